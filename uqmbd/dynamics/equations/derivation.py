"""Derivation of residuals, Jacobians and other equations from the terms of a block, by SymEngine.

All derivatives are symbolic; none is coded by hand.

Let ``psi = d Phi / dt`` be the constraints at velocity level, and ``D = d psi / d v``. ``D`` equals ``Phi_q`` for
geometric constraints, and remains valid with auxiliary states in constraints or potentials. The stabilised index-2 form
(Gear, Leimkuhler and Gupta, 1985) is::

    0 = q' - v + D^T mu
    0 = s' - g(q, v, s, t)
    0 = M v' + h - Q + D^T lambda
    0 = Phi
    0 = psi

A constraint between velocities only defines ``psi`` directly. Such a constraint has no ``Phi`` and does not contribute
to ``D^T mu``; the row of its ``Phi`` is ``0 = mu``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import symengine as se

from uqmbd.compiled import Kernel, compile_kernel
from uqmbd.dynamics.equations.block import BlockType
from uqmbd.dynamics.equations.layout import Kind, argument_names
from uqmbd.dynamics.equations.tables import Tables

__all__ = ["BlockSymbols", "DerivedEquations", "derive"]


@dataclass(frozen=True)
class DerivedEquations:
    """SymEngine expressions of one kind, each with a target."""

    expressions: list[Any]
    # ("r", row) for a vector entry, ("J", row, column) for a matrix entry, etc., with local variables ("q", 3)
    targets: list[tuple[Any, ...]]


class BlockSymbols:
    """Local symbols of a block and its derived expressions."""

    def __init__(self, block: BlockType) -> None:
        n, m, k = block.coordinates, len(block.constraints), len(block.states)
        self.block = block
        self.tables = Tables()
        self.q, self.v, self.a, self.qd = (_symbols(x, n) for x in ("q", "v", "a", "d"))
        self.s, self.sd = _symbols("s", k), _symbols("r", k)
        self.l, self.m = _symbols("l", m), _symbols("m", m)
        self.p = _symbols("p", block.parameters)
        self.h = _symbols("h", block.held)
        self.f = _symbols("f", sum(len(e.directions) for e in block.events))
        self.t, self.c = se.Symbol("_t"), se.Symbol("_c")
        convert = self.converted = self._converter()
        self.kinetic, self.potential = convert(block.kinetic), convert(block.potential)
        self.work = [(convert(f), convert(w)) for f, w in block.work]
        self.stated = [convert(e) for e in block.constraints]
        self.holonomic = block.holonomic
        self.phi = [e if h else se.Integer(0) for e, h in zip(self.stated, self.holonomic, strict=True)]
        self.g = [convert(e) for e in block.rates]
        self.s0 = [convert(e) for e in block.initial]
        self.cosines = [convert(e) for e in block.cosines]
        self.events = [
            (convert(e.guard), [convert(w) for w in e.directions], convert(e.restitution), convert(e.friction))
            for e in block.events
        ]
        self._derive()

    def _converter(self) -> Callable[[Any], Any]:
        """Return the conversion from SymPy to SymEngine, with the definitions of named quantities.

        The conversion inserts definitions, because SymEngine keeps one copy of shared parts and processes it once.
        """
        known: dict[Any, Any] = {}

        def convert(e: Any) -> Any:
            return self.tables.converted(e, known)

        for symbol, kind, expression in self.block.quantities:
            e = convert(expression)
            if kind == "rate":
                flow = list(zip([*self.q, *self.s], [*self.v, *map(convert, self.block.rates)], strict=True))
                e = _diff(e, self.t) + _sum(_diff(e, x) * dx for x, dx in flow)
            known[se.Symbol(symbol.name)] = e
        return convert

    def _derive(self) -> None:
        q, v, a, s, t = self.q, self.v, self.a, self.s, self.t

        def flow(e: Any, *, accelerate: bool) -> Any:
            """Return the total time derivative of an expression in q, s, t (and v)."""
            total = _diff(e, t) + _sum(_diff(e, x) * dx for x, dx in zip(q, v, strict=True))
            total += _sum(_diff(e, x) * dx for x, dx in zip(s, self.g, strict=True))
            return total + _sum(_diff(e, x) * dx for x, dx in zip(v, a, strict=True)) if accelerate else total

        momentum = [_diff(self.kinetic, x) for x in v]
        self.mass = [[_diff(p, x) for x in v] for p in momentum]
        inertial = [flow(p, accelerate=False) - _diff(self.kinetic, x) for p, x in zip(momentum, q, strict=True)]
        self.work_force = [_sum(f * _diff(w, x) for f, w in self.work) for x in v]
        self.potential_force = [
            -_diff(self.potential, x)
            - _sum(_diff(self.potential, y) * _diff(g, dx) for y, g in zip(s, self.g, strict=True))
            for x, dx in zip(q, v, strict=True)
        ]
        self.force = [f + w - h for f, w, h in zip(self.potential_force, self.work_force, inertial, strict=True)]
        self.psi = [flow(e, accelerate=False) if h else e for e, h in zip(self.stated, self.holonomic, strict=True)]
        self.d = [[_diff(e, x) for x in v] for e in self.psi]
        self.gamma = [-flow(e, accelerate=False) for e in self.psi]
        self.bias = [[flow(w, accelerate=False) for w in directions] for _, directions, *_ in self.events]
        for bias, event in zip(self.bias, self.block.events, strict=True):
            if event.dry:  # the driver gives a direction without motion a unit response
                bias[0] = -self.converted(event.load)

    def constraint_force(self, multipliers: list[Any], k: int) -> Any:
        """Return ``(D^T multipliers)_k``."""
        return _sum(self.d[i][k] * x for i, x in enumerate(multipliers))

    def residual(self) -> DerivedEquations:
        """Return the rows of the stabilised index-2 form."""
        e: list[Any] = []
        targets: list[tuple[Any, ...]] = []
        stabilising = [x if h else se.Integer(0) for x, h in zip(self.m, self.holonomic, strict=True)]
        for k in range(len(self.q)):
            row = self.constraint_force(stabilising, k)
            e.append(self.qd[k] - self.v[k] + row if self.block.has_rate(k) else row)
            targets.append(("q", k))
        for k, g in enumerate(self.g):
            e.append(self.sd[k] - g)
            targets.append(("s", k))
        for k in range(len(self.q)):
            inertia = _sum(self.mass[k][j] * x for j, x in enumerate(self.a))
            e.append(inertia - self.force[k] + self.constraint_force(self.l, k))
            targets.append(("v", k))
        for k, (phi, psi) in enumerate(zip(self.phi, self.psi, strict=True)):
            e += [phi if self.holonomic[k] else self.m[k], psi]
            targets += [("l", k), ("m", k)]
        return _nonzero(e, targets)

    def unknowns(self) -> list[tuple[str, int, Any, Any]]:
        """Return (letter, index, symbol, symbol of its rate or None)."""
        table = [
            ("q", self.q, self.qd),
            ("s", self.s, self.sd),
            ("v", self.v, self.a),
            ("l", self.l, None),
            ("m", self.m, None),
        ]
        found = [(x, k, y, r[k] if r else None) for x, symbols, r in table for k, y in enumerate(symbols)]
        # commands are constant between samples; auxiliary states of other components are unknowns
        first = self.block.held - self.block.coupled
        return [*found, *(("h", k, y, None) for k, y in enumerate(self.h) if k >= first)]

    def jacobian(self) -> DerivedEquations:
        """Return the entries of ``d residual / d y + c d residual / d y'``."""
        rows = self.residual()
        e: list[Any] = []
        targets: list[tuple[Any, ...]] = []
        for row, target in zip(rows.expressions, rows.targets, strict=True):
            free = row.free_symbols
            for letter, k, y, rate in self.unknowns():
                entry = _diff(row, y) if y in free else se.Integer(0)
                if rate is not None and rate in free:
                    entry = entry + self.c * _diff(row, rate)
                if entry != 0:
                    e.append(entry)
                    targets.append((target, (letter, k)))
        return DerivedEquations(e, targets)

    def position(self) -> DerivedEquations:
        """Return ``Phi`` and ``Phi_q`` with auxiliary states at their initial values, and the cosines of `Upright`."""
        start = dict(zip(self.s, self.s0, strict=True))
        phi = [self.tables.substituted(x, start) for x in self.phi] if start else self.phi
        e = list(phi)
        targets: list[tuple[Any, ...]] = [("phi", k) for k in range(len(phi))]
        for i, x in enumerate(phi):
            e += [_diff(x, y) for y in self.q]
            targets += [("phi_q", i, k) for k in range(len(self.q))]
        kept = _nonzero(e, targets)
        cosines = [self.tables.substituted(x, start) if start else x for x in self.cosines]
        return DerivedEquations(kept.expressions + cosines, kept.targets + [("cos", k) for k in range(len(cosines))])

    def initial(self) -> DerivedEquations:
        """Return the initial values of the auxiliary states."""
        return DerivedEquations(list(self.s0), [("s", k) for k in range(len(self.s0))])

    def velocity(self) -> DerivedEquations:
        """Return ``D``, and ``psi`` at rest, which equals ``Phi_t``."""
        rest = dict.fromkeys(self.v, se.Integer(0))
        e = [self.tables.substituted(x, rest) for x in self.psi]
        targets: list[tuple[Any, ...]] = [("phi_t", i) for i in range(len(e))]
        for i, row in enumerate(self.d):
            e += [self.tables.substituted(x, rest) for x in row]
            targets += [("d", i, k) for k in range(len(row))]
        return _nonzero(e, targets)

    def drift(self) -> DerivedEquations:
        """Return ``Phi`` and ``dPhi/dt``."""
        targets: list[tuple[Any, ...]] = [(x, k) for x in ("phi", "psi") for k in range(len(self.phi))]
        return _nonzero([*self.phi, *self.psi], targets)

    def acceleration(self) -> DerivedEquations:
        """Return the index-1 system ``M``, ``Q - h``, ``D``, ``gamma``, and the rates of the auxiliary states."""
        n = len(self.q)
        e: list[Any] = []
        targets: list[tuple[Any, ...]] = []
        for i in range(n):
            e += [*self.mass[i], self.force[i]]
            targets += [*(("mass", i, k) for k in range(n)), ("force", i)]
        for i, row in enumerate(self.d):
            e += [*row, self.gamma[i]]
            targets += [*(("d", i, k) for k in range(n)), ("gamma", i)]
        e += self.g
        targets += [("s", k) for k in range(len(self.g))]
        return _nonzero(e, targets)

    def linear(self) -> DerivedEquations:
        """Return derivatives of the equations of motion, and derivatives of the constraints by excitations and states.

        The rows are ``M a - Q + h + D^T lambda``, and the rates of the auxiliary states.
        """
        inertia = [_sum(self.mass[k][j] * x for j, x in enumerate(self.a)) for k in range(len(self.q))]
        rows = [(("v", k), x - self.force[k] + self.constraint_force(self.l, k)) for k, x in enumerate(inertia)]
        rows += [(("s", k), g) for k, g in enumerate(self.g)]
        excited = [self.p[k] for k in self.block.excited]
        groups = [("q", self.q), ("s", self.s), ("v", self.v), ("c", excited)]
        e = [_diff(row, x) for _, row in rows for _, symbols in groups for x in symbols]
        targets: list[tuple[Any, ...]] = [
            (f"{letter}_{group}", k, j)
            for (letter, k), _ in rows
            for group, symbols in groups
            for j in range(len(symbols))
        ]
        for letter, symbols in (("c", excited), ("s", self.s)):
            e += [_diff(phi, x) for phi in self.stated for x in symbols]
            targets += [(f"phi_{letter}", i, j) for i in range(len(self.stated)) for j in range(len(symbols))]
        return _nonzero(e, targets)

    def tangent(self) -> DerivedEquations:
        """Return derivatives of the index-1 form by coordinates, auxiliary states and velocities.

        The rows are ``M a - Q + h + D^T lambda``, the constraints ``D a - gamma``, and ``-g``. Their derivatives by
        auxiliary states of other components have the letter ``h``.
        """
        inertia = [_sum(self.mass[k][j] * x for j, x in enumerate(self.a)) for k in range(len(self.q))]
        rows = [(("v", k), x - self.force[k] + self.constraint_force(self.l, k)) for k, x in enumerate(inertia)]
        bent = [_sum(x * y for x, y in zip(row, self.a, strict=True)) for row in self.d]
        rows += [(("d", i), x - y) for i, (x, y) in enumerate(zip(bent, self.gamma, strict=True))]
        rows += [(("s", k), -g) for k, g in enumerate(self.g)]
        first = self.block.held - self.block.coupled
        groups = [("q", self.q, 0), ("s", self.s, 0), ("v", self.v, 0), ("h", self.h[first:], first)]
        e: list[Any] = []
        targets: list[tuple[Any, ...]] = []
        for (letter, k), row in rows:
            free = row.free_symbols
            for group, symbols, begin in groups:
                for j, x in enumerate(symbols):
                    if x in free:
                        e.append(_diff(row, x))
                        targets.append((f"{letter}_{group}", k, begin + j))
        return _nonzero(e, targets)

    def contact(self) -> DerivedEquations:
        """Return guards of events; for contacts also speeds ``w``, ``dw/dv``, ``w'`` without accelerations, and laws.

        Laws are the coefficients of restitution and friction.
        """
        e: list[Any] = []
        targets: list[tuple[Any, ...]] = []
        direction = 0
        for k, ((guard, directions, *law), bias) in enumerate(zip(self.events, self.bias, strict=True)):
            e += [guard, *law]
            targets += [("guard", k), ("law", k, 0), ("law", k, 1)]
            for w, rest in zip(directions, bias, strict=True):
                e += [w, rest, *(_diff(w, x) for x in self.v)]
                targets += [("speed", direction), ("bias", direction)]
                targets += [("slope", direction, i) for i in range(len(self.v))]
                direction += 1
        return _nonzero(e, targets)

    def energy(self) -> DerivedEquations:
        """Return the kinetic and potential energy."""
        return _nonzero([self.kinetic, self.potential], [("energy", 0), ("energy", 1)])

    def generalised_force(self) -> list[Any]:
        """Return the generalised forces of the block: constraints, potentials, virtual work, persistent contacts.

        The expressions contain applications of tables, as in `equations`.
        """
        directions = [w for _, along, *_ in self.events for w in along]
        forces = [
            -self.constraint_force(self.l, k)
            + self.potential_force[k]
            + self.work_force[k]
            + _sum(_diff(w, x) * f for w, f in zip(directions, self.f, strict=True))
            for k, x in enumerate(self.v)
        ]
        return self.tables.applied(forces)

    def equations(self, kind: Kind) -> DerivedEquations:
        """Return the expressions of one kind, with applications of tables."""
        found: DerivedEquations = getattr(self, kind)()
        return DerivedEquations(self.tables.applied(found.expressions), found.targets)

    def kernel(self, arguments: Sequence[Any], expressions: Sequence[Any]) -> Kernel:
        """Compile expressions of this block."""
        return compile_kernel(arguments, self.tables.applied(expressions), tables=self.tables.known)

    def arguments(self, kind: Kind) -> list[tuple[str, int, Any]]:
        """Return the state arguments of a kind, without parameters: (letter, index, symbol)."""
        symbols = {
            "q": self.q, "s": self.s, "v": self.v, "l": self.l, "m": self.m, "dq": self.qd, "ds": self.sd, "dv": self.a,
            "t": [self.t], "c": [self.c],
        }  # fmt: skip
        names = argument_names(kind, len(self.q), len(self.s), len(self.l))
        return [*((letter, k, symbols[letter][k]) for letter, k in names), *(("h", k, x) for k, x in enumerate(self.h))]


@lru_cache(maxsize=256)
def derive(block: BlockType) -> BlockSymbols:
    """Derive a block; cache the result, because the same type recurs in every mechanism."""
    return BlockSymbols(block)


def _symbols(letter: str, count: int) -> list[Any]:
    return [se.Symbol(f"_{letter}{k}") for k in range(count)]


def _diff(e: Any, x: Any) -> Any:
    return e.diff(x)


def _sum(parts: Any) -> Any:
    return se.Add(*parts)


def _nonzero(e: list[Any], targets: list[tuple[Any, ...]]) -> DerivedEquations:
    kept = [(x, y) for x, y in zip(e, targets, strict=True) if x != 0]
    return DerivedEquations([x for x, _ in kept], [y for _, y in kept])
