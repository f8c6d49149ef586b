"""Methods whose smallest size exceeds the budget: found before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from uqmbd.errors import StudyError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.propagation.budget.sized import Sized

__all__ = ["BudgetTooSmallError", "out_of_reach"]


class BudgetTooSmallError(StudyError):
    """A method has no size that the budget holds: the input is to be changed, and going on does not help."""


def out_of_reach(methods: Sequence[Sized], left: float) -> dict[str, BudgetTooSmallError]:
    """Return errors by label of methods whose smallest size exceeds what less costly ones leave of the budget."""
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
        text = f"{label}: the budget of {left:.0f} realisations is too small: its smallest size, {named[label]}, takes "
        text += f"{cost}" + (f", and the methods that take less {held}" if held else "")
        text += f". Give {sum(least.values())} realisations or more"
        text += " (for all methods), or leave methods out (--only LABEL; in Python only=)" if len(least) > 1 else ""
        found[label] = BudgetTooSmallError(f"{text}, or a time, as 30s.")
    return found
