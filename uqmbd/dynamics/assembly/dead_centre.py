"""Dead centres: poses in which constraints or given velocities are dependent, but independent in neighbouring poses.

At a dead centre, a linear combination of equations is in the left null space of the Jacobian. This combination is the
left singular vector of a vanishing singular value. Redundant equations have such a combination in every pose. A dead
centre is recognised by the curvature of the residual along the remaining motions, or by possible velocities near it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uqmbd.dynamics.assembly.least_norm import solve_least_norm
from uqmbd.dynamics.assembly.rank import gradient, joints, named
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.typing import Array, Index

__all__ = [
    "amplified",
    "dead_centre_of_pose",
    "dead_centre_of_speeds",
    "locally_dependent",
    "singular_pose",
]


UNFELT = 0.3
"""Share of the residual that no motion changes to first order; a pose with a smaller share is no dead centre."""

VANISHING = 1e-3
"""Singular value, relative to the largest, below which motions count as possible."""

CURVED = 0.02
"""Least curvature of the residual at a dead centre, relative to the size of the mechanism."""

BENT = 4.0
"""Least curvature, relative to the residual, for which a neighbouring pose can close the constraints."""

ASIDE = 1e-2
"""Distance to the neighbouring poses at which a contradiction is evaluated again."""

BETTER = 0.1
"""Largest remaining part of a contradiction next to a dead centre."""

NEWTON = 8
"""Number of Newton steps for the projection of a pose onto the selected equations."""

DIRECTIONS = 12
"""Largest number of examined motions."""

ROUNDED_LENGTH = 1e-3
"""Largest gap that rounded input values may cause, relative to the size of the mechanism."""

Close = Callable[[Array], tuple[Array, list[str]]]


def dead_centre_of_pose(model: Model, q: Array, time: float, parameters: Array, residual: Array) -> str:
    """Return a message if the pose nearest to closure (coordinate,) is a dead centre; else an empty text.

    Residuals (equation,) are divided by the lengths of their gradients, m or rad.
    """
    free = np.setdiff1d(np.arange(len(q)), model.held)
    a, lengths = _scaled(model, q, time, parameters)
    size = float(np.linalg.norm(residual))
    if not (size > 0.0 and np.isfinite(a).all() and np.isfinite(size)):
        return ""
    a = a[:, free]
    motions, unfelt, smallest = _motions(a)
    u = unfelt @ (residual @ unfelt)
    if not motions.shape[1] or float(np.linalg.norm(u)) < UNFELT * size:
        return ""
    size = float(np.linalg.norm(u))
    u = u / size
    combined = u / lengths

    def pull(shift: Array) -> Array:
        moved = q.copy()
        moved[free] += shift
        rows: Array = combined @ _phi_q(model, moved, time, parameters)[:, free]
        return rows

    # second derivatives by central differences of exact gradients: truncation is of the order 1e-8, rounding 1e-12
    bend = np.array([pull(1e-4 * x) - pull(-1e-4 * x) for x in motions.T]) / 2e-4 @ motions
    values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
    # along a negative curvature the equations close at second order, so such a motion takes precedence
    way = int(np.argmin(values)) if values[0] < -0.1 * np.abs(values).max() else int(np.argmax(np.abs(values)))
    curvature, shift = float(values[way]), motions @ vectors[:, way]
    if abs(curvature) < max(CURVED * min(1.0, model.length), BENT * size):
        return ""
    move = np.zeros(len(q))
    move[free] = shift
    bodies, owners = _moved(model, move), joints(model, _heavy(u))
    found = (
        f"The pose is a dead centre: to first order no motion of {bodies} closes {owners}"
        f" (smallest singular value of the constraints there: {smallest:.1g})"
    )
    others = _driven_otherwise(model)
    if curvature < 0:
        far = float(np.sqrt(2 * size / -curvature))  # size + curvature far^2 / 2 = 0
        return (
            f"{found}, and the mechanism may move to either side. Move the given pose of {bodies} to the intended "
            f"side, by about {far:.1g} m or rad{others}."
        )
    gap = _missing(model, combined[:, None] * _phi_q(model, q, time, parameters), size)
    missing = f": about {gap:.2g} m are missing" if np.isfinite(gap) else ""
    if gap < ROUNDED_LENGTH * model.length:
        missing += ", which may be caused by rounded input values"
    amount = " by slightly more than this gap" if np.isfinite(gap) else ""
    return (
        f"{found}, and every motion increases the gap: lengths, or prescribed values of a driver, are out of "
        f"reach{missing}. "
        f"Change a length or prescribed value{amount}, and move the given pose of {bodies} away from this pose{others}."
    )


def _missing(model: Model, pull: Array, size: float) -> float:
    """Return the displacement of points of the most loaded joint that closes all equations, m; infinite if none.

    `pull` contains gradients (equation, coordinate) times the null combination with the remaining residual `size`. The
    sums over the equations of a joint are forces on the bodies, independent of the form of the equations.
    """
    forces = model.by_body(pull)[:, :, : model.dimension]
    owners = np.unique(np.array(model.owners), return_inverse=True)[1]
    summed = np.zeros((int(owners.max()) + 1, *forces.shape[1:]))
    np.add.at(summed, owners, forces)
    largest = float(np.linalg.norm(summed, axis=2).max())
    return size / largest if largest > 1e-6 else np.inf


def dead_centre_of_speeds(
    model: Model, q: Array, directions: Array, error: float, contradiction: Callable[[Array], float], close: Close
) -> str:
    """Return a message if velocities cannot be realised because the assembled pose is a dead centre; else empty.

    `directions` (equation, coordinate) are the gradients of the kept constraints; `error` is the contradiction between
    statements and constraints, and `contradiction` evaluates it in another pose.  The callable `close` assembles given
    poses (K, coordinate).
    """
    motions, *_ = _motions(directions)
    if not motions.shape[1]:
        return ""
    better = [
        x for x in motions.T[:DIRECTIONS] if any(_can_be_met(q + k * x, error, contradiction, close) for k in _SIDES)
    ]
    if not better:
        return ""
    bodies = _moved(model, np.sqrt(np.sum(np.square(better), axis=0)))
    return (
        f"The pose is a dead centre: the stated velocities are possible near this pose, but in this pose only {bodies} "
        "can move. "
        f"State velocities of {bodies} instead, or give another pose, slightly farther along the motion."
    )


_SIDES = (ASIDE, -ASIDE)


def _can_be_met(drawn: Array, error: float, contradiction: Callable[[Array], float], close: Close) -> bool:
    """Return whether the start conditions can be satisfied in the pose nearest to a given pose."""
    q, messages = close(drawn[None])
    return not messages[0] and contradiction(q[0]) < BETTER * error


def amplified(model: Model, v: Array, given: float) -> str:
    """Return a message if given speeds do not determine the motion near a dead centre."""
    bodies = _moved(model, v)
    return (
        f"the pose is next to a dead centre: the stated velocities (at most {given:.3g} m/s or rad/s) require speeds "
        f"of {float(np.abs(v).max()):.1g} m/s or rad/s of {bodies}. A pose that satisfies the constraints to 1e-12 "
        f"does not determine these speeds. State velocities of {bodies} instead, or give a pose farther along the "
        "motion."
    )


def locally_dependent(model: Model, q: Array, time: float, parameters: Array) -> Index:
    """Find the equations that were omitted as redundant but follow from the others only in this pose.

    Redundant equations remain closed along the motions that the other equations allow.
    """
    none = np.zeros(0, dtype=np.int64)
    left = np.setdiff1d(np.arange(model.layout.constraints), np.union1d(model.layout.kept, model.layout.nonholonomic))
    if not len(left):
        return none
    a, lengths = _scaled(model, q, time, parameters)
    free, kept = np.setdiff1d(np.arange(len(q)), model.held), model.layout.independent_holonomic
    if not np.isfinite(a).all():
        return none
    motions, *_ = _motions(a[kept][:, free])
    move = np.zeros((motions.shape[1], len(q)))
    move[:, free] = motions.T
    found = set[int]()
    for x in move[:DIRECTIONS]:
        for side in _SIDES:
            moved, size = q + side * x, min(1.0, model.length)
            for _ in range(NEWTON):
                phi = _closing(model, moved, time, parameters)["phi"][0] / lengths
                # once independent equations are closed to 1e-11, other residuals are rounding errors, or far above 1e-7
                if np.abs(phi[kept]).max(initial=0.0) < 1e-11 * size:
                    found |= set(left[np.abs(phi[left]) > 1e-7 * size].tolist())
                    break
                a, _ = _scaled(model, moved, time, parameters)
                moved[free] -= solve_least_norm(a[None, kept][:, :, free], phi[None, kept], truncate=True)[0]
    return np.array(sorted(found), dtype=np.int64)


def singular_pose(model: Model, q: Array, s: Array, time: float, parameters: Array) -> str:
    """Return a message on undetermined accelerations in an assembled pose, with the dependent equations."""
    what = "the accelerations are not determined: for these inputs the assembled pose is "
    kept = gradient(model, q, s, time, parameters)[model.layout.kept]
    if not (len(kept) and np.isfinite(kept).all()):
        return f"{what}singular"
    _, combinations, smallest = _motions(kept)
    if not combinations.shape[1]:
        return f"{what}singular"
    rows = model.layout.kept[_heavy(combinations[:, -1])]
    return (
        f"{what}a dead centre, in which the equations {named(model, rows)} depend on each other (smallest singular "
        f"value {smallest:.1g}). Give another pose, slightly farther along the motion, or choose inputs that do not "
        "lead to this pose"
    )


def _closing(model: Model, q: Array, time: float, parameters: Array) -> dict[str, Array]:
    """Evaluate the position equations of one realisation."""
    state = state_arguments(time, q[None], np.zeros((1, model.layout.states)), np.zeros_like(q)[None])
    return model.evaluate("position", state, parameters[None])


def _phi_q(model: Model, q: Array, time: float, parameters: Array) -> Array:
    rows: Array = _closing(model, q, time, parameters)["phi_q"][0]
    return rows


def _scaled(model: Model, q: Array, time: float, parameters: Array) -> tuple[Array, Array]:
    """Return gradients of all position equations, scaled to length one, and their original lengths."""
    a = _phi_q(model, q, time, parameters)
    lengths = np.linalg.norm(a, axis=1)
    lengths = np.where(lengths > 1e-9, lengths, 1.0)
    return a / lengths[:, None], lengths


def _motions(a: Array) -> tuple[Array, Array, float]:
    """Return the approximate null spaces of a matrix, and its smallest singular value.

    The null spaces are orthonormal motions (coordinate, motion), and combinations of equations (equation, combination).
    """
    left, values, right = np.linalg.svd(a)
    largest = float(values.max(initial=0.0))
    rank = int(np.sum(values > VANISHING * max(largest, 1e-300)))
    return right[rank:].T, left[:, rank:], float(values.min(initial=largest))


def _heavy(u: Array) -> Index:
    order = np.argsort(-np.abs(u), kind="stable")
    rows: Index = order[np.abs(u[order]) > 0.1 * np.abs(u).max()].astype(np.int64)
    return rows


def _moved(model: Model, move: Array) -> str:
    """Return the names of the bodies with the largest motion."""
    bodies = np.linalg.norm(model.by_body(move), axis=1)
    each = np.concatenate([bodies, np.abs(move[model.of_bodies :])])
    order = np.argsort(-each, kind="stable")
    firsts = [*range(0, model.of_bodies, model.size), *range(model.of_bodies, len(move))]
    return _listed([model.carrier(firsts[k]) for k in order.tolist() if each[k] > 0.1 * each.max()][:3])


def _listed(names: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _driven_otherwise(model: Model) -> str:
    """Return a message on the drivers, and on possible replacements."""
    owners = dict.fromkeys(
        model.owners[target[1]] for target in model.evaluators["velocity"].targets if target[0] == "phi_t"
    )
    return f", or drive a joint other than the joint of {_listed([repr(x) for x in owners])}" if owners else ""
