"""Options of the form NAME=VALUE."""

from __future__ import annotations

import math
from collections.abc import Sequence

import uqmbd

__all__ = ["numbers_of", "texts_of"]


def texts_of(words: Sequence[str], option: str) -> dict[str, str]:
    """Return what options say, by name; a name may hold equals signs, its value none.

    Raises
    ------
    uqmbd.StudyError
        If one has no equals sign or no name, or a name is given twice.

    Examples
    --------
    >>> texts_of(["force=N", "a=b=m"], "--units")
    {'force': 'N', 'a=b': 'm'}
    """
    found: dict[str, str] = {}
    for word in words:
        name, mark, value = word.rpartition("=")
        if not mark or not name.strip():
            raise uqmbd.StudyError(f"{option} {word}: expected NAME=VALUE.")
        if name in found:
            raise uqmbd.StudyError(f"{option} {word}: {name!r} is given twice; expected once.")
        found[name] = value.strip()
    return found


def numbers_of(words: Sequence[str], option: str) -> dict[str, float]:
    """Return the numbers that options say, by name.

    Raises
    ------
    uqmbd.StudyError
        If one is no number, infinite, or as for `texts_of`.

    Examples
    --------
    >>> numbers_of(["force=2", "angle=1e-3"], "--noise")
    {'force': 2.0, 'angle': 0.001}
    """
    found: dict[str, float] = {}
    for name, text in texts_of(words, option).items():
        try:
            found[name] = float(text)
        except ValueError:
            found[name] = math.nan
        if not math.isfinite(found[name]):
            raise uqmbd.StudyError(f"{option} {name}={text}: {text!r} is no finite number.")
    return found
