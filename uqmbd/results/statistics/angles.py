"""Circular statistics of the outputs that are angles, beside the plain ones of the unwrapped angle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uqmbd.results.statistics.circular import circular_mean, circular_std
from uqmbd.threads import one_thread
from uqmbd.typing import Array

__all__ = ["circular_of_blocks", "circular_of_samples"]


BLOCK_NUMBERS = 1_000_000
"""Angles (8 bytes each) that are averaged at once."""


def circular_of_samples(response: Array, turns: Array) -> dict[str, Array]:
    """Average the directions of samples.

    Parameters
    ----------
    response : array, shape (S, O, T) or (S, O)
        Finite, in the units of the outputs.
    turns : array, shape (O,)
        Length of a turn in these units; 0: the output is no angle.

    Returns
    -------
    dict of str to numpy.ndarray
        ``circular_mean`` and ``circular_std``, shape (O, T) or (O,), in the units of the outputs, NaN for those that
        are no angles; empty where none is. Made for ``statistics_dataset(labels, **it)``.

    Examples
    --------
    >>> import numpy as np
    >>> found = circular_of_samples(np.array([[179.0, 1.0], [183.0, 2.0]]), np.array([360.0, 0.0]))
    >>> found["circular_mean"].round(6).tolist(), found["circular_std"].round(3).tolist()
    ([-179.0, nan], [2.0, nan])
    """
    flat = response.reshape(*response.shape[:2], -1)
    return circular_of_blocks(response.shape[1:], len(response), turns, lambda output, part: flat[:, output, part])


def circular_of_blocks(
    shape: tuple[int, ...], count: int, turns: Array, samples: Callable[[int, slice], Array]
) -> dict[str, Array]:
    """Average the directions of samples that are made block by block.

    Parameters
    ----------
    shape : tuple of int
        (O, T) or (O,).
    count : int
        Samples, S.
    turns : array, shape (O,)
        As for :func:`circular_of_samples`.
    samples : callable
        From an output and a slice of its times to samples, shape (S, t).

    Returns
    -------
    dict of str to numpy.ndarray
        As of :func:`circular_of_samples`.
    """
    if not np.any(turns):
        return {}
    mean, std = np.full((2, shape[0], int(np.prod(shape[1:]))), np.nan)
    size = max(1, BLOCK_NUMBERS // max(count, 1))
    with one_thread():
        for output in np.flatnonzero(turns):
            radians = 2.0 * np.pi / turns[output]
            for start in range(0, mean.shape[1], size):
                part = slice(start, start + size)
                angles = samples(int(output), part) * radians
                mean[output, part] = circular_mean(angles) / radians
                std[output, part] = circular_std(angles) / radians
    return {"circular_mean": mean.reshape(shape), "circular_std": std.reshape(shape)}
