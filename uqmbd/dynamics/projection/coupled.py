"""The projected index-1 system: accelerations and multipliers of coefficients.

The system ``Psi^T W A_k Psi x = Psi^T W b_k`` couples all coefficients.  It is solved by iteration: the nodal solution,
projected, is nearly right, as it differs by what the truncation leaves out; the remaining defect is reduced with the
nodal preconditioner ``Psi^T W A_k^-1 Psi`` and, where that alone converges slowly, by GMRES [1]_.  Where that takes
more iterations than a factorisation of the assembled system is worth, the latter is used for a while.

References
----------
.. [1] Y. Saad, M. H. Schultz, GMRES: a generalized minimal residual algorithm for solving nonsymmetric linear systems,
   SIAM J. Sci. Stat. Comput. 7 (1986) 856-869.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear import System, nodal_systems
from uqmbd.typing import Array

__all__ = ["Coupled"]


SIMPLE = 6
"""Plain iterations before GMRES takes over."""

MOST = 60
"""Most iterations of GMRES."""

DIRECT = 400
"""Unknowns up to which the assembled system may be factorised."""

AGAIN = 50
"""Systems after which iterations are tried again."""

ROUNDING = 1e-13
"""Change of the accelerations, over what the forces alone would cause, that is rounding."""


class Coupled:
    """Solver of the projected index-1 system, with what its last solutions taught.

    Parameters
    ----------
    model : Model
        With its index-1 system.
    psi : array, shape (K, P)
        Basis at the nodes.
    adjoint : array, shape (P, K)
        ``Psi^T W``.

    Attributes
    ----------
    iterations, systems : int
        So far.
    direct, krylov : int
        How often the system was assembled, or GMRES was needed.
    """

    def __init__(self, model: Model, psi: Array, adjoint: Array) -> None:
        self.model, self.psi, self.adjoint = model, psi, adjoint
        self.exact = psi.shape[0] == psi.shape[1]
        self.nodes = nodal_systems(model, len(psi))
        self.n = model.layout.coordinates
        self.correction = np.zeros((psi.shape[1], model.system.size))
        self.iterations = self.systems = self.direct = self.krylov = 0
        self.small = self.correction.size <= DIRECT
        self.slow = 0
        # measured: a factorisation takes 0.1 ms, and 0.25 ms more at 100 unknowns, an iteration 0.06 ms
        self.worth = (0.1 + 0.25e-6 * self.correction.size**3) / 0.06
        self.products = np.einsum("ik,kj->ijk", adjoint, psi).reshape(-1, len(psi)) if self.small else adjoint
        index = model.evaluators["acceleration"].index
        self._forces, self._masses = index.get("force"), index.get("mass")

    @property
    def compiled(self) -> bool:
        """Whether a solution is cheap enough for every stage of an explicit step."""
        return self.nodes.compiled

    def solve(self, values: Array, tolerance: float) -> Array:
        """Accelerations and multipliers, shape (P, size).

        Parameters
        ----------
        values : array, shape (K, result)
            Results of the ``acceleration`` evaluator at the nodes.
        tolerance : float
            Relative size of the last change of the accelerations.

        Returns
        -------
        array, shape (P, size)
            NaN where the iteration does not converge.
        """
        self.systems += 1
        nodes = self.nodes
        nodes.place(values)
        if self.slow and not self.exact:
            self.slow -= 1
            return self._direct(values)
        first = self.adjoint @ nodes.motion()
        if self.exact:
            return np.asarray(first)
        found = first + self.correction
        guessed, before, iterations = bool(self.correction.any()), np.inf, 0
        while iterations < SIMPLE:
            change = self._precondition(nodes.defect(self.psi @ found))
            self.iterations += 1
            moved = float(np.abs(change[:, : self.n]).max())
            if guessed and not moved <= float(np.abs(first[:, : self.n]).max()):
                # the last correction, of a state that may have been far from this one, is worse than none
                found, guessed = first.copy(), False
                continue
            found += change
            if not np.isfinite(moved):
                return np.full_like(found, np.nan)
            # over the size of the solution itself, never over that of the guess
            scale = float(np.abs(found[:, : self.n]).max()) + 1e-300
            size, done, guessed = moved / scale, iterations, False
            iterations += 1
            # the change after this one would be smaller by the same factor
            if size <= tolerance or (done and size * (size / before) <= 0.3 * tolerance):
                break
            if done == 1:  # not done yet: is there more than rounding left?
                floor = ROUNDING * self._typical(values)
                if moved <= floor:
                    break
                scale = max(scale, floor / tolerance)
                size = moved / scale
            if done and size > 0.5 * before:
                found = self._slowly(found, values, tolerance * scale)
                break
            before = size
        else:
            found = self._slowly(found, values, tolerance * scale)
        if np.isfinite(found).all():
            self.correction = found - first
        return found

    def _slowly(self, found: Array, values: Array, tolerance: float) -> Array:
        """Solve where the plain iteration converges slowly, and note whether it is worth while."""
        before = self.iterations
        found = self._gmres(found, self._right(), tolerance)
        if self.small and (self.iterations - before > self.worth or not np.isfinite(found).all()):
            self.slow = AGAIN
            return found if np.isfinite(found).all() else self._direct(values)
        return found

    def _direct(self, values: Array) -> Array:
        """Assemble the system, and solve it by LAPACK; NaN where it is singular."""
        self.direct += 1
        system: System = self.model.system
        terms, size = self.correction.shape
        blocks = (self.products @ values[:, system.source]).reshape(terms, terms, -1)
        matrix = np.zeros((terms, size, terms, size))
        matrix[:, system.rows, :, system.columns] = blocks.transpose(2, 0, 1)
        whole, right = matrix.reshape(terms * size, -1), self._right().ravel()
        # rows of light bodies are scaled up: the pivots see comparable numbers
        scale = np.abs(whole).max(axis=1)
        scale = np.where(scale > 0, scale, 1.0)
        try:
            found = np.linalg.solve(whole / scale[:, None], right / scale)
        except np.linalg.LinAlgError:
            return np.full((terms, size), np.nan)
        return np.asarray(found.reshape(terms, size))

    def _typical(self, values: Array) -> float:
        """Acceleration that the forces alone would cause: a scale where they hold each other in balance."""
        if self._forces is None or self._masses is None:
            return 0.0
        columns, (rows,) = self._forces
        entries, (i, k) = self._masses
        force, mass = np.zeros(self.n), np.zeros(self.n)
        force[rows] = np.abs(values[:, columns]).max(axis=0)
        mass[i[i == k]] = np.abs(values[:, entries[i == k]]).max(axis=0)
        return float((force[mass > 0] / mass[mass > 0]).max(initial=0.0))

    def _right(self) -> Array:
        zeros = np.zeros((len(self.psi), self.model.system.size))
        return np.asarray(self.adjoint @ self.nodes.defect(zeros))

    def excess(self, values: Array, drift: Array, tolerance: float) -> tuple[Array, Array]:
        """By what coefficients of coordinates and velocities exceed the projected constraints.

        Parameters
        ----------
        values, drift : array, shape (K, result)
            Results of the evaluators at the nodes.
        tolerance : float
            Relative size of the last change.

        Returns
        -------
        q, v : array, shape (P, coordinate)
        """
        n = self.n
        self.nodes.place(values)
        if self.exact:
            found = self.adjoint @ self.nodes.excess(drift)
            return found[:, :n], found[:, n:]
        results = []
        for right in self.model.system.drift_sides(drift):
            projected = self.adjoint @ right
            some = bool(np.abs(projected).max(initial=0.0) > 0)
            results.append(self._iterate(projected, tolerance)[:, :n] if some else np.zeros((len(projected), n)))
        return results[0], results[1]

    def _iterate(self, right: Array, tolerance: float) -> Array:
        """Solve for any projected right-hand side, from zero."""
        found = self._precondition(self.psi @ right, projected=True)
        self.systems += 1
        scale = float(np.abs(found).max()) + 1e-300
        before = np.inf
        for _ in range(SIMPLE):
            change = self._precondition(self.psi @ (right - self._apply(found)), projected=True)
            found += change
            self.iterations += 1
            size = float(np.abs(change).max()) / scale
            if size <= tolerance:
                return found
            if size > 0.5 * before or not np.isfinite(size):
                break
            before = size
        return self._gmres(found, right, tolerance * scale)

    def _precondition(self, defect: Array, *, projected: bool = False) -> Array:
        """``Psi^T W A_k^-1 Psi Psi^T W`` of a defect at the nodes (K, size)."""
        found: Array = self.adjoint @ self.nodes.solve(defect if projected else self.psi @ (self.adjoint @ defect))
        return found

    def _apply(self, x: Array) -> Array:
        """``Psi^T W A_k Psi x``, shape (P, size)."""
        found: Array = -(self.adjoint @ self.nodes.apply(self.psi @ x))
        return found

    def _gmres(self, found: Array, right: Array, tolerance: float) -> Array:
        """Reduce what is left by GMRES with the nodal preconditioner, until the change is below `tolerance`."""
        self.krylov += 1
        shape = found.shape
        defect = self._precondition(self.psi @ (right - self._apply(found)), projected=True).ravel()
        beta = float(np.linalg.norm(defect))
        if not np.isfinite(beta):
            return np.full(shape, np.nan)
        if beta <= tolerance:
            return found
        basis = [defect / beta]
        triangle = np.zeros((MOST + 1, MOST))
        target = np.zeros(MOST + 1)
        target[0] = beta
        for k in range(MOST):
            self.iterations += 1
            image = self._precondition(self.psi @ self._apply(basis[k].reshape(shape)), projected=True).ravel()
            stacked = np.array(basis)
            for _ in range(2):  # orthogonalised twice: once loses digits
                part = stacked @ image
                image = image - part @ stacked
                triangle[: k + 1, k] += part
            triangle[k + 1, k] = norm = float(np.linalg.norm(image))
            y, *_ = np.linalg.lstsq(triangle[: k + 2, : k + 1], target[: k + 2], rcond=None)
            left = float(np.linalg.norm(triangle[: k + 2, : k + 1] @ y - target[: k + 2]))
            if left <= tolerance or norm <= 1e-14 * beta:
                found += (y @ np.array(basis)).reshape(shape)
                return found
            basis.append(image / norm)
        return np.full(shape, np.nan)
