"""Find the static equilibrium of realisations from the assembled pose.

Coordinates and multipliers solve ``Q(q, v = 0, t0) = D^T lambda`` and ``Phi(q, t0) = 0``. Each iteration is a Newton
step within the tangent space of the constraints. The stiffness ``K`` is the exact Jacobian, including
``(D^T lambda)_q``. Negative stiffness is replaced by its absolute value (saddle-free Newton: Dauphin et al., 2014). The
iteration thus descends to stable equilibria, even from poses with zero stiffness, such as a horizontal pendulum.
Directions without stiffness get the step of smallest norm, which is zero. The step follows the constraints (Runge-Kutta
of order 4, then a projection), and its length is bounded. The step is halved until the forces do work along it. The
step size follows Armijo's rule with work in place of the loss of energy, so it admits forces without a potential.

Auxiliary states follow the motion of the search: the angle of a torsion spring is its initial value plus the rotation
of the bodies, for any number of turns. If the initial value also depends on the pose (as for angles), the state is
recomputed at the new pose, up to whole turns. The iterations then cause no error. Relaxing states take the
value of zero rate; states driven by time only keep their initial values. All other states are integrated along the
search path, with an error of about 1e-7 of their change.

With nonholonomic constraints, bodies roll without slip along the search path.  Such constraints have families of
equilibria, and the result may depend on the path.  A second search therefore uses shorter steps along another path: if
it ends in another pose, the realisation fails.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uqmbd.dynamics.assembly import Start, named, velocities
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.rest_equations import Forces, RestEquations, apply, solve_definite, tangents
from uqmbd.dynamics.statics.unilateral import has_dry_friction, overlaps
from uqmbd.typing import Array, Index, Mask

__all__ = ["Equilibrium", "equilibrium_start", "static_equilibria"]


ITERATIONS = 200
BLOCK, LARGEST_BLOCK, NUMBERS = 256, 8192, 1 << 21
"""Least and largest number of realisations in a group, and number of matrix entries that limits a group in between."""

TURN = 0.15
"""Largest change of an entry of a quaternion in one step: a rotation by 0.3 rad."""

CLOSED = 1e-12
"""Largest residual of constraints that counts as closed, relative to the size of the mechanism."""

FLAT = 1e-11
"""Stiffness, relative to the largest stiffness, that counts as rounding."""

PARTS = 8
"""Number of parts of a step if auxiliary states or nonholonomic constraints are integrated along the search path."""

SHORTER = 0.5
"""Ratio of the step lengths of the second search, for nonholonomic constraints, to those of the first."""

ELSEWHERE = 1e-5
"""Difference of two searches, relative to the size of the mechanism, that counts as zero."""

BALANCED = 1e-9
"""Force in a direction without stiffness, relative to the largest force of the search, that counts as zero."""


OMITTED = " The search omits dry friction, which may hold the given pose; in this case, use start='drawn'."


@dataclass(frozen=True)
class Equilibrium:
    """Poses of K realisations with balanced forces."""

    q: Array  # (K, coordinate)
    s: Array  # auxiliary states (K, state)
    messages: tuple[str, ...]  # empty if an equilibrium was found, else the reason
    stable: Mask  # (K,): whether no direction has negative stiffness
    iterations: Index  # (K,)


def equilibrium_start(drawn: Batch) -> Start:
    """Return initial states of K realisations in static equilibrium, after assembly from the given pose.

    Given velocities are kept; the other velocities have the least norm, which is zero unless drivers move.
    """
    model, parameters, time = drawn.model, drawn.parameters, drawn.model.time
    found = static_equilibria(drawn)
    good = np.flatnonzero([not m for m in found.messages])
    v, a, rates = np.zeros_like(found.q), np.zeros_like(found.q), np.zeros_like(found.s)
    multipliers = np.zeros((len(drawn), model.layout.rank))
    messages = list(found.messages)
    if len(good):
        q, s, some = found.q[good], found.s[good], parameters[good]
        v[good], contradictions = velocities(model, q, s, time, some, some)
        a[good], multipliers[good], rates[good] = accelerations(model, q, s, v[good], time, some)
        for k, contradiction in zip(good, contradictions, strict=True):
            fine = np.isfinite(a[k]).all()
            messages[k] = contradiction or ("" if fine else "the accelerations are not determined: a singular pose")
    return Start(found.q, found.s, v, a, rates, multipliers, tuple(messages), drawn.start.outside)


def static_equilibria(ensemble: Batch) -> Equilibrium:
    """Find the static equilibrium of every realisation from its initial pose.

    Bodies held during the assembly (``hold=True``) move like the others.  Realisations without an assembled pose keep
    their message.
    """
    start = ensemble.start
    q, s = start.q.copy(), start.s.copy()
    messages = list(start.messages)
    stable, steps = np.ones(len(q), dtype=bool), np.zeros(len(q), dtype=np.int64)
    good = np.flatnonzero(start.ok if len(ensemble.model.layout.free) else np.zeros(len(q), dtype=bool))
    block = min(max(NUMBERS // max(ensemble.model.layout.unknowns, 1) ** 2, BLOCK), LARGEST_BLOCK)
    for first in range(0, len(good), block):
        members = good[first : first + block]
        search = _EquilibriumSearch(ensemble.select(members))
        search.run()
        if len(ensemble.model.layout.nonholonomic):
            search.compare_search(_EquilibriumSearch(ensemble.select(members), SHORTER))
        q[members], s[members] = search.rest.whole(search.every, search.q), search.s
        stable[members], steps[members] = search.stable, search.steps
        for member, message in zip(members, search.messages, strict=True):
            messages[member] = message
    for k, reason in enumerate(overlaps(ensemble, q, s)):
        messages[k] = messages[k] or reason
    return Equilibrium(q, s, tuple(messages), stable, steps)


def _is_definite(matrices: Array, least: Array) -> Mask:
    """Return whether matrices (K, n, n) are symmetric, with eigenvalues above positive numbers (K,)."""
    rest = matrices.copy()
    n = rest.shape[1]
    with np.errstate(all="ignore"):
        close = np.abs(rest - rest.transpose(0, 2, 1)) <= least[:, None, None]
        found: Mask = np.asarray(close.all(axis=(1, 2)), dtype=bool)
        rest[:, np.arange(n), np.arange(n)] -= 2 * least[:, None]
        for k in range(n):
            pivot = rest[:, k, k]
            found &= pivot > 0
            rest[:, k + 1 :, k + 1 :] -= rest[:, k + 1 :, None, k] * (rest[:, None, k, k + 1 :] / pivot[:, None, None])
    return found


class _EquilibriumSearch:
    """Newton iteration for a group of realisations, with the state of each realisation."""

    def __init__(self, ensemble: Batch, length: float = 1.0) -> None:
        self.model, self.rest, self.length = ensemble.model, RestEquations(ensemble), length
        self.q, self.s = self.rest.coordinates(ensemble.start.q).copy(), ensemble.start.s.copy()
        count = len(self.q)
        self.every = np.arange(count)
        self.messages = [""] * count
        self.stable, self.steps = np.zeros(count, dtype=bool), np.zeros(count, dtype=np.int64)
        self.largest = np.zeros(count)  # largest force during the search
        layout, quaternions = self.model.layout, self.model.quaternions()
        where = self.model.by_body(ensemble.start.q)[:, :, : self.model.dimension]
        extent = np.ptp(where, axis=1).max(axis=1, initial=0.0) if self.model.bodies else np.zeros(count)
        self.size = np.maximum(1.0, extent)
        self.turning: Mask = np.isin(layout.free, quaternions)
        self.recomputed = self._follows_pose()
        carried = ~self.recomputed & ~self.rest.relaxing
        self.parts = PARTS if carried.any() or len(layout.nonholonomic) else 1

    def run(self) -> None:
        """Iterate to the equilibrium of each realisation."""
        active = self.every
        now = self.rest.forces(active, self.q[active], self.s[active])
        for number in range(ITERATIONS):
            if number and not self.rest.straight:
                now = self.rest.forces(active, self.q[active], self.s[active])
            step, done = self._newton(active, now)
            if self.rest.straight:
                moved, now = self._advance_straight(active, now, step, done)
            else:
                moved = self._advance(active, now, step, done)
            for k in active[~moved].tolist():
                self.messages[k] = self._unbalanced(k)
            active = active[moved & ~done]
            if not len(active):
                return
            if self.rest.straight:
                now = now.select(np.flatnonzero(moved & ~done))
        for k in active.tolist():
            self.messages[k] = self._unbalanced(k)

    def compare_search(self, other: _EquilibriumSearch) -> None:
        """Compare with a search along another path: if the results differ, the equilibrium is not determined."""
        other.run()
        apart = np.abs(self.q - other.q).max(axis=1, initial=0.0) / self.size
        for k in np.flatnonzero(apart > ELSEWHERE).tolist():
            if not self.messages[k]:
                self.messages[k] = (
                    "the given pose determines no static equilibrium: the rest position depends on the motion before "
                    f"it, because {named(self.model, self.model.layout.nonholonomic)} constrain velocities only. Give "
                    "the bodies their rest positions, hold them with a spring or a joint, or use start='drawn'."
                )

    def _newton(self, active: Index, now: Forces) -> tuple[Array, Mask]:
        """Return the steps (K, n), and a mask of the last steps."""
        # omit nonholonomic reactions in the stiffness: the search goes downhill
        multipliers = np.where(
            np.isin(self.model.layout.active, self.model.layout.nonholonomic), 0.0, now.multipliers()
        )
        found = self.rest.derivatives(active, self.q[active], self.s[active], multipliers)
        stiffness = found["vq"] + found["vs"] @ now.carry
        scale = np.abs(stiffness).max(axis=(1, 2), initial=0.0)
        self.largest[active] = np.maximum(self.largest[active], np.abs(now.force).max(axis=1, initial=0.0))
        if not self.rest.straight:
            return self._descent(active, now, stiffness, scale)
        step, done = np.empty_like(now.force), np.zeros(len(active), dtype=bool)
        stable = _is_definite(stiffness, FLAT * scale)
        good, others = np.flatnonzero(stable), np.flatnonzero(~stable)
        newton = solve_definite(stiffness[good], now.force[good, :, None])[:, :, 0]
        step[good] = self._bounded(active[good], newton)
        self.stable[active[good]] = True
        small = np.abs(step[good]).max(axis=1, initial=0.0) <= 1e-9 * self.size[active[good]]
        balanced = np.abs(now.force[good]).max(axis=1, initial=0.0) <= 1e-14 * self.largest[active[good]]
        done[good] = small | balanced
        if len(others):
            step[others], done[others] = self._descent(
                active[others], now.select(others), stiffness[others], scale[others]
            )
        return step, done

    def _descent(self, active: Index, now: Forces, stiffness: Array, scale: Array) -> tuple[Array, Mask]:
        """Return steps downhill for any stiffness (K, n, n) with the largest entries (K,), and a mask of last steps."""
        basis = tangents(now.gradient)
        force = apply(basis.transpose(0, 2, 1), now.force)
        reduced = basis.transpose(0, 2, 1) @ stiffness @ basis
        tolerance = BALANCED * self.largest[active] + 1e-12 * scale * self.size[active]
        transposed = reduced.transpose(0, 2, 1)
        curvature, modes = np.linalg.eigh((reduced + transposed) / 2)
        along = apply(modes.transpose(0, 2, 1), force)
        turned = modes.transpose(0, 2, 1) @ ((reduced - transposed) / 2) @ modes
        turned[np.abs(turned).max(axis=(1, 2), initial=0.0) <= FLAT * scale] = 0.0
        flat = np.abs(curvature) <= FLAT * scale[:, None]
        pushed = flat & (np.abs(along) > tolerance[:, None])
        still = flat & ~pushed
        # in directions with a force but without stiffness, take the largest step
        pivots = np.where(pushed, np.abs(along) / TURN, np.where(still, 1.0, np.abs(curvature)))
        matrix = np.where(still[:, :, None] | still[:, None, :], 0.0, turned)
        diagonal = np.arange(matrix.shape[1])
        matrix[:, diagonal, diagonal] = pivots
        x = np.linalg.solve(matrix, np.where(still, 0.0, along)[:, :, None])[:, :, 0]
        step = apply(basis, apply(modes, x))
        small = np.abs(step).max(axis=1, initial=0.0) <= 1e-9 * self.size[active]
        done = (small | (np.abs(along) <= 1e-14 * self.largest[active, None]).all(axis=1)) & ~pushed.any(axis=1)
        self.stable[active] = (curvature >= -FLAT * scale[:, None]).all(axis=1)
        return self._bounded(active, step), done

    def _bounded(self, active: Index, step: Array) -> Array:
        """Return steps (K, n) that turn and move bodies by a limited amount."""
        turn = np.abs(step[:, self.turning]).max(axis=1, initial=0.0) / TURN
        shift = np.abs(step[:, ~self.turning]).max(axis=1, initial=0.0) / self.size[active]
        return np.asarray(self.length * step / np.maximum(1.0, np.maximum(turn, shift))[:, None])

    def _advance(self, active: Index, now: Forces, step: Array, done: Mask) -> Mask:
        """Take the steps, shortened if needed; return a mask of the accepted steps."""
        moved: Mask = np.zeros(len(active), dtype=bool)
        expected = np.einsum("kn,kn->k", now.force, step)
        before = np.linalg.norm(now.within(now.force), axis=1)
        pending = np.arange(len(active))
        for halving in range(20):
            k = active[pending]
            q, s, work = self._along(k, now.select(pending), step[pending] * 0.5**halving)
            after = np.full(len(k), np.inf)
            closed = np.isfinite(q).all(axis=1)
            there = self.rest.forces(k[closed], q[closed], s[closed])
            after[closed] = np.linalg.norm(there.within(there.force), axis=1)
            good = closed & ((work >= 1e-4 * 0.5**halving * expected[pending]) | (after <= 0.5 * before[pending]))
            good |= closed & done[pending]
            self.q[k[good]], self.s[k[good]] = q[good], s[good]
            self.steps[k[good]] += 1
            moved[pending[good]] = True
            pending = pending[~good]
            if not len(pending):
                break
        return moved

    def _advance_straight(self, active: Index, now: Forces, step: Array, done: Mask) -> tuple[Mask, Forces]:
        """Take the steps of independent coordinates; return a mask of the accepted steps, and the forces at their ends.

        The forces after last steps are not evaluated. Their work is evaluated only where they do not become much
        smaller.
        """
        moved: Mask = done.copy()
        self.q[active[done]] += step[done]
        self.steps[active[done]] += 1
        expected = np.einsum("kn,kn->k", now.force, step)
        before = np.linalg.norm(now.force, axis=1)
        force = now.force.copy()
        pending = np.flatnonzero(~done)
        for halving in range(20):
            if not len(pending):
                break
            k, h = active[pending], 0.5**halving
            s, change = self.s[k], h * step[pending]
            q = self.q[k] + change
            end = self.rest.forces(k, q, s).force
            with np.errstate(invalid="ignore"):
                good = np.linalg.norm(end, axis=1) <= 0.5 * before[pending]
            if len(unsure := np.flatnonzero(~good)):
                middle = self.rest.forces(k[unsure], q[unsure] - change[unsure] / 2, s[unsure]).force
                mean = (now.force[pending[unsure]] + 4 * middle + end[unsure]) / 6
                with np.errstate(invalid="ignore"):
                    work = np.einsum("kn,kn->k", mean, change[unsure])
                    good[unsure] = work >= 1e-4 * h * expected[pending[unsure]]
            self.q[k[good]], force[pending[good]] = q[good], end[good]
            self.steps[k[good]] += 1
            moved[pending[good]] = True
            pending = pending[~good]
        return moved, replace(now, force=force)

    def _along(self, members: Index, now: Forces, step: Array) -> tuple[Array, Array, Array]:
        """Follow the constraints along a step; return pose, states and work of the forces; NaN if not closed."""
        q0, s0 = self.q[members], self.s[members]
        rest = self.rest

        def slope(there: Forces) -> tuple[Array, Array, Array]:
            dq = there.within(step)
            return dq, apply(there.carry, dq), np.einsum("kn,kn->k", there.force, dq)

        q, s, work = q0, s0, np.zeros(len(q0))
        h = 1 / self.parts
        for number in range(self.parts):
            slopes = [slope(rest.forces(members, q, s) if number else now)]
            for part in (h / 2, h / 2, h):
                dq, ds, _ = slopes[-1]
                slopes.append(slope(rest.forces(members, q + part * dq, s + part * ds)))
            q, s, work = (
                x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, s, work), *slopes, strict=True)
            )
        for _ in range(12):
            there = rest.forces(members, q, s)
            dq = there.closing()
            q = q + dq
            s = s + apply(there.carry, dq) + there.settle
            size = np.abs(dq).max(axis=1, initial=0.0) / self.size[members]
            if not (size > CLOSED).any():
                break
        q[~(size <= 1e-9)] = np.nan
        if self.recomputed.any():
            fine = np.isfinite(q).all(axis=1)
            s[fine] = self._settled(members[fine], q[fine], s[fine])
        return q, s, work

    def _settled(self, members: Index, q: Array, s: Array) -> Array:
        """Return the initial values of auxiliary states at a pose, in the turns reached by the search."""
        stated = self.rest.recomputed(members, q)
        stated = stated + 2 * np.pi * np.round((s - stated) / (2 * np.pi))
        near = self.recomputed[members] & (np.abs(s - stated) < 1e-2)
        return np.where(near, stated, s)

    def _follows_pose(self) -> Mask:
        """Return a mask of auxiliary states that change as their initial values do, up to whole turns."""
        count, number = self.s.shape
        if not number:
            return np.zeros((count, 0), dtype=bool)
        now = self.rest.forces(self.every, self.q, self.s)
        follows: Mask = ~self.rest.relaxing
        h = 1e-5
        for direction in tangents(now.gradient).transpose(2, 0, 1):
            ends = [self.rest.recomputed(self.every, self.q + x * direction) for x in (h, -h)]
            change = ends[0] - ends[1]
            change -= 2 * np.pi * np.round(change / (2 * np.pi))
            rate = apply(now.carry, direction)
            follows &= np.abs(change / (2 * h) - rate) <= 1e-5 * (1 + np.abs(rate))
        return follows

    def _unbalanced(self, k: int) -> str:
        """Return a message on the body farthest from balance."""
        one = np.array([k])
        now = self.rest.forces(one, self.q[one], self.s[one])
        left = np.zeros(self.model.layout.coordinates)
        left[self.model.layout.free] = now.within(now.force)[0]
        loads = self.model.by_body(left)
        d = self.model.dimension
        # the generalised force on a quaternion is twice the moment
        force, moment = np.linalg.norm(loads[:, :d], axis=1), np.linalg.norm(loads[:, d:], axis=1) / 2
        of_bodies, own = np.maximum(force, moment / self.size[k]), np.abs(left[self.model.of_bodies :])
        if own.max(initial=0.0) > of_bodies.max(initial=0.0):
            number = int(np.argmax(own))
            _, _, units = self.model.own[number]
            carrier, held = self.model.carrier(self.model.of_bodies + number), "coordinate"
            what = f"{own[number]:.3g} {'J' if units in ('1', 'rad') else f'J/({units})'}"
        else:
            worst = int(np.argmax(of_bodies))
            carrier, held = f"body {self.model.bodies[worst]!r}", "body"
            what = f"{force[worst]:.3g} N" + (f" and {moment[worst]:.3g} N m" if self.model.size > d else "")
        return (
            f"no static equilibrium was found in {self.steps[k]} steps from the given pose: "
            f"{carrier} is the farthest from balance, by {what}. Perhaps no force holds the "
            f"{held} in some direction, or its given pose is far from its rest position. Hold it with a spring or a "
            "joint, or give it a pose closer to that position."
            f"{OMITTED if has_dry_friction(self.model) else ''}"
        )
