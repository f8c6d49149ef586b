"""Maxima of the posterior density, from many starts at once.

The Levenberg-Marquardt method runs for a stack of starts, so one call evaluates the surrogate for all of them.
`scipy.optimize.least_squares` runs one start after another, with separate calls of the surrogate for each step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.posterior import STEP, Posterior

__all__ = ["REACH", "Peaks", "climb", "distinct"]


REACH = 5.0
"""Initial limit of the search, in standard deviations of the prior."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """Maxima found from a stack of starts."""

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

    `target`: posterior; `starts` (K, N); `steps`: largest number of steps; `difference` (D,): steps of central
    differences; `reach`: limit of the search, in standard deviations of the prior; `within`: trust region, the largest
    change of an input from its start, in standard deviations of the prior.
    """
    at = target.with_levels(starts).copy()
    # a start beyond the reach is still admissible
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
    """Return the best distinct maxima, lowest cost first: any two are more than one standard deviation apart.

    `dimension`: number of unknown inputs, which alone determine distances; `most`: largest number of maxima;
    `within`: largest cost above the lowest cost.
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
