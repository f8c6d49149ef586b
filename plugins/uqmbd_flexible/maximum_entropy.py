"""Random modal matrices that are always positive definite (Soize, Probabilistic Engineering Mechanics 15, 2000)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy.linalg
import scipy.stats
import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_flexible.modal_model import ModalModel

__all__ = ["random_matrices"]


@typechecked
def random_matrices(
    model: ModalModel, name: str, stiffness: float | None = None, damping: float | None = None
) -> ModalModel:
    """Return a model with random stiffness or damping, which also represents errors of the model itself.

    A matrix ``A = L^T L`` becomes ``L^T G L``. The random matrix ``G`` is positive definite, and its mean is the
    identity matrix. It has the largest entropy for its dispersion ``delta = sqrt(E |G - 1|^2 / n)`` in the Frobenius
    norm, with ``n`` modes. The random variables are the entries of a triangular factor of ``G``. They are independent,
    and each matrix has ``n (n + 1) / 2`` of them.

    Parameters
    ----------
    model : ModalModel
        Model with constant matrices.
    name : str
        Name of the body, for the names of the random variables.
    stiffness, damping : float, optional
        Dispersions, greater than 0 and less than ``sqrt((n + 1) / (n + 5))``. Default: the matrix remains constant.

    Returns
    -------
    ModalModel
        Model with random matrices.

    Raises
    ------
    uqmbd.StudyError
        If a dispersion is outside its range, or the matrix is random already or singular.

    Examples
    --------
    >>> import uqmbd_flexible
    >>> beam = uqmbd_flexible.Beam(
    ...     length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800, modes=0
    ... )
    >>> uncertain = uqmbd_flexible.random_matrices(beam, "rod", stiffness=0.1)
    >>> beam.modes, len(uncertain.stiffness.free_symbols)
    (3, 6)
    """
    found = {}
    for what, dispersion in (("stiffness", stiffness), ("damping", damping)):
        if dispersion is None:
            continue
        matrix, n = getattr(model, what), model.modes
        where = f"random_matrices {name!r}: {what}"
        highest = math.sqrt((n + 1) / (n + 5))
        if not 0 < dispersion < highest:
            raise uqmbd.StudyError(
                f"{where}: the dispersion is {dispersion:g}; expected a number greater than 0 and less than "
                f"{highest:.4g} for {n} modes."
            )
        if matrix is None or matrix.free_symbols:
            state = "the model has no such matrix" if matrix is None else "the matrix contains random variables"
            raise uqmbd.StudyError(f"{where}: {state}; expected a matrix of constants.")
        try:
            factor = scipy.linalg.cholesky(np.array(matrix.tolist(), dtype=float))
        except np.linalg.LinAlgError:
            raise uqmbd.StudyError(f"{where}: the matrix is singular; expected a positive definite matrix.") from None
        upper = _factor(f"{name} {what}", n, dispersion) * sympy.Matrix(factor)
        found[what] = upper.T * upper
    return model.replaced(**found)


def _factor(name: str, n: int, dispersion: float) -> sympy.Matrix:
    """Return the upper triangular factor of the normalised random matrix."""
    sigma = dispersion / math.sqrt(n + 1)
    found = sympy.zeros(n, n)
    for i in range(n):
        for j in range(i, n):
            label = f"{name} {i + 1},{j + 1}"
            if i == j:
                shape = (n + 1) / (2 * dispersion**2) - i / 2
                variable: Any = uqmbd.RandomVariable(label, scipy.stats.gamma(shape), units="1")
                found[i, i] = sigma * sympy.sqrt(2 * variable)
            else:
                found[i, j] = sigma * uqmbd.RandomVariable(label, scipy.stats.norm(), units="1")
    return found
