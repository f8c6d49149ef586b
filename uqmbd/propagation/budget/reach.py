"""Find methods whose smallest size exceeds the budget, before any computation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from uqmbd.errors import StudyError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.propagation.budget.sized import Sized

__all__ = ["BudgetTooSmallError", "out_of_reach"]


class BudgetTooSmallError(StudyError):
    """The smallest size of a method exceeds the budget, so that a resumed run needs other arguments."""


def out_of_reach(methods: Sequence[Sized], left: float) -> dict[str, BudgetTooSmallError]:
    """Return errors, by label, for methods whose smallest size exceeds the budget that cheaper methods leave."""
    if math.isinf(left):
        return {}
    least: dict[str, int] = {}
    for one in methods:
        with Isolated(*ERRORS_AND_EXITS):  # the run of this size reports the error
            least[one.label] = one.cost(one.sizing.least)
    named = {one.label: f"{one.sizing.option}={one.sizing.least}" for one in methods}
    held, found = 0, {}
    for label, cost in sorted(least.items(), key=lambda item: item[1]):
        if held + cost <= left:
            held += cost
            continue
        text = (
            f"{label}: the budget of {left:.0f} realisations is too small: the smallest size of this method, "
            f"{named[label]}, needs "
        )
        text += f"{cost}" + (f", and the less expensive methods need {held}" if held else "")
        text += f". Use a budget of {sum(least.values())} realisations or more"
        text += " (for all methods), or run fewer methods (--only LABEL; in Python only=)" if len(least) > 1 else ""
        found[label] = BudgetTooSmallError(f"{text}, or a time such as 30s.")
    return found
