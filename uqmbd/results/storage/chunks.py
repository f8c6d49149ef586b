"""Choose chunk shapes of variables in files, so that the values of one output over time are contiguous."""

from __future__ import annotations

import xarray as xr

__all__ = ["chunks_of"]

SMALL = 1 << 20
"""Maximum number of bytes of a variable that is stored as one chunk."""

LARGE = 1 << 22
"""Approximate number of bytes of a chunk."""


def chunks_of(variable: xr.Variable) -> tuple[int, ...]:
    """Return the chunk shape of a variable: one chunk if it is small, else chunks of one output at all times.

    The other dimensions fill a chunk up to its approximate size, the last dimension first.

    >>> import numpy as np
    >>> chunks_of(xr.Variable(("sample", "output", "time"), np.zeros((500, 4, 401))))
    (500, 1, 401)
    >>> chunks_of(xr.Variable(("sample", "output", "time"), np.zeros((5, 4, 401))))
    (5, 4, 401)
    """
    if variable.nbytes <= SMALL:
        return tuple(max(size, 1) for size in variable.shape)
    left = max(LARGE // variable.dtype.itemsize, 1)
    found = {}
    for dim in sorted(variable.dims, key=lambda dim: (dim != "time", -variable.dims.index(dim))):
        size = 1 if dim == "output" else variable.sizes[dim]
        found[dim] = size if dim == "time" else max(1, min(size, left))
        left = max(left // found[dim], 1)
    return tuple(found[dim] for dim in variable.dims)
