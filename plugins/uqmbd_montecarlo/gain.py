"""Variance reduction and cost of a control variate, as attributes of results."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd_montecarlo.allocation import optimum
from uqmbd_montecarlo.lowfidelity import PairedControl
from uqmbd_montecarlo.surrogate import ControlSurrogate

__all__ = ["of_study", "of_surrogate"]


HARM = 0.8
"""A warning is issued if the variance ratio on an equal budget is smaller. The difference from 1 allows for errors of
timing."""


def of_surrogate(statistics: xr.Dataset, surrogate: ControlSurrogate) -> dict[str, Any]:
    """Return the attributes of controlled statistics with a surrogate as control."""
    cost = f"{surrogate.realisations} realisations for the surrogate" if surrogate.realisations else "a given surrogate"
    return {
        "control_realisations": surrogate.realisations,
        "control_failures": surrogate.failures,
        "control_summary": f"control variate with {cost}: {_reductions(statistics)}",
    }


def of_study(
    statistics: xr.Dataset,
    paired: PairedControl,
    problem: uqmbd.extend.Problem,
    samples: int,
    left: float,
    wall_time: float,
) -> dict[str, Any]:
    """Return the attributes of statistics with a low-cost study as control, and warn if it does not help.

    `left`: share of the variance left by the control; `wall_time`: time of the samples and of the control at
    the samples, s. For scalar outputs, the samples were computed earlier, so computing times are not meaningful.
    """
    stated, total = paired.control.cost, paired.realisations
    attrs: dict[str, Any] = {
        "control_realisations": total,
        "control_failures": paired.failures,
        "control_cost": stated,
    }
    about = f"control variate {paired.words}, which leaves the share {left:.3g} of the variances"
    if total == samples:
        words = (
            f"{about}, at the relative cost {stated:g}: variance reduction 1.0, no advantage over Monte Carlo "
            "without control"
        )
        warnings.warn(f"{problem.label}: {words}.", stacklevel=3)
        return attrs | {"control_summary": words}
    attrs["control_summary"] = (
        f"{about}; {total} realisations of the control, {samples} of them at the samples: {_reductions(statistics)}"
    )
    further = paired.alone / (total - samples)
    whole = wall_time / samples - further
    if problem.timeless or not further > 0 or not whole > 0:
        return attrs
    ratio, cost = total / samples, further / whole
    gains = [_medians(statistics)[k] / (1 + cost * ratio) for k in range(2)]
    best = round(optimum(left, cost) * samples)
    attrs["control_measured"] = (
        f"a realisation of the control took {cost:.3g} of the time of a realisation of the study. On an equal budget, "
        f"the control divides the variance of the mean by {gains[0]:.3g} and the variance of the standard deviation by "
        f"{gains[1]:.3g}. These factors are medians over outputs and times, relative to Monte Carlo without control. "
        f"With cost={cost:.2g}, the optimum number of realisations of the control is {best}"
    )
    if max(gains) < HARM:
        warnings.warn(
            f"{problem.label}: {attrs['control_measured']}. Monte Carlo without control is more "
            "efficient here; omit control.",
            stacklevel=3,
        )
    return attrs


_NAMES = (("variance_reduction", "mean"), ("variance_reduction_std", "standard deviation"))


def _varying(statistics: xr.Dataset, name: str) -> Any:
    return np.where((statistics["variance_reduction"] != 1.0).values, statistics[name].values, np.nan)


def _medians(statistics: xr.Dataset) -> list[float]:
    found = [_varying(statistics, name) for name, _ in _NAMES]
    return [1.0 if np.isnan(values).all() else float(np.nanmedian(values)) for values in found]


def _reductions(statistics: xr.Dataset) -> str:
    """Return a text on the factors by which the variances of estimates were reduced."""
    parts = []
    for name, words in _NAMES:
        values = _varying(statistics, name)
        if np.isnan(values).all():
            return "no output varies, so the control has no effect"
        worst = np.unravel_index(int(np.nanargmin(values)), values.shape)
        where = f"{statistics['output'].values[worst[0]]} at {statistics['time'].values[worst[1]]:g} s"
        parts.append(
            f"variance of the {words} divided by {np.nanmedian(values):.3g} (median over outputs and times; minimum "
            f"{values[worst]:.3g}, for {where})"
        )
    return ", ".join(parts)
