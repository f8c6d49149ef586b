"""Dimension-adaptive sparse grids: tensor projections where they matter, in the order in which they matter."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Fit, refitted
from uqmbd_collocation.refinement import Limits, Refinement, RefinementStep, missed_share, scale_of, warn_unmet
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse_grids import Level, in_order, lower_levels, nodes_of_levels, tensor_projection

__all__ = ["DEEPEST", "refine_dimensions"]

DEEPEST = 12
"""Highest level of a germ: 25 nodes, degree 24."""


@dataclass
class _Grid:
    """Tensor projections of a downward closed set of levels, by the combination technique.

    The sum is that of :class:`~uqmbd_collocation.sparse_grids.SparseProjection`, one level after the other.
    """

    runs: CollocationRuns
    total: dict[Level, Array] = field(default_factory=dict)
    """Coefficients by the degrees of their terms."""
    found: dict[Level, dict[Level, Array]] = field(default_factory=dict)

    def nodes(self, levels: list[Level]) -> Array:
        """Return the Gauss nodes of levels, shape (K, d)."""
        return nodes_of_levels(self.runs.space, levels)

    def projection(self, level: Level) -> dict[Level, Array]:
        """Coefficients of the tensor projection of a level, by the degrees of their terms."""
        if level not in self.found:
            self.found[level] = tensor_projection(self.runs, level).terms
        return self.found[level]

    def surplus(self, level: Level) -> dict[Level, Array]:
        """Return the surplus of a level over all smaller ones: the product of differences of successive levels."""
        total: dict[Level, Array] = {}
        for sign, lower in lower_levels(level):
            for term, value in self.projection(lower).items():
                total[term] = total[term] + sign * value if term in total else sign * value
        return total

    def add(self, level: Level) -> tuple[Array, Array]:
        """Add a level, and return by how much it changes the mean and the variance, each (O, T)."""
        mean: Array | float = 0.0
        variance: Array | float = 0.0
        for term, value in self.surplus(level).items():
            before = self.total.get(term, np.zeros_like(value))
            self.total[term] = before + value
            if any(term):
                variance = variance + value * (2 * before + value)
            else:
                mean = value
        shape = next(iter(self.total.values())).shape
        return np.broadcast_to(mean, shape), np.broadcast_to(variance, shape)

    def chaos(self) -> tuple[Array, Index]:
        """Return coefficients (P, O, T) and degrees (P, d), the mean first."""
        terms = in_order(self.total)
        index = np.array(terms, dtype=np.int64).reshape(-1, self.runs.space.dimension)
        return np.array([self.total[term] for term in terms]), index

    def children(self, level: Level, done: set[Level]) -> tuple[list[Level], bool]:
        """Return the next levels that have all smaller ones, and whether the depth cut any off."""
        found, cut = [], False
        for k, germ in enumerate(self.runs.space.germs):
            if germ.values is not None and 2 * level[k] + 1 >= germ.values:
                continue  # its values are all nodes already
            if level[k] == DEEPEST:
                cut = True
                continue
            child = (*level[:k], level[k] + 1, *level[k + 1 :])
            below = ((*child[:i], child[i] - 1, *child[i + 1 :]) for i in range(len(child)) if child[i])
            if all(b in done for b in below):
                found.append(child)
        return found, cut


@dataclass(frozen=True)
class _Scale:
    """Scale of changes: the standard deviation (O, T), and its largest over time (O,)."""

    std: Array
    largest: Array

    def measure(self, mean: Array, variance: Array) -> tuple[float, float]:
        """Size of changes of mean and variance (O, T): in the mean and in the standard deviation."""
        less = np.sqrt(np.maximum(self.std**2 - np.abs(variance), 0.0))
        in_mean = (np.abs(mean).max(axis=-1) / self.largest).max()
        return float(in_mean), float(((self.std - less).max(axis=-1) / self.largest).max())


def refine_dimensions(
    runs: CollocationRuns, points: uqmbd.extend.VerificationPoints, limits: Limits, label: str
) -> Refinement:
    """Refine a sparse grid where mean and standard deviation change most, until the changes meet the tolerance.

    The changes of all levels without successors are added up (Gerstner and Griebel, Computing 71 (2003) 65-87). The
    tolerance is not met while the error at the verification points exceeds it. Raise StudyError if the allowed
    realisations do not suffice for the first levels.
    """
    grid, dimension = _Grid(runs), runs.space.dimension
    root = (0,) * dimension
    new, _ = grid.children(root, {root})
    # one node tells nothing about a spread, so that each input is tried at once
    first = np.concatenate([grid.nodes([root, *new]), points.germs])
    if len(runs.missing(first)) > limits.most:
        raise uqmbd.StudyError(
            f"{label}: the first step takes {len(runs.missing(first))} realisations, and max_realisations is "
            f"{limits.most}; allow more."
        )
    runs.at(first)
    done, reason = {root}, ""
    steps: list[RefinementStep] = []
    waiting: dict[Level, tuple[Array, Array]] = {}
    ended: list[tuple[Array, Array]] = []
    new = [root, *new]
    while True:
        where = runs.at(grid.nodes(new)) if new else np.zeros(0, dtype=np.int64)
        if not runs.good(where).all():
            return _after_failure(runs, [*grid.found, *new], grid, steps, limits, label)
        for level in new:
            waiting[level] = grid.add(level)
        waiting.pop(root, None)
        coefficients, multi_index = grid.chaos()
        scale = _scale(runs, coefficients)
        changes = scale.measure(*(_sum(k, [*waiting.values(), *ended], scale.std) for k in (0, 1)))
        settled = max(changes) < limits.tolerance
        missed = missed_share(runs, coefficients, multi_index, points) if settled else np.nan
        steps.append(RefinementStep(len(runs), len(multi_index), *changes, missed))
        steps[-1].log(label, limits)
        if settled and missed < limits.tolerance:
            break
        if not waiting:
            reason = f"no level is higher than {DEEPEST}" if ended else "there are no further terms"
            break
        # what is far below the tolerance is as good as nothing: then small levels come first
        size = {w: max(1e-3 * limits.tolerance, *scale.measure(*change)) for w, change in waiting.items()}
        worst = max(waiting, key=lambda level: (size[level], -sum(level), level))
        done.add(worst)
        new, cut = grid.children(worst, done)
        more = len(runs.missing(grid.nodes(new))) if new else 0
        if len(runs) + more > limits.most:
            reason = f"the next step needs {more} more, and max_realisations is {limits.most}"
            break
        if cut:
            ended.append(waiting[worst])
        del waiting[worst]
    if reason:
        warn_unmet(label, limits, steps, reason)
    how = f"adaptive sparse grid of {len(grid.found)} tensor projections"
    fit = Fit(coefficients, multi_index, how, runs.at(grid.nodes(list(grid.found))))
    return Refinement(fit, tuple(steps), met=not reason)


def _scale(runs: CollocationRuns, coefficients: Array) -> _Scale:
    variance = np.sum(coefficients[1:] ** 2, axis=0)
    return _Scale(np.sqrt(variance), scale_of(runs, coefficients[0], variance))


def _sum(which: int, changes: list[tuple[Array, Array]], like: Array) -> Array:
    """Sum of the sizes of changes (O, T): of the mean (0) or the variance (1)."""
    return sum((np.abs(change[which]) for change in changes), np.zeros_like(like))


def _after_failure(
    runs: CollocationRuns, tried: list[Level], grid: _Grid, steps: list[RefinementStep], limits: Limits, label: str
) -> Refinement:
    """Fit the terms that were found by regression on all nodes that did not fail."""
    if grid.total:
        _, multi_index = grid.chaos()
    else:
        multi_index = uqmbd.extend.index_set(runs.space.dimension, 1)
    fit = refitted(runs, np.unique(runs.at(grid.nodes(tried))), multi_index, label)
    warn_unmet(label, limits, steps, "the grid is not refined further, because realisations failed")
    return Refinement(fit, tuple(steps))
