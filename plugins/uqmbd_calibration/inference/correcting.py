"""A surrogate that real realisations correct where the posterior is.

The surrogate over the prior, or nothing, plus a polynomial through realisations about the posterior.  Which of them,
and of which degree, is chosen by the errors that are left where one realisation is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.posterior import Predictor

__all__ = ["CorrectedPredictions", "corrected", "enough", "tangent"]


OVER = (1.4, 1.4, 1.4, 2.5)
"""Realisations for each term, at least, by the degree of the polynomials: cubic ones go astray where none is near."""

EXACT = 1e-3
"""Square of the error of the log-likelihood below which nothing is gained."""


@dataclass(frozen=True, eq=False)
class CorrectedPredictions:
    """Predictions of a case: a base, and a polynomial about a centre."""

    base: Predictor | None  # the surrogate over the prior
    free: Index  # which inputs are unknown
    # centre, scale: (f,) and (f, f), local coordinates are ``scale @ (normals - centre)``
    centre: Array
    scale: Array
    terms: Index  # (P, f): degrees
    coefficients: Array  # (P, N): of all blocks, one after another
    splits: Index  # where blocks begin, but the first
    # (K, N): of realisations where they are left out, weighted so that their products sum to a covariance
    errors: Array

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return int(self.terms.sum(axis=1).max())

    def __call__(self, normals: Array) -> list[Array]:
        """Return predictions (K, n) of each block."""
        local = (normals[:, self.free] - self.centre) @ self.scale.T
        found = np.split(_basis(local, self.terms) @ self.coefficients, self.splits, axis=1)
        if self.base is None:
            return found
        return [a + b for a, b in zip(self.base(normals), found, strict=True)]


def corrected(
    base: Predictor,
    points: Array,
    values: Sequence[Array],
    free: Index,
    centre: Array,
    scale: Array,
    measure: Callable[[Array], Array],
) -> CorrectedPredictions:
    """Fit a correction.

    `base`: predictions over the prior; `points` (K, d): standard normal variables of realisations; `values` (K, n):
    what they gave, for each block; NaN where one failed; `free`: which inputs are unknown; `centre`, `scale` (f,) and
    (f, f): of the posterior: ``scale @ (normals - centre)`` is about standard normal; `measure`: from errors (K, N)
    of all blocks to how much each matters (K,).
    """
    real = np.concatenate(list(values), axis=1)
    local = (points[:, free] - centre) @ scale.T
    distance = np.sqrt((local**2).sum(axis=1))
    fine = np.isfinite(real).all(axis=1)
    reach = 2.0 * np.sqrt(len(free)) + 2.0
    near = np.flatnonzero(fine & (distance <= reach))
    if len(near) < (wanted := enough(len(free))):
        near = np.flatnonzero(fine)[np.argsort(distance[fine], kind="stable")[:wanted]]
    splits = np.cumsum([v.shape[1] for v in values])[:-1]
    predicted = np.concatenate(base(points[near]), axis=1)
    usable = bool(np.isfinite(predicted).all())
    # as dense as the posterior, with tails; where none is near the nearest ones count
    weights = np.exp(-0.25 * (distance[near] ** 2 - np.min(distance[near]) ** 2)) + 0.02
    best: tuple[float, CorrectedPredictions] | None = None
    for degree, over in enumerate(OVER):
        terms = uqmbd.extend.index_set(len(free), degree, "total")
        if degree and len(near) < over * len(terms) + 1:
            break
        for own in (None, base) if usable else (None,):
            if own is None and degree < 1 and usable:
                continue
            target = real[near] - (predicted if own is not None else 0.0)
            coefficients, left = _fitted(_basis(local[near], terms), target, np.sqrt(weights))
            scaled = left * np.sqrt(weights / weights.sum())[:, None]
            found = CorrectedPredictions(own, free, centre, scale, terms, coefficients, splits, scaled)
            score = float(np.average(measure(left), weights=weights)) if len(near) > 1 else 0.0
            # a simpler one is taken unless the other is clearly better
            if best is None or (score < 0.8 * best[0] and best[0] > EXACT):
                best = score, found
    assert best is not None
    return best[1]


def tangent(
    base: Predictor, point: Array, values: Sequence[Array], free: Index, centre: Array, scale: Array
) -> CorrectedPredictions:
    """Correct a base so that it has given values at a point, and given differences along each free input.

    `base`: predictions over the prior; `point` (d,): standard normal variables; `values` (1 + f, n): of each block:
    at the point, and with each free input moved by one local coordinate; `free` (f,): which inputs are unknown;
    `centre`, `scale` (f,) and (f, f): the point's free inputs, and the diagonal scale of local coordinates.
    """
    points = np.repeat(point[None], len(free) + 1, axis=0)
    points[np.arange(1, len(free) + 1), free] += 1.0 / np.diag(scale)
    real = np.concatenate(list(values), axis=1)
    predicted = np.concatenate(base(points), axis=1)
    own = base if bool(np.isfinite(predicted).all()) else None
    left = real - (predicted if own is not None else 0.0)
    terms = uqmbd.extend.index_set(len(free), 1, "total")
    coefficients = np.zeros((len(terms), real.shape[1]))
    coefficients[terms.sum(axis=1) == 0] = left[:1]
    for k in range(len(free)):
        coefficients[terms[:, k] == 1] = left[1 + k] - left[0]
    splits = np.cumsum([v.shape[1] for v in values])[:-1]
    return CorrectedPredictions(own, free, centre, scale, terms, coefficients, splits, np.zeros((0, real.shape[1])))


def enough(inputs: int, degree: int = 2) -> int:
    """Return how many realisations a polynomial takes."""
    return int(np.ceil(OVER[degree] * len(uqmbd.extend.index_set(inputs, degree, "total")))) + 2


def _fitted(basis: Array, target: Array, weights: Array) -> tuple[Array, Array]:
    """Return coefficients (P, N) of weighted least squares, and the errors (K, N) at rows that are left out."""
    q, r = np.linalg.qr(basis * weights[:, None])
    coefficients = np.linalg.lstsq(basis * weights[:, None], target * weights[:, None], rcond=1e-10)[0]
    leverage = np.minimum((q**2).sum(axis=1), 1.0 - 1e-6)
    return np.asarray(coefficients), np.asarray((target - basis @ coefficients) / (1.0 - leverage)[:, None])


def _basis(local: Array, terms: Index) -> Array:
    """Return Hermite polynomials of local coordinates (K, P)."""
    highest = int(terms.max(initial=0))
    values = np.ones((len(local), len(terms)))
    for k in range(terms.shape[1]):
        one = np.polynomial.hermite_e.hermevander(local[:, k], highest)
        values *= one[:, terms[:, k]]
    return values
