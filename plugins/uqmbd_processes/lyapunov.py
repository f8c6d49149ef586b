"""Spectral moments of responses to processes with a shaping filter, by Lyapunov's equation for all realisations."""

from __future__ import annotations

import warnings
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd_processes.rational import EPS, CharacteristicPolynomials, balancing_scales

__all__ = ["DIRECT", "EPS", "controllable", "covariances", "inverses", "is_stable", "separate"]

Array = NDArray[np.float64]

DIRECT = 10
"""Largest order of systems that are solved together; larger systems are solved one by one."""

REFINEMENTS, SMALL = 6, 1e-10
"""Largest number of refinements of a covariance, and relative correction after which no further one is needed."""

SLOW = 1e-7
"""Largest eigenvalue of a rigid-body motion, relative to the largest eigenvalue."""

WITHIN = 1e-9
"""Relative size of a direction of the state below which inputs do not excite the direction."""


@cache
def _symmetric(n: int) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Return the map from ``A`` to the matrix of Lyapunov's equation, and the rows and columns of its unknowns."""
    rows, columns = np.triu_indices(n)
    count = len(rows)
    place = np.zeros((n, n), dtype=np.int64)
    place[rows, columns] = place[columns, rows] = np.arange(count)
    found = np.zeros((count, count, n, n))
    for equation, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
        for k in range(n):
            found[equation, place[k, j], i, k] += 1.0
            found[equation, place[i, k], j, k] += 1.0
    return found.reshape(count * count, n * n).T.copy(), rows, columns


def covariances(a: Array, noise: Array) -> tuple[Array, Array]:
    """Solve ``A P + P A^T + N N^T = 0`` for K systems (K, n, n) and noise inputs (K, n); NaN if there is no solution.

    Return the covariances and bounds of their errors (K, n, n).  States are scaled to equal rates first.  Iterative
    refinement uses residuals in extended precision; the error is below the last correction and the rounding.
    """
    scale = balancing_scales(a)
    scaled, driven = a * scale[:, :, None] / scale[:, None, :], noise * scale
    systems = _systems(scaled)
    found = _solve(scaled, driven[:, :, None] * driven[:, None, :], systems)
    errors = np.full(found.shape, np.inf)
    wide, wide_noise = scaled.astype(np.longdouble), driven.astype(np.longdouble)
    waiting: Any = slice(None)  # all systems: avoid a copy
    every = np.arange(len(a))
    for _ in range(REFINEMENTS):
        part = wide[waiting] @ found[waiting].astype(np.longdouble)
        source = wide_noise[waiting, :, None] * wide_noise[waiting, None, :]
        residual = (part + np.swapaxes(part, 1, 2) + source).astype(float)
        step = _solve(scaled[waiting], residual, None if systems is None else systems[waiting])
        found[waiting] += step
        with np.errstate(invalid="ignore"):
            diagonal = np.sqrt(np.abs(np.einsum("kii->ki", found[waiting])))
            size = diagonal[:, :, None] * diagonal[:, None, :]
            errors[waiting] = np.abs(step) + 4 * EPS * np.abs(found[waiting])
            waiting = every[waiting][(np.abs(step) > SMALL * size).any(axis=(1, 2))]
        if not len(waiting):
            break
    back = scale[:, :, None] * scale[:, None, :]
    return np.asarray(found / back), np.asarray(errors / back)


def _systems(a: Array) -> Array | None:
    """Return the matrices of Lyapunov's equation (K, m, m) for its unknowns above the diagonal; None for large n."""
    count, n = a.shape[:2]
    if n > DIRECT:
        return None
    to_system, rows, _ = _symmetric(n)
    return np.asarray((a.reshape(count, -1) @ to_system).reshape(count, len(rows), len(rows)))


def _solve(a: Array, right: Array, systems: Array | None) -> Array:
    """Solve ``A P + P A^T + Q = 0`` for K systems (K, n, n) and symmetric matrices Q; NaN if there is no solution."""
    count, n = a.shape[:2]
    if systems is None:
        return _one_by_one(a, right)
    _, rows, columns = _symmetric(n)
    result = np.full((count, n, n), np.nan)
    try:
        found = np.linalg.solve(systems, -right[:, rows, columns, None])[:, :, 0]
    except np.linalg.LinAlgError:  # a singular system must not affect the others
        return _one_by_one(a, right)
    result[:, rows, columns] = result[:, columns, rows] = found
    return result


def _one_by_one(a: Array, right: Array) -> Array:
    from scipy.linalg import LinAlgError, solve_continuous_lyapunov

    result = np.full(a.shape, np.nan)
    for k in range(len(a)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the refinement states the error
                found = solve_continuous_lyapunov(a[k], -right[k])
        except (LinAlgError, ValueError):
            continue
        result[k] = (found + found.T) / 2
    return result


def is_stable(a: Array, polynomials: CharacteristicPolynomials | None = None) -> NDArray[np.bool_]:
    """Return whether all eigenvalues of systems (K, n, n) have negative real parts, by more than their rounding.

    Characteristic polynomials, if given, show that some systems are stable; the function computes eigenvalues only of
    the other systems.

    The rounding error of an eigenvalue is the rounding error of the scaled matrix, times the condition number of the
    eigenvalue. Multiple eigenvalues have no condition number; their relative rounding error is taken as `SLOW`.
    """
    count, n = a.shape[:2]
    if not n:
        return np.ones(count, dtype=bool)
    stable = np.zeros(count, dtype=bool) if polynomials is None else polynomials.stable.copy()
    others = np.flatnonzero(~stable)
    if len(others):
        stable[others] = _decays(a[others])
    return stable


def _decays(a: Array) -> NDArray[np.bool_]:
    """Return whether all eigenvalues (K, n, n) have negative real parts, by more than their rounding."""
    n = a.shape[1]
    scale = balancing_scales(a)
    scaled = a * scale[:, :, None] / scale[:, None, :]
    values, right = np.linalg.eig(scaled)
    with np.errstate(all="ignore"):
        sensitivity = np.linalg.norm(inverses(right), axis=2) * np.linalg.norm(right, axis=1)
        size = np.linalg.norm(scaled, axis=(1, 2))[:, None]
        rounding = size * np.fmin(n * EPS * sensitivity, SLOW)
        return np.asarray((values.real < -rounding).all(axis=1))


def inverses(matrices: NDArray[Any]) -> NDArray[Any]:
    """Return the inverses of matrices (K, n, n); infinite for singular systems."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:  # a singular matrix must not affect the others
        result = np.full_like(matrices, np.inf)
        for k, matrix in enumerate(matrices):
            with suppress(np.linalg.LinAlgError):
                result[k] = np.linalg.inv(matrix)
        return result


def controllable(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Return the part of one system (n, n) that inputs (n, m) excite: matrix, inputs, and basis (n, r)."""
    rate = float(np.sqrt(np.linalg.norm(a @ a))) or 1.0
    basis = np.zeros((len(a), 0))
    waiting = [column / np.linalg.norm(column) for column in b.T if np.linalg.norm(column) > 0]
    while waiting and basis.shape[1] < len(a):
        column = waiting.pop(0)
        for _ in range(2):
            column = column - basis @ (basis.T @ column)
        size = float(np.linalg.norm(column))
        if size > WITHIN:
            basis = np.column_stack([basis, column / size])
            after = a @ basis[:, -1] / rate
            if np.linalg.norm(after) > WITHIN:
                waiting.append(after / np.linalg.norm(after))
    return basis.T @ a @ basis, basis.T @ b, basis


def separate(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Separate one system (n, n) with inputs (n, m) and outputs (n,) into decaying motions and all others.

    Return the matrix, inputs and outputs of the decaying part, then of the other part: rigid-body motions,
    undamped modes, and motions that are very slow. Inputs and outputs that are only rounding errors are set to zero.
    """
    from scipy.linalg import schur, solve_sylvester

    scale = balancing_scales(a[None])[0]
    scaled, driven, seen = a * scale[:, None] / scale, b * scale[:, None], c / scale
    rate = float(np.abs(np.linalg.eigvals(scaled)).max(initial=0.0)) or 1.0
    form, basis, n = schur(scaled, sort=lambda x, y: x < -1e-13 * rate and np.hypot(x, y) > SLOW * rate)
    driven, seen = basis.T @ driven, seen @ basis
    coupling = np.zeros((n, len(a) - n))
    if coupling.size:
        coupling = solve_sylvester(form[:n, :n], -form[n:, n:], -form[:n, n:])
    first, second = driven[:n] - coupling @ driven[n:], driven[n:].copy()
    last = seen[n:] + seen[:n] @ coupling
    second[np.abs(second) <= WITHIN * np.abs(driven).max(initial=0.0)] = 0.0
    last[np.abs(last) <= WITHIN * np.abs(seen).max(initial=0.0)] = 0.0
    return form[:n, :n], first, seen[:n], form[n:, n:], second, last
