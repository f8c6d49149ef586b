"""The realisations of pick-freeze, and the Sobol' indices in the statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

import uqmbd
from uqmbd_montecarlo.pickfreeze import mixed_inputs, pick_freeze

__all__ = ["SobolRun", "run_sobol"]


@dataclass(frozen=True)
class SobolRun:
    """What the indices need besides the samples.

    Attributes
    ----------
    mixed : uqmbd.Realisations
        The first half of the samples with each input in turn from the second half: d N rows.
    variables : xarray.Dataset
        ``sobol_first``, ``sobol_total (input, output, time)`` and ``..._interval (bound, input, output, time)``.
    rows, dropped : int
        Rows of the design that were used, and those left out because a realisation of theirs failed.
    failures : int
        Of `mixed`.
    """

    mixed: uqmbd.Realisations
    variables: xr.Dataset
    rows: int
    dropped: int
    failures: int

    @property
    def words(self) -> str:
        """What was done, in a sentence."""
        d = len(self.variables["input"])
        text = (
            f"Jansen's estimators on {self.rows} rows of {d + 2} realisations each, with 95 % intervals of a bootstrap"
        )
        if self.dropped:
            text += f"; {self.dropped} further rows were left out, since a realisation of theirs failed"
        return text


def run_sobol(problem: uqmbd.Problem, samples: uqmbd.Realisations, seed: int, max_failures: float) -> SobolRun:
    """Compute the further realisations of pick-freeze, and the indices.

    Raises
    ------
    uqmbd.IntegrationError
        If too many failed.
    """
    count, dimension = len(samples.values) // 2, len(problem.inputs)
    label = f"{problem.label}: Sobol' indices"
    checkpoint = problem.checkpoint and replace(problem.checkpoint, label=label)
    other = replace(problem, label=label, checkpoint=checkpoint)
    mixed = other.realise(mixed_inputs(samples.values[:count], samples.values[count:]))

    fine = samples.good.reshape(2, count), mixed.good.reshape(dimension, count)
    failures = int(np.count_nonzero(~fine[1]))
    usable = fine[0].all(axis=0) & fine[1].all(axis=0)
    rows = int(np.count_nonzero(usable))
    if failures > max_failures * dimension * count or rows < 2:
        raise uqmbd.IntegrationError(
            f"{label}: {failures} of {dimension * count} realisations failed, and {rows} of {count} rows of the design "
            f"are whole; at least 2 rows are needed, and max_failures = {max_failures:g} must not be exceeded. "
            f"Most frequent reason: {mixed.most_frequent_reason() or samples.most_frequent_reason()}"
        )
    halves = samples.response.reshape(2, count, *problem.labels.shape)[:, usable]
    responses = mixed.response.reshape(dimension, count, *problem.labels.shape)[:, usable]
    # the samples are of the first child of this seed
    found = pick_freeze(halves[0], halves[1], responses, np.random.SeedSequence(seed, spawn_key=(1,)))
    dims = ("input", *problem.labels.dims)
    about = "not cut off at 0 and 1; 0 where the output does not vary"
    names = {"sobol_first": "first-order Sobol' index", "sobol_total": "total Sobol' index"}
    variables = {}
    for name, words in names.items():
        short = name.removeprefix("sobol_")
        variables[name] = (dims, getattr(found, short), {"long_name": words, "comment": about})
        ends = getattr(found, f"{short}_interval")
        variables[f"{name}_interval"] = (("bound", *dims), ends, {"long_name": f"95 % interval of the {words}"})
    coords = {"bound": ("bound", ["lower", "upper"]), **problem.labels.input_coords(), **problem.labels.output_coords()}
    return SobolRun(mixed, xr.Dataset(variables, coords=coords), rows, count - rows, failures)
