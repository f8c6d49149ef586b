"""Motion of assembled poses until start conditions of positions and angles are satisfied.

The search path follows the constraints.  Each step is the smallest change that satisfies the conditions and constraints
to first order (Gauss-Newton). The step is bounded, and the constraints are closed before it is accepted.  Joints
therefore do not jump to a mirror image, and angles can be tracked over any number of turns.

Auxiliary states that count angles also follow the path: the pose determines their value up to whole turns, and the
motion of the assembly determines the number of turns.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.assembly.least_norm import solve_least_norm
from uqmbd.dynamics.equations import Conditions, Model, state_arguments
from uqmbd.typing import Array, Index, Mask

__all__ = ["met"]


STEPS = 3000
"""Largest number of steps: about 150 turns from the given pose."""

TURN = 0.2
"""Largest change of an entry of a quaternion in one step."""

CLOSED = 1e-12
"""Tolerance of constraints and conditions, m or rad, relative to the size of the mechanism."""


def met(
    model: Model, q: Array, s: Array, time: float, parameters: Array, rows: Index | None
) -> tuple[Array, Array, list[str]]:
    """Move assembled poses (K, coordinate) until the conditions of positions are satisfied.

    Return poses, their auxiliary states, and for each realisation the reason for an unsatisfied condition, or an empty
    text.  The independent equations are `rows`; None: all.
    """
    search = _ConditionSearch(model, q, s, time, parameters, rows)
    search.run()
    messages = search.messages()
    failed = np.flatnonzero([bool(m) for m in messages])
    if len(failed) and model.turned and s.shape[1]:
        found, closed = _search_twice(model, q[failed], s[failed], time, parameters[failed], search.rows)
        left = found.messages()
        for row, k in enumerate(failed.tolist()):
            if closed[row] and not left[row]:
                search.q[k], search.s[k], messages[k] = found.q[row], found.s[row], ""
    return search.q, search.s, messages


def _search_twice(
    model: Model, q: Array, s: Array, time: float, parameters: Array, rows: Index
) -> tuple[_ConditionSearch, Mask]:
    """Search without drivers, then with drivers from the resulting pose, to reach turns that drivers prevent.

    Also return a mask of realisations with closed constraints.
    """
    driven = [k for k, owner in enumerate(model.owners) if owner in model.turned]
    loose = _ConditionSearch(model, q, s, time, parameters, np.setdiff1d(rows, driven))
    loose.closing = np.setdiff1d(loose.closing, driven)
    loose.run()
    found = _ConditionSearch(model, loose.q, loose.s, time, parameters, rows)
    every = np.arange(len(q))
    found.q, found.s, closed = found._closed(every, loose.q)
    found.run()
    return found, closed


class _ConditionSearch:
    """Gauss-Newton iteration for K realisations."""

    def __init__(self, model: Model, q: Array, s: Array, time: float, parameters: Array, rows: Index | None) -> None:
        assert model.conditions is not None
        self.model, self.time, self.parameters = model, time, parameters
        self.conditions: Conditions = model.conditions
        self.which = self.conditions.positions
        every = np.arange(model.layout.constraints)
        self.rows = np.setdiff1d(every, model.layout.nonholonomic) if rows is None else rows
        self.closing = every
        self.free = np.setdiff1d(np.arange(q.shape[1]), model.held)
        self.turning = model.quaternions().ravel()
        self.size = max(1.0, float(np.abs(q[:, : model.dimension]).max(initial=0.0)))
        self.q, self.s = q.copy(), s.copy()
        self.follows = self._following()

    def run(self) -> None:
        """Iterate until the conditions are satisfied, or no step decreases their residuals."""
        active = np.arange(len(self.q))
        for _ in range(STEPS):
            gap, slope, _ = self._gaps(active, self.q[active], self.s[active])
            left = np.abs(gap).max(axis=1, initial=0.0) > CLOSED * self.size
            active, gap, slope = active[left], gap[left], slope[left]
            if not len(active):
                return
            phi, d = self._constraints(active, self.q[active], self.s[active])
            a = np.concatenate([d[:, self.rows], slope], axis=1)[:, :, self.free]
            r = np.concatenate([phi[:, self.rows], gap], axis=1)
            move = np.zeros_like(self.q[active])
            move[:, self.free] = -solve_least_norm(a, r, truncate=True)
            largest = np.abs(move[:, self.turning]).max(axis=1, initial=0.0)
            move /= np.maximum(1.0, largest / TURN)[:, None]
            active = active[self._advance(active, move, np.linalg.norm(gap, axis=1))]

    def _advance(self, active: Index, move: Array, before: Array) -> Mask:
        """Take steps, shortened if needed; return a mask of the steps that decrease the residuals."""
        moved: Mask = np.zeros(len(active), dtype=bool)
        pending = np.arange(len(active))
        for halving in range(16):
            k = active[pending]
            step = 0.5**halving * move[pending]
            q, s, closed = self._closed(k, self.q[k] + step)
            gap, _, _ = self._gaps(k, q, s)
            after = np.linalg.norm(gap, axis=1)
            good = closed & (after < before[pending] * (1 - 1e-4 * 0.5**halving))
            self.q[k[good]], self.s[k[good]] = q[good], s[good]
            moved[pending[good]] = True
            pending = pending[~good]
            if not len(pending):
                break
        return moved

    def _gaps(self, members: Index, q: Array, s: Array) -> tuple[Array, Array, Array]:
        """Return residuals over the lengths of their gradients, the scaled gradients, and the lengths."""
        value, slope, _ = self.conditions(q, s, self.time, self.parameters[members])
        value, slope = value[:, self.which], slope[:, self.which]
        length = np.linalg.norm(slope[:, :, self.free], axis=2)
        length = np.where(length > 1e-9, length, 1.0)
        return value / length, slope / length[:, :, None], length

    def _constraints(self, members: Index, q: Array, s: Array) -> tuple[Array, Array]:
        """Return constraints (K, m) over the lengths of their gradients, and the scaled gradients (K, m, n)."""
        arguments, parameters = state_arguments(self.time, q, s, np.zeros_like(q)), self.parameters[members]
        phi = self.model.evaluate("drift", arguments, parameters)["phi"]
        d = self.model.evaluate("velocity", arguments, parameters)["d"]
        length = np.linalg.norm(d, axis=2)
        length = np.where(length > 1e-9, length, 1.0)
        return phi / length, d / length[:, :, None]

    def _closed(self, members: Index, q: Array) -> tuple[Array, Array, Mask]:
        """Close the constraints by the smallest change; return poses, auxiliary states, and a mask of successes."""
        q, s = q.copy(), self._carried(members, q)
        for _ in range(10):
            phi, d = self._constraints(members, q, s)
            if not (np.abs(phi[:, self.closing]).max(axis=1, initial=0.0) > 0.1 * CLOSED * self.size).any():
                break
            q[:, self.free] -= solve_least_norm(d[:, self.rows][:, :, self.free], phi[:, self.rows], truncate=True)
            s = self._carried(members, q)
        phi, _ = self._constraints(members, q, s)
        off = np.abs(phi[:, self.closing]).max(axis=1, initial=0.0)
        fine: Mask = np.isfinite(q).all(axis=1) & (off <= 1e-9 * self.size)
        cosines = self.model.evaluate(
            "position", state_arguments(self.time, q, s, np.zeros_like(q)), self.parameters[members]
        )["cos"]
        if cosines.shape[1]:
            fine &= cosines.min(axis=1) > 0
        return q, s, fine

    def _stated(self, members: Index, q: Array) -> Array:
        """Return initial values of auxiliary states at a pose."""
        arguments = state_arguments(self.time, q, np.zeros((len(q), self.model.layout.states)), np.zeros_like(q))
        return self.model.evaluate("initial", arguments, self.parameters[members])["s"]

    def _change(self, members: Index, q: Array, s: Array, move: Array) -> Array:
        """Return the change of auxiliary states along a small move, from their rates."""
        rates = []
        for v in (move, np.zeros_like(move)):
            values = self.model.evaluators["acceleration"](
                state_arguments(self.time, q, s, v), self.parameters[members]
            )
            rates.append(self.model.result("acceleration", "s", values))
        return np.asarray(rates[0] - rates[1])

    def _carried(self, members: Index, q: Array) -> Array:
        """Return auxiliary states after a step."""
        s = self._stated(members, q)
        if not self.follows.any():
            return s
        move = q - self.q[members]
        expected = self.s[members] + self._change(members, self.q[members] + move / 2, self.s[members], move)
        turns = 2 * np.pi * np.round((expected - s) / (2 * np.pi))
        return np.where(self.follows & np.isfinite(turns), s + turns, s)

    def _following(self) -> Mask:
        """Return a mask of auxiliary states that change as their initial values do, up to whole turns."""
        follows: Mask = np.ones(self.s.shape[1], dtype=bool)
        if not len(follows) or not len(self.q):
            return follows
        some, random = np.arange(min(len(self.q), 1)), np.random.default_rng(0)
        q, s, h = self.q[some], self.s[some], 1e-5
        for _ in range(2):
            # move within the constraints, because angles are undefined elsewhere
            d = self._constraints(some, q, s)[1][:, self.rows]
            direction = random.standard_normal(q.shape)
            direction -= solve_least_norm(d, (d @ direction[:, :, None])[:, :, 0], truncate=True)
            change = self._stated(some, q + h * direction) - self._stated(some, q - h * direction)
            change = (change - 2 * np.pi * np.round(change / (2 * np.pi))) / (2 * h)
            rate = self._change(some, q, s, direction)
            follows &= (np.abs(change - rate) <= 1e-4 * (1 + np.abs(rate))).all(axis=0)
        return follows

    def messages(self) -> list[str]:
        """Return a message on unsatisfied conditions for each realisation."""
        every = np.arange(len(self.q))
        gap, _, length = self._gaps(every, self.q, self.s)
        found = []
        for k, (row, scale) in enumerate(zip(gap, length, strict=True)):
            if np.abs(row).max(initial=0.0) <= 1e-9 * self.size:
                found.append("")
                continue
            worst = int(np.nanargmax(np.where(np.isfinite(row), np.abs(row), np.inf)))
            others = [self.conditions.names[i] for i in self.which if i != self.which[worst]]
            if self._still(k, worst):
                holding = self._drivers(k, worst)
                by = f" (driver {', '.join(map(repr, holding))})" if holding else ""
                why = (
                    "No motion that the joints and drivers allow changes this quantity in that pose. Either joints and "
                    f"drivers keep the quantity constant{by}, or it has a maximum or minimum there, from which two "
                    "motions are possible. In the latter case, define the bodies on the intended side."
                )
            else:
                other = f", or contradicts the start condition {' or '.join(others)}" if others else ""
                why = (
                    f"The stated value may be out of reach{other}. Define the bodies closer to the stated value; the "
                    "assembly finds angles up to about 150 turns away."
                )
            found.append(
                f"start condition {self.conditions.names[self.which[worst]]} is not met: its left side minus its right "
                f"side is {row[worst] * scale[worst]:.3g} in the nearest pose that was found. {why}"
            )
        return found

    def _drivers(self, k: int, condition: int) -> list[str]:
        """Return the names of drivers that prevent a condition of a realisation."""
        one = np.array([k])
        d = self._constraints(one, self.q[one], self.s[one])[1][0][:, self.free]
        slope = self._gaps(one, self.q[one], self.s[one])[1][0, condition, self.free]
        parts = np.linalg.lstsq(d.T, slope, rcond=None)[0]
        known = {*self.model.turned, *(self.model.prescribed.owners if self.model.prescribed is not None else ())}
        owners = [owner for owner, x in zip(self.model.owners, parts, strict=True) if abs(x) > 1e-6]
        return [x for x in dict.fromkeys(owners) if x in known]

    def _still(self, k: int, condition: int) -> bool:
        """Return whether the constraints prevent every change of a condition of a realisation."""
        one = np.array([k])
        q, s = self.q[one], self.s[one]
        d = self._constraints(one, q, s)[1][:, self.rows][:, :, self.free]
        slope = self._gaps(one, q, s)[1][:, condition, self.free]
        within = slope - solve_least_norm(d, (d @ slope[:, :, None])[:, :, 0], truncate=True)
        return bool(np.linalg.norm(within) < 1e-6)
