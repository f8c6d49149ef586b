"""Compute eigenvalues of small motions about a steady motion, in frames with constant coefficients.

Small changes of position and attitude of each body are written in axes that turn with a frame of constant angular
velocity: ``dq = S(t) x``.  Within the constraints ``x = N y``, and to first order::

    M y'' + C y' + K y + F s = 0
    M = N^T S^T m S N
    C = N^T S^T (2 m S' + c S) N
    K = N^T S^T (m S'' + c S' + k S) N

where ``m``, ``c`` and ``k`` are exact derivatives of the equations of motion, including the derivatives of inertia and
constraint forces.  Suitable frames, with constant ``N``, ``M``, ``C`` and ``K``, are found by evaluation at several
times of the motion.  The candidates are the world, the frames that rotate with bodies, and frames that differ between
bodies, in this order.  The first candidate with constant coefficients is used; without one there are no eigenvalues.

Constraints between velocities restrict the rates: ``y' = Z u + P y``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.linalg import expm

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.statics.modes import Modes, Pairs, Solved, eigenpairs, gathered, no_modes, zeros_of
from uqmbd.dynamics.statics.screws import Screws, cross_matrix, left_product
from uqmbd.dynamics.statics.steady_motion import SteadyMotions
from uqmbd.typing import Array

__all__ = ["CHANGING", "CONSTANT", "SteadyFrames", "linearise_steady", "steady_frames"]


CONSTANT = 1e-5
"""Allowed relative change of a coefficient."""

NOISE = 1e-7
"""Stiffness, relative to the largest stiffness, that counts as rounding."""

ROUNDING = 1e-12
"""Size of a sum, relative to its terms, below which the sum counts as rounding."""

CHOICES = 300
"""Largest number of combinations of frames to test."""

CHANGING = (
    "the coefficients of small motions about the steady motion change with time in every frame, so eigenvalues do not "
    "exist. An example is an asymmetric rotor in asymmetric bearings. Make the rotor or the bearings symmetric, or "
    "simulate "
    "the motion"
)


@dataclass(frozen=True)
class SteadyFrames:
    """Frames with constant coefficients of small motions ``dq = S N y`` of one realisation."""

    times: tuple[float, ...]  # times after the start, s
    maps: tuple[Array, Array, Array]  # (time, coordinate, column): S, and its first and second rates
    basis: Array  # (column, y): N
    carried: NDArray[np.bool_]  # auxiliary states determined by the pose
    coefficients: dict[str, Array]
    size: float  # size of the stiffness


@dataclass(frozen=True)
class _SteadyInstant:
    """Exact derivatives of the equations, and poses of the bodies, at one time of a steady motion."""

    after: float
    blocks: dict[str, Array]
    mass: Array
    gradient: Array  # derivatives of the kept position equations with respect to all coordinates
    attitudes: tuple[Array, Array, Array]


def linearise_steady(ensemble: Batch, motions: SteadyMotions) -> tuple[Modes, list[str]]:
    """Linearise K realisations about their steady motions; return modes (NaN if missing), and reasons."""
    found: list[Solved] = []
    messages = list(motions.messages)
    nothing = no_modes(ensemble.model.layout.coordinates)
    for k, screws in enumerate(motions.screws):
        solved: Solved | str = nothing
        if screws is not None:
            solved = _modes(ensemble.select(np.array([k])), screws)
        if isinstance(solved, str):
            messages[k] = messages[k] or solved
            solved = nothing
        found.append(solved)
    return gathered(found), messages


def _modes(one: Batch, screws: Screws) -> Solved | str:
    """Return sorted eigenvalues, one per pair, and shapes of one realisation, or the reason for their absence."""
    for frames in steady_frames(one, screws):
        if not frames.basis.shape[1]:
            return no_modes(one.model.layout.coordinates)
        solved = _solved(frames.coefficients, frames.size)
        if isinstance(solved, str):
            return solved
        values, vectors = solved
        return values, np.array([(x @ frames.basis @ vectors).T for x in frames.maps[0]])
    return CHANGING


def steady_frames(one: Batch, screws: Screws) -> Iterator[SteadyFrames]:
    """Yield all tested frames with constant coefficients of one realisation."""
    instants = [_instant(one, screws, after) for after in screws.times]
    carried = _carried(one, screws, instants[0])
    frames = screws.frames
    still = _moves(one, instants[0], [frames[0]] * len(one.model.bodies))
    free = [b for b in range(len(one.model.bodies)) if still[b]]
    tried: list[list[int]] = [[i] * len(free) for i in range(len(frames))]
    tried += [list(x) for x in islice(product(range(len(frames)), repeat=len(free)), CHOICES)]
    for choice in tried if free else [[]]:
        chosen = [frames[0]] * len(one.model.bodies)
        for b, i in zip(free, choice, strict=True):
            chosen[b] = frames[i]
        found = _constant(one, instants, chosen, carried)
        if found is not None:
            yield found


def _instant(one: Batch, screws: Screws, after: float) -> _SteadyInstant:
    model = one.model
    layout, time = model.layout, model.time + after
    q, v, a, s, rates = screws.at(after)
    q1, v1, a1, s1, rates1 = (np.ascontiguousarray(x)[None] for x in (q, v, a, s, rates))
    _, multipliers, _ = accelerations(model, q1, s1, v1, time, one.block)
    y, yp = one.pack(q1, s1, v1, multipliers), one.pack(v1, rates1, a1, np.zeros_like(multipliers))
    rows, pointers = model.pattern
    n = layout.unknowns
    columns = np.repeat(np.arange(n), np.diff(pointers))
    whole = np.zeros((2, n, n))
    for c in (0, 1):
        whole[c, rows, columns] = one.jacobian(time, y, yp, float(c))[0]
    part = layout.slices
    blocks = {i + k: whole[0][part[i], part[k]] for i in "vsm" for k in "qsv"}
    mass = (whole[1] - whole[0])[part["v"], part["v"]]
    gradient = model.evaluate("velocity", _arguments(time, q, s), one.parameters)["d"][0][layout.independent_holonomic]
    return _SteadyInstant(after, blocks, mass, gradient, screws.attitudes(after))


def _arguments(time: float, q: Array, s: Array) -> Array:
    return np.concatenate([q, s, np.zeros_like(q), [time, 0.0]])[None]


def _carried(one: Batch, screws: Screws, start: _SteadyInstant) -> NDArray[np.bool_]:
    """Return a mask of auxiliary states determined by the pose up to whole turns."""
    model = one.model
    carried: NDArray[np.bool_] = ~((start.blocks["sq"] != 0).any(axis=1) | (start.blocks["ss"] != 0).any(axis=1))
    if carried.all():
        return carried
    q, _, _, s, _ = screws.at(0.0)
    tangent = scipy.linalg.null_space(start.gradient)
    h, follows = 1e-5, np.ones(len(s), dtype=bool)
    for direction in tangent.T:
        stated = [
            model.evaluate("initial", _arguments(model.time, q + x * direction, s), one.parameters)["s"][0]
            for x in (h, -h)
        ]
        change = stated[0] - stated[1]
        change = (change - 2 * np.pi * np.round(change / (2 * np.pi))) / (2 * h)
        rate = -start.blocks["sv"] @ direction[model.layout.free]
        follows &= np.abs(change - rate) <= 1e-4 * (1 + np.abs(rate))
    found: NDArray[np.bool_] = carried | (follows & ~(start.blocks["ss"] != 0).any(axis=1))
    return found


def _seen(one: Batch, instant: _SteadyInstant, frames: list[Array]) -> tuple[Array, Array, Array]:
    """Return ``S`` and its first and second rates at one time, (n, column)."""
    model = one.model
    d, size = model.dimension, model.size
    axes = np.eye(3)[:, :d]
    turns = np.eye(3)[:, [2]] if d == 2 else np.eye(3)
    parts: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    for w, e, e1, e2 in zip(frames, *instant.attitudes, strict=True):
        omega = cross_matrix(w)
        r = expm(instant.after * omega)
        rates = [r, omega @ r, omega @ omega @ r]
        blocks = [np.zeros((size, d + (turns.shape[1] if size > d else 0))) for _ in range(3)]
        for block, x in zip(blocks, rates, strict=True):
            block[:d, :d] = (x @ axes)[:d]
        for column in range(turns.shape[1] if size > d else 0):
            x, x1, x2 = (left_product(y @ turns[:, column]) / 2 for y in rates)
            found = (x @ e, x1 @ e + x @ e1, x2 @ e + 2 * x1 @ e1 + x @ e2)
            for block, y in zip(blocks, found, strict=True):
                block[d:, d + column] = y[[0, 3]] if d == 2 else y
        for part, block in zip(parts, blocks, strict=True):
            part.append(block)
    s, s1, s2 = (scipy.linalg.block_diag(*part) for part in parts)
    return s, s1, s2


def _seen_gradient(instant: _SteadyInstant, s: Array) -> Array:
    """Return the gradient of the position equations for small changes ``x`` in frames, with rounding set to zero."""
    found: Array = instant.gradient @ s
    return np.where(np.abs(found) > ROUNDING * (np.abs(instant.gradient) @ np.abs(s)), found, 0.0)


def _moves(one: Batch, start: _SteadyInstant, frames: list[Array]) -> list[bool]:
    """Return for each body whether it can move."""
    s, *_ = _seen(one, start, frames)
    basis = scipy.linalg.null_space(_seen_gradient(start, s), rcond=1e-9)
    blocks = np.abs(basis).reshape(len(one.model.bodies), -1)
    return [bool(x.max(initial=0.0) > 1e-9) for x in blocks]


def _constant(
    one: Batch, instants: list[_SteadyInstant], frames: list[Array], carried: NDArray[np.bool_]
) -> SteadyFrames | None:
    """Return coefficients and small motions at each time; None if coefficients change."""
    basis: Array | None = None
    first: dict[str, Array] = {}
    sizes: dict[str, float] = {}
    maps: list[tuple[Array, Array, Array]] = []
    for instant in instants:
        maps.append(_seen(one, instant, frames))
        s, s1, s2 = maps[-1]
        gradient = _seen_gradient(instant, s)
        if basis is None:
            basis = scipy.linalg.null_space(gradient, rcond=1e-9)
        elif np.abs(gradient @ basis).max(initial=0.0) > CONSTANT * np.abs(gradient).max(initial=0.0):
            return None
        found, size = _coefficients(one, instant, s @ basis, s1 @ basis, s2 @ basis, carried)
        if not first:
            first, sizes = found, size
            continue
        if any(np.abs(x - first[name]).max(initial=0.0) > CONSTANT * sizes[name] for name, x in found.items()):
            return None
    assert basis is not None
    s, s1, s2 = (np.array([x[k] for x in maps]) for k in range(3))
    return SteadyFrames(tuple(x.after for x in instants), (s, s1, s2), basis, carried, first, sizes["k"])


def _coefficients(
    one: Batch, instant: _SteadyInstant, t: Array, t1: Array, t2: Array, carried: NDArray[np.bool_]
) -> tuple[dict[str, Array], dict[str, float]]:
    """Return coefficients for ``dq = t y``, and their sizes."""
    layout = one.model.layout
    x, x1, x2 = (y[layout.free] for y in (t, t1, t2))
    b, own = instant.blocks, ~carried
    carry = np.where(own[:, None], 0.0, -b["sv"])
    k_whole = b["vq"] + b["vs"] @ carry
    damping, inertia, stiffness = b["vv"] @ x, instant.mass @ x1, k_whole @ x
    found = {
        "m": x.T @ instant.mass @ x,
        "c": x.T @ (2 * inertia + damping),
        "k": x.T @ (instant.mass @ x2 + b["vv"] @ x1 + stiffness),
        "f": x.T @ b["vs"][:, own],
        "a": -(b["sq"][own] + b["ss"][np.ix_(own, carried)] @ carry[carried]) @ x - b["sv"][own] @ x1,
        "b": -b["sv"][own] @ x,
        "e": -b["ss"][np.ix_(own, own)],
    }
    parts = {
        "m": [found["m"]],
        "c": [x.T @ inertia, x.T @ damping],
        "k": [x.T @ instant.mass @ x2, x.T @ b["vv"] @ x1, x.T @ stiffness],
    }
    rows = np.isin(layout.active, layout.nonholonomic)
    n = x.shape[1]
    found["z"], found["p"] = np.eye(n), np.zeros((n, n))
    if rows.any():
        rate = b["mv"][rows] @ x
        place = b["mv"][rows] @ x1 + (b["mq"] + b["ms"] @ carry)[rows] @ x
        inverse = np.linalg.pinv(rate, rcond=1e-9)
        # use projectors, because a basis of the null space is not unique
        found["z"], found["p"] = np.eye(n) - inverse @ rate, -inverse @ place
    sizes: dict[str, float] = {}
    for name, value in found.items():
        sizes[name] = max(float(np.abs(y).max(initial=0.0)) for y in parts.get(name, [value]))
    mass, stiff = max(sizes["m"], 1e-300), sizes["k"]
    # compare rates with rates of the mechanism instead of their own size, which may nearly vanish
    speed = float(np.sqrt(stiff / mass))
    sizes["c"] = max(sizes["c"], mass * speed)
    for name, least in (("f", stiff), ("a", speed), ("b", 1.0), ("e", speed), ("z", 1.0), ("p", speed)):
        sizes[name] = max(sizes[name], least, 1e-300)
    return found, sizes


def _solved(found: dict[str, Array], size: float) -> Pairs | str:
    """Return sorted eigenvalues, one per pair, and ``y`` in their modes, or the reason for their absence."""
    m, c, k, f, a, b, e = (found[name] for name in "mckfabe")
    n, r = len(m), len(e)
    values, directions = np.linalg.eigh(found["z"])
    z, p = directions[:, values > 0.5], found["p"]
    u = z.shape[1]
    reduced = z.T @ m @ z
    try:
        np.linalg.cholesky((reduced + reduced.T) / 2)
    except np.linalg.LinAlgError:
        return "a mass is not positive"
    zeros = twice = 0
    if u == n:
        static, first = np.block([[k, f], [-a, -e]]), np.block([[c, np.zeros((n, r))], [-b, np.eye(r)]])
        zeros, twice = zeros_of(static, first, NOISE * size)
    # y' = P y + Z u, and the forces along Z
    right = -z.T @ np.hstack([m @ p @ p + c @ p + k, (m @ p + c) @ z, f])
    matrix = np.vstack(
        [
            np.hstack([p, z, np.zeros((n, r))]),
            np.linalg.solve(reduced, right),
            np.hstack([a + b @ p, b @ z, e]),
        ]
    )
    if u < n:
        sizes = np.abs(np.linalg.eigvals(matrix))
        zeros = int(np.sum(sizes <= 1e-5 * sizes.max(initial=0.0)))
    values, vectors = eigenpairs(matrix, zeros, twice)
    return values, vectors[:n]
