"""What a problem yields of requirements: margins of some realisations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.propagation.execution.realisations import Realisations
from uqmbd.typing import Array, Mask

__all__ = ["Margins"]


@dataclass(frozen=True)
class Margins:
    """How far realisations are from the limits that they have to stay within.

    Attributes
    ----------
    values : array, shape (K, requirement)
        Of the whole motion, in the units of the relations: below zero, the requirement is violated.  NaN where a
        realisation failed.
    running : array, shape (K, requirement, T)
        The smallest margin until each output time, located between the times, too.  Margins that are known at the end
        only, as of an integral, are +inf before the last time.
    failed : array of bool, shape (K,)
        Which realisations have no margins: they are neither safe nor unsafe.
    messages : tuple of str
        Reasons of failures, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.
    """

    values: Array
    running: Array
    failed: Mask
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float

    @classmethod
    def of(cls, found: Realisations, shape: tuple[int, ...]) -> Margins:
        """Return those of some realisations, the shape of each being (requirement, T)."""
        known = found.margins
        if known is None:
            return cls(np.zeros((0, shape[0])), np.zeros((0, *shape)), np.zeros(0, dtype=bool), (), {}, 0.0)
        return cls(known.values, known.running, known.failed, known.messages, found.counters, found.wall_time)
