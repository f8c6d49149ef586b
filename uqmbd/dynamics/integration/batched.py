"""Batched integration: many realisations share the explicit Runge-Kutta steps, each of which ends on the constraints.

The method of order 8 with its interpolant of order 7 is that of Dormand and Prince [1]_; its coefficients are SciPy's.
Rows are either members that only share the steps, whose size follows the worst of them, or coupled: one problem.  A
member that needs far smaller steps than the others leaves and is to be integrated alone; one that is stiff, by the
criterion of [1]_, or fails, is reported.

References
----------
.. [1] E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993, II.5,
   II.6; the test of stiffness: IV.2 of the second volume.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from uqmbd.dynamics.integration.legs import Leg
from uqmbd.dynamics.integration.roles import Equations, Node, Watcher
from uqmbd.dynamics.integration.tableau import ORDER, STAGES, interpolation_powers, tableau
from uqmbd.typing import Array, Index

__all__ = ["BatchedIntegration"]

STIFF = 6.1
"""Step size times the size of the Jacobian from which the method's stability, not its accuracy, limits the step."""
PATIENCE = 15
"""Steps in a row that must look stiff."""
APART = 3.0
"""A realisation that wants steps smaller than the median of its stack by this factor, ..."""
APART_FOR = 5
"""... this many steps in a row, is integrated alone."""
STEPS = 20_000
"""Most attempted steps."""
SETTLED = 3
"""Projections by which a state is put on the constraints to rounding."""
REFUSALS = 3
"""Refused steps in a row, and ..."""
SURPLUS = 4.0
"""... by how many tolerances a step may leave the constraints, before the rank is looked at."""
NODES = 5
"""Accepted states that are remembered."""


class BatchedIntegration:
    """One integration.

    Parameters
    ----------
    equations : Equations
        What to integrate.
    z : array, shape (row, width)
        Initial states.
    times : array, shape (T,)
        Output times, s.
    legs : sequence of Leg
        Where it starts anew, as a force may jump there, and how long steps may be until then.
    rtol : float
        Relative tolerance.
    floor : array, shape (row, 1)
        Absolute tolerance of each row.
    watch : callable, optional
        Asked every twentieth of the output times with the result so far; true: stop.
    longest : float
        Longest step, s.
    guard : Watcher, optional
        Of the rank; for rows that are not coupled.

    Attributes
    ----------
    result : array, shape (row, T, width)
        States at the output times, interpolated: near the constraints, not on them.
    apart : set of int
        Members that are to be integrated alone.
    failed : dict
        Reasons of members that cannot be integrated so.
    refused : set of int
        Those of them that cannot be integrated at all.
    steps : int
        Accepted ones.
    """

    def __init__(
        self,
        equations: Equations,
        z: Array,
        times: Array,
        legs: Sequence[Leg],
        rtol: float,
        floor: Array,
        watch: Callable[[Array], bool] | None = None,
        longest: float = np.inf,
        guard: Watcher | None = None,
    ) -> None:
        self.equations, self.times, self.rtol, self.floor = equations, times, rtol, floor
        self.legs, self.z = legs, z.copy()
        self.result = np.full((len(z), len(times), z.shape[1]), np.nan)
        self.result[:, 0] = z
        self.rows = np.arange(len(z))
        self.members = self.rows[:1] if equations.coupled else self.rows
        self.apart: set[int] = set()
        self.failed: dict[int, str] = {}
        self.refused: set[int] = set()
        self.steps = 0
        self.watch, self.watched, self.stopped = watch, 0, False
        self.longest, self.bound, self.guard = longest, longest, guard
        self.nodes: deque[tuple[float, Array]] = deque(maxlen=NODES)
        self.steps_at_most = STEPS
        self.allowed = SURPLUS**2 * equations.moving * (float(np.min(floor)) ** 2 if np.size(floor) else 0.0)
        self._allocate()
        self.tableau = tableau()
        self.scaled = np.empty_like(self.tableau.a)
        self.weights = [self.scaled[i, :i] for i in range(1, STAGES)]
        self.stiff, self.slow = np.zeros((2, len(self.members)), dtype=int)

    def run(self) -> None:
        """Integrate through all break times."""
        now, size = float(self.times[0]), 0.0
        with np.errstate(all="ignore"):
            for leg in self.legs:
                self.bound = min(self.longest, leg.longest)
                size = self._segment(now, leg.end, size)
                now = leg.end
                if self.stopped or not len(self.members):
                    return

    def _magnitude(self, z: Array) -> Array:
        """Size of each entry: of its own, or of all coupled rows together."""
        return np.linalg.norm(z, axis=0, keepdims=True) if self.equations.coupled else np.abs(z)

    def _squares(self, x: Array) -> Array:
        """Sum of squares of each member."""
        found: Array = np.einsum("kw,kw->", x, x)[None] if self.equations.coupled else np.einsum("kw,kw->k", x, x)
        return found

    def _segment(self, begin: float, end: float, size: float) -> float:
        """Integrate to `end`, where a force may jump; return the last step size."""
        eps = 1e-12 * max(1.0, abs(begin), abs(end))
        self.inside = (begin + eps, end - eps)
        now = begin
        self._restart(now)
        if not len(self.members):
            return size
        self._rate(now, self.z, 0)
        size = min(size or self._first_size(now, end), end - begin)
        wanted, attempts, rejected, refusals = size, 0, False, 0
        # whoever wants short steps gets as many as that takes
        most = self.steps_at_most + (end - begin) / self.bound
        self.nodes.clear()
        self._remember(now)
        while now < end - eps and len(self.members) and not self.stopped:
            size = min(wanted, end - now, self.bound, self.guard.limit if self.guard is not None else np.inf)
            if now + size > end - 0.1 * size:  # no tiny last step
                size = end - now
            attempts += 1
            least = 1e-13 * max(abs(now), end - begin)
            error, new = self._attempt(now, size)
            worst = float(error.max()) if np.isfinite(error).all() else np.inf
            if attempts > most or size < least:
                self._leave(np.flatnonzero(~(error < min(worst, 1e300))), self._reason(now, size, attempts > most))
                self.nodes.clear()
                self._remember(now)
                attempts, wanted = 0, max(size, 1e-6 * (end - begin))
                self._rate(now, self.z, 0)
                continue
            if worst >= 1.0:
                factor = max(0.2, 0.9 * worst ** (-1 / ORDER)) if np.isfinite(worst) else 0.2
                wanted, rejected, refusals = size * factor, True, refusals + 1
                if refusals % REFUSALS == 0:
                    now = self._doubt(now, size, end, np.flatnonzero(~(error < 1.0)))[0]
                continue
            surplus = self.equations.excess()
            if self.guard is not None and self._strayed(surplus):
                now, void = self._doubt(now, size, end, self._far(surplus))
                if void:
                    wanted, refusals = size, 0
                    continue
            refusals = 0
            # now + size may miss the end by rounding
            self._write(now, size, end if size >= end - now else now + size)
            gone = self._judge(size, error, new)
            now = end if size >= end - now else now + size
            self._project(new, surplus)
            self.steps += 1
            if self.guard is not None and self.guard.alert and now < end - eps:
                self._settle(now)
                self._remember(now)
                now = self._doubt(now, size, end, np.zeros(1, dtype=np.int64))[0]
            else:
                self._remember(now)
            factor = min(5.0, 0.9 * max(worst, 1e-10) ** (-1 / ORDER))
            wanted, rejected = size * (min(1.0, factor) if rejected else factor), False
            # places change when somebody leaves: members are told apart by their numbers
            gone_members = [(self.members[which], reason) for which, reason in gone]
            for members, reason in gone_members:
                which = np.flatnonzero(np.isin(self.members, members))
                self._leave(which, reason and f"{reason} at t = {now:.6g} s")
        return wanted

    def _restart(self, now: float) -> None:
        """Change velocities where prescribed speeds jump; at such a time the result is that right after."""
        self.equations.state[:] = self.z
        change, reasons = self.equations.impulse(now, self.rtol)
        if np.any(change):
            self.z = self.z.copy()
            self.z[:, self.equations.velocities :] += change
            if len(at := np.flatnonzero(self.times[1:] == now) + 1):
                self.result[self.rows, at[0]] = self.z
        self.refused |= {int(self.members[row]) for row in reasons}
        leaving = [(self.members[[row]], reason) for row, reason in reasons.items()]
        for member, reason in leaving:
            self._leave(np.flatnonzero(np.isin(self.members, member)), reason)

    def _remember(self, now: float) -> None:
        """Keep the state, which nothing overwrites, for the guard."""
        if self.guard is not None and len(self.members) == 1:
            self.nodes.append((now, self.z))

    def _remembered(self) -> list[Node]:
        """Give the states that were kept their rates."""
        found = []
        for time, z in self.nodes:
            self._rate(time, z, STAGES + 3)
            found.append(Node(time, z[0], self.k[STAGES + 3, 0].copy()))
        return found

    def _settle(self, now: float) -> None:
        """Put the state on the constraints to rounding: next to a singular pose any residual is magnified."""
        self.z = self.z.copy()
        for _ in range(SETTLED):
            self._rate(now, self.z, 0)
            q, v = self.equations.excess()
            self.z[:, : self.equations.n] -= q
            self.z[:, self.equations.velocities :] -= v
        self._rate(now, self.z, 0)

    def _strayed(self, surplus: tuple[Array, Array]) -> bool:
        """Whether a step may have led anybody far off the constraints."""
        q, v = surplus
        return not np.vdot(q, q) + np.vdot(v, v) <= self.allowed

    def _far(self, surplus: tuple[Array, Array]) -> Index:
        """Members that a step has led far off the constraints."""
        q, v = surplus
        most = SURPLUS**2 * self.equations.moving
        scale = self.floor + self.rtol * np.abs(self.z)
        n, velocities = self.equations.n, self.equations.velocities
        off = self._squares(q / scale[:, :n]) + self._squares(v / scale[:, velocities:])
        return np.flatnonzero(~(off <= most))

    def _doubt(self, now: float, size: float, end: float, which: Index) -> tuple[float, bool]:
        """Ask the guard about members in difficulties: the time from which to go on, and whether the step is void."""
        if self.guard is None or not len(which):
            return now, False
        if len(self.members) > 1:
            block = self.equations.block
            near = [k for k in which.tolist() if self.guard.near(now, self.z[k], size, block[k])]
            if near:
                self._leave(np.array(near), "")
                if len(self.members) == 1:
                    self._remember(now)
            return now, bool(near)
        if not self.nodes:  # the others have left just now
            self._remember(now)
        calm = not self.guard.alert
        continuation = self.guard.look(now, self._remembered(), size, end, self.equations)
        if continuation is None:
            return now, False
        if continuation.reason:
            self._leave(np.zeros(1, dtype=np.int64), continuation.reason)
            return now, True
        if continuation.equations is not None:
            continuation.equations.evaluations += self.equations.evaluations
            self.equations = continuation.equations
            self._settle(now)
            self.nodes.clear()
        elif continuation.back and len(self.nodes) > 1:
            self.nodes.pop()
            now, self.z = self.nodes.pop()
        elif continuation.state is not None and continuation.curve is not None:
            inside = np.flatnonzero((self.times > now) & (self.times <= continuation.time))
            self.result[self.rows[0], inside] = continuation.curve(self.times[inside]) if len(inside) else 0.0
            now, self.z = continuation.time, continuation.state[None].copy()
            self.nodes.clear()
        elif calm and self.guard.alert:
            self._settle(now)
            self.nodes.pop()
        else:
            return now, self.guard.limit < size
        self._rate(now, self.z, 0)
        self._remember(now)
        return self._doubt(now, size, end, which)[0] if continuation.back else now, True

    def _rate(self, time: float, z: Array, stage: int) -> None:
        self.equations.state[:] = z
        self.equations.rate(min(max(time, self.inside[0]), self.inside[1]), self.out[stage])

    def _first_size(self, now: float, end: float) -> float:
        """Guess the first step as in [1]_, the smallest of all realisations."""
        scale = self.floor + self.rtol * self._magnitude(self.z)
        width = self.z.shape[1]
        size, slope = (np.sqrt(self._squares(x / scale) / width) for x in (self.z, self.k[0]))
        guess = float(np.min(np.where((size < 1e-5) | (slope < 1e-5), 1e-6, 0.01 * size / np.maximum(slope, 1e-300))))
        guess = min(guess, end - now)
        self._rate(now + guess, self.z + guess * self.k[0], 1)
        bend = np.sqrt(self._squares((self.k[1] - self.k[0]) / scale) / width) / guess
        most = np.maximum(slope, bend)
        second = np.where(most <= 1e-15, max(1e-6, guess * 1e-3), (0.01 / np.maximum(most, 1e-300)) ** (1 / ORDER))
        best = float(np.min(second))
        return min(100 * guess, best) if np.isfinite(best) else 1e-6 * (end - now)

    def _allocate(self) -> None:
        """Buffers for the stages: as arrays, flat, and the first so many of them."""
        count, width = self.z.shape
        self.k = np.zeros((STAGES + 4, count, width))
        flat = self.k.reshape(STAGES + 4, -1)
        n, velocities = self.equations.n, self.equations.velocities
        self.out = [(k[:, :n], k[:, velocities:], k) for k in self.k]
        self.first = [flat[:i] for i in range(STAGES + 5)]  # the last: all
        self.buffer = np.empty(count * width)
        self.sum = self.buffer.reshape(count, width)

    def _combine(self, weights: Array, count: int) -> Array:
        """Sum of the first `count` stages with weights; overwritten by the next one."""
        np.dot(weights, self.first[count], out=self.buffer)
        return self.sum

    def _attempt(self, now: float, size: float) -> tuple[Array, Array]:
        """Try a step: the error of each realisation in units of the tolerance, and the new states."""
        method, equations = self.tableau, self.equations
        low, high = self.inside
        moments = np.clip(now + size * method.c, low, high).tolist()
        np.multiply(method.a, size, out=self.scaled)
        for stage, weights in enumerate(self.weights, 1):
            np.dot(weights, self.first[stage], out=self.buffer)
            np.add(self.z, self.sum, out=equations.state)
            equations.rate(moments[stage], self.out[stage])
        self.last = equations.state.copy()
        new = self.z + self._combine(size * method.b, STAGES)
        self._rate(now + size, new, STAGES)
        scale = self.floor + self.rtol * np.maximum(self._magnitude(self.z), self._magnitude(new))
        both = np.dot(method.errors, self.first[STAGES + 1]).reshape(2, *new.shape)
        both /= scale
        fifth, third = self._squares(both[0]), self._squares(both[1])
        # where both vanish so does the error; what is not finite stays so
        error = size * fifth / np.sqrt((fifth + 0.01 * third) * equations.moving + 1e-300)
        return error, new

    def _write(self, now: float, size: float, last: float) -> None:
        """Write the output times of a step to `last`, by the interpolant."""
        if abs(self.times[-1] - last) <= 1e-12 * max(1.0, abs(last)):
            last = self.times[-1]
        inside = np.arange(*np.searchsorted(self.times, (now, last), side="right"))
        if not len(inside):
            return
        method, count = self.tableau, STAGES + 1
        for more in range(3):
            shifted = self.z + size * self._combine(method.more_a[more, : count + more], count + more)
            self._rate(now + method.more_c[more] * size, shifted, count + more)
        x = np.minimum((self.times[inside] - now) / size, 1.0)
        weights = size * (interpolation_powers(x) @ method.dense)
        found = np.dot(weights, self.first[-1]).reshape(len(inside), *self.z.shape)
        self.result[self.rows[:, None], inside] = (self.z + found).transpose(1, 0, 2)
        if self.watch is not None and inside[-1] >= self.watched + max(1, len(self.times) // 20):
            self.watched = int(inside[-1])
            self.stopped = self.watch(self.result)

    def _judge(self, size: float, error: Array, new: Array) -> list[tuple[Index, str]]:
        """Find realisations that are stiff (with a reason), or hold the others up."""
        change, apart = self._squares(self.k[STAGES] - self.k[STAGES - 1]), self._squares(new - self.last)
        stiffness = size * np.sqrt(change / (apart + 1e-300))
        self.stiff = np.where(stiffness > STIFF, self.stiff + 1, 0)
        if len(error) > 1:
            wants = np.maximum(error, 1e-10) ** (-1 / ORDER)
            self.slow = np.where(wants * APART < np.median(wants), self.slow + 1, 0)
        stiff, slow = self.stiff >= PATIENCE, self.slow >= APART_FOR
        found = [(np.flatnonzero(stiff), "stiff"), (np.flatnonzero(slow & ~stiff), "")]
        return [(rows, reason) for rows, reason in found if len(rows)]

    def _project(self, new: Array, surplus: tuple[Array, Array]) -> None:
        """Go on from the new states, projected; their rates change by the same little."""
        n, velocities = self.equations.n, self.equations.velocities
        q, v = surplus
        new[:, :n] -= q
        new[:, velocities:] -= v
        self.z = new
        self.k[0] = self.k[STAGES]
        self.k[0][:, :n] -= v

    def _leave(self, which: Index, reason: str) -> None:
        """Take members out: with a reason they have failed, without one they are to be integrated alone."""
        for member in self.members[which].tolist():
            if reason:
                self.failed[member] = reason
            else:
                self.apart.add(member)
        stay = np.setdiff1d(np.arange(len(self.members)), which)
        self.members, self.stiff, self.slow = self.members[stay], self.stiff[stay], self.slow[stay]
        if self.equations.coupled:
            return
        self.equations.keep(stay)
        self.rows, self.z, self.floor = self.rows[stay], self.z[stay], self.floor[stay]
        first = self.k[0, stay]
        self._allocate()
        self.k[0] = first

    def _reason(self, now: float, size: float, many: bool) -> str:  # noqa: FBT001 - which of two
        if self.guard is not None and len(self.members) == 1:
            found = self.guard.reason(now, self.z[0], self.equations.block[0])
            if found:
                return found
        if many:
            return f"the integration stopped at t = {now:.6g} s: more than {self.steps_at_most} steps"
        return (
            f"the integration stopped at t = {now:.6g} s: the step size fell to {size:.1g} s; probably a singular "
            "pose, a stop or an impact, or a force that jumps"
        )
