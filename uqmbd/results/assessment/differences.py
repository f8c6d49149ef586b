"""Compare each method with a reference method, test their agreement within errors, and recommend a method."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, Share, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.accuracy import accuracies, stated_accuracy
from uqmbd.results.assessment.distances import distributions
from uqmbd.results.assessment.error_sentences import own_statements
from uqmbd.results.assessment.limits import COARSE, ROUGH
from uqmbd.results.assessment.own_errors import OwnError, own_error, root_mean_square
from uqmbd.results.assessment.recommendation import advice, loose
from uqmbd.results.assessment.verdicts import NO_SPREAD, REFERENCE, Verdict, compare_with_reference
from uqmbd.results.schema import total_realisations
from uqmbd.results.statistics import over_time, relative, rtol_of
from uqmbd.typing import Array

__all__ = ["choose_reference", "compare"]


LEVEL = 0.05
"""Largest probability that agreeing methods are reported to differ, for all outputs, times and methods together."""

TOLERANCE = 1e-3
"""Differences below this fraction of the largest standard deviation are ignored."""

ROUNDING = 1e-9
"""Differences below this fraction of the largest mean are ignored."""


@typechecked
def choose_reference(nodes: Mapping[str, xr.DataTree], *, rtol: Annotated[float, Bounds(0)] = 0.0) -> str:
    """Choose the reference method: the most converged one that states its convergence.

    Methods are ranked in this order: samples with a standard deviation known to within 15 %, whose standard errors are
    valid for any mechanism; methods without samples with a stated error of at most 10 %; other methods with a stated
    error; methods without a stated error. A method without samples, such as a chaos of order 0, ranks below all these
    if it misses a variation: an output is constant in this method, but varies in another method. The other method is
    ignored if its stated error of the output exceeds 10 %. Methods with unknown results at some times, such as results
    that end early, come last. Methods of equal rank are ordered by the smallest own error, then by the largest number
    of successful realisations, then by the given order.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label; at least one.
    rtol : float
        Relative tolerance of the integration; 0 if unknown.

    Returns
    -------
    str
        Label of the reference. Outputs that do not vary are ignored.

    Raises
    ------
    StudyError
        If there are no nodes.

    Examples
    --------
    >>> choose_reference({})
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A comparison needs the result of at least one propagator; no result is given.
    """
    return _most_reliable(nodes, {label: own_error(node, max(rtol, rtol_of(node))) for label, node in nodes.items()})


def _most_reliable(nodes: Mapping[str, xr.DataTree], own: Mapping[str, OwnError]) -> str:
    """Return the label of the reference, chosen by the stated errors of the methods."""
    if not nodes:
        raise StudyError("A comparison needs the result of at least one propagator; no result is given.")
    if len(nodes) == 1:
        return next(iter(nodes))
    names = {label: node.children["statistics"].to_dataset()["output"].values.tolist() for label, node in nodes.items()}
    known = {label: one.varies & ~(one.stated > COARSE) for label, one in own.items()}
    spread = {name for label in nodes for name, varies in zip(names[label], known[label], strict=True) if varies}

    def rank_of(label: str) -> tuple[bool, bool, int, float, int]:
        node = nodes[label]
        found, times = own[label], _times(node.children["statistics"].to_dataset())
        resolves = bool(found.samples) or all(
            varies for name, varies in zip(names[label], found.varies, strict=True) if name in spread
        )
        fine = np.asarray((np.isfinite(found.std) & np.isfinite(found.mean)).all(axis=0))
        whole = bool(fine.all())
        error = float(found.isel(fine).relative(times[fine]).max(initial=0.0)) if fine.any() else np.inf
        states = np.isfinite(error)
        good = states and error <= ROUGH if found.samples else bool((found.stated <= COARSE).all())
        rank = (3 if found.samples else 2) if good else int(states)
        count = int(node.attrs.get("realisations", 0)) - int(node.attrs.get("failures", 0))
        return whole, resolves, rank, -error, count

    return max(nodes, key=rank_of)


@typechecked
def compare(
    nodes: Mapping[str, xr.DataTree] | Iterable[xr.DataTree],
    reference: str | None = None,
    *,
    level: Share = LEVEL,
    tolerance: Annotated[float, Bounds(0)] = TOLERANCE,
    rtol: Annotated[float, Bounds(0)] = 0.0,
) -> xr.Dataset:
    """Compare every method with a reference.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree, or iterable of nodes
        Propagator nodes by label, with the same outputs and times.
    reference : str, optional
        Label of the reference. Default: the method from :func:`choose_reference`.
    level : float
        Largest probability of reporting a difference between methods that agree, for all outputs, times and methods
        together.
    tolerance : float
        Differences below this fraction of the largest standard deviation of an output are ignored.
    rtol : float
        Relative tolerance of the integration. Differences below ten times this value, relative to the largest mean, are
        ignored.

    Returns
    -------
    xarray.Dataset
        Dataset with the dimensions ``method`` and ``output``, in the units of the outputs:

        ``mean_difference_max``, ``std_difference_max``: largest absolute difference over time. ``mean_difference_l2``,
        ``std_difference_l2``: root mean square difference over time (trapezoidal). ``mean_relative_l2``,
        ``std_relative_l2``: the same, relative to the mean or standard deviation of the reference.
        ``quantile_difference_max``: largest difference of quantiles, over times and probabilities. ``reference_std_max
        (output)``: scale for these numbers.

        ``verdict``: statement on the output, the worst finding first. The output differs from the reference beyond both
        stated errors; the method is under-resolved or has too few samples; or it agrees, with its own stated error.
        ``verdict_kind``: ``reference``, ``agrees``, ``differs``, ``under-resolved``, ``too few samples``, ``not
        verified`` (the reference is too inaccurate) or ``no spread``. An output without spread does not vary beyond the
        integration error, and is ignored. ``detectable``: smallest difference of standard deviations that is detected.
        ``own_error``: bound of the error of the standard deviation, as root mean square over time.
        ``stated_error_max``: largest stated error over time, at
        ``stated_error_time`` (s). The three errors are relative to the standard deviation. ``own_error`` and
        ``stated_error_max`` are infinite if no error is stated.
        The denominator of the largest stated error is at least 1 % of the largest standard deviation over time.
        ``stated_error_floored``: whether an error divided by the standard deviation at its time, without this lower
        limit, would exceed the largest stated error. ``verdict`` then states the limit.

        ``wasserstein`` (in units) and ``ks``, ``(method, output, comparison_time)``: distances of the distributions,
        from samples or from 4096 samples of a chaos; NaN if a method has neither. ``ks_by_chance (method)``: value of
        ``ks`` that equal distributions exceed with the probability `level`.

        ``unknown_times``: number of times at which a method does not know the mean or standard deviation of an output.
        A method with such times is not recommended. ``wall_time`` (s), ``realisations`` and ``failures`` by method;
        ``realisations`` includes realisations that a method computes only for scalar outputs or requirements;
        ``solver_counters (method, counter)``. If the results of a method or of the reference end before the last time,
        differences are over the common times. ``compared_until`` (s, by method) is the last common time. Without a
        common time, ``compared_until`` and the differences are NaN.

        The attribute ``reference`` names the reference, whose differences are 0. The attribute ``recommendation`` names
        the method to use. A single method has no distances, counters, or recommendation. Select with ``.sel({"method":
        label})``, because ``method=`` has another meaning in ``sel`` of xarray.

    Raises
    ------
    StudyError
        If there are no nodes, the reference is unknown, or outputs or times differ.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, mean):
    ...     statistics = statistics_dataset(axes, mean=[mean], std=[[0.0, 0.1]])
    ...     return propagator_node(label, statistics, propagator="p", realisations=9, wall_time=1.0)
    >>> found = compare({"a": node("a", [0.0, 1.0]), "b": node("b", [0.0, 1.5])})
    >>> found.attrs["reference"], found["mean_difference_max"].sel({"method": "b"}).values.tolist()
    ('a', [0.5])
    >>> found["verdict"].sel({"method": "b"}).item()
    'differs: mean shifted by 0.5 (500 % of the largest standard deviation) at t = 1 s'
    >>> found["verdict"].sel({"method": "a"}).item()
    'states no error; the reference'
    """
    if not isinstance(nodes, Mapping):
        nodes = {str(node.attrs.get("label", node.name)): node for node in nodes}
    if reference is not None and reference not in nodes:
        raise StudyError(f"The reference is {reference!r}; expected one of the methods {', '.join(map(repr, nodes))}.")
    errors = {label: own_error(node, max(rtol, rtol_of(node))) for label, node in nodes.items()}
    chosen = _most_reliable(nodes, errors) if reference is None else reference
    requested = {label: float(node.attrs.get("requested_accuracy", 0.0)) for label, node in nodes.items()}
    # outputs that reach the requested accuracy of their method have no limit of the stated error
    coarse = {k: np.where(accuracies(nodes[k], one) <= requested[k], np.inf, COARSE) for k, one in errors.items()}
    base = nodes[chosen].children["statistics"].to_dataset()
    times, timed = _times(base), "time" in base.variables["mean"].dims
    units = [str(u) for u in base.variables["output_units"].values]
    own = {label: own_statements(node, errors[label]) for label, node in nodes.items()}
    columns: dict[str, list[Any]] = {}
    until: list[float] = []
    unknown: list[int] = []
    verdicts: list[list[Verdict]] = []
    for label, node in nodes.items():
        statistics = base if label == chosen else node.children["statistics"].to_dataset()
        _check_same_axes(label, statistics, chosen, base)
        both = [
            (name, over_time(statistics.variables[name].values), over_time(base.variables[name].values))
            for name in ("mean", "std")
        ]
        differences = {name: np.abs(a - b) for name, a, b in both}
        common = np.all([np.isfinite(d).all(axis=0) for d in differences.values()], axis=0)
        unknown.append(int((~np.isfinite(np.concatenate([a for _, a, _ in both]))).any(axis=0).sum()))
        until.append(float(times[common].max(initial=-np.inf)) if common.any() else np.nan)
        for name, _, expected in both:
            known = differences[name][:, common]
            l2, scale = (root_mean_square(v, times[common]) for v in (known, expected[:, common]))
            columns.setdefault(f"{name}_difference_max", []).append(_largest(known))
            columns.setdefault(f"{name}_difference_l2", []).append(l2)
            columns.setdefault(f"{name}_relative_l2", []).append(relative(l2, scale, np.inf))
        columns.setdefault("quantile_difference_max", []).append(_quantile_differences(statistics, base))
        mine, other = (errors[name].isel(common) for name in (label, chosen))
        columns.setdefault("own_error", []).append(mine.relative(times[common]))
        largest, at = errors[label].largest(times if timed else None)
        columns.setdefault("stated_error_max", []).append(largest)
        columns.setdefault("stated_error_time", []).append(at)
        columns.setdefault("stated_error_floored", []).append(errors[label].floored())
        floor = np.maximum(
            tolerance * np.nan_to_num(_largest(other.std)),
            (10 * rtol + ROUNDING) * np.nan_to_num(_largest(np.abs(other.mean))),
        )
        share = level / max(len(nodes) - 1, 1)
        verdicts.append(
            _of_reference(errors[label].varies, own[label], alone=len(nodes) < 2)
            if label == chosen
            else compare_with_reference(
                mine,
                other,
                times[common],
                units,
                level=share,
                floor=floor,
                names=(label, chosen),
                own=own[label],
                coarse=(coarse[label], coarse[chosen]),
            )
        )
    columns["detectable"] = [np.array([v.within for v in row]) for row in verdicts]
    columns["verdict_kind"] = [np.array([v.kind for v in row], dtype=np.str_) for row in verdicts]
    columns["verdict"] = [np.array([v.text for v in row], dtype=np.str_) for row in verdicts]
    variables = {
        name: (("method", "output"), np.stack(rows), {"comment": _COMMENTS[name.split("_", 1)[1]]})
        if name.split("_", 1)[-1] in _COMMENTS
        else (("method", "output"), np.stack(rows))
        for name, rows in columns.items()
    }
    attributes, spread = [node.attrs for node in nodes.values()], over_time(base.variables["std"].values)
    found = xr.Dataset(
        {
            **variables,
            "reference_std_max": ("output", _largest(spread[:, np.isfinite(spread).all(axis=0)])),
            **({"compared_until": ("method", np.array(until, dtype=float), _LAST)} if timed else {}),
            "unknown_times": ("method", np.array(unknown, dtype=np.int64)),
            "wall_time": (
                "method",
                np.array([float(a.get("method_wall_time", a.get("wall_time", np.nan))) for a in attributes]),
                {"units": "s"},
            ),
            "realisations": ("method", np.array([total_realisations(x) for x in nodes.values()], dtype=np.int64)),
            "failures": ("method", np.array([int(a.get("failures", 0)) for a in attributes], dtype=np.int64)),
        },
        coords={
            "method": ("method", np.array(list(nodes), dtype=np.str_)),
            "output": ("output", base.variables["output"].values),
            "output_units": ("output", base.variables["output_units"].values),
        },
        attrs={"reference": chosen, "level": level, "tolerance": tolerance},
    )
    if len(nodes) < 2:
        return found
    found = found.assign(_counters(attributes)).assign(distributions(nodes, chosen, times, errors[chosen], level))
    large = errors[chosen].stated > coarse[chosen]
    if poor := base["output"].values[large].tolist():
        remedies = dict.fromkeys(errors[chosen].words[o][1] for o in np.flatnonzero(large))
        found = found.assign_attrs(
            reference_under_resolved=json.dumps(poor, ensure_ascii=False),
            reference_remedy="; ".join(filter(None, remedies)),
        )
    if accuracy := max(requested.values(), default=0.0):
        values = [stated_accuracy(node, rtol=max(rtol, rtol_of(node))).value for node in nodes.values()]
        found = found.assign(stated_accuracy=("method", np.array(values)))
        found = found.assign_attrs(requested_accuracy=accuracy, reference_sampled=int(errors[chosen].drawn))
    use, sentences = advice(found)
    return found.assign_attrs(
        recommendation="\n".join((*loose(nodes), *sentences)),
        recommended=json.dumps(use, ensure_ascii=False),
    )


_LAST = {"units": "s", "long_name": "last time of the comparison"}

_COMMENTS = {
    "difference_max": "largest absolute difference over time",
    "difference_l2": "root mean square of the difference over time",
    "relative_l2": "root mean square over time of the difference, divided by the root mean square of the reference",
}


def _of_reference(varies: NDArray[np.bool_], own: list[str], *, alone: bool) -> list[Verdict]:
    """Return verdicts on the reference, or on the only method, from its own statements."""
    found = []
    for moves, text in zip(varies, own, strict=True):
        role = "" if alone or not moves else "; the reference"
        found.append(Verdict(REFERENCE if moves else NO_SPREAD, f"{text}{role}", 0.0))
    return found


def _quantile_differences(found: xr.Dataset, base: xr.Dataset) -> Array:
    """Return the largest difference of quantiles (O,) at common probabilities and times; NaN if there are none."""
    unknown = np.full(base.sizes["output"], np.nan)
    if "quantile" not in found or "quantile" not in base:
        return unknown
    if found is base:
        known = np.isfinite(base.variables["quantile"].transpose("output", ...).values).reshape(len(unknown), -1)
        return np.where(known.any(axis=1), 0.0, np.nan)
    shared = np.intersect1d(found["probability"].values, base["probability"].values)
    if not len(shared):
        return unknown
    one, other = (d["quantile"].sel(probability=shared).transpose("output", ...).values for d in (found, base))
    difference = np.abs(one - other).reshape(len(unknown), -1)
    known = np.isfinite(difference)
    return np.where(known.any(axis=1), np.where(known, difference, -np.inf).max(axis=1, initial=-np.inf), np.nan)


def _times(statistics: xr.Dataset) -> Array:
    timed = "time" in statistics.variables["mean"].dims
    return np.asarray(statistics.variables["time"].values, dtype=float) if timed else np.zeros(1)


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the maximum of each row; NaN for empty rows."""
    return np.asarray(values.max(axis=1) if values.shape[1] else np.full(len(values), np.nan), dtype=float)


def _check_same_axes(label: str, found: xr.Dataset, reference: str, expected: xr.Dataset) -> None:
    if found is expected:
        return
    if found["output"].values.tolist() != expected["output"].values.tolist():
        raise StudyError(
            f"Only results with the same outputs can be compared: {label!r} has {found['output'].values.tolist()}, "
            f"{reference!r} has {expected['output'].values.tolist()}."
        )
    same_dims = found["mean"].dims == expected["mean"].dims
    if not same_dims or ("time" in found.dims and not np.array_equal(found["time"], expected["time"])):
        raise StudyError(
            f"Only results at the same times can be compared: the times of {label!r} and {reference!r} differ."
        )


def _counters(attributes: list[dict[Any, Any]]) -> dict[str, Any]:
    """Return the solver counters of all methods, NaN for missing counters."""
    rows: list[dict[str, float]] = []
    for attrs in attributes:
        try:
            counted = dict(json.loads(attrs.get("solver_counters", "{}")))
        except (TypeError, ValueError):
            counted = {}
        rows.append({str(k): float(v) for k, v in counted.items() if isinstance(v, (int, float))})
    names = list(dict.fromkeys(name for row in rows for name in row))
    if not names:
        return {}
    values = np.array([[row.get(name, np.nan) for name in names] for row in rows])
    coordinate = xr.DataArray(np.array(names, dtype=np.str_), dims="counter")
    return {"counter": coordinate, "solver_counters": (("method", "counter"), values)}
