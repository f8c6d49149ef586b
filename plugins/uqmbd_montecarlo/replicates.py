"""Uniform samples of a design, in independent randomised replicates."""

from __future__ import annotations

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index

__all__ = ["allowed_pairs", "allowed_samples", "paired_samples", "replicate_sizes", "uniform_samples"]


def replicate_sizes(design: str, samples: int, replicates: int) -> list[int]:
    """Return the sizes of the replicates of a sampling design; one of independent points makes one replicate.

    Raise StudyError for an unknown design, too few samples, or sizes for which the design is not balanced.
    """
    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    if found.independent:
        return [samples]
    if samples < 2 * replicates:
        raise uqmbd.StudyError(
            f"MonteCarlo: {samples} samples are too few for {replicates} replicates of the design {design!r}; "
            f"take {2 * replicates} samples at least, or fewer replicates."
        )
    if found.base > 1:
        power = found.base
        while power * found.base * replicates <= samples:
            power *= found.base
        if power * replicates != samples:
            below = replicates * power
            raise uqmbd.StudyError(
                f"MonteCarlo: the design {design!r} in {replicates} replicates needs {replicates} times a power of "
                f"{'two' if found.base == 2 else found.base} samples; {samples} were given. Take {below} or "
                f"{found.base * below}."
            )
    return [len(part) for part in np.array_split(np.arange(samples), replicates)]


def allowed_samples(design: str, samples: int, replicates: int) -> int:
    """Return the largest number of samples up to `samples` that the design allows in replicates.

    If all allowed numbers are larger, return the smallest.

    >>> allowed_samples("sobol", 1500, 16), allowed_samples("latin-hypercube", 1500, 16)
    (1024, 1500)
    """
    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    if found.independent:
        return max(samples, 2)
    if found.base < 2:
        return max(samples, 2 * replicates)
    power = found.base
    while power * found.base * replicates <= samples:
        power *= found.base
    return power * replicates


def allowed_pairs(design: str, samples: int, replicates: int) -> int:
    """Return the largest number of samples up to `samples` that are pairs of a design in equal replicates.

    >>> allowed_pairs("random", 1501, 16), allowed_pairs("sobol", 1501, 16), allowed_pairs("halton", 1501, 16)
    (1500, 1024, 1472)
    """
    if uqmbd.extend.sampling_design(design, "MonteCarlo: sampling").independent:
        return max(samples // 2 * 2, 4)
    return 2 * (allowed_samples(design, samples // 2, replicates) // replicates * replicates)


def paired_samples(design: str, samples: int, replicates: int, dimension: int, seed: int) -> tuple[Array, Index, Index]:
    """Draw samples in pairs: the two halves of the coordinates of points of a design in twice as many dimensions.

    Return uniform numbers (samples, dimension) in the open interval, replicate after replicate, in each the first
    halves of its pairs, then the second ones; and the indices (samples / 2,) of first and second halves. Those of
    independent points are the first and the second half of the samples. `samples` is a number that `allowed_pairs`
    allows; the same seed gives the same bits.
    """
    count = samples // 2
    if uqmbd.extend.sampling_design(design).independent:
        return uniform_samples(design, [samples], dimension, seed), np.arange(count), count + np.arange(count)
    sizes = replicate_sizes(design, count, replicates)
    points = uniform_samples(design, sizes, 2 * dimension, seed)
    places = np.arange(samples).reshape(replicates, 2, count // replicates)
    first, second = places[:, 0].ravel(), places[:, 1].ravel()
    uniform = np.empty((samples, dimension))
    uniform[first], uniform[second] = points[:, :dimension], points[:, dimension:]
    return uniform, first, second


def uniform_samples(design: str, sizes: list[int], dimension: int, seed: int) -> Array:
    """Draw uniform numbers in the open interval, (sum of sizes, dimension).

    They are independent replicates of the design in sequence. The same seed gives the same bits.
    """
    found = uqmbd.extend.sampling_design(design)
    streams = np.random.SeedSequence(seed).spawn(len(sizes))
    return np.concatenate([found.points(dimension, n, one) for n, one in zip(sizes, streams, strict=True)])
