"""Passage over singular poses, and exchange of equations that become dependent.

Branches of motion meet in a singular pose, and the equations of motion do not determine the branch. Momentum selects
the smooth continuation of the motion. A polynomial through the last states and rates before the pose therefore
extrapolates the motion [1]_. The extrapolation extends as far beyond the pose as these states are before the pose; its
end is projected onto the constraints. The extrapolation starts so close to the pose that polynomials of degree 9 and 7
(or 7 and 5) agree within the tolerance. A motion that ends in the pose (a mechanism that locks up) has no such
polynomial. Near the pose, rounding grows with the inverse square of the distance. If rounding exceeds the tolerance,
the continuation with the least difference is used, provided that this difference is small enough.

The fixed order of elimination can fail in a regular pose, at which a pivot passes through zero.  Rejected steps near
such a pose trigger a new choice of the order at the pose.

References
----------
.. [1] E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993, II.6.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.assembly import Rank, dead_end, gradient, independent_rows, named, rank_along, ranks_along
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.linear import accelerations, excess, index1_system, residuals
from uqmbd.typing import Array

__all__ = ["SingularPoseWatcher", "regular", "repivoted"]


REACH = 4.0
"""Largest time to a singular pose that counts as near, relative to the longer of the last and the attempted step."""
FOOTING = 0.1
"""Least time from the end of a step to a singular pose, relative to the step; a step that ends closer is undone."""
APPROACH = 0.4
"""Longest step relative to the time to a singular pose."""
FEWEST = 4
"""Number of states for a continuation; one state fewer yields the error estimate."""
PAST = 0.2
"""Ratio of the time to a pose to that of the best continuation, up to which an error of `ROUNDING` is allowed."""
ROUNDING = 1e-7
"""Largest relative error of a continuation if rounding makes the tolerance unattainable."""
MOST_CHECKS = 60
"""Number of checks of the same pose after which the attempt ends."""
END = 1e-10
"""Time to a singular pose, relative to the elapsed time, that counts as zero."""
DEPENDENT = 0.2
"""Ratio of the smallest singular values of kept and all equations, below which kept ones are nearly dependent."""
STRAY = 0.05
"""Largest correction of a continuation by constraints, relative to its distance; branches are farther apart."""
POOR = 0.1
"""Relative residual of the index-1 system, in tolerances, above which its pivots are poor."""
BETTER = 0.1
"""Largest ratio of new to old residual for the acceptance of another order of elimination."""
TRIALS = 3
"""Number of orders without improvement after which the search ends."""
PLACES = np.array([0.0, 0.1, 0.3, 1.0])
"""Relative positions in a rejected step at which the residual is evaluated."""
SYSTEMS = 8
"""Largest number of stored systems with other equations or orders of elimination."""


@dataclass(frozen=True)
class Continuation:
    """Continuation of a realisation near a singular pose."""

    reason: str = ""  # reason why it cannot continue; empty if it can
    back: bool = False  # whether to continue from the previous node
    others: bool = False  # whether to use other independent equations, those of `SingularPoseWatcher.model`
    time: float = 0.0
    state: Array | None = None  # (width,): continue from this state at `time`; until then the motion is ``curve(time)``
    curve: Callable[[Any], Array] | None = None


_systems: dict[tuple[str, bytes], Any] = {}
_LOCK = threading.Lock()


def repivoted(model: Model, q: Array, s: Array, time: float, parameters: Array) -> Model:
    """Choose new independent equations at a pose of one realisation.

    The returned model is only for the index-1 form: its residual and Jacobian belong to the old choice.
    """
    layout = model.layout
    freezing = np.setdiff1d(layout.kept, layout.active)
    first = np.union1d(model.norms, freezing).astype(np.int64)
    kept, _ = independent_rows(gradient(model, q, s, time, parameters), first, layout.nonholonomic)
    if len(kept) != layout.rank or len(np.setdiff1d(kept, layout.nonholonomic)) != len(layout.independent_holonomic):
        return model
    new = replace(model, layout=replace(layout, kept=kept, active=np.setdiff1d(kept, freezing)))
    key = (model.digest, kept.tobytes())
    with _LOCK:
        system = _systems.get(key)
    return replace(new, system=system) if system else eliminated_anew(new, q, s, time, parameters, key)


def eliminated_anew(
    model: Model, q: Array, s: Array, time: float, parameters: Array, key: tuple[str, bytes] | None = None
) -> Model:
    """Choose a new order of elimination at a pose of one realisation; store it under `key`, if given."""
    shift = np.random.default_rng(0).uniform(0.1, 0.3, (2, len(q)))
    near = state_arguments(time, np.stack([q, q + shift[0]]), np.stack([s, s]), np.stack([shift[1], shift[1]]))
    system = index1_system(model, (near, np.stack([parameters, parameters])))
    if key is not None:
        with _LOCK:
            while len(_systems) >= SYSTEMS:
                del _systems[next(iter(_systems))]
            _systems[key] = system
    return replace(model, system=system)


def regular(
    model: Model, states: Array, previous: Array, now: Array, sizes: Array, parameters: Array, tolerance: float
) -> NDArray[np.bool_]:
    """Return which of K realisations with rejected steps have no singular pose and no poor pivot in reach.

    States are (K, width) at the times `now` (K,), s; `previous` (K,) are the times of the preceding nodes in s, or
    `now`.
    """
    ranks = ranks_along(model, *model.layout.split(states), now, parameters)
    ahead, kept_ahead = (np.abs([getattr(rank, name) for rank in ranks]) for name in ("ahead", "kept_ahead"))
    every, kept = (np.array([getattr(rank, name) for rank in ranks]) for name in ("every", "kept"))
    reach = REACH * np.maximum(sizes, now - previous)
    dependent = (ahead > 2 * kept_ahead) & (kept < DEPENDENT * every) & (kept_ahead < reach)
    found: NDArray[np.bool_] = ~dependent & (ahead > reach)
    some = np.flatnonzero(found)
    with np.errstate(all="ignore"):
        off = _residuals_ahead(model, states[some], now[some], sizes[some], parameters[some])[2]
    found[some] = off.max(axis=1) <= POOR * tolerance
    return found


def _residuals_ahead(
    model: Model, states: Array, now: Array, sizes: Array, parameters: Array
) -> tuple[Array, Array, Array]:
    """Return states (K, place, width), times (K, place) and relative residuals (K, place) in the next steps."""
    n = model.layout.coordinates
    ahead = np.repeat(states[:, None], len(PLACES), axis=1)
    ahead[..., :n] += (sizes[:, None] * PLACES)[..., None] * states[:, None, model.layout.velocities :]
    times = now[:, None] + sizes[:, None] * PLACES
    block = np.repeat(parameters, len(PLACES), axis=0)
    found = residuals(model, ahead.reshape(-1, states.shape[1]), times.ravel(), block)
    return ahead, times, np.nan_to_num(found, nan=np.inf).reshape(-1, len(PLACES))


@dataclass
class SingularPoseWatcher:
    """Monitor of the rank in an explicit integration of one realisation."""

    model: Model  # with the currently kept equations
    parameters: Array  # (parameter,)
    tolerance: float  # relative tolerance, and absolute tolerance of coordinates of size one
    limit: float = np.inf  # longest step, s
    passed: int = 0  # number of singular poses passed

    def __post_init__(self) -> None:
        # changes of the kept equations, in words
        self.notes: list[str] = []
        self.reordered, self.no_better = 0, 0  # numbers of accepted and rejected orders of elimination
        # choices of equations, with the time from which they apply
        self.models: list[tuple[float, Model]] = [(-np.inf, self.model)]
        # final: whether the mechanism itself fails, so that no other method could continue
        self.checks, self.final = 0, False
        self.best: Continuation | None = None
        self.least, self.distance = np.inf, np.inf

    @property
    def approaching(self) -> bool:
        """Whether a singular pose is being approached."""
        return self.checks > 0

    def model_at(self, time: float) -> Model:
        """Return the model with the choice of equations for a time, s."""
        return [model for begin, model in self.models if begin < time or begin == -np.inf][-1]

    def check(self, now: float, known: tuple[Array, Array], size: float, end: float) -> Continuation | None:
        """Return the continuation from the last node at time `now`, s; None: continue as before.

        `known` contains the last times (N,) in s, and the states (N, width). `size` is the length of the difficult
        step, and `end` is the time of the next jump, both in s.
        """
        times, states = known
        z = states[-1]
        rank = self._rank(now, z)
        step = now - float(times[-2]) if len(times) > 1 else 0.0
        apart = abs(rank.ahead) > 2 * abs(rank.kept_ahead)
        if apart and rank.kept < DEPENDENT * rank.every and abs(rank.kept_ahead) < REACH * max(size, step):
            return self._others(now, z, rank)
        if not self.approaching:
            if abs(rank.ahead) > REACH * max(size, step):
                return Continuation(others=True) if self.reorder(now, z, size) else None
            if abs(rank.ahead) < FOOTING * step and len(times) > 1:
                return Continuation(back=True)
        if rank.ahead <= 0 or rank.ahead > 100 * max(size, step):
            return self._continue_unchanged()
        self.checks += 1
        self.limit = APPROACH * rank.ahead
        if rank.ahead < END * max(1.0, abs(now)) or self.checks > MOST_CHECKS:
            # after many checks, rounding may prevent the passage: another method may succeed
            self.final = self.checks <= MOST_CHECKS
            return Continuation(reason=dead_end(self.model, now, replace(rank, every=0.0), final=self.final))
        return self._over(now, times, states, rank, end) or Continuation()

    def reason(self, now: float, z: Array) -> str:
        """Return the reason for too small steps if it is the rank; else an empty text."""
        text = dead_end(self.model, now, self._rank(now, z))
        self.final = self.final or bool(text)
        return text

    def _rank(self, time: float, z: Array) -> Rank:
        n, k = self.model.layout.coordinates, self.model.layout.states
        return rank_along(self.model, z[:n], z[n : n + k], z[n + k :], time, self.parameters)

    def _speed(self, z: Array) -> float:
        return float(np.abs(z[self.model.layout.velocities :]).max(initial=0.0))

    def _continue_unchanged(self) -> Continuation | None:
        """Continue as before."""
        before, self.checks, self.limit = self.checks, 0, np.inf
        self.best, self.least, self.distance = None, np.inf, np.inf
        return Continuation() if before else None

    def reorder(self, now: float, z: Array, size: float) -> bool:
        """Choose a new order of elimination if pivots are poor within a step of `size` s; return whether it changed."""
        layout = self.model.layout
        with np.errstate(all="ignore"):
            states, at, off = _residuals_ahead(
                self.model, z[None], np.array([now]), np.array([size]), self.parameters[None]
            )
            ahead, times, before = states[0], at[0], off[0]
            worst = int(np.argmax(before))
            if before[worst] <= POOR * self.tolerance or self.no_better >= TRIALS:
                return False
            q, s, _ = layout.split(ahead[worst])
            model = eliminated_anew(self.model, q, s, times[worst], self.parameters)
            better = model.system.programs is not None
            if better:  # otherwise LAPACK solves the system
                after = residuals(model, ahead, times, np.repeat(self.parameters[None], len(ahead), axis=0))
                better = bool(np.isfinite(after).all() and after.max() <= BETTER * before[worst])
        if not better:
            self.no_better += 1
            return False
        self.reordered += 1
        self.model = model
        self.models.append((now, model))
        self._continue_unchanged()
        return True

    def _others(self, now: float, z: Array, rank: Rank) -> Continuation | None:
        """Select other equations."""
        n, k = self.model.layout.coordinates, self.model.layout.states
        model = repivoted(self.model, z[:n], z[n : n + k], now, self.parameters)
        new = np.setdiff1d(model.layout.kept, self.model.layout.kept)
        if not len(new) or model.system.programs is None:
            return self._continue_unchanged()
        old = np.setdiff1d(self.model.layout.kept, model.layout.kept)
        self.notes.append(
            f"at t = {now:.6g} s the equations {named(model, rank.kept_equations)} become dependent; "
            f"{named(model, new, 40)} are used instead of {named(model, old, 40)}"
        )
        self.model = model
        self.models.append((now, model))
        self._continue_unchanged()
        return Continuation(others=True)

    def _over(self, now: float, times: Array, states: Array, rank: Rank, end: float) -> Continuation | None:
        """Pass over a singular pose if the continuation is accurate enough."""
        if len(times) >= FEWEST:
            self._continue(now, times, states, rank, end)
        allowed = self.tolerance if rank.ahead > PAST * self.distance else max(self.tolerance, ROUNDING)
        if self.best is None or self.least > allowed:
            return None
        course = self.best
        self.passed += 1
        self._continue_unchanged()
        return course

    def _continue(self, now: float, times: Array, states: Array, rank: Rank, end: float) -> None:
        """Continue the motion beyond a singular pose; store the continuation if no earlier continuation is better."""
        block = np.repeat(self.parameters[None], len(states), axis=0)
        q, s, v = self.model.layout.split(states)
        a, _, changes = accelerations(self.model, q, s, v, times, block)
        rates = np.concatenate([v, changes, a], axis=1)
        curve, lower = _polynomial(times, states, rates), _polynomial(times[1:], states[1:], rates[1:])
        n = self.model.layout.coordinates
        velocities = n + self.model.layout.states
        way = max(self._speed(states[-1]) * rank.ahead, 1e-300)
        for factor in (2.0, 3.0):
            time = now + factor * rank.ahead
            there = curve(time)
            error = float(np.sqrt(np.mean(((there - lower(time)) / (1.0 + np.abs(there))) ** 2)))
            if time > end or not error < self.least:
                return
            state = there.copy()
            for _ in range(4):
                q, v = excess(self.model, state[None], time, self.parameters[None])
                state[:n] -= q[0]
                state[velocities:] -= v[0]
            strayed = np.abs(state - there)
            if not (
                strayed[:n].max(initial=0.0) < STRAY * way
                and strayed[velocities:].max(initial=0.0) < STRAY * self._speed(state) * min(1.0, STRAY)
            ):
                continue
            if -4 * rank.ahead < self._rank(time, state).ahead < -0.2 * rank.ahead:
                self.best = Continuation(time=time, state=state, curve=curve)
                self.least, self.distance = error, rank.ahead
                return


def _polynomial(times: Array, states: Array, rates: Array) -> Callable[[Any], Array]:
    """Interpolate states and rates."""
    from scipy.interpolate import KroghInterpolator

    values = np.stack([x for pair in zip(states, rates, strict=True) for x in pair])
    found: Callable[[Any], Array] = KroghInterpolator(np.repeat(times, 2), values)
    return found
