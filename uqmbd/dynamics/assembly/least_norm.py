"""Least-squares solutions of smallest norm, for each realisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.linear import RANK_TOLERANCE
from uqmbd.typing import Array

__all__ = ["least_norm"]


def least_norm(a: Array, r: Array, *, truncate: bool) -> Array:
    """Least-squares solution of smallest norm of ``a x = r``, for each realisation."""
    if not truncate:
        gram = a @ a.transpose(0, 2, 1)
        try:
            y = np.linalg.solve(gram, r[:, :, None])
            x: Array = (a.transpose(0, 2, 1) @ y)[:, :, 0]
            if np.all(np.isfinite(x)):
                return x
        except np.linalg.LinAlgError:
            pass
    usable: NDArray[np.bool_] = np.asarray(np.isfinite(a).all(axis=(1, 2)))
    inverse = np.linalg.pinv(np.where(usable[:, None, None], a, 0.0), rcond=RANK_TOLERANCE)
    result: Array = (inverse @ r[:, :, None])[:, :, 0]
    result[~usable] = np.nan
    return result
