"""Common parts of refinements: steps, scales, and the check by verification realisations."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.runs import CollocationRuns

__all__ = [
    "Limits",
    "Refinement",
    "RefinementStep",
    "UnmetWarning",
    "history",
    "missed_share",
    "prospect",
    "scale_of",
    "warn_unmet",
]


WINDOW = 8
"""Steps count from so small a part of the last number of realisations on: earlier ones tell little of what follows."""

SAMPLED = 0.5
"""Power of the number of realisations with which errors of independent samples fall."""


@dataclass(frozen=True)
class Limits:
    """Stopping criteria of a refinement."""

    tolerance: float  # of mean and standard deviation, over the largest standard deviation of each output over time
    most: int  # realisations, verification included
    rtol: float  # relative tolerance of the integration, a lower bound of any achievable tolerance


@dataclass(frozen=True)
class RefinementStep:
    """State of a refinement after one of its steps."""

    realisations: int  # so far
    terms: int  # of the chaos
    change_mean: float
    change_std: float  # as `change_mean` largest over outputs and times, over the largest standard deviation over time
    missed_std: float = np.nan  # of `missed_share`; NaN if it was not computed because the changes were too large

    @property
    def change(self) -> float:
        """The largest of them."""
        return float(np.nanmax([self.change_mean, self.change_std, self.missed_std]))

    def log(self, label: str, limits: Limits) -> None:
        """Log it to ``uqmbd.refinement``."""
        about = (label, self.realisations, self.terms, self.change_mean, self.change_std, self.missed_std)
        text = "%s: %d realisations, %d terms: mean changes by %.2g, deviation by %.2g, missed %.2g; tolerance %.2g"
        logging.getLogger("uqmbd.refinement").info(text, *about, limits.tolerance)


@dataclass(frozen=True)
class Refinement:
    """A fit, its history, and whether the tolerance was met."""

    fit: Fit
    steps: tuple[RefinementStep, ...] = field(default=())
    met: bool = False


def scale_of(runs: CollocationRuns, mean: Array, variance: Array) -> Array:
    """Return the scale of changes of each output, shape (O,), from mean and variance (O, T).

    Sizes that the runs have of their own; else the largest standard deviation over time; where that is below what the
    integration can tell, the relative tolerance times the largest mean.
    """
    if runs.scale is not None:
        return runs.scale
    floor = runs.problem.rtol * np.abs(mean).max(axis=-1) + 1e-300
    return np.asarray(np.maximum(np.sqrt(variance.max(axis=-1)), floor))


def missed_share(
    runs: CollocationRuns, coefficients: Array, multi_index: Index, points: uqmbd.extend.VerificationPoints
) -> float:
    """Return by how much the standard deviation is too small because of the error of the chaos at verification points.

    A surrogate with the root-mean-square error e misses a variance of about e^2. So the standard deviation s is too
    small by e^2 / (2 s). Two steps of a refinement can agree though both miss the same terms (an even function, an
    interaction without main effects); realisations elsewhere reveal it. The value is the largest over the outputs, over
    the largest standard deviation over time; 0 without points.
    """
    known = runs.verification(points)
    if not len(known):
        return 0.0
    surrogate = np.einsum("kp,pot->kot", runs.space.evaluate(known.points.germs, multi_index), coefficients)
    weights = known.points.weights / known.points.weights.sum()
    error = np.tensordot(weights, (surrogate - known.response) ** 2, axes=1)
    scale = scale_of(runs, coefficients[0], np.sum(coefficients[1:] ** 2, axis=0) + error)
    return float((error.max(axis=-1) / (2 * scale**2)).max())


class UnmetWarning(UserWarning):
    """A refinement ended before its tolerance was met."""


def warn_unmet(label: str, limits: Limits, steps: list[RefinementStep], reason: str) -> None:
    """Warn that a refinement ended before its tolerance was met."""
    known = bool(steps) and np.isfinite(steps[-1].change)
    last = f"; mean and standard deviation are settled to {steps[-1].change:.2g} only" if known else ""
    spent = steps[-1].realisations if steps else 0
    if limits.tolerance < 100 * limits.rtol:
        reason += f". So small changes may be errors of the integration (rtol={limits.rtol:g}): try a smaller rtol"
    warnings.warn(
        f"{label}: the tolerance {limits.tolerance:g} was not met with {spent} realisations{last}. Reason: {reason}"
        f"{prospect(steps)}",
        UnmetWarning,
        stacklevel=3,
    )


def prospect(steps: Sequence[RefinementStep]) -> str:
    """Say whether more realisations would help, from how the last changes fell; nothing of few steps.

    >>> prospect([RefinementStep(n, n, 10 / n, 10 / n) for n in (10, 20, 40, 80)])
    '. The changes fell with the power 1.0 of the number of realisations: more realisations help'
    >>> prospect([RefinementStep(n, n, 0.5, 0.5) for n in (10, 20, 40, 80)])[-80:]
    '. The changes do not fall faster than those of samples: use Monte Carlo instead'
    """
    known = [one for one in steps if np.isfinite(one.change) and one.change > 0]
    part = [one for one in known if one.realisations >= known[-1].realisations / WINDOW]
    if len(part) < 3 or part[-1].realisations < 2 * part[0].realisations:
        return ""
    counts, changes = (np.log([getattr(one, name) for one in part]) for name in ("realisations", "change"))
    power = -float(np.polyfit(counts, changes, 1)[0])
    if power > SAMPLED:
        return f". The changes fell with the power {power:.1f} of the number of realisations: more realisations help"
    return ". The changes do not fall faster than those of samples: use Monte Carlo instead"


def history(steps: tuple[RefinementStep, ...]) -> xr.Dataset:
    """Return the dataset `refinement` of a node."""
    note = {"comment": "largest over outputs and times, over the largest standard deviation of the output over time"}
    missed = {"comment": "what the standard deviation lacks by the verification; NaN where it was not asked for"}
    found = {
        "realisations": ("step", np.array([s.realisations for s in steps], dtype=np.int64)),
        "terms": ("step", np.array([s.terms for s in steps], dtype=np.int64)),
        "change_mean": ("step", np.array([s.change_mean for s in steps], dtype=float), note),
        "change_std": ("step", np.array([s.change_std for s in steps], dtype=float), note),
        "missed_std": ("step", np.array([s.missed_std for s in steps], dtype=float), missed),
    }
    return xr.Dataset(found)
