"""Explicit integration of many realisations: the driver steps eight at once, each with a separate step size.

The result of a realisation does not depend on the others. A realisation that requires a decision stops with a status
that states the reason. The caller then changes the rows of the realisation here, and continues it.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.encounters import ContactPrograms, Encounters, SampledControl
from uqmbd.compiled.programs import ProgramPart
from uqmbd.compiled.radau import ImplicitEquations
from uqmbd.compiled.recording import PLACES, StepRecorder
from uqmbd.compiled.writer import LANES
from uqmbd.typing import Array, Index

__all__ = [
    "ORDER",
    "STAGES",
    "Constraints",
    "Dynamics",
    "ExplicitOptions",
    "IntegrationState",
    "InterpolatedState",
    "ExplicitStatus",
]

STAGES = 12
ORDER = 8
POINTS = 8
NODES = 5
"""Number of stored states of each realisation: those at the ends of its last steps."""
BUDGET = 40_000
"""Number of evaluations, of eight states each, after which the driver returns: less than 0.1 s for a small mechanism,
so that interrupts are possible."""


class InterpolatedState(IntEnum):
    """Whether an interpolated state is far from the constraints or close to them, as in dop853.h; 0: unknown."""

    FAR = 1
    CLOSE = 2


class ExplicitStatus(IntEnum):
    """Status of a realisation, as in dop853.h."""

    RUNNING = 0
    DONE = 1
    JUMP = 2
    REFUSED = 3
    STRAYED = 4
    STIFF = 5
    MANY = 6
    SMALL = 7
    STEPPED = 8
    EVENT = 9
    NOTED = 10
    UNSAMPLED = 11
    ASKED = 12


Interval = tuple[float, float, bool]


@dataclass(frozen=True)
class Constraints:
    """Residuals of the constraints and the projection onto them, as programs on the work array of `Dynamics`."""

    values: ProgramPart  # part of the motion before its solution
    drift: ProgramPart  # maps a state to the residuals of the constraints
    place: ProgramPart  # computes corrections of coordinates, after `motion` or `values`, and after `drift`
    move: ProgramPart  # computes corrections of velocities
    residuals: Index  # (equation,): rows of the residuals, first in position, then in velocity
    positions: int  # number of residuals in position
    surplus: Index  # (2 coordinate,): rows of the corrections

    @property
    def operations(self) -> int:
        """Return the number of row operations for the residuals at a state, after its motion."""
        return self.drift.operations + self.place.operations + self.move.operations


@dataclass(frozen=True)
class Dynamics:
    """Equations of motion, as programs on one work array.

    The first rows of the array are a state (q, s, v), the time, the constant 0, and the parameters.
    """

    coordinates: int  # number of coordinates
    velocities: int  # index of the first velocity in a state
    width: int  # length of a state
    parameters: int  # number of parameters
    motion: ProgramPart  # maps a state to its rate
    rate: Index  # (width,): rows of the rate
    constraints: Constraints | None  # None: there are no constraints
    rows: int  # number of rows of the work array
    # number of entries of a state that change, minus one for each rotating body: angular velocities replace quaternions
    moving: int
    # (body, 2 or 4): coordinates of the unit quaternions, which are stepped by angular velocities
    turns: Index = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    terms: int = 0  # 0: lanes are realisations; else terms of a problem with states (terms, width / blocks)
    blocks: int = 1  # number of rows of an entry
    cost: int = 1  # estimated cost of a rate, in evaluations of eight realisations
    implicit: ImplicitEquations | None = None  # equations of implicit steps; None: steps are explicit


_NOTHING, _NO_ROWS = ProgramPart((), 0), np.zeros(0, dtype=np.int64)
NONE = Constraints(_NOTHING, _NOTHING, _NOTHING, _NOTHING, _NO_ROWS, 0, _NO_ROWS)
"""No constraints."""


@dataclass(frozen=True)
class ExplicitOptions:
    """Tolerances and limits of an explicit integration."""

    rtol: float  # relative tolerance
    far: float  # distance from the constraints above which an interpolated state is marked as poor
    surplus: float  # distance by which a step may leave the constraints, in tolerances
    stiff: float  # step size times norm of the Jacobian above which stability instead of accuracy limits the step
    patience: int  # number of consecutive steps that must appear stiff; of steps and rejected steps, if `early`
    refusals: int  # number of consecutive rejected steps before the driver returns for a decision
    attempts: int  # maximum number of attempted steps of an integration interval
    guarded: bool  # whether the driver returns for a decision on rejected steps and on steps that leave the constraints
    early: bool = False  # whether up to five other steps may be between those that appear stiff
    between: float = np.inf  # error of the interpolant above which a step is rejected, in tolerances
    brief: bool = False  # whether steps over whole integration intervals are tried with order 5


@cache
def tableau() -> tuple[c.TableauStruct, tuple[NDArray[Any], ...]]:
    """Return the nonzero coefficients of the method, and the arrays to which their pointers refer.

    The coefficients are those of SciPy. The import of `scipy.integrate`, with its dependencies, would take 0.2 s.
    """
    text = files("uqmbd.compiled").joinpath("source/dop853.json").read_text(encoding="utf-8")
    listed = {name: rows for name, rows in json.loads(text).items() if name != "source"}
    stages = np.zeros((STAGES, STAGES + 4))
    for row, found in zip(stages, listed.pop("A"), strict=True):
        row[: len(found)] = found
    of = {name: np.array(rows, dtype=float) for name, rows in listed.items()}
    count = STAGES + 4
    unit = np.eye(count)
    step = np.concatenate([of["B"], np.zeros(4)])
    errors = np.zeros((2, count))
    errors[0, : STAGES + 1], errors[1, : STAGES + 1] = of["E5"], of["E3"]
    dense = [step, unit[0] - step, 2 * step - unit[STAGES] - unit[0], *of["D"]]
    part, between = float(of["C_EXTRA"][-1]), np.zeros(count)
    for place, row in reversed(list(enumerate(dense))):
        between = (between + row) * (1 - part if place % 2 else part)
    table = np.vstack([stages, step, of["A_EXTRA"], *dense, errors, between - of["A_EXTRA"][-1]])
    index = [np.flatnonzero(row) for row in table]
    zeros = [-len(i) % 4 for i in index]
    starts = np.cumsum([0, *(len(i) + k for i, k in zip(index, zeros, strict=True))]).astype(np.int64)
    weights = np.concatenate([np.append(row[i], np.zeros(k)) for row, i, k in zip(table, index, zeros, strict=True)])
    index = [np.append(i, np.full(k, i[-1] if k else 0)).astype(np.int64) for i, k in zip(index, zeros, strict=True)]
    moments = np.concatenate([of["C"], [1.0], of["C_EXTRA"]])
    nodes, between = (-np.cos((np.arange(POINTS) + k) * np.pi / POINTS) for k in (0.5, 1.0))
    sums = np.polynomial.chebyshev.chebvander(nodes, POINTS - 1) * np.where(np.arange(POINTS), 2.0, 1.0) / POINTS
    points = np.concatenate([0.5 + 0.5 * nodes, 0.5 + 0.5 * between, sums.ravel()])
    kept = (starts, np.concatenate(index), weights, moments, points)
    return c.TableauStruct(*map(address, kept)), kept


class IntegrationState:
    """State of an integration of M realisations: arrays that the driver and the code in Python share.

    Initial states `z` have the shape (M, width), `parameters` (M, parameter), and absolute tolerances `floor` (M,).
    Output `times` (T,) begin with the start. `intervals` are the integration intervals of each realisation: (end,
    longest step, whether the driver returns for a decision at the end). If only the first realisation has intervals,
    they apply to all realisations; equal objects are stored once. If `recording`, all steps are recorded (`recorder`).
    With `control`, the driver samples controllers at the ends of intervals.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        method: ExplicitOptions,
        z: Array,
        parameters: Array,
        times: Array,
        intervals: Sequence[Sequence[Interval]],
        floor: Array,
        contacts: ContactPrograms | None = None,
        encounters: Encounters | None = None,
        *,
        recording: bool = False,
        control: SampledControl | None = None,
    ) -> None:
        count, width = z.shape
        self.control = control
        self.contacts, self.encounters = contacts, encounters
        # number of evaluations so far, of eight states each
        self.dynamics, self.method, self.evaluations = dynamics, method, 0
        self.times = np.ascontiguousarray(times, dtype=float)
        self.z = np.array(z, dtype=float, order="C")
        self.rate = np.zeros_like(self.z)
        self.parameters = np.ascontiguousarray(parameters[:, : dynamics.parameters], dtype=float)
        self.now, self.begin = np.full((2, count), self.times[0])
        self.wanted, self.floor = np.zeros(count), np.ascontiguousarray(floor, dtype=float)
        self.limit, self.tried = np.full(count, np.inf), np.zeros(count)
        integers = np.zeros((16, count), dtype=np.int64)
        # status: see `ExplicitStatus`
        self.interval, self.last_interval, self.first, self.column, self.status = integers[:5]
        self.attempts, self.refused, self.stiff, self.fresh, self.rejected = integers[5:10]
        self.allowed, self.trusted, self.told, self.steps, self.known, self.pause = integers[10:]
        self.allowed[:] = 2**62
        layouts = {id(own): own for own in intervals}
        firsts = dict(zip(layouts, np.cumsum([0, *map(len, layouts.values())]).tolist(), strict=False))
        self.interval[:] = [firsts[id(own)] for own in intervals]
        self.last_interval[:] = self.interval + [len(own) - 1 for own in intervals]
        every = [interval for own in layouts.values() for interval in own]
        self.interval_ends, self.interval_longest = (
            np.array([interval[k] for interval in every], dtype=float) for k in (0, 1)
        )
        self.interval_jumps = np.array([interval[2] for interval in every], dtype=np.int64)
        if control is not None:  # the driver takes the samples at the ends of intervals
            self.interval_jumps[control.ending(self.interval_ends) >= 0] = 0
        self.first[:], self.column[:], self.fresh[:], self.known[:] = 1, 1, 1, 1
        self.node_times, self.nodes = np.zeros((count, NODES)), np.zeros((count, NODES, width))
        self.node_times[:, -1], self.nodes[:, -1] = self.times[0], z
        stages = 0 if dynamics.implicit is None else dynamics.implicit.stages
        self.history = np.zeros((count, stages * width + 2))
        # (M, T, width): interpolated states at output times of index below `column`, near the constraints until
        # `project` projects them; undefined at later times until `project`, or NaN for rows of one problem
        self.result = np.empty((count, len(self.times), width))
        self.result[:, 0] = z
        if dynamics.terms:
            self.result[:, 1:] = np.nan
        self.continued = np.zeros(count, dtype=bool)  # whether other equations continue a realisation
        # (M, equation + 1): largest residuals of the constraints at the output times after `project`, and the largest
        # speed at these times
        self.off = np.zeros((count, self._equations + 1))
        # (M, T): members of InterpolatedState, or 0
        self.poor = np.zeros((count, len(self.times)), dtype=np.int8)
        self.recorder = StepRecorder(count, width, recording=recording)

    def advance(self, members: Index | None = None, watch: Callable[[IntegrationState], None] | None = None) -> None:
        """Run realisations until all have stopped; rows of one problem run together.

        `watch` is called at intervals, which are less than 0.1 s for a small mechanism.
        """
        if self.dynamics.terms:
            members = np.arange(min(len(self.z), LANES))
        queue = self._every if members is None else np.ascontiguousarray(members, dtype=np.int64)
        place = self._place_of_every if members is None else address(queue)
        call, recorder, going = self._call, self.recorder, True
        while going:
            self.evaluations += call(place, len(queue))
            if recorder.room:
                recorder.take()
                for name in c.RECORDED:
                    setattr(self._pool, name, address(getattr(recorder, name)))
            if watch is not None:
                watch(self)
            # RUNNING is 0, and the only status without a value
            going = bool(np.count_nonzero(self.status if members is None else self.status[queue]) < len(queue))

    def project(self) -> None:
        """Project the states at the output times onto the constraints; states that were not reached become NaN."""
        for member in np.flatnonzero((self.column < len(self.times)) & ~self.continued).tolist():
            self.result[member, self.column[member] :] = np.nan
        if self.dynamics.constraints is None:
            return
        queue, workspace = np.arange(len(self.z)), aligned(self.dynamics.rows + self._equations + 1)
        places = (ctypes.addressof(x) for x in (self._problem, self._pool))
        load_driver().project(*places, address(queue), len(queue), address(workspace))

    # -- for the caller ----------------------------------------------------------------------------------------------
    def last_nodes(self, member: int) -> tuple[Array, Array]:
        """Return times (N,) and states (N, width) at the ends of the last steps."""
        first = NODES - int(self.known[member])
        return self.node_times[member, first:], self.nodes[member, first:]

    def settle(self, member: int, state: Array) -> None:
        """Replace the state at the end of the last step."""
        self.z[member] = self.nodes[member, -1] = state
        self.fresh[member] = 1

    def go_on_from(self, member: int, time: float, state: Array) -> None:
        """Continue from a given state; the history before it is discarded."""
        self.now[member] = self.node_times[member, -1] = time
        self.known[member] = 1
        self.settle(member, state)

    def step_back(self, member: int) -> None:
        """Undo the last step: continue from the state at its begin."""
        for array in (self.node_times, self.nodes):
            array[member, 1:] = array[member, :-1].copy()
        self.known[member] -= 1
        self.now[member], self.z[member] = self.node_times[member, -1], self.nodes[member, -1]
        self.fresh[member] = 1

    def moved(self, member: int, dynamics: Dynamics) -> IntegrationState:
        """Return a new state that continues one realisation with other equations; both states share the results."""
        new, one = copy(self), slice(member, member + 1)
        for name in c.POOL:
            rows = getattr(self, name)[one]
            setattr(new, name, rows if name in ("result", "poor") else rows.copy())
        for name in ("_pool", "_problem", "_every", "_place_of_every", "_call"):
            new.__dict__.pop(name, None)
        new.dynamics, new.evaluations = dynamics, 0
        new.recorder = self.recorder.of(member)
        new.control = None if self.control is None else self.control.of(member)
        new.off = np.zeros((1, new._equations + 1))
        new.steps[:], new.first[:] = 0, new.column
        new.continued = np.zeros(1, dtype=bool)
        self.status[member], self.continued[member] = ExplicitStatus.DONE, True
        return new

    @cached_property
    def _every(self) -> Index:
        """All realisations."""
        return np.arange(len(self.z))

    @cached_property
    def _place_of_every(self) -> int:
        return address(self._every)

    @cached_property
    def _call(self) -> Callable[[int, int], int]:
        """Function that runs the realisations of a queue, given the address and the length of the queue."""
        functions, problem, pool = load_driver(), self._problem, self._pool
        workspace = aligned(-(-functions.advance_workspace(ctypes.addressof(problem)) // LANES))
        places = ctypes.addressof(problem), ctypes.addressof(pool)
        place, budget, advance = address(workspace), max(1, BUDGET // self.dynamics.cost), functions.advance

        def call(queue: int, count: int) -> int:
            found: int = advance(*places, queue, count, place, budget)
            return found

        vars(call)["kept"] = workspace
        return call

    @property
    def _equations(self) -> int:
        constraints = self.dynamics.constraints
        return 0 if constraints is None else len(constraints.residuals)

    @cached_property
    def _pool(self) -> c.PoolStruct:
        happening = None if self.encounters is None else self.encounters.structure
        place = 0 if happening is None else ctypes.addressof(happening)
        recorded = (address(getattr(self.recorder, name)) for name in c.RECORDED)
        found = c.PoolStruct(*(address(getattr(self, name)) for name in c.POOL), *recorded, place)
        found.kept = happening
        return found

    @cached_property
    def _problem(self) -> c.ProblemStruct:
        d, m = self.dynamics, self.method
        k = d.constraints or NONE
        parts = [part.structure for part in (d.motion, k.values, k.drift, k.place, k.move)]
        coefficients, firsts = tableau(), np.ascontiguousarray(d.turns[:, :1], dtype=np.int64)
        contacts = None if self.contacts is None else self.contacts.structure
        implicit = None if d.implicit is None else d.implicit.structure
        control = None if self.control is None else self.control.structure
        found = c.ProblemStruct(
            *(d.terms, d.blocks, d.width, d.coordinates, d.velocities, d.parameters, d.width, d.rows),
            *(parts[0], address(d.rate), *d.turns.shape, address(firsts), *parts[1:]),
            *(0 if d.constraints is None else address(k.surplus), address(k.residuals), k.positions, len(k.residuals)),
            ctypes.addressof(coefficients[0]),
            *(m.rtol, float(d.moving), m.far, m.surplus, m.between, m.stiff),
            *(m.patience, int(m.early), m.refusals, m.attempts, int(m.guarded), int(m.brief), len(self.times)),
            *map(address, (self.times, self.interval_ends, self.interval_longest, self.interval_jumps)),
            0 if contacts is None else ctypes.addressof(contacts),
            *(address(PLACES), self.recorder.room),
            0 if implicit is None else ctypes.addressof(implicit),
            0 if control is None else ctypes.addressof(control),
        )
        found.kept = (
            parts,
            coefficients,
            firsts,
            contacts,
            implicit,
            control,
        )  # keep the targets of pointers alive, because another thread may replace this structure
        return found
