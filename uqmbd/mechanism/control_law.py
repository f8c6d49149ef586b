"""Laws of sampled controllers as expressions of measured values, states, time and random variables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import describe_foreign_part, foreign_part, numbers, path_keys, shown, t
from uqmbd.randomness import RandomVariable

__all__ = ["ControlLaw", "traced_law"]


@dataclass(frozen=True)
class ControlLaw:
    """Commands and new states of a controller as expressions of the arguments, time and random variables."""

    arguments: tuple[sympy.Symbol, ...]  # measured values, then states
    results: tuple[sympy.Expr, ...]  # commands, then new states


def traced_law(
    where: str, law: Callable[..., Any], measured: int, commands: Sequence[str], states: Sequence[str]
) -> ControlLaw:
    """Call the law of a controller once with symbols, and return its expressions; raise if they are invalid."""
    seen = tuple(sympy.Symbol(f"measured[{k}]", real=True) for k in range(measured))
    held = tuple(sympy.Symbol(f"state[{name}]", real=True) for name in states)
    given = (t, seen, held) if held else (t, seen)
    called = f"law(time, measured{', state' * bool(held)})"
    about = (
        f"uqmbd calls {called} once, with symbols: measured is a tuple of {measured} symbol{'s' * (measured > 1)}"
        f"{f', and state of {len(held)}' if held else ''}. Use the functions of SymPy, such as sympy.Piecewise and "
        "sympy.Min; a function of arrays of numbers is passed as function=..."
    )
    try:
        found = law(*given)
    except Exception as error:
        raise StudyError(f"{where}: its law raised {type(error).__name__}: {error}. {about}") from error
    if held and not (isinstance(found, (tuple, list)) and len(found) == 2):
        raise StudyError(
            f"{where}: its law returned {shown(found)}; expected the pair (commands, state), because the controller "
            f"has the state{'s' * (len(held) > 1)} {', '.join(map(repr, states))}. {about}"
        )
    pair = found if held else (found, ())
    results: list[sympy.Expr] = []
    for what, names, value in (("commands", commands, pair[0]), ("new states", states, pair[1])):
        if names:
            results += numbers(where, f"the law's {what}", value, len(names), ", ".join(names))
    allowed = {t, *seen, *held}
    for name, result in zip((*commands, *states), results, strict=True):
        symbols = result.free_symbols - allowed
        strange = sorted((s for s in symbols if not isinstance(s, RandomVariable)), key=str)
        if strange or path_keys(result):
            part = f"contains {strange[0]}" if strange else "depends on a sampled path"
            raise StudyError(
                f"{where}: the law of {name!r} {part}; expected an expression of the arguments of the law, random "
                "variables and uqmbd.t. List other quantities in measured."
            )
        if (foreign := foreign_part(result)) is not None:
            raise StudyError(f"{where}: the law of {name!r} is invalid: {describe_foreign_part(foreign)}")
    return ControlLaw((*seen, *held), tuple(results))
