"""End of a projected motion, and messages about unreliable results."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import AlignedChaos, PiecewiseChaos, PolynomialChaos
from uqmbd.typing import Array, Mask

__all__ = ["finished", "horizons", "no_motion", "padded", "warn"]


Chaos = PolynomialChaos | PiecewiseChaos | AlignedChaos


def warn(
    problem: uqmbd.extend.Problem,
    chaos: PolynomialChaos,
    message: str,
    stopped: dict[str, float],
    order: int,
    stop_at: float | None,
) -> None:
    """Warn about unreliable results."""
    times, label = problem.times, problem.label
    last = float(np.asarray(chaos.labels.times)[-1])
    remedy = "or use collocation with elements or Monte Carlo, to obtain later times; or end the study at this time"
    if stopped:
        warnings.warn(
            f"{label}: results end at t = {last:.6g} s of {times[-1]:g} s, because the stated error exceeds stop_at "
            f"= {stop_at:g} for {_listed(stopped)}. Raise the order, {remedy}.",
            stacklevel=3,
        )
    elif message:
        warnings.warn(
            f"{label}: the integration of the projected equations ended early; results end at t = "
            f"{last:.6g} s of {times[-1]:g} s. Reason: {message} After this time the expansion of "
            f"order {order} may be invalid. Raise the order, {remedy}.",
            stacklevel=3,
        )
    suspicions = [one.words() for one in chaos.discontinuities() if one and one.clear]
    if suspicions:
        warnings.warn(f"{label}: {'; '.join(suspicions)}.", stacklevel=3)


def horizons(chaos: Chaos, limit: float, rtol: float) -> dict[str, float]:
    """Return for each output the first time in s at which its stated error exceeds `limit` standard deviations.

    The result omits outputs whose error never exceeds the limit, and outputs that vary by less than the tolerance
    `rtol` of the integration. Without verification data, the result is empty.
    """
    if chaos.verification_response is None:
        return {}
    found = uqmbd.extend.find_exceedances(
        chaos.labels, chaos.verification_error(), limit, uqmbd.extend.varying(chaos, rtol)
    )
    return {one.output: one.begin for one in found}


def _listed(horizon: dict[str, float]) -> str:
    return ", ".join(f"{name!r} from t = {time:.6g} s on" for name, time in horizon.items())


def no_motion(label: str, error: uqmbd.AssemblyError) -> uqmbd.AssemblyError:
    """Return the assembly error of a node, with an explanation of its consequence for the expansion."""
    return uqmbd.AssemblyError(
        f"{label}: {str(error).rstrip('.')}. An expansion needs a solution at every node. Truncate the "
        "distributions, or use Monte Carlo, which omits and counts failed samples."
    )


def finished(coefficients: Array) -> int:
    """Return the number of computed times."""
    good: Mask = np.asarray(np.isfinite(coefficients).all(axis=(0, 2)))
    return int(np.argmin(good)) if not good.all() else len(good)


def padded(statistics: xr.Dataset, times: Array) -> xr.Dataset:
    """Return statistics at all times, with NaN after the end of the motion."""
    if len(statistics["time"]) == len(times):
        return statistics
    attrs = statistics["time"].attrs
    found = statistics.reindex(time=times)
    found["time"].attrs.update(attrs)
    return found
