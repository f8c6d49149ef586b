"""Recurrence coefficients of any distribution, from a fine quadrature of the density and the Lanczos process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.special

from uqmbd.randomness.distributions import AffineDistribution
from uqmbd.randomness.germs.quantile_tables import KNOTS
from uqmbd.typing import Array

__all__ = ["COUNT", "Discretised", "discretise", "discretise_quantiles", "lanczos"]


COUNT = 40
"""Number of computed recurrence coefficients, for polynomials up to degree 39 and Gauss rules of up to 40 nodes."""

MOST_PANELS = 3000
"""Largest number of panels that are bisected at once; more indicate a noisy density."""

NARROWEST = 1e-7
"""Half width of a panel, relative to the whole range, below which quantiles replace the Gauss-Legendre nodes."""

POINTS = 20
"""Number of nodes of the Gauss-Legendre rule on each panel."""

QUANTILES: Array = np.r_[
    [1e-12, 1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3], np.arange(1, 64) / 64, 1 - np.array([3e-3, 1e-3, 1e-4, 1e-5]),
    1 - np.array([1e-6, 1e-8, 1e-10, 1e-12]),
]  # fmt: skip
"""Probabilities whose quantiles are edges of panels, so that no interval of probability above 1/64 is missed."""


@dataclass(frozen=True, eq=False)
class Discretised:
    """Recurrence coefficients of the standardised variable ``(x - shift) / scale``, and their accuracy."""

    alpha: Array  # (N,) coefficients of the monic polynomials
    beta: Array  # (N,)
    shift: float
    scale: float
    bounds: tuple[float, float]
    """Support of the standardised variable; infinite if the formula of the density has no bounds."""
    mass: float  # integral of the density, which is 1 except for errors
    change: float  # largest relative change of the coefficients when all panels were halved


def discretise(law: AffineDistribution, count: int = COUNT) -> Discretised:
    """Compute recurrence coefficients of a continuous distribution.

    Gauss-Legendre rules integrate the density. Panels are bisected until the density is a polynomial on each panel. At
    a kink or a singularity, the narrowest panels are integrated with nodes from quantiles. All panels are then halved
    until the coefficients stay constant.
    """
    edges, ends = _panels(law, count)
    inner = np.where(np.isfinite(ends), ends, law.quantile(np.array([1e-6, 1 - 1e-6])))
    nodes, weights, edges = _resolve(law, edges, inner)
    closed = np.isfinite(ends).all()
    total = weights.sum()
    if not abs(total - 1) < 1e-6:  # the formula of the density is wrong, so there is no result
        return Discretised(np.zeros(count), np.ones(count), 0.0, 1.0, (-1.0, 1.0), float(total), np.inf)
    mean = (nodes * weights).sum() / total
    deviation = np.sqrt(((nodes - mean) ** 2 * weights).sum() / total)
    if closed:
        mean, deviation = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
    alpha, beta = lanczos((nodes - mean) / deviation, weights, count)
    change = np.inf
    for _ in range(4):
        edges = _thinned(np.r_[edges, (edges[1:] + edges[:-1]) / 2])
        nodes, weights, edges = _resolve(law, edges, inner)
        finer = lanczos((nodes - mean) / deviation, weights, count)
        before, change = change, float(max(np.abs(finer[0] - alpha).max(), np.abs(finer[1] / beta - 1).max()))
        alpha, beta = finer
        if change < 1e-12 or change > before:
            break
    low, high = ((end - mean) / deviation for end in ends)
    return Discretised(alpha, beta, float(mean), float(deviation), (float(low), float(high)), float(total), change)


def lanczos(nodes: Array, weights: Array, count: int) -> tuple[Array, Array]:
    """Return `count` recurrence coefficients of a discrete measure of nodes and weights (n,), normalised to mass one.

    The Lanczos process with full reorthogonalisation (Gautschi 2004, section 2.2.3) is exact to rounding if `count` is
    at most n.

    >>> alpha, beta = lanczos(np.array([-1.0, 1.0]), np.array([1.0, 1.0]), 2)
    >>> np.abs(alpha).round(12).tolist(), beta.round(12).tolist()
    ([0.0, 0.0], [1.0, 1.0])
    """
    alpha, beta = np.zeros(count), np.ones(count)
    basis = np.empty((count, len(nodes)))
    basis[0] = np.sqrt(weights / weights.sum())
    for k in range(count):
        following = nodes * basis[k]
        alpha[k] = following @ basis[k]
        if k + 1 == count:
            break
        for _ in range(2):
            following = following - basis[: k + 1].T @ (basis[: k + 1] @ following)
        norm = np.sqrt(following @ following)
        beta[k + 1] = norm**2
        basis[k + 1] = following / norm
    return alpha, beta


def discretise_quantiles(law: AffineDistribution, count: int) -> Discretised:
    """Compute recurrence coefficients from quantiles only, for an unknown density; errors are about 1e-6."""
    nodes = law.quantile(scipy.special.ndtr(KNOTS))
    weights = np.exp(-(KNOTS**2) / 2)
    low, high = law.bounds
    shift, scale = (low + high) / 2, (high - low) / 2
    alpha, beta = lanczos((nodes - shift) / scale, weights, count)
    return Discretised(alpha, beta, shift, scale, (-1.0, 1.0), 1.0, 1e-6)


def _panels(law: AffineDistribution, count: int) -> tuple[Array, Array]:
    """Return the edges of panels (N + 1,) and the ends of the support (2,)."""
    low, high = law.bounds
    quantiles = np.unique(np.clip(law.quantile(QUANTILES), low, high))
    spread = float(np.subtract(*law.quantile(np.array([0.75, 0.25]))))
    edges = [quantiles, np.linspace(quantiles[0], quantiles[-1], 33)]
    ends = np.array([low, high])
    for side, (end, sign) in enumerate(((low, -1.0), (high, 1.0))):
        edges.append(np.array([end]))
        if law.formula and _goes_on(law, end, sign, spread):
            ends[side] = sign * np.inf
            edges.append(_beyond(law, end, sign, spread, 2 * count))
    return _thinned(np.concatenate(edges)), ends


def _thinned(edges: Array) -> Array:
    """Sort edges; remove edges that are too near to the previous edge, except the last."""
    ordered = np.unique(edges)
    apart = np.diff(ordered) > NARROWEST * (ordered[-1] - ordered[0])
    kept = ordered[:-1][np.r_[True, apart[:-1]]]
    result: Array = np.r_[kept, ordered[-1]]
    return result


def _goes_on(law: AffineDistribution, end: float, sign: float, spread: float) -> bool:
    """Return whether the density decreases towards a bound at which chaospy truncates it, and is nonzero beyond."""
    at = law.pdf(end + sign * spread * np.array([-0.02, 0.0, 0.02, 0.2]))
    return bool(at[1] * spread < 1e-5 and np.all(np.diff(at) < 0) and at[-1] > 0)


def _beyond(law: AffineDistribution, end: float, sign: float, spread: float, degree: int) -> Array:
    """Return edges from a bound to the point where the density times a power of the distance is negligible."""
    middle = float(law.quantile(np.array([0.5]))[0])
    reach = abs(end - middle)
    distances = reach + np.arange(1, 401) * reach / 16
    with np.errstate(divide="ignore"):
        level = np.log(law.pdf(middle + sign * distances)) + degree * np.log(distances / reach)
        start = np.log(law.pdf(np.array([end])))[0]
    highest = np.maximum.accumulate(np.r_[start, level])[1:]
    over = np.flatnonzero(level < highest - 60)
    return middle + sign * distances[: over[0] + 1 if len(over) else None]


def _resolve(law: AffineDistribution, edges: Array, inner: Array) -> tuple[Array, Array, Array]:
    """Bisect panels until the density is a polynomial on each; return nodes, weights and the edges.

    Beyond `inner`, in unbounded tails, tolerances are relative to the local density, because high powers of the
    distance amplify errors. Between the two ends of `inner`, tolerances are also relative to the total mass.
    """
    points, rule = np.polynomial.legendre.leggauss(POINTS)
    analysis = np.polynomial.legendre.legvander(points, POINTS - 1) * rule[:, None] * (np.arange(POINTS) + 0.5)
    span = edges[-1] - edges[0]
    left, right = edges[:-1], edges[1:]
    nodes, weights, kept = [], [], [edges]
    for _ in range(60):
        middle, half = (left + right) / 2, (right - left) / 2
        x = middle[:, None] + half[:, None] * points
        density = law.pdf(x.ravel()).reshape(x.shape)
        spectrum = np.abs(density @ analysis)
        tail = spectrum[:, -4:].max(axis=1)
        far = (middle < inner[0]) | (middle > inner[1])
        rough = (tail > 1e-13 * spectrum.max(axis=1)) & (far | (tail * half > 3e-17))
        lump = rough & (half < NARROWEST * span)
        done = ~rough | (density.max(axis=1) * half < 1e-300)
        nodes.append(x[done & ~lump].ravel())
        weights.append((half[:, None] * rule * density)[done & ~lump].ravel())
        if lump.any():
            for found, measure in _by_quantiles(law, left[lump], right[lump], points, rule):
                nodes.append(found)
                weights.append(measure)
        again = ~done & ~lump
        left, middle, right = left[again], middle[again], right[again]
        if not len(left) or len(left) > MOST_PANELS:
            break
        kept.append(middle)
        left, right = np.r_[left, middle], np.r_[middle, right]
    x, w = np.concatenate(nodes), np.concatenate(weights)
    order = np.argsort(x)
    positive = w[order] > 0
    return x[order][positive], w[order][positive], np.unique(edges)


def _by_quantiles(
    law: AffineDistribution, left: Array, right: Array, points: Array, rule: Array
) -> Iterator[tuple[Array, Array]]:
    """Yield nodes and weights of panels with a singular density, from the quantiles of a Gauss rule in probability."""
    for low, high in zip(law.cdf(left), law.cdf(right), strict=True):
        if high > low:
            yield law.quantile(low + (high - low) * (points + 1) / 2), (high - low) * rule / 2
