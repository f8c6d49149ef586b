"""Further verification points in gaps next to the verification realisations that have most of the error."""

from __future__ import annotations

import numpy as np

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd.typing import Array, Index, Mask
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["with_gap", "with_gaps"]

INACCURATE = 0.1
"""Further points are added if the error exceeds this multiple of the standard deviation. Methods also warn of such
errors."""

FURTHER = 2
"""Number of further points that are added."""

AMONG, MOST = 32, 1024
"""Number of candidates for each verification point, and largest total number of candidates."""

OPPOSITE, SIMILAR = 0.5, 2.0
"""A candidate is in a gap between two points in nearly opposite directions: the cosine of their angle is at most
-`OPPOSITE`. The ratio of their distances is at most `SIMILAR`."""

STREAM = 0x7E51F3
"""Random stream of the candidates."""


def with_gaps(
    points: uqmbd.extend.VerificationPoints, chaos: PolynomialChaos, runs: CollocationRuns, plans: Plans
) -> uqmbd.extend.VerificationPoints:
    """Return the points and, for an inaccurate chaos, two further points in gaps between the points with large errors.

    Errors in thin layers of the germ space, for example next to a separatrix, may be between verification points. The
    total weight does not change: a further point takes the weight of the candidates that are nearer to it than to other
    points.
    """
    error = chaos.verification_error().reshape(runs.response.shape[1:])
    large = np.isfinite(error) & (error > INACCURATE)
    if not large.any() or len(runs) + FURTHER > plans.max_realisations:
        return points
    among = uqmbd.extend.VerificationPoints.drawn(runs.space, min(AMONG * len(points), MOST), plans.seed, STREAM)
    for _ in range(FURTHER):
        further = with_gap(points, _shares(points, chaos, runs, large), among)
        if further is None:
            break
        points = further
    return points


def _shares(
    points: uqmbd.extend.VerificationPoints, chaos: PolynomialChaos, runs: CollocationRuns, large: Mask
) -> Array:
    """Return the share (V,) of each point in the mean square error, averaged over inaccurate outputs and times."""
    where = runs.at(points.germs)
    good = runs.status[where] == Status.OK
    found = np.zeros(len(points))
    if good.any():
        response = runs.response[where[good]]
        columns = (chaos.evaluate_germs(points.germs[good]).reshape(response.shape) - response)[:, large]
        squares = points.weights[good, None] * (columns / np.maximum(np.abs(columns).max(axis=0), 1e-300)) ** 2
        found[good] = (squares / np.maximum(squares.sum(axis=0), 1e-300)).mean(axis=1)
    return found


def with_gap(
    points: uqmbd.extend.VerificationPoints, shares: Array, among: uqmbd.extend.VerificationPoints
) -> uqmbd.extend.VerificationPoints | None:
    """Return the points and the candidate with the largest estimated share of the error.

    The estimate assigns the error of the nearest point to each candidate. The selected candidate takes over the weight
    of all candidates that are nearer to it than to a point. This weight is at most the weight of a drawn point. Only
    candidates between two points are considered: beyond the outermost points, errors grow outwards, but weights are
    small. Return None if there is no such candidate, for example for germs of few values.
    """
    candidates, known = (_levels(germs, among) for germs in (among.germs, points.germs))
    apart = np.linalg.norm(candidates[:, None] - known, axis=2)
    nearest, distance = apart.argmin(axis=1), apart.min(axis=1)
    own = np.bincount(nearest, among.weights, len(points))
    # each candidate represents a part of the weight of its nearest point
    represented = among.weights * (points.weights / np.maximum(own, 1e-300))[nearest]
    closer = np.linalg.norm(candidates[:, None] - candidates, axis=2) < distance
    gained = closer @ represented
    most = np.minimum(1.0, among.weights / np.maximum(gained, 1e-300))
    error = (shares / np.maximum(points.weights, 1e-300))[nearest]
    score = error * most * gained * _between(candidates, known, nearest)
    chosen = int(score.argmax())
    if not score[chosen] > 0:
        return None
    part = most[chosen] * np.bincount(nearest, represented * closer[chosen], len(points))
    germs = np.concatenate([points.germs, among.germs[[chosen]]])
    return uqmbd.extend.VerificationPoints(germs, np.append(points.weights - part, part.sum()))


def _between(candidates: Array, known: Array, nearest: Index) -> Mask:
    """Return whether candidates (K, d) are between their nearest point and another one of similar distance."""
    first = known[nearest] - candidates
    others = known - candidates[:, None]
    sizes, distance = np.linalg.norm(others, axis=2), np.linalg.norm(first, axis=1)[:, None]
    opposite = np.einsum("kd,kvd->kv", first, others) <= -OPPOSITE * sizes * distance
    return np.asarray((opposite & (sizes <= SIMILAR * distance)).any(axis=1))


def _levels(germs: Array, among: uqmbd.extend.VerificationPoints) -> Array:
    """Return the cumulative probability (K, d) of each germ of points (K, d), from weighted candidates."""
    found = np.empty(germs.shape)
    for k in range(germs.shape[1]):
        order = np.argsort(among.germs[:, k], kind="stable")
        below = np.cumsum(among.weights[order]) / among.weights.sum()
        found[:, k] = np.interp(germs[:, k], among.germs[order, k], below)
    return found
