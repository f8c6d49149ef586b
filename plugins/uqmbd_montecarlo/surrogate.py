"""The surrogate of a control variate: where it comes from, and its values at the samples."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace

import numpy as np

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array
from uqmbd_montecarlo.controlledsums import ROUNDING

__all__ = ["ChaosControl", "Surrogate", "surrogate_of"]


@dataclass(frozen=True)
class Surrogate:
    """A chaos, and what it cost.

    Attributes
    ----------
    chaos : uqmbd.results.PolynomialChaos
    realisations, failures : int
        Computed for it, and how many of these failed; none for a chaos that was there.
    counters : dict
        Of the solver.
    wall_time : float
        s.
    """

    chaos: PolynomialChaos
    realisations: int = 0
    failures: int = 0
    counters: dict[str, float] = field(default_factory=dict)
    wall_time: float = 0.0


def surrogate_of(control: uqmbd.extend.Propagator | PolynomialChaos, problem: uqmbd.extend.Problem) -> Surrogate:
    """Train the surrogate on realisations of its own, or take the one that is given.

    Parameters
    ----------
    control : uqmbd.extend.Propagator or uqmbd.results.PolynomialChaos
        A propagator must give a node with a child ``chaos``.
    problem : uqmbd.extend.Problem
        That of the samples.

    Raises
    ------
    uqmbd.StudyError
        If there is no chaos, or not of the same inputs, outputs and times.
    """
    if isinstance(control, PolynomialChaos):
        found = Surrogate(control)
    else:
        label = f"{problem.label}: control"
        checkpoint = problem.checkpoint and replace(problem.checkpoint, label=label)
        node = control.propagate(replace(problem, label=label, checkpoint=checkpoint))
        if "chaos" not in node.children:
            raise uqmbd.StudyError(
                f"{problem.label}: the control {control.name!r} gives no polynomial chaos; "
                "take a propagator that does, e.g. Collocation(order=3)."
            )
        counters = json.loads(node.attrs["solver_counters"])
        found = Surrogate(
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
                f"{problem.label}: the control's {what} are {', '.join(given)}; expected those of the study, "
                f"{', '.join(wanted)}, in this order."
            )
    times = chaos.labels.times
    if times is None or not np.array_equal(times, problem.times):
        raise uqmbd.StudyError(
            f"{problem.label}: the control has other times than the study; make it for the same times."
        )


class ChaosControl:
    """A chaos beside samples.

    It is evaluated at the uniform numbers that the inputs are made of. So its expectation over the samples is that of
    its coefficients exactly, whatever distribution it was made for: one that does not fit the inputs helps less, but
    causes no bias.

    Parameters
    ----------
    chaos : uqmbd.results.PolynomialChaos
        The surrogate.
    uniform : array, shape (S, input)
        Uniform numbers of all samples.
    """

    words = "a polynomial chaos"

    def __init__(self, chaos: PolynomialChaos, uniform: Array) -> None:
        self._chaos, self._uniform = chaos, uniform
        self.centre, deviation = chaos.mean.ravel(), chaos.std.ravel()
        # a surrogate that does not vary controls nothing
        self.useful = np.asarray(deviation > ROUNDING * np.abs(self.centre))
        self.unit = np.where(self.useful, deviation, 1.0)

    def standardised(self, first: int, count: int) -> Array:
        """Return it at samples from index `first` on, less its expectation, over its deviation (count, C)."""
        uniform = self._uniform[first : first + count]
        values = self._chaos.evaluate_germs(self._chaos.space.from_uniform(uniform)).reshape(count, -1)
        return np.asarray((values - self.centre) / self.unit)
