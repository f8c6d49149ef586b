"""Maps between independent germs and groups of inputs: Gaussian copulas and general Rosenblatt transforms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.special

from uqmbd.errors import StudyError
from uqmbd.randomness.space.marginals import Marginal
from uqmbd.typing import Array

__all__ = ["CorrelatedTransform", "Group", "JointMap", "Rosenblatt", "conditional_names"]


SMALLEST, LARGEST = 1e-300, 1 - 2.0**-53
"""Smallest and largest probability with a finite normal germ."""

STEP = 2e-3
"""Step of germs for derivatives of maps that are known only numerically."""


@dataclass(frozen=True, eq=False)
class CorrelatedTransform:
    """Inputs as increasing functions of correlated standard variables: ``x_k = m_k(sum_j factor[k, j] * germ_j)``.

    With standard normal germs and a factor of a correlation matrix that is lower triangular in the order of
    conditioning, this is a Gaussian copula. The map is also the Rosenblatt transform of this copula. A single input has
    the factor 1 and any germ.
    """

    columns: tuple[int, ...]  # of the inputs and of the germs
    marginals: tuple[Marginal, ...]  # one for each input
    factor: Array  # (n, n) with rows of norm one
    order: tuple[int, ...]
    """Positions in `columns`, in the order of conditioning: ``factor[order][:, order]`` is lower triangular."""

    @classmethod
    def single(cls, column: int, marginal: Marginal) -> CorrelatedTransform:
        """Return the map of an independent input."""
        return cls((column,), (marginal,), np.ones((1, 1)), (0,))

    @property
    def independent(self) -> bool:
        """Whether each input depends on its own germ alone."""
        return bool(np.all(self.factor == np.diag(np.diag(self.factor))))

    def to_inputs(self, germs: Array) -> Array:
        """Map germs, shape (K, n), to inputs, row by row."""
        inputs = np.empty_like(germs)
        for row, marginal in enumerate(self.marginals):
            inputs[:, row] = marginal.to_input(self._sum(germs, row, self.order))
        return inputs

    def to_germs(self, inputs: Array) -> Array:
        """Map inputs, shape (K, n), to germs by forward substitution; NaN for an input outside its support."""
        germs = np.empty_like(inputs)
        for place, row in enumerate(self.order):
            standard = self.marginals[row].to_germ(np.ascontiguousarray(inputs[:, row]))
            germs[:, row] = (standard - self._sum(germs, row, self.order[:place])) / self.factor[row, row]
        return germs

    def germ_derivatives(self, germs: Array) -> Array:
        """Return the derivatives (K, n, n) of the germs with respect to the inputs, at germ points (K, n)."""
        slopes = np.empty_like(germs)
        for row, marginal in enumerate(self.marginals):
            slopes[:, row] = marginal.slope(self._sum(germs, row, self.order))
        inverse = np.linalg.inv(self.factor)
        with np.errstate(divide="ignore"):
            steep = 1.0 / slopes
        # avoid the product of zero and infinity
        return np.where(inverse == 0, 0.0, inverse * np.where(np.isfinite(steep), steep, np.inf)[:, None, :])

    def _sum(self, germs: Array, row: int, others: tuple[int, ...]) -> Array:
        # not a matrix product, whose rounding depends on the number of rows
        total = np.zeros(len(germs))
        for column in others:
            if self.factor[row, column]:
                total = total + self.factor[row, column] * germs[:, column]
        return total


class JointMap(Protocol):
    """Map between uniform numbers and dependent inputs."""

    def inverse(self, uniform: Array) -> Array:
        """Map uniform numbers, shape (K, n), to inputs."""

    def forward(self, inputs: Array) -> Array:
        """Map inputs, shape (K, n), to uniform numbers; NaN outside the support."""

    @property
    def text(self) -> str:
        """Stored text of the map; empty if it cannot be stored."""


@dataclass(frozen=True, eq=False)
class Rosenblatt:
    """Rosenblatt transform of a joint distribution: germs are functions of conditional probabilities."""

    columns: tuple[int, ...]  # of the inputs and of the germs
    order: tuple[int, ...]  # positions in `columns`, in the order of conditioning
    normal: tuple[bool, ...]  # which germs are standard normal; the others are uniform on [-1, 1]
    joint: JointMap | None = None  # None after reading from a file without it

    @property
    def independent(self) -> bool:
        """Whether each input depends on its own germ alone."""
        return len(self.columns) == 1

    def to_inputs(self, germs: Array) -> Array:
        """Map germs, shape (K, n), to inputs."""
        if self.joint is None:
            raise _not_stored("to inputs")
        uniform = np.where(self.normal, scipy.special.ndtr(germs), (germs + 1) / 2)
        return self.joint.inverse(np.clip(uniform, 0, 1))

    def to_germs(self, inputs: Array) -> Array:
        """Map inputs, shape (K, n), to germs; NaN for an input outside its support."""
        if self.joint is None:
            raise _not_stored("to germs")
        uniform = self.joint.forward(inputs)
        # far out, probabilities are rounded to one: germs there are large, but not infinite
        inside = np.clip(uniform, SMALLEST, LARGEST)
        return np.where(self.normal, scipy.special.ndtri(inside), 2 * uniform - 1)

    def germ_derivatives(self, germs: Array) -> Array:
        """Return the derivatives (K, n, n) of the germs with respect to the inputs, at germ points (K, n).

        The method inverts derivatives of the inputs with respect to the germs. Central differences of fourth order give
        these within the supports of the germs, because conditional distributions are known only numerically.
        """
        count = germs.shape[1]
        forth = np.empty((len(germs), count, count))
        for k in range(count):
            step = np.full(len(germs), STEP)
            if not self.normal[k]:
                step = np.minimum(step, (1.0 - np.abs(germs[:, k])) / 2.0)
            found = np.zeros_like(germs)
            for times, weight in zip((-2, -1, 1, 2), (1.0, -8.0, 8.0, -1.0), strict=True):
                moved = germs.copy()
                moved[:, k] += times * step
                found = found + weight * self.to_inputs(moved)
            with np.errstate(divide="ignore", invalid="ignore"):
                forth[:, :, k] = found / (12.0 * step)[:, None]
        known = np.flatnonzero(np.isfinite(forth).all(axis=(1, 2)))
        known = known[np.linalg.det(forth[known]) != 0]
        back = np.full_like(forth, np.nan)
        back[known] = np.linalg.inv(forth[known])
        return back


Group = CorrelatedTransform | Rosenblatt
"""Map of a group of dependent inputs, or of one input."""


def _not_stored(direction: str) -> StudyError:
    return StudyError(
        f"This polynomial chaos does not contain the map {direction} of dependent inputs (Rosenblatt's transform of "
        "a general joint distribution). The distribution may contain user functions (chaospy.UserDistribution), "
        "or arithmetic that only chaospy evaluates, or an earlier version wrote the results. Evaluate the chaos at "
        "germs, or build the GermSpace from the study again."
    )


def conditional_names(names: tuple[str, ...], order: tuple[int, ...], factor: Array | None = None) -> tuple[str, ...]:
    """Return names of germs: ``"c | a, b"`` is the germ of c given a and b; `order` is the order of conditioning.

    >>> conditional_names(("a", "b", "c"), (1, 0, 2))
    ('a | b', 'b', 'c | b, a')
    """
    labels = list(names)
    for place, row in enumerate(order):
        given = [names[k] for k in order[:place] if factor is None or factor[row, k]]
        if given:
            labels[row] = f"{names[row]} | {', '.join(given)}"
    return tuple(labels)
