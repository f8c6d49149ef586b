"""Dimension-adaptive sparse grids, which add tensor projections in order of their contribution."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Fit, refitted
from uqmbd_collocation.refinement.steps import Limits, Refinement, RefinementStep, missed_share, scale_of, warn_unmet
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse_grids import Level, in_order, lower_levels, nodes_of_levels, tensor_projection

__all__ = ["DEEPEST", "refine_dimensions"]

DEEPEST = 12
"""Highest level of a germ, with 25 nodes and degree 24."""


@dataclass
class _Grid:
    """Tensor projections of a downward closed set of levels, by the combination technique.

    The result is the same as for :class:`~uqmbd_collocation.sparse_grids.SparseProjection`, but levels are added one by
    one.
    """

    runs: CollocationRuns
    total: dict[Level, Array] = field(default_factory=dict)
    """Coefficients (O, T), keyed by the degrees of their terms."""
    found: dict[Level, dict[Level, Array]] = field(default_factory=dict)

    def nodes(self, levels: list[Level]) -> Array:
        """Return the Gauss nodes of levels, shape (K, d)."""
        return nodes_of_levels(self.runs.space, levels)

    def projection(self, level: Level) -> dict[Level, Array]:
        """Return the coefficients of the tensor projection of a level, keyed by the degrees of their terms."""
        if level not in self.found:
            self.found[level] = tensor_projection(self.runs, level).terms
        return self.found[level]

    def surplus(self, level: Level) -> dict[Level, Array]:
        """Return the surplus of a level over all smaller levels: the product of differences of successive levels."""
        total: dict[Level, Array] = {}
        for sign, lower in lower_levels(level):
            for term, value in self.projection(lower).items():
                total[term] = total[term] + sign * value if term in total else sign * value
        return total

    def add(self, level: Level) -> tuple[Array, Array, Array]:
        """Add a level, and return the changes of mean and variance, and the mean square of the surplus, each (O, T)."""
        mean: Array | float = 0.0
        variance: Array | float = 0.0
        energy: Array | float = 0.0
        for term, value in self.surplus(level).items():
            before = self.total.get(term, np.zeros_like(value))
            self.total[term] = before + value
            energy = energy + value**2
            if any(term):
                variance = variance + value * (2 * before + value)
            else:
                mean = value
        shape = next(iter(self.total.values())).shape
        return np.broadcast_to(mean, shape), np.broadcast_to(variance, shape), np.broadcast_to(energy, shape)

    def chaos(self) -> tuple[Array, Index]:
        """Return coefficients (P, O, T) and degrees (P, d) of the terms; the first term is the constant."""
        terms = in_order(self.total)
        index = np.array(terms, dtype=np.int64).reshape(-1, self.runs.space.dimension)
        return np.array([self.total[term] for term in terms]), index

    def children(self, level: Level, done: set[Level]) -> tuple[list[Level], bool]:
        """Return the next levels whose smaller levels are all in `done`, and whether `DEEPEST` excluded one."""
        found, cut = [], False
        for k, germ in enumerate(self.runs.space.germs):
            if germ.values is not None and 2 * level[k] + 1 >= germ.values:
                continue  # all values of this germ are nodes already
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
    """Scale of changes: the standard deviation (O, T), and its maximum over time (O,)."""

    std: Array
    largest: Array

    def root_mean_square(self, energy: Array) -> float:
        """Convert a mean square (O, T) to the largest root mean square over the largest standard deviation."""
        return float((np.sqrt(energy.max(axis=-1)) / self.largest).max())

    def measure(self, mean: Array, variance: Array) -> tuple[float, float]:
        """Convert changes of mean and variance (O, T) to relative changes of mean and standard deviation."""
        less = np.sqrt(np.maximum(self.std**2 - np.abs(variance), 0.0))
        in_mean = (np.abs(mean).max(axis=-1) / self.largest).max()
        return float(in_mean), float(((self.std - less).max(axis=-1) / self.largest).max())


def refine_dimensions(
    runs: CollocationRuns, points: uqmbd.extend.VerificationPoints, limits: Limits, label: str
) -> Refinement:
    """Refine a sparse grid by the largest changes of mean and standard deviation, until the changes meet `limits`.

    The criterion compares the tolerance with the sum of the changes of all levels without successors (Gerstner and
    Griebel, Computing 71 (2003) 65-87). The refinement also continues while the error at the verification points
    exceeds the tolerance. If `limits` contains an error, only the error at the verification points ends the refinement.
    Each step then refines the level with the largest root mean square. Raise StudyError if the first levels need more
    than the allowed realisations.
    """
    grid, dimension = _Grid(runs), runs.space.dimension
    root = (0,) * dimension
    new, _ = grid.children(root, {root})
    # a single node gives no standard deviation, so the first step includes the next level of each input
    first = np.concatenate([grid.nodes([root, *new]), points.germs])
    more = len(runs.missing(first)) + limits.reserved
    if more > limits.most:
        raise uqmbd.StudyError(
            f"{label}: the first step needs {more} realisations, but max_realisations is {limits.most}. Increase "
            "max_realisations."
        )
    runs.at(first)
    done, reason = {root}, ""
    helpful: Literal["realisations", "samples", "neither"] = "realisations"
    steps: list[RefinementStep] = []
    waiting: dict[Level, tuple[Array, Array, Array]] = {}
    ended: list[tuple[Array, Array, Array]] = []
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
        missed = missed_share(runs, coefficients, multi_index, points)
        steps.append(RefinementStep(len(runs), len(multi_index), *changes, missed))
        steps[-1].log(label, limits)
        if steps[-1].met(limits, settled=settled):
            break
        if not waiting:
            reason = (
                f"the level {DEEPEST} is the highest possible one" if ended else "the basis contains all terms already"
            )
            helpful = "samples" if ended else "neither"
            break
        # sizes far below the limit count as equal; small levels then come first
        if limits.error is None:
            size = {w: max(1e-3 * limits.tolerance, *scale.measure(*change[:2])) for w, change in waiting.items()}
        else:  # a mean square of new terms is linear in the variance, but not in the mean
            size = {w: max(1e-3 * limits.error, scale.root_mean_square(change[2])) for w, change in waiting.items()}
        worst = max(waiting, key=lambda level: (size[level], -sum(level), level))
        done.add(worst)
        new, cut = grid.children(worst, done)
        more = (len(runs.missing(grid.nodes(new))) if new else 0) + limits.reserved
        if len(runs) + more > limits.most:
            reason = f"the next step needs {more} more realisations, but max_realisations is {limits.most}"
            break
        if cut:
            ended.append(waiting[worst])
        del waiting[worst]
    if reason:
        warn_unmet(label, limits, steps, reason, helpful)
    how = f"adaptive sparse grid of {len(grid.found)} tensor projections"
    fit = Fit(coefficients, multi_index, how, runs.at(grid.nodes(list(grid.found))))
    return Refinement(fit, tuple(steps), met=not reason)


def _scale(runs: CollocationRuns, coefficients: Array) -> _Scale:
    variance = np.sum(coefficients[1:] ** 2, axis=0)
    return _Scale(np.sqrt(variance), scale_of(runs, coefficients[0], variance))


def _sum(which: int, changes: list[tuple[Array, Array, Array]], like: Array) -> Array:
    """Return the sum (O, T) of absolute changes of the mean (`which` = 0) or of the variance (`which` = 1)."""
    return sum((np.abs(change[which]) for change in changes), np.zeros_like(like))


def _after_failure(
    runs: CollocationRuns, tried: list[Level], grid: _Grid, steps: list[RefinementStep], limits: Limits, label: str
) -> Refinement:
    """Return a regression on all successful nodes, with the terms of the refinement so far."""
    if grid.total:
        _, multi_index = grid.chaos()
    else:
        multi_index = uqmbd.extend.index_set(runs.space.dimension, 1)
    fit = refitted(runs, np.unique(runs.at(grid.nodes(tried))), multi_index, label)
    warn_unmet(label, limits, steps, "the refinement of the grid stopped because realisations failed", "neither")
    return Refinement(fit, tuple(steps))
