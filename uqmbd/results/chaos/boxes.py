"""Boxes that fill the germ space: the elements of a chaos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox
    from uqmbd.results.chaos.interface import Surrogate

__all__ = ["check_filled", "rows_of_boxes", "terms_of_all", "verification_of_all"]


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


def terms_of_all(chaoses: Sequence[Surrogate]) -> tuple[Index, list[list[int]]]:
    """Return the terms (P, d) that any of the chaoses has, by their degree, and the numbers of each chaos's own."""
    every = {tuple(row) for chaos in chaoses for row in chaos.multi_index.tolist()}
    terms = sorted(every, key=lambda row: (sum(row), [-k for k in row]))
    place = {row: k for k, row in enumerate(terms)}
    rows = [[place[tuple(row)] for row in chaos.multi_index.tolist()] for chaos in chaoses]
    return np.array(terms, dtype=np.int64), rows


def verification_of_all(chaoses: Sequence[Surrogate]) -> tuple[Array | None, Array | None]:
    """Return the verification realisations of all chaoses that have any: germ points (V, d), and responses."""
    germs = [c.verification_germs for c in chaoses if c.verification_germs is not None]
    response = [c.verification_response for c in chaoses if c.verification_response is not None]
    return (np.concatenate(germs), np.concatenate(response)) if germs and response else (None, None)
