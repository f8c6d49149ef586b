"""Compute eigenfrequencies and damping of a constrained mechanism, linearised about a pose at rest.

Small motions within the constraints are ``dq = N x``, with a basis ``N`` of the null space of ``D``. Multipliers and
quaternion norms therefore add no modes::

    M x'' + C x' + K x + F s = 0        s' = A x + B x' + E s

with ``M``, ``C`` and ``K`` projected by ``N``; ``K`` contains ``(D^T lambda)_q``, the stiffness of constraint forces.
All matrices are blocks of the exact Jacobian of the stabilised index-2 form.  Auxiliary states that only follow the
bodies (counted angles) are eliminated and add to ``K``; only states with separate dynamics remain as ``s``.

Time is frozen at the initial time, so drivers stand still.  If the pose is not an equilibrium, constant forces are
assumed to balance the remaining forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.statics.rest_equations import RestEquations, apply, tangents
from uqmbd.dynamics.statics.unilateral import not_linear
from uqmbd.typing import Array

__all__ = ["Modes", "Pairs", "Solved", "eigenpairs", "gathered", "linearise", "no_modes", "zeros_of"]


ZERO = 1e-11
"""Stiffness, relative to the largest stiffness, that counts as rounding."""


@dataclass(frozen=True)
class Modes:
    """Eigenvalues and mode shapes of K linearised realisations."""

    # (K, mode), 1/s, sorted by absolute value; of a conjugate pair, the eigenvalue with positive imaginary part; NaN
    # after the last mode of a realisation with fewer modes
    eigenvalues: NDArray[np.complex128]
    # per realisation (time, mode, coordinate), up to a factor per mode, without the exponential: at one time for a pose
    # at rest, at the examined times for a steady motion; NaN for rigid-body modes
    shapes: tuple[NDArray[np.complex128], ...]

    @property
    def frequency(self) -> Array:
        """Natural frequencies ``|eigenvalue| / 2 pi``, Hz; with proportional damping, the undamped frequencies."""
        return np.asarray(np.abs(self.eigenvalues) / (2 * np.pi))

    @property
    def damping_ratio(self) -> Array:
        """Damping ratios ``-Re(eigenvalue) / |eigenvalue|``.

        Without oscillation, the ratio is 1 for modes that decay and -1 for modes that grow; rigid-body modes have 0.
        """
        size = np.abs(self.eigenvalues)
        return np.asarray(0.0 - self.eigenvalues.real / np.where(size == 0, 1.0, size))


def linearise(ensemble: Batch, q: Array, s: Array) -> tuple[Modes, list[str]]:
    """Linearise K realisations about poses at rest (K, coordinate), which satisfy the constraints.

    Return the modes, and reasons why a realisation has none; empty texts for the others.

    Each degree of freedom has one mode, or two if it is overdamped.  Modes are NaN if a pose is not finite, a mass is
    not positive, or small motions are not linear.
    """
    rest, every = RestEquations(ensemble), np.arange(len(ensemble))
    layout = ensemble.model.layout
    nothing, reasons = no_modes(layout.coordinates), not_linear(ensemble, q, s)
    if not rest.n:
        return gathered([nothing] * len(q)), reasons
    free = rest.coordinates(q)
    bare = rest.derivatives(every, free, s)
    mass = rest.derivatives(every, free, s, c=1.0)["vv"] - bare["vv"]
    force = rest.forces(every, free, s).force
    multipliers = _multipliers(mass, bare["vl"], force)
    found = rest.derivatives(every, free, s, multipliers)
    basis = tangents(np.ascontiguousarray(bare["vl"].transpose(0, 2, 1)))
    each = [nothing] * len(q)
    for k in np.flatnonzero(np.isfinite(free).all(axis=1) & ~np.array([bool(x) for x in reasons])).tolist():
        values, within = _eigenvalues({name: block[k] for name, block in found.items()}, mass[k], basis[k])
        shapes = np.zeros((1, len(values), layout.coordinates), dtype=complex)
        shapes[0][:, layout.free] = within.T @ basis[k].T
        each[k] = values, shapes
    return gathered(each), reasons


Solved = tuple[NDArray[np.complex128], NDArray[np.complex128]]
"""Eigenvalues (mode,) and shapes (time, mode, coordinate) of one realisation."""


def no_modes(coordinates: int) -> Solved:
    """Return the result of a realisation without modes."""
    return np.zeros(0, dtype=complex), np.zeros((1, 0, coordinates), dtype=complex)


def gathered(each: Sequence[Solved]) -> Modes:
    """Join the modes of realisations."""
    result = np.full((len(each), max((len(values) for values, _ in each), default=0)), complex(np.nan, np.nan))
    for k, (values, _) in enumerate(each):
        result[k, : len(values)] = values
    return Modes(result, tuple(shapes for _, shapes in each))


def _multipliers(mass: Array, transposed: Array, force: Array) -> Array:
    """Return multipliers at rest: ``M a + D^T lambda = Q``, ``D a = 0``."""
    count, n, m = transposed.shape
    matrix = np.zeros((count, n + m, n + m))
    matrix[:, :n, :n], matrix[:, :n, n:] = mass, transposed
    matrix[:, n:, :n] = transposed.transpose(0, 2, 1)
    right = np.zeros((count, n + m))
    right[:, :n] = force
    return apply(np.linalg.pinv(matrix, rcond=1e-14, hermitian=True), right)[:, n:]


Pairs = tuple[NDArray[np.complex128], NDArray[np.complex128]]
"""Eigenvalues (mode,), and eigenvectors as columns."""


def _eigenvalues(blocks: dict[str, Array], mass: Array, basis: Array) -> Pairs:
    """Return sorted eigenvalues of one realisation, one per conjugate pair, and eigenvectors in the basis."""
    own = (blocks["sq"] != 0).any(axis=1) | (blocks["ss"] != 0).any(axis=1)
    # states without separate dynamics follow the coordinates: ds = T dq with T = dg/dv
    carry = np.where(own[:, None], 0.0, -blocks["sv"])
    whole = blocks["vq"] + blocks["vs"] @ carry
    largest = float(np.abs(whole).max(initial=0.0))
    m, c, k = (basis.T @ x @ basis for x in (mass, blocks["vv"], whole))
    f = basis.T @ blocks["vs"][:, own]
    a = -(blocks["sq"][own] + blocks["ss"][np.ix_(own, ~own)] @ carry[~own]) @ basis
    b, e = -blocks["sv"][own] @ basis, -blocks["ss"][np.ix_(own, own)]
    try:
        factor = np.linalg.cholesky((m + m.T) / 2)
    except np.linalg.LinAlgError:
        return np.zeros(0, dtype=complex), np.zeros((len(m), 0), dtype=complex)
    unit = scipy.linalg.solve_triangular(factor, np.eye(len(m)), lower=True).T  # motions of unit mass, as columns
    if not own.any() and not np.any(c) and np.abs(k - k.T).max(initial=0.0) <= ZERO * largest:
        squares, modes = np.linalg.eigh(unit.T @ ((k + k.T) / 2) @ unit)
        shape = unit @ modes
        squares[np.abs(squares) <= ZERO * largest * np.einsum("ij,ij->j", shape, shape)] = 0.0
        roots = np.sqrt(np.abs(squares))
        values = np.concatenate([1j * roots[squares >= 0], roots[squares < 0], -roots[squares < 0]])
        swinging, falling = shape[:, squares >= 0], shape[:, squares < 0]
        return sorted_pairs(values, np.hstack([swinging, falling, falling]))
    n, r = len(k), int(own.sum())
    static = np.block([[k, f], [-a, -e]])
    first = np.block([[c, np.zeros((n, r))], [-b, np.eye(r)]])
    zeros, twice = zeros_of(static, first, ZERO * largest)
    k, c, f, a, b = unit.T @ k @ unit, unit.T @ c @ unit, unit.T @ f, a @ unit, b @ unit
    top = np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, r))])
    matrix = np.vstack([top, np.hstack([-k, -c, -f]), np.hstack([a, b, e])])
    values, vectors = eigenpairs(matrix, zeros, twice)
    return values, unit @ vectors[:n]


def eigenpairs(matrix: Array, zeros: int, twice: int) -> Pairs:
    """Return sorted eigenvalues and eigenvectors of a first-order matrix (n, n), one per conjugate pair.

    The matrix has `zeros` eigenvalues at zero, with NaN vectors; `twice` of these eigenvalues are double.
    """
    values, vectors = np.linalg.eig(matrix)
    values, vectors = values.astype(complex), vectors.astype(complex)
    behind = np.argsort(np.abs(values))[zeros + twice :]
    values, vectors = values[behind], vectors[:, behind]
    real = np.abs(values.imag) <= 1e-9 * np.abs(values)
    kept = np.concatenate([np.zeros(zeros), values[real].real, values[~real & (values.imag > 0)]])
    rigid = np.full((len(matrix), zeros), np.nan)
    return sorted_pairs(kept, np.hstack([rigid, vectors[:, real], vectors[:, ~real & (values.imag > 0)]]))


def zeros_of(static: Array, first: Array, noise: float) -> tuple[int, int]:
    """Count modes at zero, and double eigenvalues among them (undamped free motion of bodies)."""
    left, values, right = np.linalg.svd(static)
    none = values <= max(noise, 1e-13 * float(values[:1].max(initial=0.0)))
    if not none.any():
        return 0, 0
    rates = left[:, none].T @ first @ right[none].T
    rank = int(np.sum(np.linalg.svd(rates, compute_uv=False) > 1e-10 * max(np.abs(first).max(), 1e-300)))
    return int(none.sum()), int(none.sum()) - rank


def sorted_pairs(values: NDArray[np.complex128], vectors: NDArray[np.complex128]) -> Pairs:
    """Sort eigenvalues and eigenvectors (columns) by the absolute value of the eigenvalues."""
    size = np.round(np.abs(values), 12)  # of eigenvalues of equal size, the decaying mode precedes the growing mode
    order = np.lexsort((values.real, size))
    return np.asarray(values[order], dtype=complex), np.asarray(vectors[:, order], dtype=complex)
