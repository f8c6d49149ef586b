"""Declarations of a component class: checks at the definition of the class, and texts for `help` and editors."""

from __future__ import annotations

import inspect
import re
import sys
import textwrap
from collections.abc import Mapping
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.local import RESERVED
from uqmbd.mechanism.components.parameter import Parameter
from uqmbd.mechanism.components.world_pose import KEYWORDS, Declared, replaced
from uqmbd.mechanism.geometry import NamedFrame

__all__ = ["declare", "require_annotated"]

SYMBOLS = (
    "ball", "coil", "contact", "cylinder", "damper", "driver", "force", "hinge", "line", "plane", "rod", "skate",
    "slide", "spring", "torque", "universal", "weld", "wheel",
)  # fmt: skip
"""Symbols for drawings of components."""

KINDS = {
    "scalar": "number or expression",
    "turning_axis": "axis",
    "rotation": "quaternion or matrix; in planar space an angle",
    "numbers": "numbers or expressions",
    "option": "expression",
}
"""Kinds of parameters, and their names in words."""

SECTION = re.compile(r"^[A-Z][A-Za-z ]+\n-{3,}$", re.MULTILINE)
"""Heading of a section of a docstring."""


def declare(component: type[Declared]) -> None:
    """Check the declaration of a component class, and set the signature and the docstring of the class.

    Raises `uqmbd.StudyError` if the drawing symbol of the class is unknown. A parameter must not hide an attribute of
    `Local` or refer to an undeclared body or point.
    """
    name, bodies, parameters = component.__name__, component.bodies, component.parameters()
    if component.symbol and component.symbol not in SYMBOLS:
        known = ", ".join(map(repr, SYMBOLS))
        raise StudyError(f"{name}: symbol is {component.symbol!r}; expected one of {known}.")
    if hidden := sorted(RESERVED & parameters.keys()):
        raise StudyError(
            f"{name}: the parameter name {hidden[0]!r} is reserved, because p.{hidden[0]} has another meaning in "
            "terms(); choose another name."
        )
    _require_listed(component)
    points = tuple(key for key, other in parameters.items() if other.kind == "point")
    for key, parameter in parameters.items():
        for word, stated, there in (("body", parameter.body, bodies), ("about", parameter.about, points)):
            if stated and stated not in there:
                expected = ", ".join(map(repr, there)) or "no value, because the class declares none"
                raise StudyError(f"{name}: parameter {key!r}: {word} is {stated!r}; expected {expected}.")
    component.__signature__ = _signature(component)
    if "__doc__" in vars(component) and component.__doc__:
        component.__doc__ = _described(component, inspect.cleandoc(component.__doc__))


def _require_listed(component: type[Declared]) -> None:
    """Raise `uqmbd.StudyError` if a class annotates a body that is not in `bodies`."""
    bodies = component.bodies
    annotated = [key for key, kind in _annotations(component).items() if _is_frame(kind)]
    unlisted = [key for key in annotated if key not in bodies]
    if unlisted:
        # one class of the order, `Component`, has default names
        stated = sum("bodies" in vars(base) for base in component.__mro__) > 1
        suggested = [*(bodies if stated else ()), *(key for key in annotated if not stated or key in unlisted)]
        raise StudyError(
            f"{component.__name__}: {unlisted[0]!r} is annotated as a body, but bodies is "
            f"{bodies!r}{'' if stated else ', the default'}. Write bodies = {tuple(dict.fromkeys(suggested))!r}; "
            "annotate other attributes with ClassVar."
        )


def _is_frame(kind: Any) -> bool:
    """Return whether an annotation (a class or its name as text) is `NamedFrame`, the type of bodies."""
    text = kind if isinstance(kind, str) else getattr(kind, "__name__", "")
    return text.strip("'\" ").rpartition(".")[2] == NamedFrame.__name__


def require_annotated(component: type[Declared]) -> None:
    """Raise `uqmbd.StudyError` if type checkers would see other arguments of a class than declared.

    The error occurs if a body or parameter lacks an annotation, if another attribute has one, or if the order differs.
    """
    name, parameters = component.__name__, component.parameters()
    seen: dict[str, Any] = {}
    for base in reversed(component.__mro__):
        seen.update({key: found for key, found in _annotations(base).items() if "ClassVar" not in str(found)})
    expected = ["name", *component.bodies, *parameters]
    for key in expected[1:]:
        kind = f"uqmbd.Parameter[...] = {parameters[key]!r}" if key in parameters else "uqmbd.extend.NamedFrame"
        if key not in seen:
            raise StudyError(f"{name}: {key!r} has no type annotation, so type checkers ignore it. Write {key}: {kind}")
    if component.grounded:
        raise StudyError(
            f"{name}: a uqmbd.extend.TypedComponent cannot have an optional body as a field. Derive from "
            "uqmbd.Component, and declare __init__ for type checkers."
        )
    if list(seen) != expected:
        raise StudyError(
            f"{name}: type checkers see the arguments ({', '.join(seen)}); expected ({', '.join(expected)}). Declare "
            "name, bodies and parameters in this order, and annotate other attributes with ClassVar."
        )
    late = ""
    for key, parameter in parameters.items():
        if late and parameter.required and not parameter.left_out:
            raise StudyError(
                f"{name}: {key!r} has no default, but follows {late!r}, which has a default. Reverse their order, or "
                "give it a default (for a turning_axis: default=())."
            )
        late = late if parameter.required and not parameter.left_out else key


def _annotations(kind: type) -> Mapping[str, Any]:
    if sys.version_info >= (3, 14):
        import annotationlib

        return annotationlib.get_annotations(kind, format=annotationlib.Format.STRING)
    found: Mapping[str, Any] = vars(kind).get("__annotations__", {})
    return found


def _signature(component: type[Declared]) -> inspect.Signature:
    """Return the signature of a component class; the annotation of each parameter argument is its `Parameter`."""
    grounded, empty = component.grounded, inspect.Parameter.empty
    anywhere, by_name = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    parts = [inspect.Parameter("name", anywhere, annotation=str)]
    parts += [inspect.Parameter(x, anywhere, annotation=NamedFrame) for x in component.bodies if x not in grounded]
    defaulted = False
    for key, parameter in component.parameters().items():
        default = () if parameter.kind == "turning_axis" else empty if parameter.required else parameter.default
        defaulted = defaulted or default is not empty
        # a required argument after an optional one must be a keyword argument in a signature
        kind = by_name if (defaulted and default is empty) or parts[-1].kind is by_name else anywhere
        parts.append(inspect.Parameter(key, kind, default=default, annotation=parameter))
    optional = dict.fromkeys(grounded, NamedFrame) | _in_world(component)
    parts += [inspect.Parameter(x, by_name, default=None, annotation=kind) for x, kind in optional.items()]
    return inspect.Signature(parts)


def _in_world(component: type[Declared]) -> dict[str, Any]:
    """Return declarations of the arguments ``at`` and ``axis``, which are poses in the world frame."""
    return {
        word: Parameter(
            "m" if word == "at" else "1",
            f"in world axes, in the given pose, instead of {' and '.join(names)}",
            kind=component.parameters()[names[0]].kind,
            default=None,
        )
        for word in KEYWORDS
        if (names := replaced(component, word))
    }


def _described(component: type[Declared], text: str) -> str:
    """Return a docstring with a section on the parameters; add the section if it is missing."""
    if re.search(r"^Parameters\n-{3,}$", text, re.MULTILINE):
        return text
    lines = ["Parameters", "----------", "name : str", "    Unique in its mechanism."]
    for body in component.bodies:
        ground = "; if omitted: the ground" if body in component.grounded else ""
        lines += [f"{body} : body of the mechanism, or its ground{ground}"]
    for key, parameter in {**component.parameters(), **_in_world(component)}.items():
        lines += [f"{key} : {_in_words(parameter)}", *_indented(_sentence(parameter))]
    section = SECTION.search(text)
    place = len(text) if section is None else section.start()
    return "\n".join([text[:place].rstrip(), "", *lines, *(["", text[place:]] if section else [])])


def _in_words(parameter: Parameter) -> str:
    """Return type, units and default of a parameter as text."""
    words = ", ".join(x.__name__ if isinstance(x, type) else repr(x) for x in parameter.choices)
    kind = f"{{{words}}}" if words else KINDS.get(parameter.kind, parameter.kind)
    units = f" [{parameter.units}]" if parameter.units else ""
    return f"{kind}{units}" + ("" if parameter.required else f", default {parameter.default!r}")


def _sentence(parameter: Parameter) -> str:
    """Return description and range of a parameter as text."""
    words = parameter.description[:1].upper() + parameter.description[1:]
    return words + (f"; {parameter.range_text}." if parameter.ranged else "." * bool(words))


def _indented(text: str) -> list[str]:
    return textwrap.wrap(text, 110, initial_indent="    ", subsequent_indent="    ")
