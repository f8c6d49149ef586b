"""What a problem yields: the responses of some realisations."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import ScalarValues
from uqmbd.typing import Array

__all__ = ["Realisations"]


@dataclass(frozen=True)
class Realisations:
    """Responses of a mechanism to given inputs.

    Attributes
    ----------
    values : array, shape (K, input)
        The inputs.
    response : array, shape (K, output, time)
        NaN where a realisation failed.
    status : array of int, shape (K,)
        0: fine; `uqmbd.results.STATUS_MEANINGS` names the others.
    messages : tuple of str
        Reason of each failure, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.
    scalars : ScalarValues, optional
        Outputs without a time: `values` (K, scalar) with a `status` and `messages` of their own, where the mechanism
        has some.
    """

    values: Array
    response: Array
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float
    scalars: ScalarValues | None = None

    @property
    def failures(self) -> int:
        """How many failed."""
        return int(np.count_nonzero(self.status))

    def most_frequent_reason(self) -> str:
        """Return the reason that most failures share (numbers aside), in its first wording."""
        reasons = [m for m in self.messages if m]
        if not reasons:
            return ""
        shapes = ["".join(c for c in m if not c.isdigit()) for m in reasons]
        return reasons[shapes.index(Counter(shapes).most_common(1)[0][0])]
