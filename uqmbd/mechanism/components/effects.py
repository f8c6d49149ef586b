"""Parameters without an effect: a value that only matters with other options than those chosen is refused."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.auxiliary_state import frames_of
from uqmbd.mechanism.components.component import Component, Parameter, VirtualWork
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.expressions import as_symbolic, flatten, shown, t
from uqmbd.mechanism.geometry import Space

__all__ = ["effective_parameters", "known_effects", "no_effect", "require_effects"]


def require_effects(where: str, component: Component, space: Space, known: dict[Hashable, frozenset[str]]) -> None:
    """Raise where an optional parameter has a value that has an effect with other options only.

    The `uqmbd.StudyError` names the parameter, and the options with which it has an effect.  Components without options
    are checked by `uqmbd.testing.check_component`.  The dict `known` stores the effective parameters of earlier
    components by class, options and bodies; those of this component are added.
    """
    declared = component.parameters()
    stated = [parameter for parameter in declared.values() if _is_stated(component, parameter)]
    if not stated or not any(parameter.words for parameter in declared.values()):
        return
    effective = known_effects(component, space, known)
    for parameter in stated:
        if parameter.name not in effective and _options_with(component, space, parameter):
            given = f"{parameter.name} is {shown(component.given[parameter.name])}"
            raise StudyError(f"{where}: {given}; it has {no_effect(component, space, parameter)}.")


def known_effects(component: Component, space: Space, known: dict[Hashable, frozenset[str]]) -> frozenset[str]:
    """Return the effective parameters of a component, looked up in `known` where one like it has been seen."""
    key = _key(component)
    if key is None:
        return effective_parameters(component, space)
    if key not in known:
        known[key] = effective_parameters(component, space)
    return known[key]


def effective_parameters(
    component: Component, space: Space, options: Mapping[str, Any] | None = None
) -> frozenset[str]:
    """Return the names of the parameters that enter a term, a reaction, the motion that it returns, or a drawing.

    All numbers are symbols here: none is without effect only because another one is zero.  `options` replace those
    that the component has.  Where its terms raise an error, all are returned: that error is reported elsewhere.
    """
    declared = component.parameters()
    points = {name for name, parameter in declared.items() if parameter.kind == "point"}
    found = points | {component.radius_of(name) for name in points} | {component.prescribed_angle}
    found |= {name for name, parameter in declared.items() if parameter.about}
    values, symbols_of = _symbolic(component, options or {})
    local = _Watched(space, frames_of(component), values, t)
    read, component.read = component.read, set()
    try:
        terms, point = component.stated(local)
        component.motion()
        asked = component.read | local.asked
        read_alone = component.read & set(declared)
    except Exception:  # of the author of the component, who learns of it when the equations are made
        return frozenset(declared)
    finally:
        component.read = read
    used = {s for e in (*_expressions(terms), *flatten(point)) for s in as_symbolic(e).free_symbols}
    entered = {name for name, own in symbols_of.items() if used & own}
    is_option = {name for name, parameter in declared.items() if parameter.kind == "option"}
    found |= entered | read_alone | (is_option & (asked | component.prepared_from))
    if entered - set(declared):  # a value that prepare() made of them
        found |= component.prepared_from
    return frozenset(found)


class _Watched(Local):
    """A `Local` that records the names that are read."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.asked: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if "asked" in self.__dict__:
            self.asked.add(name)
        return super().__getattr__(name)


def _is_stated(component: Component, parameter: Parameter) -> bool:
    """Return whether a parameter that may be left out was given a value other than 0, None and its default."""
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
    """Return the identity of an option: plain words and numbers by value, others by the object."""
    plain = isinstance(option, (str, bool, int, float))
    return (type(option), option) if plain else id(option)


def _is_equal(one: Any, other: Any) -> bool:
    one, other = as_symbolic(one), as_symbolic(other)
    return bool(one.is_number and other.is_number and float(one) == float(other))


def _key(component: Component) -> Hashable | None:
    """Return the key of the effects of a component; None if an option is no plain word or number."""
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
    """Return values of parameters in which each number is a separate symbol, and the symbols by name."""
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
    """Yield the expressions of terms; of work, the power."""
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
    """Return the end of a sentence on a parameter without an effect: the options that cause this, and advice."""
    others = _options_with(component, space, parameter)
    having = " and ".join(f"{key}={_word(component.values[key])}" for key in _chosen(component, parameter))
    hint = ", ".join(filter(None, (parameter.description, parameter.units)))
    where = f"with {having}" if having else f"in {type(space).__name__} space"
    return f"no effect {where}, so leave it out{f', or choose {_choice(others)}' if others else ''} ({hint})"


def _chosen(component: Component, parameter: Parameter) -> dict[str, Parameter]:
    """Return the other parameters that are one of some words."""
    declared = component.parameters()
    return {key: p for key, p in declared.items() if p.words and key in component.values and key != parameter.name}


def _options_with(component: Component, space: Space, parameter: Parameter) -> list[str]:
    """Return the options, as ``law='linear'``, with which a parameter has an effect."""
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
