"""Germs conditional on an interval, with orthonormal polynomials and Gauss rules."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.special
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.randomness.germs.germ import STORED, Germ
from uqmbd.randomness.germs.quantile_tables import KNOTS, interpolate, invert
from uqmbd.randomness.germs.recurrences import recurrence
from uqmbd.randomness.germs.stieltjes import COUNT, lanczos
from uqmbd.typing import Array

__all__ = ["TruncatedGerm", "cumulated", "median", "truncate_germ"]


POINTS = 24
"""Number of nodes of the Gauss rule on each panel of a density."""

FAR = 26.0
"""Standard normal variable at which the density times a polynomial of degree 80 is below rounding."""

SMALLEST = 1e-12
"""Probability of an interval up to which the interval is rejected as empty."""


@dataclass(frozen=True, eq=False)
class TruncatedGerm(Germ):
    """Germ conditional on an interval (its ``bounds``), in the coordinate of the whole germ.

    :func:`truncate_germ` constructs it.
    """

    parent: Germ | None = None  # the whole germ
    ends: tuple[float, float] = (0.0, 1.0)  # cumulative probabilities of `parent` at the ends of the interval

    def from_uniform(self, u: ArrayLike) -> Array:
        """Map uniform numbers, of any shape, into the interval by the conditional quantile function."""
        assert self.parent is not None
        low, high = self.ends
        whole = self.parent.from_uniform(low + (high - low) * np.asarray(u, dtype=float))
        return np.asarray(np.clip(whole, *self.bounds))


def cumulated(germ: Germ, x: ArrayLike) -> Array:
    """Return the distribution function of a germ at points of any shape."""
    points = np.asarray(x, dtype=float)
    inside = np.clip(points, *germ.bounds)
    if isinstance(germ, TruncatedGerm):
        assert germ.parent is not None
        low, high = germ.ends
        return np.asarray((cumulated(germ.parent, inside) - low) / (high - low))
    found: Array
    if germ.family == "hermite":
        found = scipy.special.ndtr(inside)
    elif germ.family == "legendre":
        found = (inside + 1) / 2
    elif germ.family == "jacobi":
        found = scipy.special.betainc(*germ.parameters, (inside + 1) / 2)
    elif germ.family == "laguerre":
        found = scipy.special.gammainc(*germ.parameters, inside)
    elif germ.table is None:
        raise StudyError(
            f"The quantile function of {germ.name!r} was not stored. Build the GermSpace from the study again."
        )
    elif germ.family == "discrete":
        below = np.searchsorted(germ.table[1], points, side="right")
        found = np.r_[0.0, germ.table[0]][below]
    else:
        where = invert(germ.table, np.clip(inside, germ.table[1, 0], germ.table[1, -1]))
        found = scipy.special.ndtr(where)
    if germ.family != "discrete":
        found = np.where(points <= germ.bounds[0], 0.0, np.where(points >= germ.bounds[1], 1.0, found))
    return np.asarray(found, dtype=float)


def truncate_germ(germ: Germ, lower: float, upper: float) -> Germ:
    """Return `germ` conditional on an interval. `germ` itself must not be truncated.

    Infinite ends and ends of the support impose no condition. The coordinate of the germ is unchanged, so that maps to
    inputs remain valid. A uniform germ keeps Legendre polynomials, in closed form. The Lanczos process computes
    polynomials of other germs from a quadrature of the density, or of the quantile function if no density is known. See
    Wan and Karniadakis, SIAM Journal on Scientific Computing 28 (2006) 901-928. A discrete germ keeps values above
    `lower` and up to and including `upper`. Raise StudyError if the interval is empty, or too improbable for any
    computation.
    """
    low, high = max(float(lower), germ.bounds[0]), min(float(upper), germ.bounds[1])
    if germ.family == "discrete":
        return _values_between(germ, float(lower), float(upper))
    if (low, high) == tuple(germ.bounds):
        return germ
    ends = (float(cumulated(germ, low)), float(cumulated(germ, high)))
    if not low < high or not ends[1] - ends[0] > SMALLEST:
        raise StudyError(
            f"The interval from {lower:g} to {upper:g} of the germ {germ.name!r} has the probability "
            f"{max(ends[1] - ends[0], 0.0):.3g}; expected more than {SMALLEST:g}."
        )
    alpha, beta = _recurrence(germ.family, germ.parameters, _key(germ), low, high)
    return TruncatedGerm(germ.name, "truncated", alpha, beta, (), (low, high), None, germ, ends)


def _key(germ: Germ) -> bytes:
    """Return the key of a tabulated distribution; empty for distributions with a formula."""
    return b"" if germ.table is None else germ.table.tobytes()


@lru_cache(maxsize=4096)
def _recurrence(
    family: str, parameters: tuple[float, ...], table: bytes, low: float, high: float
) -> tuple[Array, Array]:
    """Return the recurrence coefficients on an interval; cached, because elements share intervals."""
    if family == "legendre":
        alpha, beta = recurrence("legendre", (), STORED)
        shift, scale = (low + high) / 2, (high - low) / 2
    else:
        if table:
            nodes, weights = _by_quantiles(np.frombuffer(table).reshape(2, -1), low, high)
        else:
            nodes, weights = _by_density(family, parameters, low, high)
        shift = float(weights @ nodes / weights.sum())
        scale = float(np.sqrt(weights @ (nodes - shift) ** 2 / weights.sum()))
        alpha, beta = lanczos((nodes - shift) / scale, weights, COUNT)
    # from the standardised variable to the coordinate of the germ
    beta = scale**2 * beta
    beta[0] = 1.0
    alpha = shift + scale * alpha
    for array in (alpha, beta):
        array.setflags(write=False)
    return alpha, beta


def _by_density(family: str, parameters: tuple[float, ...], low: float, high: float) -> tuple[Array, Array]:
    """Return nodes and weights that integrate polynomials over an interval with the density of a family."""
    if family == "hermite":
        edges = np.arange(max(low, -FAR), min(high, FAR), 0.75)
        nodes, weights = _panels(np.r_[edges, min(high, FAR)])
        nearest = np.abs(nodes).min()
        return nodes, weights * np.exp(-(nodes**2 - nearest**2) / 2)
    if family == "laguerre":
        (shape,) = parameters
        high = min(high, max(low, shape + 2 * COUNT) * 1.5 + 250.0)
        return _with_ends(low, high, (0.0, np.inf), (shape - 1, 0.0), lambda x: np.exp(-(x - low)), 3.0)
    a, b = parameters
    return _with_ends(low, high, (-1.0, 1.0), (a - 1, b - 1), np.ones_like, 0.25)


def _with_ends(
    low: float, high: float, singular: tuple[float, float], powers: tuple[float, float], smooth: object, width: float
) -> tuple[Array, Array]:
    """Return a rule for ``(x - s0)^p0 (s1 - x)^p1 smooth(x)``: Gauss-Jacobi at singular ends, else growing panels."""
    assert callable(smooth)
    edges = [low, high]
    for side, point in enumerate(singular):
        if not np.isfinite(point):
            continue
        # panels are at most as long as their distance to the singularity
        distance = max((low, high)[side] - point, 0.0) if side == 0 else max(point - (low, high)[side], 0.0)
        step = distance or (high - low) / 4
        at = step + distance if not distance else distance
        while at < high - low + distance:
            edges.append(point + at if side == 0 else point - at)
            at *= 2
    inner = np.unique(np.clip(edges, low, high))
    inner = np.unique(
        np.concatenate(
            [np.linspace(x, y, int(np.ceil((y - x) / width)) + 1) for x, y in zip(inner, inner[1:], strict=False)]
        )
    )
    inner = inner[np.r_[True, np.diff(inner) > 1e-13 * (high - low)]]
    inner[-1] = high
    nodes, weights = [], []
    for k, (x, y) in enumerate(zip(inner, inner[1:], strict=False)):
        at_low = powers[0] if x == singular[0] and k == 0 else 0.0
        at_high = powers[1] if y == singular[1] and k == len(inner) - 2 else 0.0
        points, rule = scipy.special.roots_jacobi(POINTS, at_high, at_low)
        where, half = (x + y) / 2 + (y - x) / 2 * points, (y - x) / 2
        weight = rule * half ** (1 + at_low + at_high) * smooth(where)
        for (point, power), own in zip(zip(singular, powers, strict=True), (at_low, at_high), strict=True):
            if power and not own and np.isfinite(point):
                weight = weight * np.abs(where - point) ** power
        nodes.append(where)
        weights.append(weight)
    return np.concatenate(nodes), np.concatenate(weights)


def _by_quantiles(table: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return nodes and weights from a tabulated quantile function.

    The rule integrates with the distribution of samples that are drawn from the table.
    """
    inside = np.clip([low, high], table[1, 0], table[1, -1])
    start, stop = (float(z) for z in invert(table, inside))
    start, stop = (
        start if np.isfinite(low) and low > table[1, 0] else KNOTS[0],
        stop if np.isfinite(high) and high < table[1, -1] else KNOTS[-1],
    )
    nodes, weights = _panels(np.linspace(start, stop, max(8, int(np.ceil((stop - start) / 0.1))) + 1))
    nearest = np.abs(nodes).min()
    values = np.clip(interpolate(table, nodes), low, high)
    return values, weights * np.exp(-(nodes**2 - nearest**2) / 2)


def _panels(edges: Array) -> tuple[Array, Array]:
    points, rule = np.polynomial.legendre.leggauss(POINTS)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    return (middle[:, None] + half[:, None] * points).ravel(), (half[:, None] * rule).ravel()


def _values_between(germ: Germ, lower: float, upper: float) -> Germ:
    assert germ.table is not None
    steps, values = germ.table
    # an interval from the lower end of the support includes this end
    kept = ((values > lower) | (lower <= values[0])) & (values <= upper)
    if kept.all():
        return germ
    if not kept.any():
        raise StudyError(f"The germ {germ.name!r} takes no value from {lower:g} to {upper:g}.")
    probability = np.diff(np.r_[0.0, steps])[kept]
    probability = probability / probability.sum()
    alpha, beta = lanczos(values[kept], probability, min(int(kept.sum()), COUNT))
    table = np.array([np.cumsum(probability), values[kept]])
    return Germ(germ.name, "discrete", alpha, beta, (), (float(values[kept][0]), float(values[kept][-1])), table)


def median(germ: Germ) -> float:
    """Return the median of a germ; for a discrete germ, a point between two values."""
    if germ.family == "discrete" and germ.table is not None:
        steps, values = germ.table
        k = int(np.clip(np.abs(steps[:-1] - 0.5).argmin(), 0, len(values) - 2))
        return float((values[k] + values[k + 1]) / 2)
    return float(germ.from_uniform(np.array([0.5]))[0])
