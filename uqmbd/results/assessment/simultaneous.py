"""Critical values for errors over time: how often the largest of many dependent deviations exceeds a bound by chance.

A deviation that is looked for at 401 times is found somewhere, if each time has its own 5 %. Deviations at neighbouring
times depend on one another, so that 401 of them count as far fewer; how many follows from the samples.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.typing import Array

__all__ = ["chance", "curve_length", "pointwise_level", "student"]


def curve_length(parts: Sequence[Array]) -> float:
    r"""Return the length of the curve of normalised deviations on the unit sphere over time.

    `parts` (S, T): what each sample adds to a deviation at each time, one array for each independent set of samples;
    the columns of all together have the norm of the standard error. Return radians: :math:`\sum_k \arccos
    \varrho_{k,k+1}`, with the correlations of neighbouring times. Times without any deviation are passed over.

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
    r"""Return an upper bound of the chance that the largest of standard normal deviations exceeds a bound in size.

    The lesser of :math:`2 \Phi(-u) + (\kappa / \pi) e^{-u^2/2}`, for deviations along a curve of the length
    :math:`\kappa` on the unit sphere ([1]_, [2]_), and of :math:`2 T \Phi(-u)` (Bonferroni).

    `bound`: in standard errors; `length`: from :func:`curve_length`; infinite where nothing is known of the
    dependence; `count`: number of times, T.

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
    """Return the level of a test at one time for which that over all times has a level.

    `level`: between 0 and 1: how often the largest deviation over time may exceed its critical value by chance;
    `length`, `count`: as of :func:`chance`.

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
