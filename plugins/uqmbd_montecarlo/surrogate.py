"""Surrogate of a control variate: its training, and its values at the samples."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array
from uqmbd_montecarlo.controlledsums import ROUNDING

__all__ = ["ChaosControl", "ControlSurrogate", "no_surrogate", "surrogate_of"]


@dataclass(frozen=True)
class ControlSurrogate:
    """Polynomial chaos, and its cost."""

    chaos: PolynomialChaos
    realisations: int = 0  # number of training realisations; 0 for a given chaos
    failures: int = 0  # number of failures among the training realisations
    counters: dict[str, float] = field(default_factory=dict)  # solver counters, by name
    wall_time: float = 0.0  # s


def surrogate_of(control: uqmbd.extend.Propagator | PolynomialChaos, problem: uqmbd.extend.Problem) -> ControlSurrogate:
    """Return the given surrogate, or train one on separate realisations.

    A propagator must return a node with a child ``chaos``. Raise StudyError if this child is missing, or if inputs,
    outputs or times of surrogate and study differ.
    """
    if isinstance(control, PolynomialChaos):
        found = ControlSurrogate(control)
    else:
        node = control.propagate(problem.part(f"{problem.label}: control").using(observed=problem.runner.observed))
        if "chaos" not in node.children:
            raise uqmbd.StudyError(
                f"{problem.label}: the control {control.name!r} computes no polynomial chaos; use a propagator that "
                "does, e.g. Collocation(order=3)."
            )
        counters = json.loads(node.attrs["solver_counters"])
        found = ControlSurrogate(
            PolynomialChaos.from_dataset(node.children["chaos"]),
            int(node.attrs["realisations"]),
            int(node.attrs["failures"]),
            {name: number for name, number in counters.items() if isinstance(number, (int, float))},
            float(node.attrs["wall_time"]),
        )
    _check(found.chaos, problem)
    return found


def _check(chaos: PolynomialChaos, problem: uqmbd.extend.Problem) -> None:
    for what, given, wanted in (
        ("inputs", tuple(i.name for i in chaos.labels.inputs), problem.inputs.names),
        ("outputs", tuple(o.name for o in chaos.labels.outputs), tuple(o.name for o in problem.labels.outputs)),
    ):
        if given != wanted:
            raise uqmbd.StudyError(
                f"{problem.label}: the {what} of the control are {', '.join(given)}; expected those of the study, "
                f"{', '.join(wanted)}, in this order."
            )
    times = chaos.labels.times
    if times is None or not np.array_equal(times, problem.times):
        raise uqmbd.StudyError(
            f"{problem.label}: the output times of the control differ from those of the study; "
            "expected equal output times."
        )


class ChaosControl:
    """Polynomial chaos at the uniform numbers (S, input) of samples, as a control variate.

    The chaos maps uniform numbers to its own germs. The expectation of the chaos therefore follows exactly from its
    coefficients, for any distribution. If the distributions of the chaos differ from the distributions of the inputs,
    the variance is reduced less, but there is no bias.
    """

    words = "a polynomial chaos"

    def __init__(self, chaos: PolynomialChaos, uniform: Array) -> None:
        self._chaos, self._uniform = chaos, uniform
        self.centre, deviation = chaos.mean.ravel(), chaos.std.ravel()
        # a constant surrogate is not a useful control
        self.useful = np.asarray(deviation > ROUNDING * np.abs(self.centre))
        self.unit = np.where(self.useful, deviation, 1.0)

    def standardised(self, first: int, count: int) -> Array:
        """Return standardised values (count, C) of the surrogate at `count` samples from index `first` on.

        Each value minus its expectation is divided by its standard deviation. C is the number of outputs times the
        number of times.
        """
        uniform = self._uniform[first : first + count]
        values = self._chaos.evaluate_germs(self._chaos.space.from_uniform(uniform)).reshape(count, -1)
        return np.asarray((values - self.centre) / self.unit)


def no_surrogate(control: Any, inputs: uqmbd.extend.JointInput) -> str | None:
    """Return the reason why a surrogate cannot be the control: the outputs depend on sampled paths; None if it can."""
    keys = [variable.name for variable in inputs.variables if variable.is_key]
    if not keys or not isinstance(control, (uqmbd.extend.Propagator, PolynomialChaos)):
        return None
    return (
        f"control is {control!r}, but no surrogate exists for outputs that depend on sampled paths of {keys[0]!r}; "
        "omit control, or use LowFidelity(...) with a less expensive study of the same processes"
    )
