"""Equations of motion coupled by a basis, in coefficients of states, and their C structure for the driver."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.explicit import Constraints, Dynamics
from uqmbd.compiled.programs import ProgramPart, ProgramStep
from uqmbd.compiled.writer import LANES
from uqmbd.typing import Array, Index

__all__ = ["CoupledSystems", "NodalSystems"]


DIRECT = 1000
"""Maximum number of unknowns for a factorisation of the assembled system if iterations diverge: 8 MB, about 0.1 s."""

SYSTEMS, ITERATIONS, DIRECTS, KRYLOVS, _, COUNTS = range(6)
"""Indices of counters, as in coupled.h."""

_OUTSIDE = ctypes.CFUNCTYPE(None, ctypes.c_int64)


@dataclass(frozen=True)
class NodalSystems:
    """Index-1 systems ``A x = b`` at the nodes in the lanes of a work array.

    The first rows of the work array are a state (q, s, v), the time, the constant 0, and the parameters.
    """

    width: int  # length of a state
    coordinates: int  # number of accelerations; they are the first unknowns
    parameters: int  # number of parameters
    values: ProgramPart  # maps a state to the entries of A and b
    drift: ProgramPart  # maps a state to the residuals of the constraints
    factor: ProgramPart  # maps the entries to the factors
    solve: ProgramPart  # maps the factors and a right-hand side to the solution
    rows: int  # number of rows of the work array
    right: int  # first row of the right-hand side
    guess: int  # first row of the vector x in the product A x
    solution: Index  # (size,): rows of the solution
    starts: Index  # first entry of each row of A
    columns: Index  # column of each entry
    entries: Index  # row of the work array of each entry
    motion: Index  # (size,): rows of b; -1: zero
    constraints: Index  # (2, size): rows of the right-hand sides of the corrections of coordinates and velocities
    rates: Index  # (auxiliary state,): rows of the rates of auxiliary states

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return len(self.solution)


class CoupledSystems:
    """The projected system ``Psi^T W A_k Psi x = Psi^T W b_k``, with a correction from its last solutions.

    The basis `psi` at the nodes is (K, P), `adjoint` is ``Psi^T W`` (P, K), and `parameters` of the nodes are (K,
    parameter). The callable `outside` replaces the programs `factor` and `solve`. The arguments of `outside` are the
    work arrays (K / 8, rows, 8), and True for new systems or False for a solution.
    """

    def __init__(
        self,
        systems: NodalSystems,
        psi: Array,
        adjoint: Array,
        parameters: Array,
        outside: Callable[[Array, bool], None] | None = None,
    ) -> None:
        (nodes, terms), self.systems = psi.shape, systems
        self.terms, self.blocks = terms, -(-terms // LANES)
        groups, size = -(-nodes // LANES), systems.size
        # lanes without a node are copies of the last node
        lanes = np.minimum(np.arange(groups * LANES), nodes - 1)
        self.work = aligned(groups * systems.rows).reshape(groups, systems.rows, LANES)
        first = systems.width + 2
        own = parameters[lanes, : systems.parameters].reshape(groups, LANES, -1)
        self.work[:, first : first + systems.parameters] = own.transpose(0, 2, 1)
        self.psi, self.adjoint = aligned(terms * groups), aligned(nodes * self.blocks)
        self.psi[:] = psi[lanes].T.reshape(-1, LANES)
        self.adjoint.reshape(nodes, -1)[:, :terms] = adjoint.T
        self.counts, self.correction = np.zeros(COUNTS, dtype=np.int64), aligned(size * self.blocks)
        self.small = terms * size <= DIRECT and nodes > terms
        gesv = _gesv() if self.small else 0
        # measured with n = 30 to 200 unknowns: a factorisation takes as long as n / 2 iterations
        worth = 0.5 * terms * size if gesv else -1.0
        self._raised: BaseException | None = None
        self._outside = _OUTSIDE(0) if outside is None else _OUTSIDE(self._guarded(outside))
        tables = systems.starts, systems.columns, systems.entries, systems.motion, systems.constraints, systems.rates
        self._tables = [np.ascontiguousarray(x, dtype=np.int64) for x in (systems.solution, *tables)]
        self._parts = [x.structure for x in (systems.values, systems.drift, systems.factor, systems.solve)]
        self.structure = c.CoupledStruct(
            *(terms, nodes, systems.width, systems.coordinates, size, len(systems.rates)),
            *map(address, (self.psi, self.adjoint, self.work)),
            *(systems.rows, systems.width),
            *self._parts,
            *(ctypes.cast(self._outside, ctypes.c_void_p), systems.right, systems.guess),
            *map(address, self._tables),
            *(1e-12, 1e-10, worth, gesv, address(self.counts), address(self.correction), 0, 0, 0),
        )
        self.memory = aligned(load_driver().coupled_memory(self._address))
        self.structure.memory = address(self.memory)
        self._state = aligned(systems.width * self.blocks + 2)
        self._nodes, self._lanes = nodes, lanes
        self._times, self._paces = aligned(groups), aligned(groups)

    def _guarded(self, outside: Callable[[Array, bool], None]) -> Callable[[int], None]:
        """Return a function that stores an exception for `_raise_stored`, because the driver cannot propagate it."""

        def call(what: int) -> None:
            try:
                if self._raised is None:
                    outside(self.work, what == 0)
            except BaseException as error:  # noqa: BLE001 - an interruption, too, is raised after the driver
                self._raised = error
            if self._raised is not None:
                self.work[:, self.systems.solution] = np.nan

        return call

    def _raise_stored(self) -> None:
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised

    @property
    def _address(self) -> int:
        return ctypes.addressof(self.structure)

    def tolerances(self, accelerations: float, excess: float) -> None:
        """Set the relative tolerances of the last change of accelerations and of the constraint residuals."""
        self.structure.tolerance, self.structure.tolerance_drift = accelerations, excess

    def rate(self, time: float, state: Array) -> tuple[Array, Array]:
        """Return accelerations and multipliers (P, size) and rates of auxiliary states at a state (P, width).

        The time is in s. All values are coefficients of the basis; they are NaN if the iteration does not converge. The
        second array has columns for the auxiliary states with a rate.
        """
        self._take(time, state)
        found = aligned((self.systems.size + len(self.systems.rates)) * self.blocks)
        load_driver().coupled_rate(self._address, address(self._state), address(found))
        self._raise_stored()
        rows = self._coefficients(found)
        rates = rows[:, self.systems.size :]
        if self.structure.paces and rates.shape[1]:
            # the driver collects rates with respect to time
            nodal = self.work[:, self.systems.rates].transpose(0, 2, 1).reshape(-1, rates.shape[1])[: self._nodes]
            paces = self._paces.ravel()[: self._nodes, None]
            rates = self.adjoint.reshape(self._nodes, -1)[:, : self.terms].T @ (paces * nodal)
        return rows[:, : self.systems.size], rates

    def excess(self, time: float, state: Array) -> tuple[Array, Array]:
        """Return residuals of the projected constraints at coefficients (P, width): q and v, each (P, coordinate)."""
        self._take(time, state)
        n = self.systems.coordinates
        found = aligned(2 * n * self.blocks)
        load_driver().coupled_place(self._address, address(self._state))
        load_driver().coupled_excess(self._address, address(self._state), address(found))
        self._raise_stored()
        rows = self._coefficients(found)
        return rows[:, :n], rows[:, n:]

    @contextmanager
    def in_phase(self, times: Array, paces: Array) -> Iterator[None]:
        """Use a phase as the independent variable in a context: `times` (K,) in s, `paces` (K,) in s/rad.

        Each node has a separate time, and a separate derivative of time by phase. `rate` then returns derivatives by
        phase, and ignores its argument `time`.
        """
        self._times.ravel()[:], self._paces.ravel()[:] = times[self._lanes], paces[self._lanes]
        self.structure.times, self.structure.paces = address(self._times), address(self._paces)
        try:
            yield
        finally:
            self.structure.times = self.structure.paces = 0

    def dynamics(self, velocities: int, rated: Index, moving: int, *, constrained: bool) -> Dynamics:
        """Return the equations of motion of all coefficients, as one problem.

        In a state, velocities begin at entry `velocities`, and `moving` entries change; `rated` are the auxiliary
        states with a rate.
        """
        systems, blocks = self.systems, self.blocks
        n, width = systems.coordinates, systems.width
        begin = width * blocks + 2  # after the time and zero
        end = begin + (systems.size + len(systems.rates)) * blocks

        def rows(first: int, count: int) -> Index:
            return np.arange(first, first + count * blocks).reshape(count, blocks)

        rate = np.full((width, blocks), width * blocks + 1)
        rate[:n] = rows(velocities * blocks, n)
        rate[n + rated] = rows(begin + systems.size * blocks, len(rated))
        rate[velocities:] = rows(begin, n)
        # velocity residuals are computed together with the coordinates, and residuals are not requested
        nothing, no_rows = ProgramPart((), 0), np.zeros(0, dtype=np.int64)
        excess = self._part("coupled_excess", end)
        constraints = Constraints(nothing, excess, nothing, nothing, no_rows, 0, rows(end, 2 * n).ravel())
        return Dynamics(
            coordinates=n * blocks,
            velocities=velocities * blocks,
            width=width * blocks,
            parameters=0,
            motion=self._part("coupled_rate", begin),
            rate=rate.ravel(),
            constraints=constraints if constrained else None,
            rows=end + 2 * n * blocks,
            moving=moving,
            terms=self.terms,
            blocks=blocks,
            cost=10 * len(self.work),
        )

    def _part(self, name: str, to: int) -> ProgramPart:
        method = ctypes.cast(getattr(load_driver(), name), ctypes.c_void_p).value or 0
        return ProgramPart((ProgramStep(None, 1, None, None, 0, to, method, self._address),), 0)

    def _take(self, time: float, state: Array) -> None:
        width = self.systems.width
        self._state[: width * self.blocks].reshape(width, -1)[:, : self.terms] = state.T
        self._state[width * self.blocks] = time

    def _coefficients(self, rows: Array) -> Array:
        return np.ascontiguousarray(rows.reshape(-1, self.blocks * LANES)[:, : self.terms].T)


def _gesv() -> int:
    """Return the address of LAPACK's dgesv in SciPy; 0 if its integers have another size."""
    from scipy.linalg import cython_lapack

    capsule: Any = cython_lapack.__pyx_capi__["dgesv"]
    name = ctypes.pythonapi.PyCapsule_GetName
    name.restype, name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    signature = name(capsule)
    return (pointer(capsule, signature) or 0) if signature.startswith(b"void (int *, int *, ") else 0
