"""Values of discrete variables, with their probabilities."""

from __future__ import annotations

import numpy as np

from uqmbd.randomness.rosenblatt.conditionals import AffineConditional, Conditional, Core, Cut
from uqmbd.randomness.rosenblatt.expressions import evaluated
from uqmbd.typing import Array

__all__ = ["atoms_of"]


MOST = 2**18
"""Largest number of values of all points together."""


def atoms_of(law: Conditional, values: Array) -> tuple[Array, Array] | None:
    """Return the values and probabilities (m, N) of a discrete variable; None if they are unknown or too many."""
    if isinstance(law, Core):
        low, high = law.ends(values)
        count = int((high - low).max()) + 1
        if count * len(low) > MOST:
            return None
        x = low + np.arange(count)[:, None]
        steps = np.stack([law.upto(row, values) for row in x])
        return x, np.diff(steps, axis=0, prepend=0.0)
    if isinstance(law, AffineConditional):
        inner = atoms_of(law.inner, values)
        return (
            None
            if inner is None
            else (evaluated(law.shift, values) + evaluated(law.scale, values) * inner[0], inner[1])
        )
    if isinstance(law, Cut):
        inner = atoms_of(law.inner, values)
        if inner is None:
            return None
        low, high = law.ends(values)
        p = np.where((inner[0] >= low) & (inner[0] <= high), inner[1], 0.0)
        return inner[0], p / p.sum(axis=0)
    return None
