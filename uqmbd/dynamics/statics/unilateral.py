"""Dry friction and rigid contacts in statics: forces that are not functions of the pose, and have no linearisation.

Dry friction that sticks balances any force up to its limit. The poses at rest are then a set, and `static_equilibria`
computes the pose of this set at which the forces balance without friction. Its other poses are, to first order, within

    |dq| <= N (N^T K N)^-1 N^T J^T f

of this pose, with the stiffness ``K``, the free directions ``N``, the sliding directions ``J`` and the limit ``f``.
Small motions of sticking joints are locked, and small motions of sliding joints are not linear. Equations of rigid
contacts are inequalities, which statics omits. All functions of this package therefore call this module: an equilibrium
with overlapping bodies fails, and so does a linearisation in which friction or contact acts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model, OutputMap, state_arguments
from uqmbd.dynamics.observation import observe_along
from uqmbd.dynamics.statics.rest_equations import RestEquations, tangents
from uqmbd.typing import Array

__all__ = ["Range", "has_dry_friction", "not_linear", "not_steady", "overlaps", "ranges_by_friction"]


ACTS = 1e-9
"""Part of a direction that the constraints allow, relative to the direction, above which a force along it acts."""

CLOSED = 1e-7
"""Gap of a rigid contact, relative to the size of the mechanism, that counts as closed."""

FLAT = 1e-11
"""Stiffness, relative to the largest stiffness, that counts as zero."""

STEP = 1e-4
"""Step of the central differences of outputs, relative to the displacement."""

NOT_LINEAR = (
    "Use smooth friction (for example with a transition speed), friction=0 for the mechanism that slides, or a "
    "constraint for the joint that sticks; or simulate the motion"
)


class _Force(NamedTuple):
    """Dry friction or a rigid contact of one state."""

    component: str
    dry: bool
    size: float  # gap, m, of a contact; limit, N or N m, of dry friction
    along: Array  # (direction, coordinate), within the constraints


def has_dry_friction(model: Model) -> bool:
    """Return whether a model has dry friction."""
    return any(model.given_loads)


def not_linear(ensemble: Batch, q: Array, s: Array) -> list[str]:
    """Return reasons why small motions about poses at rest (K, coordinate) are not linear; empty texts for others."""
    found: list[str] = []
    if not _candidates(ensemble.model):
        return [""] * len(q)
    for forces in map(list, _acting(ensemble, q, s, None)):
        reason = ""
        if dry := _named([x for x in forces if x.dry]):
            reason = f"small motions are not linear, because the dry friction of {dry} sticks at rest. {NOT_LINEAR}"
        elif forces:
            reason = (
                f"small motions are not linear, because the rigid contact {_named(forces)} is closed and may open. Use "
                "a compliant contact, or a constraint instead of the contact"
            )
        found.append(reason)
    return found


def not_steady(ensemble: Batch, q: Array, s: Array, v: Array) -> list[str]:
    """Return reasons why steady motions with states (K, coordinate) are not those of the mechanism; empty: none."""
    found: list[str] = []
    if not _candidates(ensemble.model):
        return [""] * len(q)
    for forces in map(list, _acting(ensemble, q, s, v)):
        kind = "dry friction" if any(x.dry for x in forces) else "rigid contacts"
        found.append(
            f"steady motions are computed without {kind}, but the force of {_named(forces)} acts. Use smooth friction "
            "and compliant contacts, or simulate the motion"
            if forces
            else ""
        )
    return found


def overlaps(ensemble: Batch, q: Array, s: Array) -> list[str]:
    """Return reasons why poses at rest (K, coordinate) are impossible: overlaps of rigid contacts; empty: none."""
    found: list[str] = []
    if not _candidates(ensemble.model):
        return [""] * len(q)
    limit = CLOSED * max(1.0, ensemble.model.length)
    for forces in _acting(ensemble, q, s, None):
        deep = [x for x in forces if not x.dry and x.size < -limit]
        worst = min(deep, key=lambda x: x.size, default=None)
        found.append(
            ""
            if worst is None
            else f"static equilibrium omits rigid contacts, and bodies would overlap by {-worst.size:.3g} m at "
            f"{worst.component!r}. Use a compliant contact, or start='drawn'"
        )
    return found


class Range(NamedTuple):
    """Range of an expression at rest due to dry friction, to first order: components, value without it, half width."""

    components: str
    value: float
    half_width: float  # infinite: friction holds the mechanism in any pose


def ranges_by_friction(one: Batch, q: Array, s: Array, seen: OutputMap | None) -> tuple[Range, ...]:
    """Return the ranges of expressions over the poses at rest of one realisation; empty if no dry friction acts.

    The pose (1, coordinate) is that without friction. Without expressions, the only range has no value.
    """
    (forces,) = (list(x) for x in _acting(one, q, s, None))
    dry = [x for x in forces if x.dry]
    if not dry:
        return ()
    names = _named(dry)
    if seen is None:
        return (Range(names, np.nan, np.nan),)
    time = np.array([one.model.time])

    def observed(place: Array, states: Array) -> Array:
        return observe_along(one, seen, time, np.concatenate([place, states, 0 * place], axis=1)[:, None])[0, :, 0]

    rest, every, free = RestEquations(one), np.arange(1), one.model.layout.free
    now = rest.forces(every, rest.coordinates(q), s)
    found = rest.derivatives(every, rest.coordinates(q), s, now.multipliers())
    basis = tangents(now.gradient)[0]
    stiffness = basis.T @ (found["vq"] + found["vs"] @ now.carry)[0] @ basis
    left, sizes, right = np.linalg.svd(stiffness)
    stiff = sizes > FLAT * max(float(np.abs(found["vq"]).max(initial=0.0)), 1e-300)
    width = np.zeros(len(seen.names))
    for force in dry:
        pushed = force.size * force.along[:, free] @ basis
        loose = np.abs(pushed @ left[:, ~stiff]).max(initial=0.0) > ACTS * np.abs(pushed).max()
        moved = (pushed @ left[:, stiff] / sizes[stiff]) @ right[stiff] @ basis.T
        changes = []
        for dq in moved:
            whole = np.zeros_like(q)
            whole[:, free] = STEP * dq
            ds = STEP * (now.carry[0] @ dq)[None]
            ends = [observed(q + sign * whole, s + sign * ds) for sign in (1, -1)]
            changes.append((ends[0] - ends[1]) / (2 * STEP))
        width += np.where(loose, np.inf, np.linalg.norm(changes, axis=0))
    value = observed(q, s)
    return tuple(Range(names, a, b) for a, b in zip(value.tolist(), width.tolist(), strict=True))


def _candidates(model: Model) -> list[int]:
    """Return the numbers of the events of rigid contacts and dry friction."""
    return [k for k, (*_, count) in enumerate(model.events) if count]


def _acting(ensemble: Batch, q: Array, s: Array, v: Array | None) -> Iterator[Iterator[_Force]]:
    """Yield, for each state, closed contacts and dry friction whose forces act in a free direction."""
    model = ensemble.model
    bodies = _candidates(model)
    if not bodies:
        yield from (iter(()) for _ in q)
        return
    arguments = state_arguments(model.time, q, s, np.zeros_like(q) if v is None else v)
    with np.errstate(all="ignore"):
        found = model.evaluate("contact", arguments, ensemble.block)
        gradient = model.evaluate("velocity", arguments, ensemble.block)["d"][:, model.layout.kept]
    first = np.cumsum([0, *(count for *_, count in model.events)])

    def forces(k: int) -> Iterator[_Force]:
        if not (np.isfinite(gradient[k]).all() and np.isfinite(found["slope"][k]).all()):
            return
        held = np.linalg.pinv(gradient[k]) @ gradient[k]
        for event in bodies:
            dry, normal = model.given_loads[event], int(first[event])
            rows = slice(normal + dry, first[event + 1] if dry else normal + 1)
            size = float(-found["bias"][k, normal] if dry else found["guard"][k, event])
            slope = found["slope"][k, rows]
            along = slope - slope @ held
            acts = np.linalg.norm(along) > ACTS * np.linalg.norm(slope)
            if acts and (size > 0 if dry else size <= CLOSED * max(1.0, model.length)):
                yield _Force(model.events[event][0], dry, size, along)

    for k in range(len(q)):
        yield forces(k)


def _named(forces: list[_Force]) -> str:
    names = [repr(x) for x in dict.fromkeys(x.component for x in forces)]
    return names[0] if len(names) == 1 else " and ".join([", ".join(names[:-1]), names[-1]]) if names else ""
