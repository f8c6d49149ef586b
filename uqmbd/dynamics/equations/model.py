"""Numerical model of a mechanism: index maps and compiled equations, without symbols, for worker processes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy

from uqmbd.dynamics.equations.evaluators import Evaluators
from uqmbd.dynamics.equations.layout import RESULTS, Kind, Layout, ParameterMap
from uqmbd.dynamics.equations.limits import Limit, Tensor
from uqmbd.dynamics.equations.paths import PathFamily
from uqmbd.errors import Finding
from uqmbd.mechanism import Spline
from uqmbd.typing import Array, Index

__all__ = ["Model", "Statement"]


@dataclass(frozen=True)
class Statement:
    """Given initial velocity or angular velocity of a body, or its held pose."""

    body: str
    quantity: str
    coordinates: Index
    parameters: Index


class _Places(NamedTuple):
    """Layout of the results of one kind of evaluator.

    `size`: number of entries of all vectors and matrices. `columns`: columns of the evaluator's results; `entries`:
    entry that each column fills. `named`: by name, the shape, the range of entries, the columns, and their entries
    within this range.
    """

    size: int
    columns: Index
    entries: Index
    named: dict[str, tuple[tuple[int, ...], slice, Index, Index]]


@dataclass(frozen=True)
class Model:
    """Numerical model of a mechanism."""

    name: str
    time: float  # initial time, s
    layout: Layout  # sizes, kept rows and frozen coordinates
    bodies: tuple[str, ...]  # names of bodies, in the order of their coordinates
    size: int  # number of coordinates of a body
    dimension: int  # dimension of the position of a body
    equations: tuple[str, ...]  # name of every constraint equation ("A: point x")
    owners: tuple[str, ...]  # component of every constraint equation
    norms: Index  # equations for the unit norm of quaternions, present in every mechanism
    cosines: tuple[str, ...]
    inputs: tuple[str, ...]
    # parameters of all instances, then given pose, statements, break times, inputs of start conditions, ranged numbers
    parameters: ParameterMap
    drawn: Index
    statements: tuple[Statement, ...]
    held: Index
    breaks: Index
    limits: tuple[Limit, ...]
    tensors: tuple[Tensor, ...]
    evaluators: Evaluators = field(repr=False)
    events: tuple[tuple[str, str, int], ...] = ()
    """Component and label of each event, and number of directions in which velocities jump.

    The first direction is the normal; 0: velocities do not jump.
    """
    given_loads: tuple[bool, ...] = ()
    """Whether each event is dry friction, whose first direction is a given load instead of a motion."""
    rough: bool = False
    """Whether a force has corners in the state (contact, stops, friction), which long steps could miss."""
    findings: tuple[Finding, ...] = ()
    """Probable mistakes of the mechanism."""
    digest: str = ""
    """Hash of all equations, parameters and outputs, as symbols."""
    outputs: Any = field(default=None, repr=False)
    scalars: Any = field(default=None, repr=False)
    """Compiled scalar outputs, or None."""
    margins: Any = field(default=None, repr=False)
    """Compiled margins of requirements, `uqmbd.dynamics.margins.MarginMap`, or None."""
    system: Any = field(default=None, repr=False)
    prescribed: Any = field(default=None, repr=False)
    """Functions of time in parameters of components with constraints, a `Prescribed`."""
    timed: Any = field(default=None, repr=False)
    """Functions of time that a step may miss, `uqmbd.dynamics.integration.functions_of_time.TimedFunctions`."""
    tables: Any = field(default=None, repr=False)
    """Tables over time, a `uqmbd.dynamics.integration.knots.TimedTables`; None: no tables."""
    length: float = 1.0
    """Largest extent of the given pose at the means, m; 1 if unknown."""
    max_step: float = np.inf
    """Longest step of any integrator, s."""
    added_breaks: tuple[float, ...] = ()
    """Further times at which integrations restart, s."""
    conditions: Any = field(default=None, repr=False)
    """Start conditions, `uqmbd.dynamics.equations.start_conditions.Conditions`, or None."""
    controls: tuple[Any, ...] = ()
    """Controllers, each a `uqmbd.dynamics.control.Loop`."""
    speeds_commanded: bool = False
    """Whether a command is a prescribed speed of a constraint."""
    links: tuple[tuple[int, int], ...] = ()
    """Pairs of bodies that components connect, by number; -1, as the first of a pair, is the ground."""
    acting: tuple[tuple[str, ...], ...] = ()
    """Names of components that exert forces, other than constraint forces, on each body."""
    turned: tuple[str, ...] = ()
    """Names of components that prescribe an angle (`Component.prescribed_angle`)."""
    excitations: int = 0
    """Number of coefficients of excitations."""
    paths: tuple[PathFamily, ...] = ()
    """Families of sampled paths of excitations."""
    start_at: str = "drawn"
    """Start of realisations: ``drawn`` (assembled from the given pose) or ``equilibrium``."""
    own: tuple[tuple[str, str, str], ...] = ()
    """Component, name and units of each coordinate of a component; they follow the coordinates of the bodies."""
    largest: tuple[float, ...] = ()
    """Largest valid absolute value of each coordinate of a component."""
    fastest: tuple[tuple[str, int, float], ...] = ()
    """Component, number of a body, and angular speed of the body up to which the component is valid, rad/s."""

    @property
    def of_bodies(self) -> int:
        """Number of coordinates of bodies, which are the first coordinates."""
        return len(self.bodies) * self.size

    def by_body(self, values: Array) -> Array:
        """Return the values of bodies among values of all coordinates (..., coordinate), shape (..., body, size)."""
        return values[..., : self.of_bodies].reshape(*values.shape[:-1], len(self.bodies), self.size)

    def beyond(self, times: Array, states: Array) -> str:
        """Return a value beyond the range of validity of a component in states (T, width), as text, or empty."""
        own = np.abs(states[:, self.of_bodies : self.layout.coordinates])
        excess = own / np.array(self.largest).reshape(1, -1)
        if excess.size and np.nanmax(excess) > 1:
            row, k = map(int, np.unravel_index(int(np.nanargmax(excess)), excess.shape))
            component, name, units = self.own[k]
            return (
                f"coordinate {name!r} of {component!r} reaches {own[row, k]:.3g} {units} at {times[row]:.4g} s, but "
                f"the component is valid only up to {self.largest[k]:.3g} {units}"
            )
        for component, number, bound in self.fastest:
            rates = self.by_body(states[:, self.layout.velocities :])[:, number, self.dimension :]
            speeds = 2 * np.linalg.norm(rates, axis=1)  # the rate of a unit quaternion is half the angular velocity
            row = int(np.nanargmax(speeds))
            if speeds[row] > bound:
                return (
                    f"the angular speed of body {self.bodies[number]!r} reaches {speeds[row]:.3g} rad/s at "
                    f"{times[row]:.4g} s, but {component!r} is valid only up to {bound:.3g} rad/s"
                )
        return ""

    def carrier(self, coordinate: int) -> str:
        """Return the body or the component of a coordinate, such as ``body 'rod'``."""
        if coordinate < self.of_bodies:
            return f"body {self.bodies[coordinate // self.size]!r}"
        component, name, _ = self.own[coordinate - self.of_bodies]
        return f"coordinate {name!r} of {component!r}"

    @property
    def needs_dense_output(self) -> bool:
        """Whether outputs or requirements need the motion between the output times."""
        return any(one is not None and one.needs_dense_output for one in (self.scalars, self.margins))

    def between_samples(self, time: float) -> Model:
        """Return the model with another initial time in s, and with constant commands instead of controllers.

        The new model reuses the cached index maps and counts of this model.
        """
        other = replace(self, time=time, controls=())
        for name in ("_places", "block_parameters", "counts", "pattern", "rheonomic"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    @cached_property
    def rheonomic(self) -> bool:
        """Whether constraints depend on time."""
        return "phi_t" in self.evaluators["velocity"].index

    @cached_property
    def block_parameters(self) -> int:
        """Number of parameters of the blocks, which precede all other parameters."""
        return int(self.drawn[0]) if len(self.drawn) else len(self.parameters.constants)

    @cached_property
    def pattern(self) -> tuple[Index, Index]:
        """Row indices and column pointers of the Jacobian, compressed by columns, in the order of its targets."""
        targets = self.evaluators["jacobian"].targets
        columns, rows = (np.array([x[k] for x in targets], dtype=np.int64) for k in (1, 2))
        return rows, np.searchsorted(columns, np.arange(self.layout.unknowns + 1)).astype(np.int64)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Length of each named dimension of the results."""
        return {
            "q": self.layout.coordinates, "state": self.layout.states, "row": self.layout.constraints,
            "cos": len(self.cosines), "event": len(self.events), "direction": sum(n for *_, n in self.events),
            "pair": 2, "excitation": self.excitations, "h": self.layout.states,
        }  # fmt: skip

    def result(self, kind: Kind, name: str, values: Array) -> Array:
        """Return the vector or matrix with a name from results of an evaluator (K, result), shape (K, ...)."""
        shape, part, columns, entries = self._places_of(kind).named[name]
        found = np.zeros((len(values), part.stop - part.start))
        found[:, entries] = values[:, columns]
        return found.reshape(len(values), *shape)

    def evaluate(self, kind: Kind, arguments: Array, parameters: Array) -> dict[str, Array]:
        """Evaluate all vectors and matrices of a kind; return them by name."""
        places = self._places_of(kind)
        found = np.zeros((len(arguments), places.size))
        found[:, places.entries] = self.evaluators[kind](arguments, parameters)[:, places.columns]
        return {name: found[:, part].reshape(len(found), *shape) for name, (shape, part, _, _) in places.named.items()}

    @cached_property
    def _places(self) -> dict[Kind, _Places]:
        """Cached places of results."""
        return {}

    def _places_of(self, kind: Kind) -> _Places:
        if kind not in self._places:
            size, named = 0, dict[str, tuple[tuple[int, ...], slice, Index, Index]]()
            none = np.zeros(0, dtype=np.int64)
            for name, spaces in RESULTS[kind].items():
                shape = tuple(self.counts[x] for x in spaces)
                columns, where = self.evaluators[kind].index.get(name, (none, ()))
                entries = np.ravel_multi_index(tuple(where), shape) if len(columns) else none
                named[name] = shape, slice(size, size + math.prod(shape)), columns, entries
                size += math.prod(shape)
            every = np.concatenate([none, *(columns for _, _, columns, _ in named.values())])
            shifted = [entries + part.start for _, part, _, entries in named.values()]
            self._places[kind] = _Places(size, every, np.concatenate([none, *shifted]), named)
        return self._places[kind]

    def of_components(self, equations: Index) -> list[int]:
        """Return the constraint equations of components among `equations`."""
        norms = set(self.norms.tolist())
        return [int(k) for k in equations if int(k) not in norms]

    def quaternions(self) -> Index:
        """Coordinates of each body's quaternion, shape (body, 2 or 4); empty in translational space."""
        first = np.arange(len(self.bodies)) * self.size + self.dimension
        return first[:, None] + np.arange(self.size - self.dimension)[None, :]


def break_times(
    expressions: list[sympy.Expr], time: sympy.Symbol, whole: Callable[[sympy.Expr], sympy.Expr] = lambda e: e
) -> list[sympy.Expr]:
    """Find the times at which expressions may change branch: roots of conditions that are linear in time.

    The ends of splines are included.  `whole` inserts the definitions of named quantities into a condition.
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
