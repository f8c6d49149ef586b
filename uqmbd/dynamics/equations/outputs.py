"""Outputs: the user's expressions, compiled for states, accelerations and multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.equations.block import Instance
from uqmbd.dynamics.equations.derivation import derive
from uqmbd.dynamics.equations.evaluator import Placement
from uqmbd.dynamics.equations.expressions import plain
from uqmbd.dynamics.equations.tables import Tables
from uqmbd.errors import StudyError
from uqmbd.logs import logged
from uqmbd.mechanism import (
    AngleSymbol,
    Auxiliary,
    AuxiliarySymbol,
    Body,
    Component,
    HeldStates,
    HeldSymbol,
    JointAngle,
    Local,
    Mechanism,
    Output,
    Parameter,
    ReactionSymbol,
    StateSymbol,
    angles_in,
    as_symbolic,
    t,
)
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["AngleCounter", "OutputMap", "angle_counters", "output_map"]


class AngleCounter(Component):
    """Counts the turns of an angle that is an output: a state that integrates its rate.

    Its value only picks the branch of the angle; the angle itself comes from the coordinates.
    """

    bodies = ("body",)
    offered = True
    counts: AngleSymbol
    cosine = Parameter("1", "cosine of the angle, or of half of it")
    sine = Parameter("1", "sine of the angle, or of half of it")
    rate = Parameter("rad/s", "its rate")
    near = Parameter("rad", "angle near which it starts")
    half = Parameter("", "whether they are those of half the angle", kind="option")
    signed = Parameter("", "whether their sign means something", kind="option")

    def terms(self, p: Local) -> list[Auxiliary]:
        """Start at the angle of the assembled pose that is nearest to the drawn one."""
        angle = JointAngle(p.cosine, p.sine, half=p.half, signed=p.signed)
        return [Auxiliary(p.state("angle"), p.rate, angle.nearest(p.near, p.cosine, p.sine))]


def angle_counters(mechanism: Mechanism) -> list[Component]:
    """Return a counter for every angle in outputs, start conditions and measured quantities: bodies, then joints."""
    expressions = [output.expression for output in mechanism.observed()]
    expressions += [condition.residual for condition in mechanism.conditions.values()]
    expressions += [x for c in mechanism.controllers.values() for x in c.measured if not isinstance(x, str)]
    counters: list[Component] = []
    angles = sorted(angles_in(expressions), key=lambda x: (not isinstance(x.owner, Body), x.owner.name, str(x)))
    for symbol in logged("deriving angles", angles):
        angle = symbol.angle
        body = min((x.owner for x in symbol.states if isinstance(x, StateSymbol)), key=lambda x: x.name)
        counter = AngleCounter(str(symbol), body)
        counter.counts = symbol
        pair = {"cosine": angle.cosine, "sine": angle.sine, "rate": angle.rate}
        counter.values = {key: angle.whole(x) for key, x in pair.items()}
        counter.values |= {"near": as_symbolic(angle.near), "half": angle.half, "signed": angle.signed}
        counters.append(counter)
    return counters


@dataclass(frozen=True)
class OutputMap:
    """Compiled outputs."""

    names: tuple[str, ...]  # as the user wrote them
    units: tuple[str, ...]  # as the user wrote them
    accelerates: bool  # whether accelerations or multipliers are needed
    kernel: Kernel  # of (q, s, v, a, lambda, t, inputs, parameters[needed]); lambda of all constraint equations
    needed: Index
    turns: Array  # (output,): length of a turn of the outputs that are angles, else 0
    counted: NDArray[np.bool_]  # (output,): whether the integration already makes the angle continuous
    reference: Array  # (output,): angles near which realisations start; see `uqmbd.dynamics.ensemble.referenced`
    # names of the outputs that redundant constraints leave undetermined (some reactions)
    not_unique: tuple[str, ...] = ()
    # directions of contacts whose forces are the last arguments
    directions: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __call__(self, state: Array, inputs: Array, parameters: Array, forces: Array | None = None) -> Array:
        """Evaluate at ``state = (q, s, v, a, lambda, t)``; all arguments have the same leading shape.

        `forces` are those of contacts that last, in all directions; None: there are none.
        """
        pushes = np.zeros((*state.shape[:-1], len(self.directions)))
        if forces is not None:
            pushes = forces[..., self.directions]
        arguments = np.concatenate([state, inputs, parameters[..., self.needed], pushes], axis=-1)
        return self.kernel(np.ascontiguousarray(arguments))

    def unwrap(self, response: Array) -> Array:
        """Return outputs (..., output, T) with whole turns added to angles: continuous in time from near the reference.

        Other outputs do not change, and one realisation does not depend on the others.  Each time may come on a branch
        of its own: outputs that were observed in pieces are joined first.  The output times begin at the initial one
        and are dense: no angle moves by half a turn from one to the next.  Values that are not finite remain so and
        count no turns.
        """
        which = np.flatnonzero(self.turns)
        if not len(which):
            return response
        turn, angle = self.turns[which, None], response[..., which, :]
        before = np.broadcast_to(self.reference[which, None], (*angle.shape[:-1], 1))
        with np.errstate(invalid="ignore"):
            steps = np.round(np.diff(angle, axis=-1, prepend=before) / turn)
        steps[..., self.counted[which], 1:] = 0.0
        steps[~np.isfinite(steps)] = 0.0
        result: Array = response.copy()
        result[..., which, :] = angle - turn * np.cumsum(steps, axis=-1)
        return result


def output_map(
    outputs: Sequence[Output],
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
    *,
    gradients: bool = False,
) -> OutputMap:
    """Compile outputs of all blocks and their placements, with all equations retained.

    The index of each body by name is in `order`; `inputs` are the columns of the inputs; `sizes` are the numbers of
    coordinates, auxiliary states and constraint equations.  With `gradients` the kernel appends the derivatives of each
    output by coordinates, then by velocities.
    """
    n, k, m = sizes
    start = {"q": 0, "s": n, "v": n + k, "a": 2 * n + k, "l": 3 * n + k, "t": 3 * n + k + m}

    def column(letter: str, index: int) -> str:
        return f"_y{start[letter] + index}"

    symbols: dict[Any, sympy.Expr] = {t: sympy.Symbol(column("t", 0), real=True)}
    symbols |= {v: sympy.Symbol(f"_x{i}", real=True) for i, v in enumerate(inputs)}
    holders: dict[str, tuple[str, Any]] = {}
    pending = [plain(o.expression) for o in outputs]
    free = sorted({s for e in pending for s in e.free_symbols}, key=str)
    for symbol in logged("deriving outputs", free):
        if isinstance(symbol, ReactionSymbol):
            holder = f"_R{len(holders)}"
            holders[holder] = ("reaction", symbol)
            symbols[symbol] = sympy.Symbol(holder, real=True)
        elif isinstance(symbol, HeldSymbol):
            symbols[symbol] = sympy.Symbol(column("s", _held(symbol, instances, places)), real=True)
        elif isinstance(symbol, AuxiliarySymbol):
            symbols[symbol] = sympy.Symbol(column("s", _auxiliary(symbol, instances, places)), real=True)
        elif isinstance(symbol, AngleSymbol):
            symbols[symbol] = _angle(symbol, instances, places, order, column).xreplace(symbols)
        elif isinstance(symbol, StateSymbol):
            if symbol.quantity in ("kinetic_energy", "potential_energy"):
                holder = f"_R{len(holders)}"
                holders[holder] = (symbol.quantity, symbol)
                symbols[symbol] = sympy.Symbol(holder, real=True)
            elif symbol.quantity in ("q", "v", "a"):
                symbols[symbol] = _coordinate(symbol, order, column)
            else:
                inner = symbol.owner.expand(symbol)
                swap = {s: _coordinate(s, order, column) for s in inner.free_symbols}
                symbols[symbol] = inner.xreplace(swap)
    local = [e.xreplace(symbols) for e in pending]
    used = [(i, p) for i, p in zip(instances, places, strict=True) if _uses(i, holders)]
    layout = [
        (
            i.type.digest,
            i.component.name,
            (i.type.reaction_on, i.type.reaction_sign, sympy.srepr(sympy.Tuple(*i.type.reaction_point))),
            {x: tuple(map(int, y)) for x, y in p.letters.items()},
            tuple(map(int, p.parameters)),
        )
        for i, p in used
    ]
    wanted = [(h, kind, str(s)) for h, (kind, s) in holders.items()]
    width = 3 * n + k + m + 1

    def make() -> tuple[Kernel, Index, bool, Index]:
        import symengine as se

        swap = {
            se.Symbol(h): _reaction(used, s, column) if kind == "reaction" else _energy(used, kind, column)
            for h, (kind, s) in holders.items()
        }
        tables = Tables()
        expressions = [tables.converted(e).xreplace(swap) for e in local]
        if gradients:
            places = [se.Symbol(column(letter, i)) for letter in "qv" for i in range(n)]
            expressions += [derivative for e in expressions for derivative in _gradient(e, places)]
        # arguments of tables hold no inserted symbol yet
        expressions = [e.xreplace(swap) for e in tables.applied(expressions)]
        known = dict(tables.known)
        for instance, _ in used:
            known |= derive(instance.type).tables.known
        names = {str(s) for e in expressions for s in e.free_symbols}
        needed = sorted(int(x[2:]) for x in names if x.startswith("_g"))
        late = any(x.startswith("_y") and start["a"] <= int(x[2:]) < start["t"] for x in names)
        pushes = sorted(int(x[2:]) for x in names if x.startswith("_w"))
        arguments = [se.Symbol(f"_y{c}") for c in range(width)] + [se.Symbol(f"_x{c}") for c in range(len(inputs))]
        arguments += [se.Symbol(f"_g{c}") for c in needed] + [se.Symbol(f"_w{c}") for c in pushes]
        kernel = compile_kernel(arguments, expressions, tables=known)
        return kernel, np.array(needed, dtype=np.int64), late or bool(pushes), np.array(pushes, dtype=np.int64)

    kind = "outputs with gradients" if gradients else "outputs with contacts"
    key = (kind, width, len(inputs), layout, wanted, sympy.srepr(sympy.Tuple(*local)))
    kernel, needed, late, pushes = cached(key, make)
    turns = np.array([o.turn for o in outputs], dtype=float)
    counted = np.array([_counted(o.expression) for o in outputs], dtype=bool)
    names, units = tuple(o.name for o in outputs), tuple(o.units for o in outputs)
    return OutputMap(names, units, late, kernel, needed, turns, counted, np.zeros(len(outputs)), directions=pushes)


def _gradient(expression: Any, symbols: list[Any]) -> list[Any]:
    """Differentiate an expression; numbers of turns (`floor`) are constant."""
    import symengine as se

    held = {e: se.Symbol(f"_turns{k}") for k, e in enumerate(se.sympify(expression).atoms(se.floor))}
    back = {symbol: e for e, symbol in held.items()}
    still = expression.xreplace(held)
    return [still.diff(x).xreplace(back) for x in symbols]


def _counted(expression: sympy.Expr) -> bool:
    """Return whether an angle is a polynomial of counted angles, so that it cannot jump."""
    free = expression.free_symbols
    angles = any(isinstance(s, AngleSymbol) for s in free)
    return angles and bool(expression.is_polynomial(*free))


def _coordinate(symbol: Any, order: dict[str, int], column: Any) -> sympy.Symbol:
    index = order[symbol.owner.name] * symbol.owner.space.size + symbol.index
    return sympy.Symbol(column(symbol.quantity, index), real=True)


def _angle(
    symbol: AngleSymbol, instances: list[Instance], places: list[Placement], order: dict[str, int], column: Any
) -> sympy.Expr:
    """Return the angle, with the turns of its counter, in coordinates, the counter's state, and random variables."""
    swap = {s: _coordinate(s, order, column) for s in symbol.states}
    cosine, sine = (symbol.angle.whole(x).xreplace(swap) for x in (symbol.angle.cosine, symbol.angle.sine))
    for instance, place in zip(instances, places, strict=True):
        if isinstance(instance.component, AngleCounter) and instance.component.counts == symbol:
            counted = sympy.Symbol(column("s", int(place.letters["s"][0])), real=True)
            return symbol.angle.nearest(counted, cosine, sine)
    raise StudyError(f"{symbol} is not counted; record it with mechanism.output(...).")


def _held(symbol: HeldSymbol, instances: list[Instance], places: list[Placement]) -> int:
    """Return the number of a controller's value among the auxiliary states."""
    for instance, place in zip(instances, places, strict=True):
        if isinstance(instance.component, HeldStates) and instance.component.controller is symbol.owner:
            return int(place.letters["s"][symbol.index])
    raise StudyError(f"{symbol}: the controller {symbol.owner.name!r} was not added; call mechanism.add(...) first.")


def _auxiliary(symbol: AuxiliarySymbol, instances: list[Instance], places: list[Placement]) -> int:
    """Return the number of an auxiliary state of a component among all."""
    for instance, place in zip(instances, places, strict=True):
        if instance.component is symbol.component and symbol.state in instance.type.states:
            return int(place.letters["s"][instance.type.states.index(symbol.state)])
    raise StudyError(f"{symbol}: {symbol.component!r} has no state {symbol.state!r} any more.")


def _uses(instance: Instance, holders: dict[str, tuple[str, Any]]) -> bool:
    return any(kind != "reaction" or s.component is instance.component for kind, s in holders.values())


def _global(instance: Instance, place: Placement, column: Any) -> dict[Any, Any]:
    import symengine as se

    derived = derive(instance.type)
    swap = {derived.t: se.Symbol(column("t", 0))}
    for letter, symbols in (("q", derived.q), ("s", derived.s), ("v", derived.v)):
        swap |= {x: se.Symbol(column(letter, int(g))) for x, g in zip(symbols, place.letters[letter], strict=True)}
    held = place.letters.get("h", ())
    swap |= {x: se.Symbol(column("s", int(g))) for x, g in zip(derived.h, held, strict=True)}
    swap |= {x: se.Symbol(column("l", int(g))) for x, g in zip(derived.l, place.letters["row"], strict=True)}
    swap |= {x: se.Symbol(f"_w{int(g)}") for x, g in zip(derived.f, place.letters["direction"], strict=True)}
    return swap | {x: se.Symbol(f"_g{int(g)}") for x, g in zip(derived.p, place.parameters, strict=True)}


def _reaction(used: list[tuple[Instance, Placement]], symbol: Any, column: Any) -> Any:
    """One component of the force or moment on body j (``E Q / 2`` moved from body origin to the component's point)."""
    import symengine as se

    instance, place = next((i, p) for i, p in used if i.component is symbol.component)
    block = instance.type
    space, derived = block.space, derive(block)
    d, first = space.dimension, block.reaction_on * space.size
    q = [sympy.Symbol(f"_q{first + i}", real=True) for i in range(space.size)]
    load = [sympy.Symbol(f"_Q{first + i}", real=True) for i in range(space.size)]
    if symbol.quantity == "reaction_force":
        e = load[symbol.index]
    else:
        arm = sympy.Matrix(q[:d]) - sympy.Matrix([block.whole(x) for x in block.reaction_point])
        force = sympy.Matrix(load[:d])
        moment = space.moment(q[d:], load[d:])
        extra = arm.cross(force) if d == 3 else sympy.Matrix([arm[0] * force[1] - arm[1] * force[0]])
        e = (moment + extra)[symbol.index]
    loads = {se.Symbol(f"_Q{i}"): x for i, x in enumerate(derived.generalised_force())}
    acting = derived.tables.applied([derived.converted(block.reaction_sign * e).xreplace(loads)])[0]
    return acting.xreplace(_global(instance, place, column))


def _energy(used: list[tuple[Instance, Placement]], kind: str, column: Any) -> Any:
    import symengine as se

    total = se.Integer(0)
    for instance, place in used:
        derived = derive(instance.type)
        energy = derived.tables.applied([derived.kinetic if kind == "kinetic_energy" else derived.potential])[0]
        total = total + energy.xreplace(_global(instance, place, column))
    return total
