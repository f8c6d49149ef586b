"""How far the mean and the standard deviation of each method lie from those of a reference method."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError

__all__ = ["choose_reference", "compare"]


def choose_reference(nodes: Mapping[str, xr.DataTree]) -> str:
    """Choose the method to compare the others with.

    Methods whose results end before the last time come last. Methods that state their own standard errors come first,
    since they alone say how far they may be off; among equals the one with the most successful realisations; then the
    one that was given first.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        The propagator nodes by label; not empty.

    Returns
    -------
    str
        A label.

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
    if not nodes:
        raise StudyError("A comparison needs the result of at least one propagator; there is none.")

    def trust(label: str) -> tuple[bool, bool, int]:
        node = nodes[label]
        whole = "ends_at" not in node.attrs
        known = {"std_error_mean", "std_error_std"} <= set(node.children["statistics"].data_vars)
        return whole, known, int(node.attrs.get("realisations", 0)) - int(node.attrs.get("failures", 0))

    return max(nodes, key=trust)


def compare(nodes: Mapping[str, xr.DataTree], reference: str | None = None) -> xr.Dataset:
    """Compare every method with a reference.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label, with the same outputs and times.
    reference : str, optional
        Label of the reference; default :func:`choose_reference`.

    Returns
    -------
    xarray.Dataset
        With the dimensions ``method`` and ``output``, in the units of the outputs: ``mean_difference_max`` and
        ``std_difference_max``, the largest absolute difference over time, and ``mean_difference_l2`` and
        ``std_difference_l2``, its root mean square over time (trapezoidal). ``reference_std_max (output)`` is a scale
        for them. ``wall_time`` (s), ``realisations`` and ``failures`` by method. Where the results of a method, or of
        the reference, end before the last time, differences are over the times that both have; ``compared_until``
        (s, by method) is the last of them, NaN if there is none, and so are then the differences. The attribute
        ``reference`` names the reference, whose differences are 0. (Select with ``.sel({"method": label})``:
        ``method=`` means another thing to xarray's ``sel``.)

    Raises
    ------
    StudyError
        If there is no node, the reference is unknown, or outputs or times differ.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(label, mean):
    ...     statistics = statistics_dataset(axes, mean=[mean], std=[[0.0, 0.1]])
    ...     return propagator_node(label, statistics, propagator="p", realisations=9, wall_time=1.0)
    >>> found = compare({"a": node("a", [0.0, 1.0]), "b": node("b", [0.0, 1.5])})
    >>> found.attrs["reference"], found["mean_difference_max"].sel({"method": "b"}).values.tolist()
    ('a', [0.5])
    """
    chosen = choose_reference(nodes) if reference is None else reference
    if chosen not in nodes:
        raise StudyError(f"The reference {chosen!r} is not among the methods {', '.join(map(repr, nodes))}.")
    base = nodes[chosen].children["statistics"].to_dataset()
    times = base["time"].values if "time" in base["mean"].dims else np.zeros(1)
    columns: dict[str, list[NDArray[np.float64]]] = {}
    until: list[float] = []
    for label, node in nodes.items():
        statistics = node.children["statistics"].to_dataset()
        _check_same_axes(label, statistics, chosen, base)
        both = [(name, statistics[name].values, base[name].values) for name in ("mean", "std")]
        differences = {name: np.abs(a - b).reshape(-1, len(times)) for name, a, b in both}
        common = np.all([np.isfinite(d).all(axis=0) for d in differences.values()], axis=0)
        until.append(float(times[common].max(initial=-np.inf)) if common.any() else np.nan)
        for name, difference in differences.items():
            known = difference[:, common]
            columns.setdefault(f"{name}_difference_max", []).append(_largest(known))
            columns.setdefault(f"{name}_difference_l2", []).append(_root_mean_square(known, times[common]))
    comments = {"max": "largest absolute difference over time", "l2": "root mean square of the difference over time"}
    variables = {
        name: (("method", "output"), np.stack(rows), {"comment": comments[name.rsplit("_", 1)[1]]})
        for name, rows in columns.items()
    }
    attributes = [node.attrs for node in nodes.values()]
    return xr.Dataset(
        {
            **variables,
            "reference_std_max": ("output", _largest(_finite(base["std"].values))),
            **_until(until, "time" in base["mean"].dims),
            "wall_time": ("method", np.array([float(a.get("wall_time", np.nan)) for a in attributes]), {"units": "s"}),
            "realisations": ("method", np.array([int(a.get("realisations", 0)) for a in attributes], dtype=np.int64)),
            "failures": ("method", np.array([int(a.get("failures", 0)) for a in attributes], dtype=np.int64)),
        },
        coords={
            "method": ("method", np.array(list(nodes), dtype=np.str_)),
            "output": ("output", base["output"].values),
            "output_units": ("output", base["output_units"].values),
        },
        attrs={"reference": chosen},
    )


def _until(until: list[float], timed: bool) -> dict[str, tuple[str, NDArray[np.float64], dict[str, str]]]:
    about = {"units": "s", "long_name": "last time of the comparison"}
    return {"compared_until": ("method", np.array(until, dtype=float), about)} if timed else {}


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (O, ...) at the times at which all outputs have one."""
    flat = values.reshape(len(values), -1)
    return np.asarray(flat[:, np.isfinite(flat).all(axis=0)])


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Maximum of each row; NaN of an empty one."""
    return np.asarray(values.max(axis=1) if values.shape[1] else np.full(len(values), np.nan), dtype=float)


def _root_mean_square(difference: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(times) < 2:
        return _largest(difference)
    # Scaled, so that differences of 1e-200 do not vanish in their square.
    scale = np.where(_largest(difference) > 0, _largest(difference), 1.0)
    mean_square = np.trapezoid((difference / scale[:, None]) ** 2, times, axis=1) / (times[-1] - times[0])
    return np.asarray(scale * np.sqrt(mean_square), dtype=float)


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
