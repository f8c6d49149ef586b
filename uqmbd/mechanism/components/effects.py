"""Check for parameter values that have no effect with the chosen options of a component."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.auxiliary_state import frames_of
from uqmbd.mechanism.components.component import Component, Parameter, VirtualWork
from uqmbd.mechanism.components.coordinates import pairs_of
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.expressions import as_symbolic, flatten, shown, t
from uqmbd.mechanism.geometry import Space

__all__ = ["effective_parameters", "known_effects", "no_effect", "require_effects"]


def require_effects(where: str, component: Component, space: Space, known: dict[Hashable, frozenset[str]]) -> None:
    """Raise if the value of an optional parameter has an effect only with other options.

    The `uqmbd.StudyError` names the parameter and the options for which it has an effect.  The function skips
    components without options, which `uqmbd.testing.check_component` checks.  The function adds the effective
    parameters of this component to the dict `known`, whose keys contain class, options and bodies.
    """
    declared = component.parameters()
    stated = [parameter for parameter in declared.values() if _is_stated(component, parameter)]
    if not stated or not any(parameter.words for parameter in declared.values()):
        return
    effective = known_effects(component, space, known)
    for parameter in stated:
        if parameter.name not in effective and _options_with(component, space, parameter):
            given = f"{parameter.name} is {shown(component.given[parameter.name])}"
            raise StudyError(f"{where}: {given}, but it has {no_effect(component, space, parameter)}.")


def known_effects(component: Component, space: Space, known: dict[Hashable, frozenset[str]]) -> frozenset[str]:
    """Return the effective parameters of a component; reuse the entry of an equal component in `known`, if any."""
    key = _key(component)
    if key is None:
        return effective_parameters(component, space)
    if key not in known:
        known[key] = effective_parameters(component, space)
    return known[key]


def effective_parameters(
    component: Component, space: Space, options: Mapping[str, Any] | None = None
) -> frozenset[str]:
    """Return the names of the parameters that enter a term, a reaction, a motion quantity, a drawing or a bound.

    Symbols replace all numbers, so that a zero cannot hide the effect of another parameter.  `options` replace options
    of the component.  If its method `terms` raises an error, the function returns all parameters; the derivation of the
    equations reports the error.
    """
    declared = component.parameters()
    points = {name for name, parameter in declared.items() if parameter.kind == "point"}
    found = points | {component.radius_of(name) for name in points} | {component.prescribed_angle}
    found |= {name for name, parameter in declared.items() if parameter.about}
    values, symbols_of = _symbolic(component, options or {})
    local = _RecordingLocal(space, frames_of(component), values, t, pairs_of(component))
    read, component.read = component.read, set()
    try:
        terms, point = component.stated(local)
        component.motion()
        component.coordinates()
        component.largest_speeds()
        accessed = component.read | local.accessed
        read_alone = component.read & set(declared)
    except Exception:  # the derivation of the equations reports errors in the code of a component
        return frozenset(declared)
    finally:
        component.read = read
    used = {s for e in (*_expressions(terms), *flatten(point)) for s in as_symbolic(e).free_symbols}
    entered = {name for name, own in symbols_of.items() if used & own}
    is_option = {name for name, parameter in declared.items() if parameter.kind == "option"}
    found |= entered | read_alone | (is_option & (accessed | component.prepared_from))
    if entered - set(declared):  # a used value comes from prepare(), which read parameters
        found |= component.prepared_from
    return frozenset(found)


class _RecordingLocal(Local):
    """`Local` that records the names of the attributes that the terms read."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.accessed: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if "accessed" in self.__dict__:
            self.accessed.add(name)
        return super().__getattr__(name)


def _is_stated(component: Component, parameter: Parameter) -> bool:
    """Return whether an optional parameter has a value other than 0, None and its default."""
    if parameter.required or parameter.name not in component.given:
        return False
    value = component.values.get(parameter.name)
    if parameter.kind == "option":
        return value is not None and _identity(value) != _identity(parameter.default)
    entries = flatten(() if value is None else value)
    usual = flatten(() if parameter.default is None else parameter.default)
    zero = [0] * len(entries)
    return not any(len(x) == len(entries) and all(map(_is_equal, entries, x)) for x in (zero, usual))


def _identity(option: Any) -> Hashable:
    """Return a key of an option: words and numbers by value, other objects by identity."""
    plain = isinstance(option, (str, bool, int, float))
    return (type(option), option) if plain else id(option)


def _is_equal(one: Any, other: Any) -> bool:
    one, other = as_symbolic(one), as_symbolic(other)
    return bool(one.is_number and other.is_number and float(one) == float(other))


def _key(component: Component) -> Hashable | None:
    """Return the key of a component in `known`; None if an option is neither a word nor a number."""
    parts: list[Any] = [type(component), *(body.is_ground for body in component.attached.values())]
    for name, parameter in component.parameters().items():
        value = component.values.get(name)
        if parameter.kind != "option":
            parts.append(None if value is None else len(flatten(value)))
        elif value is None or isinstance(value, (str, bool, int, float)):
            parts.append((type(value), value))
        else:
            return None
    return tuple(parts)


def _symbolic(component: Component, options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, set[sympy.Dummy]]]:
    """Return parameter values with a separate symbol for each number, and these symbols by parameter name."""
    declared = component.parameters()
    values: dict[str, Any] = {}
    symbols: dict[str, set[sympy.Dummy]] = {}
    for name, value in component.values.items():
        if value is None or (name in declared and declared[name].kind == "option"):
            values[name] = options.get(name, value)
            continue
        own = [sympy.Dummy(name, real=True) for _ in flatten(value)]
        values[name] = (sympy.Matrix(own) if own else ()) if isinstance(value, tuple) else own[0]
        symbols[name] = set(own)
    return values, symbols


def _expressions(part: Any) -> Iterator[Any]:
    """Yield the expressions of terms; for virtual work, the power."""
    if isinstance(part, VirtualWork):
        yield from (as_symbolic(f) * v for f, v in zip(flatten(part.force), flatten(part.velocity), strict=False))
    elif is_dataclass(part):
        for one in fields(part):
            yield from _expressions(getattr(part, one.name))
    elif isinstance(part, (list, tuple, sympy.MatrixBase)):
        for one in part:
            yield from _expressions(one)
    elif part is not None and not isinstance(part, str):
        yield part


def no_effect(component: Component, space: Space, parameter: Parameter) -> str:
    """Return the end of a message on a parameter without an effect: the options that cause it, and advice."""
    others = _options_with(component, space, parameter)
    having = " and ".join(f"{key}={_word(component.values[key])}" for key in _chosen(component, parameter))
    hint = ", ".join(filter(None, (parameter.description, parameter.units)))
    where = f"with {having}" if having else f"in {type(space).__name__} space"
    return f"no effect {where}, so omit it{f', or choose {_choice(others)}' if others else ''} ({hint})"


def _chosen(component: Component, parameter: Parameter) -> dict[str, Parameter]:
    """Return the other parameters whose choices are words."""
    declared = component.parameters()
    return {key: p for key, p in declared.items() if p.words and key in component.values and key != parameter.name}


def _options_with(component: Component, space: Space, parameter: Parameter) -> list[str]:
    """Return the options, in the form ``law='linear'``, for which a parameter has an effect."""
    return [
        f"{key}={word!r}"
        for key, p in _chosen(component, parameter).items()
        for word in p.words
        if _identity(component.values[key]) != _identity(word)
        and parameter.name in effective_parameters(component, space, {key: word})
    ]


def _word(option: Any) -> str:
    return f"{type(option).__name__}(...)" if not isinstance(option, (str, bool, int, float)) else repr(option)


def _choice(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
