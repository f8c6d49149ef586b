"""The index-1 systems at the nodes of a projection, with right-hand sides of any kind: compiled, or factorised."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from uqmbd.compiled import Kernel
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear.index1 import DENSE_LIMIT, System
from uqmbd.dynamics.linear.sparse import Factors
from uqmbd.dynamics.linear.unrolled import defect_kernel, unroll
from uqmbd.typing import Array

__all__ = [
    "CompiledSystems",
    "FrontalSystems",
    "LapackSystems",
    "NodalSystems",
    "SparseSystems",
    "nodal_systems",
]


class NodalSystems(Protocol):
    """Systems ``A_k x = b_k`` of K nodes.

    Attributes
    ----------
    compiled : bool
        Whether they are cheap enough for every stage of an explicit step.
    """

    compiled: bool

    def place(self, values: Array) -> None:
        """Take the results of the ``acceleration`` evaluator at the nodes (K, result): all else is about them."""

    def motion(self) -> Array:
        """Accelerations and multipliers at the nodes, shape (K, size)."""

    def solve(self, right: Array) -> Array:
        """Solve for any right-hand sides (K, size)."""

    def apply(self, x: Array) -> Array:
        """``-A_k x_k``, shape (K, size)."""

    def defect(self, x: Array) -> Array:
        """``b_k - A_k x_k`` of the equations of motion, shape (K, size)."""

    def excess(self, drift: Array) -> Array:
        """Find what is too much of coordinates and velocities at the nodes, shape (K, 2 coordinate)."""


def nodal_systems(model: Model, count: int) -> NodalSystems:
    """Make the systems of `count` nodes: compiled where that is not too long."""
    system: System = model.system
    if system.fronts is not None:
        return FrontalSystems(model)
    if system.elimination is not None and isinstance(system.solve, Kernel) and system.project is not None:
        given, size = system.solve.inputs, system.size
        rights = given + np.arange(size)[None, :]
        code = unroll(system.elimination, system.rows, system.columns, system.source, rights, given + size, size)
        if code is not None:
            return CompiledSystems(system, code, count)
    return SparseSystems(model) if system.size > DENSE_LIMIT else LapackSystems(model)


class CompiledSystems:
    """Straight-line code for the model's own order of elimination."""

    compiled = True

    def __init__(self, system: System, code: Kernel, count: int) -> None:
        assert system.solve is not None and system.project is not None
        self.system, self.given, self.code = system, code.inputs - system.size, code
        entries = (system.rows, system.columns, system.source)
        self.product = defect_kernel(*entries, np.full(system.size, -1), self.given)
        self.difference = defect_kernel(*entries, system.motion, self.given)
        self.both = np.empty((count, self.given + system.size))
        self.values = self.both[:, : self.given]

    def place(self, values: Array) -> None:
        """See `NodalSystems`."""
        self.values = values
        self.both[:, : self.given] = values

    def motion(self) -> Array:
        """See `NodalSystems`."""
        assert self.system.solve is not None
        return self.system.solve(self.values)

    def solve(self, right: Array) -> Array:
        """See `NodalSystems`."""
        self.both[:, self.given :] = right
        return self.code(self.both)

    def apply(self, x: Array) -> Array:
        """See `NodalSystems`."""
        self.both[:, self.given :] = x
        return self.product(self.both)

    def defect(self, x: Array) -> Array:
        """See `NodalSystems`."""
        self.both[:, self.given :] = x
        return self.difference(self.both)

    def excess(self, drift: Array) -> Array:
        """See `NodalSystems`."""
        assert self.system.project is not None
        return self.system.project(np.concatenate([self.values, drift], axis=1))


class SparseSystems:
    """Sparse factorisations, for large mechanisms whose elimination cannot be compiled."""

    compiled = False

    def __init__(self, model: Model) -> None:
        self.model, self.system = model, model.system
        self.values = np.zeros((0, 0))
        self.factors = Factors((), np.zeros((0, 0)))

    def place(self, values: Array) -> None:
        """See `NodalSystems`."""
        self.values = values
        self.factors = self.system.pattern.factorise(values)

    def motion(self) -> Array:
        """See `NodalSystems`."""
        return self.solve(self.system.right(self.values))

    def solve(self, right: Array) -> Array:
        """See `NodalSystems`."""
        return self.factors.solve(right)

    def apply(self, x: Array) -> Array:
        """See `NodalSystems`."""
        return -np.asarray(self.system.pattern.product(self.values, x))

    def defect(self, x: Array) -> Array:
        """See `NodalSystems`."""
        found: Array = self.system.right(self.values) + self.apply(x)
        return found

    def excess(self, drift: Array) -> Array:
        """See `NodalSystems`."""
        n = self.model.layout.coordinates
        return np.concatenate([self.solve(side)[:, :n] for side in self.system.drift_sides(drift)], axis=1)


class FrontalSystems(SparseSystems):
    """The model's own elimination by blocks."""

    compiled = True

    def place(self, values: Array) -> None:
        """See `NodalSystems`."""
        self.values = values

    def solve(self, right: Array) -> Array:
        """See `NodalSystems`."""
        found: Array = self.system.fronts.solve(self.values, right)
        return found


class LapackSystems:
    """Dense inverses: for mechanisms whose elimination is too long to compile, at the starts of an integration."""

    compiled = False

    def __init__(self, model: Model) -> None:
        self.model, self.system = model, model.system
        self.matrix = self.inverse = np.zeros((0, 0, 0))
        self.right = np.zeros((0, 0))

    def place(self, values: Array) -> None:
        """See `NodalSystems`."""
        self.matrix, self.right = self.system.matrix(values), self.system.right(values)
        # rows of light bodies are scaled up: the pivots see comparable numbers
        scale = np.abs(self.matrix).max(axis=2)
        scale = np.where(scale > 0, scale, 1.0)
        try:
            self.inverse = np.linalg.inv(self.matrix / scale[:, :, None]) / scale[:, None, :]
        except np.linalg.LinAlgError:
            self.inverse = np.full_like(self.matrix, np.nan)

    def motion(self) -> Array:
        """See `NodalSystems`."""
        return self.solve(self.right)

    def solve(self, right: Array) -> Array:
        """See `NodalSystems`."""
        found = np.matmul(self.inverse, right[:, :, None])
        # refined once: an inverse loses digits that a factorisation keeps
        found += np.matmul(self.inverse, right[:, :, None] - np.matmul(self.matrix, found))
        return np.asarray(found[:, :, 0])

    def apply(self, x: Array) -> Array:
        """See `NodalSystems`."""
        return np.asarray(-np.matmul(self.matrix, x[:, :, None])[:, :, 0])

    def defect(self, x: Array) -> Array:
        """See `NodalSystems`."""
        return self.right + self.apply(x)

    def excess(self, drift: Array) -> Array:
        """See `NodalSystems`."""
        n = self.model.layout.coordinates
        return np.concatenate([self.solve(side)[:, :n] for side in self.system.drift_sides(drift)], axis=1)
