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

    Methods that state their own standard errors come first, since they alone say how far they may be off; among equals
    the one with the most successful realisations; then the one that was given first.

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

    def trust(label: str) -> tuple[bool, int]:
        node = nodes[label]
        known = {"std_error_mean", "std_error_std"} <= set(node.children["statistics"].data_vars)
        return known, int(node.attrs.get("realisations", 0)) - int(node.attrs.get("failures", 0))

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
        for them. ``wall_time`` (s), ``realisations`` and ``failures`` by method. The attribute ``reference`` names the
        reference, whose differences are 0. (Select with ``.sel({"method": label})``: ``method=`` means another thing
        to xarray's ``sel``.)

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
    columns: dict[str, list[NDArray[np.float64]]] = {}
    for label, node in nodes.items():
        statistics = node.children["statistics"].to_dataset()
        _check_same_axes(label, statistics, chosen, base)
        for name in ("mean", "std"):
            difference = np.abs(statistics[name].values - base[name].values)
            columns.setdefault(f"{name}_difference_max", []).append(_largest(difference))
            columns.setdefault(f"{name}_difference_l2", []).append(_root_mean_square(difference, base))
    comments = {"max": "largest absolute difference over time", "l2": "root mean square of the difference over time"}
    variables = {
        name: (("method", "output"), np.stack(rows), {"comment": comments[name.rsplit("_", 1)[1]]})
        for name, rows in columns.items()
    }
    attributes = [node.attrs for node in nodes.values()]
    return xr.Dataset(
        {
            **variables,
            "reference_std_max": ("output", _largest(base["std"].values)),
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


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values.reshape(len(values), -1).max(axis=1), dtype=float)


def _root_mean_square(difference: NDArray[np.float64], base: xr.Dataset) -> NDArray[np.float64]:
    times = base["time"].values if "time" in base["mean"].dims else np.zeros(1)
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
