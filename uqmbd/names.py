"""Names and units that users give: one rule for bodies, components, outputs, random variables, propagators."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from uqmbd.errors import StudyError

__all__ = ["check_name", "check_units", "did_you_mean"]


def check_name(name: object, what: str) -> str:
    """Return `name` if it can be one, else raise.

    Parameters
    ----------
    name : object
        What the user gave.
    what : str
        What it is to name, for the message.

    Raises
    ------
    uqmbd.StudyError
        If it is not a text, empty, contains ``/`` or is ``time``.

    Examples
    --------
    >>> check_name("crank", "body")
    'crank'
    """
    if not isinstance(name, str):
        raise StudyError(
            f"{what}: the name is {name!r} ({type(name).__name__}); expected a text. The name is the first argument."
        )
    if not name.strip():
        raise StudyError(f"{what}: the name is empty; give it one that you will recognise in plots and tables.")
    if "/" in name:
        raise StudyError(f"{what} {name!r}: a name cannot contain '/', which separates groups in result files.")
    if name == "time":
        raise StudyError(f"{what} 'time': that name is taken by the time axis of the results; choose another.")
    return name


def check_units(units: object, where: str) -> str:
    """Return units if they are a text, else raise.

    Parameters
    ----------
    units : object
        What the user gave; an empty text where there are none.
    where : str
        What they belong to, for the message.

    Raises
    ------
    uqmbd.StudyError
        If they are no text.

    Examples
    --------
    >>> check_units("kg m^2", "output 'inertia'")
    'kg m^2'
    """
    if not isinstance(units, str):
        raise StudyError(f"{where}: units is {units!r} ({type(units).__name__}); expected a text such as 'm' or 'N m'.")
    return units


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the known name that is nearest to a misspelt one, as the end of a sentence; empty if none is near.

    Parameters
    ----------
    name : str
        What the user gave.
    known : iterable of str
        What there is.

    Examples
    --------
    >>> did_you_mean("colocation", ["monte-carlo", "collocation"])
    "; did you mean 'collocation'?"
    >>> did_you_mean("x", ["monte-carlo", "collocation"])
    ''
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
