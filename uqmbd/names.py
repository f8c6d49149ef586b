"""Check of names, units and arguments from users, with the same rules for all objects of a study."""

from __future__ import annotations

import difflib
import functools
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar, cast

from uqmbd.errors import StudyError

__all__ = [
    "ANY",
    "SeriesPlace",
    "check_arguments",
    "check_label",
    "check_name",
    "check_units",
    "checked",
    "did_you_mean",
    "lineage",
    "natural_order",
    "unwritable",
]

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class SeriesPlace:
    """Place of a scalar output in a series of outputs along an axis (`uqmbd.extend.OutputSeries`).

    Attributes
    ----------
    series : str
        Name of the series.
    position : float
        Position along the axis, in its units.
    axis, units : str
        Name and units of the axis.

    Examples
    --------
    >>> SeriesPlace("psd", 0.5, "frequency", "Hz").position
    0.5
    """

    series: str
    position: float
    axis: str
    units: str


_BREAKS = frozenset("\t\n\r\u2028\u2029")
"""Characters that break tables and messages."""

RESERVED_LABELS = frozenset(
    {
        "comparison",
        "convergence",
        "motion",
        "pose_surrogate",
        "statistics",
        "samples",
        "nodes",
        "chaos",
        "scalars",
        "requirements",
    }
)
"""Names of the parts of results, which methods cannot use."""

ANY = "any"
"""Name of the event that at least one requirement is violated."""

LONGEST_LABEL = 200
"""Largest number of bytes of a label, which is part of file names."""


_UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Control characters, surrogates and non-characters, which files, pages and terminals cannot contain."""


_DIGITS = re.compile(r"([0-9]+)")


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Return a sort key of a name that orders numbers by value: 2 comes before 10.

    >>> sorted(["road_10", "road_2", "road_1", "mass"], key=natural_order)
    ['mass', 'road_1', 'road_2', 'road_10']
    """
    return [int(part) if k % 2 else part for k, part in enumerate(_DIGITS.split(name))], name


def unwritable(text: str) -> str:
    r"""Describe the first character of a text that files, pages and terminals cannot contain; empty if there is none.

    Tabs, ends of lines and printable characters of all scripts are allowed.

    >>> unwritable("Länge [m]"), unwritable("bell\a")
    ('', 'the control character U+0007')
    """
    found = _UNWRITABLE.search(text)
    if found is None:
        return ""
    code = ord(found.group())
    if code == 0:
        return "a null character"
    kind = "half a character" if 0xD800 <= code < 0xE000 else "what is no character" if code > 0xFF00 else ""
    return f"{kind or 'the control character'}{',' if kind else ''} U+{code:04X}"


def check_name(name: object, what: str) -> str:
    """Return a valid name, or raise StudyError.

    `name` is the input of the user, `what` the kind of the named object for the message. A name is invalid if it is not
    a text, is empty, contains ``/`` or a control character, or is ``time``, ``.`` or ``..``.

    >>> check_name("crank", "body")
    'crank'
    """
    if not isinstance(name, str):
        raise StudyError(
            f"{what}: the name is {name!r} ({type(name).__name__}); expected a string as the first argument."
        )
    if not name.strip():
        raise StudyError(f"{what}: the name is empty; give a descriptive name for plots and tables.")
    mark = "'/', which separates groups in result files" if "/" in name else unwritable(name)
    if not mark and len(name.splitlines()) > 1 or set(name) & _BREAKS:
        mark = "tabs or ends of lines, which break tables and messages"
    if mark:
        raise StudyError(f"{what} {name!r}: a name cannot contain {mark}.")
    if name in (".", ".."):
        raise StudyError(f"{what} {name!r}: this name is reserved for a folder; choose another name.")
    if name == "time":
        raise StudyError(f"{what} 'time': this name is reserved for the time axis of the results; choose another name.")
    return name


def check_label(label: object) -> str:
    """Return a valid label of a method for results and files, or raise StudyError.

    `label` is the input of the user. A label is invalid if it is not a name, is the name of a part of results, or is
    too long.

    >>> check_label("order 4")
    'order 4'
    """
    name = check_name(label, "label")
    if name in RESERVED_LABELS:
        raise StudyError(
            f"label {name!r}: this name is reserved for a group of the results; choose another name. Reserved names: "
            f"{', '.join(sorted(RESERVED_LABELS))}."
        )
    if len(name.encode()) > LONGEST_LABEL:
        raise StudyError(
            f"label {name[:40] + '...'!r}: the label has {len(name)} characters; expected at most {LONGEST_LABEL} "
            "bytes, because it is part of file names."
        )
    return name


def check_units(units: object, where: str) -> str:
    """Return valid units; warn about unknown units and about spellings that differ from uqmbd's.

    `units` is the input of the user, or an empty text without units. `where` is the object with these units, for the
    message. Raise StudyError if `units` is not a text, or contains a control character. Warn by UnitsWarning if the
    units are unknown, or have another spelling.

    >>> check_units("kg m^2", "output 'inertia'")
    'kg m^2'
    """
    if not isinstance(units, str):
        raise StudyError(f"{where}: units is {units!r} ({type(units).__name__}); expected a text such as 'm' or 'N m'.")
    if mark := unwritable(units):
        raise StudyError(f"{where}: units is {units!r}; units cannot contain {mark}.")
    if set(units) & _BREAKS:
        raise StudyError(f"{where}: units is {units!r}; units cannot contain tabs or ends of lines.")
    from uqmbd.units import spelling, warn  # imported here, because `uqmbd --help` does not need them

    if words := spelling(where, units):
        warn(words)
    return units


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the known name nearest to a misspelt name, as the end of a sentence; empty if no name is near.

    `name` is the input of the user, `known` are the existing names.

    >>> did_you_mean("colocation", ["monte-carlo", "collocation"])
    "; did you mean 'collocation'?"
    >>> did_you_mean("x", ["monte-carlo", "collocation"])
    ''
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function or a class so that wrong arguments raise StudyError instead of TypeError.

    Python's own TypeError states neither the intended argument nor the existing arguments.

    >>> @checked
    ... def spring(stiffness, damping=0):
    ...     return stiffness
    >>> spring(2, dampnig=1)
    Traceback (most recent call last):
    uqmbd.errors.StudyError: spring: there is no argument 'dampnig'; did you mean 'damping'? Usage: spring(stiffness,
    damping=0).
    """
    if isinstance(function, type):
        made: Any = function
        made.__init__ = checked(made.__init__)
        return cast("Callable[P, R]", made)
    signature = inspect.signature(function)
    what = function.__qualname__.removesuffix(".__init__").removesuffix(".__new__")
    bound = what != function.__qualname__ or "." in function.__qualname__.rpartition("<locals>.")[2]

    @functools.wraps(function)
    def call(*arguments: P.args, **keywords: P.kwargs) -> R:
        check_arguments(what, signature, arguments, keywords, bound=bound)
        return function(*arguments, **keywords)

    return call


def check_arguments(
    what: str, signature: inspect.Signature, arguments: Sequence[Any], keywords: Mapping[str, Any], *, bound: bool
) -> None:
    """Raise StudyError unless a call fits a signature.

    `what` is the name of the function for the message. `signature` is its signature. `arguments` and `keywords` are
    the given arguments. `bound` states whether the first argument is the object or the class, which users do not see.
    The message names the argument that is unknown, missing, given twice or superfluous.
    """
    try:
        signature.bind(*arguments, **keywords)
    except TypeError:
        pass
    else:
        return
    parameters = list(signature.parameters.values())[bound:]
    shown = signature.replace(
        parameters=[p.replace(annotation=p.empty) for p in parameters], return_annotation=signature.empty
    )
    usage = f" Usage: {what.rpartition('.')[2]}{shown}."
    given = arguments[bound:]
    name = given[0] if given else keywords.get("name")
    where = f"{what} {name!r}" if isinstance(name, str) else what
    known = [p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    by_position = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    takes_all = any(p.kind is p.VAR_KEYWORD for p in parameters)
    unknown = [key for key in keywords if key not in known and not takes_all]
    if unknown:
        near = did_you_mean(unknown[0], known) or "."
        raise StudyError(f"{where}: there is no argument {unknown[0]!r}{near}{usage}")
    if len(given) > len(by_position):
        fit = f"at most {len(by_position)} fit" if by_position else "all must be given by name"
        raise StudyError(f"{where}: {len(given)} arguments are given by position; {fit}.{usage}")
    twice = [key for key in by_position[: len(given)] if key in keywords]
    if twice:
        raise StudyError(f"{where}: {twice[0]!r} is given twice, by position and by name.{usage}")
    missing = [p.name for p in parameters if p.default is p.empty and p.name in known[len(given) :]]
    missing = [name for name in missing if name not in keywords]
    raise StudyError(f"{where}: the argument {missing[0]!r} is missing.{usage}")


def lineage(kind: type) -> list[str]:
    """Return the names of a type and its bases, nearest first, with the name of the package before each name.

    >>> lineage(StudyError)[:2]
    ['uqmbd.StudyError', 'uqmbd.UqmbdError']
    """
    return [f"{one.__module__.partition('.')[0]}.{one.__qualname__}" for one in kind.__mro__]
