"""What propagators of polynomial chaos share."""

from __future__ import annotations

from uqmbd.propagation.chaos.elements import ElementLimits, ElementRefinement, refine_elements
from uqmbd.propagation.chaos.nodes import NodeFit, fit_nodes
from uqmbd.propagation.chaos.verification import Verification

__all__ = [
    "NodeFit",
    "Verification",
    "fit_nodes",
    "ElementLimits",
    "ElementRefinement",
    "refine_elements",
]
