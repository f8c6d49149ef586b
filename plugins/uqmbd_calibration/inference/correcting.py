"""Correction of a surrogate by realisations of the mechanism in the region of the posterior.

The prediction is the surrogate over the prior, or zero, plus a polynomial fit to realisations near the posterior.
Leave-one-out errors of these realisations select the base and the degree of the polynomial.
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
"""Least number of realisations for each polynomial term, for the degrees 0 to 3. Cubic polynomials need more, because
they have large errors far from realisations."""

EXACT = 1e-3
"""Squared error of the log-likelihood below which no further improvement is sought."""


@dataclass(frozen=True, eq=False)
class CorrectedPredictions:
    """Predictions for the records of a machine: a base surrogate plus a polynomial about a centre."""

    base: Predictor | None  # the surrogate over the prior
    free: Index  # indices of the unknown inputs
    # centre, scale: (f,) and (f, f); local coordinates are ``scale @ (normals - centre)``
    centre: Array
    scale: Array
    terms: Index  # (P, f): degrees of the polynomial terms
    coefficients: Array  # (P, N): concatenated for all blocks
    splits: Index  # first columns of the second and later blocks
    # (K, N): leave-one-out errors of realisations, with weights such that their products sum to a covariance
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
    """Fit a correction of a base surrogate to realisations.

    `base`: predictions over the prior; `points` (K, d): standard normal variables of realisations; `values`: responses
    (K, n) of each block, NaN for a failed realisation; `free` (f,): indices of the unknown inputs; `centre` (f,) and
    `scale` (f, f): local coordinates ``scale @ (normals - centre)``, about standard normal in the posterior;
    `measure`: function that converts errors (K, N) of all blocks to one error (K,) of each realisation.
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
    # the weight function is wider than the posterior density; if no realisation is near, the nearest ones count most
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
            # prefer the simpler correction unless the other has a clearly smaller error
            if best is None or (score < 0.8 * best[0] and best[0] > EXACT):
                best = score, found
    assert best is not None
    return best[1]


def tangent(
    base: Predictor, point: Array, values: Sequence[Array], free: Index, centre: Array, scale: Array
) -> CorrectedPredictions:
    """Correct a base surrogate, so that it has given values at a point and given slopes along each unknown input.

    `base`: predictions over the prior; `point` (d,): standard normal variables; `values`: responses (1 + f, n) of each
    block, at the point and with each unknown input moved by one local coordinate; `free` (f,): indices of the unknown
    inputs; `centre` (f,) and `scale` (f, f): unknown inputs at the point, and diagonal scale of local coordinates.
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
    """Return the number of realisations that a polynomial fit needs."""
    return int(np.ceil(OVER[degree] * len(uqmbd.extend.index_set(inputs, degree, "total")))) + 2


def _fitted(basis: Array, target: Array, weights: Array) -> tuple[Array, Array]:
    """Return weighted least-squares coefficients (P, N) and leave-one-out errors (K, N)."""
    q, r = np.linalg.qr(basis * weights[:, None])
    coefficients = np.linalg.lstsq(basis * weights[:, None], target * weights[:, None], rcond=1e-10)[0]
    leverage = np.minimum((q**2).sum(axis=1), 1.0 - 1e-6)
    return np.asarray(coefficients), np.asarray((target - basis @ coefficients) / (1.0 - leverage)[:, None])


def _basis(local: Array, terms: Index) -> Array:
    """Return Hermite polynomials (K, P) of local coordinates (K, f)."""
    highest = int(terms.max(initial=0))
    values = np.ones((len(local), len(terms)))
    for k in range(terms.shape[1]):
        one = np.polynomial.hermite_e.hermevander(local[:, k], highest)
        values *= one[:, terms[:, k]]
    return values
