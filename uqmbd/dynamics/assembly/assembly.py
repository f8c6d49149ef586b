"""Assembly: consistent positions, velocities, accelerations and multipliers from the given pose.

Damped Gauss-Newton steps move the given poses by the least amount that satisfies the constraints. Velocities have the
least norm. The driver computes both. Realisations that the driver leaves undecided are solved by singular values.
Singular values and pivoted QR determine the rank of the constraint Jacobian. Accelerations follow from the index-1
system.

Length: poses and velocities are in one module, because messages on impossible velocities require the closure of poses
near the given pose.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from uqmbd.dynamics.assembly.conditions import met
from uqmbd.dynamics.assembly.dead_centre import (
    amplified,
    dead_centre_of_pose,
    dead_centre_of_speeds,
    locally_dependent,
    singular_pose,
)
from uqmbd.dynamics.assembly.least_norm import solve_least_norm
from uqmbd.dynamics.assembly.programs import BODY_RATE, closed_poses, least_velocities
from uqmbd.dynamics.assembly.rank import named
from uqmbd.dynamics.assembly.start import Start
from uqmbd.dynamics.assembly.undefined import REMEDY, describe_undefined
from uqmbd.dynamics.equations import Model, impossible, state_arguments
from uqmbd.dynamics.linear import RANK_TOLERANCE, accelerations
from uqmbd.mechanism import LARGEST
from uqmbd.typing import Array, Index

__all__ = [
    "assemble",
    "dropped_in_dead_centre",
    "independent_rows",
    "placed",
    "positions",
    "statement_rows",
    "velocities",
]


POSITION_TOLERANCE = 1e-12
ITERATIONS = 200

ROUNDED = 2e-7
"""Allowed contradiction of given velocities, relative to the largest velocity: the accuracy of seven digits. Given
velocities are adjusted; the constraints are satisfied to rounding."""
SLOW = 1e-4
"""Lower bound of given speeds, m/s or rad/s, in the check of amplification near a dead centre."""
AMPLIFIED = 1e6
"""Speed relative to given speeds above which the sensitivity to the pose is checked."""
DIGITS = 1e-6
"""Allowed relative change of a speed if the pose changes by its closure error."""
BLOCK = 1 << 20
"""Number of gradient entries that are evaluated together."""
SHIFT = 1e-6
"""Displacement along a motion over which gradients are compared, m or rad."""
REFUSED = "State fewer of them, or consistent ones."
LEAST_ROUNDED = 1e-8
"""Least allowed contradiction of given velocities, m/s or rad/s."""


def _constraints(model: Model, q: Array, time: float, parameters: Array) -> dict[str, Array]:
    still = np.zeros((len(q), model.layout.states))
    return model.evaluate("position", state_arguments(time, q, still, np.zeros_like(q)), parameters)


def _scales(gradient: Array) -> Array:
    """Return the norm of the gradient of each equation; a residual divided by it is a displacement."""
    norm = np.linalg.norm(np.ascontiguousarray(gradient), axis=2)
    return np.where(norm > 1e-9, norm, 1.0)


def positions(
    model: Model, drawn: Array, time: float, parameters: Array, rows: Index | None = None
) -> tuple[Array, list[str]]:
    """Close the constraints by the least change of given poses (K, coordinate), then satisfy start conditions.

    Return assembled poses (K, coordinate), and for each realisation the reason of failure or an empty text.  The
    independent equations are `rows`; by default they are chosen by singular values.
    """
    if model.conditions is None or not len(model.conditions.positions):
        return _closed(model, drawn, time, parameters, rows)
    q, _, messages = placed(model, drawn, time, parameters, rows)
    return q, messages


def placed(
    model: Model, drawn: Array, time: float, parameters: Array, rows: Index | None
) -> tuple[Array, Array, list[str]]:
    """Return the poses of `positions`, their auxiliary states, and messages."""
    q, messages = _closed(model, drawn, time, parameters, rows)
    s = np.zeros((len(q), model.layout.states))
    if model.layout.states:
        s = model.evaluate("initial", state_arguments(time, q, s, np.zeros_like(q)), parameters)["s"]
    if model.conditions is not None and len(model.conditions.positions) and not all(messages):
        good = np.flatnonzero([not m for m in messages])
        q[good], s[good], found = met(model, q[good], s[good], time, parameters[good], rows)
        for k, message in zip(good.tolist(), found, strict=True):
            messages[k] = message
    return q, s, messages


def _closed(model: Model, drawn: Array, time: float, parameters: Array, rows: Index | None) -> tuple[Array, list[str]]:
    """Close all constraints by the smallest change of bodies; change coordinates of components only if necessary."""
    own = np.arange(model.of_bodies, model.layout.coordinates)
    if not len(own) or not model.bodies:
        return _moved_least(model, drawn, time, parameters, rows)
    q, messages = _moved_least(replace(model, held=np.union1d(model.held, own)), drawn, time, parameters, rows)
    left = np.flatnonzero([bool(m) for m in messages])
    if len(left):
        q[left], found = _moved_least(model, drawn[left], time, parameters[left], rows)
        for k, message in zip(left.tolist(), found, strict=True):
            messages[k] = message
    return q, messages


def _moved_least(
    model: Model, drawn: Array, time: float, parameters: Array, rows: Index | None
) -> tuple[Array, list[str]]:
    """Close all constraints by the smallest change of given poses: by the compiled driver, then by `iterate_poses`."""
    if rows is None:
        return iterate_poses(model, drawn, time, parameters, rows)
    q, undecided = closed_poses(model, drawn, time, parameters, rows)
    messages = [""] * len(q)
    left = np.flatnonzero(undecided)
    if len(left):
        q[left], found = iterate_poses(model, drawn[left], time, parameters[left], rows)
        for k, message in zip(left.tolist(), found, strict=True):
            messages[k] = message
    return q, messages


def iterate_poses(
    model: Model, drawn: Array, time: float, parameters: Array, rows: Index | None
) -> tuple[Array, list[str]]:
    """Close all constraints by the smallest change of given poses, even if singular; return poses and messages."""
    n = drawn.shape[1]
    free = np.setdiff1d(np.arange(n), model.held)
    q = drawn.copy()
    size = np.maximum(1.0, np.abs(drawn[:, : model.dimension]).max(axis=1, initial=0.0))
    now = _constraints(model, q, time, parameters)
    scale = _scales(now["phi_q"])
    residual = now["phi"] / scale
    active = np.abs(residual).max(axis=1, initial=0.0) > POSITION_TOLERANCE * size
    quaternions = model.quaternions()
    for _ in range(ITERATIONS):
        todo = np.flatnonzero(active)
        if not len(todo):
            break
        used = slice(None) if rows is None else rows
        a = (now["phi_q"][todo] / scale[todo][:, :, None])[:, used][:, :, free]
        r = residual[todo][:, used]
        move = np.zeros((len(todo), n))
        move[:, free] = -solve_least_norm(a, r, truncate=rows is None)
        # limit rotations in one iteration to about 0.6 rad, because the linearisation is invalid for larger rotations
        largest = (
            np.abs(move[:, quaternions.ravel()]).max(axis=1, initial=0.0) if quaternions.size else np.zeros(len(todo))
        )
        move /= np.maximum(1.0, largest / 0.3)[:, None]
        before = np.linalg.norm(residual[todo], axis=1)
        step = np.ones(len(todo))
        pending = np.arange(len(todo))
        best_q = q[todo].copy()
        for halving in range(14):
            trial = _normalised(
                q[todo[pending]] + step[pending, None] * move[pending], quaternions, step[pending], model.held
            )
            there = _constraints(model, trial, time, parameters[todo[pending]])
            after = np.linalg.norm(there["phi"] / scale[todo[pending]], axis=1)
            good = (after < before[pending]) | (after < POSITION_TOLERANCE * size[todo[pending]])
            best_q[pending[good]] = trial[good]
            pending = pending[~good]
            step[pending] /= 2
            if not len(pending):
                break
            if halving == 13:
                active[todo[pending]] = False  # no descent: the pose is as close as possible
        moved = np.abs(best_q - q[todo]).max(axis=1, initial=0.0)
        q[todo] = best_q
        now = _constraints(model, q, time, parameters)
        scale = _scales(now["phi_q"])
        residual = now["phi"] / scale
        still = np.abs(residual).max(axis=1, initial=0.0) <= POSITION_TOLERANCE * size
        active[still] = False
        active[todo[moved < 1e-16 * size[todo]]] = False
    return q, _position_messages(model, q, time, parameters, now, residual, size)


def _normalised(q: Array, quaternions: Index, step: Array, held: Index) -> Array:
    """Return coordinates with normalised quaternions after a long step."""
    if not quaternions.size:
        return q
    e = q[:, quaternions]
    length = np.linalg.norm(e, axis=2, keepdims=True)
    far = np.abs(length - 1) > 1e-6
    free = np.asarray(~np.isin(quaternions, held).any(axis=1))
    far &= free[None, :, None]
    q = q.copy()
    q[:, quaternions] = np.where(far, e / np.where(length > 0.1, length, 1.0), e)
    return q


def _position_messages(
    model: Model, q: Array, time: float, parameters: Array, now: dict[str, Array], residual: Array, size: Array
) -> list[str]:
    messages = []
    for k in range(len(residual)):
        worst = np.abs(residual[k])
        message = ""
        if worst.size and not worst.max() <= 1e-9 * size[k]:
            if not np.all(np.isfinite(worst)):
                i = int(np.argmax(~np.isfinite(worst)))
                messages.append(
                    f"the equation {model.equations[i]!r} is {now['phi'][k, i]:g}: an argument of "
                    f"{model.owners[i]!r}, such as a driver's function of time, has no finite value. {REMEDY}"
                )
                continue
            i = int(np.argmax(worst))
            owners = _largest_owners(model, worst)
            remedy = dead_centre_of_pose(model, q[k], time, parameters[k], residual[k])
            message = (
                f"{owners} cannot be closed: equation {model.equations[i]!r} has a residual of {now['phi'][k, i]:.3g} "
                f"(about {worst[i]:.3g} m or rad apart). "
                + (remedy or "Check the points, axes and lengths, and the given pose.")
            )
        elif now["cos"].size and now["cos"][k].min() < 0:
            i = int(np.argmin(now["cos"][k]))
            message = (
                f"{model.cosines[i]} was assembled in its mirror image, half a turn off "
                f"(cosine {now['cos'][k, i]:.3g}). Give the body a pose closer to the intended one."
            )
        messages.append(message)
    return messages


def _largest_owners(model: Model, worst: Array) -> str:
    by_owner: dict[str, float] = {}
    for owner, value in zip(model.owners, worst, strict=True):
        by_owner[owner] = max(by_owner.get(owner, 0.0), float(value) if np.isfinite(value) else np.inf)
    ranked = sorted(by_owner, key=lambda o: -by_owner[o])
    others = [repr(o) for o in ranked[1:4] if by_owner[o] > 0.3 * by_owner[ranked[0]]]
    return f"joint {ranked[0]!r}" + (f" (together with {', '.join(others)})" if others else "")


def dropped_in_dead_centre(model: Model, parameters: Array, time: float) -> str:
    """Return a message on omitted redundant equations that follow from others only in the assembled pose.

    `parameters` (1, parameter) belong to one realisation.
    """
    q, messages = positions(model, parameters[:, model.drawn], time, parameters, model.layout.independent_holonomic)
    if messages[0]:
        return ""
    here = locally_dependent(model, q[0], time, parameters[0])
    if not len(here):
        return ""
    return (
        f"The given pose is a dead centre: the equations {named(model, here)} are redundant in this pose only, so the "
        "motion from this pose is not determined. Give a pose slightly farther along the motion, or drive "
        "another joint."
    )


def independent_rows(gradient: Array, first: Index, last: Index | None = None) -> tuple[Index, Index]:
    """Split equations into independent and redundant equations (sorted indices) by gradients (equation, coordinate).

    The gradients are ``Phi_q`` at an assembled pose, or ``D`` for velocity equations.  Equations `first` (unit
    quaternions) have priority over all others.  Equations `last` (velocity equations) have the lowest priority and
    never replace a position equation.
    """
    m = len(gradient)
    if last is not None and len(last):
        early = np.setdiff1d(np.arange(m), last)
        held = early[independent_rows(gradient[early], np.searchsorted(early, first))[0]]
        some = np.union1d(held, last)
        found = some[independent_rows(gradient[some], np.searchsorted(some, held))[0]]
        return found, np.setdiff1d(np.arange(m), found)
    if m == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    norm = np.linalg.norm(gradient, axis=1)
    a = gradient / np.where(norm > 1e-12, norm, 1.0)[:, None]
    others = np.setdiff1d(np.arange(m), first)
    basis = scipy.linalg.orth(a[first].T) if len(first) else np.zeros((a.shape[1], 0))
    rest = a[others] - (a[others] @ basis) @ basis.T
    if not len(others):
        return np.arange(m), np.zeros(0, dtype=np.int64)
    _, r, pivots = scipy.linalg.qr(rest.T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    rank = int(np.sum(diagonal > RANK_TOLERANCE * max(1.0, diagonal.max(initial=0.0))))
    kept = np.sort(np.concatenate([first, others[pivots[:rank]]]))
    return kept.astype(np.int64), np.setdiff1d(np.arange(m), kept).astype(np.int64)


def velocities(
    model: Model, q: Array, s: Array, time: float, parameters: Array, all_parameters: Array
) -> tuple[Array, list[str]]:
    """Return velocities (K, coordinate) of least norm that satisfy constraints and stated velocities, and messages.

    A message names the contradictions of a realisation; it is empty without contradictions.
    """
    messages = [""] * len(q)
    conditioned = model.conditions is not None and len(model.conditions.velocities) > 0
    if not model.statements and not conditioned and not model.rheonomic:
        return np.zeros_like(q), messages
    v, undecided = least_velocities(model, q, s, time, all_parameters)
    left = np.flatnonzero(undecided)
    if len(left):
        v[left], found = _stated(model, q[left], s[left], time, parameters[left], all_parameters[left])
        for k, message in zip(left.tolist(), found, strict=True):
            messages[k] = message
    numbers = np.concatenate([x.parameters for x in model.statements] or [np.zeros(0, dtype=np.int64)])
    stated = np.abs(all_parameters[:, numbers]).max(axis=1, initial=SLOW)
    fast = np.flatnonzero(np.abs(v).max(axis=1, initial=0.0) > AMPLIFIED * stated)
    together = max(1, BLOCK // ((len(model.equations) + v.shape[1]) * v.shape[1]))
    for first in range(0, len(fast), together):
        some = fast[first : first + together]
        which, given = _undetermined(model, q[some], s[some], v[some], time, parameters[some], all_parameters[some])
        for k, size in zip(some[which].tolist(), given.tolist(), strict=True):
            messages[k] = messages[k] or amplified(model, v[k], size)
    return v, messages


def _undetermined(
    model: Model, q: Array, s: Array, v: Array, time: float, parameters: Array, all_parameters: Array
) -> tuple[Index, Array]:
    """Find the realisations with velocities (K, n) that an assembled pose does not determine to six digits.

    The pose is closed as far as possible.  Return the indices, and for each the largest given speed over the length of
    its gradient.  A ratio of speeds would depend on units and lengths. The criterion is therefore the change of
    velocities with the pose along the motion.
    """
    a, b, _ = _speed_equations(model, q, s, time, parameters, all_parameters)
    length = np.linalg.norm(a, axis=2)
    length = np.where(length > 1e-12, length, 1.0)
    given = np.abs(b / length).max(axis=1, initial=SLOW)
    largest = np.abs(v).max(axis=1, initial=0.0)
    which = np.flatnonzero((largest > AMPLIFIED * given) & np.isfinite(v).all(axis=1))
    if not len(which):
        return which, given[which]
    q, s, v, largest, length = q[which], s[which], v[which], largest[which], length[which]
    left = []
    for side in (SHIFT, -SHIFT):
        moved = q + side * v / largest[:, None]
        rows, right, _ = _speed_equations(model, moved, s, time, parameters[which], all_parameters[which])
        left.append((right - (rows @ v[:, :, None])[:, :, 0]) / length)
    change = solve_least_norm(a[which] / length[:, :, None], (left[0] - left[1]) / (2 * SHIFT), truncate=True)
    off = POSITION_TOLERANCE * np.maximum(1.0, np.abs(q[:, : model.dimension]).max(axis=1, initial=0.0))
    lost = off * np.abs(change).max(axis=1) > DIGITS * largest
    return which[lost], given[which][lost]


def _stated(
    model: Model, q: Array, s: Array, time: float, parameters: Array, all_parameters: Array
) -> tuple[Array, list[str]]:
    """Solve for `velocities` by singular values if equations are nearly dependent; report contradictions."""
    kept, (a, b, names) = model.layout.kept, _speed_equations(model, q, s, time, parameters, all_parameters)
    if len(names) == len(model.equations):
        return solve_least_norm(a[:, kept], b[:, kept], truncate=False), [""] * len(q)
    a, b, v, error = _least_contradicting(a, b)
    limit = np.maximum(LEAST_ROUNDED, ROUNDED * np.abs(b).max(axis=1, initial=0.0))
    v = _moved_onto(a[:, kept], b[:, kept], v)
    messages = []
    for k in range(len(q)):
        if error[k].max(initial=0.0) <= limit[k]:
            messages.append("")
            continue
        guilty = list(dict.fromkeys(names[i] for i in np.argsort(-error[k]) if error[k, i] > 0.05 * error[k].max()))
        statements = [g for g in guilty if g not in model.equations] or sorted(set(names[len(model.equations) :]))
        of_components = {model.equations[i] for i in model.of_components(np.arange(len(model.equations)))}
        joints = [g for g in guilty if g in of_components]
        messages.append(
            f"the stated {' and '.join(statements)} contradict{'s' if len(statements) == 1 else ''} "
            + (
                f"the constraint{'s' * (len(joints) != 1)} {', '.join(map(repr, joints[:4]))}"
                if joints
                else "one another"
            )
            + f" (by {error[k].max():.3g}). "
            + (_dead_centre(model, q, s, time, parameters, all_parameters, k, a[k, kept], error[k].max()) or REFUSED)
        )
    return v, messages


def _speed_equations(
    model: Model, q: Array, s: Array, time: float, parameters: Array, all_parameters: Array
) -> tuple[Array, Array, list[str]]:
    """Return gradients (K, m, n), right-hand sides (K, m) and names of all conditions on velocities."""
    found = model.evaluate("velocity", state_arguments(time, q, s, np.zeros_like(q)), parameters)
    rows, values, names = [found["d"], *statement_rows(model, q)], [-found["phi_t"]], list(model.equations)
    for statement in model.statements:
        stated = all_parameters[:, statement.parameters]
        values.append(stated)
        names += [f"{statement.quantity} of body {statement.body}"] * stated.shape[1]
    conditions = model.conditions
    if conditions is not None and len(conditions.velocities):
        value, _, slope = conditions(q, s, time, all_parameters)
        rows.append(slope[:, conditions.velocities])
        values.append(-value[:, conditions.velocities])
        names += [f"start condition {conditions.names[k]}" for k in conditions.velocities]
    return np.concatenate(rows, axis=1), np.concatenate(values, axis=1), names


def _least_contradicting(a: Array, b: Array) -> tuple[Array, Array, Array, Array]:
    """Scale gradients to length one; return gradients, right-hand sides, least-error velocities, and the error."""
    a = np.ascontiguousarray(a)
    scale = np.linalg.norm(a, axis=2)
    scale = np.where(scale > 1e-12, scale, 1.0)
    a, b = a / scale[:, :, None], b / scale
    with np.errstate(all="ignore"):
        v = solve_least_norm(a, b, truncate=True)
    return a, b, v, np.abs((a @ v[:, :, None])[:, :, 0] - b)


def _dead_centre(
    model: Model,
    q: Array,
    s: Array,
    time: float,
    parameters: Array,
    all_parameters: Array,
    k: int,
    directions: Array,
    error: float,
) -> str:
    """Return a message if realisation k is in a dead centre in which the given velocities are impossible."""
    one = slice(k, k + 1)

    def contradiction(moved: Array) -> float:
        equations = _speed_equations(model, moved[None], s[one], time, parameters[one], all_parameters[one])
        return float(_least_contradicting(*equations[:2])[3].max())

    def close(drawn: Array) -> tuple[Array, list[str]]:
        return _closed(model, drawn, time, parameters[one], model.layout.independent_holonomic)

    return dead_centre_of_speeds(model, q[k], directions, error, contradiction, close)


def _moved_onto(a: Array, b: Array, v: Array) -> Array:
    """Change velocities (K, n) by the least amount that satisfies ``a v = b``.

    Integrators therefore start on the constraints. A second correction removes errors from rounding.
    """
    for _ in range(2):
        v = v + solve_least_norm(a, b - (a @ v[:, :, None])[:, :, 0], truncate=True)
    return v


def statement_rows(model: Model, q: Array) -> list[Array]:
    """Return gradients of given velocities of bodies with respect to velocities, (K, number, n) per statement."""
    count, n = q.shape
    found = []
    for statement in model.statements:
        number = len(statement.coordinates)
        if statement.quantity == "velocity":
            block = np.zeros((count, number, n))
            block[:, np.arange(number), statement.coordinates] = 1.0
        else:
            block = np.zeros((count, len(statement.parameters), n))
            block[:, :, statement.coordinates] = _body_rate(q[:, statement.coordinates])
        found.append(block)
    return found


def _body_rate(e: Array) -> Array:
    """Return the matrix from quaternion rates to the angular velocity in body axes, ``2 G(e)``."""
    lines = BODY_RATE[e.shape[1]]
    return 2 * np.stack([np.stack([sign * e[:, k] for k, sign in line], axis=1) for line in lines], axis=1)


def assemble(model: Model, all_parameters: Array, time: float) -> Start:
    """Return consistent initial states of realisations (K, parameter), with messages for failed assemblies."""
    bad: NDArray[np.bool_] = np.asarray(~(np.abs(all_parameters) <= LARGEST).all(axis=1))
    safe = all_parameters
    if bad.any():
        safe = np.where(bad[:, None], np.nan_to_num(safe, nan=1.0, posinf=1.0, neginf=1.0), safe)
    q, s, messages = placed(model, safe[:, model.drawn], time, safe, model.layout.independent_holonomic)
    v, contradictions = velocities(model, q, s, time, safe, safe)
    forbidden = impossible(model.limits, model.tensors, safe)
    outside = ~bad & np.array([bool(n) for n in forbidden], dtype=bool)
    if bad.any() or any(forbidden) or any(messages) or any(contradictions):
        messages = [
            f"a parameter is not finite, or larger than {LARGEST:g}" if b else (n or m or c)
            for b, n, m, c in zip(bad, forbidden, messages, contradictions, strict=True)
        ]
        good = np.flatnonzero([not m for m in messages])
        a, rates, multipliers = np.zeros_like(q), np.zeros_like(s), np.zeros((len(q), model.layout.rank))
        a[good], multipliers[good], rates[good] = accelerations(model, q[good], s[good], v[good], time, safe[good])
    else:
        a, multipliers, rates = accelerations(model, q, s, v, time, safe)
    for k in np.flatnonzero(~np.isfinite(a).all(axis=1)):
        messages[k] = describe_undefined(model, q[k], s[k], v[k], time, safe[k]) or singular_pose(
            model, q[k], s[k], time, safe[k]
        )
    return Start(q, s, v, a, rates, multipliers, tuple(messages), outside)
