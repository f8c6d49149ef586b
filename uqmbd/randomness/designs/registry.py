"""Sampling designs of the core, and all designs by name.

What a sampling design is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Protocol, TypeAlias

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.plugins import core_offers, hookimpl
from uqmbd.plugins import designs as designs_of_plugins
from uqmbd.typing import Array

__all__ = [
    "BuiltInDesigns",
    "Design",
    "SamplingDesign",
    "Seed",
    "design_problem",
    "sampling_design",
    "sampling_designs",
]

Seed: TypeAlias = int | np.random.SeedSequence
"""Arguments of ``numpy.random.default_rng``."""


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


class Random:
    """Independent points."""

    name = "random"
    independent = extendable = True

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw points."""
        return np.random.default_rng(seed).random((numbers.stop, dimension))[numbers.start :]


class LatinHypercube:
    """One point in each slice of each axis (McKay, Beckman and Conover, Technometrics 21 (1979) 239-245)."""

    name = "latin-hypercube"

    def points(self, dimension: int, numbers: range, seed: Seed) -> Array:
        """Draw all points."""
        from scipy.stats import qmc

        return np.asarray(qmc.LatinHypercube(dimension, rng=np.random.default_rng(seed)).random(len(numbers)))


class Sobol:
    """Owen-scrambled Sobol' points (Owen, SIAM Journal on Numerical Analysis 34 (1997) 1884-1910)."""

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


class BuiltInDesigns:
    """Sampling designs of the core, in the form of a plugin."""

    @hookimpl
    def uqmbd_designs(self) -> list[type]:
        """Return the designs."""
        return [Random, LatinHypercube, Sobol, Halton]


@dataclass(frozen=True)
class Design:
    """A sampling design as methods use it.

    Attributes
    ----------
    made : SamplingDesign
        The design itself.
    name : str
    independent, extendable : bool
        What it declares.
    base : int
        What it declares; 1: points of any number are balanced.

    Examples
    --------
    >>> import uqmbd
    >>> design = uqmbd.extend.sampling_design("sobol")
    >>> design.name, design.base, design.extendable
    ('sobol', 2, True)
    >>> points = design.points(dimension=1, count=8, seed=1)
    >>> sorted((points[:, 0] * 8).astype(int).tolist())  # one in each eighth
    [0, 1, 2, 3, 4, 5, 6, 7]
    """

    made: SamplingDesign
    name: str
    independent: bool
    extendable: bool
    base: int

    @classmethod
    def of(cls, kind: type[SamplingDesign]) -> Design:
        """Return a design after checking its declarations.

        Raises
        ------
        uqmbd.StudyError
            If the class declares something that cannot be used.
        """
        base = getattr(kind, "base", 1)
        if not isinstance(base, int) or base < 1:
            raise StudyError(f"The sampling design {kind.name!r} declares base = {base!r}; expected a whole number.")
        independent, extendable = (getattr(kind, name, False) is True for name in ("independent", "extendable"))
        return cls(kind(), kind.name, independent, extendable, base)

    def points(self, dimension: int, count: int, seed: Seed) -> Array:
        """Draw points in the open unit cube, shape (count, dimension).

        Parameters
        ----------
        dimension : int
            Of the cube.
        count : int
            How many.
        seed : int or sequence of int
            Of the random numbers.

        Returns
        -------
        array, shape (count, dimension)
            More than 0 and less than 1.

        Raises
        ------
        uqmbd.StudyError
            If the design gives something else.
        """
        if not dimension:
            return np.zeros((count, 0))
        found = np.asarray(self.made.points(dimension, range(count), seed), dtype=float)
        if problem := design_problem(found, (count, dimension)):
            raise StudyError(f"The sampling design {self.name!r} {problem}.")
        # the ends of the interval would map to infinity
        return np.asarray(np.clip(found, 2.0**-54, 1 - 2.0**-53))


def design_problem(points: Array, shape: tuple[int, int]) -> str:
    """Return a message on faulty points of a design, or nothing."""
    if points.shape != shape:
        return f"gave points of shape {points.shape}; expected {shape}"
    if not ((points >= 0) & (points <= 1)).all():
        return "gave points outside the unit cube"
    return ""


@cache
def _offered() -> dict[str, type]:
    return core_offers(BuiltInDesigns(), "designs")


def sampling_designs() -> tuple[str, ...]:
    """Return the names of all that there are, those of the core first.

    Examples
    --------
    >>> sampling_designs()[:4]
    ('random', 'latin-hypercube', 'sobol', 'halton')
    """
    return (*_offered(), *designs_of_plugins())


def sampling_design(name: str, where: str = "sampling_design: name", others: Sequence[str] = ()) -> Design:
    """Return the sampling design of a name.

    Parameters
    ----------
    name : str
        One of `sampling_designs`.
    where : str
        Who asks, and for what, in messages.
    others : sequence of str
        What else could have been given, for messages.

    Raises
    ------
    uqmbd.StudyError
        If there is none; the message lists those that are installed.

    Examples
    --------
    >>> design = sampling_design("sobol")
    >>> design.points(2, 8, seed=1).shape, design.extendable, design.independent
    ((8, 2), True, False)
    """
    if not isinstance(name, str):
        raise StudyError(f"{where} is {name!r}; expected the name of a sampling design.")
    # plugins are not loaded for what the core has
    found = _offered().get(name) or designs_of_plugins().get(name)
    if found is not None:
        return Design.of(found)
    known = [*others, *sampling_designs()]
    expected = f"one of {', '.join(map(repr, known))}"
    near = did_you_mean(name, known)
    told = f"{near} Expected {expected}." if near else f"; expected {expected}."
    raise StudyError(f"{where} is {name!r}{told}")
