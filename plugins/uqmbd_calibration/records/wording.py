"""Checks of arguments, and texts for their messages."""

from __future__ import annotations

import contextlib
import difflib
import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any, NoReturn

import numpy as np

import uqmbd
from uqmbd.typing import Array

MANY = 10**8
"""Largest number of values of a record; larger records do not fit into memory with all derived arrays."""

__all__ = [
    "check_known_names",
    "check_mapping",
    "check_name",
    "check_units",
    "listed",
    "near",
    "number",
    "numbers",
    "short",
]


def short(value: object) -> str:
    """Return the representation of a value in at most 80 characters.

    >>> short("x" * 200)[-5:]
    'xx...'
    """
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def near(name: object, known: Collection[str]) -> str:
    """Return a text with the most similar known name for a misspelt name, as the end of a sentence.

    >>> near("angel", ["angle", "force"]), near("x", [])
    ("; did you mean 'angle'?", '.')
    """
    found = difflib.get_close_matches(str(name), list(known), n=1)
    return f"; did you mean {found[0]!r}?" if found else "."


def listed(names: Collection[str]) -> str:
    """Return a text that lists names for a message.

    >>> listed(["a", "b"]), listed([])
    ("'a', 'b'", 'none')
    """
    return ", ".join(map(repr, names)) or "none"


def check_name(name: object, where: str) -> str:
    """Return a valid name of a record or an output, or raise `uqmbd.StudyError`."""
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or "/" in name:
        raise uqmbd.StudyError(
            f"{where}: the name is {short(name)}; expected a non-empty string without '/', tabs and line breaks."
        )
    if name in ("time", ".", ".."):
        raise uqmbd.StudyError(f"{where}: the name {name!r} is reserved; choose another name.")
    return name


def check_units(units: object, where: str) -> str:
    """Return units if they are a text, or raise `uqmbd.StudyError`."""
    if not isinstance(units, str) or not units.isprintable():
        raise uqmbd.StudyError(
            f"{where}: units is {short(units)}; expected a string such as 'm' or 'rad', or '' for a pure number."
        )
    return units


def check_mapping(given: object, known: Collection[str] | None, what: str, example: str, where: str) -> dict[str, Any]:
    """Return a mapping with known names as keys, or raise `uqmbd.StudyError`."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise uqmbd.StudyError(f"{where}: {what} is {short(given)}; expected a mapping such as {what}={example}.")
    for name in given:
        if not isinstance(name, str):
            raise uqmbd.StudyError(
                f"{where}: {what} has the key {short(name)}; expected strings as keys, e.g. {example}."
            )
    if known is not None:
        check_known_names(given, known, f"{where}: {what}")
    return dict(given)


def check_known_names(given: Iterable[str], known: Collection[str], where: str) -> None:
    """Raise `uqmbd.StudyError` if a name is not an output of a record."""
    for name in given:
        if name not in known:
            raise uqmbd.StudyError(
                f"{where} contains {name!r}, which is not a recorded output{near(name, known)} The recorded outputs "
                f"are {listed(known)}."
            )


def number(value: object, where: str, what: str, *, positive: bool = False) -> float:
    """Return a finite number, or raise `uqmbd.StudyError`."""
    expected = "a finite number above zero" if positive else "a finite number"
    if isinstance(value, (bool, np.bool_, str, bytes)):
        _not_a_number(value, where, what, expected)
    try:
        found = float(value)  # type: ignore[arg-type]  # any type is tried
    except (TypeError, ValueError, OverflowError):
        _not_a_number(value, where, what, expected)
    if not math.isfinite(found) or (positive and found <= 0):
        _not_a_number(value, where, what, expected)
    return found


def _not_a_number(value: object, where: str, what: str, expected: str) -> NoReturn:
    raise uqmbd.StudyError(f"{where}: {what} is {short(value)}; expected {expected}.")


def numbers(values: object, where: str, what: str) -> Array:
    """Return a one-dimensional array with gaps for masked entries, or raise `uqmbd.StudyError`."""
    found: Any = None
    with contextlib.suppress(TypeError, ValueError):
        found = values if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
    if found is not None and found.dtype.kind in "mM":
        raise uqmbd.StudyError(
            f"{where}: {what} are dates or durations ({found.dtype}); expected numbers (times in s)."
        )
    if found is not None and (found.dtype.kind == "O" or found.size == 0):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            found = found.astype(float)
    if found is None or found.dtype.kind not in "iuf":
        raise uqmbd.StudyError(f"{where}: {what} are {short(values)}; expected numbers.")
    if found.size > MANY:
        raise uqmbd.StudyError(f"{where}: {what} have the shape {found.shape}; expected at most {MANY} numbers.")
    if found.ndim != 1:
        raise uqmbd.StudyError(f"{where}: {what} have the shape {found.shape}; expected a one-dimensional array.")
    array: Array = np.ma.filled(found.astype(float), np.nan)
    return array
