"""Germs of all inputs, maps between germs and inputs, boxes of germs, and their storage."""

from __future__ import annotations

from uqmbd.randomness.space.boxes import GermBox, located
from uqmbd.randomness.space.germ_space import TRANSFORMS, GermSpace
from uqmbd.randomness.space.marginals import Marginal
from uqmbd.randomness.space.transforms import CorrelatedTransform

__all__ = [
    "TRANSFORMS",
    "CorrelatedTransform",
    "GermBox",
    "GermSpace",
    "Marginal",
    "located",
]
