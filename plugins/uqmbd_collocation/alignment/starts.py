"""Phases at which oscillations start, unwrapped to be continuous in the inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.typing import Array

if TYPE_CHECKING:
    from scipy.spatial import KDTree

__all__ = ["Starts"]


@dataclass(frozen=True, eq=False)
class Starts:
    """Start phases of given realisations; any other realisation starts within half a turn of its nearest neighbour."""

    points: KDTree  # inputs, each divided by its range
    scale: Array  # (d,) ranges of the inputs
    phases: Array  # (K,) start phases, rad

    @classmethod
    def of(cls, values: Array, phases: Array) -> Starts:
        """Return start phases (K,) in rad, unwrapped to be continuous over inputs (K, d).

        Neighbours in the minimum spanning tree of the inputs differ by less than half a turn.
        """
        # imported here, because studies import this module, and few align phases
        from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
        from scipy.spatial import KDTree
        from scipy.spatial.distance import cdist

        scale = np.where(np.ptp(values, axis=0) > 0, np.ptp(values, axis=0), 1.0)
        points = values / scale
        found = np.array(phases, dtype=float)
        # the tree treats a distance of zero as no edge
        tree = minimum_spanning_tree(cdist(points, points) + 1e-9)
        order, before = breadth_first_order(tree, len(points) // 2, directed=False)
        for k in order[1:]:
            found[k] -= 2 * np.pi * np.round((found[k] - found[before[k]]) / (2 * np.pi))
        return cls(KDTree(points), scale, found)

    def near(self, values: Array) -> Array:
        """Return approximate start phases (K,) in rad of realisations at inputs (K, d)."""
        return np.asarray(self.phases[self.points.query(values / self.scale)[1]])
