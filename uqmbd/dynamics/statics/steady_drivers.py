"""What drivers and loads do later on: a steady motion needs speeds that are constant, not only at the start."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.typing import Array

__all__ = ["later_times", "uneven_driver"]


WINDOW = 10.0
"""Time from the start on over which drivers and loads are looked at, s, at least."""

TURNS = 3.0
"""The same in turns of what turns fastest."""

SAMPLES = 16
"""Times of this window that are looked at; their distances grow, so that no period goes unseen."""

EVEN = 1e-7
"""Part of the change of a prescribed function by which it may depart from a straight line."""


def later_times(model: Model, parameters: Array, fastest: float) -> Array:
    """Return ascending times after the initial one, s, at which a steady motion must continue.

    The parameters (parameter,) are those of one realisation.  The largest angular velocity is `fastest`, rad/s.
    """
    window = max(WINDOW, TURNS * 2 * np.pi / fastest) if fastest > 1e-3 else WINDOW
    found = window * np.geomspace(1e-3, 1.0, SAMPLES)
    breaks = np.sort(np.unique(parameters[model.breaks] - model.time))
    breaks = breaks[np.isfinite(breaks) & (breaks > 0) & (breaks < window)]
    between = (breaks + np.append(breaks[1:], window)) / 2
    return np.asarray(np.unique(np.concatenate([found, between])))


def uneven_driver(ensemble: Batch, k: int) -> str:
    """Say which driver of a realisation has a speed that is not constant from the start on; empty: none."""
    model = ensemble.model
    prescribed = model.prescribed
    if prescribed is None or not prescribed.owners:
        return ""
    after = np.concatenate([[0.0], later_times(model, ensemble.parameters[k], 0.0)])
    values = ensemble.values[k]
    moments = np.column_stack([np.repeat(values[None], len(after), axis=0), model.time + after])
    seen = prescribed.functions(moments)
    for column, owner, name, units in zip(seen.T, prescribed.owners, prescribed.names, prescribed.units, strict=True):
        size = max(float(np.abs(column).max()), 1e-9)
        rates, what = column, f"{name} of driver {owner!r}"
        if not units.endswith("/s"):
            rates, what = np.diff(column) / np.diff(after), f"speed of driver {owner!r}"
            units = f"{units}/s" if units not in ("", "1") else "1/s"
            # differences lose digits
            size = max(float(np.abs(rates).max()), 1e-7 * size / float(np.diff(after).min()))
        departure = np.abs(rates - rates[0])
        if not departure.max() <= EVEN * size:
            i = int(np.nanargmax(np.where(np.isfinite(departure), departure, np.inf)))
            return (
                f"the {what} is not constant: it is {rates[0]:.4g} {units} at first and {rates[i]:.4g} {units} about "
                f"{after[i]:.3g} s later; give it a constant one, or begin where it has become constant"
            )
    return ""
