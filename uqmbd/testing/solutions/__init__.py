"""Mechanisms with closed-form motions or moments."""

from __future__ import annotations

from uqmbd.testing.solutions import closed_forms
from uqmbd.testing.solutions.closed_forms import ClosedForm
from uqmbd.testing.solutions.known import CASES, ReferenceSolution, certain, fragile

__all__ = [
    "CASES",
    "ClosedForm",
    "ReferenceSolution",
    "certain",
    "closed_forms",
    "fragile",
]
