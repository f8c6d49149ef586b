"""Equations of motion at rest, and their exact derivatives, for statics and linearisation.

The unknowns at rest, at one time, are the coordinates ``q``, the auxiliary states ``s`` and the multipliers ``lambda``
of the stabilised index-2 form. The equations at rest are::

    0 = -Q(q, s) + D(q, s)^T lambda        s' = g(q, s)        0 = Phi(q, s)

Coordinates fixed permanently by a constraint (``Layout.frozen``) are not unknowns in these equations either.

An auxiliary state changes with the pose by ``ds = T dq`` with ``T = dg/dv``, its rate per velocity.  A relaxing state,
whose rate depends on the state itself, has a separate equilibrium ``g(q, s) = 0`` instead, which determines ``T``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.linear import RANK_TOLERANCE
from uqmbd.typing import Array, Index

__all__ = ["Forces", "RestEquations", "apply", "solve_definite", "tangents"]


DEFINITE = 1e-12
"""Pivot, relative to its diagonal entry, up to which a system is solved with a search for pivots."""

FEW = 4
"""Largest number of unknowns for which systems are eliminated together, faster than LAPACK solves them one by one."""


def apply(matrices: Array, vectors: Array) -> Array:
    """Multiply matrices (K, m, n) with vectors (K, n)."""
    product: Array = (matrices @ vectors[:, :, None])[:, :, 0]
    return product


def solve_definite(matrices: Array, right: Array) -> Array:
    """Solve symmetric positive definite systems (K, n, n) for right-hand sides (K, n, columns), without pivots.

    Systems that are not definite are solved with pivots; a singular one raises LinAlgError.
    """
    n = matrices.shape[1]
    if n > FEW:
        return np.asarray(np.linalg.solve(matrices, right), dtype=float)
    a, x = (np.array(np.moveaxis(y, 0, -1), order="C") for y in (matrices, right))
    definite = np.ones(len(matrices), dtype=bool)
    with np.errstate(all="ignore"):
        for k in range(n):
            definite &= a[k, k] > DEFINITE * matrices[:, k, k]
            for i in range(k + 1, n):
                factor = a[i, k] / a[k, k]
                a[i, k + 1 :] -= factor * a[k, k + 1 :]
                x[i] -= factor * x[k]
        for k in reversed(range(n)):
            for i in range(k + 1, n):
                x[k] -= a[k, i] * x[i]
            x[k] /= a[k, k]
    solution = np.ascontiguousarray(np.moveaxis(x, -1, 0))
    others = np.flatnonzero(~definite)
    if len(others):
        solution[others] = np.linalg.solve(matrices[others], right[others])
    return solution


def tangents(gradient: Array) -> Array:
    """Return orthonormal bases (K, n, n - m) of the null spaces of full-rank constraint gradients (K, m, n)."""
    count, m, n = gradient.shape
    if not m:
        return np.tile(np.eye(n), (count, 1, 1))
    basis = np.linalg.qr(gradient.transpose(0, 2, 1), mode="complete")[0]
    return np.asarray(basis[:, :, m:], dtype=float)


@dataclass(frozen=True)
class Forces:
    """Forces, constraints and rates of auxiliary states in K states at rest."""

    force: Array  # (K, n): applied generalised forces Q on the unknown coordinates
    phi: Array  # (K, m): constraints
    rates: Array  # (K, k): rates of the auxiliary states
    gradient: Array  # (K, m, n): D
    carry: Array  # (K, k, n): T, derivative of the auxiliary states with respect to the coordinates
    settle: Array  # (K, k): change of the relaxing auxiliary states to their equilibrium

    def select(self, members: Index) -> Forces:
        """Return the forces of the selected states."""
        return Forces(**{name: value[members] for name, value in vars(self).items()})

    def multipliers(self) -> Array:
        """Return the multipliers that balance the forces in the least-squares sense, (K, m)."""
        return _normal(self.gradient, apply(self.gradient, self.force))

    def within(self, direction: Array) -> Array:
        """Project directions (K, n) onto the tangent space of the constraints."""
        back = _normal(self.gradient, apply(self.gradient, direction))
        return direction - apply(self.gradient.transpose(0, 2, 1), back)

    def closing(self) -> Array:
        """Return the smallest change of the coordinates that closes the constraints to first order, (K, n)."""
        return -apply(self.gradient.transpose(0, 2, 1), _normal(self.gradient, self.phi))


def _normal(gradient: Array, right: Array) -> Array:
    """Solve ``D D^T x = right``."""
    if not gradient.shape[1]:
        return np.zeros_like(right)
    gram = gradient @ gradient.transpose(0, 2, 1)
    try:
        x = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
        if np.isfinite(x).all():
            return np.asarray(x, dtype=float)
    except np.linalg.LinAlgError:
        pass
    # the tolerance is squared, because singular values of the Gram matrix are squares of singular values of D
    return apply(np.linalg.pinv(np.nan_to_num(gram), rcond=RANK_TOLERANCE**2, hermitian=True), right)


class RestEquations:
    """Equations of realisations at rest; the assembled start determines the frozen coordinates."""

    def __init__(self, ensemble: Batch) -> None:
        self.model, self.parameters = ensemble.model, ensemble.block
        layout = self.model.layout
        self.frozen, self.time = ensemble.frozen, self.model.time
        self.n, self.states, self.m = len(layout.free), layout.states, layout.multipliers
        rows, pointers = self.model.pattern
        columns = np.repeat(np.arange(layout.unknowns), np.diff(pointers))
        self._entries: dict[str, tuple[Index, Index, Index]] = {}
        for name in ("vq", "vs", "vv", "vl", "sq", "ss", "sv"):
            i, k = layout.slices[name[0]], layout.slices[name[1]]
            inside = (rows >= i.start) & (rows < i.stop) & (columns >= k.start) & (columns < k.stop)
            which = np.flatnonzero(inside)
            self._entries[name] = which, rows[which] - i.start, columns[which] - k.start
        self.relaxing = np.zeros((len(ensemble), self.states), dtype=bool)
        if self.states:
            every = np.arange(len(ensemble))
            own = self.derivatives(every, self.coordinates(ensemble.start.q), ensemble.start.s)["ss"]
            # no tolerance is needed: the derivative is exactly zero if the rate does not contain the state
            self.relaxing = np.diagonal(own, axis1=1, axis2=2) != 0

    @property
    def straight(self) -> bool:
        """Whether the coordinates are independent of each other, without constraints or auxiliary states."""
        return not self.m and not self.states

    def coordinates(self, q: Array) -> Array:
        """Select the unknown coordinates from all coordinates, shape (K, n)."""
        return q[:, self.model.layout.free]

    def whole(self, members: Index, q: Array) -> Array:
        """Return all coordinates, including the frozen coordinates."""
        layout = self.model.layout
        result = np.zeros((len(q), layout.coordinates))
        result[:, layout.free], result[:, layout.frozen] = q, self.frozen[members]
        return result

    def forces(self, members: Index, q: Array, s: Array) -> Forces:
        """Evaluate forces and constraints at rest of members (K,), at coordinates (K, n) and auxiliary states (K, k).

        The arguments `q` are the unknown coordinates.
        """
        layout = self.model.layout
        where = layout.slices
        residual = self.model.evaluators["residual"](self._arguments(members, q, s, None, ()), self.parameters[members])
        full = np.zeros((len(q), layout.unknowns))
        columns = [x[1] for x in self.model.evaluators["residual"].targets]
        full[:, columns] = residual
        if self.straight:
            nothing = np.zeros((len(q), 0, self.n))
            return Forces(-full[:, where["v"]], nothing[:, :, 0], nothing[:, :, 0], nothing, nothing, nothing[:, :, 0])
        found = self.derivatives(members, q, s)
        carry, settle = np.zeros((len(q), self.states, self.n)), np.zeros((len(q), self.states))
        rates = -full[:, where["s"]]
        if self.states:
            relaxing = self.relaxing[members]
            # relaxing states solve g(q, s) = 0; other states integrate velocities, so that ds = -(dr/dv) dq
            matrix = np.where(relaxing[:, :, None], found["ss"], np.eye(self.states))
            right = np.where(relaxing[:, :, None], -found["sq"], -found["sv"])
            settled = np.where(relaxing, rates, 0.0)[:, :, None]
            solved = np.linalg.solve(matrix, np.concatenate([right, settled], axis=2))
            carry, settle = solved[:, :, : self.n], solved[:, :, self.n]
        gradient = np.ascontiguousarray(found["vl"].transpose(0, 2, 1))
        return Forces(-full[:, where["v"]], full[:, where["l"]], rates, gradient, carry, settle)

    def derivatives(
        self, members: Index, q: Array, s: Array, multipliers: Array | None = None, c: float = 0.0
    ) -> dict[str, Array]:
        """Return blocks of the Jacobian of the residual at rest, ``dr/dy + c dr/dy'``, by row and column.

        The blocks are ``vq``, ``vs``, ``vv``, ``vl``, ``sq``, ``ss`` and ``sv``, each of shape (K, rows, columns).
        """
        arguments = self._arguments(members, q, s, multipliers, (c,))
        values = self.model.evaluators["jacobian"](arguments, self.parameters[members])
        sizes = {"q": self.n, "v": self.n, "s": self.states, "l": self.m}
        result = {}
        for name, (which, rows, columns) in self._entries.items():
            block = np.zeros((len(q), sizes[name[0]], sizes[name[1]]))
            block[:, rows, columns] = values[:, which]
            result[name] = block
        return result

    def recomputed(self, members: Index, q: Array) -> Array:
        """Return the initial auxiliary states for a pose, (K, k)."""
        full = self.whole(members, q)
        arguments = state_arguments(self.time, full, np.zeros((len(q), self.states)), np.zeros_like(full))
        return self.model.evaluate("initial", arguments, self.parameters[members])["s"]

    def _arguments(
        self, members: Index, q: Array, s: Array, multipliers: Array | None, extra: tuple[float, ...]
    ) -> Array:
        layout = self.model.layout
        y = np.zeros((len(q), layout.unknowns))
        where = layout.slices
        y[:, where["q"]], y[:, where["s"]] = q, s
        if multipliers is not None:
            y[:, where["l"]] = multipliers
        return layout.index2_arguments(self.time, y, np.zeros_like(y), self.frozen[members], *extra)
