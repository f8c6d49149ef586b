"""Boxes in the germ space: the elements of multi-element polynomial chaos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import OrInfinite, Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.randomness.germs import cumulated, median, truncate_germ
from uqmbd.randomness.space.germ_space import GermSpace

__all__ = ["GermBox", "located"]


NARROWEST = 2.0**-24
"""Probability of an interval of a germ up to which the interval is not divided."""


@typechecked
@dataclass(frozen=True, eq=False)
class GermBox:
    """Box in the germ space: an element of multi-element polynomial chaos.

    Parameters
    ----------
    space : GermSpace
        Whole germ space.
    lower, upper : tuple of float, length d
        Ends of the interval of each germ, in its coordinate; they may be infinite. A box contains its upper ends, but
        not its lower ends, except for the lower ends of the support.

    Raises
    ------
    uqmbd.StudyError
        If the box is empty.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
    >>> whole = GermBox.whole(GermSpace.of(JointInput.of([a, b])))
    >>> left, right = whole.split(0)
    >>> right.lower, right.upper, right.probability
    ((0.0, -inf), (1.0, inf), 0.5)
    >>> right.local.germs[0].gauss(1)[0].tolist()
    [0.5]
    """

    space: GermSpace
    lower: tuple[OrInfinite, ...]
    upper: tuple[OrInfinite, ...]

    def __post_init__(self) -> None:
        """Convert and check the bounds."""
        for name in ("lower", "upper"):
            object.__setattr__(self, name, tuple(float(x) for x in getattr(self, name)))
        if not len(self.lower) == len(self.upper) == self.space.dimension:
            raise StudyError(
                f"A box has {len(self.lower)} lower and {len(self.upper)} upper limits; expected "
                f"{self.space.dimension} of each, one for every germ."
            )
        if not self.probability > 0:
            raise StudyError(
                f"The box from {self.lower} to {self.upper} is empty; expected lower limits below upper limits."
            )

    @classmethod
    def whole(cls, space: GermSpace) -> GermBox:
        """Return the box that is the whole space."""
        bounds = np.array([germ.bounds for germ in space.germs]).reshape(-1, 2)
        return cls(space, tuple(bounds[:, 0].tolist()), tuple(bounds[:, 1].tolist()))

    @cached_property
    def probabilities(self) -> tuple[float, ...]:
        """Probability of each germ's interval, length d."""
        found = []
        for germ, low, high in zip(self.space.germs, self.lower, self.upper, strict=True):
            first = low <= germ.bounds[0]
            found.append(float(cumulated(germ, high)) - (0.0 if first else float(cumulated(germ, low))))
        return tuple(found)

    @property
    def probability(self) -> float:
        """Probability of the box: the product of `probabilities`, because germs are independent."""
        return float(np.prod(self.probabilities))

    @cached_property
    def local(self) -> GermSpace:
        """Germ space of the conditional distribution, in the coordinates of the whole space; its maps remain valid."""
        parts = zip(self.space.germs, self.lower, self.upper, strict=True)
        germs = tuple(truncate_germ(germ, low, high) for germ, low, high in parts)
        return GermSpace(self.space.inputs, germs, self.space.groups)

    def contains(self, germs: ArrayLike) -> NDArray[np.bool_]:
        """Return whether germ points (K, d) are in the box, shape (K,).

        Raises
        ------
        StudyError
            If the points have another number of germs.
        """
        points = np.asarray(germs, dtype=float)
        if points.ndim != 2 or points.shape[1] != len(self.lower):
            raise StudyError(f"GermBox.contains: germs have the shape {points.shape}; expected (K, {len(self.lower)}).")
        found = np.ones(len(points), dtype=bool)
        for k, germ in enumerate(self.space.germs):
            if self.lower[k] > germ.bounds[0]:
                found &= points[:, k] > self.lower[k]
            if self.upper[k] < germ.bounds[1]:
                found &= points[:, k] <= self.upper[k]
        return found

    def divisible(self, germ: Size) -> bool:
        """Return whether the box can be split along a germ: it is not too narrow, and contains several values.

        Raises
        ------
        StudyError
            If there is no germ of this number.
        """
        if not 0 <= germ < len(self.lower):
            raise StudyError(
                f"GermBox.divisible: germ is {germ!r:.40}; expected the number of a germ, below {len(self.lower)}."
            )
        local = self.local.germs[germ]
        return bool(self.probabilities[germ] > NARROWEST and (local.values or 2) > 1)

    def split(self, germ: int, at: str = "median") -> tuple[GermBox, GermBox]:
        """Split the box along a germ.

        Parameters
        ----------
        germ : int
            Number of the germ.
        at : {"median", "midpoint"}
            Point of the split: the median of the conditional distribution, so that both parts have the same
            probability; or the midpoint of a finite interval.

        Returns
        -------
        GermBox, GermBox
            Lower and upper part.

        Raises
        ------
        uqmbd.StudyError
            If the box cannot be split there.
        """
        if at not in ("median", "midpoint"):
            raise StudyError(f"GermBox.split: at={at!r}; expected 'median' or 'midpoint'.")
        if not self.divisible(germ):
            raise StudyError(f"The box from {self.lower} to {self.upper} cannot be split along germ {germ}.")
        local = self.local.germs[germ]
        where = median(local)
        if at == "midpoint" and local.family != "discrete":
            where = (local.bounds[0] + local.bounds[1]) / 2
            if not np.isfinite(where):
                raise StudyError(f"Germ {local.name!r} has no midpoint from {local.bounds[0]} to {local.bounds[1]}.")
        below, above = list(self.upper), list(self.lower)
        below[germ] = above[germ] = where
        return GermBox(self.space, self.lower, tuple(below)), GermBox(self.space, tuple(above), self.upper)


def located(boxes: Sequence[GermBox], germs: ArrayLike) -> NDArray[np.int64]:
    """Return the index (K,) of the box that contains each germ point (K, d); -1 if there is none."""
    points = np.asarray(germs, dtype=float)
    found = np.full(len(points), -1, dtype=np.int64)
    for k, box in enumerate(boxes):
        found[box.contains(points) & (found < 0)] = k
    return found
