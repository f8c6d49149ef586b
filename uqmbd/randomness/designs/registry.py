"""Protocol of sampling designs, designs of the core, and selection of all designs by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Protocol, TypeAlias

import numpy as np

from uqmbd.arguments import typechecked
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
"""Seed: an argument of ``numpy.random.default_rng``."""


class SamplingDesign(Protocol):
    """Protocol of a class that draws points in the unit cube; the constructor takes no arguments.

    Class attributes declare additional properties; a design lacks the properties that it does not declare:

    ``independent = True``
        Points are independent of each other, and Monte Carlo computes standard errors from single points. Monte Carlo
        draws any other design in independent replicates.
    ``extendable = True``
        The points of ``range(n)`` are the first n of any longer range. A refinement can reuse its results, and points
        can be drawn in parts.
    ``base``, a whole number, 2 or more
        Points are balanced if their number is a power of ``base``; replicates have such numbers.

    Attributes
    ----------
    name : str
        Name by which methods select the design.

    Examples
    --------
    This design spreads points evenly by irrational steps. A plugin provides it by the hook ``uqmbd_designs``:

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
            Number of inputs, at least 1.
        numbers : range
            Indices of the points; ``range(n)`` for all n points of a design that is not extendable.
        seed : int or numpy.random.SeedSequence
            Seed of the random numbers. The same seed gives the same bits; another seed gives independent points.

        Returns
        -------
        array, shape (len(numbers), dimension)
            Points with coordinates from 0 to 1.
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
        """Draw a balanced set, whose size is a power of two, and return the requested points."""
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
    """Sampling design with checked declarations, for use by methods.

    Attributes
    ----------
    made : SamplingDesign
        Object with the points of the design.
    name : str
    independent, extendable : bool
        Declared properties.
    base : int
        Declared base; with 1, points of any number are balanced.

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
            If a declaration of the class is invalid.
        """
        base = getattr(kind, "base", 1)
        if not isinstance(base, int) or base < 1:
            raise StudyError(
                f"The sampling design {kind.name!r} declares base = {base!r}; expected a whole number, 1 or more."
            )
        independent, extendable = (getattr(kind, name, False) is True for name in ("independent", "extendable"))
        return cls(kind(), kind.name, independent, extendable, base)

    def points(self, dimension: int, count: int, seed: Seed) -> Array:
        """Draw points in the open unit cube, shape (count, dimension).

        Parameters
        ----------
        dimension : int
            Dimension of the cube.
        count : int
            Number of points.
        seed : int or sequence of int
            Seed of the random numbers.

        Returns
        -------
        array, shape (count, dimension)
            Coordinates above 0 and below 1.

        Raises
        ------
        uqmbd.StudyError
            If points have another shape or are outside of the unit cube.
        """
        if not dimension:
            return np.zeros((count, 0))
        found = np.asarray(self.made.points(dimension, range(count), seed), dtype=float)
        if problem := design_problem(found, (count, dimension)):
            raise StudyError(f"The sampling design {self.name!r} {problem}.")
        # the ends of the interval would map to infinity
        return np.asarray(np.clip(found, 2.0**-54, 1 - 2.0**-53))


def design_problem(points: Array, shape: tuple[int, int]) -> str:
    """Return a message about invalid points of a design; empty if they are valid."""
    if points.shape != shape:
        return f"returned points of shape {points.shape}; expected {shape}"
    if not ((points >= 0) & (points <= 1)).all():
        return "returned points outside the unit cube"
    return ""


@cache
def _offered() -> dict[str, type]:
    return core_offers(BuiltInDesigns(), "designs")


@typechecked(values=False)
def sampling_designs() -> tuple[str, ...]:
    """Return the names of all sampling designs, first the designs of the core.

    Examples
    --------
    >>> sampling_designs()[:4]
    ('random', 'latin-hypercube', 'sobol', 'halton')
    """
    return (*_offered(), *designs_of_plugins())


@typechecked(values=False)
def sampling_design(name: str, where: str = "sampling_design: name", others: Sequence[str] = ()) -> Design:
    """Return a sampling design by its name.

    Parameters
    ----------
    name : str
        Name of the design, one of `sampling_designs`.
    where : str
        Origin of the request, for messages.
    others : sequence of str
        Other accepted values, for messages.

    Raises
    ------
    uqmbd.StudyError
        If there is no such design; the message lists the installed designs.

    Examples
    --------
    >>> design = sampling_design("sobol")
    >>> design.points(2, 8, seed=1).shape, design.extendable, design.independent
    ((8, 2), True, False)
    """
    if not isinstance(name, str):
        raise StudyError(f"{where} is {name!r}; expected the name of a sampling design.")
    # a design of the core does not need the plugins to be loaded
    found = _offered().get(name) or designs_of_plugins().get(name)
    if found is not None:
        return Design.of(found)
    known = [*others, *sampling_designs()]
    expected = f"one of {', '.join(map(repr, known))}"
    near = did_you_mean(name, known)
    text = f"{near} Expected {expected}." if near else f"; expected {expected}."
    raise StudyError(f"{where} is {name!r}{text}")
