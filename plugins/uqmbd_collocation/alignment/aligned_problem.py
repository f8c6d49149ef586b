"""Problem whose outputs are the times of markers, and the motion between markers.

Every rule, fit and refinement accepts this problem like the original problem.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import uqmbd
from uqmbd.extend import AlignedElement, Labels, OutputInfo
from uqmbd.typing import Array
from uqmbd_collocation.alignment.markers import Cut
from uqmbd_collocation.runs import DerivedSource

__all__ = ["AlignedProblem"]


@dataclass(frozen=True, eq=False)
class AlignedProblem(DerivedSource):
    """Problem whose outputs are the time, then the outputs of the study, at the points of all segments in sequence."""

    problem: uqmbd.extend.Problem
    cut: Cut  # computes realisations from marker to marker
    segments: int
    points: int  # number of points of each segment

    @property
    def labels(self) -> Labels:
        """Labels of outputs, with the time as the first output; columns have numbers instead of times."""
        inner = self.problem.labels
        columns = np.arange(float(self.segments * self.points))
        return replace(inner, outputs=(OutputInfo("time", "s"), *inner.outputs), times=columns)

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Return realisations divided at the markers, with the response (K, 1 + O, segments * points)."""
        cut, found = self.cut(values)
        where = AlignedElement.points(self.points)
        times = cut.edges[:, :-1, None] + where * np.diff(cut.edges, axis=1)[:, :, None]
        rows = np.concatenate([times[:, :, None], cut.response], axis=2)
        response = rows.transpose(0, 2, 1, 3).reshape(len(rows), rows.shape[2], -1)
        return replace(found, response=response)

    def split(self, coefficients: Array) -> tuple[Array, Array]:
        """Return coefficients (P, S + 1) of the markers, and (P, S, O, N) of the outputs at the points."""
        rows = coefficients.reshape(*coefficients.shape[:2], self.segments, self.points)
        edges = np.concatenate([rows[:, 0, :, 0], rows[:, 0, -1:, -1]], axis=1)
        return edges, rows[:, 1:].transpose(0, 2, 1, 3)
