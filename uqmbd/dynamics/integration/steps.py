"""The motion between times at which states are known, as recorded steps: polynomials of degree 7.

SciPy's interpolants through values and rates are of degree 3, or 5 where second derivatives are known: an integrator's
error lies far below that of such a polynomial over one of its steps.
"""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import PLACES, Path
from uqmbd.typing import Array, Index

__all__ = ["path_through"]


BOTH, ALONE = 4, 8
"""Neighbouring times whose states determine a polynomial: with rates, and without."""


def path_through(times: Array, states: Array, rates: Array | None, owner: Index, end: float | None = None) -> Path:
    """Return the motion from each time to the next, on a stretch on which it is smooth.

    Parameters
    ----------
    times : array, shape (S,)
        Increasing, s.
    states : array, shape (M, S, width)
        Of realisations that share the times.
    rates : array, shape (M, S, width), optional
        Of the states.
    owner : array of int, shape (M,)
        Their numbers.
    end : float, optional
        Where the stretch ends, s; default: at the last of the times.
    """
    if len(times) < 2:
        none = np.zeros((0, len(PLACES), states.shape[2]))
        return Path(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0, dtype=bool), none)
    count = min(BOTH if rates is not None else ALONE, len(times))
    number = np.arange(len(times) - 1)
    last = times[1:].copy()
    last[-1] = last[-1] if end is None else min(end, float(last[-1]))
    # windows around each interval, in the length of the interval from its begin
    window = np.clip(number - (count - 2) // 2, 0, len(times) - count)[:, None] + np.arange(count)
    length = np.diff(times)
    at = (times[window] - times[:-1, None]) / length[:, None]
    places = PLACES * ((last - times[:-1]) / length)[:, None]
    found = np.zeros((len(states), len(number), len(PLACES), states.shape[2]))
    for j in range(count):
        others = np.delete(np.arange(count), j)
        apart = at[:, j, None] - at[:, others]
        basis = np.ones_like(places)
        for k, other in enumerate(others.tolist()):
            basis *= (places - at[:, other, None]) / apart[:, k, None]
        value, slope = basis, np.zeros_like(basis)
        if rates is not None:
            beside = places - at[:, j, None]
            value = (1 - 2 * np.sum(1 / apart, axis=1)[:, None] * beside) * basis**2
            slope = beside * basis**2 * length[:, None]
        found += value[None, :, :, None] * states[:, window[:, j], None]
        if rates is not None:
            found += slope[None, :, :, None] * rates[:, window[:, j], None]
    members = len(states)
    ends = np.broadcast_to(np.stack([times[:-1], last], axis=1), (members, len(number), 2)).reshape(-1, 2)
    flat = found.reshape(-1, *found.shape[2:])
    return Path(np.repeat(owner, len(number)), ends.copy(), np.zeros(len(flat), dtype=bool), flat)
