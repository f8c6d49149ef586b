"""What propagators of polynomial chaos share."""

from __future__ import annotations

from uqmbd.propagation.chaos.elements import ElementLimits, ElementRefinement, refine_elements
from uqmbd.propagation.chaos.verification import Verification

__all__ = [
    "Verification",
    "ElementLimits",
    "ElementRefinement",
    "refine_elements",
]
