"""Outputs: compilation of the user's expressions for states, accelerations and multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.equations.block import Instance
from uqmbd.dynamics.equations.derivation import derive
from uqmbd.dynamics.equations.evaluator import Placement
from uqmbd.dynamics.equations.evaluators import excitations_of
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
    ExcitationSymbol,
    HeldStates,
    HeldSymbol,
    JointAngle,
    Local,
    Mechanism,
    Output,
    Parameter,
    PathSymbol,
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
    """Counter of the turns of an angle in an output: a state that integrates the rate of the angle.

    The state only selects the branch of the angle; the coordinates determine the angle.
    """

    bodies = ("body",)
    offered = True
    counts: AngleSymbol
    cosine = Parameter("1", "cosine of the angle, or of half the angle")
    sine = Parameter("1", "sine of the angle, or of half the angle")
    rate = Parameter("rad/s", "rate of the angle")
    near = Parameter("rad", "angle near which the counter starts")
    half = Parameter("", "whether cosine and sine are those of half the angle", kind="option")
    signed = Parameter("", "whether the common sign of cosine and sine matters", kind="option")

    def terms(self, p: Local) -> list[Auxiliary]:
        """Return the state; its initial value is the angle of the assembled pose nearest to the given angle."""
        angle = JointAngle(p.cosine, p.sine, half=p.half, signed=p.signed)
        return [Auxiliary(p.state("angle"), p.rate, angle.nearest(p.near, p.cosine, p.sine))]


def angle_counters(mechanism: Mechanism) -> list[Component]:
    """Return counters for the angles in outputs, start conditions and measured quantities, bodies before joints."""
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

    names: tuple[str, ...]  # in the user's spelling
    units: tuple[str, ...]  # in the user's spelling
    accelerates: bool  # whether accelerations or multipliers are needed
    kernel: Kernel  # of (q, s, v, a, lambda, t, inputs, parameters[needed]); lambda of all constraint equations
    needed: Index
    turns: Array  # (output,): length of a turn for angles, else 0
    counted: NDArray[np.bool_]  # (output,): whether the integration already makes the angle continuous
    reference: Array  # (output,): angles near the initial angles; see `uqmbd.dynamics.ensemble.referenced`
    # names of outputs that are undetermined because of redundant constraints (some reactions)
    not_unique: tuple[str, ...] = ()
    # directions of contacts; their forces are the last arguments
    directions: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def places(self) -> tuple[None, ...]:
        """Places in a series of outputs along an axis, which only scalar outputs have: None for each output."""
        return (None,) * len(self.names)

    def __call__(self, state: Array, inputs: Array, parameters: Array, forces: Array | None = None) -> Array:
        """Evaluate at ``state = (q, s, v, a, lambda, t)``; all arguments have the same leading shape.

        `forces` are the forces of persistent contacts in all directions; None: no contacts.
        """
        pushes = np.zeros((*state.shape[:-1], len(self.directions)))
        if forces is not None:
            pushes = forces[..., self.directions]
        arguments = np.concatenate([state, inputs, parameters[..., self.needed], pushes], axis=-1)
        return self.kernel(np.ascontiguousarray(arguments))

    def unwrap(self, response: Array) -> Array:
        """Add whole turns to angles in outputs (..., output, T): they start near the reference and are continuous.

        Other outputs do not change, and realisations are independent of each other.  Each time may be on a different
        branch; outputs observed in pieces must be joined first.  The output times begin at the initial time and are
        dense: no angle moves by half a turn between them.  Values that are not finite remain unchanged and count no
        turns.
        """
        which = np.flatnonzero(self.turns)
        if not len(which):
            return response
        result: Array = response.copy()
        for k in which.tolist():
            turn, angle = self.turns[k], response[..., k, :]
            # the integration makes counted angles continuous: only the branch of the first one is unknown
            angle = angle[..., :1] if self.counted[k] else angle
            before = np.broadcast_to(self.reference[k], (*angle.shape[:-1], 1))
            with np.errstate(invalid="ignore"):
                steps = np.round(np.diff(angle, axis=-1, prepend=before) / turn)
            steps[~np.isfinite(steps)] = 0.0
            result[..., k, :] -= turn * np.cumsum(steps, axis=-1)
        return result


def output_map(
    outputs: Sequence[Output],
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
    *,
    gradients: Literal["", "motion", "all"] = "",
) -> OutputMap:
    """Compile outputs for all blocks and placements, including all constraint equations.

    `order` contains the first coordinate of each body and component by name; `inputs` are the columns of the inputs;
    `sizes` are the numbers of coordinates, auxiliary states and constraint equations.  With `gradients`, the kernel
    appends the derivatives of each output with respect to coordinates, then velocities. ``all``: with respect to all
    states, accelerations and multipliers, then coefficients of excitations.
    """
    n, k, m = sizes
    start = {"q": 0, "s": n, "v": n + k, "a": 2 * n + k, "l": 3 * n + k, "t": 3 * n + k + m}

    def column(letter: str, index: int) -> str:
        return f"_y{start[letter] + index}"

    symbols: dict[Any, sympy.Expr] = {t: sympy.Symbol(column("t", 0), real=True)}
    symbols |= {v: sympy.Symbol(f"_x{i}", real=True) for i, v in enumerate(inputs)}
    coefficients = _coefficients(instances, places)
    holders: dict[str, tuple[str, Any]] = {}
    pending = [plain(o.expression) for o in outputs]
    free = sorted({s for e in pending for s in e.free_symbols}, key=str)
    for symbol in logged("deriving outputs", free):
        if isinstance(symbol, ReactionSymbol):
            holder = f"_R{len(holders)}"
            holders[holder] = ("reaction", symbol)
            symbols[symbol] = sympy.Symbol(holder, real=True)
        elif isinstance(symbol, ExcitationSymbol):
            symbols[symbol] = sympy.Symbol(f"_g{_excited(symbol, coefficients)}", real=True)
        elif isinstance(symbol, PathSymbol):
            symbols[symbol] = sympy.Symbol(f"_g{_path(symbol, instances, places)}", real=True)
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
            sizes = {"q": n, "v": n} if gradients == "motion" else {"q": n, "s": k, "v": n, "a": n, "l": m}
            places = [[se.Symbol(column(letter, i))] for letter, size in sizes.items() for i in range(size)]
            if gradients == "all":
                places += [[se.Symbol(f"_g{i}") for i in same] for same in coefficients.values()]
            expressions += [derivative for e in expressions for derivative in _gradient(e, places)]
        # arguments of tables contain no inserted symbol yet
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

    kind = f"outputs with gradients {gradients}" if gradients else "outputs with contacts"
    excited = list(coefficients.values()) if gradients == "all" else []
    key = (kind, width, len(inputs), layout, wanted, excited, sympy.srepr(sympy.Tuple(*local)))
    kernel, needed, late, pushes = cached(key, make)
    turns = np.array([o.turn for o in outputs], dtype=float)
    counted = np.array([_counted(o.expression) for o in outputs], dtype=bool)
    names, units = tuple(o.name for o in outputs), tuple(o.units for o in outputs)
    return OutputMap(names, units, late, kernel, needed, turns, counted, np.zeros(len(outputs)), directions=pushes)


def _coefficients(instances: list[Instance], places: list[Placement]) -> dict[ExcitationSymbol, list[int]]:
    """Return the parameters of the model that are each coefficient of an excitation."""
    found: dict[ExcitationSymbol, list[int]] = {symbol: [] for symbol in excitations_of(instances)}
    for instance, place in zip(instances, places, strict=True):
        for symbol, k in zip(instance.excitations, instance.type.excited, strict=True):
            found[symbol].append(int(place.parameters[k]))
    return found


def _excited(symbol: ExcitationSymbol, coefficients: dict[ExcitationSymbol, list[int]]) -> int:
    """Return a parameter that is a coefficient of an excitation."""
    if symbol not in coefficients:
        raise StudyError(
            f"an output contains {symbol.source.source.name}({symbol.argument}), which acts on no component; use it in "
            "a force, a driver or a road, with the same argument."
        )
    return coefficients[symbol][0]


def _path(symbol: PathSymbol, instances: list[Instance], places: list[Placement]) -> int:
    """Return a parameter that is the memory address of a sampled path; `_excited` has rejected unused paths."""
    return next(
        int(place.parameters[k])
        for instance, place in zip(instances, places, strict=True)
        for k, path in instance.paths.items()
        if path == symbol
    )


def _gradient(expression: Any, groups: list[list[Any]]) -> list[Any]:
    """Differentiate an expression by groups of symbols for one variable; numbers of turns (`floor`) are constant."""
    import symengine as se

    held = {e: se.Symbol(f"_turns{k}") for k, e in enumerate(se.sympify(expression).atoms(se.floor))}
    back = {symbol: e for e, symbol in held.items()}
    still = expression.xreplace(held)
    return [se.Add(*(still.diff(x) for x in group)).xreplace(back) for group in groups]


def _counted(expression: sympy.Expr) -> bool:
    """Return whether an angle is a polynomial of counted angles, which cannot jump."""
    free = expression.free_symbols
    angles = any(isinstance(s, AngleSymbol) for s in free)
    return angles and bool(expression.is_polynomial(*free))


def _coordinate(symbol: Any, order: dict[str, int], column: Any) -> sympy.Symbol:
    index = order[symbol.owner.name] + symbol.index
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
    """Return the index of a controller value among the auxiliary states."""
    for instance, place in zip(instances, places, strict=True):
        if isinstance(instance.component, HeldStates) and instance.component.controller is symbol.owner:
            return int(place.letters["s"][symbol.index])
    raise StudyError(f"{symbol}: the controller {symbol.owner.name!r} was not added; call mechanism.add(...) first.")


def _auxiliary(symbol: AuxiliarySymbol, instances: list[Instance], places: list[Placement]) -> int:
    """Return the index of a component's auxiliary state among all auxiliary states."""
    for instance, place in zip(instances, places, strict=True):
        if instance.component is symbol.component and symbol.state in instance.type.states:
            return int(place.letters["s"][instance.type.states.index(symbol.state)])
    raise StudyError(f"{symbol}: {symbol.component!r} no longer has a state {symbol.state!r}.")


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
    """Return a component of the force or moment on body j (``E Q / 2``, moved to the component's point)."""
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
