"""Implicit integration of the projected stabilised index-2 form by IDA, with a linear solver for its size."""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from uqmbd.dynamics.integration import (
    RELAXED,
    diagnosis,
    import_sundials,
    instant,
    pace,
    solve,
    step_limits,
    step_tolerance,
    times_between,
)
from uqmbd.dynamics.projection.ensemble import ProjectedEquations
from uqmbd.dynamics.projection.trajectories import Watch
from uqmbd.typing import Array

__all__ = ["LINEAR_SOLVERS", "LinearSolver", "ImplicitResult", "implicit"]


LinearSolver = Literal["auto", "dense", "sparse", "krylov-nodal", "krylov-mean"]
LINEAR_SOLVERS: tuple[LinearSolver, ...] = ("auto", "dense", "sparse", "krylov-nodal", "krylov-mean")

DENSE_TO = 150
"""Largest number of unknowns for which a dense factorisation is fastest."""
SPARSE_TO = 400
"""Largest number of unknowns for which a sparse factorisation is faster than a Krylov solver."""


@dataclass
class ImplicitResult:
    """Result of an implicit integration."""

    coefficients: Array  # (P, T, 2 coordinate + state): NaN after an early end
    message: str = ""  # reason of an early end, or empty
    # residuals, Jacobians or their products, factorisations, preconditioner solutions
    counters: dict[str, float] = field(default_factory=dict)


class CoefficientJacobian:
    """Jacobian of the coefficients in the form required by IDA."""

    def __init__(self, projected: ProjectedEquations, kind: LinearSolver, counters: dict[str, float]) -> None:
        self.projected, self.counters = projected, counters
        layout = projected.model.layout
        self.n, self.terms = layout.unknowns, projected.terms
        rows, pointers = projected.model.pattern
        self.rows, self.columns = rows, np.repeat(np.arange(self.n), np.diff(pointers))
        if kind == "auto":
            unknowns = projected.unknowns
            kind = "dense" if unknowns <= DENSE_TO else "sparse"
        self.kind = kind
        if kind == "sparse":
            # order of a matrix compressed by columns: columns (j, column), in each column the rows (i, row)
            order = np.lexsort(
                (
                    *(x.ravel() for x in np.meshgrid(np.arange(self.terms), self.rows, indexing="ij")[::-1]),
                    np.tile(self.columns, self.terms),
                )
            )
            self.order = order
        self.by_row = np.argsort(self.rows, kind="stable")
        self.row_starts = np.searchsorted(self.rows[self.by_row], np.arange(self.n))
        self.values = np.zeros((0, 0))
        self.inverse = np.zeros((0, 0, 0))

    def options(self) -> dict[str, Any]:
        """Return the options of IDA for the linear solver."""
        if self.kind == "dense":
            return {"linsolver": "dense", "jacfn": self._dense}
        if self.kind == "sparse":
            from scipy import sparse

            one = np.zeros((self.n, self.n))
            one[self.rows, self.columns] = 1.0
            pattern = sparse.csc_matrix(np.kron(np.ones((self.terms, self.terms)), one))
            return {"linsolver": "sparse", "jacfn": self._sparse, "sparsity": pattern}
        ida = import_sundials()
        return {
            "linsolver": "gmres",
            "krylov_dim": 12,
            "precond": ida.IDAPrecond(self._factorise, self._precondition),
            "jactimes": ida.IDAJacTimes(self._prepare, self._product),
        }

    def _count(self, name: str) -> None:
        self.counters[name] = self.counters.get(name, 0) + 1

    def _shaped(self, y: Array) -> Array:
        return y.reshape(self.terms, self.n)

    def _dense(self, t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
        self._count("factorisations")
        jac[:] = self.projected.jacobian(t, self._shaped(y), self._shaped(yp), c)

    def _sparse(self, t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
        self._count("factorisations")
        blocks = self.projected.jacobian_blocks(t, self._shaped(y), self._shaped(yp), c)
        # from (i, j, entry) to the order by columns
        jac[:] = blocks.transpose(1, 0, 2).reshape(self.terms, -1)[:, self.order].ravel()

    def _evaluate(self, t: float, y: Array, yp: Array, c: float) -> Array:
        return self.projected.nodal_jacobian(t, self._shaped(y), self._shaped(yp), c)

    def _prepare(self, t: float, y: Array, yp: Array, res: Array, c: float) -> None:
        self._count("jacobians")
        self.values = self._evaluate(t, y, yp, c)

    def _product(self, t: float, y: Array, yp: Array, res: Array, v: Array, product: Array, c: float) -> None:
        self._count("jacobian_products")
        nodal = self.projected.psi @ self._shaped(v)
        parts = (self.values * nodal[:, self.columns])[:, self.by_row]
        product[:] = (self.projected.adjoint @ np.add.reduceat(parts, self.row_starts, axis=1)).ravel()

    def _factorise(self, t: float, y: Array, yp: Array, res: Array, c: float) -> None:
        self._count("factorisations")
        values = self._evaluate(t, y, yp, c)
        if self.kind == "krylov-mean":
            values = (self.projected.weights @ values)[None]
        matrix = np.zeros((len(values), self.n, self.n))
        matrix[:, self.rows, self.columns] = values
        # scale rows of light bodies, so that pivots of the factorisation compare similar numbers
        scale = np.abs(matrix).max(axis=2, keepdims=True)
        scale = np.where(scale > 0, scale, 1.0)
        try:
            self.inverse = np.linalg.inv(matrix / scale) / scale.transpose(0, 2, 1)
        except np.linalg.LinAlgError:
            self.inverse = np.linalg.pinv(matrix / scale) / scale.transpose(0, 2, 1)

    def _precondition(
        self, t: float, y: Array, yp: Array, res: Array, r: Array, z: Array, c: float, delta: float
    ) -> None:
        self._count("preconditioner_solutions")
        right = self._shaped(r)
        if self.kind == "krylov-mean":
            z[:] = (right @ self.inverse[0].T).ravel()
            return
        nodal = np.matmul(self.inverse, (self.projected.psi @ right)[:, :, None])[:, :, 0]
        z[:] = (self.projected.adjoint @ nodal).ravel()


def implicit(
    projected: ProjectedEquations,
    times: Array,
    rtol: float,
    linear_solver: LinearSolver = "auto",
    watch: Watch | None = None,
) -> ImplicitResult:
    """Integrate the coefficients by IDA at output times (T,), s.

    The linear solver is dense, sparse, or Krylov.  The Krylov preconditioner consists of the exact Jacobians of all
    nodes, or of their mean.  IDA pauses about ten times to call `watch` with the coefficients so far; a true return
    value ends the integration.
    """
    if linear_solver == "auto" and projected.unknowns > SPARSE_TO:
        # the mean preconditioner costs less if it converges; the nodal preconditioner is robust
        found = implicit(projected, times, rtol, "krylov-mean", watch)
        if not found.message:
            return found
        again = implicit(projected, times, rtol, "krylov-nodal", watch)
        return ImplicitResult(
            again.coefficients, again.message, _sum(found.counters, again.counters) | {"left_the_mean": 1}
        )
    ensemble, layout, terms = projected.ensemble, projected.model.layout, projected.terms
    start = projected.start
    path = np.full((terms, len(times), layout.width), np.nan)
    path[:, 0] = start.state
    counters: dict[str, float] = {"residuals": 0, "integrations": 0, "seconds": 0.0}
    linear = CoefficientJacobian(projected, linear_solver, counters)
    counters["unknowns"] = projected.unknowns
    frozen = projected.adjoint @ ensemble.frozen

    def residual(t: float, y: Array, yp: Array, res: Array) -> None:
        counters["residuals"] += 1
        res[:] = projected.residual(t, y.reshape(terms, -1), yp.reshape(terms, -1)).ravel()

    length = max(1e-3, float(np.abs(ensemble.start.q).max(initial=0.0)))
    tolerance = step_tolerance(rtol, projected.unknowns)
    atol = np.full(layout.unknowns, tolerance * min(1.0, length))
    atol[layout.differential :] = RELAXED
    state, now, message = start.state, float(times[0]), ""
    intervals = pace(ensemble, times, rtol)
    pauses = {interval.end for interval in intervals}
    starts = {float(times[0]), *pauses}
    if watch is not None:
        pauses |= set(times[:: max(1, len(times) // 10)][1:].tolist())
    for stop in [*sorted(pauses - {float(times[-1])}), float(times[-1])]:
        if ensemble.breaks.size and now in starts:
            state = state.copy()
            state[:, layout.velocities :] += projected.impulse(state, now, rtol)
            path[:, np.flatnonzero(times[1:] == now) + 1] = state[:, None]
        q, s, v = projected.split(state)
        # use a slightly later time, as a force may jump at the start
        accelerations, multipliers, rates = projected.accelerations(state, now + instant(now))
        y = ensemble.pack(q, s, v, multipliers)
        yp = ensemble.pack(v, rates, accelerations, np.zeros_like(multipliers))
        longest = next(interval.longest for interval in intervals if interval.end >= stop)
        inside, grid = times_between(times, now, stop)
        begin = clock.perf_counter()
        limits = {"rtol": tolerance, "atol": np.tile(atol, terms), **step_limits(grid, longest)}
        solution = solve(residual, linear.options(), grid, y.ravel(), yp.ravel(), **limits)
        counters["seconds"] += clock.perf_counter() - begin
        counters["integrations"] += 1
        y_path = solution.y.reshape(len(solution.t), terms, -1)
        reached = len(y_path) if solution.success else len(y_path) - 1
        where = np.searchsorted(grid, times[inside])
        done = where < reached
        path[:, inside[done]] = _expanded(projected, y_path[where[done]].transpose(1, 0, 2), frozen)
        if not solution.success or reached < len(grid):
            message = diagnosis(solution, float(solution.t[-1]) if len(solution.t) else now, rtol)
            break
        if watch is not None and watch(path):
            break
        state = _expanded(projected, y_path[-1][:, None], frozen)[:, 0]
        now = stop
    return ImplicitResult(path, message, counters)


def _sum(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
    return {name: a.get(name, 0) + b.get(name, 0) for name in a | b if name != "unknowns"} | {"unknowns": b["unknowns"]}


def _expanded(projected: ProjectedEquations, y: Array, frozen: Array) -> Array:
    """Return full states (P, T, width) from unknowns (P, T, n) and coefficients (P, frozen) of frozen coordinates."""
    layout = projected.model.layout
    where = layout.slices
    result = np.zeros((*y.shape[:2], layout.width))
    n, velocities = layout.coordinates, layout.velocities
    result[..., layout.free] = y[..., where["q"]]
    result[..., layout.frozen] = frozen[:, None]
    result[..., n:velocities] = y[..., where["s"]]
    result[..., velocities + layout.free] = y[..., where["v"]]
    return result
