"""Read a budget and an accuracy from their text forms: ``10min``, ``5000``, ``1%``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.wording import format_duration

__all__ = ["Amount", "accuracy_of", "allowed_of", "budget_of"]

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}

FINEST, COARSEST = 1e-9, 1.0

MOST = 10**18
"""Maximum number of realisations of a budget."""

MOST_ALLOWED = 0.5
"""Upper limit of an allowed probability of violation: a larger value is probably the probability of success."""


@dataclass(frozen=True)
class Amount:
    """Budget of a run: a number of realisations or a time, s; one of the two is finite."""

    realisations: float = math.inf
    seconds: float = math.inf

    @property
    def words(self) -> str:
        """Return the budget as text for messages."""
        if math.isfinite(self.seconds):
            return format_duration(self.seconds)
        return f"{self.realisations:.0f} realisations"


def budget_of(given: object, name: str = "budget") -> Amount | None:
    """Read a budget: a number of realisations, or a duration such as ``"30s"``, ``"10min"``, ``"2h"``.

    Raise StudyError, with the name of the option, for any other value.

    >>> budget_of("1.5h"), budget_of("1e4")
    (Amount(realisations=inf, seconds=5400.0), Amount(realisations=10000, seconds=inf))
    """
    if given is None:
        return None
    if not isinstance(given, bool) and isinstance(given, Integral) and 0 < int(given) <= MOST:
        return Amount(realisations=int(given))
    if isinstance(given, str) and (found := re.fullmatch(r"\s*([0-9.]+(?:e[0-9]+)?)\s*([a-z]*)\s*", given)):
        try:
            number = float(found[1])
        except ValueError:
            number = math.nan
        if found[2] in SECONDS and 0 < number < math.inf:
            return Amount(seconds=number * SECONDS[found[2]])
        if not found[2] and 0 < number < math.inf and number == int(number):
            return Amount(realisations=int(number))
    raise StudyError(
        f"{name} is {given!r}; expected a number of realisations such as 5000, or a time in s, min, h "
        "or d such as 10min."
    )


def accuracy_of(given: object, name: str = "accuracy") -> float | None:
    """Read an accuracy: a number between 0 and 1, such as 0.01 or ``"1%"``; raise StudyError for any other value.

    >>> accuracy_of("1%"), accuracy_of("0.5 %"), accuracy_of(0.02)
    (0.01, 0.005, 0.02)
    """
    if given is None:
        return None
    value = _share(given)
    if not FINEST <= value < COARSEST:
        raise StudyError(
            f"{name} is {given!r}; expected a share of the standard deviation of each output between 0 and 1, such "
            "as 0.01 or '1%'."
        )
    return value


def allowed_of(given: object, name: str = "allowed") -> float | None:
    """Read an allowed probability of violation, such as 0.01 or ``"1%"``.

    Raise StudyError if the value is not a probability. Raise StudyError also for one half and more: a value such as
    ``"99%"`` is probably the probability that the requirement is met.

    >>> allowed_of("1%"), allowed_of(0.02), allowed_of("0")
    (0.01, 0.02, 0.0)
    """
    if given is None:
        return None
    value = _share(given)
    if 0 <= value < MOST_ALLOWED:
        return value
    turned = value if value <= 1 else value / 100
    hint = (
        f" If the requirement must be met with the probability {turned:.6g}, write {1 - turned:.6g}."
        if MOST_ALLOWED <= turned < 1
        else ""
    )
    raise StudyError(
        f"{name} is {given!r}; expected the allowed probability of violation, less than {MOST_ALLOWED:g}, such as "
        f"0.01 or '1%'.{hint}"
    )


def _share(given: object) -> float:
    """Return a number or a percentage as a share; NaN if it is neither."""
    if not isinstance(given, bool) and isinstance(given, Real):
        number: Any = given  # float() rejects large integers
        return float(given) if abs(number) <= MOST else math.nan
    if not isinstance(given, str):
        return math.nan
    text = given.strip()
    try:
        return float(text.removesuffix("%")) / 100 if text.endswith("%") else float(text)
    except ValueError:
        return math.nan
