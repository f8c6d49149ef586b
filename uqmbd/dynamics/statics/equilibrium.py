"""Static equilibrium of realisations, found from the assembled pose.

Solved for are coordinates and multipliers with ``Q(q, v = 0, t0) = D^T lambda`` and ``Phi(q, t0) = 0``.  Each iteration
is a Newton step within the tangent space of the constraints, whose stiffness ``K`` is the exact Jacobian, ``(D^T
lambda)_q`` included.  Directions of negative stiffness are taken with its absolute value, so that the iteration
descends to stable equilibria (saddle-free Newton: Dauphin et al., 2014) even from poses where the stiffness vanishes,
such as a horizontal pendulum; directions without stiffness get the step of smallest norm, which is none. The step
follows the constraints (Runge-Kutta of order 4, then a projection), and its length is bounded. It is halved until the
forces have done work along it. This is Armijo's rule, with work in place of the loss of energy, so it admits forces
without a potential.

Auxiliary states are carried along: the angle of a torsion spring is that at the start and what the bodies turned on the
way, any number of turns. The value that the component states for the start may follow the pose too (as angles do). Then
it is recomputed at the new pose, up to whole turns. So no error of the iterations remains. States that relax take the
value at which their rate vanishes; states that time alone drives keep their initial values. A state that is known by
its way alone is right to about 1e-7 of its change.

Where constraints bind velocities alone, bodies roll on the way, and do not slip.  Such constraints have equilibria in
families, and which one is found may depend on the way.  It is sought a second time by shorter steps, along another way:
where that ends elsewhere, the realisation has failed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.assembly import Start, named, velocities
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.rest_equations import Forces, RestEquations, apply, tangents
from uqmbd.typing import Array, Index, Mask

__all__ = ["Equilibrium", "equilibrium_start", "static_equilibria"]


ITERATIONS = 200
BLOCK = 256
"""Realisations that are solved together."""

TURN = 0.15
"""Largest change of a quaternion's entry in one step: a turn by 0.3 rad."""

CLOSED = 1e-12
"""Constraints are closed to this length, m, per size of the mechanism."""

FLAT = 1e-11
"""Stiffness, as a part of the largest one, that is no stiffness but rounding."""

PARTS = 8
"""Parts of a step where auxiliary states are known by their way alone."""

SHORTER = 0.5
"""Steps of a second search, over those of the first, where bodies roll on the way."""

ELSEWHERE = 1e-5
"""Difference of two searches, over the size of the mechanism, that is none."""

BALANCED = 1e-9
"""Force along a direction without stiffness, as a part of the largest on the way, that counts as none."""


@dataclass(frozen=True)
class Equilibrium:
    """Poses of K realisations in which all forces balance."""

    q: Array  # (K, coordinate)
    s: Array  # auxiliary states (K, state)
    messages: tuple[str, ...]  # empty where an equilibrium was found, else the reason
    stable: Mask  # (K,): whether no direction has negative stiffness
    iterations: Index  # (K,)


def equilibrium_start(drawn: Batch) -> Start:
    """Return initial states in static equilibrium of K realisations, which are assembled from the drawn pose.

    Velocities are those that the script states; the others have the least norm, which is rest unless drivers move.
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
    """Find the static equilibrium of every realisation, from the pose of its start.

    Bodies that are held while the mechanism is assembled (``hold=True``) move like the others.  Realisations that were
    not assembled keep their message.
    """
    start = ensemble.start
    q, s = start.q.copy(), start.s.copy()
    messages = list(start.messages)
    stable, steps = np.ones(len(q), dtype=bool), np.zeros(len(q), dtype=np.int64)
    good = np.flatnonzero(start.ok if len(ensemble.model.layout.free) else np.zeros(len(q), dtype=bool))
    for first in range(0, len(good), BLOCK):
        members = good[first : first + BLOCK]
        search = _EquilibriumSearch(ensemble.select(members))
        search.run()
        if len(ensemble.model.layout.nonholonomic):
            search.compare_search(_EquilibriumSearch(ensemble.select(members), SHORTER))
        q[members], s[members] = search.rest.whole(search.every, search.q), search.s
        stable[members], steps[members] = search.stable, search.steps
        for member, message in zip(members, search.messages, strict=True):
            messages[member] = message
    return Equilibrium(q, s, tuple(messages), stable, steps)


class _EquilibriumSearch:
    """The iteration for some realisations, and how far each of them is."""

    def __init__(self, ensemble: Batch, length: float = 1.0) -> None:
        self.model, self.rest, self.length = ensemble.model, RestEquations(ensemble), length
        self.q, self.s = self.rest.coordinates(ensemble.start.q).copy(), ensemble.start.s.copy()
        count = len(self.q)
        self.every = np.arange(count)
        self.messages = [""] * count
        self.stable, self.steps = np.zeros(count, dtype=bool), np.zeros(count, dtype=np.int64)
        self.largest = np.zeros(count)  # force on the way
        layout, quaternions = self.model.layout, self.model.quaternions()
        where = ensemble.start.q.reshape(count, len(self.model.bodies), self.model.size)[:, :, : self.model.dimension]
        self.size = np.maximum(1.0, np.ptp(where, axis=1).max(axis=1, initial=0.0))
        self.turning: Mask = np.isin(layout.free, quaternions)
        self.recomputed = self._follows_pose()
        carried = ~self.recomputed & ~self.rest.relaxing
        self.parts = PARTS if carried.any() or len(layout.nonholonomic) else 1

    def run(self) -> None:
        """Iterate to the equilibrium of each realisation."""
        active = self.every
        for _ in range(ITERATIONS):
            now = self.rest.forces(active, self.q[active], self.s[active])
            step, done = self._newton(active, now)
            moved = self._advance(active, now, step, done)
            for k in active[~moved].tolist():
                self.messages[k] = self._unbalanced(k)
            active = active[moved & ~done]
            if not len(active):
                return
        for k in active.tolist():
            self.messages[k] = self._unbalanced(k)

    def compare_search(self, other: _EquilibriumSearch) -> None:
        """Compare with a search along another way: where that ends elsewhere, no equilibrium is determined."""
        other.run()
        apart = np.abs(self.q - other.q).max(axis=1, initial=0.0) / self.size
        for k in np.flatnonzero(apart > ELSEWHERE).tolist():
            if not self.messages[k]:
                self.messages[k] = (
                    "the drawn pose determines no static equilibrium: where the mechanism comes to rest depends on the "
                    f"way there, as {named(self.model, self.model.layout.nonholonomic)} bind velocities alone. Draw it "
                    "where it rests, hold it with a spring or a joint, or start as drawn."
                )

    def _newton(self, active: Index, now: Forces) -> tuple[Array, Mask]:
        """Find the steps (K, n), and whether they are the last ones."""
        # reactions that bodies roll by do not turn the way that they go: it is downhill
        multipliers = np.where(
            np.isin(self.model.layout.active, self.model.layout.nonholonomic), 0.0, now.multipliers()
        )
        found = self.rest.derivatives(active, self.q[active], self.s[active], multipliers)
        stiffness = found["vq"] + found["vs"] @ now.carry
        basis = tangents(now.gradient)
        force = apply(basis.transpose(0, 2, 1), now.force)
        reduced = basis.transpose(0, 2, 1) @ stiffness @ basis
        scale = np.abs(stiffness).max(axis=(1, 2), initial=0.0)
        self.largest[active] = np.maximum(self.largest[active], np.abs(now.force).max(axis=1, initial=0.0))
        tolerance = BALANCED * self.largest[active] + 1e-12 * scale * self.size[active]
        transposed = reduced.transpose(0, 2, 1)
        curvature, modes = np.linalg.eigh((reduced + transposed) / 2)
        along = apply(modes.transpose(0, 2, 1), force)
        turned = modes.transpose(0, 2, 1) @ ((reduced - transposed) / 2) @ modes
        turned[np.abs(turned).max(axis=(1, 2), initial=0.0) <= FLAT * scale] = 0.0
        flat = np.abs(curvature) <= FLAT * scale[:, None]
        pushed = flat & (np.abs(along) > tolerance[:, None])
        still = flat & ~pushed
        # without stiffness but with a force: as far as a step goes
        pivots = np.where(pushed, np.abs(along) / TURN, np.where(still, 1.0, np.abs(curvature)))
        matrix = np.where(still[:, :, None] | still[:, None, :], 0.0, turned)
        diagonal = np.arange(matrix.shape[1])
        matrix[:, diagonal, diagonal] = pivots
        x = np.linalg.solve(matrix, np.where(still, 0.0, along)[:, :, None])[:, :, 0]
        step = apply(basis, apply(modes, x))
        small = np.abs(step).max(axis=1, initial=0.0) <= 1e-9 * self.size[active]
        done = (small | (np.abs(along) <= 1e-14 * self.largest[active, None]).all(axis=1)) & ~pushed.any(axis=1)
        self.stable[active] = (curvature >= -FLAT * scale[:, None]).all(axis=1)
        turn = np.abs(step[:, self.turning]).max(axis=1, initial=0.0) / TURN
        shift = np.abs(step[:, ~self.turning]).max(axis=1, initial=0.0) / self.size[active]
        return self.length * step / np.maximum(1.0, np.maximum(turn, shift))[:, None], done

    def _advance(self, active: Index, now: Forces, step: Array, done: Mask) -> Mask:
        """Take the steps, shortened if needed; return which could be taken."""
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

    def _along(self, members: Index, now: Forces, step: Array) -> tuple[Array, Array, Array]:
        """Follow the constraints in the direction of a step; return the work of the forces. NaN: they do not close."""
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
        """Auxiliary states as components state them for a pose, as many turns on as on the way."""
        stated = self.rest.recomputed(members, q)
        stated = stated + 2 * np.pi * np.round((s - stated) / (2 * np.pi))
        near = self.recomputed[members] & (np.abs(s - stated) < 1e-2)
        return np.where(near, stated, s)

    def _follows_pose(self) -> Mask:
        """Return which auxiliary states change with the pose as their initial values do, up to whole turns."""
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
        """Name the body that is farthest from balance."""
        one = np.array([k])
        now = self.rest.forces(one, self.q[one], self.s[one])
        left = np.zeros(self.model.layout.coordinates)
        left[self.model.layout.free] = now.within(now.force)[0]
        loads = left.reshape(len(self.model.bodies), self.model.size)
        d = self.model.dimension
        # the generalised force on a quaternion is twice the moment
        force, moment = np.linalg.norm(loads[:, :d], axis=1), np.linalg.norm(loads[:, d:], axis=1) / 2
        worst = int(np.argmax(np.maximum(force, moment / self.size[k])))
        what = f"{force[worst]:.3g} N" + (f" and {moment[worst]:.3g} N m" if self.model.size > d else "")
        return (
            f"no static equilibrium was found in {self.steps[k]} steps from the drawn pose: "
            f"body {self.model.bodies[worst]!r} is the farthest from balance, by {what}. Is there a direction in which "
            "nothing holds it, or was it drawn far from where it comes to rest? Hold it with a spring or a joint, or "
            "draw it closer."
        )
