"""Rank of the constraint equations along a motion: time to a singular pose, and affected equations.

The constraints of the equations of motion lose rank in a singular pose.  Near this pose, the smallest singular values
change linearly with time. If the mechanism locks up, they vanish like the square root of the remaining time instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.typing import Array, Index

__all__ = [
    "Rank",
    "dead_end",
    "gradient",
    "joints",
    "named",
    "null_equations",
    "rank_along",
    "violated",
]


WATCHED = 6
"""Largest number of singular values in the search for zeros."""

SMALL = 0.3
"""Relative size of a singular value below which the search includes its zero."""

VIOLATION = 100.0
"""Allowed residual of an omitted redundant equation, in tolerances, relative to the size of the mechanism."""

FINE, COARSE = 1e-6, 1e-2
"""Least and greatest value of the allowed residual."""

BLOCK = 2048
"""Number of states in one evaluation of residuals."""


@dataclass(frozen=True)
class Rank:
    """Measures of the rank of the constraint equations of one realisation."""

    # smallest relevant singular value of all equations, scaled to length one; relevant: the rank at a general pose
    every: float
    kept: float  # smallest singular value of the kept equations
    # time to the nearest singular pose of all equations, s, to first order; negative: past; infinite: none near
    ahead: float
    kept_ahead: float  # time to the nearest singular pose of the kept equations, s
    equations: Index  # equations that become dependent, the most affected first
    kept_equations: Index  # kept equations that become dependent, the most affected first


def gradient(model: Model, q: Array, s: Array, time: float, parameters: Array) -> Array:
    """Return the Jacobian of all constraints (equation, coordinate) of one realisation, with rows of length one."""
    return _scaled_gradient(model, q, s, time, parameters)[0]


def _scaled_gradient(model: Model, q: Array, s: Array, time: float, parameters: Array) -> tuple[Array, Array]:
    """Return the rows of `gradient`, and their original lengths (equation, 1); 1 without a gradient."""
    state = state_arguments(time, q[None], s[None], np.zeros_like(q)[None])
    d = model.evaluate("velocity", state, parameters[None])["d"][0]
    norm = np.linalg.norm(d, axis=1)
    lengths = np.where(norm > 1e-9, norm, 1.0)[:, None]
    return d / lengths, lengths


def rank_along(model: Model, q: Array, s: Array, v: Array, time: float, parameters: Array) -> Rank:
    """Determine the rank at a state of one realisation, and the loss of rank along the present velocity."""
    here = gradient(model, q, s, time, parameters)
    # a short displacement along the motion: large compared with rounding, small compared with curvature
    delta = 1e-5 / max(float(np.abs(v).max(initial=0.0)), 1e-3)
    slope = (gradient(model, q + delta * v, s, time + delta, parameters) - here) / delta
    kept = model.layout.kept
    every, ahead, equations = _nearest(here, slope, model.layout.rank)
    if len(kept) == len(here):
        return Rank(every, every, ahead, ahead, equations, equations)
    least, kept_ahead, some = _nearest(here[kept], slope[kept], len(kept))
    return Rank(every, least, ahead, kept_ahead, equations, kept[some])


def _nearest(a: Array, slope: Array, rank: int) -> tuple[float, float, Index]:
    """Return the smallest relevant singular value, time to the nearest zero of small ones, and affected rows."""
    if not (rank and np.isfinite(a).all() and np.isfinite(slope).all()):
        return 1.0, np.inf, np.zeros(0, dtype=np.int64)  # values that are not finite are reported elsewhere
    left, values, right = np.linalg.svd(a)
    values = np.concatenate([values, np.zeros(max(0, rank - len(values)))])
    size = max(float(values[0]), 1e-300)
    small = np.arange(max(0, rank - WATCHED), rank)
    small = small[values[small] < SMALL * size]
    weakest = left[:, rank - 1]
    order = np.argsort(-np.abs(weakest), kind="stable")
    rows = order[np.abs(weakest[order]) > 0.1 * np.abs(weakest).max()].astype(np.int64)
    ahead = np.inf
    if len(small):
        # singular if sigma + t U^T D' W is singular: linear change for small times
        change = left[:, small].T @ slope @ right[small].T
        inverse = np.linalg.eigvals(-change / values[small][:, None]) if values[small].all() else np.array([np.inf])
        real = np.where(np.abs(inverse.imag) <= 0.5 * np.abs(inverse.real), inverse.real, 0.0)
        strongest = real[np.argmax(np.abs(real))]
        ahead = float(1.0 / strongest) if strongest else np.inf
    return float(values[rank - 1] / size), ahead, rows


def null_equations(model: Model, q: Array, s: Array, time: float, parameters: Array) -> Array:
    """Return combinations of constraint equations without an effect on coordinates: arbitrary extra multipliers.

    The result for one realisation has the shape (equation, redundancy). The result is orthonormal before the division
    of each row by the length of its equation's gradient.
    """
    scaled, lengths = _scaled_gradient(model, q, s, time, parameters)
    left = np.linalg.svd(scaled)[0]
    free: Array = left[:, model.layout.rank :] / lengths
    return free


def violated(
    model: Model, times: Array, states: Array, parameters: Array, lengths: Array, rtol: float
) -> dict[int, tuple[int, str]]:
    """Find motions that violate equations omitted as redundant, which were only dependent in a singular start pose.

    States are (K, T, width), NaN if missing; `lengths` (K, equation) are the lengths of the gradients of the equations.
    Return the index of the first such time and a message for each affected realisation.
    """
    layout = model.layout
    if layout.rank == layout.constraints:
        return {}
    count, number, width = states.shape
    flat, values = states.reshape(-1, width), np.zeros((count * number, layout.constraints))
    for first in range(0, len(flat), BLOCK):
        part = np.arange(first, min(first + BLOCK, len(flat)))
        found = model.evaluate("drift", state_arguments(times[part % number], flat[part]), parameters[part // number])
        values[part] = found["phi"]
        values[np.ix_(part, layout.nonholonomic)] = found["psi"][:, layout.nonholonomic]
    values[:, layout.kept] = 0.0
    share = min(COARSE, max(FINE, VIOLATION * rtol))
    allowed = np.full((count, 1, layout.constraints), share * min(1.0, model.length))
    speed = np.nanmax(np.abs(states[..., layout.velocities :]), axis=(1, 2), initial=0.0)
    allowed[:, 0, layout.nonholonomic] = share * np.maximum(speed, 1e-3 * min(1.0, model.length))[:, None]
    off = np.abs(values).reshape(count, number, -1) > allowed * lengths[:, None]
    texts: dict[int, tuple[int, str]] = {}
    for k in np.flatnonzero(off.any(axis=(1, 2))).tolist():
        first = int(np.argmax(off[k].any(axis=1)))
        names = named(model, np.flatnonzero(off[k, first]))
        texts[k] = (
            first,
            f"the equations {names}, omitted as redundant at the start, are violated from t = {times[first]:.6g} s "
            "on: other equations do not imply them. The constraints may contradict each other (such as two drivers of "
            "one motion, or lengths that do not fit). Or several motions are possible, because the drawn pose is "
            "singular: draw the mechanism slightly farther along the motion",
        )
    return texts


def dead_end(model: Model, time: float, rank: Rank, *, sure: bool = True) -> str:
    """Return a message if a motion ends at dependent constraints; `sure`: whether a passage was attempted."""
    if min(rank.every, rank.kept) > 1e-3 and abs(rank.ahead) > 1e-6 * max(1.0, abs(time)):
        return ""
    what, end = ("locks up", ", and no motion can continue") if sure else ("locks up, or is in a singular pose", "")
    return (
        f"the integration stopped at t = {time:.6g} s: the mechanism {what}; there the equations "
        f"{named(model, rank.equations)} become dependent{end}. "
        f"Check lengths and drivers at the joints {joints(model, rank.equations)}, "
        "or choose an earlier end time"
    )


def named(model: Model, equations: Index, most: int = 4) -> str:
    """Return a list of equations by joint and direction as text, without unit quaternions."""
    names = [repr(model.equations[k]) for k in model.of_components(equations)]
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def joints(model: Model, equations: Index) -> str:
    """Return a list of the components that own equations as text."""
    found = dict.fromkeys(model.owners[k] for k in model.of_components(equations))
    return ", ".join(map(repr, found))
