"""Boxes that fill the germ space: the elements of a chaos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["check_filled", "rows_of_boxes"]


def check_filled(boxes: Sequence[GermBox]) -> None:
    """Raise a StudyError if the boxes do not fill the germ space."""
    total = sum(box.probability for box in boxes)
    if abs(total - 1) > 1e-9:
        raise StudyError(f"The boxes must fill the germ space; their probabilities sum to {total:.12g}.")


def rows_of_boxes(boxes: Sequence[GermBox], germs: Array) -> list[NDArray[np.intp]]:
    """Return the numbers of the germ points (K, d) that lie in each box.

    Raises
    ------
    StudyError
        If a point lies in none.
    """
    from uqmbd.randomness import located

    where = located(boxes, germs)
    if np.any(where < 0):
        raise StudyError(f"The germ point {germs[int(where.argmin())].tolist()} lies in none of the elements.")
    return [np.flatnonzero(where == k) for k in range(len(boxes))]
