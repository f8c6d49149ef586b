"""Order statistics of rows without a sort, in one tenth of the time of a vectorised sort in NumPy."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled.driver import address, load_driver
from uqmbd.typing import Array, Index

__all__ = ["order_statistics"]

MOST_RANKS = 62
"""Maximum number of ranks of one call, as in ranks.c."""


def order_statistics(rows: Array, ranks: Index) -> Array:
    """Return the numbers (R, N) of rows (R, K) at ascending ranks (N,) from 0; NaN for a row that contains NaN.

    The result agrees bit for bit with a sort. The rows are overwritten.
    """
    if rows.ndim != 2 or rows.dtype != float or not rows.flags.c_contiguous:
        raise ValueError(f"rows have shape {rows.shape} and type {rows.dtype}; expected contiguous rows of numbers")
    count = rows.shape[1]
    if ranks.ndim != 1 or len(ranks) and not (0 <= ranks[0] and ranks[-1] < count and (np.diff(ranks) >= 0).all()):
        raise ValueError(f"ranks are {ranks.tolist()}; expected ascending numbers below {count}")
    # if the driver is not loaded, for example in a process that only reads results, loading takes as long as sorting
    if len(ranks) > MOST_RANKS or not load_driver.cache_info().currsize:
        rows.sort(axis=1)
        found: Array = np.where(np.isnan(rows[:, -1:]), np.nan, rows[:, ranks])
        return found
    found = np.empty((len(rows), len(ranks)))
    own, cells, spare = np.ascontiguousarray(ranks, dtype=np.int64), np.empty(count, dtype=np.uint16), np.empty(count)
    load_driver().order_statistics(
        *(address(rows), len(rows), count, address(own), len(ranks)), *(address(x) for x in (found, cells, spare))
    )
    return found
