"""Spectral moments of the stationary response of an expression, summed over independent processes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uqmbd_processes.descriptions import check_family
from uqmbd_processes.lyapunov import DIRECT, EPS, controllable, covariances, is_stable, separate
from uqmbd_processes.paths import ShapingFilter
from uqmbd_processes.quadrature import TOLERANCE, WORDS, density_of_response, integrate_moments, select
from uqmbd_processes.rational import CharacteristicPolynomials, rational_variance

__all__ = ["density", "moments"]

if TYPE_CHECKING:
    from uqmbd.extend import LinearSystem

Array = NDArray[np.float64]
Found = tuple[dict[int, Array], list[str]]

EXACT = 1e-7
"""Largest relative bound of the error of a variance by polynomials; other variances need Lyapunov's equation."""

FEW = 6
"""Largest number of states for polynomials: their bounds are seldom small enough for more states."""

ROUNDING = 1e-10
"""Noise in a response, relative to its terms, that counts as zero."""

ZERO = 1e-12
"""An inexact variance counts as zero if it, plus its error, is at most this share of the sum of its absolute terms."""

UNSTABLE = 1e-6
"""Growth rate, relative to the rates of the mechanism, that counts as instability."""

UNSTABLE_TEXT = "the pose of the linearisation is unstable, so there is no stationary response"


def density(system: LinearSystem, frequency: float) -> tuple[Array, list[str]]:
    """Return the two-sided density per rad/s of the response (K,) at one angular frequency, and reasons for NaN."""
    total, reasons = np.zeros(len(system)), [""] * len(system)
    for members, part, faults, _ in _decaying(system):
        _note(reasons, members, faults)
        if all(faults):
            continue
        at = np.full((len(part), 1), frequency)
        for source, channels in _processes(part):
            total[members] += density_of_response(part, source, channels, at)[:, 0]
    total[[bool(reason) for reason in reasons]] = np.nan
    return total, reasons


def moments(system: LinearSystem, orders: Sequence[int], tolerance: float = TOLERANCE) -> Found:
    """Return the moments ``2 int w^k S dw`` over positive frequencies (K,) by order k, and reasons for NaN.

    `tolerance`: largest relative error of a quadrature.
    """
    result = {k: np.zeros(len(system)) for k in orders}
    reasons = [""] * len(system)
    for members, part, faults, polynomials in _decaying(system):
        _note(reasons, members, faults)
        if all(faults):
            continue
        found, lost = _moments(part, polynomials, orders, tolerance)
        _note(reasons, members, lost)
        for order in orders:
            result[order][members] = found[order]
    if any(reasons):
        for order in orders:
            result[order][[bool(reason) for reason in reasons]] = np.nan
    return result, reasons


def _note(reasons: list[str], members: NDArray[np.int64], more: list[str]) -> None:
    """Write the reasons of members into the list of all reasons; most calls have no reasons."""
    if any(more):
        for k, reason in zip(members.tolist(), more, strict=True):
            reasons[k] = reason


def _processes(system: LinearSystem) -> list[tuple[Any, list[int]]]:
    """Return each process and its channels."""
    found: dict[str, tuple[Any, list[int]]] = {}
    for k, channel in enumerate(system.channels):
        name = channel.source.field or channel.source.name
        found.setdefault(name, (channel.source, []))[1].append(k)
    for _, channels in found.values():
        check_family([system.channels[k].source for k in channels])
    return list(found.values())


Part = tuple[NDArray[np.int64], "LinearSystem", list[str], CharacteristicPolynomials | None]


def _decaying(system: LinearSystem) -> list[Part]:
    """Divide an ensemble into parts with decaying states.

    Return for each part its members, its system, and for each member the reason why it has no stationary response, or
    an empty text. The last element of a part contains characteristic polynomials of small systems whose motions all
    decay. In realisations with motions that do not decay, only the controllable and observable states of these motions
    remain.
    """
    polynomials = CharacteristicPolynomials.of(system.a) if system.a.shape[1] <= DIRECT else None
    stable = is_stable(system.a, polynomials)
    good = np.flatnonzero(stable)
    few = None if polynomials is None or system.a.shape[1] > FEW else polynomials.select(good)
    parts: list[Part] = [(good, select(system, good), [""] * len(good), few)] if len(good) else []
    for k in np.flatnonzero(~stable):
        one = select(system, np.array([k]))
        values = np.linalg.eigvals(one.a[0])
        rate = float(np.abs(values).max(initial=0.0)) or 1.0
        reason = UNSTABLE_TEXT if values.real.max(initial=-1.0) > UNSTABLE * rate else ""
        # only the part without decay is reduced, so that the reduction does not affect the others
        a1, b1, c1, a2, b2, c2 = separate(one.a[0], one.b[0], one.c[0])
        a2, b2, basis = controllable(a2, b2)
        back, c2, inner = controllable(a2.T, (c2 @ basis)[:, None])
        n, size = len(a1), len(a1) + len(back)
        a = np.zeros((1, size, size))
        a[0, :n, :n], a[0, n:, n:] = a1, back.T
        reduced = replace(one, a=a, b=np.vstack([b1, inner.T @ b2])[None], c=np.concatenate([c1, c2[:, 0]])[None])
        if not reason and np.linalg.eigvals(reduced.a[0]).real.max(initial=-1.0) > -1e-9 * rate:
            reason = (
                f"{one.name} has no stationary response: the random processes excite a motion that does not decay, "
                "such as a rigid-body motion or an undamped mode"
            )
        parts.append((np.array([k]), reduced, [reason], None))
    return parts


def _moments(
    system: LinearSystem, polynomials: CharacteristicPolynomials | None, orders: Sequence[int], tolerance: float
) -> Found:
    """Return the moments of systems with decaying states."""
    total = {k: np.zeros(len(system)) for k in orders}
    reasons = [""] * len(system)
    for source, channels in _processes(system):
        found, lost = _of_process(system, polynomials, source, channels, orders, tolerance)
        for order in orders:
            total[order] += found[order]
        if any(lost):
            reasons = [one or other for one, other in zip(reasons, lost, strict=True)]
    return total, reasons


def _of_process(
    system: LinearSystem,
    polynomials: CharacteristicPolynomials | None,
    source: Any,
    channels: list[int],
    orders: Sequence[int],
    tolerance: float,
) -> Found:
    speeds = np.array([system.channels[k].speed for k in channels])
    different = np.ptp(speeds, axis=0) > 1e-12 * np.abs(speeds).max(axis=0)
    if different.any():
        text = (
            f"{system.name} has no stationary response: the mechanism travels along the random process "
            f"{source.name!r} at different speeds"
        )
        return {k: np.full(len(system), np.nan) for k in orders}, [text if x else "" for x in different.tolist()]
    shape: ShapingFilter | None = source.shape
    rational = [k for k in orders if k % 2 == 0]
    if shape is None or source.band != (0.0, math.inf) or len(channels) > 1:
        return integrate_moments(system, source, channels, orders, tolerance)
    found, reasons = _of_filter(system, polynomials, source, shape, channels[0], max(rational, default=0))
    other = [k for k in orders if k % 2]
    if other:
        kept = np.array([k for k, reason in enumerate(reasons) if not reason], dtype=np.int64)
        found |= {k: np.full(len(system), np.nan) for k in other}
        if len(kept):
            more, lost = integrate_moments(select(system, kept), source, channels, other, tolerance)
            for k in other:
                found[k][kept] = more[k]
            for member, reason in zip(kept.tolist(), lost, strict=True):
                reasons[member] = reason
    return {k: found[k] for k in orders}, reasons


def _of_filter(
    system: LinearSystem,
    polynomials: CharacteristicPolynomials | None,
    source: Any,
    shape: ShapingFilter,
    channel: int,
    highest: int,
) -> Found:
    """Return the even moments up to an order: variances of the response and its rates.

    The variance is computed by polynomials if their error bound is small, otherwise by Lyapunov's equation.
    """
    if polynomials is None or highest or shape.d:
        return _by_lyapunov(system, source, shape, channel, highest)
    value, error = rational_variance(system, polynomials, shape, channel)
    members = np.flatnonzero(~((value > 0) & (error <= EXACT * value)) | system.e[:, 1:, channel].any(axis=1))
    if not len(members):
        return {0: value}, [""] * len(system)
    found, lost = _by_lyapunov(select(system, members), source, shape, channel, 0)
    reasons = [""] * len(system)
    for k, reason in zip(members.tolist(), lost, strict=True):
        reasons[k] = reason
    value[members] = found[0]
    return {0: value}, reasons


def _by_lyapunov(system: LinearSystem, source: Any, shape: ShapingFilter, channel: int, highest: int) -> Found:
    """Return the even moments up to an order: variances of the response and its rates."""
    speed = np.abs(system.channels[channel].speed)
    af, bf, cf = shape.matrices
    count, n, r = len(system), system.a.shape[1], len(bf)
    b, e = system.b[:, :, channel], system.e[:, :, channel]
    a = np.zeros((count, n + r, n + r))
    a[:, :n, :n], a[:, :n, n:] = system.a, b[:, :, None] * cf
    a[:, n:, n:] = speed[:, None, None] * af
    noise = np.zeros((count, n + r))
    noise[:, n:] = np.sqrt(speed)[:, None] * bf
    noise[:, :n] = b * shape.d / np.sqrt(speed)[:, None]
    # the process and its rates in the states of the filter, and the noise in them
    rows = [cf, cf @ af, cf @ af @ af]
    row = np.zeros((count, n + r))
    row[:, :n] = system.c
    for k in range(3):
        row[:, n:] += e[:, k, None] * speed[:, None] ** k * rows[k]
    jumps = np.abs(e[:, 1] * (cf @ bf)) + np.abs(e[:, 2] * (cf @ af @ bf)) + np.abs(e[:, 2] * (cf @ bf))
    jumps = jumps + shape.d * np.abs(e).sum(axis=1)
    white = jumps > 0
    found: dict[int, Array] = {}
    reasons = [""] * count
    covariance, spread = covariances(a, noise)
    size = np.abs(row)
    for order in range(0, highest + 1, 2):
        if order:
            bare = np.abs(np.einsum("kn,kn->k", row, noise)) > ROUNDING * np.einsum("kn,kn->k", size, np.abs(noise))
            white = white | bare
            row = (row[:, None, :] @ a)[:, 0]
            size = (size[:, None, :] @ np.abs(a))[:, 0]
        for k in np.flatnonzero(white).tolist():
            reasons[k] = reasons[k] or (
                f"{system.name} has no {WORDS[order]}: its response to the random process {source.name!r} contains "
                "white noise; give the process a band, use a smoother one, or remove the damping that reads its rate"
            )
        found[order] = np.maximum(np.einsum("kn,knm,km->k", row, covariance, row), 0.0)
        terms = np.einsum("kn,knm,km->k", size, np.abs(covariance), size)
        errors = np.einsum("kn,knm,km->k", size, spread, size) + 8 * (order + 2) * EPS * terms
        inexact = errors > TOLERANCE * found[order]
        zero = inexact & (found[order] + errors <= ZERO * terms)
        found[order][zero] = 0.0
        with np.errstate(all="ignore"):
            relative = errors / found[order]
        for k in np.flatnonzero(inexact & ~zero).tolist():
            reasons[k] = reasons[k] or (
                f"{system.name}: the {WORDS[order]} by Lyapunov's equation has the relative error "
                f"{relative[k]:.2g}, above {TOLERANCE:g}; its natural frequencies or decay rates differ too much"
            )
    for k in np.flatnonzero(~np.isfinite(found[0])).tolist():
        reasons[k] = reasons[k] or f"{system.name}: Lyapunov's equation has no finite solution"
    return found, reasons
