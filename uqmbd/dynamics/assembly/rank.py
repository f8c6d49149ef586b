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
    "ranks_along",
    "violated",
]


WATCHED = 6
"""Largest number of singular values whose zeros over time are searched."""

SMALL = 0.3
"""Singular value, relative to the largest, below which the time of its zero is computed."""

VIOLATION = 100.0
"""Allowed residual of an omitted redundant equation, relative to the mechanism's size, divided by the tolerance."""

FINE, COARSE = 1e-6, 1e-2
"""Least and greatest allowed residual, relative to the size of the mechanism."""

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
    weakest: Array  # (equation,): share of the equations in the smallest relevant singular value; empty: unknown
    kept_weakest: Array  # the same, for the kept equations
    of_kept: Index  # kept equations

    @property
    def equations(self) -> Index:
        """Equations that become dependent, the most affected first."""
        return _affected(self.weakest)

    @property
    def kept_equations(self) -> Index:
        """Kept equations that become dependent, the most affected first."""
        return self.of_kept[_affected(self.kept_weakest)]


def _affected(weakest: Array) -> Index:
    """Return the indices of large shares, the largest first."""
    order = np.argsort(-np.abs(weakest), kind="stable")
    found: Index = order[np.abs(weakest[order]) > 0.1 * np.abs(weakest).max(initial=0.0)].astype(np.int64)
    return found


def gradient(model: Model, q: Array, s: Array, time: float, parameters: Array) -> Array:
    """Return the Jacobian of all constraints (equation, coordinate) of one realisation, with rows of length one."""
    rows, _ = _scaled_gradients(model, q[None], s[None], np.array([time]), parameters[None])
    found: Array = rows[0]
    return found


def _scaled_gradients(model: Model, q: Array, s: Array, times: Array, parameters: Array) -> tuple[Array, Array]:
    """Return Jacobians with rows of length one (K, equation, coordinate), and the lengths; 1 without a gradient."""
    d = model.evaluate("velocity", state_arguments(times, q, s, np.zeros_like(q)), parameters)["d"]
    norm = np.linalg.norm(d, axis=2)
    lengths = np.where(norm > 1e-9, norm, 1.0)[..., None]
    return d / lengths, lengths


def rank_along(model: Model, q: Array, s: Array, v: Array, time: float, parameters: Array) -> Rank:
    """Determine the rank at a state of one realisation, and the loss of rank along the present velocity."""
    return ranks_along(model, q[None], s[None], v[None], np.array([time]), parameters[None])[0]


def ranks_along(model: Model, q: Array, s: Array, v: Array, times: Array, parameters: Array) -> list[Rank]:
    """Determine the ranks at states of K realisations, and their losses along the present velocities."""
    here = _scaled_gradients(model, q, s, times, parameters)[0]
    # a short displacement along the motion: large compared with rounding, small compared with curvature
    delta = 1e-5 / np.maximum(np.abs(v).max(axis=1, initial=0.0), 1e-3)
    there = _scaled_gradients(model, q + delta[:, None] * v, s, times + delta, parameters)[0]
    slope = (there - here) / delta[:, None, None]
    layout = model.layout
    found = _nearest(here, slope, layout.rank)
    kept = found
    if len(layout.kept) < here.shape[1]:
        kept = _nearest(here[:, layout.kept], slope[:, layout.kept], len(layout.kept))
    parts = zip(*found, *kept, strict=True)
    return [
        Rank(float(every), float(least), float(ahead), float(kept_ahead), weakest, kept_weakest, layout.kept)
        for every, ahead, weakest, least, kept_ahead, kept_weakest in parts
    ]


def _nearest(a: Array, slope: Array, rank: int) -> tuple[Array, Array, Array]:
    """Return the smallest relevant singular values, times to the nearest zeros of small ones, and shares of rows.

    The shapes are (K,), (K,) and (K, equation).
    """
    least, ahead, weakest = np.ones(len(a)), np.full(len(a), np.inf), np.zeros(a.shape[:2])
    # values that are not finite are reported elsewhere
    known = np.flatnonzero(np.isfinite(a).all(axis=(1, 2)) & np.isfinite(slope).all(axis=(1, 2)))
    if not rank or not len(known):
        return least, ahead, weakest[:, :0]
    left, values, right = np.linalg.svd(a[known])
    values = np.pad(values, ((0, 0), (0, max(0, rank - values.shape[1]))))
    size = np.maximum(values[:, 0], 1e-300)
    least[known], weakest[known] = values[:, rank - 1] / size, left[..., rank - 1]
    small = (values[:, max(0, rank - WATCHED) : rank] < SMALL * size[:, None]).sum(axis=1)
    for count in np.unique(small[small > 0]).tolist():  # singular values descend
        some, part = np.flatnonzero(small == count), slice(rank - count, rank)
        sigma = values[some, part]
        # singular if sigma + t U^T D' W is singular: linear change for small times
        change = left[some, :, part].transpose(0, 2, 1) @ slope[known[some]] @ right[some, part].transpose(0, 2, 1)
        regular = sigma.all(axis=1)
        inverse = np.full((len(some), count), np.inf, dtype=complex)
        inverse[regular] = np.linalg.eigvals(-change[regular] / sigma[regular][..., None])
        real = np.where(np.abs(inverse.imag) <= 0.5 * np.abs(inverse.real), inverse.real, 0.0)
        strongest = np.take_along_axis(real, np.abs(real).argmax(axis=1)[:, None], axis=1)[:, 0]
        with np.errstate(divide="ignore"):
            ahead[known[some]] = np.where(strongest != 0, 1.0 / strongest, np.inf)
    return least, ahead, weakest


def null_equations(model: Model, q: Array, s: Array, time: float, parameters: Array) -> Array:
    """Return combinations of multipliers without an effect on coordinates, which may be added to every solution.

    The result for one realisation has the shape (equation, redundancy). The result is orthonormal before the division
    of each row by the length of its equation's gradient.
    """
    scaled, lengths = _scaled_gradients(model, q[None], s[None], np.array([time]), parameters[None])
    left = np.linalg.svd(scaled[0])[0]
    free: Array = left[:, model.layout.rank :] / lengths[0]
    return free


def violated(
    model: Model, times: Array, states: Array, parameters: Array, lengths: Array, rtol: float
) -> dict[int, tuple[int, str]]:
    """Find motions that violate equations which were omitted as redundant, but are so in a singular start pose only.

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
            "one motion, or lengths that do not fit). Or several motions are possible, because the given pose is "
            "singular: give a pose slightly farther along the motion",
        )
    return texts


def dead_end(model: Model, time: float, rank: Rank, *, final: bool = True) -> str:
    """Return a message if a motion ends at dependent constraints; `final` states that no method can continue it."""
    if min(rank.every, rank.kept) > 1e-3 and abs(rank.ahead) > 1e-6 * max(1.0, abs(time)):
        return ""
    what, end = ("locks up", ", and no motion can continue") if final else ("locks up, or is in a singular pose", "")
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
