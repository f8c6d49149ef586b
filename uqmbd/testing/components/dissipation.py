"""Dissipation: no closed motion of bodies gains energy from virtual work, and no auxiliary state grows at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import Instance, derive
from uqmbd.testing.components.bench import Bench, norm_rows
from uqmbd.testing.components.loads import feasible_state, loads_at
from uqmbd.typing import Array

__all__ = ["check_dissipation"]

POSES = 6
"""Number of random poses of each realisation."""

LOOPS = 60
"""Number of closed motions in each pose."""

SIDES = 3
"""Number of straight parts of a closed motion, each with a separate speed."""

STEP = 1e-5
"""Step of central differences of auxiliary states, relative to one plus their magnitude."""

FAR = 0.3
"""Step of secants of the rates of auxiliary states, relative to one plus their magnitude."""

SLOW = 1e-3
"""Speed of a motion, m/s, at which only auxiliary states cause forces."""

SMALL = 1e-7
"""Energy gain that counts as rounding, relative to the sum of the magnitudes of its parts."""


@dataclass(frozen=True)
class _Laws:
    """Laws of a component in one pose, as functions of auxiliary states and velocities."""

    instance: Instance
    q: Array  # (n,)
    time: float  # s
    parameters: Array  # (parameter,)

    def __call__(self, s: Array, v: Array) -> tuple[Array, Array]:
        """Return forces of virtual work (M, n) and rates of states (M, s), at states (M, s) and velocities (M, n)."""
        count = len(v)
        fixed = [np.repeat(x[None, :], count, axis=0) for x in (self.q, np.array([self.time]), self.parameters)]
        found = _kernel(self.instance)(np.ascontiguousarray(np.concatenate([fixed[0], s, v, *fixed[1:]], axis=1)))
        n, states = len(self.q), s.shape[1]
        return found[:, :n], found[:, n : n + states]

    def start(self) -> Array:
        """Return the initial values of the states (s,)."""
        states, n = len(self.instance.type.states), len(self.q)
        arguments = np.concatenate([self.q, np.zeros(states), np.zeros(n), [self.time], self.parameters])
        return _kernel(self.instance)(arguments[None, :])[0, n + states :]


def check_dissipation(bench: Bench, rng: np.random.Generator) -> None:
    """Raise AssertionError if virtual work, auxiliary states or impacts of a component create energy.

    A small closed motion with parts u_k, sum u_k = 0, at speeds a_k gains the energy ``sum F(q, a_k u_k) . u_k``. The
    gain is zero for forces that depend only on the pose, and negative for friction.
    """
    _check_restitution(bench, rng)
    block = bench.instance.type
    if not block.work and not block.states:
        return
    for parameters in bench.parameters(bench.inputs):
        for _ in range(POSES):
            q, s, _, time = feasible_state(bench, parameters, rng)
            laws = _Laws(bench.instance, q, time, parameters)
            motions = _allowed(bench, q, s, time, parameters)
            if len(motions):
                _check_loops(bench, laws, motions, rng)
            if block.states:
                _check_growth(bench, laws)
                _check_memory(bench, laws, motions, rng)


def _kernel(instance: Instance) -> Kernel:
    """Compile the forces of virtual work, the rates of states and their initial values."""
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        return derived.kernel(arguments, [*derived.work_force, *derived.g, *derived.s0])

    result: Kernel = cached(("dissipation", instance.type.digest), make)
    return result


def _allowed(bench: Bench, q: Array, s: Array, time: float, parameters: Array) -> Array:
    """Return a basis (motion, n) of the velocities that satisfy the constraints and the lengths of quaternions."""
    n = len(q)
    rows = loads_at(bench.instance, q, s, np.zeros(n), time, parameters).gradient
    rows = np.concatenate([rows, norm_rows(bench.instance, q)])
    if not len(rows):
        return np.eye(n)
    _, sizes, basis = np.linalg.svd(rows)
    return np.asarray(basis[int((sizes > 1e-9 * sizes[0]).sum()) :])


def _check_loops(bench: Bench, laws: _Laws, motions: Array, rng: np.random.Generator) -> None:
    """Check small closed triangles, and motions back and forth, with random speeds and initial states."""
    parts = rng.normal(size=(LOOPS, SIDES, len(motions)))
    parts[: LOOPS // 2, -1] = 0  # back and forth
    parts[:, 0] -= parts.sum(axis=1)
    u = parts @ motions
    speeds = np.exp(rng.uniform(-2, 1, (LOOPS, SIDES, 1)))
    force, _ = laws(np.repeat(laws.start()[None, :], LOOPS * SIDES, axis=0), (speeds * u).reshape(-1, u.shape[-1]))
    power = (force.reshape(u.shape) * u).sum(axis=2)
    gained, size = power.sum(axis=1), np.abs(power).sum(axis=1)
    worst = int(np.argmax(gained - SMALL * size))
    assert not gained[worst] > SMALL * size[worst] + 1e-12, (
        f"{bench.title}: its virtual work generates energy: the bodies gain {gained[worst]:.3g} J per metre along a "
        f"small closed path. The exchange along its {SIDES} straight segments is {size[worst]:.3g} J per metre. "
        "Check the signs of damping, friction and slip, and that a contact force is not larger during separation. "
        "For a motor or a controller, pass dissipative=False."
    )


def _check_growth(bench: Bench, laws: _Laws) -> None:
    """Require that slopes and secants of auxiliary state rates at rest have no eigenvalue with positive real part."""
    states = laws.start()
    for step in (STEP, FAR):
        steps = np.diag(step * (1 + np.abs(states)))
        rest = np.zeros((len(steps), len(laws.q)))
        _, ahead = laws(states + steps, rest)
        _, behind = laws(states - steps, rest)
        slope = ((ahead - behind) / (2 * np.diag(steps))[:, None]).T
        if not np.isfinite(slope).all():
            continue
        growth = float(np.linalg.eigvals(slope).real.max())
        assert growth < 1e-6 * (1 + np.abs(slope).max()), (
            f"{bench.title}: its auxiliary states {', '.join(map(repr, bench.instance.type.states))} grow at the "
            f"rate {growth:.3g} 1/s while the bodies are at rest. Check the sign of each rate of uqmbd.Auxiliary. If "
            "the component is unstable by design, pass dissipative=False."
        )


def _check_memory(bench: Bench, laws: _Laws, motions: Array, rng: np.random.Generator) -> None:
    """Require that the forces of auxiliary states, after an initial motion has changed these, oppose this motion."""
    if not len(motions):
        return
    u = rng.normal(size=(LOOPS, len(motions))) @ motions
    start = np.repeat(laws.start()[None, :], LOOPS, axis=0)
    _, forward = laws(start, u)
    _, back = laws(start, -u)
    change = (forward - back) / 2
    step = STEP * (1 + np.abs(start).max()) / (1 + np.abs(change).max())
    ahead, _ = laws(start + step * change, SLOW * u)  # at low speed: closed motions test laws that depend on speed
    behind, _ = laws(start - step * change, SLOW * u)
    parts = (ahead - behind) / (2 * step) * u
    power = parts.sum(axis=1)
    size = np.abs(parts).sum(axis=1) + 1e-3 * np.abs(ahead * u).sum(axis=1)
    if not np.isfinite(power).all():
        return
    worst = int(np.argmax(power - 1e-5 * size))
    assert power[worst] <= 1e-5 * size[worst] + 1e-9, (
        f"{bench.title}: its auxiliary states {', '.join(map(repr, bench.instance.type.states))} amplify the motion "
        f"that changes them: the power of their forces initially grows by {power[worst]:.3g} W/s. Check the signs of "
        "the rates of uqmbd.Auxiliary and of the forces. If the component is unstable by design, pass "
        "dissipative=False."
    )


def _check_restitution(bench: Bench, rng: np.random.Generator) -> None:
    """Require coefficients of restitution between 0 and 1, and of friction of at least 0."""
    block = bench.instance.type
    if not any(e.directions for e in block.events):
        return
    targets = bench.kernel("contact")[1]
    for _ in range(POSES):
        values = bench.evaluate("contact", bench.state(rng), bench.parameters(bench.inputs))
        for column, (name, *where) in zip(values.T, targets, strict=True):
            if name != "law":
                continue
            what, most = (("restitution", 1.0), ("friction", np.inf))[where[1]]
            wrong = column[(column < 0) | (column > most)]
            assert not len(wrong), (
                f"{bench.title}: the coefficient of {what} of the event {block.events[where[0]].label!r} is "
                f"{wrong[0]:.4g}; expected 0 {'to 1' if most == 1 else 'or more'}. Values outside this range "
                "generate energy. Declare minimum= and maximum= of its parameter, or correct the expression."
            )
