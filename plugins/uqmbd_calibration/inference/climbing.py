"""The most probable values, from many starts at once.

Levenberg and Marquardt's method for a stack of starts: the surrogate is evaluated for all of them in one call.
`scipy.optimize.least_squares` takes one start after another, and calls the surrogate for each of its steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.posterior import STEP, Posterior

__all__ = ["REACH", "Peaks", "climb", "distinct"]


REACH = 5.0
"""Standard deviations of the prior beyond which nothing is looked for at first."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """Results of climbs to maxima."""

    vectors: Array  # (K, N)
    cost: Array  # (K,): minus the log-density
    hessian: Array  # (K, N, N)

    def __getitem__(self, rows: Array | slice | list[int]) -> Peaks:
        return Peaks(self.vectors[rows], self.cost[rows], self.hessian[rows])


def climb(
    target: Posterior,
    starts: Array,
    steps: int = 30,
    difference: Array | float = STEP,
    reach: float = REACH,
    within: float = np.inf,
) -> Peaks:
    """Climb from starts (K, N) to maxima of the posterior density.

    `target`: whose density; `starts` (K, N); `steps`: at most; `difference` (D,): steps of central differences;
    `reach`: standard deviations of the prior beyond which nothing is looked for; `within`: standard deviations of the
    prior by which an input may move from its start: a trust region.
    """
    at = target.with_levels(starts).copy()
    # a start beyond the reach stays admissible
    lower = np.minimum(np.maximum(starts - within, -reach), starts)
    upper = np.maximum(np.minimum(starts + within, reach), starts)
    damping = np.full(len(at), 1e-2)
    now = target.linearised(at, difference)
    cost, gradient, hessian = now.cost.copy(), now.gradient.copy(), now.hessian.copy()
    going = np.isfinite(cost)
    for _ in range(steps):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        diagonal = np.einsum("kii->ki", hessian[rows])
        damped = hessian[rows] + damping[rows, None, None] * diagonal[:, :, None] * np.eye(at.shape[1])
        step = -np.linalg.solve(damped, gradient[rows][..., None])[..., 0]
        step[:, target.unknowns.first_level :] = 0.0
        tried = np.clip(at[rows] + step, lower[rows], upper[rows])
        tried = target.with_levels(tried)
        then = target.linearised(tried, difference)
        better = then.cost < cost[rows]
        moved = rows[better]
        length = np.einsum("ki,kij,kj->k", step, hessian[rows], step)
        at[moved], cost[moved] = tried[better], then.cost[better]
        gradient[moved], hessian[moved] = then.gradient[better], then.hessian[better]
        damping[moved] = np.maximum(damping[moved] / 5.0, 1e-9)
        damping[rows[~better]] *= 4.0
        small = length < 1e-6
        going[rows[small & (better | (damping[rows] < 1e-2))]] = False
        going[rows[damping[rows] > 1e8]] = False
    return Peaks(at, cost, hessian)


def distinct(peaks: Peaks, dimension: int, most: int, within: float = np.inf) -> Peaks:
    """Return the best of those that are apart by more than one deviation of either, in the order of their cost.

    `dimension`: of the unknown inputs; levels and coefficients do not count; `most`: how many; `within`: cost above
    the best one up to which they are kept.
    """
    kept: list[int] = []
    for k in np.argsort(peaks.cost, kind="stable").tolist():
        if not np.isfinite(peaks.cost[k]) or (kept and peaks.cost[k] > peaks.cost[kept[0]] + within):
            break
        away = peaks.vectors[kept][:, :dimension] - peaks.vectors[k, :dimension]
        metric = peaks.hessian[kept][:, :dimension, :dimension]
        if all(np.einsum("ki,kij,kj->k", away, metric, away) > 1.0):
            kept.append(k)
        if len(kept) == most:
            break
    return peaks[kept]
