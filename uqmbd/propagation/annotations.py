"""Check options of methods against the annotations of their fields, for scripts and the command line."""

from __future__ import annotations

import contextlib
import dataclasses
import typing
from functools import lru_cache
from typing import Any, ClassVar, Protocol

from uqmbd.arguments import Bounds, bounded, each, fits, is_one, members, refusal, several
from uqmbd.errors import StudyError

__all__ = ["Bounds", "MethodClass", "check_options", "option_types", "plain"]


class MethodClass(Protocol):
    """Class of a method with its registered name; the fields of the class are the options."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]


def check_options(kind: type, options: dict[str, Any]) -> None:
    """Raise StudyError for an option whose value does not fit the annotation of its field in the dataclass.

    Options that contain objects of a class are checked by the method, which can suggest suitable classes.
    """
    declared = option_types(kind)
    for name, value in options.items():
        if name in declared and not _names_a_class(declared[name]) and not fits(value, declared[name]):
            raise StudyError(f"{kind.__name__}: {refusal(name, value, declared[name])}")


def _names_a_class(annotation: Any) -> bool:
    """Return whether an annotation allows instances of a class other than texts and numbers."""
    return any(isinstance(x, type) and x.__module__ != "builtins" for x in members(annotation))


@lru_cache(maxsize=64)
def option_types(kind: type) -> dict[str, Any]:
    """Return the field annotations of a dataclass, except annotations that only type checkers can resolve."""
    found: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        owner = next(base for base in kind.__mro__ if field.name in vars(base).get("__annotations__", {}))
        one = type("One", (), {"__annotations__": {field.name: field.type}, "__module__": owner.__module__})
        with contextlib.suppress(NameError, TypeError):
            found[field.name] = typing.get_type_hints(one, include_extras=True)[field.name]
    return found


def plain(value: Any, annotation: Any) -> Any:
    """Return an option as a Python number, or a tuple of numbers, if it fits its annotation with bounds.

    >>> from typing import Annotated
    >>> import numpy as np
    >>> plain(np.int64(3), Annotated[int, Bounds(0)]), plain([1, 2], Annotated[tuple[float, ...], Bounds(0)])
    (3, (1.0, 2.0))
    """
    for member in members(annotation):
        base, bounds = bounded(member)
        if several(base) and isinstance(value, list):
            return tuple(value)
        if bounds is None or value is None or not is_one(value, member):
            continue
        if typing.get_origin(base) is tuple:
            return tuple(typing.get_args(base)[0](x) for x in each(value))
        return base(value)
    return value
