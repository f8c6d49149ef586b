"""Motion quantities of a component: their rates are consistent, and independent of the pose of the whole mechanism."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import sympy

from uqmbd.mechanism import AngleSymbol, as_symbolic, motion_quantities
from uqmbd.testing.components.bench import Bench
from uqmbd.testing.components.motion import displaced, random_turn
from uqmbd.typing import Array

__all__ = ["check_motion_rates"]

STEP = 1e-5
"""Of central differences, s."""


class MotionRate(NamedTuple):
    """One motion quantity: its value up to whole turns, its stated rate, and the rate of its value."""

    name: str
    value: float
    stated: float
    derived: float
    period: float


def check_motion_rates(bench: Bench, row: int, q: Array, v: Array, gradient: Array, rng: np.random.Generator) -> None:
    """Check that stated rates are those of angles and displacements, independent of the pose of the whole mechanism.

    q and v are a state of realisation `row` at which the constraints hold; `gradient` is theirs, (m, n). Raise
    AssertionError otherwise.
    """
    if not motion_quantities(bench.case.component):
        return
    space = bench.case.mechanism.space
    rows = gradient
    if space.turns:
        norms = np.zeros((len(bench.instance.bodies), len(q)))
        for k in range(len(norms)):
            part = slice(k * space.size + space.dimension, (k + 1) * space.size)
            norms[k, part] = q[part]
        rows = np.concatenate([gradient, norms])
    v = v - np.linalg.lstsq(rows, rows @ v, rcond=1e-10)[0] if len(rows) else v
    here = list(_values(bench, row, q, v))
    turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
    there = list(_values(bench, row, displaced(space, turn, q, shift), displaced(space, turn, v)))
    between = bench.case.free and len(bench.case.component.bodies) > 1
    for one, other in zip(here, there, strict=True):
        assert np.isfinite([one.value, one.stated]).all(), f"{bench.title}: its {one.name} is no number: {one.value}."
        error = abs(one.stated - one.derived)
        assert error < 1e-6 * (1 + abs(one.derived)), (
            f"{bench.title}: the stated rate of its {one.name} is {one.stated:.6g}, and its {one.name} changes at "
            f"{one.derived:.6g}; leave rate= out, and it is derived."
        )
        change = other.value - one.value
        change -= one.period * round(change / one.period) if one.period else 0.0
        assert not between or abs(change) < 1e-6 * (1 + abs(one.value)), (
            f"{bench.title}: its {one.name} changes by {change:.2g} when everything is moved and turned as a whole."
        )


def _values(bench: Bench, row: int, q: Array, v: Array) -> Iterator[MotionRate]:
    """Yield the motion quantities as numbers; rates of values by central differences."""
    size = bench.case.mechanism.space.size
    symbols = [x for body in bench.instance.bodies for x in (*body.q, *body.v)]
    inputs = dict(zip(bench.case.mechanism.inputs.variables, map(sympy.Float, bench.inputs[row]), strict=True))

    def function(e: Any, constants: Mapping[sympy.Symbol, Any] | None = None) -> Callable[[Array], float]:
        known = {k: as_symbolic(x).xreplace(inputs).evalf() for k, x in (constants or {}).items()}
        compiled = sympy.lambdify(symbols, as_symbolic(e).xreplace({**inputs, **known}))

        def at(place: Array) -> float:
            parts = zip(place.reshape(-1, size), v.reshape(-1, size), strict=True)
            return float(compiled(*(x for pair in parts for part in pair for x in part)))

        return at

    def rate(f: Callable[[Array], float]) -> float:
        return (f(q + STEP * v) - f(q - STEP * v)) / (2 * STEP)

    found = motion_quantities(bench.case.component)
    for name, motion in bench.case.component.motion().items():
        if motion is None:
            continue
        value = found[name][0]
        if isinstance(value, AngleSymbol):
            angle = value.angle
            speed = function(angle.rate, angle.constants)(q)
            cosine, sine = (function(x, angle.constants) for x in (angle.cosine, angle.sine))
            c, s = cosine(q), sine(q)
            derived = angle.parts * (c * rate(sine) - s * rate(cosine)) / (c**2 + s**2)
            yield MotionRate(name, angle.parts * float(np.arctan2(s, c)), speed, derived, 2 * np.pi)
        else:
            displacement = function(value)
            yield MotionRate(name, displacement(q), function(found[motion.speed][0])(q), rate(displacement), 0.0)
