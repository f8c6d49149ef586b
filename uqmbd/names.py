"""Names, units and arguments that users give: one rule for bodies, components, outputs, random variables, methods."""

from __future__ import annotations

import difflib
import functools
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from uqmbd.errors import StudyError

__all__ = [
    "ANY",
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
"""Names of the parts of results, which no method can have."""

ANY = "any"
"""Name of the event that one requirement or another is violated."""

LONGEST_LABEL = 200
"""Bytes of a label: it names files as well."""


_UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Control characters, halves of characters, and what is none: files, pages and terminals cannot hold them."""


_DIGITS = re.compile(r"([0-9]+)")


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Return by what names are sorted, so that the second of numbered ones comes before the tenth.

    >>> sorted(["road_10", "road_2", "road_1", "mass"], key=natural_order)
    ['mass', 'road_1', 'road_2', 'road_10']
    """
    return [int(part) if k % 2 else part for k, part in enumerate(_DIGITS.split(name))], name


def unwritable(text: str) -> str:
    r"""Name the first character of a text that files, pages and terminals cannot hold; empty if there is none.

    Tabs and ends of lines are allowed, and so is every printable character of any script.

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
    """Return `name` if it can be one, else raise.

    `name`: what the user gave; `what`: what it is to name, for the message. Raise StudyError if it is not a text,
    empty, contains ``/`` or a control character, or is ``time``, ``.`` or ``..``.

    >>> check_name("crank", "body")
    'crank'
    """
    if not isinstance(name, str):
        raise StudyError(
            f"{what}: the name is {name!r} ({type(name).__name__}); expected a text. The name is the first argument."
        )
    if not name.strip():
        raise StudyError(f"{what}: the name is empty; give it one that you will recognise in plots and tables.")
    mark = "'/', which separates groups in result files" if "/" in name else unwritable(name)
    if not mark and len(name.splitlines()) > 1 or set(name) & _BREAKS:
        mark = "tabs or ends of lines, which break tables and messages"
    if mark:
        raise StudyError(f"{what} {name!r}: a name cannot contain {mark}.")
    if name in (".", ".."):
        raise StudyError(f"{what} {name!r}: that name denotes a folder; choose another one.")
    if name == "time":
        raise StudyError(f"{what} 'time': that name is taken by the time axis of the results; choose another.")
    return name


def check_label(label: object) -> str:
    """Return the label of a method if it can name results and files, else raise.

    `label`: what the user gave. Raise StudyError if it is no name, a name that results use themselves, or too long.

    >>> check_label("order 4")
    'order 4'
    """
    name = check_name(label, "label")
    if name in RESERVED_LABELS:
        raise StudyError(
            f"label {name!r}: that name belongs to a part of the results; choose another; reserved are "
            f"{', '.join(sorted(RESERVED_LABELS))}."
        )
    if len(name.encode()) > LONGEST_LABEL:
        raise StudyError(
            f"label {name[:40] + '...'!r}: it has {len(name)} characters and names files, too; take at most "
            f"{LONGEST_LABEL} bytes."
        )
    return name


def check_units(units: object, where: str) -> str:
    """Return units if they are a text, else raise; warn where they are spelt in another way than here.

    `units`: what the user gave; an empty text where there are none; `where`: what they belong to, for the message.
    Raise StudyError if they are no text, or contain a control character. Warn by UnitsWarning if they are no units,
    or are to be written in another way.

    >>> check_units("kg m^2", "output 'inertia'")
    'kg m^2'
    """
    if not isinstance(units, str):
        raise StudyError(f"{where}: units is {units!r} ({type(units).__name__}); expected a text such as 'm' or 'N m'.")
    if mark := unwritable(units):
        raise StudyError(f"{where}: units is {units!r}; units cannot contain {mark}.")
    if set(units) & _BREAKS:
        raise StudyError(f"{where}: units is {units!r}; units cannot contain tabs or ends of lines.")
    from uqmbd.units import spelling, warn  # which `uqmbd --help` does not need

    if told := spelling(where, units):
        warn(told)
    return units


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the known name that is nearest to a misspelt one, as the end of a sentence; empty if none is near.

    `name`: what the user gave; `known`: what there is.

    >>> did_you_mean("colocation", ["monte-carlo", "collocation"])
    "; did you mean 'collocation'?"
    >>> did_you_mean("x", ["monte-carlo", "collocation"])
    ''
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function refuse arguments that it does not have, as everything else is refused.

    Python's own TypeError says neither which name was meant nor what there is.

    >>> @checked
    ... def spring(stiffness, damping=0):
    ...     return stiffness
    >>> spring(2, dampnig=1)
    Traceback (most recent call last):
    uqmbd.errors.StudyError: spring: there is no argument 'dampnig'; did you mean 'damping'? Usage: spring(stiffness,
    damping=0).
    """
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
    """Raise unless a call fits a signature.

    `what`: what is called, for the message; `signature`: what it takes; `arguments`, `keywords`: what it is given;
    `bound`: whether its first argument is the object or the class, which users do not see. Raise StudyError naming
    the argument that is unknown, missing, given twice or too many.
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
    """Name a type and its bases, the nearest first, each after its package.

    >>> lineage(StudyError)[:2]
    ['uqmbd.StudyError', 'uqmbd.UqmbdError']
    """
    return [f"{one.__module__.partition('.')[0]}.{one.__qualname__}" for one in kind.__mro__]
