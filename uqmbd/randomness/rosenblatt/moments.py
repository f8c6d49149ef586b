"""Means and covariances of dependent variables, from closed forms or by quadrature over the transform."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.special

from uqmbd import logs
from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import tail_of
from uqmbd.randomness.rosenblatt.atoms import atoms_of
from uqmbd.randomness.rosenblatt.conditionals import AffineConditional, Conditional, Core, Spanned
from uqmbd.randomness.rosenblatt.expressions import Expression, MemberValue, evaluated, used
from uqmbd.randomness.rosenblatt.laws import AffineJoint, Chain, Copulated, JointLaw, Single
from uqmbd.randomness.rosenblatt.transform import Transform
from uqmbd.randomness.rosenblatt.vectors import NormalMixture, Vector
from uqmbd.typing import Array

__all__ = ["covariances_of", "known_covariance", "means_of"]


COUNTS = (6, 9, 13, 19, 28, 41, 60, 88, 130)
"""Numbers of nodes of the Gauss rule per variable, tried in turn until two rules agree."""

MOST = 2**18
"""Largest number of points of a rule."""

CLOSE = 1e-8
"""Difference of two rules, relative to the standard deviation, up to which they agree."""

STATED, REFUSED = 1e-6, 1e-3
"""Errors, relative to the standard deviation, that are logged, and that raise StudyError."""

REPLICATES, SAMPLES = 8, 2**13
"""Replicates and points of a scrambled Sobol' sequence, if a rule has too many points."""

MeanOf = Callable[[Any], float]
"""Function that returns the mean of a univariate distribution of chaospy."""


def means_of(names: tuple[str, ...], transform: Transform, mean_of: MeanOf) -> Array:
    """Return the means of the components of a joint distribution, shape (n,).

    Components without a mean get their value at the medians of all variables. `mean_of` returns the mean of a
    univariate distribution of chaospy whose parameters are numbers. Raise StudyError if a quadrature is less
    accurate than 0.1 % of the standard deviation.
    """
    known = _Means(transform.law, mean_of)
    for k in transform.law.order:
        if known.of(k) is None:
            known.found[k] = _integrated(names, transform, k)
    return np.array([known.of(k) for k in range(len(names))], dtype=float)


def known_covariance(distribution: Any, transform: Transform) -> Array | None:
    """Return the covariances (n, n) of vectors and mixtures from their parameters; None for other distributions."""
    import chaospy

    law, given = transform.law, distribution._parameters
    if isinstance(distribution, (chaospy.MvNormal, chaospy.MvLogNormal)) and transform.gaussian:
        exponential = isinstance(distribution, chaospy.MvLogNormal)
        matrix = np.asarray(given["sigma" if exponential else "covariance"], dtype=float)
        if not exponential:
            return matrix
        means = np.exp(np.asarray(given["mu"], dtype=float) + np.diag(matrix) / 2)
        return np.asarray(np.outer(means, means) * np.expm1(matrix))
    if isinstance(law, NormalMixture):
        away = law.centres - law.weights @ law.centres
        parts = law.factors @ law.factors.transpose(0, 2, 1) + away[:, :, None] * away[:, None, :]
        return np.asarray(np.tensordot(law.weights, parts, 1))
    if isinstance(law, Vector) and not law.exponential and not any(map(used, law.centre)):
        square = law.factor @ law.factor.T
        return np.asarray(square if np.isinf(law.freedom) else square * law.freedom / (law.freedom - 2))
    return None


def covariances_of(names: tuple[str, ...], transform: Transform, means: Array) -> Array:
    """Return the covariances (n, n) of the components of a joint distribution, by quadrature.

    Raise StudyError if a covariance is less accurate than 0.1 % of the standard deviations.
    """
    count = transform.dimension
    found, errors, scales = np.zeros((count, count)), np.zeros((count, count)), np.ones((count, count))
    columns = [transform.law.given[k] | {k} for k in range(count)]
    for i in range(count):
        for j in range(i + 1):
            if columns[i] & columns[j]:
                found[i, j], errors[i, j], scales[i, j] = _product_by_rules(
                    transform, columns[i] | columns[j], means, i, j
                )
    if not (errors <= STATED * scales).all():
        sampled, uncertain = _products_by_samples(transform, means)
        better = np.tril(~(errors <= np.maximum(uncertain, STATED * scales)))
        found, errors = np.where(better, sampled, found), np.where(better, uncertain, errors)
        spread = np.sqrt(np.diag(found))
        scales = np.where(better, np.outer(spread, spread), scales)
    relative = np.tril(errors / scales)
    worst = tuple(int(k) for k in np.unravel_index(np.argmax(relative), relative.shape))
    if not relative.max() <= REFUSED:
        raise StudyError(
            f"random_vector {names}: the error of the computed covariance of {names[worst[0]]!r} and "
            f"{names[worst[1]]!r} is {relative.max():.2g} of their standard deviations. The distribution is not "
            "smooth or has a heavy tail. Declare independent random variables, and define the dependent ones as "
            "expressions of them."
        )
    if relative.max() > STATED:
        logs.methods.warning("covariances of %s: by quadrature, accurate to %.1g", ", ".join(names), relative.max())
    return np.tril(found) + np.tril(found, -1).T


class _Means:
    """Means that follow from the means of single variables by the linearity of expectations."""

    def __init__(self, law: JointLaw, mean_of: MeanOf, larger: _Means | None = None) -> None:
        self._law, self._mean_of, self._larger = law, mean_of, larger
        self.found: dict[int, float | None] = {}

    def of(self, k: int) -> float | None:
        """Return the mean of a component; None if linearity does not determine it."""
        if k not in self.found:
            self.found[k] = self._within(self._law, k)
        return self.found[k]

    def _within(self, law: JointLaw, k: int) -> float | None:
        if isinstance(law, Chain) and law is not self._law:  # expressions of a chain refer to its own members
            return _Means(law, self._mean_of, self).of(k)
        if isinstance(law, Chain):
            step = next(step for step in law.steps if k in step.columns)
            return self._within(step.law, step.columns.index(k))
        if isinstance(law, Single):
            return self._of_one(law.law)
        if isinstance(law, NormalMixture):
            return float(law.weights @ law.centres[:, k])
        if isinstance(law, AffineJoint):
            inner, shift = self._within(law.inner, k), self._expected(law.shift[k])
            scale = self._expected(law.scale[k]) if not used(law.scale[k]) else None
            return None if inner is None or shift is None or scale is None else shift + scale * inner
        if isinstance(law, Copulated):  # a copula does not change the distributions of independent components
            return None if any(law.margins.given) or law.margins.outer else self._within(law.margins, k)
        if isinstance(law, Vector) and not law.exponential:
            return self._expected(law.centre[k])
        if isinstance(law, Vector) and isinstance(law.centre[k], float):
            return float(np.exp(law.centre[k] + (law.factor[k] ** 2).sum() / 2))
        return None

    def _of_one(self, law: Conditional) -> float | None:
        if isinstance(law, Core) and not law.given:
            return self._mean_of(law.family)
        if isinstance(law, AffineConditional) and not law.inner.given:
            parts = (self._expected(law.shift), self._expected(law.scale), self._of_one(law.inner))
            shift, scale, inner = parts
            return None if shift is None or scale is None or inner is None else shift + scale * inner
        if isinstance(law, Spanned) and not law.inner.given:
            lower, upper, inner = self._expected(law.lower), self._expected(law.upper), self._of_one(law.inner)
            if lower is None or upper is None or inner is None:
                return None
            low, high = (float(end[0]) for end in law.inner.ends(np.empty((0, 1))))
            share = (inner - low) / (high - low)
            return lower * (1 - share) + upper * share
        return None

    def _expected(self, expression: Expression) -> float | None:
        if isinstance(expression, float):
            return expression
        if isinstance(expression, MemberValue):
            outside = self._law.outside if isinstance(self._law, Chain) else 0
            if expression.place < outside:
                return None if self._larger is None else self._larger.of(expression.place)
            return self.of(expression.place - outside)
        if not used(expression):
            return float(evaluated(expression, np.empty((0, 1))))
        left, right = self._expected(expression.left), self._expected(expression.right)
        if left is None or right is None:
            return None
        if expression.kind == "sum":
            return left + right
        if expression.kind == "product" and not (used(expression.left) and used(expression.right)):
            return left * right
        return None


def _integrated(names: tuple[str, ...], transform: Transform, k: int) -> float:
    if _without_mean(transform, k):
        return float(transform.inverse(np.full((1, len(names)), 0.5))[0, k])
    mean, error, spread = _by_rules(transform, k)
    if not error <= REFUSED * spread:
        mean, error, spread = _by_samples(transform, k)
    if not error <= REFUSED * spread:
        raise StudyError(
            f"random_vector {names}: the error of the computed mean of {names[k]!r} is {error:.2g}, for a standard "
            f"deviation of about {spread:.2g}. Its conditional distribution is not smooth or has a heavy tail. "
            f"Declare the variables on which {names[k]} depends as random variables, and write {names[k]} as an "
            "expression of them."
        )
    if error > STATED * spread:
        logs.methods.warning("mean of %s: %.6g by quadrature, accurate to %.1g", names[k], mean, error)
    return mean


def _without_mean(transform: Transform, k: int) -> bool:
    """Return whether tails of a component are too heavy for a mean, at any of three probabilities of the others."""
    if transform.law.discrete[k]:
        return False
    for level in (0.05, 0.5, 0.95):

        def conditional(u: Array, level: float = level) -> Array:
            rows = np.full((len(u), transform.dimension), level)
            rows[:, k] = u
            return transform.inverse(rows)[:, k]

        tail = tail_of(conditional)
        if tail.power_law and tail.moments <= 1.02:
            return True
    return False


def _by_rules(transform: Transform, k: int) -> tuple[float, float, float]:
    """Return the mean, its error and the standard deviation by Gauss rules with increasing numbers of nodes."""
    columns = transform.law.given[k] | {k}
    last: float | None = None
    result = (np.nan, np.inf, 1.0)
    for count in COUNTS:
        points = _expanded(transform.law, columns, *_normal_rule(count))
        if points is None:
            break
        x, p = points[0][k], points[1]
        mean = float(p @ x)
        spread = _spread(x, p)
        if last is not None:
            result = (mean, abs(mean - last), spread)
            if result[1] <= CLOSE * spread:
                break
        last = mean
    return result


def _product_by_rules(
    transform: Transform, columns: frozenset[int], means: Array, i: int, j: int
) -> tuple[float, float, float]:
    """Return the covariance of two components, its error and the product of their deviations, by Gauss rules."""
    last: float | None = None
    result = (0.0, np.inf, 1.0)
    for count in COUNTS:
        points = _expanded(transform.law, columns, *_normal_rule(count))
        if points is None:
            break
        x, p = points[0] - means[:, None], points[1]
        value, scale = float(p @ (x[i] * x[j])), float(np.sqrt((p @ x[i] ** 2) * (p @ x[j] ** 2)))
        if last is not None:
            result = (value, abs(value - last), scale)
            if result[1] <= CLOSE * scale:
                break
        last = value
    return result


def _products_by_samples(transform: Transform, means: Array) -> tuple[Array, Array]:
    """Return the covariances (n, n) and twice their standard errors, by scrambled Sobol' sequences."""
    from scipy.stats import qmc

    parts = []
    for seed in range(REPLICATES):
        uniform = np.clip(qmc.Sobol(transform.dimension, seed=seed).random(SAMPLES), 1e-12, 1 - 1e-12)
        x = transform.inverse(uniform) - means
        parts.append(x.T @ x / SAMPLES)
    return np.mean(parts, axis=0), 2 * np.std(parts, axis=0, ddof=1) / np.sqrt(REPLICATES)


def _normal_rule(count: int) -> tuple[Array, Array]:
    """Return uniform nodes (count,) of a Gauss rule over the probit scale, and weights of sum 1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return np.clip(scipy.special.ndtr(nodes), 1e-16, 1 - 2.0**-53), weights / weights.sum()


def _expanded(law: JointLaw, columns: frozenset[int], u: Array, weights: Array) -> tuple[Array, Array] | None:
    """Return points (n, N) and weights (N,) of a tensor rule in some components; None if impossible or too large."""
    steps = law.steps if isinstance(law, Chain) else None
    x, p = np.zeros((len(law.order), 1)), np.ones(1)
    if steps is None:
        if any(law.discrete):
            return None
        return _tensor(x, p, law, tuple(range(len(law.order))), sorted(columns), u, weights)
    for step in steps:
        inside = [k for k, column in enumerate(step.columns) if column in columns]
        if not inside:
            continue
        if isinstance(step.law, Single) and step.law.law.discrete:
            single = atoms_of(step.law.law, x)
            if single is None or single[0].size > MOST:
                return None
            x, p = np.tile(x, len(single[0])), (p * single[1]).ravel()
            x[step.columns[0]] = single[0].ravel()
            x, p = x[:, p > 0], p[p > 0]
            continue
        if any(step.law.discrete):
            return None
        found = _tensor(x, p, step.law, step.columns, inside, u, weights)
        if found is None:
            return None
        x, p = found
    return x, p


def _tensor(
    x: Array, p: Array, law: JointLaw, columns: tuple[int, ...], inside: list[int], u: Array, weights: Array
) -> tuple[Array, Array] | None:
    count = len(u) ** len(inside)
    if count * len(p) > MOST:
        return None
    grid = np.stack(np.meshgrid(*[u] * len(inside), indexing="ij")).reshape(len(inside), -1)
    own = np.stack(np.meshgrid(*[weights] * len(inside), indexing="ij")).reshape(len(inside), -1).prod(axis=0)
    x, p = np.repeat(x, count, axis=1), (p[:, None] * own).ravel()
    uniform = np.full((len(columns), x.shape[1]), 0.5)
    uniform[inside] = np.tile(grid, x.shape[1] // count)
    with np.errstate(all="ignore"):
        x[list(columns)] = law.inverse(uniform, x)
    return x, p


def _by_samples(transform: Transform, k: int) -> tuple[float, float, float]:
    """Return the mean, twice its standard error and the standard deviation by scrambled Sobol' sequences."""
    from scipy.stats import qmc

    columns = sorted(transform.law.given[k] | {k})
    means, deviations = [], []
    for seed in range(REPLICATES):
        rows = np.full((SAMPLES, transform.dimension), 0.5)
        rows[:, columns] = np.clip(qmc.Sobol(len(columns), seed=seed).random(SAMPLES), 1e-12, 1 - 1e-12)
        x = transform.inverse(rows)[:, k]
        means.append(x.mean())
        deviations.append(_spread(x, np.full(len(x), 1 / len(x))))
    error = 2 * float(np.std(means, ddof=1)) / np.sqrt(REPLICATES)
    return float(np.mean(means)), error, float(np.mean(deviations))


def _spread(x: Array, p: Array) -> float:
    """Return the standard deviation, or half the range of the inner two thirds if smaller, for heavy tails."""
    deviation = float(np.sqrt(np.maximum(p @ (x - p @ x) ** 2, 0.0)))
    order = np.asarray(np.argsort(x))
    low, high = np.interp(np.array([1 / 6, 5 / 6]), np.cumsum(p[order]), x[order])
    return min(deviation, float(high - low) / 2) if high > low else deviation
