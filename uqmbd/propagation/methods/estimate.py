"""What a method would take, found out before anything is computed or allocated; and which sizes of it there are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from uqmbd.arguments import Bounds, Size, typechecked

__all__ = ["Estimate", "Sizing", "readable"]


@typechecked
@dataclass(frozen=True)
class Estimate:
    """What a method would take for a study.

    Parameters
    ----------
    realisations : int
        How many it computes.
    memory : int
        Bytes of the arrays that it holds at once.
    detail : str
        What they are for, as "3542 nodes, 1771 terms".
    at_most : bool
        Whether it is the most that a method may take that finds out by itself, rather than what it will.
    disk : int, optional
        Bytes of its results, before compression; None: it does not tell.
    together : bool
        Whether its realisations are solved together, so that what one takes alone does not tell their time.

    Examples
    --------
    >>> Estimate(500, 64_000_000, "500 samples").words
    '500 realisations, 64 MB'
    >>> Estimate(5000, 3_200_000_000, at_most=True).words
    'up to 5000 realisations, 3.2 GB'
    """

    realisations: Size
    memory: Size
    detail: str = ""
    at_most: bool = False
    disk: Size | None = None
    together: bool = False

    @property
    def words(self) -> str:
        """Both numbers, for people."""
        some = "" if self.realisations == 1 else "s"
        return f"{'up to ' if self.at_most else ''}{self.realisations} realisation{some}, {readable(self.memory)}"


@typechecked
@dataclass(frozen=True, kw_only=True)
class Sizing:
    """How a method is made larger or smaller, so that a run can choose its size by a budget and an accuracy.

    A size is one whole number, which the larger takes more realisations and has the smaller error.

    Parameters
    ----------
    option : str
        Name of the option that it is, as ``samples`` or ``order``.
    at : callable
        From a size to the method (a `uqmbd.extend.Propagator`) of that size; it may raise a `uqmbd.StudyError` where
        there is none of that size.
    least : int
        The smallest size that states an error.
    falls : {"root", "steps", "itself"}
        How the error falls with the size.  ``root``: as 1 / sqrt(size), as of samples.  ``steps``: by a factor with
        each step of the size, as of orders: one is tried after the other.  ``itself``: the method ends by itself at the
        accuracy, and the size only bounds it.
    allowed : callable, optional
        From any number to the largest size that is not larger, where not all numbers are sizes.
    extends : bool
        Whether the realisations of a size are the first ones of a larger size, in the same order.
    of : {"moments", "probabilities"}
        What its accuracy is of: see `uqmbd.results.stated_accuracy`.
    also : tuple of str
        Names of further options that `at` sets.
    bound : int, optional
        Of a method that ends by itself: its size where there is no budget.

    Examples
    --------
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> sizing = MonteCarlo(samples=512, sampling="sobol", seed=1).sizing(None, 0.01)
    >>> sizing.option, sizing.largest(1500), sizing.at(1024).samples
    ('samples', 1024, 1024)
    """

    option: str
    at: Callable[[int], Any]
    least: Size
    falls: Literal["root", "steps", "itself"] = "root"
    allowed: Callable[[int], int] | None = None
    extends: bool = False
    of: Literal["moments", "probabilities"] = "moments"
    also: tuple[str, ...] = ()
    bound: Size | None = None

    def largest(self, number: Annotated[float, Bounds(0)]) -> int:
        """Return the largest size up to a number; the least one where none is so small."""
        found = int(number) if self.allowed is None else self.allowed(int(number))
        return max(found, self.least)


def readable(size: int) -> str:
    """Return a number of bytes as text for messages.

    >>> readable(950), readable(12_300), readable(2_000_000_000)
    ('1 kB', '12 kB', '2 GB')
    """
    for power, unit in ((12, "TB"), (9, "GB"), (6, "MB")):
        if size >= 10**power:
            return f"{size / 10**power:.2g} {unit}" if size < 10 ** (power + 2) else f"{size / 10**power:.0f} {unit}"
    return f"{max(1, round(size / 1000))} kB"
