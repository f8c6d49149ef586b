"""Check that the rates of motion quantities are consistent, and independent of the pose of the whole mechanism."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import sympy

from uqmbd.mechanism import AngleSymbol, as_symbolic, motion_quantities
from uqmbd.testing.components.bench import Bench, norm_rows, own_coordinates
from uqmbd.testing.components.motion import displaced, random_turn
from uqmbd.typing import Array

__all__ = ["check_motion_rates"]

STEP = 1e-5
"""Step of central differences, s."""


class MotionRate(NamedTuple):
    """Motion quantity: value up to whole turns, stated rate, and rate of the value."""

    name: str
    value: float
    stated: float
    derived: float
    period: float


def check_motion_rates(bench: Bench, row: int, q: Array, v: Array, gradient: Array, rng: np.random.Generator) -> None:
    """Check the stated rates of angles and displacements, and their independence from the pose of the mechanism.

    q and v are a state of realisation `row` that satisfies the constraints; `gradient` (m, n) is the gradient of the
    constraints. Raise AssertionError if the check fails.
    """
    if not motion_quantities(bench.case.component):
        return
    space = bench.case.mechanism.space
    rows, own = np.concatenate([gradient, norm_rows(bench.instance, q)]), own_coordinates(bench.instance)
    v = v - np.linalg.lstsq(rows, rows @ v, rcond=1e-10)[0] if len(rows) else v
    compiled = _compile(bench, row)
    here = list(compiled.values(q, v))
    turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
    there = list(compiled.values(displaced(space, turn, q, shift, own), displaced(space, turn, v, own=own)))
    between = bench.case.free and len(bench.case.component.bodies) > 1
    for one, other in zip(here, there, strict=True):
        assert np.isfinite([one.value, one.stated]).all(), (
            f"{bench.title}: its {one.name} evaluates to {one.value}; expected a finite number."
        )
        error = abs(one.stated - one.derived)
        assert error < 1e-6 * (1 + abs(one.derived)), (
            f"{bench.title}: the declared rate of its {one.name} is {one.stated:.6g}, but the derivative of its "
            f"{one.name} is {one.derived:.6g}. Omit rate=; the rate is then derived automatically."
        )
        change = other.value - one.value
        change -= one.period * round(change / one.period) if one.period else 0.0
        assert not between or abs(change) < 1e-6 * (1 + abs(one.value)), (
            f"{bench.title}: its {one.name} changes by {change:.2g} when the whole mechanism is translated and "
            "rotated; expected no change."
        )


class _Compiled(NamedTuple):
    """Compiled motion quantities of one realisation."""

    quantities: list[
        tuple[str, int]
    ]  # name; angle divided by the angle of its cosine and sine, or 0 for a displacement
    function: Callable[
        ..., list[float]
    ]  # functions of poses and velocities of all bodies: rate, and cosine and sine or value

    def at(self, q: Array, v: Array) -> Array:
        """Evaluate the quantities at poses q and velocities v."""
        return np.array(self.function(*q, *v), dtype=float)

    def values(self, q: Array, v: Array) -> Iterator[MotionRate]:
        """Yield the motion quantities as numbers, with rates of values by central differences."""
        values = iter(self.at(q, v))
        rates = iter((self.at(q + STEP * v, v) - self.at(q - STEP * v, v)) / (2 * STEP))
        for name, parts in self.quantities:
            stated, _ = next(values), next(rates)
            if parts:
                (c, dc), (s, ds) = ((next(values), next(rates)) for _ in range(2))
                derived = parts * (c * ds - s * dc) / (c**2 + s**2)
                yield MotionRate(name, parts * float(np.arctan2(s, c)), stated, derived, 2 * np.pi)
            else:
                yield MotionRate(name, next(values), stated, next(rates), 0.0)


def _compile(bench: Bench, row: int) -> _Compiled:
    """Compile the motion quantities of realisation `row`.

    SymPy compiles all expressions at once, independently of kernels, because they share most of their terms.
    """
    owners = bench.instance.owners
    symbols = [*(x for one in owners for x in one.q), *(x for one in owners for x in one.v)]
    inputs = dict(zip(bench.case.mechanism.inputs.variables, map(sympy.Float, bench.inputs[row]), strict=True))
    found = motion_quantities(bench.case.component)
    quantities: list[tuple[str, int]] = []
    expressions: list[Any] = []
    for name, motion in bench.case.component.motion().items():
        if motion is None:
            continue
        value = found[name][0]
        angle = value.angle if isinstance(value, AngleSymbol) else None
        parts = (found[motion.speed][0], value) if angle is None else (angle.rate, angle.cosine, angle.sine)
        constants = {} if angle is None else angle.constants
        known = {k: as_symbolic(x).xreplace(inputs).evalf() for k, x in constants.items()}
        expressions += [as_symbolic(x).xreplace({**inputs, **known}) for x in parts]
        quantities.append((name, angle.parts if angle else 0))
    return _Compiled(quantities, sympy.lambdify(symbols, expressions, cse=True))
