"""Distance of each method from a reference method, their agreement within errors, and the recommended one."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, Share, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.distances import distributions
from uqmbd.results.assessment.limits import COARSE, ROUGH
from uqmbd.results.assessment.own_errors import OwnError, own_error, own_statements, root_mean_square
from uqmbd.results.assessment.recommendation import advice, loose
from uqmbd.results.assessment.verdicts import NO_SPREAD, REFERENCE, Verdict, compare_with_reference
from uqmbd.results.statistics import over_time, relative, rtol_of
from uqmbd.typing import Array

__all__ = ["choose_reference", "compare"]


LEVEL = 0.05
"""Largest probability that methods that agree are reported to differ, over all outputs, times and methods together."""

TOLERANCE = 1e-3
"""Differences below this part of the largest standard deviation count for nothing."""

ROUNDING = 1e-9
"""The same relative to the largest mean, and in tolerances of the integration."""


@typechecked
def choose_reference(nodes: Mapping[str, xr.DataTree], *, rtol: Annotated[float, Bounds(0)] = 0.0) -> str:
    """Choose the reference method: the most converged one that states its convergence.

    Methods whose results end before the last time come last. Before them come surrogates, such as a chaos of order 0,
    in which an output has no spread although others give one. Those whose stated error is above 10 % are exempt. First
    come samples that tell the standard deviation to within 15 %, for their standard errors hold whatever the mechanism;
    then surrogates whose stated error is below 10 %; then others that state an error; then those that state none. Among
    equals the one of the least own error, the one with the most successful realisations, and the one that was given
    first.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        The propagator nodes by label; not empty.
    rtol : float
        Tolerance of the integration, 0 where it is not known.

    Returns
    -------
    str
        A label.  Outputs that do not vary count for nothing.

    Raises
    ------
    StudyError
        If there is no node.

    Examples
    --------
    >>> choose_reference({})
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A comparison needs the result of at least one propagator; there is none.
    """
    return _most_reliable(nodes, {label: own_error(node, max(rtol, rtol_of(node))) for label, node in nodes.items()})


def _most_reliable(nodes: Mapping[str, xr.DataTree], own: Mapping[str, OwnError]) -> str:
    """Return the label of the reference, by the errors that methods state."""
    if not nodes:
        raise StudyError("A comparison needs the result of at least one propagator; there is none.")
    if len(nodes) == 1:
        return next(iter(nodes))
    names = {label: node.children["statistics"].to_dataset()["output"].values.tolist() for label, node in nodes.items()}
    known = {label: one.varies & ~(one.stated > COARSE) for label, one in own.items()}
    spread = {name for label in nodes for name, varies in zip(names[label], known[label], strict=True) if varies}

    def trust(label: str) -> tuple[bool, bool, int, float, int]:
        node = nodes[label]
        found, times = own[label], _times(node.children["statistics"].to_dataset())
        sees = bool(found.samples) or all(
            varies for name, varies in zip(names[label], found.varies, strict=True) if name in spread
        )
        fine = np.asarray((np.isfinite(found.std) & np.isfinite(found.mean)).all(axis=0))
        whole = bool(fine.all())
        error = float(found.isel(fine).relative(times[fine]).max(initial=0.0)) if fine.any() else np.inf
        states = np.isfinite(error)
        good = states and error <= ROUGH if found.samples else bool((found.stated <= COARSE).all())
        rank = (3 if found.samples else 2) if good else int(states)
        count = int(node.attrs.get("realisations", 0)) - int(node.attrs.get("failures", 0))
        return whole, sees, rank, -error, count

    return max(nodes, key=trust)


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
        Label of the reference; default :func:`choose_reference`.
    level : float
        Largest probability that methods that agree are reported to differ, in any output at any time of any method.
    tolerance : float
        Differences below this part of the largest standard deviation of an output count for nothing.
    rtol : float
        Of the integration: differences of ten times as much, relative to the largest mean, count for nothing.

    Returns
    -------
    xarray.Dataset
        With the dimensions ``method`` and ``output``, in the units of the outputs: ``mean_difference_max`` and
        ``std_difference_max``, the largest absolute difference over time, and ``mean_difference_l2`` and
        ``std_difference_l2``, its root mean square over time (trapezoidal); ``mean_relative_l2`` and
        ``std_relative_l2``, the latter over that of the reference itself; ``quantile_difference_max``, over times and
        probabilities. ``reference_std_max (output)`` is a scale for them.

        ``verdict`` is the one statement on an output, what is worst first: the output differs from the reference beyond
        both stated errors; the method is under-resolved or has too few samples; or it agrees, with its own stated
        error. ``verdict_kind`` says it in a word: ``reference``, ``agrees``, ``differs``, ``under-resolved``, ``too few
        samples`` or ``no spread``, which counts for nothing: the output does not vary beyond the integration error.
        ``detectable`` is the smallest difference of standard deviations that would be noticed. ``own_error`` is a bound
        of the error that a method states for its standard deviation, averaged over time. ``stated_error_max`` is its
        largest stated error over time, at ``stated_error_time`` (s). All three are relative to the standard deviation
        (infinite: none is stated). The attribute ``recommendation`` says which method to use.

        ``wasserstein`` (in units) and ``ks`` ``(method, output, comparison_time)``: distances of the distributions,
        from samples, or from 4096 samples of a chaos; NaN where there are none; ``ks_by_chance (method)``: which of the
        latter equal distributions exceed at the level.

        ``unknown_times``: how many times there are at which a method does not know the mean or standard deviation of
        an output; one that has any is not recommended.  ``wall_time`` (s), ``realisations`` and ``failures`` by
        method, ``solver_counters (method, counter)``. Where the results of a method, or of the reference, end before
        the last time, differences are over the times that
        both have; ``compared_until`` (s, by method) is the last of them, NaN if there is none, and so are then the
        differences. The attribute ``reference`` names the reference, whose differences are 0. A single method has no
        distances, counters, or recommendation. (Select with ``.sel({"method": label})``: ``method=`` means another
        thing to xarray's ``sel``.)

    Raises
    ------
    StudyError
        If there is no node, the reference is unknown, or outputs or times differ.

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
    nodes = _by_label(nodes)
    if reference is not None and reference not in nodes:
        raise StudyError(f"The reference {reference!r} is not among the methods {', '.join(map(repr, nodes))}.")
    errors = {label: own_error(node, max(rtol, rtol_of(node))) for label, node in nodes.items()}
    chosen = _most_reliable(nodes, errors) if reference is None else reference
    base = nodes[chosen].children["statistics"].to_dataset()
    times, timed = _times(base), "time" in base["mean"].dims
    units = [str(u) for u in base["output_units"].values]
    own = {label: own_statements(node, errors[label]) for label, node in nodes.items()}
    columns: dict[str, list[Any]] = {}
    until: list[float] = []
    unknown: list[int] = []
    said: list[list[Verdict]] = []
    for label, node in nodes.items():
        statistics = base if label == chosen else node.children["statistics"].to_dataset()
        _check_same_axes(label, statistics, chosen, base)
        both = [(name, over_time(statistics[name].values), over_time(base[name].values)) for name in ("mean", "std")]
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
        floor = np.maximum(
            tolerance * np.nan_to_num(_largest(other.std)),
            (10 * rtol + ROUNDING) * np.nan_to_num(_largest(np.abs(other.mean))),
        )
        share = level / max(len(nodes) - 1, 1)
        said.append(
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
            )
        )
    columns["detectable"] = [np.array([v.within for v in row]) for row in said]
    columns["verdict_kind"] = [np.array([v.kind for v in row], dtype=np.str_) for row in said]
    columns["verdict"] = [np.array([v.text for v in row], dtype=np.str_) for row in said]
    variables = {
        name: (("method", "output"), np.stack(rows), {"comment": _COMMENTS[name.split("_", 1)[1]]})
        if name.split("_", 1)[-1] in _COMMENTS
        else (("method", "output"), np.stack(rows))
        for name, rows in columns.items()
    }
    attributes = [node.attrs for node in nodes.values()]
    found = xr.Dataset(
        {
            **variables,
            "reference_std_max": ("output", _largest(_finite(base["std"].values))),
            **({"compared_until": ("method", np.array(until, dtype=float), _LAST)} if timed else {}),
            "unknown_times": ("method", np.array(unknown, dtype=np.int64)),
            "wall_time": ("method", np.array([float(a.get("wall_time", np.nan)) for a in attributes]), {"units": "s"}),
            "realisations": ("method", np.array([int(a.get("realisations", 0)) for a in attributes], dtype=np.int64)),
            "failures": ("method", np.array([int(a.get("failures", 0)) for a in attributes], dtype=np.int64)),
        },
        coords={
            "method": ("method", np.array(list(nodes), dtype=np.str_)),
            "output": ("output", base["output"].values),
            "output_units": ("output", base["output_units"].values),
        },
        attrs={"reference": chosen, "level": level, "tolerance": tolerance},
    )
    if len(nodes) < 2:
        return found
    found = found.assign(_counters(attributes)).assign(distributions(nodes, chosen, times, errors[chosen], level))
    poor = base["output"].values[errors[chosen].stated > COARSE].tolist()
    if poor:
        found = found.assign_attrs(reference_under_resolved=json.dumps(poor, ensure_ascii=False))
    use, sentences = advice(found)
    return found.assign_attrs(
        recommendation="\n".join((*loose(nodes), *sentences)),
        recommended=json.dumps(use, ensure_ascii=False),
    )


_LAST = {"units": "s", "long_name": "last time of the comparison"}

_COMMENTS = {
    "difference_max": "largest absolute difference over time",
    "difference_l2": "root mean square of the difference over time",
    "relative_l2": "root mean square of the difference over time, over that of the reference",
}


def _of_reference(varies: NDArray[np.bool_], own: list[str], *, alone: bool) -> list[Verdict]:
    """Return statements of the reference, or of the only method, on itself."""
    found = []
    for moves, text in zip(varies, own, strict=True):
        role = "" if alone or not moves else "; the reference"
        found.append(Verdict(REFERENCE if moves else NO_SPREAD, f"{text}{role}", 0.0))
    return found


def _quantile_differences(found: xr.Dataset, base: xr.Dataset) -> Array:
    """Return the largest difference of quantiles (O,) at probabilities and times of both; NaN where there is none."""
    unknown = np.full(base.sizes["output"], np.nan)
    if "quantile" not in found or "quantile" not in base:
        return unknown
    if found is base:
        known = np.isfinite(base["quantile"].transpose("output", ...).values).reshape(len(unknown), -1)
        return np.where(known.any(axis=1), 0.0, np.nan)
    shared = np.intersect1d(found["probability"].values, base["probability"].values)
    if not len(shared):
        return unknown
    one, other = (d["quantile"].sel(probability=shared).transpose("output", ...).values for d in (found, base))
    difference = np.abs(one - other).reshape(len(unknown), -1)
    known = np.isfinite(difference)
    return np.where(known.any(axis=1), np.where(known, difference, -np.inf).max(axis=1, initial=-np.inf), np.nan)


def _by_label(nodes: Mapping[str, xr.DataTree] | Iterable[xr.DataTree]) -> dict[str, xr.DataTree]:
    if isinstance(nodes, Mapping):
        return dict(cast(Mapping[str, xr.DataTree], nodes))
    return {str(node.attrs.get("label", node.name)): node for node in nodes}


def _times(statistics: xr.Dataset) -> Array:
    timed = "time" in statistics["mean"].dims
    return np.asarray(statistics["time"].values, dtype=float) if timed else np.zeros(1)


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (O, ...) at the times at which all outputs have one."""
    flat = values.reshape(len(values), -1 if values.size else 1)
    return np.asarray(flat[:, np.isfinite(flat).all(axis=0)])


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Maximum of each row; NaN of an empty one."""
    return np.asarray(values.max(axis=1) if values.shape[1] else np.full(len(values), np.nan), dtype=float)


def _check_same_axes(label: str, found: xr.Dataset, reference: str, expected: xr.Dataset) -> None:
    if found["output"].values.tolist() != expected["output"].values.tolist():
        raise StudyError(
            f"Only results with the same outputs can be compared: {label!r} has {found['output'].values.tolist()}, "
            f"{reference!r} has {expected['output'].values.tolist()}."
        )
    same_dims = found["mean"].dims == expected["mean"].dims
    if not same_dims or ("time" in found.dims and not np.array_equal(found["time"], expected["time"])):
        raise StudyError(
            f"Only results at the same times can be compared: those of {label!r} and {reference!r} differ."
        )


def _counters(attributes: list[dict[Any, Any]]) -> dict[str, Any]:
    """Return the solver counters of all methods, NaN where a method does not count."""
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
