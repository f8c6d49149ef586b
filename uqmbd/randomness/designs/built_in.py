"""The sampling designs of the core."""

from __future__ import annotations

import math

import numpy as np

from uqmbd.plugins import hookimpl
from uqmbd.randomness.designs.protocol import Seed
from uqmbd.typing import Array

__all__ = ["BuiltIn"]


class Random:
    """Independent points."""

    name = "random"
    independent = extendable = True

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw points."""
        return np.random.default_rng(seed).random((numbers.stop, dimension))[numbers.start :]


class LatinHypercube:
    """One point in each slice of each axis [1]_.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239-245.
    """

    name = "latin-hypercube"

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw all points."""
        from scipy.stats import qmc

        return np.asarray(qmc.LatinHypercube(dimension, rng=np.random.default_rng(seed)).random(len(numbers)))


class Sobol:
    """Owen-scrambled Sobol' points [1]_.

    References
    ----------
    .. [1] A. B. Owen, SIAM Journal on Numerical Analysis 34 (1997) 1884-1910.
    """

    name = "sobol"
    extendable = True
    base = 2

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw points; a power of two of them, which keep the balance, and leave out the others."""
        from scipy.stats import qmc

        engine = qmc.Sobol(dimension, rng=np.random.default_rng(seed))
        found = engine.random_base2(math.ceil(math.log2(numbers.stop)))
        return np.asarray(found[numbers.start : numbers.stop])


class Halton:
    """Scrambled Halton points."""

    name = "halton"
    extendable = True

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw points."""
        from scipy.stats import qmc

        return np.asarray(qmc.Halton(dimension, rng=np.random.default_rng(seed)).random(numbers.stop)[numbers.start :])


class BuiltIn:
    """What the core offers, by the hook that plugins use."""

    @hookimpl
    def uqmbd_designs(self) -> list[type]:
        """Return the designs."""
        return [Random, LatinHypercube, Sobol, Halton]
