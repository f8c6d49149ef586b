"""Does a sampling design mean what it says: uniform points that seed and numbers determine."""

from __future__ import annotations

import numpy as np

from uqmbd.plugins import KINDS, registered_name
from uqmbd.randomness import Design, SamplingDesign, Seed, design_problem
from uqmbd.typing import Array

__all__ = ["check_design"]

SEEDS = 20
LEAST = 64
"""Points of a seed, at least."""

ALIKE = 0.5
"""Correlation of two coordinates, over all seeds, that no sound design has."""

TAIL = 1e-6
"""Probability at which a sound design fails by chance."""


def check_design(design: type[SamplingDesign], *, dimensions: tuple[int, ...] = (1, 2, 5)) -> None:
    """Check a sampling design, in cubes of several dimensions.

    - It has a name, and declares whole numbers and truths.
    - The same seed gives the same bits, other seeds other points, and so do seeds of NumPy's sequences of seeds.
    - Each point is uniform in each of its coordinates, over the seeds (a test of Kolmogorov and Smirnov). Its
      coordinates are neither the same for all points of a seed nor alike.
    - An extendable design continues where it ended, and gives any part of its points alone.

    Parameters
    ----------
    design : type
        As `uqmbd.extend.SamplingDesign` says.
    dimensions : tuple of int
        Of the cubes.

    Raises
    ------
    AssertionError
        If something is wrong; the message says what.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.testing import check_design
    >>> class Uniform:
    ...     \"\"\"Independent points.\"\"\"
    ...     name = "uniform"
    ...     independent = True
    ...     def points(self, dimension, numbers, seed):
    ...         return np.random.default_rng(seed).random((len(numbers), dimension))
    >>> check_design(Uniform)
    """
    from scipy.stats import kstest

    _, problem = registered_name(design, KINDS["designs"]._replace(reserved=()))
    assert not problem, f"{design.__name__} is a class {problem}."
    assert design.__doc__, f"{design.__name__} has no docstring; say what it is."
    used = Design.of(design)
    count = used.base
    while count < LEAST:
        count = count * used.base if used.base > 1 else LEAST
    for dimension in dimensions:
        title = f"{design.__name__} in {dimension} dimensions"
        parts = [_drawn(used, dimension, seed, range(count)) for seed in np.random.SeedSequence(3).spawn(SEEDS)]
        one, again, other = (_drawn(used, dimension, seed, range(count)) for seed in (5, 5, 6))
        assert np.array_equal(one, again), f"{title}: the same seed gives other points."
        assert not np.array_equal(one, other), f"{title}: another seed gives the same points."
        assert not np.array_equal(parts[0], parts[1]), f"{title}: another sequence of seeds gives the same points."
        every = np.concatenate(parts).T
        for k, values in enumerate(every):
            still = all(np.ptp(part[:, k]) == 0 for part in parts)
            assert not still, f"{title}: coordinate {k} is the same for all points of a seed."
            found = kstest(values, "uniform").pvalue
            assert found > TAIL, f"{title}: coordinate {k} is not uniform over the seeds (p = {found:.2g})."
        for j, k in np.argwhere(np.triu(np.abs(np.atleast_2d(np.corrcoef(every))), 1) > ALIKE):
            raise AssertionError(
                f"{title}: coordinates {j} and {k} are alike; each is to be uniform whatever the others are."
            )
        later = range(count, 2 * count)
        if used.extendable:
            assert np.array_equal(
                np.concatenate([one, _drawn(used, dimension, 5, later)]), _drawn(used, dimension, 5, range(2 * count))
            ), f"{title}: it declares extendable = True, but the first points of more are others, or {later} alone are."


def _drawn(design: Design, dimension: int, seed: Seed, numbers: range) -> Array:
    found = np.asarray(design.made.points(dimension, numbers, seed))
    problem = design_problem(found, (len(numbers), dimension))
    assert not problem, f"{type(design.made).__name__} in {dimension} dimensions: it {problem}."
    return found
