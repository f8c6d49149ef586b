"""Means of dependent variables: by the law of total expectation, or by quadrature over their transform."""

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

__all__ = ["means_of"]


COUNTS = (6, 9, 13, 19, 28, 41, 60, 88, 130)
"""Nodes of the Gauss rule for each variable, in turn until two agree."""

MOST = 2**18
"""Points of a rule."""

CLOSE = 1e-8
"""Difference of two rules at which they agree, relative to the standard deviation."""

STATED, REFUSED = 1e-6, 1e-3
"""Errors, relative to the standard deviation, above which a mean is stated with its error, and above which none is."""

REPLICATES, SAMPLES = 8, 2**13
"""Replicates and points of a scrambled Sobol' sequence, if a rule has too many points."""

MeanOf = Callable[[Any], float]
"""Returns the mean of a distribution of chaospy of one variable."""


def means_of(names: tuple[str, ...], transform: Transform, mean_of: MeanOf) -> Array:
    """Return the means of the components of a joint distribution, shape (n,).

    Components without a mean get their value at the medians of all variables. `mean_of` returns the mean of a
    distribution of chaospy of one variable with numbers as parameters. Raise StudyError if a quadrature is less
    accurate than 0.1 % of the standard deviation.
    """
    known = _Means(transform.law, mean_of)
    for k in transform.law.order:
        if known.of(k) is None:
            known.found[k] = _integrated(names, transform, k)
    return np.array([known.of(k) for k in range(len(names))], dtype=float)


class _Means:
    """Means that follow from those of single variables: sums of expectations are expectations of sums."""

    def __init__(self, law: JointLaw, mean_of: MeanOf, larger: _Means | None = None) -> None:
        self._law, self._mean_of, self._larger = law, mean_of, larger
        self.found: dict[int, float | None] = {}

    def of(self, k: int) -> float | None:
        """Return the mean of a component; None where it does not follow."""
        if k not in self.found:
            self.found[k] = self._within(self._law, k)
        return self.found[k]

    def _within(self, law: JointLaw, k: int) -> float | None:
        if isinstance(law, Chain) and law is not self._law:  # its expressions name its own members
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
        if isinstance(law, Copulated):  # a copula leaves distributions as they are that do not depend on each other
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
            f"deviation of about {spread:.2g}. Its distribution given the others is not smooth or has a heavy tail. "
            "Declare the variables that it depends on as random variables, and write it as an expression of them."
        )
    if error > STATED * spread:
        logs.methods.warning("mean of %s: %.6g by quadrature, accurate to %.1g", names[k], mean, error)
    return mean


def _without_mean(transform: Transform, k: int) -> bool:
    """Return whether the tails of a component are too heavy for a mean, at any of some values of the others."""
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
    """Return the mean, its error and the standard deviation by Gauss rules with ever more nodes."""
    columns = transform.law.given[k] | {k}
    last: float | None = None
    result = (np.nan, np.inf, 1.0)
    for count in COUNTS:
        nodes, weights = np.polynomial.hermite_e.hermegauss(count)
        u = np.clip(scipy.special.ndtr(nodes), 1e-16, 1 - 2.0**-53)
        points = _expanded(transform.law, columns, u, weights / weights.sum())
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


def _expanded(law: JointLaw, columns: frozenset[int], u: Array, weights: Array) -> tuple[Array, Array] | None:
    """Return points (n, N) and weights (N,) of a tensor rule in some components; None where there are too many."""
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
    """Return the standard deviation, or half the range of the inner two thirds if that is less: tails may be heavy."""
    deviation = float(np.sqrt(np.maximum(p @ (x - p @ x) ** 2, 0.0)))
    order = np.asarray(np.argsort(x))
    low, high = np.interp(np.array([1 / 6, 5 / 6]), np.cumsum(p[order]), x[order])
    return min(deviation, float(high - low) / 2) if high > low else deviation
