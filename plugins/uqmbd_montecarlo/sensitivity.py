"""The realisations of pick-freeze, and the Sobol' indices in the statistics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array
from uqmbd_montecarlo.pickfreeze import PickFreeze, mixed_inputs

__all__ = ["SobolRun", "rows_at_once", "run_sobol"]


@dataclass(frozen=True)
class SobolRun:
    """What the indices need besides the samples.

    Attributes
    ----------
    variables : xarray.Dataset
        ``sobol_first``, ``sobol_total (input, output, time)`` and ``..._interval (bound, input, output, time)``.
    rows, dropped : int
        Rows of the design that were used, and those left out because a realisation of theirs failed.
    realisations, failures : int
        Of the first half of the samples with each input in turn from the second half.
    reason : str
        The most frequent reason of failure, or empty.
    """

    variables: xr.Dataset
    rows: int
    dropped: int
    realisations: int
    failures: int
    reason: str
    counters: dict[str, float]
    wall_time: float

    @property
    def words(self) -> str:
        """What was done, in a sentence."""
        d = len(self.variables["input"])
        text = (
            f"Jansen's estimators on {self.rows} rows of {d + 2} realisations each, with 95 % intervals of a jackknife "
            "over blocks of rows"
        )
        if self.dropped:
            text += f"; {self.dropped} further rows were left out, since a realisation of theirs failed"
        return text


def rows_at_once(rows: int, inputs: int, keep: int) -> int:
    """Return how many rows of d + 2 realisations are held at once, of which `keep` may be.

    Examples
    --------
    >>> rows_at_once(1000, 3, keep=20_000), rows_at_once(100_000, 3, keep=20_000)
    (1000, 4000)
    """
    return max(1, min(rows, keep // (inputs + 2)))


def run_sobol(
    problem: uqmbd.Problem, values: Array, responses: Callable[[int, int], Array], keep: int, max_failures: float
) -> SobolRun:
    """Compute the further realisations of pick-freeze, some rows at a time, and the indices.

    Parameters
    ----------
    problem : uqmbd.Problem
        That of the samples.
    values : array, shape (2 N, input)
        Inputs of the samples.
    responses : callable
        Responses (K, output, time) of the samples from one index to another, NaN where they failed.
    keep : int
        Realisations that are held at once.
    max_failures : float
        Share.

    Raises
    ------
    uqmbd.IntegrationError
        If too many failed.
    """
    count, dimension = len(values) // 2, len(problem.inputs)
    label = f"{problem.label}: Sobol' indices"
    checkpoint = problem.checkpoint and replace(problem.checkpoint, label=label)
    other = replace(problem, label=label, checkpoint=checkpoint)
    sums: PickFreeze | None = None
    failures, wall_time, reasons, counters = 0, 0.0, Counter[str](), dict[str, float]()
    step = rows_at_once(count, dimension, keep)
    for first in range(0, count, step):
        part = slice(first, min(first + step, count))
        found = other.realise(mixed_inputs(values[:count][part], values[count:][part]))
        mixed = found.response.reshape(dimension, -1, *problem.labels.shape)
        halves = [responses(start + part.start, start + part.stop) for start in (0, count)]
        fine = found.good.reshape(dimension, -1)
        usable = np.all([fine.all(axis=0), *(np.isfinite(x).all(axis=(1, 2)) for x in halves)], axis=0)
        rows = np.flatnonzero(usable)
        more = PickFreeze.of(first + rows, count, halves[0][rows], halves[1][rows], mixed[:, rows])
        sums = more if sums is None else sums.merge(more)
        failures += int(np.count_nonzero(~fine))
        wall_time += found.wall_time
        counters |= {name: counters.get(name, 0) + number for name, number in found.counters.items()}
        if reason := found.most_frequent_reason():
            reasons[reason] += found.failures
    used = 0 if sums is None else int(sums.rows.sum())
    reason = reasons.most_common(1)[0][0] if reasons else ""
    few = sums is None or np.count_nonzero(sums.rows) < 2
    if sums is None or few or failures > max_failures * dimension * count:
        raise uqmbd.IntegrationError(
            f"{label}: {failures} of {dimension * count} realisations failed, and {used} of {count} rows of the design "
            "are whole; rows of 2 blocks of the design are needed at least, and "
            f"max_failures = {max_failures:g} must not be exceeded. "
            f"Most frequent reason: {reason or 'an output is not finite'}"
        )
    about = used, count - used, dimension * count, failures, reason
    return SobolRun(_variables(sums, problem.labels), *about, counters, wall_time)


def _variables(sums: PickFreeze, labels: uqmbd.results.Labels) -> xr.Dataset:
    found = sums.indices()
    dims = ("input", *labels.dims)
    about = "not cut off at 0 and 1; 0 where the output does not vary"
    names = {"sobol_first": "first-order Sobol' index", "sobol_total": "total Sobol' index"}
    variables = {}
    for name, words in names.items():
        short = name.removeprefix("sobol_")
        variables[name] = (dims, getattr(found, short), {"long_name": words, "comment": about})
        ends = getattr(found, f"{short}_interval")
        variables[f"{name}_interval"] = (("bound", *dims), ends, {"long_name": f"95 % interval of the {words}"})
    coords = {"bound": ("bound", ["lower", "upper"]), **labels.input_coords(), **labels.output_coords()}
    return xr.Dataset(variables, coords=coords)
