"""Covariances of inputs, from closed forms for vectors or by quadrature of the density or the Rosenblatt transform."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from uqmbd import logs
from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import AffineDistribution, heaviest_tail, is_dependent
from uqmbd.randomness.existence import exists, moment_orders
from uqmbd.randomness.germs import discretise, discretise_quantiles
from uqmbd.randomness.rosenblatt import covariances_of, known_covariance
from uqmbd.randomness.variable import JointDistribution
from uqmbd.typing import Array

__all__ = ["covariance_of"]

CLOSE = 1e-8
"""Error of total probability and recurrence coefficients, below which a variance from the density is accepted."""

STATED, REFUSED = 1e-6, 1e-3
"""Relative errors of a variance above which a warning states the error, and above which an exception is raised."""

LAST = 200.0
"""Logarithm of the largest integrated distance from the median, in widths of the inner part, of a power law."""


def covariance_of(joint: JointDistribution) -> Array:
    """Return the covariance matrix (n, n) of the variables of a joint distribution.

    An infinite variance is inf, and covariances with dependent variables are then NaN. If the mean does not exist,
    variance and covariances are NaN. Raise StudyError if a quadrature is less accurate than 0.1 %.
    """
    orders = np.array(list(moment_orders(joint.members()).values()))
    unknown = np.where([exists(1, order) for order in orders], np.inf, np.nan)
    if not is_dependent(joint.distribution):
        laws = zip(joint.members(), orders, unknown, strict=True)
        return np.diag([_variance(v.name, v.distribution) if exists(2, order) else no for v, order, no in laws])
    if not exists(2, orders.min()):
        return np.where(np.eye(len(orders), dtype=bool), unknown, np.nan)
    known = known_covariance(joint.distribution, joint.transform)
    return covariances_of(joint.names, joint.transform, joint.means) if known is None else known


def _variance(name: str, distribution: Any) -> float:
    """Return the finite variance of a distribution of one variable."""
    law = replace(AffineDistribution.of(distribution), shift=0.0)
    if law.discrete:
        low, high = law.bounds
        numbers = np.arange(np.ceil(min(low, high)), np.floor(max(low, high)) + 1)
        weights = np.diff(law.cdf(np.r_[numbers[0] - 0.5, numbers + 0.5]))
        weights = weights / weights.sum()
        return float(weights @ (numbers - weights @ numbers) ** 2)
    tail = heaviest_tail(law)
    if tail.power_law:
        return _of_power_law(name, law, tail.index) if law.formula else _continued(name, law, tail.index)
    return _discretised(law)


def _discretised(law: AffineDistribution) -> float:
    """Return the variance from the density between the bounds, or from quantiles if this fails or is inaccurate."""
    import chaospy

    try:
        found = discretise(law, 2)
        if abs(found.mass - 1) < CLOSE and found.change < CLOSE:
            return float(found.scale**2 * found.beta[1])
    except chaospy.UnsupportedFeature:  # the distribution has no density
        pass
    found = discretise_quantiles(law, 2)
    return float(found.scale**2 * found.beta[1])


def _of_power_law(name: str, law: AffineDistribution, index: float) -> float:
    """Return the variance from the density; beyond the inner part, integrate over the logarithm of the distance."""
    from scipy.integrate import quad

    centre, low, high = law.quantile(np.array([0.5, 1e-4, 1 - 1e-4]))
    spread = float(high - low)
    inner = ((np.array([low, high]) - centre) / spread).tolist()

    def moment(order: int) -> tuple[float, float]:
        def weighted(y: float) -> float:
            return float(y**order * law.pdf(np.array([centre + spread * y]))[0] * spread)

        def over_logarithm(s: float, sign: int) -> float:
            return weighted(sign * np.exp(s)) * float(np.exp(s))

        found = [quad(weighted, 0.0, end, limit=400, full_output=1)[:2] for end in inner]
        found[0] = -found[0][0], found[0][1]
        for end, bound, sign in zip(inner, law.bounds, (-1, 1), strict=True):
            edges = sorted({np.log(abs(end)), min(np.log(abs(bound - centre) / spread), LAST), LAST})
            for pair in zip(edges, edges[1:], strict=False):
                found.append(quad(over_logarithm, *pair, args=(sign,), limit=400, full_output=1)[:2])
            last = over_logarithm(LAST, sign) / (index - order)
            found.append((last, abs(last) / 10))
        return sum(value for value, _ in found), sum(error for _, error in found)

    (mass, lost), (first, _), (second, error) = moment(0), moment(1), moment(2)
    return spread**2 * _accurate(name, second - first**2, error + abs(mass - 1) + lost)


def _continued(name: str, law: AffineDistribution, index: float) -> float:
    """Return the variance with a power-law tail beyond the bounds of the density; the error is 10 % of the tail."""
    centre = float(law.quantile(np.array([0.5]))[0])
    far = np.abs(law.quantile(np.array([1e-9, 1 - 1e-9])) - centre)
    ends = np.abs(np.array(law.bounds) - centre)
    beyond = float((1e-9 * (ends / far) ** -index * ends**2 * index / (index - 2)).sum())
    return _accurate(name, _discretised(law) + beyond, beyond / 10)


def _accurate(name: str, variance: float, error: float) -> float:
    """Return a variance; raise StudyError if its error is above 0.1 %."""
    if not error < REFUSED * variance:
        raise StudyError(
            f"Input {name!r}: the computed variance has a relative error of {error / variance:.1g}, because the "
            "distribution has a heavy tail. Truncate it: chaospy.Trunc(distribution, lower, upper)."
        )
    if error > STATED * variance:
        logs.methods.warning("variance of %s: by quadrature, accurate to %.1g", name, error / variance)
    return variance
