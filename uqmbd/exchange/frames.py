"""Results as tidy frames of pandas, with a row for each output and time, or for each realisation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.results import propagator_nodes
from uqmbd.status import Status

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["samples_to_frame", "to_frame"]

MOST = 20_000_000
"""Largest number of values in a frame of realisations over time: 160 MB."""

RENAMED = {"std": "standard_deviation"}


@typechecked
def to_frame(results: xr.DataTree | xr.DataArray, outputs: Sequence[str] | str | None = None) -> pd.DataFrame:
    """Return statistics as a tidy pandas frame, with one row for each method, output and time.

    Parameters
    ----------
    results : xarray.DataTree
        Result of a study, or node ``tree["LABEL"]`` of one method. Type checkers may regard the node as a DataArray.
    outputs : str or sequence of str, optional
        Names of the outputs to include. Default: all.

    Returns
    -------
    pandas.DataFrame
        Columns ``method``, ``output``, ``units``, ``time`` (s; NaN for scalar outputs), ``mean`` and
        ``standard_deviation``. Columns of other statistics follow, such as ``quantile_0.05``, ``sobol_first_NAME`` of
        an input, or ``std_error_mean``. These columns are NaN for methods that do not compute the statistic.

    Raises
    ------
    uqmbd.StudyError
        If `results` contain no statistics, or an output does not exist.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> quantile = {"quantile": [[[0.0, 1.0]]], "probability": [0.5]}
    >>> statistics = statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.2]], **quantile)
    >>> node = propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> to_frame(node)[["method", "output", "units", "time", "mean", "standard_deviation", "quantile_0.5"]]
      method output units  time  mean  standard_deviation  quantile_0.5
    0   mine      x     m   0.0   0.0                 0.1           0.0
    1   mine      x     m   1.0   1.0                 0.2           1.0
    """
    import pandas as pd

    parts = []
    for label, node in _nodes("to_frame", results).items():
        for part in _parts(node):
            if "statistics" in part.children:
                parts += [(label, data) for data in [part.children["statistics"].to_dataset()] if data.sizes["output"]]
    if not parts:
        raise StudyError(
            "to_frame: the argument contains no statistics; expected the result of a study or of one method."
        )
    chosen = _chosen("to_frame", outputs, [str(x) for _, data in parts for x in data["output"].values])
    frames = []
    for label, data in parts:
        own = [name for name in map(str, data["output"].values) if name in chosen]
        if own:
            frames.append(_statistics(label, data.sel(output=own)))
    return pd.concat(frames, ignore_index=True)


@typechecked
def samples_to_frame(
    results: xr.DataTree | xr.DataArray,
    outputs: Sequence[str] | str | None = None,
    times: Sequence[float] | float | None = None,
) -> pd.DataFrame:
    """Return the samples of a method as a pandas frame.

    Parameters
    ----------
    results : xarray.DataTree
        Node of a method that stores samples, such as ``tree["monte-carlo"]``, or result of a study with only one such
        method.
    outputs : str or sequence of str, optional
        Outputs over time. By default, the frame contains inputs and scalar outputs, with one value for each
        realisation.
    times : float or sequence of float, optional
        Output times, s. Default: all. A given time may differ from an output time by a billionth of the time span.

    Returns
    -------
    pandas.DataFrame
        Without `outputs`: one row for each realisation, with the columns ``sample`` (its number), inputs, scalar
        outputs and ``status`` (as text). Results of failed realisations are NaN. With `outputs`: one row for each
        realisation and time, with the columns ``sample``, ``time`` and these outputs. Join both frames by ``sample``.
        ``frame.attrs["units"]`` contains the units of the columns.

    Raises
    ------
    uqmbd.StudyError
        If there are no samples, an output or time does not exist, or the frame would have more than 20 million numbers.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, sample_dataset, statistics_dataset
    >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0, 1.0])
    >>> samples = sample_dataset([[[1.0, 2.0]], [[1.5, 2.5]]], [[3.0], [4.0]], axes)
    >>> statistics = statistics_dataset(axes, mean=[[1.2, 2.2]], std=[[0.2, 0.2]])
    >>> node = propagator_node("mine", statistics, samples, propagator="p", realisations=2, wall_time=0.0)
    >>> samples_to_frame(node)
       sample    k status
    0       0  3.0     ok
    1       1  4.0     ok
    >>> samples_to_frame(node, "x", times=1.0)
       sample  time    x
    0       0   1.0  2.0
    1       1   1.0  2.5
    """
    where = "samples_to_frame"
    found = {label: node for label, node in _nodes(where, results).items() if _sampled(node)}
    if len(found) != 1:
        given = f"the samples of {len(found)} methods ({', '.join(map(repr, found))})" if found else "no samples"
        raise StudyError(
            f"{where}: expected the samples of one method, but {given} are given; pass tree['LABEL'] of one method."
        )
    ((_, node),) = found.items()
    data = [part.children["samples"].to_dataset() for part in _sampled(node)]
    timed = next((one for one in data if "time" in one["response"].dims), None)
    if outputs is None:
        if times is not None:
            raise StudyError(f"{where}: times={times!r} has no effect without outputs=; name the outputs over time.")
        return _realisations(data, timed)
    if timed is None:
        raise StudyError(f"{where}: the results have no output over time; omit outputs=.")
    chosen = _chosen(where, outputs, [str(x) for x in timed["output"].values])
    at = _times(where, times, timed["time"].values)
    count = timed.sizes["sample"]
    size = count * len(at) * (len(chosen) + 2)
    if size > MOST:
        raise StudyError(
            f"{where}: {count} realisations of {len(chosen)} outputs at {len(at)} times are {size:.3g} numbers in the "
            f"frame; expected at most {MOST:.3g}. Choose fewer by outputs= and times=, or use the arrays of "
            "tree['LABEL/samples']."
        )
    return _over_time(timed.sel(output=chosen).isel(time=at), count)


def _statistics(label: str, data: xr.Dataset) -> pd.DataFrame:
    """Return the rows of one method, for outputs over time or for scalar outputs."""
    import pandas as pd

    dims = ("output", "time") if "time" in data.dims else ("output",)
    count, times = data.sizes["output"], data.sizes.get("time", 1)
    columns: dict[str, Any] = {
        "method": np.full(count * times, label, dtype=object),
        "output": np.repeat(data["output"].values.astype(object), times),
        "units": np.repeat(data["output_units"].values.astype(object), times),
        "time": np.tile(data["time"].values if "time" in data.dims else np.array([np.nan]), count),
    }
    for name, variable in data.data_vars.items():
        column = RENAMED.get(str(name), str(name))
        others = [str(dim) for dim in variable.dims if dim not in dims]
        if "output" not in variable.dims or len(others) > 1 or not np.issubdtype(variable.dtype, np.number):
            continue
        whole = variable.broadcast_like(data[list(dims)[-1]] if "time" in dims else variable).transpose(*others, *dims)
        if not others:
            columns[column] = whole.values.ravel()
            continue
        for value, one in zip(data[others[0]].values, whole.values, strict=True):
            text = f"{value:g}" if isinstance(value, (float, np.floating)) else str(value)
            columns[f"{column}_{text}"] = one.ravel()
    return pd.DataFrame(columns)


def _realisations(data: list[xr.Dataset], timed: xr.Dataset | None) -> pd.DataFrame:
    """Return a frame of inputs, scalar outputs and status, with one row for each realisation."""
    import pandas as pd

    first = data[0]
    columns: dict[str, Any] = {"sample": np.arange(first.sizes["sample"])}
    units: dict[str, str] = {}
    for k, name in enumerate(map(str, first["input"].values)):
        columns[name] = first["inputs"].values[:, k]
        units[name] = str(first["input_units"].values[k])
    for one in data:
        if one is timed:
            continue
        for k, name in enumerate(map(str, one["output"].values)):
            columns[name] = one["response"].values[:, k]
            units[name] = str(one["output_units"].values[k])
    columns["status"] = _status(data)
    frame = pd.DataFrame(columns)
    frame.attrs["units"] = {name: unit for name, unit in units.items() if unit}
    return frame


def _status(data: list[xr.Dataset]) -> Any:
    """Return the status of each realisation as text; the first dataset in which it failed decides."""
    found = np.full(data[0].sizes["sample"], Status.OK.meaning, dtype=object)
    for one in data:
        attrs, values = one["status"].attrs, one["status"].values
        meanings = attrs.get("flag_meanings", " ".join(status.meaning for status in Status)).split()
        words = dict(zip(np.ravel(attrs.get("flag_values", np.arange(len(meanings)))).tolist(), meanings, strict=True))
        for k in np.flatnonzero((values != Status.OK) & (found == Status.OK.meaning)):
            found[k] = words.get(int(values[k]), str(int(values[k])))
    return found


def _over_time(data: xr.Dataset, count: int) -> pd.DataFrame:
    """Return a frame of outputs, with one row for each realisation and time."""
    import pandas as pd

    times = data["time"].values
    columns: dict[str, Any] = {
        "sample": np.repeat(np.arange(count), len(times)),
        "time": np.tile(times, count),
    }
    units = {"time": "s"}
    for k, name in enumerate(map(str, data["output"].values)):
        columns[name] = data["response"].isel(output=k).transpose("sample", "time").values.ravel()
        if unit := str(data["output_units"].values[k]):
            units[name] = unit
    frame = pd.DataFrame(columns)
    frame.attrs["units"] = units
    return frame


def _nodes(where: str, results: Any) -> dict[str, xr.DataTree]:
    if not isinstance(results, xr.DataTree):
        raise StudyError(
            f"{where}: {type(results).__name__} is given; expected the result of a study, or of one method."
        )
    return propagator_nodes(results)


def _parts(node: xr.DataTree) -> list[xr.DataTree]:
    """Return a node, and the node of its scalar outputs if it exists."""
    return [node, *([node.children["scalars"]] if "scalars" in node.children else [])]


def _sampled(node: xr.DataTree) -> list[xr.DataTree]:
    return [part for part in _parts(node) if "samples" in part.children]


def _chosen(where: str, outputs: Sequence[str] | str | None, known: Sequence[str]) -> list[str]:
    """Return the chosen names of outputs; raise StudyError for unknown names."""
    if outputs is None:
        return list(dict.fromkeys(known))
    chosen = [outputs] if isinstance(outputs, str) else list(outputs)
    for name in chosen:
        if name not in known:
            raise StudyError(
                f"{where}: the results have no output {name!r}{did_you_mean(str(name), list(known))}; the outputs "
                f"are {', '.join(map(repr, dict.fromkeys(known)))}."
            )
    if not chosen:
        raise StudyError(f"{where}: outputs is empty; expected some of {', '.join(map(repr, dict.fromkeys(known)))}.")
    return chosen


def _times(where: str, times: Sequence[float] | float | None, known: Any) -> list[int]:
    """Return the indices of the chosen output times; raise StudyError for unknown times."""
    if times is None:
        return list(range(len(known)))
    requested = np.atleast_1d(np.asarray(times, dtype=float))
    places = [int(np.abs(known - time).argmin()) for time in requested]
    for time, place in zip(requested, places, strict=True):
        if not abs(known[place] - time) <= 1e-9 * max(float(np.ptp(known)), abs(float(known[place]))):
            raise StudyError(
                f"{where}: {time:g} s is not an output time; the nearest output time is {known[place]:.9g} s."
            )
    return places
