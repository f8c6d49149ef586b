"""Symbols for the reactions of components in output expressions."""

from __future__ import annotations

from typing import Any, Protocol

import sympy

from uqmbd.randomness import Symbol, Symbolic

__all__ = ["ReactingComponent", "PlaneReaction", "ReactionSymbol"]


UNITS = {"reaction_force": "N", "reaction_moment": "N m"}


class ReactingComponent(Protocol):
    """A component with reactions."""

    name: str


class ReactionSymbol(Symbolic, Symbol):
    """Symbol of one component of a reaction vector, a placeholder in output expressions."""

    component: ReactingComponent
    quantity: str
    index: int

    def __new__(cls, component: ReactingComponent, quantity: str, index: int) -> ReactionSymbol:
        """Make a symbol named after the component and the quantity."""
        self: ReactionSymbol = sympy.Symbol.__xnew__(cls, f"{component.name}.{quantity}[{index}]", real=True)
        self.component, self.quantity, self.index = component, quantity, index
        self.units = UNITS.get(quantity, "")
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.component))


class PlaneReaction(ReactionSymbol):
    """Moment in planar space: a scalar that also accepts the index ``[0]``."""

    _iterable = False  # SymPy must not treat the symbol as a sequence

    def __getitem__(self, index: int) -> PlaneReaction:
        if index not in (0, -1):
            raise IndexError(f"{self.name} has one component in planar space")
        return self
