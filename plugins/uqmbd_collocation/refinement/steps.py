"""Common parts of refinements: steps, scales, and the check by verification realisations."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

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
"""The extrapolation uses steps with at least this fraction, 1 / WINDOW, of the realisations of the last step."""

NOISE = 100.0
"""Changes below this multiple of the relative tolerance of the integration may be integration errors."""

SAMPLED = 0.5
"""Convergence rate of independent samples: errors are proportional to their number to the power -SAMPLED."""


@dataclass(frozen=True)
class Limits:
    """Stopping criteria of a refinement."""

    # largest change of mean and standard deviation, relative to the largest standard deviation of each output over time
    tolerance: float
    most: int  # largest number of realisations, including verification
    rtol: float  # relative tolerance of the integration, a lower bound of any achievable tolerance
    reserved: int = 0  # number of realisations for verification after the refinement
    # root mean square error at the verification points that ends the refinement, relative to the largest standard
    # deviation of each output over time; None: the tolerance ends it
    error: float | None = None


@dataclass(frozen=True)
class RefinementStep:
    """State of a refinement after a step."""

    realisations: int  # total number so far
    terms: int  # number of terms of the chaos
    change_mean: float
    # both changes: largest over outputs and times, divided by the largest standard deviation over time
    change_std: float
    missed_std: float = np.nan  # result of `missed_share`; NaN if it was not computed

    @property
    def settled(self) -> float:
        """Larger one of the changes of mean and standard deviation."""
        return float(np.nanmax([self.change_mean, self.change_std]))

    @property
    def error(self) -> float:
        """Root mean square error at the verification points, relative to the largest standard deviation over time."""
        share = 2 * self.missed_std  # of the sum of variance and mean square error
        return float(np.sqrt(share / (1 - share))) if not share >= 1 else np.inf

    @property
    def change(self) -> float:
        """Largest one of both changes and of the missed part of the standard deviation."""
        return float(np.nanmax([self.change_mean, self.change_std, self.missed_std]))

    def log(self, label: str, limits: Limits) -> None:
        """Write the step to the log ``uqmbd.refinement``."""
        about = (label, self.realisations, self.terms, self.change_mean, self.change_std, self.missed_std)
        text = "%s: %d realisations, %d terms: mean changed by %.2g, standard deviation by %.2g; missing %.2g; %s %.2g"
        limit = ("tolerance", limits.tolerance) if limits.error is None else ("max_error", limits.error)
        logging.getLogger("uqmbd.refinement").info(text, *about, *limit)

    def met(self, limits: Limits, *, settled: bool) -> bool:
        """Return whether the limits are met; `settled`: whether mean and standard deviation have converged."""
        if limits.error is not None:
            return self.error <= limits.error
        return settled and self.missed_std < limits.tolerance


@dataclass(frozen=True)
class Refinement:
    """Fit, its history, and whether the tolerance was met."""

    fit: Fit
    steps: tuple[RefinementStep, ...] = field(default=())
    met: bool = False


def scale_of(runs: CollocationRuns, mean: Array, variance: Array) -> Array:
    """Return the scale of changes of each output, shape (O,), from mean and variance (O, T).

    The scale is the scale of the runs if they have one, otherwise the largest standard deviation over time. The scale
    is at least the integration error: the relative tolerance times the largest mean.
    """
    if runs.scale is not None:
        return runs.scale
    floor = runs.problem.rtol * np.abs(mean).max(axis=-1) + 1e-300
    return np.asarray(np.maximum(np.sqrt(variance.max(axis=-1)), floor))


def missed_share(
    runs: CollocationRuns, coefficients: Array, multi_index: Index, points: uqmbd.extend.VerificationPoints
) -> float:
    """Return the missing part of the standard deviation, from the error of the chaos at verification points.

    A surrogate with the root-mean-square error e misses a variance of about e^2. So the standard deviation s is too
    small by e^2 / (2 s). Two steps of a refinement can agree although both miss the same terms (an even function, an
    interaction without main effects). Realisations at other points detect such terms. The result is the largest value
    over the outputs, divided by the largest standard deviation over time. Without verification points, the result is 0.
    If the realisations of all verification points failed, the result is NaN.
    """
    known = runs.verification(points)
    if not len(known):
        return np.nan if len(points) else 0.0
    surrogate = np.einsum("kp,pot->kot", runs.space.evaluate(known.points.germs, multi_index), coefficients)
    weights = known.points.weights / known.points.weights.sum()
    error = np.tensordot(weights, (surrogate - known.response) ** 2, axes=1)
    scale = scale_of(runs, coefficients[0], np.sum(coefficients[1:] ** 2, axis=0) + error)
    ratio = np.sqrt(error.max(axis=-1)) / scale  # the square of the scale of an output that is zero underflows
    return float((0.5 * ratio**2).max())


class UnmetWarning(UserWarning):
    """Warning if a refinement ended before it met its tolerance."""


def warn_unmet(
    label: str,
    limits: Limits,
    steps: list[RefinementStep],
    reason: str,
    helpful: Literal["realisations", "samples", "neither"],
) -> None:
    """Warn that a refinement ended before its tolerance was met; `helpful`: more realisations, or another method."""
    if limits.error is not None and steps:
        _warn_error_unmet(label, limits, steps, reason, helpful)
        return
    last, missed = "", steps[-1].missed_std if steps else np.nan
    if steps and np.isfinite(steps[-1].settled):
        last = f"; mean and standard deviation still changed by {steps[-1].settled:.2g} in the last step"
        if missed > steps[-1].settled:
            last += f", and the error at the verification realisations is {np.sqrt(2 * missed):.2g} of the largest "
            last += "standard deviation"
    spent = steps[-1].realisations if steps else 0
    noise = NOISE * limits.rtol
    if limits.tolerance < noise:
        reason += f". Changes of this size may be integration errors (rtol={limits.rtol:g}); try a smaller rtol"
    # more realisations and other methods cannot reduce integration errors
    limited = helpful != "neither" and bool(steps) and steps[-1].change >= noise
    more = prospect(steps, limits.tolerance, more=helpful == "realisations") if limited else ""
    warnings.warn(
        f"{label}: the tolerance {limits.tolerance:g} was not met with {spent} realisations{last}. Reason: {reason}"
        f"{more}",
        UnmetWarning,
        stacklevel=3,
    )


def _warn_error_unmet(label: str, limits: Limits, steps: list[RefinementStep], reason: str, helpful: str) -> None:
    """Warn that a refinement ended before the error at the verification realisations was small enough."""
    assert limits.error is not None
    error, noise = steps[-1].error, NOISE * limits.rtol
    errors = [RefinementStep(one.realisations, one.terms, one.error, one.error) for one in steps]
    if limits.error < noise:
        reason += f". Errors of this size may be integration errors (rtol={limits.rtol:g}); try a smaller rtol"
    # more realisations and other methods cannot reduce integration errors
    limited = helpful != "neither" and error >= noise
    more = prospect(errors, limits.error, more=helpful == "realisations") if limited else ""
    known = f"the error at the verification realisations is {error:.2g} of the largest standard deviation"
    known = known if np.isfinite(error) else "the error at the verification realisations is unknown"
    warnings.warn(
        f"{label}: max_error {limits.error:g} was not met with {steps[-1].realisations} realisations: {known}. "
        f"Reason: {reason}{more}",
        UnmetWarning,
        stacklevel=4,
    )


def prospect(steps: Sequence[RefinementStep], tolerance: float, *, more: bool = True) -> str:
    """Return a text on whether more realisations would help, from the decay of the last changes.

    `more`: whether the refinement can use more realisations; if not, the text refers to samples. After few steps, the
    text is empty.

    >>> prospect([RefinementStep(n, n, 10 / n, 10 / n) for n in (10, 20, 40, 80)], 1e-2)[-49:]
    'realisations: about 1000 would meet the tolerance'
    >>> prospect([RefinementStep(n, n, 0.5, 0.5) for n in (10, 20, 40, 80)], 1e-2)[-31:]
    'this tolerance; use Monte Carlo'
    """
    known = [one for one in steps if np.isfinite(one.change) and one.change > 0]
    part = [one for one in known if one.realisations >= known[-1].realisations / WINDOW]
    if len(part) < 3 or part[-1].realisations < 2 * part[0].realisations:
        return ""
    counts, changes = (np.log([getattr(one, name) for one in part]) for name in ("realisations", "change"))
    power = -float(np.polyfit(counts, changes, 1)[0])
    lead = f". The changes fell with the power {max(power, 0.0):.1f} of the number of realisations"
    # logarithm of the required number; errors of samples fall with the inverse root of their number
    needed = np.inf if power <= 0 else counts[-1] + (changes[-1] - np.log(tolerance)) / power
    if power > SAMPLED and needed < -2 * np.log(tolerance):
        return f"{lead}: about {float(f'{np.exp(needed):.1g}'):.0f} would meet the tolerance" if more else ""
    return f"{lead}. Monte Carlo needs no more realisations than this method for this tolerance; use Monte Carlo"


def history(steps: tuple[RefinementStep, ...]) -> xr.Dataset:
    """Return the dataset `refinement` of a node."""
    note = {
        "comment": "largest change over outputs and times, divided by the largest standard deviation of the "
        "output over time"
    }
    missed = {
        "comment": "missing part of the standard deviation at verification realisations; NaN without such realisations"
    }
    found = {
        "realisations": ("step", np.array([s.realisations for s in steps], dtype=np.int64)),
        "terms": ("step", np.array([s.terms for s in steps], dtype=np.int64)),
        "change_mean": ("step", np.array([s.change_mean for s in steps], dtype=float), note),
        "change_std": ("step", np.array([s.change_std for s in steps], dtype=float), note),
        "missed_std": ("step", np.array([s.missed_std for s in steps], dtype=float), missed),
    }
    return xr.Dataset(found)
