"""What a sampling design is."""

from __future__ import annotations

from typing import ClassVar, Protocol, TypeAlias

import numpy as np

from uqmbd.typing import Array

__all__ = ["SamplingDesign", "Seed"]

Seed: TypeAlias = int | np.random.SeedSequence
"""What ``numpy.random.default_rng`` makes a generator of."""


class SamplingDesign(Protocol):
    """Class of a sampling design, which is made without arguments: points in the unit cube.

    What more it can it declares by class attributes; what is not declared it cannot:

    ``independent = True``
        Points are independent of each other, so that standard errors come from them one by one.  Any other design is
        drawn in independent replicates by Monte Carlo.
    ``extendable = True``
        The points of ``range(n)`` are the first n of any longer range: a method that refines keeps what it has
        computed, and points can be drawn part by part.
    ``base``, a whole number, 2 or more
        Points are balanced where their number is a power of it; replicates have such numbers.

    Attributes
    ----------
    name : str
        By which methods choose it.

    Examples
    --------
    Points that are evenly spread by irrational steps, which a plugin gives by the hook ``uqmbd_designs``:

    >>> import numpy as np
    >>> import uqmbd
    >>> class Kronecker:
    ...     name = "kronecker"
    ...     extendable = True
    ...     def points(self, dimension, numbers, seed):
    ...         steps = np.sqrt([2.0, 3.0, 5.0])[:dimension]
    ...         return (np.arange(numbers.start, numbers.stop)[:, None] * steps + 0.5) % 1
    >>> design: uqmbd.extend.SamplingDesign = Kronecker()
    >>> design.points(2, range(0, 3), 0).round(3).tolist()
    [[0.5, 0.5], [0.914, 0.232], [0.328, 0.964]]
    """

    name: ClassVar[str]

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw points, each of them uniform in the unit cube.

        Parameters
        ----------
        dimension : int
            Number of inputs, 1 or more.
        numbers : range
            Which points; ``range(n)``, where the design is not extendable: all n of them.
        seed : int or numpy.random.SeedSequence
            Of the random numbers: the same seed gives the same bits, another one independent points.

        Returns
        -------
        array, shape (len(numbers), dimension)
            0 to 1.
        """
        ...
