"""Test a sampling design: points are uniform, and seed and numbers determine them."""

from __future__ import annotations

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.plugins import KINDS, registered_name
from uqmbd.randomness import Design, SamplingDesign, Seed, design_problem
from uqmbd.typing import Array

__all__ = ["check_design"]

SEEDS = 20
LEAST = 64
"""Minimum number of points of a seed."""

ALIKE = 0.5
"""Correlation of two coordinates over all seeds, which a correct design never reaches."""

TAIL = 1e-6
"""Probability that a correct design fails by chance."""


@typechecked(values=False)
def check_design(design: type[SamplingDesign], *, dimensions: tuple[int, ...] = (1, 2, 5)) -> None:
    """Check a sampling design, in cubes of several dimensions.

    - The design has a name, and declares integers and booleans.
    - The same seed gives the same bits, and other seeds give other points; this includes seed sequences of NumPy.
    - Each point is uniform in each of its coordinates, over the seeds (Kolmogorov-Smirnov test). A coordinate differs
      between the points of a seed, and coordinates differ from each other.
    - An extendable design continues after its last point, and can give any part of its points separately.

    Parameters
    ----------
    design : type
        Class with the interface of `uqmbd.extend.SamplingDesign`.
    dimensions : tuple of int
        Dimensions of the cubes.

    Raises
    ------
    AssertionError
        If a check fails; the message states the check.

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
    assert design.__doc__, f"{design.__name__} has no docstring; describe the design in one sentence."
    used = Design.of(design)
    count = used.base
    while count < LEAST:
        count = count * used.base if used.base > 1 else LEAST
    for dimension in dimensions:
        title = f"{design.__name__} in {dimension} dimensions"
        parts = [_drawn(used, dimension, seed, range(count)) for seed in np.random.SeedSequence(3).spawn(SEEDS)]
        one, again, other = (_drawn(used, dimension, seed, range(count)) for seed in (5, 5, 6))
        assert np.array_equal(one, again), f"{title}: two calls with the same seed return different points."
        assert not np.array_equal(one, other), f"{title}: two different seeds return the same points."
        assert not np.array_equal(parts[0], parts[1]), (
            f"{title}: two different SeedSequence objects return the same points."
        )
        every = np.concatenate(parts).T
        for k, values in enumerate(every):
            still = all(np.ptp(part[:, k]) == 0 for part in parts)
            assert not still, (
                f"{title}: coordinate {k} has the same value in all points of a seed; expected a uniform distribution."
            )
            found = kstest(values, "uniform").pvalue
            assert found > TAIL, (
                f"{title}: coordinate {k} is not uniformly distributed over the seeds (p = {found:.2g} in a "
                "Kolmogorov-Smirnov test)."
            )
        for j, k in np.argwhere(np.triu(np.abs(np.atleast_2d(np.corrcoef(every))), 1) > ALIKE):
            raise AssertionError(
                f"{title}: coordinates {j} and {k} are correlated; expected independent uniform coordinates."
            )
        later = range(count, 2 * count)
        if used.extendable:
            assert np.array_equal(
                np.concatenate([one, _drawn(used, dimension, 5, later)]), _drawn(used, dimension, 5, range(2 * count))
            ), (
                f"{title}: the class declares extendable = True, but a larger design does not begin with the points "
                f"of a smaller one. Or the points of {later} change when they are requested separately."
            )


def _drawn(design: Design, dimension: int, seed: Seed, numbers: range) -> Array:
    found = np.asarray(design.made.points(dimension, numbers, seed))
    problem = design_problem(found, (len(numbers), dimension))
    assert not problem, f"{type(design.made).__name__} in {dimension} dimensions: it {problem}."
    return found
