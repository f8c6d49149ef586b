"""Expected Fisher information of records on the inputs, relative to the prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.posterior import Posterior
from uqmbd_calibration.inference.searching import spread_over_prior

__all__ = ["Direction", "combination", "directions", "expected_covariance"]


POINTS = 8
"""Number of points of the prior over which the information is averaged."""

LITTLE = 0.5
"""Ratio of expected variance to prior variance above which a direction counts as unidentified."""

SMALL = 0.15
"""An input with a smaller weight than this share of the largest weight is omitted from the name of a direction."""


@dataclass(frozen=True, eq=False)
class Direction:
    """Linear combination of inputs."""

    name: str  # ``stiffness_1 - stiffness_2``, each divided by its standard deviation
    weights: Array  # (D,): of the standard normal variables of the inputs, with norm one
    variance: float  # ratio of the remaining variance to the prior variance


def expected_covariance(target: Posterior, levels: Array, seed: int) -> Array:
    """Return the expected covariance (D, D) of the inputs over the prior, in standard deviations of the prior.

    `target`: posterior by the surrogate over the prior; `levels` (M,): normal variables of the noise levels.
    """
    inputs, unknowns = len(target.unknowns.inputs), target.unknowns
    points = np.zeros((POINTS, unknowns.dimension))
    points[:, :inputs] = np.clip(spread_over_prior(inputs, POINTS, seed), -2.0, 2.0)
    points[:, unknowns.first_level :] = levels
    hessian = target.linearised(points, expected=True).hessian
    fine = np.isfinite(hessian).all(axis=(1, 2))
    covariance = np.linalg.inv(hessian[fine])[:, :inputs, :inputs]
    return np.asarray(covariance.mean(axis=0)) if len(covariance) else np.eye(inputs)


def directions(covariance: Array, names: Sequence[str]) -> tuple[Direction, ...]:
    """Return the unidentified combinations of inputs, largest remaining variance first."""
    values, vectors = np.linalg.eigh(covariance)
    found = []
    for k in np.argsort(-values, kind="stable").tolist():
        if values[k] > LITTLE:
            weights = vectors[:, k]
            # the first named input has a positive sign, so that rounding does not decide between equal weights
            named = np.abs(weights) >= SMALL * np.abs(weights).max()
            weights = weights * np.sign(weights[np.argmax(named)])
            found.append(Direction(combination(weights, names), weights, float(values[k])))
    return tuple(found)


def combination(weights: Array, names: Sequence[str]) -> str:
    """Return the name of a combination of inputs.

    >>> combination(np.array([0.70710678, -0.70710678, 0.001]), ["k1", "k2", "m"])
    '0.71 k1 - 0.71 k2'
    >>> combination(np.array([0.01, 1.0, 0.0]), ["k1", "k2", "m"])
    'k2'
    """
    large = np.flatnonzero(np.abs(weights) >= SMALL * np.abs(weights).max())
    if len(large) == 1:
        return names[int(large[0])]
    text = ""
    for k in large.tolist():
        sign = "-" if weights[k] < 0 else "+"
        text += f" {sign} {abs(weights[k]):.2f} {names[k]}"
    return text.removeprefix(" + ").lstrip()
