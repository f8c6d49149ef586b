"""Projected ensemble: realisations at the nodes of a quadrature, coupled through a basis (Galerkin).

Coordinates, velocities and multipliers are expanded in polynomials that are orthonormal for the distribution of the
inputs, ``y(xi) = sum_j Y_j psi_j(xi)``.  With nodes ``xi_k``, weights ``w_k`` and ``Psi_kj = psi_j(xi_k)``, the
coefficients satisfy the projected equations of the ensemble::

    R(Y, Y', t) = Psi^T W r(Psi Y, Psi Y', t; xi)

These are the Euler-Lagrange equations of the averaged Lagrangian with averaged virtual work (Variational Work).
The projected index-1 system determines the coefficients of accelerations and multipliers.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.arguments import shown, typechecked
from uqmbd.compiled import CoupledSystems, Dynamics
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.integration import instant, speed_jumps
from uqmbd.dynamics.linear import nodal_systems
from uqmbd.dynamics.projection.singular_values import smallest_singular_values
from uqmbd.errors import AssemblyError, StudyError
from uqmbd.typing import Array

__all__ = ["ProjectedSystem", "ProjectedStart", "ProjectedEquations"]

DRIFT = 1e-3
"""Relative accuracy of the computed constraint violation after a step."""


class ProjectedSystem:
    """Projected system of a model, with a correction from its last solutions.

    The basis `psi` at the nodes is (K, P), `adjoint` is ``Psi^T W`` (P, K), and `block` contains the parameters of the
    nodes (K, parameter).  `systems` contains the work arrays and counters of the driver.
    """

    def __init__(self, model: Model, psi: Array, adjoint: Array, block: Array) -> None:
        self.layout, self.nodal = model.layout, nodal_systems(model)
        library = self.nodal.library
        outside = None if library is None else library()
        self.systems = CoupledSystems(self.nodal.systems, psi, adjoint, block, outside)

    @property
    def compiled(self) -> bool:
        """Whether the system can be solved at low cost in every stage of an explicit step."""
        return self.nodal.compiled

    @property
    def counters(self) -> dict[str, int]:
        """Numbers of systems, iterations, assemblies of the system, and GMRES solutions so far."""
        systems, iterations, direct, krylov = self.systems.counts[:4].tolist()
        return {"systems": systems, "iterations": iterations, "direct": direct, "krylov": krylov}

    def dynamics(self, tolerance: float) -> Dynamics:
        """Return the equations of motion for the explicit integrator.

        Iterations for the accelerations end at a relative change of `tolerance`.
        """
        layout = self.layout
        self.systems.tolerances(tolerance, DRIFT)
        moving = layout.width - 2 * len(layout.frozen) - layout.held
        return self.systems.dynamics(layout.velocities, self.nodal.rated, moving, constrained=bool(layout.rank))

    def solve(self, state: Array, time: float, tolerance: float) -> tuple[Array, Array]:
        """Return accelerations and multipliers (P, size), and rates of the auxiliary states (P, state), at a time in s.

        The state (P, width) contains coefficients.  Iterations for the accelerations end at a relative change of
        `tolerance`; the results are NaN if the iterations do not converge.
        """
        self.systems.tolerances(tolerance, tolerance)
        found, rated = self.systems.rate(time, state)
        rates = np.zeros((len(state), self.layout.states))
        rates[:, self.nodal.rated] = rated
        return found, rates

    def excess(self, state: Array, time: float, tolerance: float) -> tuple[Array, Array]:
        """Return corrections of positions and velocities (P, coordinate) for the projected constraint violation."""
        self.systems.tolerances(tolerance, tolerance)
        return self.systems.excess(time, state)


ORTHONORMAL = 1e-9
"""Largest error of the basis' scalar products by the quadrature rule that counts as rounding."""

CLOSED = 1e-8
"""Allowed residual of a projected constraint at the start, relative to the size of the coordinates."""

CORRECTIONS = 12
"""Largest number of Newton steps for the projection of initial coefficients onto the constraints."""

JACOBIAN_NUMBERS = 2_000_000
"""Largest number of entries of nodal Jacobians (8 bytes each) in one computation of singular values."""


@dataclass(frozen=True)
class ProjectedStart:
    """Consistent initial coefficients."""

    state: Array  # (P, 2 coordinate + state): coordinates, auxiliary states and velocities
    accelerations: Array  # (P, coordinate)
    multipliers: Array  # (P, kept): multipliers of the kept equations
    corrections: int  # number of Newton steps for the projected constraints


class ProjectedEquations:
    """Equations of a `ProjectedEnsemble`, for all integrators.

    Raises
    ------
    uqmbd.StudyError
        If the shape of the basis or of the weights does not fit the nodes.
    """

    @typechecked
    def __init__(self, ensemble: Ensemble, psi: Array, weights: Array) -> None:
        self.ensemble, self.model = ensemble, ensemble.model
        self.psi = np.ascontiguousarray(psi, dtype=float)
        self.weights = np.asarray(weights, dtype=float)
        if self.psi.ndim != 2 or len(self.psi) != len(ensemble) or self.weights.shape != (len(ensemble),):
            raise StudyError(
                f"ProjectedEnsemble: psi is {shown(psi)} and weights is {shown(weights)}; expected values of the basis "
                f"(K, P) and weights (K,) at the {len(ensemble)} nodes of the ensemble."
            )
        self.adjoint = np.ascontiguousarray((self.psi * self.weights[:, None]).T)
        """Map ``Psi^T W``, shape (P, K), from values at the nodes to coefficients.  If the basis is not orthonormal
        for the rule (samples), the map is the least squares of the rule, ``(Psi^T W Psi)^-1 Psi^T W``."""
        gram = self.adjoint @ self.psi
        if np.abs(gram - np.eye(len(gram))).max() > ORTHONORMAL:
            self.adjoint = np.ascontiguousarray(np.linalg.solve(gram, self.adjoint))
        wrong = [k for k, ok in enumerate(ensemble.start.ok) if not ok]
        if wrong:
            values = ", ".join(
                f"{name} = {x:.6g}" for name, x in zip(self.model.inputs, ensemble.values[wrong[0]], strict=True)
            )
            raise AssemblyError(
                f"{len(wrong)} of {len(ensemble)} nodes cannot be assembled, the first at {values}: "
                f"{ensemble.start.messages[wrong[0]]}"
            )

    @property
    def terms(self) -> int:
        """Number of polynomials, P."""
        return int(self.psi.shape[1])

    @property
    def unknowns(self) -> int:
        """Number of unknown coefficients of the stabilised index-2 form."""
        return self.terms * self.model.layout.unknowns

    @property
    def collocates(self) -> bool:
        """Whether the numbers of terms and nodes are equal, so that the projection has no truncation error."""
        return bool(self.psi.shape[0] == self.psi.shape[1])

    def residual(self, time: float, coefficients: Array, rates: Array) -> Array:
        """Return the projected residual ``Psi^T W r(Psi Y, Psi Y')``, shape (P, n)."""
        found = self.ensemble.residual(time, self.psi @ coefficients, self.psi @ rates)
        result: Array = self.adjoint @ found
        return result

    def nodal_jacobian(self, time: float, coefficients: Array, rates: Array, c: float) -> Array:
        """Return Jacobian values at the nodes on the model's pattern, shape (K, nnz)."""
        return self.ensemble.jacobian(time, self.psi @ coefficients, self.psi @ rates, c)

    @cached_property
    def products(self) -> Array:
        """Weighted products ``w_k psi_i(xi_k) psi_j(xi_k)``, shape (P P, K)."""
        count = len(self.weights)
        found: Array = np.einsum("ik,kj->ijk", self.adjoint, self.psi).reshape(-1, count)
        return np.ascontiguousarray(found)

    def jacobian_blocks(self, time: float, coefficients: Array, rates: Array, c: float) -> Array:
        """Return values of all blocks ``J_ij = sum_k w_k psi_i psi_j J_k``, shape (P, P, nnz)."""
        found = self.products @ self.nodal_jacobian(time, coefficients, rates, c)
        return found.reshape(self.terms, self.terms, -1)

    def jacobian(self, time: float, coefficients: Array, rates: Array, c: float) -> Array:
        """Return the dense Jacobian ``dR/dY + c dR/dY'`` of the flattened coefficients, shape (P n, P n)."""
        rows, pointers = self.model.pattern
        n = self.model.layout.unknowns
        columns = np.repeat(np.arange(n), np.diff(pointers))
        dense = np.zeros((self.terms, n, self.terms, n))
        blocks = self.jacobian_blocks(time, coefficients, rates, c)
        dense[:, rows, :, columns] = blocks.transpose(2, 0, 1)
        return dense.reshape(self.unknowns, self.unknowns)

    def split(self, state: Array) -> tuple[Array, Array, Array]:
        """Return coordinates, auxiliary states and velocities of states (..., width)."""
        return self.model.layout.split(state)

    @cached_property
    def coupled(self) -> ProjectedSystem:
        """Projected index-1 system."""
        return ProjectedSystem(self.model, self.psi, self.adjoint, self.ensemble.block)

    @cached_property
    def start(self) -> ProjectedStart:
        """Consistent initial coefficients: projected states of assembled nodes that satisfy projected constraints."""
        nodal, time = self.ensemble.start, self.model.time
        state = self.adjoint @ nodal.state
        n, velocities = self.model.layout.coordinates, self.model.layout.velocities
        size = max(1e-3, float(np.abs(nodal.q).max(initial=0.0)))
        corrections, left = 0, np.inf
        # iterate the coordinates to convergence, then correct the velocities, whose equations are linear
        for corrections in range(CORRECTIONS + 1):
            q, _ = self._excess(state, time)
            before, left = left, float(np.abs(q).max(initial=0.0))
            # iterations do not reduce rounding errors
            done = left <= 1e-14 * size or (left <= 1e-11 * size and left > 0.1 * before)
            if done or corrections == CORRECTIONS or not np.isfinite(left):
                break
            state[:, :n] -= q
        for _ in range(2):
            state[:, velocities:] -= self._excess(state, time)[1]
        found, _ = self.coupled.solve(state, time, tolerance=1e-12)
        if not (left <= CLOSED * size and np.isfinite(found).all() and np.isfinite(state).all()):
            raise AssemblyError(
                f"mechanism {self.model.name!r}: the projected equations have no consistent start, although every "
                "node has one. They are singular, or the truncated expansion is too coarse. Raise the order, or use "
                "a method that integrates each realisation separately."
            )
        return ProjectedStart(state, found[:, :n], found[:, n:], corrections)

    def accelerations(self, state: Array, time: float) -> tuple[Array, Array, Array]:
        """Return coefficients of accelerations, multipliers of independent equations and rates of auxiliary states."""
        found, rates = self.coupled.solve(state, time, tolerance=1e-10)
        n = self.model.layout.coordinates
        return found[:, :n], found[:, n:], rates

    def impulse(self, state: Array, time: float, rtol: float) -> Array:
        """Return the change of velocity coefficients (P, coordinate) by jumps of prescribed speeds at nodes.

        Parameters
        ----------
        state : array, shape (P, width)
            Coefficients immediately before `time`.
        time : float
            Time of the possible jump, s.
        rtol : float
            Relative tolerance of the integration.
        """
        nodal = self.psi @ state
        jump = speed_jumps(self.model, nodal, time, self.ensemble.block, rtol)[0]
        if not np.any(jump):
            return np.zeros((self.terms, self.model.layout.coordinates))
        return self.follow(state, time + instant(time))

    def follow(self, state: Array, time: float) -> Array:
        """Return the change of velocity coefficients (P, coordinate) that satisfies the constraints at a time."""
        return -self._excess(state, time)[1]

    def continued(self, ensemble: Ensemble, start: ProjectedStart) -> ProjectedEquations:
        """Return the same projection of an ensemble at a later time, with given initial coefficients."""
        other = copy(self)
        other.__dict__.update(ensemble=ensemble, model=ensemble.model, start=start, coupled=self.coupled)
        return other

    def _excess(self, state: Array, time: float) -> tuple[Array, Array]:
        return self.coupled.excess(state, time, tolerance=1e-10)

    def constraints(self, times: Array, nodal: Array) -> Array:
        """Return the root of the summed expectations of squared constraints (T,), for nodal states (K, T, width).

        Times are equal for all nodes, (T,), or given for each node, (K, T).
        """
        count, number, _ = nodal.shape
        arguments = state_arguments(np.resize(times, count * number), nodal.reshape(count * number, -1))
        evaluator = self.model.evaluators["drift"]
        found = evaluator(arguments, np.repeat(self.ensemble.block, number, axis=0)).reshape(count, number, -1)
        entry = evaluator.index.get("phi")
        phi = found[:, :, entry[0]] if entry is not None else found[:, :, :0]
        squares: Array = np.sqrt(np.einsum("k,ktm->t", self.weights, phi**2))
        return squares

    def smallest_singular_values(self, time: float | Array, state: Array) -> tuple[Array, Array]:
        """Return the smallest singular values of the projected constraint Jacobian and of all nodal Jacobians.

        Rows of a Jacobian are the kept equations.  Both values are infinite without constraints.  The accuracy of the
        projected value is 0.5 %, or rounding if the iteration is unreliable.  The nodal value is the exact value of one
        node; the values of other nodes are less by at most 0.1 %.

        Parameters
        ----------
        time : float, or array of shape (T,)
            Time or times, s.
        state : array, shape (P, width) or (P, T, width)
            Coefficients.

        Returns
        -------
        tuple of array, shape () or (T,)
        """
        times = np.atleast_1d(np.asarray(time, dtype=float))
        states = np.moveaxis(self.nodal(state.reshape(self.terms, len(times), -1)), 0, 1)
        kept, columns = self.model.layout.kept, self.model.layout.coordinates
        found = np.full((2, len(times)), np.inf)
        if len(kept):
            count = len(self.weights)
            size = max(1, JACOBIAN_NUMBERS // (count * len(kept) * columns))
            for begin in range(0, len(times), size):
                part = slice(begin, begin + size)
                some = states[part].reshape(-1, states.shape[2])
                arguments = state_arguments(np.repeat(times[part], count), some)
                block = np.tile(self.ensemble.block, (len(times[part]), 1))
                d = self.model.evaluate("acceleration", arguments, block)["d"][:, kept]
                jacobians = d.reshape(-1, count, len(kept), columns)
                found[:, part] = smallest_singular_values(jacobians, self.psi, self.adjoint, self.weights)
        projected, nodal = found.reshape(2, *np.shape(time))
        return projected, nodal

    def nodal(self, coefficients: Array) -> Array:
        """Return values at the nodes (K, ...) of coefficients (P, ...)."""
        found = self.psi @ coefficients.reshape(self.terms, -1)
        return found.reshape(len(self.weights), *coefficients.shape[1:])

    def project(self, values: Array) -> Array:
        """Return coefficients (P, ...) of values at the nodes (K, ...)."""
        found = self.adjoint @ values.reshape(len(self.weights), -1)
        return found.reshape(self.terms, *values.shape[1:])
