"""Expected information of a record on the inputs, relative to the prior: Fisher information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.posterior import Posterior
from uqmbd_calibration.inference.searching import spread_over_prior

__all__ = ["Direction", "combination", "directions", "expected_covariance"]


POINTS = 8
"""Points of the prior over which is averaged."""

LITTLE = 0.5
"""Expected variance, over that of the prior, above which a direction counts as unidentified."""

SMALL = 0.15
"""Part of a direction, over its largest, that is not named."""


@dataclass(frozen=True, eq=False)
class Direction:
    """A combination of inputs."""

    name: str  # ``stiffness_1 - stiffness_2``, each over its standard deviation
    weights: Array  # (D,): of the standard normal variables of the inputs, of norm one
    variance: float  # that is left of it, over that of the prior


def expected_covariance(target: Posterior, levels: Array, seed: int) -> Array:
    """Return the covariance (D, D) that is expected of the inputs, over the prior, in its standard deviations.

    `target`: by the surrogate over the prior; `levels` (M,): normal variables of the noise levels.
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
    """Return the combinations that are not identified, those of which least is known first."""
    values, vectors = np.linalg.eigh(covariance)
    found = []
    for k in np.argsort(-values, kind="stable").tolist():
        if values[k] > LITTLE:
            weights = vectors[:, k]
            # the first that is named counts upwards, however the last bits of equal ones fall
            named = np.abs(weights) >= SMALL * np.abs(weights).max()
            weights = weights * np.sign(weights[np.argmax(named)])
            found.append(Direction(combination(weights, names), weights, float(values[k])))
    return tuple(found)


def combination(weights: Array, names: Sequence[str]) -> str:
    """Name a combination of inputs.

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
