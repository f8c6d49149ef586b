"""Runs with sizes that follow from a budget and an accuracy."""

from __future__ import annotations

from uqmbd.propagation.budget.amounts import Amount, accuracy_of, allowed_of, budget_of
from uqmbd.propagation.budget.reach import BudgetTooSmallError
from uqmbd.propagation.budget.sharing import BudgetedRun, BudgetTerms
from uqmbd.propagation.budget.timing import Timing, timing_of

__all__ = [
    "Amount",
    "BudgetTooSmallError",
    "BudgetTerms",
    "Timing",
    "BudgetedRun",
    "accuracy_of",
    "allowed_of",
    "budget_of",
    "timing_of",
]
