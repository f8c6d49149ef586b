"""`--only` and `--set`: select propagators, and set their options."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import types
import typing
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, Union

from uqmbd.errors import StudyError, UqmbdError
from uqmbd.names import did_you_mean
from uqmbd.propagation import option_types

if TYPE_CHECKING:
    from uqmbd.propagation import Propagator

__all__ = ["apply_settings", "check_labels", "parse_value", "type_name"]


def check_labels(labels: Sequence[str], propagators: Sequence[Propagator]) -> None:
    """Raise a `StudyError` that lists the known labels if a label belongs to no propagator of the study."""
    known = {propagator.node_name: propagator for propagator in propagators}
    for label in labels:
        if label not in known:
            raise StudyError(
                f"--only {label}: the study has no propagator with this label{did_you_mean(label, known) or '.'}\n"
                f"{_listed(propagators)}"
            )


def apply_settings(settings: Sequence[str], propagators: Sequence[Propagator]) -> tuple[Propagator, ...]:
    """Return the propagators with options changed by ``LABEL.option=value``.

    `settings` are as on the command line; the last of several settings of an option applies. `propagators` are the
    methods of the study, which do not change. Raise StudyError if a setting has another form, or if the label, the
    option or the value is invalid; the message lists valid labels.
    """
    changes: dict[str, dict[str, Any]] = {}
    known = {propagator.node_name: propagator for propagator in propagators}
    for setting in settings:
        target, equals, text = setting.partition("=")
        label, dot, option = target.strip().rpartition(".")
        if not (equals and dot and label and option):
            example = f"{next(iter(known), 'LABEL')}.{_example(propagators)}"
            raise StudyError(f"--set {setting}: expected LABEL.option=value, such as {example}.")
        if label not in known:
            raise StudyError(
                f"--set {setting}: the study has no propagator {label!r}{did_you_mean(label, known) or '.'}\n"
                f"{_listed(propagators)}"
            )
        types_of = _option_types(known[label])
        if option not in types_of:
            raise StudyError(
                f"--set {setting}: {label!r} has no option {option!r}{did_you_mean(option, types_of) or '.'} "
                f"Its options:\n"
                f"{_options(known[label])}"
            )
        try:
            value = parse_value(text.strip(), types_of[option])
        except ValueError as error:
            raise StudyError(
                f"--set {setting}: {option} cannot be {text.strip()!r}; expected {type_name(types_of[option])}."
            ) from error
        changes.setdefault(label, {})[option] = value
    return tuple(_replaced(propagator, changes.get(propagator.node_name, {})) for propagator in propagators)


def parse_value(text: str, annotation: Any) -> Any:
    """Read a value of a type from text; raise `ValueError` if the text does not fit.

    >>> parse_value("1e-6", float), parse_value("12", int), parse_value("none", int | None), parse_value("no", bool)
    (1e-06, 12, None, False)
    >>> parse_value("3,4", tuple[int, ...]), parse_value("sobol", Literal["random", "sobol"])
    ((3, 4), 'sobol')
    >>> parse_value("plain,phase", Literal["auto"] | tuple[Literal["plain", "phase"], ...] | None)
    ('plain', 'phase')
    """
    origin, members = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return parse_value(text, members[0])
    if origin in (Union, types.UnionType):
        # a string accepts any text, so it is last
        for member in sorted(members, key=lambda member: (member is not types.NoneType, member is str)):
            try:
                return parse_value(text, member)
            except ValueError:
                continue
        raise ValueError(text)
    if origin is Literal:
        for member in members:
            if str(member) == text:
                return member
        raise ValueError(text)
    if annotation in (None, types.NoneType):
        if text.lower() in ("none", ""):
            return None
        raise ValueError(text)
    if annotation is bool:
        try:
            return {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}[text.lower()]
        except KeyError:
            raise ValueError(text) from None
    if annotation is int:
        return _integer(text)
    if annotation is float:
        return float(text)
    if annotation is str:
        return text
    try:
        value = ast.literal_eval(text)
    except (SyntaxError, ValueError):
        if origin in (tuple, list, Sequence, typing.get_origin(typing.Sequence[int])) or annotation in (tuple, list):
            return tuple(part.strip() for part in text.split(",") if part.strip())
        return text  # the propagator checks the value
    return value


def _integer(text: str) -> int:
    """Read an integer, also in the form 1e4."""
    try:
        return int(text)
    except ValueError:
        value = float(text)
        if value != int(value):
            raise
        return int(value)


def _replaced(propagator: Propagator, changes: dict[str, Any]) -> Propagator:
    if not changes:
        return propagator
    try:
        # the label, and so the name of the node, does not change
        return dataclasses.replace(propagator, **changes)
    except UqmbdError:
        raise
    except (TypeError, ValueError) as error:
        given = ", ".join(f"{propagator.node_name}.{option}={value}" for option, value in changes.items())
        raise StudyError(f"--set {given}: {error}") from error


def _option_types(propagator: Propagator) -> dict[str, Any]:
    """Return the options that may be set, with their types; the label is excluded because it selects the method."""
    known = option_types(type(propagator))  # a type that only a type checker can resolve accepts the text unchanged
    return {
        option.name: known.get(option.name, Any)
        for option in dataclasses.fields(propagator)
        if option.init and option.name != "label"
    }


def _listed(propagators: Sequence[Propagator]) -> str:
    if not propagators:
        return "The study has no propagators."
    return "Its propagators: " + ", ".join(f"{p.node_name} ({type(p).__name__})" for p in propagators) + "."


def _options(propagator: Propagator) -> str:
    """List options with type, value in the study, and default."""
    lines = []
    fields = {option.name: option for option in dataclasses.fields(propagator)}
    for name, annotation in _option_types(propagator).items():
        factory = fields[name].default_factory
        default = fields[name].default if factory is dataclasses.MISSING else factory()
        text = "no default" if default is dataclasses.MISSING else f"default {default!r}"
        value = getattr(propagator, name)
        now = "" if value is default or value == default else f"; {value!r} in the study"
        lines.append(f"  {name}: {type_name(annotation)}, {text}{now}")
    return "\n".join(lines) or "  (no options)"


def type_name(annotation: Any) -> str:
    """Return the description of a type as text.

    >>> type_name(int | None), type_name(Literal["a", "b"]), type_name(tuple[int, ...])
    ('int or none', "'a' or 'b'", 'tuple[int, ...]')
    >>> type_name(tuple[Literal["a", "b"], ...])
    "several of 'a', 'b'"
    """
    origin, members = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return type_name(members[0])
    if origin in (Union, types.UnionType):
        return " or ".join(type_name(member) for member in members)
    if origin is Literal:
        return " or ".join(repr(member) for member in members)
    if origin is tuple and typing.get_origin(members[0]) is Literal:
        return "several of " + ", ".join(repr(member) for member in typing.get_args(members[0]))
    if annotation is types.NoneType:
        return "none"
    if annotation is Any:
        return "a value"
    return annotation.__name__ if inspect.isclass(annotation) and not members else str(annotation)


def _example(propagators: Sequence[Propagator]) -> str:
    for propagator in propagators:
        for name in _option_types(propagator):
            return f"{name}={getattr(propagator, name)}"
    return "samples=100"
