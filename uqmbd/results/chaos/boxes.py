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

__all__ = [
    "VERIFICATION",
    "check_filled",
    "checked_weights",
    "rows_of_boxes",
    "terms_of_all",
    "verification_of_all",
]


VERIFICATION = ("verification_germs", "verification_response", "verification_weights")
"""Names of what a surrogate knows of its verification realisations."""

ROUNDING = 1e-12
"""By how much weights that are read again may differ from 1 in sum."""


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


def verification_of_all(chaoses: Sequence[Surrogate], probabilities: Sequence[float]) -> dict[str, Array | None]:
    """Return the verification realisations of the chaoses of all elements: germ points (V, d), responses, weights.

    Each element counts by its probability, however many of the realisations are in it.  None where none has any.
    """
    pairs = [(c, p) for c, p in zip(chaoses, probabilities, strict=True) if c.verification_germs is not None]
    if not pairs:
        return dict.fromkeys(VERIFICATION)
    parts = [[getattr(c, name) for c, _ in pairs] for name in VERIFICATION[:2]]
    weights = np.concatenate([p * np.asarray(c.verification_weights) for c, p in pairs])
    return dict(zip(VERIFICATION, (*map(np.concatenate, parts), weights / weights.sum()), strict=True))


def checked_weights(weights: Array | None, germs: Array | None, boxes: Sequence[GermBox] = ()) -> Array | None:
    """Return the weights of verification realisations so that they sum to 1.

    Parameters
    ----------
    weights : array, shape (V,), or None
        None: they are spread like the inputs, within each of the boxes where there are some.
    germs : array, shape (V, d), or None
        Their germ points; None: there are none.
    boxes : sequence of GermBox
        Elements, each of which counts by its probability.

    Raises
    ------
    StudyError
        If there is not one for each, or one is negative.
    """
    if germs is None:
        if weights is not None:
            raise StudyError("'verification_weights' are given without 'verification_germs'; they belong together.")
        return None
    if weights is None:
        found = np.ones(len(germs))
        for box, rows in zip(boxes, rows_of_boxes(boxes, germs) if boxes else (), strict=True):
            found[rows] = box.probability / max(len(rows), 1)
    else:
        found = np.array(weights, dtype=float)
    if found.shape != (len(germs),) or not (np.isfinite(found).all() and (found >= 0).all() and found.sum() > 0):
        raise StudyError(
            f"'verification_weights' must be one number, not negative, for each of {len(germs)} verification points; "
            f"{found.tolist()} was given."
        )
    if abs(found.sum() - 1) > ROUNDING:
        found /= found.sum()
    found.setflags(write=False)
    return found
