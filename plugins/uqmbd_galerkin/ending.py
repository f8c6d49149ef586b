"""Where a projected motion ends, and what is said of results that must not be trusted."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array, Mask
from uqmbd_galerkin.verification import horizons

__all__ = ["finished", "padded", "warn"]


DOUBTFUL = 0.1
"""Stated error, over the standard deviation, from which a result is not given without a warning."""


def warn(
    problem: uqmbd.Problem,
    chaos: PolynomialChaos,
    message: str,
    stopped: dict[str, float],
    order: int,
    stop_at: float | None,
) -> None:
    """Say where the result must not be trusted.

    Parameters
    ----------
    problem : uqmbd.Problem
        What was computed.
    chaos : uqmbd.results.PolynomialChaos
        Up to the last time with results.
    message : str
        Why the integration ended, or empty.
    stopped : dict of str to float
        Outputs whose stated error passed `stop_at`, and when.
    order : int
        Of the expansion.
    stop_at : float, optional
        Stated error at which a run ends.
    """
    times, label = problem.times, problem.label
    last = float(np.asarray(chaos.labels.times)[-1])
    remedy = "raise the order, use collocation with elements or Monte Carlo, or study a shorter time"
    if stopped:
        warnings.warn(
            f"{label}: results end at t = {last:.6g} s of {times[-1]:g} s, since the stated error of "
            f"{_listed(stopped)} passes stop_at = {stop_at:g}. To go further, {remedy}.",
            stacklevel=4,
        )
    elif message:
        warnings.warn(
            f"{label}: the projected motion ended, results are given up to t = {last:.6g} s of {times[-1]:g} s: "
            f"{message} The expansion of order {order} may have stopped being valid: {remedy}.",
            stacklevel=4,
        )
    suspicions = [one.words() for one in chaos.discontinuities() if one and one.clear]
    if suspicions:
        warnings.warn(f"{label}: {'; '.join(suspicions)}.", stacklevel=4)
    doubtful = horizons(chaos, DOUBTFUL, problem.rtol)
    if doubtful:
        warnings.warn(
            f"{label}: the stated error passes {DOUBTFUL:.0%} of the standard deviation, in {_listed(doubtful)}; "
            f"do not trust it from there on: {remedy}.",
            stacklevel=4,
        )


def _listed(horizon: dict[str, float]) -> str:
    return ", ".join(f"{name!r} from t = {time:.6g} s on" for name, time in horizon.items())


def finished(coefficients: Array) -> int:
    """How many times are computed."""
    good: Mask = np.asarray(np.isfinite(coefficients).all(axis=(0, 2)))
    return int(np.argmin(good)) if not good.all() else len(good)


def padded(statistics: xr.Dataset, times: Array) -> xr.Dataset:
    """Statistics at all times, NaN where the motion had ended."""
    if len(statistics["time"]) == len(times):
        return statistics
    attrs = statistics["time"].attrs
    found = statistics.reindex(time=times)
    found["time"].attrs.update(attrs)
    return found
