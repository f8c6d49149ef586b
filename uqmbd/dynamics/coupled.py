"""The projected index-1 system: accelerations and multipliers of coefficients.

The system ``Psi^T W A_k Psi x = Psi^T W b_k`` couples all coefficients.  It is solved by iteration: the nodal solution,
projected, is nearly right, as it differs by what the truncation leaves out; the remaining defect is reduced with the
nodal preconditioner ``Psi^T W A_k^-1 Psi`` and, where that alone converges slowly, by GMRES.  Everything at the nodes
is compiled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.index1 import System
from uqmbd.dynamics.model import Model
from uqmbd.dynamics.straightline import defect_kernel, straight_line

__all__ = ["Coupled"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SIMPLE = 6
"""Plain iterations before GMRES takes over."""

MOST = 60
"""Most iterations of GMRES."""


class Coupled:
    """Solver of the projected index-1 system, with what its last solutions taught.

    Parameters
    ----------
    model : Model
        With a compiled index-1 system.
    psi : array, shape (K, P)
        Basis at the nodes.
    adjoint : array, shape (P, K)
        ``Psi^T W``.

    Attributes
    ----------
    iterations, systems : int
        So far.
    """

    def __init__(self, model: Model, psi: Array, adjoint: Array) -> None:
        self.model, self.psi, self.adjoint = model, psi, adjoint
        self.exact = psi.shape[0] == psi.shape[1]
        system: System = model.system
        assert system.elimination is not None and system.solve is not None
        given, size = system.solve.given, system.size
        self.size, self.given, self.n = size, given, model.layout.coordinates
        self.nodal = system.solve
        rights = given + np.arange(size)[None, :]
        anywhere = straight_line(
            system.elimination, system.rows, system.columns, system.source, rights, given + size, size
        )
        assert anywhere is not None
        self.anywhere = anywhere
        self.product = defect_kernel(system.rows, system.columns, system.source, np.full(size, -1), given)
        self.defect = defect_kernel(system.rows, system.columns, system.source, system.motion, given)
        self.correction = np.zeros((psi.shape[1], size))
        self.iterations = self.systems = 0
        count = len(psi)
        self._both = np.empty((count, given + size))

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
        first = self.adjoint @ self.nodal(values)
        if self.exact:
            return np.asarray(first)
        both = self._both
        both[:, : self.given] = values
        found = first + self.correction
        scale = float(np.abs(found[:, : self.n]).max()) + 1e-300
        before = np.inf
        for k in range(SIMPLE):
            both[:, self.given :] = self.psi @ found
            change = self._precondition(self.defect.fast(both))
            found += change
            self.iterations += 1
            size = float(np.abs(change[:, : self.n]).max()) / scale
            # the change after this one would be smaller by the same factor
            if size <= tolerance or (k and size * (size / before) <= 0.3 * tolerance):
                break
            if not np.isfinite(size):
                return np.full_like(found, np.nan)
            if k and size > 0.5 * before:
                found = self._gmres(found, self._right(values), tolerance * scale)
                break
            before = size
        else:
            found = self._gmres(found, self._right(values), tolerance * scale)
        self.correction = found - first
        return found

    def _right(self, values: Array) -> Array:
        both = self._both
        both[:, : self.given] = values
        both[:, self.given :] = 0.0
        return np.asarray(self.adjoint @ self.defect.fast(both))

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
        system: System = self.model.system
        assert system.project is not None
        nodal = system.project(np.concatenate([values, drift], axis=1))
        n = self.n
        if self.exact:
            found = self.adjoint @ nodal
            return found[:, :n], found[:, n:]
        self._both[:, : self.given] = values
        results = []
        for letter in ("phi", "psi"):
            right = np.zeros((len(self.psi), self.size))
            found_in = self.model.evaluators["drift"].index.get(letter)
            if found_in is not None:
                columns, (rows,) = found_in
                number = np.full(self.model.layout.constraints, -1)
                number[self.model.layout.kept] = np.arange(len(self.model.layout.kept))
                kept = number[rows] >= 0
                right[:, n + number[rows[kept]]] = drift[:, columns[kept]]
            projected = self.adjoint @ right
            scale = float(np.abs(projected).max(initial=0.0))
            results.append(self._iterate(projected, tolerance)[:, :n] if scale > 0 else np.zeros((len(projected), n)))
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
        both = self._both
        both[:, self.given :] = defect if projected else self.psi @ (self.adjoint @ defect)
        found: Array = self.adjoint @ self.anywhere(both)
        return found

    def _apply(self, x: Array) -> Array:
        """``Psi^T W A_k Psi x``, shape (P, size)."""
        both = self._both
        both[:, self.given :] = self.psi @ x
        found: Array = -(self.adjoint @ self.product.fast(both))
        return found

    def _gmres(self, found: Array, right: Array, tolerance: float) -> Array:
        """Reduce what is left by GMRES with the nodal preconditioner, until the change is below `tolerance`."""
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
