"""Find steady motions of realisations: every body follows a screw, and the mechanism keeps its shape.

Newton's method finds the pose. `solve_steady_speeds` computes velocities from a pose, and differences along the motion
yield accelerations; the residual forces within the constraints must vanish.  A result is accepted only if it is a
steady motion within rounding: each body rotates with a frame of constant angular velocity,

    omega' = W x omega        r'' = U x r'

and the resulting poses at other times also satisfy the constraints and the equations of motion.

The module also checks drivers and loads after the start, because a steady motion requires permanently constant speeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.rest_equations import apply
from uqmbd.dynamics.statics.screws import Screws, screws_of
from uqmbd.dynamics.statics.steady_speeds import ORDERS, flow, solve_steady_speeds
from uqmbd.dynamics.statics.unilateral import not_steady
from uqmbd.typing import Array, Index, Mask

__all__ = ["SteadyMotions", "steady_motions"]

WINDOW = 10.0
"""Least duration after the start over which drivers and loads are examined, s."""

TURNS = 3.0
"""Least duration of the examination in turns of the fastest body."""

SAMPLES = 16
"""Number of examined times; their spacing grows, so that no period is missed."""

EVEN = 1e-7
"""Allowed deviation of a prescribed function from a straight line, relative to its change."""


def later_times(model: Model, parameters: Array, fastest: float) -> Array:
    """Return ascending times in s after the initial time, at which a steady motion must continue.

    The parameters (parameter,) belong to one realisation.  The largest angular velocity is `fastest`, rad/s.
    """
    window = max(WINDOW, TURNS * 2 * np.pi / fastest) if fastest > 1e-3 else WINDOW
    found = window * np.geomspace(1e-3, 1.0, SAMPLES)
    breaks = np.sort(np.unique(parameters[model.breaks] - model.time))
    breaks = breaks[np.isfinite(breaks) & (breaks > 0) & (breaks < window)]
    between = (breaks + np.append(breaks[1:], window)) / 2
    return np.asarray(np.unique(np.concatenate([found, between])))


def uneven_driver(ensemble: Batch, k: int) -> str:
    """Return a message on a driver of a realisation with a speed that varies after the start; empty: none."""
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
                f"{after[i]:.3g} s later; give the driver a constant speed, or start when its speed is constant"
            )
    return ""


ITERATIONS = 25
LONGEST = 0.2
"""Largest change of a coordinate in one step, relative to the size of the mechanism."""

BALANCED = 1e-9
"""Residual force, relative to the largest of forces and inertia, that counts as zero."""

SMALL = 1e-11
"""Step of a coordinate, relative to the size of the mechanism, that counts as zero."""

SPAN = 3e-3
"""Rotation angle in rad over which rates of velocities are computed."""

STEADY = 1e-6
"""Allowed deviation of a steady motion: relative error of accelerations, and displacement relative to the size."""


CONTROLLED = (
    "a sampled controller changes its commands at each sample, so the motion is not steady; write its law as a "
    "continuous force of the components, or simulate the motion"
)


DEFORMED = (
    "steady motions with coordinates of components, such as modes of flexible bodies, are not computed; simulate the "
    "motion"
)


@dataclass(frozen=True)
class SteadyMotions:
    """Steady motions of K realisations."""

    q: Array  # (K, coordinate), at the initial time
    s: Array  # auxiliary states (K, state), at the initial time
    v: Array  # (K, coordinate), at the initial time
    screws: tuple[Screws | None, ...]  # motion of the bodies after the start, per realisation; None: no steady motion
    messages: tuple[str, ...]  # empty if a steady motion was found, else the reason

    def select(self, members: Index) -> SteadyMotions:
        """Return the motions of the selected realisations."""
        screws, messages = ([x[k] for k in members] for x in (self.screws, self.messages))
        return SteadyMotions(self.q[members], self.s[members], self.v[members], tuple(screws), tuple(messages))


def steady_motions(ensemble: Batch) -> SteadyMotions:
    """Find the steady motions of K realisations from their initial states.

    If the initial state with the given velocities is a steady motion, it is used unchanged.
    """
    model, start = ensemble.model, ensemble.start
    q, s, v = start.q.copy(), start.s.copy(), start.v.copy()
    messages = list(start.messages)
    screws: list[Screws | None] = [None] * len(q)
    if model.controls:
        return SteadyMotions(q, s, v, tuple(screws), tuple(m or CONTROLLED for m in messages))
    if model.own:
        return SteadyMotions(q, s, v, tuple(screws), tuple(m or DEFORMED for m in messages))
    reasons = dict.fromkeys(np.flatnonzero(start.ok).tolist(), "")
    if model.statements or (model.conditions is not None and len(model.conditions.velocities)):
        for k in list(reasons):
            reasons[k] = _accept(ensemble, k, q, s, v, screws)
    for order, downhill in product(ORDERS, (True, False)):
        todo = np.array([k for k in reasons if screws[k] is None], dtype=np.int64)
        if not len(todo):
            break
        found_q, found_s, found_v, left = _search(ensemble, todo, order, downhill=downhill)
        for row, k in enumerate(todo.tolist()):
            x, y, z = q.copy(), s.copy(), v.copy()
            x[k], y[k], z[k] = found_q[row], found_s[row], found_v[row]
            why = left[row] or _accept(ensemble, k, x, y, z, screws)
            if screws[k] is not None:
                q[k], s[k], v[k] = x[k], y[k], z[k]
            reasons[k] = reasons[k] or why
    for k, why in reasons.items():
        if screws[k] is None:
            messages[k] = f"no steady motion was found from the start pose: {uneven_driver(ensemble, k) or why}"
    for k, why in enumerate(not_steady(ensemble, q, s, v)):
        if why and screws[k] is not None:
            screws[k], messages[k] = None, why
    return SteadyMotions(q, s, v, tuple(screws), tuple(messages))


def _accept(ensemble: Batch, k: int, q: Array, s: Array, v: Array, screws: list[Screws | None]) -> str:
    """Store the screws of a realisation in steady motion, or return a message on the unsteady quantity."""
    found = screws_of(ensemble.model, q[k], s[k], v[k], ensemble.parameters[k])
    if isinstance(found, str):
        return found
    why = _unsteady(ensemble.model, found, ensemble.parameters[k])
    if not why:
        screws[k] = found
    return why


def _unsteady(model: Model, screws: Screws, parameters: Array) -> str:
    """Return a message on a deviation from a steady motion at other times; empty: none."""
    layout, row = model.layout, parameters[None]
    why = _changing(model, screws, parameters)
    if why:
        return why
    for after in screws.times:
        time = model.time + after
        q, v, a, s, rates = screws.at(after)
        arguments = state_arguments(time, q[None], s[None], v[None])
        drift = model.evaluate("drift", arguments, row)
        open_ = np.abs(drift["phi"][0])[layout.kept]
        if open_.max(initial=0.0) > STEADY * max(1.0, model.length):
            i = int(layout.kept[np.argmax(open_)])
            return f"the motion is not steady: {model.equations[i]!r} would open {after:.3g} s later"
        true, _, found = (x[0] for x in accelerations(model, q[None], s[None], v[None], time, row))
        scale = max(float(np.abs(true).max(initial=0.0)), float(np.abs(a).max(initial=0.0)), 1e-3)
        off = np.abs(true - a).reshape(len(model.bodies), -1).max(axis=1)
        if not off.max(initial=0.0) <= STEADY * scale:
            body = model.bodies[int(np.argmax(np.where(np.isfinite(off), off, np.inf)))]
            later = f" {after:.3g} s later" if after else ""
            return f"body {body!r} is not in equilibrium{later} if the relative positions of the bodies are constant"
        if layout.states and not np.abs(found - rates).max() <= STEADY * max(1.0, float(np.abs(rates).max())):
            return "a state of a component changes at a rate that is not constant"
    return ""


def _changing(model: Model, screws: Screws, parameters: Array) -> str:
    """Return a message on a driver or load that ends a steady motion later, without fast rotation; empty: none."""
    after = later_times(model, parameters, screws.fastest)
    times, rows = model.time + after, np.repeat(parameters[None], len(after), axis=0)
    states = [screws.at(x) for x in after.tolist()]
    q, v, a, s, _ = (np.array(x) for x in zip(*states, strict=True))
    # rounding errors, and the residual of Newton's method, grow with the turns
    allowed = STEADY * (1 + screws.fastest * after)
    found = model.evaluate("velocity", state_arguments(times, q, s, v), rows)
    if model.rheonomic:
        kept = model.layout.kept
        d, own = found["d"][:, kept], found["phi_t"][:, kept]
        scale = np.maximum(np.abs(d * v[:, None, :]).max(axis=2, initial=0.0), np.abs(own)).max(axis=0, initial=0.0)
        off = np.abs(apply(d, v) + own) > allowed[:, None] * np.maximum(scale, 1e-6)
        off &= (own != 0).any(axis=0)
        if off.any():
            row, column = np.argwhere(off)[0]
            return f"{model.equations[kept[column]]!r} requires a different speed {after[row]:.3g} s later"
    first = state_arguments(model.time, *(np.repeat(x[:1], len(after), axis=0) for x in (q, s, v)))
    later = state_arguments(times, *(np.repeat(x[:1], len(after), axis=0) for x in (q, s, v)))
    forces = [model.evaluate("acceleration", x, rows)["force"] for x in (first, later)]
    if not (forces[0] != forces[1]).any():
        return ""  # no load depends on time
    true, _, _ = accelerations(model, q, s, v, times, rows)
    scale = np.maximum(np.maximum(np.abs(true).max(axis=1, initial=0.0), np.abs(a).max(axis=1, initial=0.0)), 1e-3)
    off = np.abs(true - a).reshape(len(after), len(model.bodies), -1).max(axis=2)
    wrong = ~(off <= (allowed * scale)[:, None])
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        return f"a load changes with time: body {model.bodies[column]!r} is not in balance {after[row]:.3g} s later"
    return ""


def _search(
    ensemble: Batch, members: Index, order: tuple[str, ...], *, downhill: bool
) -> tuple[Array, Array, Array, list[str]]:
    """Find balanced poses from the initial poses: coordinates, auxiliary states, velocities, and messages.

    With `downhill`, the forces, including inertia forces, must do work along the search; otherwise they must decrease.
    """
    model, parameters = ensemble.model, ensemble.parameters[members]
    q, s = ensemble.start.q[members].copy(), ensemble.start.s[members].copy()
    messages = ["no change of the pose balances the forces"] * len(members)
    active = np.arange(len(members))
    force, scale = _unbalanced(model, q, s, parameters, order)
    for _ in range(ITERATIONS):
        if not len(active):
            break
        step = _newton(model, q[active], s[active], parameters[active], order, force, downhill=downhill)
        done = np.linalg.norm(force, axis=1) <= BALANCED * scale
        done |= np.abs(step).max(axis=1, initial=0.0) <= SMALL * max(1.0, model.length)
        for k in active[done].tolist():
            messages[k] = ""
        active, force, scale, step = active[~done], force[~done], scale[~done], step[~done]
        if not len(active):
            break
        before, moved = np.linalg.norm(force, axis=1), np.zeros(len(active), dtype=bool)
        for halving in range(12):
            pending = np.flatnonzero(~moved)
            some = active[pending]
            x, y = _closed(model, q[some], s[some], 0.5**halving * step[pending], parameters[some])
            closed: Mask = np.asarray(np.isfinite(x).all(axis=1))
            x = np.where(closed[:, None], x, q[some])
            there, size = _unbalanced(model, x, y, parameters[some], order)
            after = np.linalg.norm(there, axis=1)
            good = after < before[pending] * (0.5 if downhill else 1 - 1e-3 * 0.5**halving)
            if downhill:
                good |= np.einsum("kn,kn->k", there, step[pending]) >= 0
            good = closed & (good | (after <= BALANCED * size))
            q[some[good]], s[some[good]] = x[good], y[good]
            force[pending[good]], scale[pending[good]] = there[good], np.maximum(scale[pending[good]], size[good])
            moved[pending[good]] = True
            if moved.all():
                break
        active, force, scale = active[moved], force[moved], scale[moved]
    return q, s, solve_steady_speeds(model, q, s, model.time, parameters, order), messages


def _pseudo(matrices: Array, smallest: float) -> Array:
    """Return pseudo-inverses; singular values below the relative size `smallest` count as zero."""
    return np.asarray(np.linalg.pinv(matrices, rcond=smallest), dtype=float)


def _tangents(gradient: Array) -> Array:
    """Return projectors (K, n, n) onto the tangent spaces of the constraints."""
    return np.asarray(np.eye(gradient.shape[2]) - _pseudo(gradient, 1e-9) @ gradient)


def _unbalanced(model: Model, q: Array, s: Array, parameters: Array, order: tuple[str, ...]) -> tuple[Array, Array]:
    """Return the unbalanced forces within the constraints, (K, n), and the sizes of forces and inertia."""
    time, ends = model.time, []
    v = solve_steady_speeds(model, q, s, time, parameters, order)
    h = SPAN / max(_fastest(model, q, v), 1e-3)
    for part in (-2, -1, 1, 2):
        x, y = flow(model, q, s, time, parameters, order, part * h)
        ends.append(solve_steady_speeds(model, x, y, time + part * h, parameters, order))
    required = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
    found = model.evaluate("acceleration", state_arguments(time, q, s, v), parameters)
    inertia = apply(found["mass"], required)
    kept = found["d"][:, model.layout.kept]
    force = apply(_tangents(kept), found["force"] - inertia)
    scale = np.maximum(np.abs(found["force"]).max(axis=1), np.abs(inertia).max(axis=1))
    return force, np.maximum(scale, 1e-12)


def _fastest(model: Model, q: Array, v: Array) -> float:
    """Return the largest angular velocity, or speed over the size of the mechanism, 1/s."""
    rates = np.abs(v).reshape(len(v), -1, model.size)
    turning = 2 * rates[:, :, model.dimension :].max(initial=0.0)
    return float(max(turning, rates[:, :, : model.dimension].max(initial=0.0) / model.length))


def _newton(
    model: Model, q: Array, s: Array, parameters: Array, order: tuple[str, ...], force: Array, *, downhill: bool
) -> Array:
    """Return the steps of the coordinates (K, n) that balance the forces to first order."""
    count, n = q.shape
    found = model.evaluate("velocity", state_arguments(model.time, q, s, np.zeros_like(q)), parameters)
    gradient = found["d"][:, model.layout.independent_holonomic]
    values, directions = np.linalg.eigh(_tangents(gradient))
    freedom = int(np.round(values.sum(axis=1)).max())
    basis = directions[:, :, n - freedom :]
    h = 1e-6 * max(1.0, model.length)
    columns = []
    for k in range(freedom):
        ends = []
        for sign in (1, -1):
            x = q + sign * h * basis[:, :, k]
            ends.append(_unbalanced(model, x, s + _counted(model, q, s, x, parameters), parameters, order)[0])
        columns.append((ends[0] - ends[1]) / (2 * h))
    if not columns:
        return np.zeros_like(q)
    jacobian = np.stack(columns, axis=2)
    if downhill:
        # replace negative stiffness by its absolute value, as in a search for a static equilibrium
        reduced = basis.transpose(0, 2, 1) @ jacobian
        values, modes = np.linalg.eigh(-(reduced + reduced.transpose(0, 2, 1)) / 2)
        along = apply(modes.transpose(0, 2, 1), apply(basis.transpose(0, 2, 1), force))
        least = 1e-7 * np.abs(values).max(axis=1, initial=0.0)[:, None]
        amounts = np.where(np.abs(values) > least, along / np.where(values == 0, 1.0, np.abs(values)), 0.0)
        step = apply(basis, apply(modes, amounts))
    else:
        step = -apply(basis, apply(_pseudo(jacobian, 1e-7), force))
    largest = np.abs(step).max(axis=1, initial=0.0) / (LONGEST * max(1.0, model.length))
    return np.asarray(step / np.maximum(1.0, largest)[:, None])


def _counted(model: Model, q: Array, s: Array, moved: Array, parameters: Array) -> Array:
    """Return the change of initial auxiliary states with the pose, up to whole turns."""
    ends = [
        model.evaluate("initial", state_arguments(model.time, x, np.zeros_like(s), np.zeros_like(x)), parameters)["s"]
        for x in (q, moved)
    ]
    change = ends[1] - ends[0]
    return np.asarray(change - 2 * np.pi * np.round(change / (2 * np.pi)))


def _closed(model: Model, q: Array, s: Array, step: Array, parameters: Array) -> tuple[Array, Array]:
    """Take steps, and close the constraints by the least change; NaN if they cannot be closed."""
    x, y, kept = q + step, s, model.layout.independent_holonomic
    for _ in range(12):
        y = s + _counted(model, q, s, x, parameters)
        arguments = state_arguments(model.time, x, y, np.zeros_like(x))
        phi = model.evaluate("drift", arguments, parameters)["phi"][:, kept]
        if not np.abs(phi).max(initial=0.0) > 1e-13 * max(1.0, model.length):
            break
        gradient = model.evaluate("velocity", arguments, parameters)["d"][:, kept]
        x = x - apply(_pseudo(gradient, 1e-9), phi)
    open_ = ~(np.abs(phi).max(axis=1, initial=0.0) <= 1e-9 * max(1.0, model.length))
    y[open_] = s[open_]
    x[open_] = np.nan
    return x, y
