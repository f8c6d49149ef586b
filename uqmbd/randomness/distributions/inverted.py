"""Quantiles of scipy's distributions that have a formula for the density but none for the quantiles.

scipy computes each such quantile by Brent's method. A surrogate needs a table of 6,601 quantiles; Brent's method took
3 to 60 s for it, and failed in the tails of ``norminvgauss``. Integrating the density takes 0.1 s. UNU.RAN
(`scipy.stats.sampling.NumericalInversePolynomial`) is as fast, but its errors are relative to the total probability.
For ``norminvgauss``, the probability is wrong by 0.1 % at the quantile of 1e-12, and by 5 % at the quantile of 1e-14.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["ACCURACY", "Inverted", "invert_distribution"]


ACCURACY = 1e-10
"""Error of probabilities, measured by the distribution function of scipy, above which a table is not used."""

POINTS = 20
"""Number of nodes of the Gauss-Legendre rule on each panel."""

SPARED = 1e-13
"""Relative size of the last coefficients up to which the density on a panel counts as a polynomial."""

SMALLEST = 1e-40
"""Probability beyond which tails are cut."""

MOST = 1500
"""Largest number of panels; more indicate a noisy density, which is itself a numerical integral."""

STEPS = 60
"""Number of steps of Newton's method or bisection."""

PROBE = np.array([1e-12, 1e-6, 1e-3, 0.05, 0.25, 0.5, 0.75, 0.95, 0.999, 1 - 1e-6])
"""Probabilities at which a table is compared with the distribution function."""


@dataclass(frozen=True, eq=False)
class Inverted:
    """Piecewise polynomial integral of a density on panels, summed from both ends."""

    edges: Array  # (n + 1,) edges of the panels
    series: Array  # (n, 21) Legendre coefficients of the integral from the left edge of each panel
    below: Array  # (n + 1,) probability below each edge, with a small relative error
    above: Array  # (n + 1,) probability above each edge, with a small relative error

    def quantile(self, u: Array) -> Array:
        """Return quantiles; for probabilities in the cut tails, return the outermost edges."""
        lower = u < 0.5
        return self._solved(np.where(lower, u, 1 - u), lower)

    def _solved(self, probability: Array, lower: NDArray[np.bool_]) -> Array:
        """Return points by Newton's method in brackets, from probabilities below (if `lower`) or above the points."""
        last = len(self.series)
        left = np.searchsorted(self.below, probability, side="right") - 1
        right = last - np.searchsorted(self.above[::-1], probability, side="right")
        panel = np.clip(np.where(lower, left, right), 0, last - 1)
        missing = np.where(lower, probability - self.below[panel], self.above[panel] - probability)
        series, width = self.series[panel].T, (self.edges[1:] - self.edges[:-1])[panel]
        slope = np.polynomial.legendre.legder(series)
        low, high, at = np.full(probability.shape, -1.0), np.full(probability.shape, 1.0), np.zeros(probability.shape)
        for _ in range(STEPS):  # as many steps for each point, so that no value depends on others
            value = np.polynomial.legendre.legval(at, series, tensor=False) - missing
            low, high = np.where(value < 0, at, low), np.where(value < 0, high, at)
            with np.errstate(all="ignore"):
                newton = at - value / np.polynomial.legendre.legval(at, slope, tensor=False)
            at = np.where((newton > low) & (newton < high), newton, (low + high) / 2)
        found: Array = np.clip(self.edges[panel] + width * (1 + at) / 2, self.edges[0], self.edges[-1])
        return found


def invert_distribution(
    density: Callable[[Array], Array], cdf: Callable[[Array], Array], support: tuple[float, float], quartiles: Array
) -> Inverted | None:
    """Return a table of the quantiles of a distribution.

    The result is None if the integral of the density is less accurate than `ACCURACY`. Panels start at the quartiles
    (3,), double in width outwards, and are bisected until the density is a polynomial on each panel. The table is
    compared with the distribution function at probabilities from 1e-12 to 1 - 1e-6. `density` and `cdf` map arrays
    (N,); the ends of the support may be infinite.

    >>> import scipy.stats
    >>> normal = scipy.stats.norm()
    >>> table = invert_distribution(normal.pdf, normal.cdf, normal.support(), normal.ppf([0.25, 0.5, 0.75]))
    >>> u = np.array([1e-30, 1e-9, 0.3, 0.5, 1 - 1e-12])
    >>> bool(np.abs(table.quantile(u) - normal.ppf(u)).max() < 1e-12)
    True
    """
    points, rule = (np.asarray(x, dtype=float) for x in np.polynomial.legendre.leggauss(POINTS))
    analysis = np.polynomial.legendre.legvander(points, POINTS - 1) * rule[:, None] * (np.arange(POINTS) + 0.5)
    edges = _edges(density, support, quartiles)
    if edges is None:
        return None
    left, right = edges[:-1], edges[1:]
    found: list[tuple[Array, Array, Array]] = []
    for _ in range(60):
        middle: Array = (left + right) / 2
        half: Array = (right - left) / 2
        x = middle[:, None] + half[:, None] * points
        values = density(x.ravel()).reshape(x.shape)
        if not np.isfinite(values).all() or (values < 0).any():
            return None
        spectrum = values @ analysis
        size = np.abs(spectrum)
        rough = (size[:, -4:].max(axis=1) > SPARED * size.max(axis=1)) & (size.max(axis=1) * half > SMALLEST)
        rough &= half > 4e-16 * np.maximum(np.abs(left), np.abs(right))
        rough &= (size[:, -4:].max(axis=1) * half > 1e-18) | (half > 1e-3 * (quartiles[2] - quartiles[0]))
        found.append((left[~rough], right[~rough], spectrum[~rough] * half[~rough, None]))
        left, middle, right = left[rough], middle[rough], right[rough]
        if not len(left):
            break
        if len(left) + sum(len(part[0]) for part in found) > MOST:
            return None
        left, right = np.r_[left, middle], np.r_[middle, right]
    starts, ends, spectra = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(starts)
    starts, ends, spectra = starts[order], ends[order], spectra[order]
    series = np.polynomial.legendre.legint(spectra, lbnd=-1, axis=1)
    masses = 2 * spectra[:, 0]
    below, above = np.r_[0.0, np.cumsum(masses)], np.r_[np.cumsum(masses[::-1])[::-1], 0.0]
    table = Inverted(np.r_[starts, ends[-1:]], series, below, above)
    if not abs(below[-1] - 1) < ACCURACY:
        return None
    with np.errstate(all="ignore"):
        error = np.abs(cdf(table.quantile(PROBE)) - PROBE).max()
    return table if error < ACCURACY else None


def _edges(density: Callable[[Array], Array], support: tuple[float, float], quartiles: Array) -> Array | None:
    """Return edges of panels, which widen outwards and narrow towards a finite end of the support."""
    low, high = float(quartiles[0]), float(quartiles[2])
    spread = high - low
    if not 0 < spread < np.inf:
        return None
    parts: list[Array] = [np.asarray(np.linspace(low, high, 5), dtype=float)]
    for start, end, sign in ((low, support[0], -1.0), (high, support[1], 1.0)):
        if np.isfinite(end):
            steps: Array = start + (end - start) * (1 - np.exp2(-np.arange(1.0, 60.0)))
            parts += [steps[np.abs(end - steps) > 1e-15 * max(abs(end), spread)], np.array([end])]
            continue
        reach: Array = spread * np.exp2(np.arange(-1.0, 1000.0))
        with np.errstate(all="ignore"):  # some squares of large distances are infinite
            values = density(start + sign * reach) * reach
        small = np.flatnonzero(~(values > SMALLEST))
        if not len(small):
            return None
        parts.append(start + sign * reach[: small[0] + 1])
    edges = np.unique(np.concatenate(parts))
    return edges[np.r_[True, np.diff(edges) > 0]]
