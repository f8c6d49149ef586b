"""The explicit method of order 8 of Dormand and Prince, with its interpolant of order 7, by SciPy's coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from uqmbd.typing import Array

__all__ = ["ORDER", "STAGES", "Tableau", "interpolation_powers", "tableau"]

STAGES = 12
ORDER = 8


@dataclass(frozen=True)
class Tableau:
    """Coefficients: stages, the step, estimates of its error of order 5 and 3, and the interpolant."""

    a: Array
    c: Array
    b: Array
    errors: Array
    more_a: Array
    more_c: Array
    dense: Array


@cache
def tableau() -> Tableau:
    """Make the coefficients, once."""
    from scipy.integrate import DOP853 as method

    stages, count = np.eye(STAGES + 4), STAGES + 1
    step = np.concatenate([method.B, np.zeros(4)])
    dense = np.array([step, stages[0] - step, 2 * step - stages[STAGES] - stages[0], *method.D])
    errors = np.array([method.E5[:count], method.E3[:count]])
    return Tableau(
        np.array(method.A[:STAGES, :STAGES]), method.C, method.B, errors, method.A_EXTRA, method.C_EXTRA, dense
    )


def interpolation_powers(x: Array) -> Array:
    """Polynomials of the interpolant at parts of a step (T,), shape (T, 7)."""
    powers = np.empty((len(x), 7))
    powers[:, ::2], powers[:, 1::2] = x[:, None], (1 - x)[:, None]
    return np.asarray(np.cumprod(powers, axis=1), dtype=float)
