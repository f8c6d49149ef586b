"""Sampling designs: uniform numbers in the unit cube, in independent randomised replicates."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

import uqmbd
from uqmbd.typing import Array

__all__ = ["DESIGNS", "replicate_sizes", "uniform_samples"]


DESIGNS = ("random", "latin-hypercube", "sobol")


def replicate_sizes(design: str, samples: int, replicates: int) -> list[int]:
    """Share samples among replicates.

    Parameters
    ----------
    design : str
        One of `DESIGNS`; ``random`` needs no replicates and makes one.
    samples, replicates : int
        How many.

    Returns
    -------
    list of int
        Sizes of the replicates.

    Raises
    ------
    uqmbd.StudyError
        If the replicates would be too small, or no powers of two for ``sobol``.

    Examples
    --------
    >>> replicate_sizes("latin-hypercube", 20, 8)
    [3, 3, 3, 3, 2, 2, 2, 2]
    """
    if design == "random":
        return [samples]
    if samples < 2 * replicates:
        raise uqmbd.StudyError(
            f"MonteCarlo: {samples} samples are too few for {replicates} replicates of a {design} design; "
            f"take {2 * replicates} samples at least, or fewer replicates."
        )
    if design == "sobol":
        size = samples / replicates
        if size != 2 ** int(np.log2(size)):
            below = replicates * 2 ** int(np.log2(size))
            raise uqmbd.StudyError(
                f"MonteCarlo: a sobol design of {replicates} replicates needs {replicates} times a power of two "
                f"samples; {samples} were given. Take {below} or {2 * below}."
            )
    return [len(part) for part in np.array_split(np.arange(samples), replicates)]


def uniform_samples(design: str, sizes: list[int], dimension: int, seed: int) -> Array:
    """Uniform numbers, open interval, shape (sum of sizes, dimension): replicate after replicate.

    Parameters
    ----------
    design : str
        ``random``: independent points; ``latin-hypercube``: one point in each slice of each axis [1]_; ``sobol``:
        Owen-scrambled Sobol' points [2]_.
    sizes : list of int
        Sizes of the replicates, which are independent of one another.
    dimension : int
        Number of inputs.
    seed : int
        The same seed gives the same bits.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239-245.
    .. [2] A. B. Owen, SIAM Journal on Numerical Analysis 34 (1997) 1884-1910.

    Examples
    --------
    >>> u = uniform_samples("latin-hypercube", [4], 1, seed=3)
    >>> sorted((4 * u[:, 0]).astype(int).tolist())
    [0, 1, 2, 3]
    """
    streams = np.random.SeedSequence(seed).spawn(len(sizes))
    parts = []
    for size, stream in zip(sizes, streams, strict=True):
        generator = np.random.default_rng(stream)
        if design == "random":
            parts.append(generator.random((size, dimension)))
        elif design == "latin-hypercube":
            parts.append(qmc.LatinHypercube(dimension, rng=generator).random(size))
        else:
            parts.append(qmc.Sobol(dimension, scramble=True, rng=generator).random_base2(int(np.log2(size))))
    # the ends of the interval would map to infinity
    return np.clip(np.concatenate(parts), 2.0**-54, 1 - 2.0**-53)
