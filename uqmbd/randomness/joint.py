"""Joint distribution of all inputs of a study, and a test whether rows of inputs can be samples of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.special

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import natural_order
from uqmbd.randomness.covariances import covariance_of
from uqmbd.randomness.distributions import AffineDistribution, is_dependent
from uqmbd.randomness.rosenblatt import in_blocks
from uqmbd.randomness.variable import JointDistribution, RandomVariable
from uqmbd.typing import Array

__all__ = ["JointInput", "why_not_drawn"]


@typechecked
@dataclass(frozen=True)
class JointInput:
    """All random variables of a mechanism, in one order, with their joint distribution.

    Variables of one `uqmbd.random_vector` are dependent; all others are independent. A study provides this object as
    ``problem.inputs``, and a mechanism as ``mechanism.inputs``; tests of plugins create it by `of`.

    Parameters
    ----------
    variables : tuple of RandomVariable
        Random variables in the order of the columns of every array of inputs.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd.extend import JointInput
    >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
    >>> inputs = JointInput.of([b, a])
    >>> inputs.names, inputs.means.tolist(), inputs.std.round(6).tolist()
    (('a', 'b'), [1.0, 1.0], [0.57735, 3.0])
    >>> inputs.from_uniform(np.array([[0.25, 0.5]]))
    array([[0.5, 1. ]])
    >>> JointInput.of([uqmbd.RandomVariable(f"x_{k}", chaospy.Normal(0, 1)) for k in (10, 9, 1)]).names
    ('x_1', 'x_9', 'x_10')
    """

    variables: tuple[RandomVariable, ...]

    @classmethod
    def of(cls, variables: Iterable[RandomVariable]) -> JointInput:
        """Sort variables by name, with numbers in numerical order, and complete groups of dependent variables.

        Parameters
        ----------
        variables : iterable of RandomVariable
            Random variables; one variable of a dependent group is enough.

        Returns
        -------
        JointInput
            Inputs in the order of studies with these variables.

        Raises
        ------
        uqmbd.StudyError
            If two different variables share a name.
        """
        seen: dict[str, RandomVariable] = {}
        for variable in (member for v in variables for member in v.joint.members()):
            other = seen.setdefault(variable.name, variable)
            if other != variable:
                raise StudyError(
                    f"random variable {variable.name!r} exists twice, as {other.description} and as "
                    f"{variable.description}. Use different names for different quantities, or one object for the "
                    "same quantity."
                )
        return cls(tuple(sorted(seen.values(), key=lambda v: natural_order(v.name))))

    def replaced(self, variables: Iterable[RandomVariable]) -> JointInput:
        """Return the inputs with some variables replaced by others of the same names and units.

        Parameters
        ----------
        variables : iterable of RandomVariable
            Replacements.

        Returns
        -------
        JointInput
            Inputs in the same order.

        Raises
        ------
        uqmbd.StudyError
            If a name is unknown, units differ, or only a part of a dependent group is replaced.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.extend import JointInput
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
        >>> JointInput.of([a, b]).replaced([uqmbd.RandomVariable("b", chaospy.Normal(1.5, 0.1))]).means
        array([1. , 1.5])
        """
        given = JointInput.of(variables)
        own = {v.name: v for v in self.variables}
        for new in given.variables:
            if new.name not in own:
                known = ", ".join(map(repr, self.names)) or "none"
                raise StudyError(f"the replaced input {new.name!r} does not exist; the inputs are: {known}.")
            old = own[new.name]
            if new.units != old.units:
                raise StudyError(
                    f"the input {new.name!r} has the units {old.units or 'no units'!r}, but its replacement has "
                    f"{new.units or 'no units'!r}; expected the same units."
                )
            if missing := sorted(set(old.joint.names) - set(given.names)):
                raise StudyError(
                    f"the replaced input {new.name!r} depends on the input {missing[0]!r}, which is not replaced. "
                    "Replace all dependent inputs together."
                )
        return JointInput.of({**own, **{v.name: v for v in given.variables}}.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names, in order."""
        return tuple(v.name for v in self.variables)

    @property
    def units(self) -> tuple[str, ...]:
        """Units, in order."""
        return tuple(v.units for v in self.variables)

    @property
    def descriptions(self) -> tuple[str, ...]:
        """Distributions as text, in order."""
        return tuple(v.description for v in self.variables)

    def __len__(self) -> int:
        return len(self.variables)

    @cached_property
    def means(self) -> Array:
        """Expectations, shape ``(input,)``."""
        return np.array([v.mean for v in self.variables], dtype=float)

    @cached_property
    def covariance(self) -> Array:
        """Covariance matrix, shape ``(input, input)``, in products of the units.

        Covariances come from closed forms for vectors, else from quadrature. Errors are below 1e-6 of the standard
        deviations, or a log message states them. A variance that does not exist is infinite, or NaN if the mean does
        not exist.

        Raises
        ------
        uqmbd.StudyError
            If an error is above 0.1 % of the standard deviations.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.extend import JointInput
        >>> k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]))
        >>> JointInput.of([k, c]).covariance.tolist()  # in the order of the names: c, k
        [[0.01, 0.05], [0.05, 1.0]]
        """
        found = np.zeros((len(self), len(self)))
        for group, columns in self._groups():
            found[np.ix_(columns, columns)] = covariance_of(group)
        return found

    @property
    def std(self) -> Array:
        """Standard deviations, shape ``(input,)``: square roots of the diagonal of :attr:`covariance`."""
        return np.sqrt(np.diag(self.covariance))

    def _groups(self) -> Iterator[tuple[JointDistribution, list[int]]]:
        """Yield each joint distribution with the columns of its variables."""
        for group in {id(v.joint): v.joint for v in self.variables}.values():
            yield group, [self.names.index(name) for name in group.names]

    def from_uniform(self, uniform: Array) -> Array:
        """Map independent uniform numbers to inputs by the inverse Rosenblatt transform.

        Parameters
        ----------
        uniform : array, shape (sample, input)
            Numbers from 0 to 1. For 0 and 1 the inputs are finite as well, in the far tails of their distributions.

        Returns
        -------
        array, shape (sample, input)
            Inputs with their joint distribution. Appending rows does not change the bits of the first rows.

        Raises
        ------
        uqmbd.StudyError
            If the array has another shape, or numbers outside 0 to 1.
        """
        uniform = np.asarray(uniform, dtype=float)
        if uniform.ndim != 2 or uniform.shape[1] != len(self):
            raise StudyError(f"uniform numbers have shape {uniform.shape}; expected (samples, {len(self)}).")
        if not ((uniform >= 0) & (uniform <= 1)).all():
            raise StudyError("uniform numbers are NaN or outside 0 to 1; expected numbers between 0 and 1.")
        values = np.empty_like(uniform)
        for group, columns in self._groups():
            if is_dependent(group.distribution):
                values[:, columns] = group.transform.inverse(uniform[:, columns])
                continue
            laws = [AffineDistribution.of(v.distribution) for v in group.members()]
            if any(law.mends for law in laws):
                for column, law in zip(columns, laws, strict=True):
                    quantiles = law.quantile(uniform[:, column])
                    values[:, column] = np.rint(quantiles) if law.discrete else quantiles
            elif len(columns) == 1:
                mapped = np.ravel(group.distribution.inv(uniform[:, columns[0]]))
                # chaospy's discrete distributions invert to a continuous number around each integer
                whole = getattr(group.distribution, "interpret_as_integer", False)
                values[:, columns[0]] = np.rint(mapped) if whole else mapped
            else:
                mapped = in_blocks(group.distribution.inv, uniform[:, columns], 0.5)
                single = np.array([law.discrete for law in laws])
                values[:, columns] = np.where(single, np.rint(mapped), mapped)
        return values


CHANCE = 1e-9
"""Probability that the test rejects samples of the inputs."""

MOST = 2**14
"""Largest number of tested rows; a random subset of more rows is tested."""

MOST_DEPENDENT = 2**11
"""Largest number of tested rows of dependent inputs, whose transform is slow."""

TAILS = (1e-4, 1e-3, 1e-2, 0.05)
"""Probabilities of both tails together; nodes that fill the space are too frequent in these tails."""

REPEATS = 3
"""Rows that may share a value of a continuous input by chance; pick-freeze designs repeat values once per input."""


def why_not_drawn(inputs: JointInput, values: Array) -> str:
    """Return why rows (K, I) are not samples of the inputs, as a sentence without full stop; else an empty text.

    The tests of each input are the Kolmogorov-Smirnov test, counts in its tails, and a search for repeated values.
    Dependent inputs are tested after the Rosenblatt transform. The tests do not detect weights, dependence between
    independent inputs, or anything in fewer than about thirty rows.
    """
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) > MOST:
        values = values[np.sort(np.random.default_rng(0).choice(len(values), MOST, replace=False))]
    for name, below, upto, own in _probabilities(inputs, values):
        most = int(np.unique(own, return_counts=True)[1].max(initial=0))
        if most > max(len(inputs), REPEATS) and (upto - below).max() < 1e-6:
            return f"a value of the continuous input {name!r} occurs in {most} of {len(own)} rows"
        for chance, test in (
            (_kolmogorov(below, upto), "a test of Kolmogorov and Smirnov"),
            (len(TAILS) * min(_tail(below, upto, share) for share in TAILS), "a test of the number in the tails"),
        ):
            if chance < CHANCE / (2 * len(inputs)):
                return (
                    f"the values of the input {name!r} in {len(own)} rows do not have its distribution "
                    f"(p = {chance:.1g} in {test})"
                )
    return ""


def _probabilities(inputs: JointInput, values: Array) -> Iterator[tuple[str, Array, Array, Array]]:
    """Yield name, probabilities below and up to each value (K,), and values of each independent variable."""
    for group in {id(v.joint): v.joint for v in inputs.variables}.values():
        rows = values[:, [inputs.names.index(name) for name in group.names]]
        if not is_dependent(group.distribution):
            for variable, own in zip(group.members(), rows.T, strict=True):
                law = AffineDistribution.of(variable.distribution)
                half = 0.5 if law.discrete else 1e-9 * float(np.subtract(*law.quantile(np.array([0.75, 0.25]))))
                if half < np.spacing(np.abs(own).max(initial=0.0)):  # rounding repeats values
                    half = float(np.spacing(np.abs(own).max()))
                yield variable.name, law.cdf(own - half), law.cdf(own + half), own
        elif group.transform.invertible and not any(group.transform.law.discrete):
            uniform = group.transform.forward(rows[:MOST_DEPENDENT])
            known = np.isfinite(uniform).all(axis=1)
            if known.mean() > 0.99:
                yield from ((name, u, u, u) for name, u in zip(group.names, uniform[known].T, strict=True))


def _kolmogorov(below: Array, upto: Array) -> float:
    """Return the p-value of the Kolmogorov-Smirnov statistic, or an upper limit above 1e-3; atoms make it conservative.

    The one-sided distribution gives small p-values exactly. The import of `scipy.stats`, which has the two-sided one,
    would take a tenth of the time of a short run.
    """
    if not len(upto):
        return 1.0
    order = np.argsort(upto)
    # equal values share the first and the last of their ranks
    first = np.searchsorted(upto[order], upto[order], side="left") / len(upto)
    last = np.searchsorted(upto[order], upto[order], side="right") / len(upto)
    distance = max(np.abs(last - upto[order]).max(), np.abs(first - below[order]).max())
    limit = 2 * math.exp(-2 * len(upto) * distance**2)  # Dvoretzky, Kiefer, Wolfowitz and Massart
    if len(upto) > 1000 and limit > 1e-3:  # the distribution takes 0.1 s for 20 000 rows
        return min(1.0, limit)
    return min(1.0, 2 * float(scipy.special.smirnov(len(upto), min(distance, 1.0))))


def _tail(below: Array, upto: Array, share: float) -> float:
    """Return the probability that samples have at least as many rows in both tails of total probability `share`."""
    found = int(((upto <= share / 2) | (below >= 1 - share / 2)).sum())
    return float(scipy.special.bdtrc(found - 1, len(upto), share))
