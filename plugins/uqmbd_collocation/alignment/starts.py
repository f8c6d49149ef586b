"""Phases at which oscillations start, unwrapped so that they are continuous in the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from uqmbd.typing import Array

__all__ = ["Starts"]


@dataclass(frozen=True, eq=False)
class Starts:
    """Start phases of some realisations; others start within half a turn of their neighbour."""

    points: KDTree  # their inputs, each over its range
    scale: Array  # (d,) the ranges
    phases: Array  # (K,) rad

    @classmethod
    def of(cls, values: Array, phases: Array) -> Starts:
        """Return start phases (K,), rad, unwrapped so that they are continuous over inputs (K, d).

        Neighbours along the minimum spanning tree of the inputs differ by less than half a turn.
        """
        scale = np.where(np.ptp(values, axis=0) > 0, np.ptp(values, axis=0), 1.0)
        points = values / scale
        found = np.array(phases, dtype=float)
        # the tree takes a distance of zero for none
        tree = minimum_spanning_tree(cdist(points, points) + 1e-9)
        order, before = breadth_first_order(tree, len(points) // 2, directed=False)
        for k in order[1:]:
            found[k] -= 2 * np.pi * np.round((found[k] - found[before[k]]) / (2 * np.pi))
        return cls(KDTree(points), scale, found)

    def near(self, values: Array) -> Array:
        """Return phases near which realisations at inputs (K, d) start, rad, shape (K,)."""
        return np.asarray(self.phases[self.points.query(values / self.scale)[1]])
