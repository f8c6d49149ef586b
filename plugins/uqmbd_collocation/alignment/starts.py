"""Phases at which oscillations start, told from those that differ by whole turns: continuous in the inputs."""

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
    """Start phases of some realisations; others start within half a turn of their neighbour.

    Attributes
    ----------
    points : KDTree
        Their inputs, each over its range.
    scale : array, shape (d,)
        The ranges.
    phases : array, shape (K,)
        rad.
    """

    points: KDTree
    scale: Array
    phases: Array

    @classmethod
    def of(cls, values: Array, phases: Array) -> Starts:
        """Make them continuous from neighbour to neighbour along the shortest tree through all.

        Parameters
        ----------
        values : array, shape (K, d)
            Inputs.
        phases : array, shape (K,)
            Of the starts, rad, but for whole turns.
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
