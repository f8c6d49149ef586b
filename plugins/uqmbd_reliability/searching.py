"""Find design points, the points on the limits nearest to the origin, by simultaneous searches from several starts.

OpenTURNS's FORM computes all realisations of a gradient in one call. FORM processes one start after another, and
computes the points of the line search one by one. FORM needs 11 calls and 20 points for a plane in two dimensions, and
26 calls and 50 points for a parabola. A plane in 40 dimensions needs 415 points. FORM cannot continue if a realisation
fails, and its MultiFORM raises an error for symmetric branches. Here, one stack contains all starts and all
requirements. With many inputs, gradients are updated instead of computed again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_reliability.ledger import BudgetExhausted, LimitStateLedger

__all__ = ["DesignPoint", "distinct", "search", "starts"]


STEP = 0.05
"""Step of finite differences, large enough to make the integration error in the difference quotient small."""

FULL = 6
"""Largest number of inputs with computed gradients in each step; for more, Broyden's formula updates them."""

ROUNDS = 12
FARTHEST = 9.0
"""Distance from the origin beyond which violations have probabilities below 1e-18."""


@dataclass(frozen=True, eq=False)
class DesignPoint:
    """Most likely point of violation."""

    requirement: int  # index of the requirement whose margin is zero at the point
    point: Array  # (d,) in the standard normal space
    beta: float  # distance from the origin; negative if the origin is a violation
    direction: Array  # (d,) unit vector into the violation: opposite to the gradient of the margin


def starts(points: Array, margins: Array, origin: float, most: int) -> Array:
    """Return at most `most` start points (S, d) of searches.

    The function selects given points whose rays from the origin seem to reach the limit soonest, with directions at
    least 45 degrees apart. It moves them along their rays to the estimated limit, at most to 1.5 times their distance
    plus one. `margins` (K,) are NaN for failed realisations; `origin` is the margin of the origin.
    """
    distance = np.linalg.norm(points, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        met = distance * origin / (origin - margins)
    good = np.isfinite(met) & (distance > 0.1) & (met > 0) & (met < 3 * FARTHEST)
    order = np.flatnonzero(good)[np.argsort(met[good], kind="stable")]
    chosen: list[int] = []
    for k in order:
        cosines = [points[k] @ points[j] / (distance[k] * distance[j]) for j in chosen]
        if all(c < 0.7 for c in cosines):
            chosen.append(int(k))
        if len(chosen) == most:
            break
    # if the point violates the limit, this is an interpolation; otherwise limit the extrapolation
    scale = [min(met[k], 1.5 * distance[k] + 1.0) / distance[k] for k in chosen]
    return np.array([points[k] * s for k, s in zip(chosen, scale, strict=True)]).reshape(-1, points.shape[1])


def search(ledger: LimitStateLedger, begin: Array, requirement: Array, origin: Array) -> list[DesignPoint]:
    """Return design points of simultaneous searches from all starts (S, d).

    Steps follow Hasofer, Lind, Rackwitz and Fiessler with backtracking. `requirement` (S,): index of the margin for
    each start; `origin` (requirement,): margins of the origin. Several searches may end at the same point.
    """
    paths = [_SearchPath(u, int(r)) for u, r in zip(begin, requirement, strict=True)]
    for _ in range(ROUNDS):
        going = [path for path in paths if not path.done]
        requested = [path.asked() for path in going]
        if not requested or sum(map(len, requested)) > ledger.left:
            break
        try:
            found = ledger(np.concatenate(requested))
        except BudgetExhausted:
            break
        edges = np.cumsum([0, *map(len, requested)])
        for path, low, high in zip(going, edges, edges[1:], strict=False):
            path.process(found[low:high, path.requirement])
    ended = []
    for path in paths:
        if path.ended:
            beta = float(np.linalg.norm(path.point)) * (1.0 if origin[path.requirement] > 0 else -1.0)
            ended.append(DesignPoint(path.requirement, path.point, beta, -path.slope / np.linalg.norm(path.slope)))
    return ended


class _SearchPath:
    """Search from one start: it proposes points, and processes their margins."""

    def __init__(self, begin: Array, requirement: int) -> None:
        self.requirement = requirement
        self.point, self.tried = begin, begin
        self.margin = np.nan
        self.slope = np.zeros(len(begin))
        self.merit, self.halvings = np.inf, 0
        self.fresh = True
        self.done = self.ended = False

    def asked(self) -> Array:
        """Return the points to be computed."""
        if not self.fresh:
            return self.tried[None]
        return np.concatenate([self.tried[None], self.tried + STEP * np.eye(len(self.tried))])

    def process(self, margins: Array) -> None:
        """Process the margins of the requested points, and choose the next step."""
        margin, slope = float(margins[0]), self.slope
        if self.fresh and len(margins) > 1:
            slope = (margins[1:] - margin) / STEP
        elif np.isfinite(margin) and np.isfinite(self.margin):
            moved = self.tried - self.point
            slope = slope + (margin - self.margin - slope @ moved) / max(float(moved @ moved), 1e-12) * moved
        # a failed realisation contains no information on the slope in its direction
        slope = np.where(np.isfinite(slope), slope, 0.0)
        size = float(np.linalg.norm(slope))
        worse = not np.isfinite(margin) or size == 0.0
        if not worse:
            factor = (2.0 * float(np.linalg.norm(self.tried)) + 1.0) / size
            merit = 0.5 * float(self.tried @ self.tried) + factor * abs(margin)
            worse = self.halvings < 3 and bool(np.isfinite(self.margin)) and merit > self._merit(factor) + 1e-9
        if worse:
            self.halvings += 1
            if self.halvings > 4 or not np.isfinite(self.margin):
                self.done = True
            self.tried = 0.5 * (self.tried + self.point)
            # if an updated gradient gives no progress, compute it again at the best point so far
            if self.halvings == 2 and len(slope) > FULL and np.isfinite(self.margin):
                self.tried, self.fresh, self.margin = self.point, True, np.nan
            return
        self.point, self.margin, self.slope, self.halvings = self.tried, margin, slope, 0
        across = self.point - (self.point @ slope) / size**2 * slope
        near = abs(margin) < 0.03 * size
        if near and np.linalg.norm(across) < 0.1 + 0.03 * np.linalg.norm(self.point):
            self.done = self.ended = True
            return
        self.fresh = len(slope) <= FULL
        target = (self.point @ slope - margin) / size**2 * slope
        step = target - self.point
        length = float(np.linalg.norm(step))
        self.tried = self.point + step * min(1.0, 3.0 / max(length, 1e-12))
        if np.linalg.norm(self.tried) > FARTHEST:
            self.tried = self.tried * (FARTHEST / np.linalg.norm(self.tried))
            if np.linalg.norm(self.point) > 0.98 * FARTHEST:
                self.done = True
        # a point on the limit is useful at the end of the rounds, even if it is not the nearest one
        self.ended = near

    def _merit(self, factor: float) -> float:
        return 0.5 * float(self.point @ self.point) + factor * abs(self.margin)


def distinct(points: list[DesignPoint]) -> list[DesignPoint]:
    """Return design points without repetitions, sorted by requirement, then by increasing beta.

    A point is a repetition if an earlier point of the same requirement is at most ``0.3 max(|beta|, 1)`` away, with
    beta of the earlier point.
    """
    found: list[DesignPoint] = []
    for one in sorted(points, key=lambda p: (p.requirement, p.beta)):
        same = [o for o in found if o.requirement == one.requirement]
        if all(np.linalg.norm(o.point - one.point) > 0.3 * max(abs(o.beta), 1.0) for o in same):
            found.append(one)
    return found
