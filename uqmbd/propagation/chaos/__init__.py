"""What propagators of polynomial chaos share."""

from __future__ import annotations

from uqmbd.propagation.chaos.elements import ElementLimits, ElementRefinement, refine_elements

__all__ = [
    "ElementLimits",
    "ElementRefinement",
    "refine_elements",
]
