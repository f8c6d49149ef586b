"""Texts that identify functions and processes, and the comparison of processes at points."""

from __future__ import annotations

import math
import uuid
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

import uqmbd
from uqmbd.laws import distance

__all__ = [
    "GIVEN",
    "PATHS",
    "check_description",
    "check_family",
    "check_paths",
    "check_point",
    "check_units_and_mean",
    "describe_function",
    "describe_options",
    "refuse_arithmetic",
]

GIVEN = ("psd", "covariance", "filter", "record")
"""Arguments that describe a process, of which exactly one is given."""

PATHS = ("harmonics", "filter", "karhunen_loeve")
"""Kinds of sampled paths."""

SESSION = uuid.uuid4().hex[:8]
"""Name of this process in the texts of functions with unknown content."""

UNKNOWN: dict[int, Any] = {}
"""Functions with unknown content; the references keep their addresses in use."""


def describe_function(function: Any) -> str:
    """Return a text that identifies a function by its name and content, also in other processes and later runs.

    A function with unknown content, such as one that reads a file, equals only itself, and only in this process.
    """
    if type(function).__module__.partition(".")[0] == __name__.partition(".")[0]:
        return repr(function)  # plain data
    key = uqmbd.extend.content_key(function)
    if key is None:
        UNKNOWN[id(function)] = function
        key = f"{SESSION}-{id(function)}"
    named = function if hasattr(function, "__qualname__") else type(function)
    return f"{named.__module__}.{named.__qualname__}-{key[:32]}"


def describe_options(process: Any) -> dict[str, str]:
    """Return all options of a process, except its name and point, as texts."""
    covariance, coherence = vars(process)["_texts"]
    key = next(name for name in GIVEN if getattr(process, name) is not None)
    found = {key: covariance if key == "covariance" else repr(getattr(process, key))}
    found |= {"over": repr(process.over), "units": repr(process.units)}
    if process.mean:
        found["mean"] = repr(process.mean)
    if process.coherence is not None:
        found["coherence"] = coherence
    if process.paths != PATHS[0]:
        found["paths"] = repr(process.paths)
    return found | {x: repr(getattr(process, x)) for x in ("length", "cutoff") if getattr(process, x) is not None}


def check_family(sources: Sequence[Any]) -> None:
    """Raise StudyError unless processes have the same name and differ only in their points."""
    if len({x.family for x in sources}) > 1:
        listed = ", ".join(sorted({repr(x.family) for x in sources}))
        raise uqmbd.StudyError(
            f"random process {sources[0].family!r}: paths of {listed} were requested; expected points of one process."
        )
    first = sources[0].description
    for other in sources[1:]:
        if other.description != first:
            keys = [k for k in first | other.description if first.get(k) != other.description.get(k)]
            listed = " and ".join([", ".join(keys[:-1]), keys[-1]] if len(keys) > 1 else keys)
            raise uqmbd.StudyError(
                f"random process {sources[0].family!r}: {sources[0].name!r} and {other.name!r} differ in {listed}; "
                "expected points of one process. Give processes with other options different names."
            )


def check_description(process: Any) -> tuple[str, str]:
    """Return the name of a process in messages, and its argument; raise StudyError without exactly one description."""
    if not isinstance(process.name, str) or not process.name.strip() or "/" in process.name:
        raise uqmbd.StudyError(f"RandomProcess: the name is {process.name!r}; expected a text without '/'.")
    where = f"random process {process.name!r}"
    given = [name for name in GIVEN if getattr(process, name) is not None]
    if len(given) != 1:
        what = f"{' and '.join(given)} are given" if given else "no description is given"
        raise uqmbd.StudyError(f"{where}: {what}; expected one of psd=, covariance=, filter= and record=.")
    over = {distance: "distance", uqmbd.t: "time"}.get(process.over, process.over)
    if over not in ("distance", "time"):
        raise uqmbd.StudyError(f"{where}: over={process.over!r}; expected 'distance' or 'time'.")
    return where, over


def check_units_and_mean(where: str, process: Any) -> None:
    """Raise StudyError unless units are a text, the mean is a number, and the coherence is a function."""
    if not isinstance(process.units, str):
        raise uqmbd.StudyError(f"{where}: units is {process.units!r}; expected a text such as 'm'.")
    mean = process.mean
    if isinstance(mean, bool) or not isinstance(mean, (int, float, np.number)) or not math.isfinite(mean):
        raise uqmbd.StudyError(f"{where}: mean is {mean!r}; expected a finite number.")
    if process.coherence is not None and not callable(process.coherence):
        raise uqmbd.StudyError(
            f"{where}: coherence is {process.coherence!r}; expected a function of the frequency and the separation."
        )


def check_paths(where: str, process: Any) -> None:
    """Raise StudyError unless the process has sampled paths of the requested kind."""
    if process.paths not in PATHS:
        raise uqmbd.StudyError(
            f"{where}: paths is {process.paths!r}; expected 'harmonics', 'filter' or 'karhunen_loeve'."
        )
    if process.paths == PATHS[0]:
        return
    reason = _no_filter(process) if process.paths == "filter" else ""
    if process.coherence is not None:
        reason = reason or "the process has a coherence, which only paths of harmonics have; omit paths="
    elif process.paths == "karhunen_loeve" and process.length is None:
        reason = "the expansion needs the length of its interval; give length=, the largest argument of the process"
    if reason:
        raise uqmbd.StudyError(f"{where}: paths={process.paths!r} is not possible: {reason}.")


def _no_filter(process: Any) -> str:
    """Return the reason why a process has no paths of a filter, or an empty text."""
    if process.shape is None:
        return "the process has no shaping filter: give filter=, exponential_covariance(...) or kanai_tajimi(...)"
    if process.density is not None and process.density.angular_band != (0.0, float("inf")):
        return "the spectrum has a band, which the filter does not have; omit the band"
    if process.shape.d:
        return "the process is white noise, which has no paths; use a smoother process"
    return "" if process.length is None else "paths of a filter do not repeat; omit length="


def check_point(process: Any, point: Sequence[Any]) -> None:
    """Raise StudyError unless a process has a coherence and no point, and the coordinates of a point are finite."""
    where = f"random process {process.name!r}"
    if process.coherence is None:
        raise uqmbd.StudyError(
            f"{where}: the process has no coherence, so its values at different points are unknown; give "
            "coherence=, such as davenport_coherence(decay, speed)."
        )
    numbers = [isinstance(x, (int, float, np.number)) and math.isfinite(x) for x in point]
    if not point or not all(numbers) or process.point:
        raise uqmbd.StudyError(f"{where}: at() has the argument {point!r}; expected finite coordinates of a point.")


def refuse_arithmetic(process: Any, other: Any = None) -> NoReturn:
    """Raise the error of a process that an expression contains without its argument."""
    argument = "20 * uqmbd.t" if process.over == "distance" else "uqmbd.t"
    raise uqmbd.StudyError(
        f"random process {process.name!r}: an expression contains the process without its argument; call it, such as "
        f"{process.name}({argument})."
    )
