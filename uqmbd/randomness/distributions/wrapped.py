"""Distributions of chaospy that evaluate a wrapped object of another package.

`chaospy.UserDistribution` contains functions, has no moments, and is always continuous.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from chaospy.distributions.baseclass import ShiftScaleDistribution, SimpleDistribution

from uqmbd.errors import StudyError
from uqmbd.randomness.distributions.sources import DistributionSource
from uqmbd.typing import Array

__all__ = ["MovedDistribution", "WholeNumbers", "WrappedDistribution"]

RARE = 1e-15
"""Probability beyond the finite bound that replaces an infinite end of the support, as in chaospy's distributions."""

MOST_VALUES = 100_000
"""Largest number of whole numbers that a discrete distribution may take."""


class _Printed:
    """Print a distribution as its package does."""

    _text: str

    def __repr__(self) -> str:
        return self._text

    __str__ = __repr__


class WrappedDistribution(_Printed, SimpleDistribution):
    """Continuous distribution of another package, printed as `text`."""

    tabulated = True
    """Whether quantiles are computed numerically, which may be slow."""

    def __init__(self, source: DistributionSource, text: str) -> None:
        super().__init__(parameters={}, repr_args=[])
        self._source, self._text = source, text
        low, high = source.support
        self._low = low if np.isfinite(low) else source.lower_quantile(RARE)
        self._high = high if np.isfinite(high) else source.upper_quantile(RARE)

    def _ppf(self, u: Array, **_: Any) -> Array:
        return self._source.quantile(u)

    def _cdf(self, x: Array, **_: Any) -> Array:
        return self._source.cdf(x)

    def _pdf(self, x: Array, **_: Any) -> Array:
        return self._source.density(x)

    def _mom(self, order: Array, **_: Any) -> float:
        degree = int(np.ravel(order)[0])
        return self._source.moment(degree) if degree else 1.0

    def _lower(self, **_: Any) -> float:
        return self._low

    def _upper(self, **_: Any) -> float:
        return self._high


class MovedDistribution(_Printed, ShiftScaleDistribution):
    """Distribution of ``shift + scale * x``, with ``x`` of the distribution `standard`; printed as `text`."""

    tabulated = True

    def __init__(self, standard: WrappedDistribution, shift: float, scale: float, text: str) -> None:
        super().__init__(standard, shift=shift, scale=scale)
        self._text = text


class WholeNumbers(_Printed, SimpleDistribution):
    """Table of a distribution of whole numbers; as in chaospy, each number spreads over an interval of length one.

    The constructor reads the source once; `text` is the printed form. Raise StudyError, whose message is part of a
    sentence, if the source takes other values than whole numbers, or too many values.
    """

    interpret_as_integer = True

    def __init__(self, source: DistributionSource, text: str) -> None:
        super().__init__(parameters={}, repr_args=[])
        low, high = source.support
        low = low if np.isfinite(low) else source.lower_quantile(RARE)
        high = high if np.isfinite(high) else source.upper_quantile(RARE)
        if not (np.isfinite([low, high]).all() and high - low < MOST_VALUES):
            raise StudyError(
                f"its values are whole numbers from {low:g} to {high:g}; expected at most {MOST_VALUES} values"
            )
        numbers = np.arange(np.floor(low), np.ceil(high) + 1)
        probability = source.density(numbers)
        if abs(probability.sum() - 1) > 1e-9:
            raise StudyError(
                f"it is discrete, but the probabilities of whole numbers sum to {probability.sum():.6g}; "
                "expected whole numbers only"
            )
        self._text, self._numbers, self._probability = text, numbers, probability / probability.sum()
        self._edges = np.r_[numbers[0] - 0.5, numbers + 0.5]
        self._cumulated = np.r_[0.0, np.cumsum(self._probability)]

    def _ppf(self, u: Array, **_: Any) -> Array:
        chosen = np.clip(np.searchsorted(self._cumulated, u, side="right") - 1, 0, len(self._numbers) - 1)
        part = np.divide(
            u - self._cumulated[chosen],
            self._probability[chosen],
            out=np.zeros_like(u),
            where=self._probability[chosen] > 0,
        )
        # chaospy rounds halves to even numbers, so each value must stay inside the interval of its number
        found: Array = self._numbers[chosen] + np.clip(part - 0.5, -0.5 + 1e-10, 0.5 - 1e-10)
        return found

    def _cdf(self, x: Array, **_: Any) -> Array:
        return np.asarray(np.interp(x, self._edges, self._cumulated))

    def _pdf(self, x: Array, **_: Any) -> Array:
        place = np.rint(x - self._numbers[0])
        inside = (place >= 0) & (place < len(self._numbers))
        return np.where(inside, self._probability[np.where(inside, place, 0).astype(int)], 0.0)

    def _mom(self, order: Array, **_: Any) -> float:
        return float(self._numbers ** int(np.ravel(order)[0]) @ self._probability)

    def _lower(self, **_: Any) -> float:
        return float(self._edges[0] + 1e-10)

    def _upper(self, **_: Any) -> float:
        return float(self._edges[-1] - 1e-10)
