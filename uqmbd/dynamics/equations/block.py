"""Blocks: terms of a component type in local symbols, shared by all instances of the type.

Local symbols are plain SymPy symbols with fixed names, so that all instances of a type have the same text:
``_q`` coordinates, ``_v`` velocities, ``_s`` auxiliary states, ``_l``, ``_m`` multipliers, ``_p`` parameters, ``_t``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy

from uqmbd.dynamics.equations.counted_angles import count
from uqmbd.dynamics.equations.events import EventType, friction_event, local_event
from uqmbd.dynamics.equations.expressions import (
    TIME,
    localised_expression,
    require_derivatives,
    require_velocities,
)
from uqmbd.dynamics.equations.local_values import LocalValues, bodies_of, foreign_states, localise, symbols_of
from uqmbd.errors import StudyError
from uqmbd.logs import logged
from uqmbd.mechanism import (
    AttachedFrame,
    Auxiliary,
    AuxiliarySymbol,
    Body,
    BodyTerms,
    Component,
    Constraint,
    CoordinateSet,
    DryFriction,
    Event,
    ExcitationSymbol,
    Frame,
    HeldSymbol,
    Kinetic,
    Local,
    PathSymbol,
    Potential,
    Separation,
    Space,
    Upright,
    VelocityConstraint,
    VirtualWork,
    coordinates_of,
    flatten,
)

__all__ = ["BlockType", "Instance", "instances_of"]


_FOREIGN = "an auxiliary state of another component"
_INSTEAD = (
    "Use such a state as a force, a torque, a stiffness, a damping or a potential, or in the rate of an auxiliary "
    "state."
)


@dataclass(frozen=True)
class BlockType:
    """Terms of a component type, in local symbols."""

    name: str
    space: Space
    bodies: int
    owns: bool  # whether the block contains q' = v for its coordinates, as for a body
    parameters: int
    states: tuple[str, ...]
    kinetic: sympy.Expr
    potential: sympy.Expr
    work: tuple[tuple[sympy.Expr, sympy.Expr], ...]
    constraints: tuple[sympy.Expr, ...]
    holonomic: tuple[bool, ...]  # for each constraint: whether it constrains positions; else velocities only
    labels: tuple[str, ...]
    rates: tuple[sympy.Expr, ...]
    initial: tuple[sympy.Expr, ...]
    cosines: tuple[sympy.Expr, ...]
    cosine_labels: tuple[str, ...]
    reaction_point: tuple[sympy.Expr, ...]
    quantities: tuple[tuple[sympy.Symbol, str, sympy.Expr], ...]  # symbol, "value" or "rate", expression; in order
    events: tuple[EventType, ...]
    gaps: tuple[tuple[sympy.Expr, sympy.Expr], ...]  # gap at the start, and depth of a large overlap
    reaction_on: int  # local body on which the reaction acts; `reaction_sign` contains its sign
    reaction_sign: int
    # number of ``_h``: controller commands and states in parameters, then auxiliary states of other components
    held: int = 0
    coupled: int = 0  # number of auxiliary states of other components, which are the last ``_h``
    excited: tuple[int, ...] = ()  # numbers of parameters that are coefficients of excitations
    # coordinates of other components, then own coordinates, after those of the bodies
    foreign: int = 0
    own: int = 0

    @property
    def coordinates(self) -> int:
        """Number of local coordinates."""
        return self.bodies * self.space.size + self.foreign + self.own

    def has_rate(self, coordinate: int) -> bool:
        """Return whether the block contains ``q' = v`` for a local coordinate."""
        return self.owns or coordinate >= self.coordinates - self.own

    @property
    def expressions(self) -> list[sympy.Expr]:
        """All expressions for the derivation of the equations of motion."""
        work = [x for pair in self.work for x in pair]
        named = [e for _, _, e in self.quantities]
        return [self.kinetic, self.potential, *self.constraints, *self.rates, *work, *named]

    def whole(self, expression: sympy.Expr) -> sympy.Expr:
        """Insert the definitions of named quantities."""
        if not self.quantities:
            return expression
        return expression.xreplace(self._quantities)

    @cached_property
    def _quantities(self) -> dict[sympy.Basic, sympy.Expr]:
        flow = {sympy.Symbol(f"_q{k}", real=True): sympy.Symbol(f"_v{k}", real=True) for k in range(self.coordinates)}
        found: dict[sympy.Basic, sympy.Expr] = {}
        flow |= {sympy.Symbol(f"_s{k}", real=True): rate for k, rate in enumerate(self.rates)}
        for symbol, kind, expression in self.quantities:
            e = expression.xreplace(found)
            if kind == "rate":
                e = e.diff(TIME) + sympy.Add(*(e.diff(x) * dx.xreplace(found) for x, dx in flow.items()))
            found[symbol] = e
        return found

    @cached_property
    def digest(self) -> str:
        """Hash of all data that affect the derivation."""
        parts: tuple[Any, ...] = (
            self.space.name,
            self.bodies,
            self.owns,
            self.parameters,
            len(self.states),
            *(k for k, holonomic in enumerate(self.holonomic) if not holonomic),
            sympy.srepr(
                sympy.Tuple(
                    self.kinetic, self.potential, *(x for w in self.work for x in w), sympy.S.Zero, *self.constraints,
                    sympy.S.Zero, *self.rates, *self.initial, sympy.S.Zero, *self.cosines,
                    *(x for e in self.events for x in (sympy.Symbol(e.label), *e.expressions)),
                    *(x for s, kind, e in self.quantities for x in (s, sympy.Integer(kind == "rate"), e)),
                )
            ),
        )  # fmt: skip
        if self.held:
            parts = (*parts, self.held)
        if self.coupled:
            parts = (*parts, "coupled", self.coupled)
        if self.excited:
            parts = (*parts, "excited", *self.excited)
        if self.foreign or self.own:
            parts = (*parts, "coordinates", self.foreign, self.own)
        return hashlib.sha256(repr(parts).encode()).hexdigest()


@dataclass(frozen=True)
class Instance:
    """Component as an instance of its block type."""

    component: Component
    type: BlockType
    bodies: tuple[Body, ...]
    parameters: tuple[sympy.Expr, ...]
    """Values of the local parameters, in random variables; coefficients and paths of excitations are zero."""
    held: tuple[HeldSymbol | AuxiliarySymbol, ...] = ()
    """Commands and states of controllers in the parameters, then auxiliary states of other components."""
    excitations: tuple[ExcitationSymbol, ...] = ()
    """Coefficients of excitations, in the order of ``type.excited``."""
    paths: Mapping[int, PathSymbol] = field(default_factory=dict)
    """Sampled paths, by the number of the local parameter that contains the memory address."""
    sets: tuple[CoordinateSet, ...] = ()
    """Coordinates of other components, then own coordinates."""

    @property
    def owners(self) -> tuple[Body | CoordinateSet, ...]:
        """Owners of the local coordinates, in order."""
        return (*self.bodies, *self.sets)


def instances_of(components: list[Component], space: Space) -> list[Instance]:
    """Group components into block types; evaluate terms once per type."""
    known: dict[Any, BlockType] = {}
    return [_instance(component, space, known) for component in logged("deriving components", components)]


def _instance(component: Component, space: Space, known: dict[Any, BlockType]) -> Instance:
    bodies, foreign = bodies_of(component)
    own = coordinates_of(component)
    sets = (*foreign, *(() if own is None else (own,)))
    held = foreign_states(component)
    coupled = sum(isinstance(s, AuxiliarySymbol) for s in held)
    local = localise(component, (*bodies, *sets), held)
    parameters = local.parameters
    carriers = [frame.body if isinstance(frame, AttachedFrame) else frame for frame in component.attached.values()]
    kinds = tuple(bodies.index(b) if isinstance(b, Body) else -1 for b in carriers)
    excitations = {k: p for k, p in enumerate(parameters) if isinstance(p, ExcitationSymbol)}
    names = () if own is None else own.names
    numbers = sum(len(x.q) for x in foreign)
    key = (type(component), space.name, kinds, len(bodies), local.pattern, coupled, tuple(excitations), numbers, names)
    if key not in known:
        sizes = len(held), coupled, tuple(excitations), numbers, names
        known[key] = _build_block(component, space, len(bodies), kinds, local, *sizes)
    paths = {k: p for k, p in enumerate(parameters) if isinstance(p, PathSymbol)}
    settled = tuple(sympy.S.Zero if k in excitations or k in paths else p for k, p in enumerate(parameters))
    return Instance(component, known[key], tuple(bodies), settled, held, tuple(excitations.values()), paths, sets)


def _build_block(
    component: Component,
    space: Space,
    bodies: int,
    kinds: tuple[int, ...],
    given: LocalValues,
    held: int,
    coupled: int,
    excited: tuple[int, ...],
    elsewhere: int,
    own: tuple[str, ...],
) -> BlockType:
    n, parameters = space.size, len(given.parameters)
    total = n * bodies + elsewhere + len(own)
    q, v = symbols_of("q", total), symbols_of("v", total)
    moving = [Frame(space, q[n * b : n * b + n], v[n * b : n * b + n]) for b in range(bodies)]
    frames = {role: moving[k] if k >= 0 else Frame(space) for role, k in zip(component.attached, kinds, strict=True)}
    first = total - len(own)
    local = Local(
        space, frames, given.values, TIME, dict(zip(own, zip(q[first:], v[first:], strict=True), strict=True))
    )
    local.attach(given.frames)
    turns = count(local, given.counted)
    terms, point = component.stated(local)
    terms = [*turns, *terms]
    named = {symbol: sympy.Symbol(f"_u{k}", real=True) for k, symbol in enumerate(local.quantities)}
    where = f"{type(component).__name__} {component.name!r}"
    known = {
        *q,
        *v,
        *local.states.values(),
        *symbols_of("p", parameters),
        *symbols_of("h", held),
        *named.values(),
        TIME,
    }

    def settled(expression: Any) -> sympy.Expr:
        return localised_expression(where, component, expression, named, known)

    quantities = tuple((named[symbol], kind, settled(e)) for symbol, (kind, e) in local.quantities.items())

    velocities, coordinates = set(v), set(q) | set(local.states.values())
    accelerations: set[sympy.Basic] = set()
    others = symbols_of("h", held)
    commands, foreign = set(others[: held - coupled]), set(others[held - coupled :])
    for symbol, kind, e in quantities:
        if e.free_symbols & (velocities if kind == "rate" else accelerations):
            accelerations.add(symbol)
        if kind == "rate" or e.free_symbols & velocities:
            velocities.add(symbol)
        if e.free_symbols & coordinates:
            coordinates.add(symbol)
        if e.free_symbols & commands:
            commands.add(symbol)
        if e.free_symbols & foreign:
            foreign.add(symbol)
            if kind == "rate":
                raise StudyError(f"{where}: terms() uses the rate of a quantity that contains {_FOREIGN}. {_INSTEAD}")
    kinetic: sympy.Expr = sympy.S.Zero
    potential: sympy.Expr = sympy.S.Zero
    work: list[tuple[sympy.Expr, sympy.Expr]] = []
    constraints: list[sympy.Expr] = []
    holonomic: list[bool] = []
    labels: list[str] = []
    rates: dict[sympy.Symbol, tuple[sympy.Expr, sympy.Expr]] = {}
    uprights: list[tuple[sympy.Expr, str]] = []
    gaps: list[tuple[sympy.Expr, sympy.Expr]] = []
    events: list[EventType] = []
    for term in terms:
        match term:
            case Kinetic(energy):
                kinetic += settled(energy)
            case Potential(energy):
                potential += settled(energy)
            case VirtualWork(force, velocity):
                f, w = flatten(force), flatten(velocity)
                if len(f) != len(w):
                    raise StudyError(
                        f"{where}: VirtualWork has a force of {len(f)} components and a velocity of {len(w)}; "
                        "expected equal numbers."
                    )
                pairs = [(settled(a), settled(b)) for a, b in zip(f, w, strict=True)]
                for _, rate in pairs:
                    if rate.free_symbols and not rate.free_symbols & velocities:
                        raise StudyError(
                            f"{where}: the second argument of VirtualWork(force, velocity) contains no velocity; the "
                            "work of a force on a point is VirtualWork(force, body.point_velocity(point))."
                        )
                work += pairs
            case Constraint(equations, label) | VelocityConstraint(equations, label):
                parts = [settled(e) for e in flatten(equations)]
                names = ["x", "y", "z"] if len(parts) in (2, 3) else [str(k + 1) for k in range(len(parts))]
                word = label or "equation"
                labels += [word] if len(parts) == 1 else [f"{word} {x}" for x in names[: len(parts)]]
                constraints += parts
                holonomic += [isinstance(term, Constraint)] * len(parts)
            case Auxiliary(state, rate, initial):
                rates[state] = (settled(rate), settled(initial))
            case Event():
                events.append(local_event(where, term, settled, velocities))
            case DryFriction():
                events.append(friction_event(where, term, settled, velocities))
            case Upright(cosine, label):
                uprights.append((settled(cosine), label))
            case Separation(gap, reach):
                gaps.append((settled(gap), settled(reach)))
            case _:
                raise StudyError(
                    f"{where}: terms() yielded {term!r}; expected Kinetic, Potential, VirtualWork, "
                    "Constraint, VelocityConstraint, Auxiliary, Event, DryFriction, Upright or Separation. "
                    "An energy is yielded as uqmbd.Potential(energy), a force as uqmbd.VirtualWork(force, velocity)."
                )
    for state, symbol in local.states.items():
        if symbol not in rates:
            raise StudyError(f"{where}: the state {state!r} is used but no Auxiliary term gives its rate.")
    at_rest = [e for e, h in zip(constraints, holonomic, strict=True) if h]
    for e in (*at_rest, potential):
        if e.free_symbols & velocities:
            what = "a potential energy" if e is potential else f"the constraint {labels[constraints.index(e)]!r}"
            raise StudyError(
                f"{where}: {what} contains a velocity; constraints and potential energies may depend only on "
                "positions, states and time. Write a force that depends on velocities as a VirtualWork. Write an "
                "equation that is linear in velocities as a VelocityConstraint."
            )
    guards = [event.guard for event in events]
    clash = [e for e in at_rest if not e.free_symbols & coordinates]
    if clash:
        raise StudyError(
            f"{where}: the constraint {labels[constraints.index(clash[0])]!r} contains no coordinate of a body."
        )
    for what, parts in (("its constraint", at_rest), ("its kinetic energy", [kinetic]), ("its event", guards)):
        if any(e.free_symbols & commands for e in parts):
            raise StudyError(
                f"{where}: {what} contains a command of a controller. A command jumps at every sample, but "
                "positions and masses cannot jump. Use a command as a force, a torque, a stiffness or a damping, or as "
                "the speed of a speed driver."
            )
    jumps = [x for event in events for x in event.expressions]
    initial = [x for _, x in rates.values()]
    poses = [x for pair in (*uprights, *gaps) for x in pair if isinstance(x, sympy.Expr)]
    for what, parts in (
        ("its constraint", constraints),
        ("its kinetic energy", [kinetic]),
        ("its event", jumps),
        ("the initial value of its state", initial),
        ("a limit of its poses", poses),
    ):
        if any(e.free_symbols & foreign for e in parts):
            raise StudyError(f"{where}: {what} contains {_FOREIGN}. {_INSTEAD}")
    changing = {*velocities, *coordinates}
    require_derivatives(where, [kinetic, potential, *(x for pair in work for x in pair)], changing)
    require_derivatives(where, [*constraints, *(rate for rate, _ in rates.values())], changing | {TIME})
    ends = kinds or (-1,)
    on, sign = (ends[-1], 1) if ends[-1] >= 0 else (ends[0], -1)
    block = BlockType(
        name=type(component).__name__,
        space=space,
        bodies=bodies,
        owns=isinstance(component, BodyTerms),
        parameters=parameters,
        states=tuple(local.states),
        kinetic=kinetic,
        potential=potential,
        work=tuple(work),
        constraints=tuple(constraints),
        holonomic=tuple(holonomic),
        labels=tuple(labels),
        rates=tuple(rates[s][0] for s in local.states.values()),
        initial=tuple(rates[s][1] for s in local.states.values()),
        cosines=tuple(u for u, _ in uprights),
        cosine_labels=tuple(x for _, x in uprights),
        reaction_point=tuple(settled(x) for x in point),
        quantities=quantities,
        events=tuple(events),
        gaps=tuple(gaps),
        reaction_on=on,
        reaction_sign=sign,
        held=held,
        coupled=coupled,
        excited=excited,
        foreign=elsewhere,
        own=len(own),
    )
    for e, label in ((e, label) for e, h, label in zip(constraints, holonomic, labels, strict=True) if not h):
        require_velocities(where, label, e, block.whole(e), set(v), accelerations)
    return block
