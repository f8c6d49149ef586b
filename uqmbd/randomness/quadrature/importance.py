"""Weighted points, denser in the tails than the inputs, for means of quantities that are large in the tails.

The truncation error of a polynomial chaos of order n begins with polynomials of degree n + 1. The squares of these
polynomials are large in the tails. Few points with the distribution of the inputs do not sample this error. chaospy and
SciPy do not sample such densities; the densities of single polynomials are the induced distributions of the references.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.special

from uqmbd.randomness.designs import sampling_design
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.space import GermSpace
from uqmbd.typing import Array, Index

__all__ = ["TailMixture"]


NOMINAL = 0.5
"""Fraction of the points with the distribution of the inputs; its inverse is the upper bound of the weights."""

DEGREES = (2, 3, 4, 5)
"""Total degrees of the products of polynomials whose squares are the densities of the other points."""

SINGLE = 0.5
"""Fraction of the other points for polynomials of a single germ; the rest is for all products of the same total degree,
which include those of a single germ."""

FARTHEST = 4.0
"""Largest probit at which the density is changed; beyond, at a probability of 6e-5, inputs may be meaningless."""

CELLS = 256
"""Number of intervals in which the density of a continuous germ is constant."""


@dataclass(frozen=True, eq=False)
class _Tilted:
    """Densities of a germ, relative to its own density, that are proportional to squares of its polynomials.

    The densities are constant in cells, so that points and weights match exactly.
    """

    germ: Germ
    edges: Array  # (C + 1,) ends of the cells, as probabilities
    limits: Array  # (C - 1,) inner ends, as values of the germ
    density: Array  # (C, D + 1) by cell and degree; 1 for degrees that the germ does not have

    @classmethod
    def of(cls, germ: Germ) -> _Tilted:
        """Tabulate the densities of a germ."""
        if germ.values is not None and germ.table is not None:
            cumulated, values = germ.table
            edges = np.concatenate([[0.0], cumulated[:-1], [1.0]])
            limits, moved = (values[1:] + values[:-1]) / 2, np.ones(len(values), dtype=bool)
        else:
            inner = scipy.special.ndtr(np.linspace(-FARTHEST, FARTHEST, CELLS + 1))
            edges = np.concatenate([[0.0], inner, [1.0]])
            limits, moved = germ.from_uniform(inner), np.ones(CELLS + 2, dtype=bool)
            moved[[0, -1]] = False
        top, highest = max(DEGREES), germ.highest_degree
        known = top if highest is None else min(top, highest)
        density = np.ones((len(edges) - 1, top + 1))
        middle = germ.from_uniform((edges[1:] + edges[:-1]) / 2)
        density[:, : known + 1] = np.where(moved[:, None], germ.polynomials(middle, known) ** 2, 1.0)
        return cls(germ, edges, limits, density / (np.diff(edges) @ density))

    def drawn(self, uniform: Array, degree: int) -> Array:
        """Map uniform numbers to probabilities at which the germ has the density of a degree."""
        cumulated = np.concatenate([[0.0], np.cumsum(np.diff(self.edges) * self.density[:, degree])])
        return np.interp(uniform, cumulated / cumulated[-1], self.edges)

    def at(self, values: Array) -> Array:
        """Return the densities (K, D + 1) at values of the germ (K,)."""
        return self.density[np.searchsorted(self.limits, values, side="right")]


@dataclass(frozen=True, eq=False)
class TailMixture:
    """Mixture of the distribution of germs with a heavier-tailed one, for independent germs of any distributions.

    Half of the points have the distribution of the germs; this nominal part bounds the weights (Owen and Zhou, Journal
    of the American Statistical Association 95 (2000) 135-143). Densities of the other points, relative to the germs,
    are squares of orthonormal polynomials of the total degrees 2 to 5, in equal parts. Half of these polynomials are of
    a single germ, half are all products of the degree (induced distributions: Narayan, Electronic Transactions on
    Numerical Analysis 50 (2018) 71-97; Cohen and Migliorati, SMAI Journal of Computational Mathematics 3 (2017)
    181-203). For normal germs, the density of all products depends only on the distance from the centre, so that no
    direction is preferred.
    """

    space: GermSpace

    def points(self, count: int, seed: int) -> Array:
        """Return germ points (K, d) of a scrambled Sobol' sequence, whose first coordinate selects the polynomials."""
        dimension = self.space.dimension
        uniform = sampling_design("sobol", "TailMixture").points(dimension + 1, count, seed)
        choice, uniform = uniform[:, 0], uniform[:, 1:].copy()
        draw = np.random.default_rng([seed, 1])
        for row, chosen in zip(uniform, choice, strict=True):
            degrees = self._degrees((chosen - NOMINAL) / (1 - NOMINAL), draw)
            for k in np.flatnonzero(degrees):
                row[k] = self._tilted[k].drawn(row[k], int(degrees[k]))
        return self.space.from_uniform(uniform)

    def weights(self, germs: Array) -> Array:
        """Return the ratio (K,) of the germs' density to the mixture density at points (K, d); its mean is about 1."""
        dimension, top = self.space.dimension, max(DEGREES)
        alone, products = np.zeros((len(germs), top + 1)), np.zeros((len(germs), top + 1))
        products[:, 0] = 1.0
        for k, tilted in enumerate(self._tilted):
            density = tilted.at(germs[:, k])
            alone += density / dimension
            # sums over all products of a degree, one germ after another
            products = np.stack(
                [np.sum(products[:, : m + 1] * density[:, m::-1], axis=1) for m in range(top + 1)], axis=1
            )
        found = np.full(len(germs), NOMINAL)
        for m in DEGREES:
            every = products[:, m] / math.comb(m + dimension - 1, m)
            found += (1 - NOMINAL) / len(DEGREES) * (SINGLE * alone[:, m] + (1 - SINGLE) * every)
        return 1.0 / found

    @cached_property
    def _tilted(self) -> tuple[_Tilted, ...]:
        return tuple(_Tilted.of(germ) for germ in self.space.germs)

    def _degrees(self, chosen: float, draw: np.random.Generator) -> Index:
        """Return the degrees (d,) of the polynomials that a number below 1 selects; zeros for a number below 0."""
        dimension = self.space.dimension
        found = np.zeros(dimension, dtype=np.int64)
        if chosen < 0:
            return found
        kind, within = divmod(chosen * len(DEGREES), 1.0)
        degree = DEGREES[min(int(kind), len(DEGREES) - 1)]
        if within < SINGLE:
            found[min(int(within / SINGLE * dimension), dimension - 1)] = degree
            return found
        # stars and bars: all products are equally likely
        bars = np.sort(draw.choice(degree + dimension - 1, dimension - 1, replace=False))
        return np.diff(np.concatenate([[-1], bars, [degree + dimension - 1]])) - 1
