"""Realisations of the pick-freeze method, and Sobol' indices in the statistics."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array, Index
from uqmbd_montecarlo.pickfreeze import PickFreeze, SobolIndices, mixed_inputs

__all__ = ["SobolRun", "group_count", "rows_at_once", "run_sobol"]


@dataclass(frozen=True)
class SobolRun:
    """Sobol' indices, and their further realisations."""

    variables: xr.Dataset
    """``sobol_first``, ``sobol_total (input, output, time)`` and ``..._interval (bound, input, output, time)``."""
    rows: int  # number of rows of the design in the estimates
    dropped: int  # number of rows that are omitted because one of their realisations failed
    realisations: int  # number of further realisations: first halves with one input from second halves
    failures: int  # number of failed further realisations
    reason: str  # most frequent reason of failure; an empty text if none failed
    counters: dict[str, float]
    wall_time: float
    replicates: int = 0
    """Number of replicates of a design with dependent points."""
    groups: int = 0  # number of inputs or groups of inputs with indices
    without: Mapping[str, str] = field(default_factory=dict)
    """Reasons of outputs without indices, by name."""

    @property
    def words(self) -> str:
        """Description of the computation in a sentence."""
        d = self.groups
        if not self.rows:
            return f"no Sobol' indices: {next(iter(self.without.values()))}"
        blocks = f"the {self.replicates} replicates of the design" if self.replicates else "blocks of rows"
        text = (
            f"Jansen's estimators on {self.rows} rows of {d + 2} realisations each, with 95 % intervals from a "
            f"jackknife over {blocks}"
        )
        if self.dropped:
            text += f"; {self.dropped} further rows with failed realisations were omitted"
        return text


def rows_at_once(rows: int, inputs: int, keep: int) -> int:
    """Return the number of rows in memory at once; their realisations, d + 2 for each row, are at most `keep`.

    >>> rows_at_once(1000, 3, keep=20_000), rows_at_once(100_000, 3, keep=20_000)
    (1000, 4000)
    """
    return max(1, min(rows, keep // (inputs + 2)))


def run_sobol(
    problem: uqmbd.extend.Problem,
    values: Array,
    pairs: tuple[Index, Index],
    responses: Callable[[int, int], Array],
    keep: int,
    max_failures: float,
    replicates: int = 0,
) -> SobolRun:
    """Compute the further realisations of pick-freeze, at most `keep` at a time, and return the Sobol' indices.

    `values` (2 N, input): inputs of the samples; `pairs`: indices (N,) of both halves of each pair; `responses`:
    function that returns responses (K, output, time) of consecutive samples, NaN for failed ones; `replicates`: number
    of equal, mutually independent parts of the pairs, 0 if all pairs are independent. An output that does not occur in
    some realisations has no indices (NaN, with the reason). Under the condition that the output occurs, inputs are
    dependent, so shares of its variance do not add up. Pick-freeze changes a single input, so the changed inputs can be
    outside the region in which the output occurs. Raise IntegrationError if the share of failures exceeds
    `max_failures`.
    """
    count = len(values) // 2
    groups = _groups(problem.inputs)
    dimension = len(groups)
    names, nothing = [output.name for output in problem.labels.outputs], (0, count, 0, 0, "", dict[str, float](), 0.0)
    late = Counter(problem.runner.observed.missing)
    if any(late.values()):
        # if an output does not occur in some realisations, no output of this request gets indices; the caller requests
        # the outputs that always occur again, without the others
        beside = dict.fromkeys(names, "another output of the same computation does not occur in some realisations")
        without = beside | _reasons({names[k]: late[k] for k in late}, problem.runner.observed.counted)
        unknown = np.full((2, dimension, *problem.labels.shape), np.nan)
        indices = SobolIndices(*[unknown[0]] * 3, *[unknown] * 3, varies=True)
        return SobolRun(_variables(indices, problem, without), *nothing, replicates, dimension, without)
    first, second = pairs
    # these realisations are not samples of the inputs, so they do not enter the counts of missing outputs
    other = problem.part(f"{problem.label}: Sobol' indices")
    sums: PickFreeze | None = None
    failures, wall_time, reasons, counters = 0, 0.0, Counter[str](), dict[str, float]()
    step = rows_at_once(count, dimension, keep)
    for start in range(0, count, step):
        part = slice(start, min(start + step, count))
        found = other.realise(mixed_inputs(values[first[part]], values[second[part]], groups))
        halves = [_at(responses, where[part]) for where in (first, second)]
        censored = found.status == Status.CENSORED
        fine = (found.good | censored).reshape(dimension, -1)
        # outputs that do not occur need no further message
        given = np.where(censored[:, None, None] & np.isnan(found.response), 0.0, found.response)
        mixed = given.reshape(dimension, -1, *problem.labels.shape)
        usable = np.all([fine.all(axis=0), *(np.isfinite(x).all(axis=(1, 2)) for x in halves)], axis=0)
        rows = np.flatnonzero(usable)
        blocks = replicates or None
        more = PickFreeze.of(start + rows, count, halves[0][rows], halves[1][rows], mixed[:, rows], blocks)
        sums = more if sums is None else sums.merge(more)
        failures += int(np.count_nonzero(~fine))
        wall_time += found.wall_time
        counters |= {name: counters.get(name, 0) + number for name, number in found.counters.items()}
        if reason := found.most_frequent_reason():
            reasons[reason] += found.failures
    problem.runner.observed.counters.update(other.runner.observed.counters)
    late = other.runner.observed.missing
    used = 0 if sums is None else int(sums.rows.sum())
    reason = reasons.most_common(1)[0][0] if reasons else ""
    few = sums is None or np.count_nonzero(sums.rows) < 2
    if sums is None or few or failures > max_failures * dimension * count:
        raise uqmbd.IntegrationError(
            f"{other.label}: {failures} of {dimension * count} realisations failed, and {used} of {count} rows of "
            "the pick-freeze design are complete. Expected complete rows in at least 2 blocks, and a share of "
            f"failures of at most max_failures = {max_failures:g}. Most frequent reason: "
            f"{reason or 'an output is not finite'}"
        )
    without = _reasons({names[k]: late[k] for k in late}, dimension * count)
    about = used, count - used, dimension * count, failures, reason
    variables = _variables(sums.indices(), problem, without)
    return SobolRun(variables, *about, counters, wall_time, replicates, dimension, without)


def _reasons(missing: Mapping[str, int], of: int) -> dict[str, str]:
    """Return the reasons of missing indices for outputs that do not occur in some realisations."""
    return {
        name: (f"it does not occur in {number} of {of} realisations; given that it occurs, the inputs are dependent")
        for name, number in missing.items()
        if number
    }


def _at(responses: Callable[[int, int], Array], places: Index) -> Array:
    """Return responses at ascending indices (K,); each call requests consecutive samples."""
    runs = np.split(places, np.flatnonzero(np.diff(places) != 1) + 1)
    return np.concatenate([responses(int(run[0]), int(run[-1]) + 1) for run in runs])


def _groups(inputs: uqmbd.extend.JointInput) -> list[list[int]]:
    """Return the groups of inputs with indices: each input, then the keys of all sampled paths if there are several."""
    keys = _keys(inputs)
    return [[k] for k in range(len(inputs))] + ([keys] if 1 < len(keys) < len(inputs) else [])


def group_count(inputs: uqmbd.extend.JointInput) -> int:
    """Return the number of groups of inputs with indices."""
    return len(_groups(inputs))


def _keys(inputs: uqmbd.extend.JointInput) -> list[int]:
    return [k for k, variable in enumerate(inputs.variables) if variable.is_key]


def _variables(found: SobolIndices, problem: uqmbd.extend.Problem, without: Mapping[str, str]) -> xr.Dataset:
    labels, count, keys = problem.labels, len(problem.inputs), _keys(problem.inputs)
    # the last group contains all keys; a single key is the group
    paths = found.part(slice(keys[0], keys[0] + 1) if len(keys) == 1 else slice(count, None))
    found = found.part(slice(count))
    dims = ("input", *labels.dims)
    about = zero = "not cut off at 0 and 1; 0 where the output does not vary"
    names = {"sobol_first": "first-order Sobol' index", "sobol_total": "total Sobol' index"}
    variables = {}
    for name, words in names.items():
        short = name.removeprefix("sobol_")
        variables[name] = (dims, getattr(found, short), {"long_name": words, "comment": about})
        ends = getattr(found, f"{short}_interval")
        variables[f"{name}_interval"] = (("bound", *dims), ends, {"long_name": f"95 % interval of the {words}"})
    coords = {"bound": ("bound", ["lower", "upper"]), **labels.input_coords(), **labels.output_coords()}
    if 0 < len(keys) < count:
        coords["origin"] = ("origin", ["parameters", "paths", "both"])
        about = "of the variance: due to parameters alone, sampled paths alone, and interactions of both"
        alone, reach = (np.where(paths.varies, 1.0 - x, 0.0) for x in (paths.total, paths.total_interval[::-1]))
        shares = np.concatenate([alone, paths.first, paths.shared])
        ends = np.concatenate([reach, paths.first_interval, paths.shared_interval], axis=1)
        split = ("origin", *labels.dims)
        variables["variance_share"] = (split, shares, {"long_name": f"share {about}", "comment": zero})
        about = f"95 % interval of the share {about}"
        variables["variance_share_interval"] = (("bound", *split), ends, {"long_name": about})
    data = xr.Dataset(variables, coords=coords)
    if not without:
        return data
    known, unknown = ~data["output"].isin(list(without)), json.dumps(dict(without))
    return data.assign(
        {
            name: x.where(known).transpose(*x.dims).assign_attrs(x.attrs, unknown=unknown)
            for name, x in data.data_vars.items()
        }
    )
