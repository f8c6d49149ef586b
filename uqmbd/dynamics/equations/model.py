"""The model: index maps and compiled equations of a mechanism; numbers only, so that it travels to worker processes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from uqmbd.dynamics.equations.block import Instance
from uqmbd.dynamics.equations.evaluator import Evaluator, Placement, fused, typed
from uqmbd.dynamics.equations.layout import RESULTS, Kind, Layout
from uqmbd.dynamics.equations.limits import Limit, Tensor
from uqmbd.dynamics.equations.parameters import ParameterMap
from uqmbd.mechanism import Controller, HeldStates, Spline
from uqmbd.typing import Array, Index

__all__ = ["FUSED_LIMIT", "Model", "Statement"]


FUSED_LIMIT = 130
"""Unknowns up to which residual and Jacobian are one kernel: beyond, compilation costs more than it saves."""


@dataclass(frozen=True)
class Statement:
    """A stated initial velocity or angular velocity of a body, or its held pose."""

    body: str
    quantity: str
    coordinates: Index
    parameters: Index


@dataclass(frozen=True)
class Model:
    """Everything numeric about a mechanism.

    Attributes
    ----------
    time : float
        Initial time, s.
    layout : Layout
        Sizes, kept rows and frozen coordinates.
    bodies : tuple of str
        Names, in the order of their coordinates.
    size, dimension : int
        Coordinates of a body, and dimension of its position.
    equations : tuple of str
        Name of every constraint equation ("A: point x").
    owners : tuple of str
        Component of every constraint equation.
    norms : array of int
        Equations that give a body's quaternion unit length, which every mechanism has.
    parameters : ParameterMap
        All parameters of all instances, then the drawn pose, statements, break times, random variables of start
        conditions, and random numbers that have a range.
    limits : tuple of Limit
        Parameters that have a range.
    tensors : tuple of Tensor
        Random inertia tensors.
    """

    name: str
    time: float
    layout: Layout
    bodies: tuple[str, ...]
    size: int
    dimension: int
    equations: tuple[str, ...]
    owners: tuple[str, ...]
    norms: Index
    cosines: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: ParameterMap
    drawn: Index
    statements: tuple[Statement, ...]
    held: Index
    breaks: Index
    limits: tuple[Limit, ...]
    tensors: tuple[Tensor, ...]
    evaluators: dict[str, Evaluator] = field(repr=False)
    events: tuple[tuple[str, str, int], ...] = ()
    """Component and label of each event, and in how many directions velocities jump, the normal one first; 0: none."""
    rough: bool = False
    """Whether a force has corners in the state (contact, stops, friction): long steps could step over them."""
    notices: tuple[str, ...] = ()
    """What may be meant and often is not, a sentence each."""
    digest: str = ""
    """Hash of all equations, parameters and outputs, as symbols."""
    outputs: Any = field(default=None, repr=False)
    scalars: Any = field(default=None, repr=False)
    """Compiled outputs without a time, or None."""
    system: Any = field(default=None, repr=False)
    pattern: tuple[Index, Index] = field(default=(np.zeros(0, int), np.zeros(0, int)), repr=False)
    """Row indices and column pointers of the Jacobian, compressed by columns."""
    prescribed: Any = field(default=None, repr=False)
    """Functions of time that components with constraints are given, a `Prescribed`."""
    timed: Any = field(default=None, repr=False)
    """Functions of time that may be stepped over, `uqmbd.dynamics.integration.functions_of_time.Timed`."""
    tables: Any = field(default=None, repr=False)
    """Tables over time, a `uqmbd.dynamics.integration.knots.TimedTables`; None: it has none."""
    length: float = 1.0
    """Largest extent of the mechanism as drawn, m, at the means; 1 where none is known."""
    max_step: float = np.inf
    """Longest step of any integrator, s."""
    added_breaks: tuple[float, ...] = ()
    """Times at which integrations start anew besides those that the equations have, s."""
    conditions: Any = field(default=None, repr=False)
    """What holds at the start only, `uqmbd.dynamics.equations.start_conditions.Conditions`, or None."""
    controls: tuple[Any, ...] = ()
    """Controllers, each a `uqmbd.dynamics.control.Loop`."""
    speeds_commanded: bool = False
    """Whether a command is a speed that a constraint prescribes."""
    links: tuple[tuple[int, int], ...] = ()
    """Pairs of bodies that components connect, by number; -1, the first of a pair: the ground."""
    turned: tuple[str, ...] = ()
    """Components that prescribe an angle, by name (`Component.prescribed_angle`)."""
    start_at: str = "drawn"
    """Where realisations start: ``drawn`` (as assembled from the drawn pose) or ``equilibrium``."""

    def between_samples(self, time: float) -> Model:
        """Return the model with another initial time, s, and without controllers: what they command is constant.

        What has been looked up stays known.
        """
        other = replace(self, time=time, controls=())
        for name in ("_places", "block_parameters", "counts"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    @cached_property
    def block_parameters(self) -> int:
        """How many parameters belong to the blocks (the first ones)."""
        return int(self.drawn[0]) if len(self.drawn) else len(self.parameters.constants)

    @cached_property
    def counts(self) -> dict[str, int]:
        """How many there are of what the indices of results count."""
        return {
            "q": self.layout.coordinates, "state": self.layout.states, "row": self.layout.constraints,
            "cos": len(self.cosines), "event": len(self.events), "direction": sum(n for *_, n in self.events),
            "pair": 2,
        }  # fmt: skip

    def result(self, kind: Kind, name: str, values: Array) -> Array:
        """Vector or matrix of a name among the results of an evaluator (K, result), shape (K, ...)."""
        _, _, _, places = self._places[kind]
        shape, part, columns, entries = places[name]
        found = np.zeros((len(values), part.stop - part.start))
        found[:, entries] = values[:, columns]
        return found.reshape(len(values), *shape)

    def evaluate(self, kind: Kind, arguments: Array, parameters: Array) -> dict[str, Array]:
        """Evaluate all vectors and matrices of a kind, by name."""
        size, columns, entries, places = self._places[kind]
        found = np.zeros((len(arguments), size))
        found[:, entries] = self.evaluators[kind](arguments, parameters)[:, columns]
        return {name: found[:, part].reshape(len(found), *shape) for name, (shape, part, _, _) in places.items()}

    @cached_property
    def _places(self) -> dict[Kind, tuple[int, Index, Index, dict[str, tuple[tuple[int, ...], slice, Index, Index]]]]:
        """Of each kind: all entries of its vectors and matrices, the results that are some, and which ones.

        Then by name: the shape, the part of all entries, the results that are some of its own, and which ones.
        """
        found: dict[Kind, tuple[int, Index, Index, dict[str, tuple[tuple[int, ...], slice, Index, Index]]]] = {}
        none = np.zeros(0, dtype=np.int64)
        for kind in RESULTS.keys() & self.evaluators.keys():
            size, places = 0, dict[str, tuple[tuple[int, ...], slice, Index, Index]]()
            for name, spaces in RESULTS[kind].items():
                shape = tuple(self.counts[x] for x in spaces)
                columns, where = self.evaluators[kind].index.get(name, (none, ()))
                entries = np.ravel_multi_index(tuple(where), shape) if len(columns) else none
                places[name] = shape, slice(size, size + math.prod(shape)), columns, entries
                size += math.prod(shape)
            every = np.concatenate([none, *(columns for _, _, columns, _ in places.values())])
            shifted = [entries + part.start for _, part, _, entries in places.values()]
            found[kind] = size, every, np.concatenate([none, *shifted]), places
        return found

    def of_components(self, equations: Index) -> list[int]:
        """Those of some constraint equations that components state."""
        norms = set(self.norms.tolist())
        return [int(k) for k in equations if int(k) not in norms]

    def quaternions(self) -> Index:
        """Coordinates of each body's quaternion, shape (body, 2 or 4); empty in translational space."""
        first = np.arange(len(self.bodies)) * self.size + self.dimension
        return first[:, None] + np.arange(self.size - self.dimension)[None, :]


def place(instances: list[Instance], order: dict[str, int], kept: Index | None = None) -> list[Placement]:
    """Give every local variable its global index.

    Parameters
    ----------
    instances : list of Instance
        All blocks.
    order : dict
        Index of each body by name.
    kept : array of int, optional
        Independent equations; all by default.
    """
    total = sum(len(i.type.constraints) for i in instances)
    number = np.full(total, -1, dtype=np.int64)
    kept = np.arange(total) if kept is None else kept
    number[kept] = np.arange(len(kept))
    rows = states = cosines = parameters = events = directions = 0
    holders = _holders(instances)
    placements = []
    for instance in instances:
        block = instance.type
        size = block.space.size
        q = np.concatenate([np.arange(size) + order[b.name] * size for b in instance.bodies] or [np.zeros(0, int)])
        row = np.arange(rows, rows + len(block.constraints))
        state = np.arange(states, states + len(block.states))
        multipliers = number[row]
        one = np.zeros(1, dtype=np.int64)
        along = sum(len(e.directions) for e in block.events)
        held = {"h": np.array([holders[h.owner] + h.index for h in instance.held])} if instance.held else {}
        placements.append(
            Placement(
                {
                    "q": q,
                    "v": q,
                    "dq": q,
                    "dv": q,
                    "s": state,
                    "ds": state,
                    "l": multipliers,
                    "m": multipliers,
                    "t": one,
                    "c": one,
                    "row": row,
                    "state": state,
                    "cos": np.arange(cosines, cosines + len(block.cosines)),
                    "event": np.arange(events, events + len(block.events)),
                    "direction": np.arange(directions, directions + along),
                    **held,
                },  # fmt: skip
                np.arange(parameters, parameters + block.parameters),
            )
        )
        rows, states = rows + len(block.constraints), states + len(block.states)
        cosines, parameters = cosines + len(block.cosines), parameters + block.parameters
        events, directions = events + len(block.events), directions + along
    return placements


def _holders(instances: list[Instance]) -> dict[Controller, int]:
    """First auxiliary state of each controller."""
    found: dict[Controller, int] = {}
    states = 0
    for instance in instances:
        if isinstance(instance.component, HeldStates):
            found[instance.component.controller] = states
        states += len(instance.type.states)
    return found


def residual_places(places: list[Placement], layout: Layout) -> list[Placement]:
    """Placements whose letters are rows of ``y``: what residual and Jacobian targets need.

    Frozen coordinates come after all unknowns; their velocities are dropped.
    """
    slices, n = layout.slices, layout.coordinates
    unknown, held = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    unknown[layout.free] = np.arange(n - len(layout.frozen))
    held[layout.frozen] = layout.unknowns + np.arange(len(layout.frozen))
    result = []
    for p in places:
        letters = dict(p.letters)
        for letter in ("q", "v", "dq", "dv"):
            letters[letter] = unknown[p.letters[letter]]
        for letter in "qsvlm":
            index = letters[letter]
            letters[letter] = np.where(index < 0, -1, index + slices[letter].start)
        if "h" in letters:
            letters["h"] = letters["h"] + slices["s"].start
        letters["q"] = np.where(letters["q"] < 0, held[p.letters["q"]], letters["q"])
        result.append(Placement(letters, p.parameters, layout.unknowns))
    return result


def compiled_evaluator(
    kind: Kind, instances: list[Instance], order: dict[str, int], layout: Layout, parameters: int, *, fuse: bool
) -> Evaluator:
    """Compile one kind of equations."""
    blocks = [i.type for i in instances]
    if kind in ("residual", "jacobian"):
        places = residual_places(place(instances, order, layout.active), layout)
        # in y the columns of q, s, v, l, m are their own indices
        columns = {
            (x, i + (layout.slices[x].start if x in "qsvlm" else 0)): c for (x, i), c in layout.columns(kind).items()
        }
        # behind the zero column stand the values of the frozen coordinates
        first = len(columns) + 1
        columns |= {("q", layout.unknowns + i): first + i for i in range(len(layout.frozen))}
    else:
        places = place(instances, order)
        columns = layout.columns(kind)
    if fuse:
        return fused(kind, blocks, places, columns, parameters)
    return typed(kind, blocks, places, columns)


def csc_pattern(jacobian: Evaluator, unknowns: int) -> tuple[Index, Index]:
    """Row indices and column pointers from the targets of a Jacobian, which are sorted by column and row."""
    columns = np.array([x[1] for x in jacobian.targets], dtype=np.int64)
    rows = np.array([x[2] for x in jacobian.targets], dtype=np.int64)
    pointers = np.searchsorted(columns, np.arange(unknowns + 1))
    return rows, pointers.astype(np.int64)


def break_times(
    expressions: list[sympy.Expr], time: sympy.Symbol, whole: Callable[[sympy.Expr], sympy.Expr] = lambda e: e
) -> list[sympy.Expr]:
    """Find the times at which expressions may change branch: roots of conditions that are linear in time.

    Those at which a spline ends are such.  `whole` inserts what named quantities in a condition stand for.
    """
    found: list[sympy.Expr] = []
    for e in expressions:
        conditions = [x.lhs - x.rhs for x in sorted(e.atoms(sympy.core.relational.Relational), key=str)]
        conditions += [x.argument - end for x in sorted(e.atoms(Spline), key=str) for end in x.table.breaks]
        for condition in conditions:
            difference = whole(condition)
            slope = difference.diff(time)
            if slope != 0 and not slope.has(time):
                root = -difference.subs(time, 0) / slope
                if not root.has(time) and root not in found:
                    found.append(root)
    return found
