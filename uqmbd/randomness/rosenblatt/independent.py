"""Replacement of distributions of independent variables that chaospy evaluates incorrectly.

chaospy treats a doubled, shifted or truncated whole number as a continuous variable. For sums and products
of vectors with independent components, chaospy provides no separate distributions of the components. It searches for
quantiles of mixtures with random steps.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.special

from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import distribution_of, is_dependent
from uqmbd.randomness.rosenblatt.atoms import atoms_of
from uqmbd.randomness.rosenblatt.conditionals import Core
from uqmbd.randomness.rosenblatt.expressions import NotUnderstood, owners_of
from uqmbd.randomness.rosenblatt.members import conditional
from uqmbd.randomness.rosenblatt.reading import mixture_of
from uqmbd.randomness.rosenblatt.vectors import NormalMixture
from uqmbd.typing import Array

__all__ = ["rewritten"]


BLOCK = 1024
"""Number of quantiles that are computed at once."""


def rewritten(distribution: Any) -> Any:
    """Return an equivalent distribution that chaospy evaluates correctly.

    The result is the argument if chaospy evaluates it correctly. Raise StudyError, whose message is part of a sentence,
    if arithmetic gives values that are not whole numbers. Raise StudyError also if chaospy ignores members of a joint
    distribution that follow a vector, and these members cannot be determined.

    >>> import chaospy
    >>> odd = rewritten(2 * chaospy.Binomial(2, 0.5) + 1)
    >>> odd, odd.inv(np.array([0.1, 0.5, 0.9])).round().tolist()
    (Add(Multiply(2, Binomial(2, 0.5)), 1), [1.0, 3.0, 5.0])
    >>> rewritten(chaospy.Iid(chaospy.Uniform(), 2) + 1)
    J(Add(Uniform(), 1.0), Add(Uniform(), 1.0))
    """
    import chaospy

    if isinstance(distribution, chaospy.J) and set(distribution._owners) != set(range(len(distribution))):
        distribution = copy.copy(distribution)  # chaospy ignores members that follow a vector
        try:
            distribution._owners = dict(owners_of(distribution))
        except NotUnderstood:
            raise StudyError(
                f"chaospy ignores members of the joint distribution {distribution} that follow a vector; "
                "put the vectors last"
            ) from None
    if is_dependent(distribution) and not _cut(distribution):
        return distribution
    if len(distribution) == 1:
        return _alone(distribution)
    given = [_component(distribution, k) for k in range(len(distribution))]
    found = [_alone(one) for one in given]
    changed = any(a is not b for a, b in zip(given, found, strict=True))
    return chaospy.J(*found) if changed or not isinstance(distribution, chaospy.J) else distribution


def _cut(distribution: Any) -> bool:
    """Return whether a distribution truncates independent variables; chaospy treats such variables as dependent."""
    import chaospy

    return isinstance(distribution, chaospy.Trunc) and not is_dependent(distribution._dist)


def _component(distribution: Any, k: int) -> Any:
    import chaospy

    if not isinstance(distribution, chaospy.Distribution):
        numbers = np.ravel(distribution)
        return float(numbers[k if len(numbers) > 1 else 0])
    given = distribution._parameters
    if isinstance(distribution, chaospy.Negative):
        return chaospy.Negative(_component(given["left"], k))
    if isinstance(distribution, (chaospy.Add, chaospy.Multiply, chaospy.Power)):
        return type(distribution)(_component(given["left"], k), _component(given["right"], k))
    if isinstance(distribution, chaospy.Trunc) and len(distribution) > 1:
        inner = distribution._dist
        ends = {side: _component(given[side], k) for side in ("lower", "upper")}
        free = {"lower": inner.lower[k], "upper": inner.upper[k]}
        return chaospy.Trunc(_component(inner, k), **{s: x for s, x in ends.items() if x is not free[s] != x})
    return distribution[k]


@dataclass(frozen=True, eq=False)
class _DiscreteTable:
    """Table of a discrete variable; a `uqmbd.randomness.distributions.sources.DistributionSource`."""

    numbers: Array
    probability: Array

    @property
    def discrete(self) -> bool:
        return True

    @property
    def support(self) -> tuple[float, float]:
        return float(self.numbers.min()), float(self.numbers.max())

    def cdf(self, x: Array) -> Array:
        return np.asarray([self.probability[self.numbers <= one].sum() for one in x])

    def quantile(self, u: Array) -> Array:
        order = np.argsort(self.numbers)
        place = np.searchsorted(np.cumsum(self.probability[order]), u)
        return np.asarray(self.numbers[order][np.minimum(place, len(order) - 1)])

    def upper_quantile(self, u: float) -> float:
        return float(self.quantile(np.array([1 - u]))[0])

    def lower_quantile(self, u: float) -> float:
        return float(self.quantile(np.array([u]))[0])

    def moment(self, order: int) -> float:
        return float(self.probability @ self.numbers**order)

    def density(self, x: Array) -> Array:
        return np.asarray([self.probability[self.numbers == one].sum() for one in x])


@dataclass(frozen=True, eq=False)
class _Mixed:
    """Mixture of normal variables; a `uqmbd.randomness.distributions.sources.DistributionSource`."""

    mixture: NormalMixture

    @property
    def discrete(self) -> bool:
        return False

    @property
    def support(self) -> tuple[float, float]:
        return -np.inf, np.inf

    def density(self, x: Array) -> Array:
        standard = self._standard(x)
        heights = np.exp(-(standard**2) / 2) / (self._spread * np.sqrt(2 * np.pi))
        return np.asarray((self.mixture.weights * heights).sum(axis=-1))

    def cdf(self, x: Array) -> Array:
        return np.asarray((self.mixture.weights * scipy.special.ndtr(self._standard(x))).sum(axis=-1))

    def quantile(self, u: Array) -> Array:
        flat = np.ravel(np.asarray(u, dtype=float))
        found = np.empty_like(flat)
        for first in range(0, len(flat), BLOCK):
            part = flat[None, first : first + BLOCK]
            found[first : first + BLOCK] = self.mixture.inverse(part, part[:0])[0]
        return found.reshape(np.shape(u))

    def upper_quantile(self, u: float) -> float:
        turned = NormalMixture(self.mixture.weights, -self.mixture.centres, self.mixture.factors, (0,))
        return -float(turned.inverse(np.array([[u]]), np.empty((0, 1)))[0, 0])

    def lower_quantile(self, u: float) -> float:
        return float(self.quantile(np.array([u]))[0])

    def moment(self, order: int) -> float:
        centres = self.mixture.centres[:, 0]
        terms = np.zeros_like(centres)
        for j in range(order // 2 + 1):
            # moment of order 2 j of a standard normal variable
            own = math.factorial(2 * j) / (2**j * math.factorial(j))
            terms = terms + math.comb(order, 2 * j) * own * centres ** (order - 2 * j) * self._spread ** (2 * j)
        return float(self.mixture.weights @ terms)

    @property
    def _spread(self) -> Array:
        return self.mixture.factors[:, 0, 0]

    def _standard(self, x: Array) -> Array:
        return np.asarray((np.asarray(x, dtype=float)[..., None] - self.mixture.centres[:, 0]) / self._spread)


def _alone(distribution: Any) -> Any:
    import chaospy

    if isinstance(distribution, chaospy.GaussianKDE):
        return distribution_of("", _Mixed(mixture_of(distribution)), str(distribution))
    return _whole_numbers(distribution)


def _whole_numbers(distribution: Any) -> Any:
    try:
        law = conditional(distribution, {})
    except NotUnderstood:
        return distribution
    if not law.discrete or isinstance(law, Core):
        return distribution
    found = atoms_of(law, np.empty((0, 1)))
    numbers = None if found is None else np.rint(found[0][:, 0])
    if found is None or numbers is None or np.abs(found[0][:, 0] - numbers).max() > 1e-9:
        raise StudyError(
            f"the distribution {distribution} has values that are not whole numbers, or too many values. Declare the "
            "whole number as a random variable, and write the arithmetic into the mechanism"
        )
    return distribution_of("", _DiscreteTable(numbers, found[1][:, 0]), str(distribution))
