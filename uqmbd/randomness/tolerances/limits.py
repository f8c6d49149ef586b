"""Normal distributions of sizes, from limits and a process capability."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.arguments import Positive, fits, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import checked

if TYPE_CHECKING:
    import chaospy

__all__ = ["Toleranced", "made", "require_number", "stated_tolerance", "tolerance"]


@typechecked
@dataclass(frozen=True)
class Toleranced:
    """Tolerance of a size, which `uqmbd.tolerance` and `uqmbd.iso286` attach to its distribution.

    Parameters
    ----------
    nominal : float
        Nominal size.
    lower, upper : float
        Limits of size.
    cpk : float
        Process capability index.
    inspected : bool
        Whether parts beyond the limits are rejected.
    source : str
        Tolerance as in a drawing, such as ``"30 +0.02/0"``.
    units : str
        Units of all sizes; empty if they are not stated.

    Raises
    ------
    uqmbd.StudyError
        If the lower limit is not below the upper one.

    Examples
    --------
    >>> import uqmbd
    >>> stated = uqmbd.extend.stated_tolerance(uqmbd.tolerance(30, 0.02, 0.0))
    >>> str(stated), round(stated.mean, 6), round(stated.sigma, 6)
    ('30 +0.02/0, Cpk 1.33', 30.01, 0.002506)
    """

    nominal: float
    lower: float
    upper: float
    cpk: Positive
    inspected: bool
    source: str
    units: str = ""

    def __post_init__(self) -> None:
        """Check that the lower limit is below the upper limit."""
        if not self.lower < self.upper:
            raise StudyError(
                f"Toleranced: lower is {self.lower:g} and upper is {self.upper:g}; expected a lower limit below the "
                "upper one."
            )

    @property
    def mean(self) -> float:
        """Mean of the process: the middle of the limits."""
        return (self.lower + self.upper) / 2

    @property
    def sigma(self) -> float:
        """Standard deviation of the process before parts are rejected."""
        return (self.upper - self.lower) / (6 * self.cpk)

    def __str__(self) -> str:
        """Return the tolerance as text, such as ``30 +0.02/0, Cpk 1.33``."""
        return f"{self.source}, Cpk {self.cpk:g}{', inspected' if self.inspected else ''}"


@checked
def tolerance(
    nominal: float, plus: float, minus: float, cpk: float = 1.33, inspected: bool = False
) -> chaospy.Distribution:
    """Return the distribution of a size with limits as in a drawing, such as 30 +0.02/-0.01.

    The distribution is normal, as for a centred process of capability `cpk`. Its mean is in the middle of the limits,
    and its standard deviation is ``(plus + minus) / (6 cpk)``. Sizes exceed the limits with the probability of such a
    process: 66 parts in a million for a capability of 1.33, 0.27 % for 1.

    Parameters
    ----------
    nominal : float
        Nominal size, in any units.
    plus, minus : float
        Distance of the upper limit above the nominal size, and of the lower limit below it, in the same units.
    cpk : float
        Process capability index: distance from the mean to the nearer limit over three standard deviations.
    inspected : bool
        Whether parts beyond the limits are rejected; the normal distribution is then truncated at the limits.

    Returns
    -------
    chaospy.Distribution
        Distribution for `uqmbd.RandomVariable`. The table of inputs in a report also states the tolerance.

    Raises
    ------
    uqmbd.StudyError
        If an argument is not a number, if the lower limit is not below the upper one, or if `minus` is negative.

    See Also
    --------
    uqmbd.iso286 : limits from a class such as H7.

    Examples
    --------
    >>> import uqmbd
    >>> d = uqmbd.RandomVariable("d", uqmbd.tolerance(30, 0.02, 0), units="mm")
    >>> round(d.mean, 9), d.description
    (30.01, 'Normal(mu=30.01, sigma=0.00250627): 30 +0.02/0, Cpk 1.33')
    """
    where = f"tolerance({nominal!r}, {plus!r}, {minus!r})"
    nominal, plus, minus = (
        require_number(where, name, x) for name, x in (("nominal", nominal), ("plus", plus), ("minus", minus))
    )
    if minus < 0:
        below, above = nominal + minus, nominal - minus
        remedy = (
            f"if it is {above:.12g}, use the middle of the limits as the nominal size: "
            f"tolerance({(nominal + (plus - minus) / 2):.12g}, {(plus + minus) / 2:.12g}, {(plus + minus) / 2:.12g})"
            if plus > -minus
            else f"a lower limit of {above:.12g} requires an upper limit above it"
        )
        raise StudyError(
            f"{where}: minus is {minus:g}, but minus is the distance of the lower limit below the nominal size. If "
            "the lower limit is "
            f"{below:.12g}, write {-minus:g}; {remedy}."
        )
    if not plus + minus > 0:
        raise StudyError(
            f"{where}: the upper limit is {nominal + plus:.12g}, and the lower limit is {nominal - minus:.12g}; "
            "expected an upper limit above the lower limit."
        )
    source = f"{nominal:.12g} {_signed(plus)}/{_signed(-minus)}" if plus != minus else f"{nominal:.12g} ±{plus:.12g}"
    return made(where, nominal, plus, -minus, cpk, inspected, source)


def made(
    where: str, nominal: float, upper: float, lower: float, cpk: float, inspected: bool, source: str, units: str = ""
) -> chaospy.Distribution:
    """Return the distribution of a size from its signed deviations.

    Raise StudyError if `cpk` is not positive, or `inspected` is neither True nor False.
    """
    cpk = require_number(where, "cpk", cpk)
    if cpk <= 0:
        raise StudyError(f"{where}: cpk is {cpk:g}; expected a process capability index above 0, such as 1.33.")
    if not isinstance(inspected, (bool, np.bool_)):
        raise StudyError(f"{where}: inspected is {inspected!r}; expected True or False.")
    found = Toleranced(nominal, nominal + lower, nominal + upper, cpk, bool(inspected), source, units)
    return _distribution(found)


@typechecked
def stated_tolerance(distribution: Any) -> Toleranced | None:
    """Return the tolerance from which a distribution was constructed; None for other distributions.

    Parameters
    ----------
    distribution : distribution
        Distribution of chaospy.

    Examples
    --------
    >>> import chaospy
    >>> stated_tolerance(tolerance(30, 0.02, 0)).upper, stated_tolerance(chaospy.Normal(30, 0.01))
    (30.02, None)
    """
    found = getattr(distribution, "toleranced", None)
    return found if isinstance(found, Toleranced) else None


def require_number(where: str, name: str, value: Any) -> float:
    """Return a finite number as float; raise StudyError for anything else."""
    if not fits(value, float):
        raise StudyError(f"{where}: {name} is {shown(value)}; expected a finite number.")
    return float(value)


def _signed(deviation: float) -> str:
    return f"{deviation:+.12g}" if deviation else "0"


def _distribution(toleranced: Toleranced) -> chaospy.Distribution:
    return _classes()[toleranced.inspected](toleranced)


@cache
def _classes() -> tuple[type[chaospy.Distribution], type[chaospy.Distribution]]:
    """Return the classes of distributions with a tolerance, before and after inspection."""
    import chaospy

    class Process(chaospy.Normal):
        def __init__(self, toleranced: Toleranced) -> None:
            super().__init__(toleranced.mean, toleranced.sigma)
            self.toleranced = toleranced

        def __repr__(self) -> str:
            return f"Normal(mu={self.toleranced.mean:.12g}, sigma={self.toleranced.sigma:.6g}): {self.toleranced}"

        def __reduce__(self) -> tuple[Any, ...]:
            return _distribution, (self.toleranced,)

    class Inspected(chaospy.TruncNormal):
        def __init__(self, toleranced: Toleranced) -> None:
            super().__init__(toleranced.lower, toleranced.upper, toleranced.mean, toleranced.sigma)
            self.toleranced = toleranced

        def __repr__(self) -> str:
            t = self.toleranced
            between = f"between {t.lower:.12g} and {t.upper:.12g}"
            return f"Normal(mu={t.mean:.12g}, sigma={t.sigma:.6g}) {between}: {t}"

        def __reduce__(self) -> tuple[Any, ...]:
            return _distribution, (self.toleranced,)

    return Process, Inspected
