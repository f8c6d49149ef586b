"""Counted angles in the parameters of a component, each with a counter state in the component's block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.mechanism import Auxiliary, JointAngle, Local

__all__ = ["CountedAngle", "count"]


@dataclass(frozen=True)
class CountedAngle:
    """Angle in parameters of a component, in local symbols."""

    symbol: sympy.Symbol
    angle: JointAngle
    cosine: sympy.Expr
    sine: sympy.Expr
    rate: sympy.Expr
    near: sympy.Expr

    @property
    def pattern(self) -> tuple[Any, ...]:
        """Data by which counters differ."""
        return self.symbol, self.angle.half, self.angle.signed, self.cosine, self.sine, self.rate, self.near


def count(local: Local, counted: Sequence[CountedAngle]) -> list[Auxiliary]:
    """Insert counted angles into the values of a component, and return the terms of their counter states.

    Each component has separate counters, so that its block does not depend on states of other blocks.
    """
    swap: dict[sympy.Basic, sympy.Expr] = {}
    terms: list[Auxiliary] = []
    for k, x in enumerate(counted):
        state = local.state(f"counted angle {k + 1}")
        swap[x.symbol] = local.let(f"angle {k + 1}", x.angle.continued(state, x.cosine, x.sine))
        terms.append(Auxiliary(state, x.rate, x.angle.at_start(x.cosine, x.sine, x.near)))
    local.insert(swap)
    return terms
