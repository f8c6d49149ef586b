"""Response of the linearised mechanism to excitations, for outputs that plugins compute from it.

Small motions about a pose at rest satisfy the constraints to first order: ``dq = N x + P w``, with a basis ``N`` of the
null space of ``D`` and ``D P = -dPhi/dw``.  The equations of motion along ``N`` and the rates of the auxiliary states
give ``z' = A z + B0 w + B1 w' + B2 w''`` for ``z = (x, x', s)``.  Multipliers and accelerations follow from the same
equations, so that every output has the form ``y = C z + D0 w + D1 w' + D2 w''``.  With the state
``z - (B1 + A B2) w - B2 w'`` the system is::

    z' = A z + B w              y = C z + E0 w + E1 w' + E2 w''
    B  = B0 + A B1 + A^2 B2     E0 = D0 + C (B1 + A B2)      E1 = D1 + C B2      E2 = D2

About a steady motion, small motions are written in frames with constant coefficients (`steady_modes`):
``dq = S (N x + P w)``, whose rates contain the rates of ``S``. The matrices are evaluated at several times of the
motion, and must not change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Instance, Model, OutputMap, ParameterMap, excitations_of, state_arguments
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.linear_system import Channel, LinearSystem
from uqmbd.dynamics.statics.rest_equations import solve_definite, tangents
from uqmbd.dynamics.statics.screws import Screws
from uqmbd.dynamics.statics.steady_modes import CHANGING, CONSTANT, SteadyFrames, steady_frames
from uqmbd.dynamics.statics.steady_motion import SteadyMotions
from uqmbd.dynamics.statics.unilateral import not_linear
from uqmbd.errors import StudyError
from uqmbd.mechanism import ORDERS, LinearOutput, Output, t
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["LinearMap", "linear_map"]

LEAST_CHUNK, LARGEST_CHUNK, NUMBERS = 256, 8192, 1 << 21
"""Least and largest number of realisations that are linearised at once, and number of matrix entries in between."""

ROUNDING = 1e-11
"""Direct response, relative to the whole response at the highest frequency of the mechanism, that counts as zero."""

NOISE = 1e-9
"""Change of a response during a steady motion, relative to its terms, that counts as rounding."""

INVARIANT = (
    "Use a quantity that remains constant, such as an angle between bodies, a distance, or a position across the motion"
)

ROLLING = (
    "responses about steady motions are not computed for mechanisms with constraints between velocities, such as "
    "rolling wheels; simulate the motion"
)

PRESCRIBED = "a random process prescribes a speed, or a constraint contains a state; prescribe the position instead"


@dataclass(frozen=True)
class _LinearisedStates:
    """States about which the motion is linearised: of K realisations at rest, or at K times of one steady motion."""

    values: Array  # inputs (K, input)
    block: Array  # (K, parameter)
    time: Array  # (K,)
    q: Array
    s: Array
    v: Array
    a: Array
    multipliers: Array  # (K, constraint)
    frames: SteadyFrames | None = None  # None: at rest


@dataclass(frozen=True)
class LinearMap:
    """Compiled outputs of the linearised mechanism."""

    requests: tuple[tuple[Any, int, str, tuple[float, ...]], ...]
    """For each value: the declared function, the number of its expression, the pose, and further numbers."""
    seen: OutputMap
    """Expressions of the values, with all derivatives."""
    sources: tuple[Any, ...]
    arguments: ParameterMap
    """Speeds, then offsets, of the channels."""

    @property
    def poses(self) -> frozenset[str]:
        """Poses of the linearisations."""
        return frozenset(pose for _, _, pose, _ in self.requests)

    def evaluate(self, ensemble: Batch, pose: str, q: Array, s: Array) -> tuple[list[int], Array, list[str]]:
        """Evaluate the values of a pose (K, coordinate), (K, state) at rest.

        Return the numbers of the values, the values (K, value), and for each realisation the reason for missing values.
        """
        columns = self._columns(pose)
        values, reasons = np.full((len(q), len(columns)), np.nan), [""] * len(q)
        chunk = min(max(NUMBERS // max(ensemble.model.layout.width, 1) ** 2, LEAST_CHUNK), LARGEST_CHUNK)
        for first in range(0, len(q), chunk):
            part = np.arange(first, min(first + chunk, len(q)))
            systems = self._systems(ensemble.model, _at_rest(ensemble.select(part), q[part], s[part]))
            for column, k in enumerate(columns):
                system = systems if isinstance(systems, str) else systems(self.requests[k][1])
                found, missing = self._value(k, system, len(part))
                values[part, column] = found
                if any(missing):
                    for member, reason in zip(part.tolist(), missing, strict=True):
                        reasons[member] = reasons[member] or reason
        lost = not_linear(ensemble, q, s)
        if any(lost):
            values[[bool(x) for x in lost]] = np.nan
            reasons = [first or second for first, second in zip(lost, reasons, strict=True)]
        return columns, values, reasons

    def evaluate_steady(self, ensemble: Batch, motions: SteadyMotions) -> tuple[list[int], Array, list[str]]:
        """Evaluate the values about steady motions, as `evaluate` about poses at rest."""
        columns = self._columns("steady")
        values, reasons = np.full((len(ensemble), len(columns)), np.nan), list(motions.messages)
        for k, screws in enumerate(motions.screws):
            if screws is None:
                continue
            one = ensemble.select(np.array([k]))
            if len(ensemble.model.layout.nonholonomic):
                reasons[k] = ROLLING
                continue
            missing = [CHANGING] * len(columns)
            for frames in steady_frames(one, screws):
                systems = self._systems(ensemble.model, _in_motion(one, screws, frames))
                for column, wanted in enumerate(columns):
                    if missing[column]:
                        system = systems if isinstance(systems, str) else _constant(systems(self.requests[wanted][1]))
                        found, lost = self._value(wanted, system, 1)
                        values[k, column], missing[column] = found[0], lost[0]
                if not any(missing):
                    break
            reasons[k] = reasons[k] or next(filter(None, missing), "")
        return columns, values, reasons

    def _columns(self, pose: str) -> list[int]:
        return [k for k, (_, _, at, _) in enumerate(self.requests) if at == pose]

    def _value(self, wanted: int, system: LinearSystem | str, count: int) -> tuple[Array, Sequence[str]]:
        """Return a value of K realisations, and reasons; a text instead of a system is the reason of all."""
        if isinstance(system, str):
            return np.full(count, np.nan), [system] * count
        declared, _, _, numbers = self.requests[wanted]
        found: tuple[Array, Sequence[str]] = declared.function(system, *numbers)
        return found

    def _systems(self, model: Model, points: _LinearisedStates) -> Callable[[int], LinearSystem] | str:
        """Return a function from the number of an expression to its linear system, or the reason why there is none."""
        q, s, v, time, count = points.q, points.s, points.v, points.time, len(self.sources)
        speed, offset = np.split(self.arguments(points.values), 2, axis=1)
        channels = tuple(Channel(x, speed[:, k], offset[:, k]) for k, x in enumerate(self.sources))
        layout, n = model.layout, model.layout.coordinates
        place = offset + time[:, None] * speed
        found = model.evaluate("linear", state_arguments(time, q, s, v, points.multipliers, points.a), points.block)
        base = model.evaluate("acceleration", state_arguments(time, q, s, v), points.block)
        own = ((found["s_q"] != 0).any(axis=2) | (found["s_s"] != 0).any(axis=2)).any(axis=0)
        own |= (found["s_c"] != 0).any(axis=(0, 2))
        if points.frames is not None:
            own = ~points.frames.carried
        if found["phi_c"][:, layout.nonholonomic].any() or found["phi_s"][:, :, own].any():
            return PRESCRIBED
        mass, d = base["mass"], base["d"][:, layout.kept]

        def of_time(derivatives: Array) -> list[Array]:
            """Convert derivatives by coefficients to derivatives (K, row, channel) by excitations and their rates."""
            zero, one, two = np.moveaxis(derivatives.reshape(*derivatives.shape[:2], count, ORDERS), 3, 0)
            x, rate = place[:, None], speed[:, None]
            return [zero, (one - x * zero) / rate, (two - x * one + x**2 * zero / 2) / rate**2]

        gram = d @ d.transpose(0, 2, 1)
        moved = of_time(found["phi_c"][:, layout.kept])[0]
        # small motions along the constraints, small motions that follow the excitations, and rates of both
        bases, follows = _motions(d, gram, moved, points.frames)
        basis, follow = bases[0], follows[0]
        free = basis.shape[2]
        size = 2 * free + int(own.sum())
        w = [slice(size + k * count, size + (k + 1) * count) for k in range(ORDERS)]

        def blank(rows: int) -> Array:
            return np.zeros((len(q), rows, size + ORDERS * count))

        dq, dv, da, ds = blank(n), blank(n), blank(n), blank(layout.states)
        dq[:, :, :free], dq[:, :, w[0]] = basis, follow
        dv[:, :, free : 2 * free], dv[:, :, w[1]] = basis, follow
        dv[:, :, :free], dv[:, :, w[0]] = bases[1], follows[1]
        # without the second rate of x
        da[:, :, free : 2 * free], da[:, :, :free] = 2 * bases[1], bases[2]
        da[:, :, w[2]], da[:, :, w[1]], da[:, :, w[0]] = follow, 2 * follows[1], follows[2]
        ds[:, ~own] = found["s_v"][:, ~own] @ dq
        ds[:, np.flatnonzero(own), 2 * free + np.arange(int(own.sum()))] = 1.0
        if own.size or d.shape[1] or points.frames is not None:
            force = found["v_q"] @ dq + found["v_v"] @ dv + found["v_s"] @ ds
            rates = found["s_q"] @ dq + found["s_v"] @ dv + found["s_s"] @ ds
        else:  # the coordinates are independent of each other
            force, rates = np.concatenate([found["v_q"], found["v_v"], blank(n)[:, :, size:]], axis=2), blank(0)
        for part, of_force, of_rate in zip(w, of_time(found["v_c"]), of_time(found["s_c"]), strict=True):
            force[:, :, part] += of_force
            rates[:, :, part] += of_rate
        dl = blank(layout.constraints)
        if d.shape[1] or points.frames is not None:
            across = basis.transpose(0, 2, 1)
            along = -_solve(across @ mass @ basis, across @ (force + mass @ da))
            da += basis @ along
            dl[:, layout.kept] = -_solve(gram, d @ (mass @ da + force))
        else:
            along = da = -_solve(mass, force)
        flow = np.concatenate([blank(free), along, rates[:, own]], axis=1)
        flow[:, np.arange(free), free + np.arange(free)] = 1.0
        a, b0, b1, b2 = flow[:, :, :size], *(flow[:, :, part] for part in w)
        carried = b1 + a @ b2
        state = np.concatenate([q, s, v, points.a, points.multipliers, time[:, None]], axis=1)
        every = self.seen(state, points.values, points.block)
        expressions = len(self.seen.names)
        gradients = every[:, expressions:].reshape(len(q), expressions, -1)
        motion = np.concatenate([dq, ds, dv, da, dl], axis=1)
        fastest = np.sqrt(np.linalg.norm(a @ a, axis=(1, 2)))[:, None]

        def system(number: int) -> LinearSystem:
            gradient = gradients[:, number]
            row = (gradient[:, None, : motion.shape[1]] @ motion)[:, 0]
            for part, of_row in zip(w, of_time(gradient[:, None, motion.shape[1] :]), strict=True):
                row[:, part] += of_row[:, 0]
            c = row[:, :size]
            b = b0 + a @ carried
            e = np.stack([row[:, part] for part in w], axis=1)
            e[:, 0] += np.einsum("kn,knc->kc", c, carried)
            e[:, 1] += np.einsum("kn,knc->kc", c, b2)
            powers = fastest[:, :, None] ** np.arange(ORDERS)[None, :, None]
            inside = np.einsum("kn,knc->kc", np.abs(c), np.abs(b)) / np.where(fastest == 0, 1.0, fastest)
            whole = (np.abs(e) * powers).max(axis=1) + inside
            e[np.abs(e) * powers <= ROUNDING * whole[:, None]] = 0.0
            return LinearSystem(a, b, c, e, every[:, number], channels, self.seen.names[number])

        return system


def _at_rest(ensemble: Batch, q: Array, s: Array) -> _LinearisedStates:
    """Return poses at rest (K, coordinate), (K, state)."""
    model, v = ensemble.model, np.zeros_like(q)
    time = np.full(len(q), model.time)
    return _LinearisedStates(
        ensemble.values, ensemble.block, time, q, s, v, v, _multipliers(model, q, s, v, time, ensemble.block)
    )


def _in_motion(one: Batch, screws: Screws, frames: SteadyFrames) -> _LinearisedStates:
    """Return the states of a steady motion at its examined times."""
    model, count = one.model, len(frames.times)
    q, v, a, s, _ = (np.array(x) for x in zip(*map(screws.at, frames.times), strict=True))
    values, block = (np.repeat(x, count, axis=0) for x in (one.values, one.block))
    time = model.time + np.array(frames.times)
    return _LinearisedStates(values, block, time, q, s, v, a, _multipliers(model, q, s, v, time, block), frames)


def _multipliers(model: Model, q: Array, s: Array, v: Array, time: Array, block: Array) -> Array:
    found = np.zeros((len(q), model.layout.constraints))
    found[:, model.layout.kept] = accelerations(model, q, s, v, time, block)[1]
    return found


Rates = tuple[Array, Array, Array]
"""Matrices (K, coordinate, column), and their first and second rates."""


def _motions(d: Array, gram: Array, moved: Array, frames: SteadyFrames | None) -> tuple[Rates, Rates]:
    """Return bases of small motions within constraints with the gradients ``d``, and motions that follow excitations.

    ``moved`` (K, row, channel) is the derivative of the constraints by the excitations.
    """
    if frames is None:
        basis = tangents(np.ascontiguousarray(d))
        follow = -d.transpose(0, 2, 1) @ _solve(gram, moved)
        none, still = np.zeros_like(basis), np.zeros_like(follow)
        return (basis, none, none), (follow, still, still)
    s, s1, s2 = frames.maps
    inside = -np.linalg.pinv(d @ s, rcond=1e-9) @ moved
    return (s @ frames.basis, s1 @ frames.basis, s2 @ frames.basis), (s @ inside, s1 @ inside, s2 @ inside)


def _constant(system: LinearSystem) -> LinearSystem | str:
    """Return the system of one realisation from those at the times of a steady motion, or the reason without one."""
    sizes = np.abs(system.eigenvalues[0])
    sizes = sizes[sizes > 0] if (sizes > 0).any() else np.ones(1)
    frequencies = np.concatenate([sizes * x for x in (0.3, 0.9, 3.0)])
    response = system.transfer(np.broadcast_to(frequencies, (len(system), len(frequencies))))
    rate = float(sizes.max())
    inside = (np.abs(system.c)[:, :, None] * np.abs(system.b)).sum(axis=1) / rate
    whole = (np.abs(system.e) * rate ** np.arange(ORDERS)[None, :, None]).sum(axis=1) + inside
    change = np.abs(response - response[:1])
    if (change > CONSTANT * np.abs(response) + NOISE * whole.max(initial=0.0)).any():
        return f"the response of {system.name} changes during the steady motion. {INVARIANT}"
    same = np.ptp(system.mean) <= CONSTANT * max(float(np.abs(system.mean).max()), 1e-3)
    channels = tuple(Channel(c.source, c.speed[:1], c.offset[:1]) for c in system.channels)
    mean = system.mean[:1] if same else np.full(1, np.nan)
    return LinearSystem(system.a[:1], system.b[:1], system.c[:1], system.e[:1], mean, channels, system.name)


def _solve(matrix: Array, right: Array) -> Array:
    """Solve symmetric systems (K, m, m), usually definite, for right-hand sides (K, m, columns)."""
    try:
        return solve_definite(matrix, right)
    except np.linalg.LinAlgError:  # a singular system must not affect the others
        return np.asarray(np.linalg.pinv(np.nan_to_num(matrix)) @ right)


def linear_map(
    found: Sequence[LinearOutput],
    instances: list[Instance],
    inputs: Sequence[RandomVariable],
    compiled: Callable[[Sequence[Output]], OutputMap],
) -> LinearMap | None:
    """Compile outputs of the linearised mechanism; `compiled` compiles expressions with all derivatives."""
    if not found:
        return None
    coefficients = excitations_of(instances)
    channels = [c for c in coefficients if c.order == 0]
    names: dict[str, Any] = {}
    for c in channels:
        name = c.source.source.name
        if names.setdefault(name, c.source) != c.source:
            raise StudyError(f"two different random processes have the name {name!r}; give each a different name.")
    if not channels:
        raise StudyError(
            f"output {str(found[0])!r} is a response to random processes, but no component of the mechanism contains "
            "one; use a process in a force, a driver or a road."
        )
    seen = sorted({x.seen for x in found}, key=str)
    requests = tuple((x.declared, seen.index(x.seen), x.at, x.numbers) for x in found)
    arguments = [*(c.argument.diff(t) for c in channels), *(c.argument.subs(t, 0) for c in channels)]
    return LinearMap(
        requests,
        compiled([Output(str(e), e, "") for e in seen]),
        tuple(c.source.source for c in channels),
        ParameterMap.of(arguments, inputs),
    )
