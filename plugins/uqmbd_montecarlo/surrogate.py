"""The surrogate of a control variate: where it comes from, and what the samples say beside it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array
from uqmbd_montecarlo.control import FOLDS, controlled_statistics, fold_of, variables
from uqmbd_montecarlo.jointmoments import JointMoments

__all__ = ["ControlledSums", "Surrogate", "surrogate_of"]


_ROUNDING = 32.0 * np.finfo(float).eps


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


def surrogate_of(control: uqmbd.Propagator | PolynomialChaos, problem: uqmbd.Problem) -> Surrogate:
    """Train the surrogate on realisations of its own, or take the one that is given.

    Parameters
    ----------
    control : uqmbd.Propagator or uqmbd.results.PolynomialChaos
        A propagator must give a node with a child ``chaos``.
    problem : uqmbd.Problem
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


def _check(chaos: PolynomialChaos, problem: uqmbd.Problem) -> None:
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


class ControlledSums:
    """What is kept of samples and of the surrogate beside them, in a memory that does not grow with their number.

    The surrogate is evaluated at the uniform numbers that the inputs are made of. So its expectation over the samples
    is that of its coefficients exactly, whatever distribution it was made for: one that does not fit the inputs helps
    less, but causes no bias.

    Parameters
    ----------
    chaos : uqmbd.results.PolynomialChaos
        The surrogate.
    uniform : array, shape (S, input)
        Uniform numbers of all samples.
    """

    def __init__(self, chaos: PolynomialChaos, uniform: Array) -> None:
        self._chaos, self._uniform = chaos, uniform
        self._centre, deviation = chaos.mean.ravel(), chaos.std.ravel()
        # a surrogate that does not vary controls nothing
        self._useful = deviation > _ROUNDING * np.abs(self._centre)
        self._unit = np.where(self._useful, deviation, 1.0)
        self._shift: Array | None = None
        self._folds: list[JointMoments | None] = [None] * FOLDS

    def add(self, first: int, response: Array, fine: NDArray[np.bool_]) -> None:
        """Add samples from index `first` on: responses (K, output, time), and which of them succeeded (K,)."""
        uniform = self._uniform[first : first + len(fine)]
        values = self._chaos.evaluate_germs(self._chaos.space.from_uniform(uniform)).reshape(len(fine), -1)
        surrogate = (values - self._centre) / self._unit
        found = (response.reshape(len(fine), -1) - self._centre) / self._unit
        if self._shift is None:
            # near the mean, so that no digits are lost; the estimates do not depend on it
            self._shift = found[fine].mean(axis=0) if fine.any() else np.zeros(found.shape[1])
        gathered = variables(found - self._shift, surrogate, fine)
        of_fold = fold_of(np.arange(first, first + len(fine)), len(self._uniform))
        for k in np.unique(of_fold).tolist():
            part, before = JointMoments.of(gathered[of_fold == k]), self._folds[k]
            self._folds[k] = part if before is None else before.merge(part)

    def apply(self, statistics: xr.Dataset) -> xr.Dataset:
        """Put controlled estimates of mean and deviation, and what was gained, into the statistics of the samples.

        They stay where the surrogate or the output does not vary, and the deviation where its estimate is not positive.
        """
        found = controlled_statistics([fold for fold in self._folds if fold is not None])
        mean, std = statistics["mean"].values, statistics["std"].values
        useful = self._useful.reshape(mean.shape) & (std > _ROUNDING * np.abs(mean))

        def shaped(values: Array, otherwise: Any, where: NDArray[np.bool_]) -> Array:
            return np.where(where, values.reshape(mean.shape), otherwise)

        unit, centre = self._unit, self._centre + self._unit * (0.0 if self._shift is None else self._shift)
        positive = useful & (found.variance > 0).reshape(mean.shape)
        deviation = np.sqrt(np.where(found.variance > 0, found.variance, 1.0))
        controlled_std = shaped(unit * deviation, std, positive)
        replaced = {
            "mean": shaped(centre + unit * found.mean, mean, useful),
            "std": controlled_std,
            "variance": controlled_std**2,
            "std_error_mean": shaped(unit * found.error_mean, statistics["std_error_mean"].values, useful),
            "std_error_std": shaped(
                unit * found.error_variance / (2 * deviation), statistics["std_error_std"].values, positive
            ),
        }
        note = {"comment": "of samples, with a polynomial chaos as control variate"}
        dims = statistics["mean"].dims
        reductions = {
            "variance_reduction": ("mean", shaped(found.reduction_mean, 1.0, useful)),
            "variance_reduction_std": ("standard deviation", shaped(found.reduction_variance, 1.0, positive)),
        }
        changed = {
            name: (dims, value, {**statistics[name].attrs, **({} if "error" in name else note)})
            for name, value in replaced.items()
        }
        about = "variance of the estimate without control over that with it; 1 where there is nothing to control"
        added = {
            name: (dims, value, {"long_name": f"variance reduction of the {what}", "comment": about})
            for name, (what, value) in reductions.items()
        }
        result = statistics.assign(changed | added)
        for name in ("skewness", "kurtosis", "quantile"):
            kept = statistics[name].attrs.get("comment", "")
            result[name].attrs["comment"] = f"{kept}; of the samples alone, without the control".lstrip("; ")
        return result
