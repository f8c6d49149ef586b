"""Texts that identify functions and processes, and the comparison of processes at points."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from typing import Any, NoReturn

import uqmbd

__all__ = ["GIVEN", "check_family", "describe_function", "describe_options", "refuse_arithmetic"]

GIVEN = ("psd", "covariance", "filter", "record")
"""Descriptions of processes, one of which is given."""

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
    """Return all options of a process but its name and point, as texts."""
    covariance, coherence = vars(process)["_texts"]
    key = next(name for name in GIVEN if getattr(process, name) is not None)
    found = {key: covariance if key == "covariance" else repr(getattr(process, key))}
    found |= {"over": repr(process.over), "units": repr(process.units)}
    if process.mean:
        found["mean"] = repr(process.mean)
    if process.coherence is not None:
        found["coherence"] = coherence
    return found | {x: repr(getattr(process, x)) for x in ("length", "cutoff") if getattr(process, x) is not None}


def check_family(sources: Sequence[Any]) -> None:
    """Raise unless processes at points of one name differ only in their points."""
    first = sources[0].description
    for other in sources[1:]:
        if other.description != first:
            keys = [k for k in first | other.description if first.get(k) != other.description.get(k)]
            listed = " and ".join([", ".join(keys[:-1]), keys[-1]] if len(keys) > 1 else keys)
            raise uqmbd.StudyError(
                f"random process {sources[0].family!r}: {sources[0].name!r} and {other.name!r} differ in {listed}; "
                "expected points of one process. Give processes with other options different names."
            )


def refuse_arithmetic(process: Any, other: Any = None) -> NoReturn:
    """Raise the error of a process that an expression contains without its argument."""
    argument = "20 * uqmbd.t" if process.over == "distance" else "uqmbd.t"
    raise uqmbd.StudyError(
        f"random process {process.name!r}: an expression contains the process without its argument; call it, such as "
        f"{process.name}({argument})."
    )
