"""Cost estimate of a method before any computation or allocation, and possible sizes of the method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from uqmbd.arguments import Bounds, Size, typechecked

__all__ = ["Estimate", "Sizing", "readable"]


@typechecked
@dataclass(frozen=True)
class Estimate:
    """Estimated cost of a method for a study.

    Parameters
    ----------
    realisations : int
        Number of realisations.
    memory : int
        Size of the arrays that the method stores in memory at the same time, bytes.
    detail : str
        Explanation of these numbers, such as "3542 nodes, 1771 terms".
    at_most : bool
        Whether the numbers are upper bounds, because the method chooses its size automatically.
    disk : int, optional
        Size of the results before compression, bytes; None: unknown.
    together : bool
        Whether the method solves for all realisations together. The time of a single realisation then does not predict
        the total.

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
        """Return both numbers as text."""
        some = "" if self.realisations == 1 else "s"
        return f"{'up to ' if self.at_most else ''}{self.realisations} realisation{some}, {readable(self.memory)}"


@typechecked
@dataclass(frozen=True, kw_only=True)
class Sizing:
    """Possible sizes of a method; a run chooses one by budget and accuracy.

    A size is an integer. A larger size requires more realisations and has a smaller error.

    Parameters
    ----------
    option : str
        Name of the option that sets the size, such as ``samples`` or ``order``.
    at : callable
        Function that maps a size to the method (a `uqmbd.extend.Propagator`) of this size. The function may raise a
        `uqmbd.StudyError` if no method has this size.
    least : int
        Smallest size at which the method states an error.
    falls : {"root", "steps", "itself"}
        Decrease of the error with the size. ``root``: the error is proportional to 1 / sqrt(size), as for samples.
        ``steps``: each step reduces the error by a factor, as for orders; the steps run one after another. ``itself``:
        the method ends when it reaches the accuracy, and the size is only an upper bound.
    allowed : callable, optional
        Function that maps a number to the largest allowed size up to this number. Default: every number is allowed.
    extends : bool
        Whether the realisations of a size are the first realisations of a larger size, in the same order.
    of : {"moments", "probabilities"}
        Kind of the accuracy; see `uqmbd.results.stated_accuracy`.
    also : tuple of str
        Names of further options that `at` sets.
    bound : int, optional
        Size of a run without a budget, for a method that ends automatically.
    tighten : callable, optional
        Function that maps a factor below 1 to the sizing with tolerances multiplied by this factor, for a method that
        ends automatically. If its stated error exceeds the accuracy, a run repeats the method with smaller tolerances.

    Examples
    --------
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> sizing = MonteCarlo(samples=512, sampling="sobol", seed=1).sizing(None, 0.01)
    >>> sizing.option, sizing.largest(1500), sizing.at(1024).samples
    ('samples', 1280, 1024)
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
    tighten: Callable[[float], Sizing] | None = None

    def largest(self, number: Annotated[float, Bounds(0)]) -> int:
        """Return the largest allowed size up to a number, or the smallest size if no allowed size is that small."""
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
