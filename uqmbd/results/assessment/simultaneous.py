"""Compute critical values for the largest of many correlated deviations over time.

Tests at 401 times, each with a level of 5 %, almost always find a deviation. Deviations at neighbouring times are
correlated, so 401 tests are equivalent to far fewer independent ones; this number is estimated from the samples.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.typing import Array

__all__ = ["chance", "curve_length", "pointwise_level", "student"]


def curve_length(parts: Sequence[Array]) -> float:
    r"""Return the length of the curve of normalised deviations on the unit sphere over time.

    `parts` (S, T): contribution of each sample to a deviation at each time, with one array for each independent set of
    samples. The norm of a column over all arrays is the standard error. Return radians: :math:`\sum_k \arccos
    \varrho_{k,k+1}`, with the correlations of neighbouring times. Times without any deviation are skipped.

    >>> t = np.linspace(0, np.pi, 181)
    >>> round(curve_length([np.array([np.cos(t), np.sin(t)])]), 6)
    3.141593
    """
    norm = np.sqrt(sum((np.square(part).sum(axis=0) for part in parts), start=np.zeros(parts[0].shape[1])))
    used = norm > 0
    products = np.zeros(max(int(used.sum()) - 1, 0))
    for part in parts:
        unit = part[:, used] / norm[used]
        products += np.einsum("st,st->t", unit[:, 1:], unit[:, :-1])
    return float(np.arccos(np.clip(products, -1.0, 1.0)).sum())


def chance(bound: float, length: float, count: int) -> float:
    r"""Return an upper bound of the probability that the largest absolute standard normal deviation exceeds a bound u.

    The result is the smaller of two bounds. The first is :math:`2 \Phi(-u) + (\kappa / \pi) e^{-u^2/2}`, for deviations
    along a curve of length :math:`\kappa` on the unit sphere ([1]_, [2]_). The second is :math:`2 T \Phi(-u)`
    (Bonferroni).

    `bound`: u, in standard errors; `length`: length from :func:`curve_length`, infinite for unknown correlations;
    `count`: number of times, T.

    .. [1] H. Hotelling, American Journal of Mathematics 61 (1939) 440-460.
    .. [2] D. Q. Naiman, Annals of Statistics 14 (1986) 896-906.

    >>> round(chance(1.959964, 0.0, 401), 6), round(chance(3.0, np.inf, 10), 6)
    (0.05, 0.026998)
    """
    from scipy.special import ndtr

    one = 2.0 * float(ndtr(-bound))
    along = one + length / np.pi * float(np.exp(-0.5 * bound * bound))
    return float(min(along, max(count, 1) * one, 1.0))


def pointwise_level(level: float, length: float, count: int) -> float:
    """Return the level of a test at one time, such that the test over all times has the level `level`.

    `level`: probability, between 0 and 1, that the largest deviation over time exceeds its critical value by chance;
    `length`, `count`: as for :func:`chance`.

    >>> round(pointwise_level(0.05, 0.0, 401), 6), round(pointwise_level(0.05, np.inf, 10), 6)
    (0.05, 0.005)
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    bound = brentq(lambda u: np.log(chance(u, length, count)) - np.log(level), 0.0, 30.0, xtol=1e-10)
    return 2.0 * float(ndtr(-bound))


def student(level: float, freedom: Array) -> Array:
    """Return the magnitude that Student's t exceeds with probability `level`, for degrees of freedom (...).

    >>> student(0.05, np.array([10.0, np.inf])).round(4).tolist()
    [2.2281, 1.96]
    """
    from scipy.special import ndtri, stdtrit

    finite = np.isfinite(freedom)
    found = -stdtrit(np.where(finite, freedom, 1.0), 0.5 * level)
    return np.asarray(np.where(finite, found, -ndtri(0.5 * level)), dtype=float)
