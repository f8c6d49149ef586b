"""Random variables in expressions: SymPy symbols with a distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.special
import sympy

from uqmbd.arguments import typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.names import check_name, check_units, checked
from uqmbd.randomness.rosenblatt import NotUnderstood, Transform, means_of, rewritten, supports_of
from uqmbd.randomness.symbolic import Symbol, Symbolic
from uqmbd.randomness.tolerances import stated_tolerance
from uqmbd.typing import Distribution

__all__ = ["JointDistribution", "RandomVariable", "random_vector", "uniform_variable"]


@dataclass(frozen=True, eq=False)
class JointDistribution:
    """Distribution of one or more dependent variables with their names; all members of a group share it."""

    distribution: Any
    names: tuple[str, ...]
    units: tuple[str, ...]
    key: bool = False
    """Whether the variable is the key of sampled paths, on which no result depends smoothly."""

    @cached_property
    def means(self) -> np.ndarray:
        """Expectations, shape ``(dimension,)``."""
        from uqmbd.randomness.distributions import is_dependent

        if not is_dependent(self.distribution):
            return np.concatenate([mean_of(variable.distribution) for variable in self.members()])
        if _moments_known(self.distribution):
            return mean_of(self.distribution)
        return means_of(self.names, self.transform, lambda distribution: float(mean_of(distribution)[0]))

    @cached_property
    def transform(self) -> Transform:
        """Rosenblatt transform of dependent variables."""
        return Transform.of(self.distribution)

    @cached_property
    def bounds(self) -> np.ndarray:
        """Intervals that contain all values, shape ``(dimension, 2)``; a far finite end may replace an infinite one."""
        from uqmbd.randomness.distributions import is_dependent

        if not is_dependent(self.distribution) or self.transform.gaussian:
            ends = [(v.distribution.lower, v.distribution.upper) for v in self.members()]
            return np.array([[float(np.ravel(end)[0]) for end in pair] for pair in ends])
        return supports_of(self.transform.law)

    @cached_property
    def separated(self) -> tuple[JointDistribution, ...]:
        """Distribution of the other variables, then of each discrete variable that is independent of all others.

        Without such discrete variables, this distribution is the only element. Variables keep their names. Raise
        StudyError if such a variable takes values that are not whole numbers.
        """
        import chaospy

        from uqmbd.randomness.distributions import is_dependent

        if not isinstance(self.distribution, chaospy.J) or not is_dependent(self.distribution):
            return (self,)
        law, owners = self.transform.law, self.distribution._owners
        alone = {k for k in owners if len(owners[k][1]) == 1 and law.discrete[k] and self.transform.alone(k)}
        if not alone:
            return (self,)
        rest = sorted(set(owners) - alone)
        others = list({id(owners[k][1]): owners[k][1] for k in rest}.values())
        parts = [JointDistribution(others[0] if len(others) == 1 else chaospy.J(*others), *self._labels(rest))]
        for k in sorted(alone):
            try:
                parts.append(JointDistribution(rewritten(owners[k][1]), *self._labels([k])))
            except StudyError as error:
                raise StudyError(f"Input {self.names[k]!r}: {error}.") from None
        return tuple(parts)

    def _labels(self, rows: Sequence[int]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return tuple(self.names[k] for k in rows), tuple(self.units[k] for k in rows)

    def members(self) -> tuple[RandomVariable, ...]:
        """Return all variables of the group."""
        return tuple(RandomVariable._member(self, i) for i in range(len(self.names)))


class RandomVariable(Symbolic, Symbol):
    """A scalar with a probability distribution, usable in any SymPy expression.

    Parameters
    ----------
    name : str
        Name of the variable in data, plots and messages.
    distribution : uqmbd.typing.Distribution
        One-dimensional distribution: of chaospy, of ``scipy.stats`` (a frozen distribution or one of the newer
        infrastructure), or of OpenTURNS. The attribute `distribution` is always a distribution of chaospy.
    units : str
        Units, such as ``m``, ``N m``, or ``1`` for a pure number. Units are checked where the variable is used
        (``docs/how-to/units.md``), and never converted. The default is the units of a size of `uqmbd.iso286`, otherwise
        any units.

    Raises
    ------
    uqmbd.StudyError
        If the name is invalid, if the distribution is invalid or not one-dimensional, or if it states other units.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    >>> (2 * length).diff(length)
    2
    >>> round(length.mean, 12)
    1.0
    >>> import scipy.stats
    >>> uqmbd.RandomVariable("stiffness", scipy.stats.weibull_min(2, scale=3), units="N/m").description
    'scipy.stats.weibull_min(2, scale=3)'
    """

    units: str
    distribution: Any
    joint: JointDistribution
    component: int

    @checked
    def __new__(cls, name: str, distribution: Distribution = None, units: str = "") -> RandomVariable:
        """Check the arguments."""
        where = f"random variable {check_name(name, 'random variable')!r}"
        distribution = _checked_distribution(where, distribution, 1)
        check_units(units, where)
        stated = stated_tolerance(distribution)
        if stated is not None and stated.units and units not in ("", stated.units):
            raise StudyError(
                f"{where}: units is {units!r}, but {distribution} is in {stated.units}. Define the size in the units "
                "of the mechanism, e.g. uqmbd.iso286(0.030, 'H7', units='m'); uqmbd does not convert the units of a "
                "tolerance."
            )
        return cls._member(JointDistribution(distribution, (name,), (units or (stated.units if stated else ""),)), 0)

    if not TYPE_CHECKING:  # the arguments are those of ``__new__``

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            """Accept the arguments of ``__new__``, which constructs the symbol."""

    @classmethod
    def _member(cls, joint: JointDistribution, component: int) -> RandomVariable:
        self: RandomVariable = sympy.Symbol.__xnew__(cls, joint.names[component], real=True)
        self.units = joint.units[component]
        self.joint = joint
        self.component = component
        self.distribution = joint.distribution if len(joint.names) == 1 else joint.distribution[component]
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        if self.joint.key:  # keys of one name are equal: they choose the same paths
            return (*super()._hashable_content(), "key")
        # SymPy's cache must not exchange two variables of one name with different distributions.
        return (*super()._hashable_content(), id(self.joint), self.component)

    def __reduce__(self) -> tuple[Any, ...]:
        return (RandomVariable._member, (self.joint, self.component))

    @property
    def mean(self) -> float:
        """Expectation of the distribution, which deterministic simulations use."""
        return float(self.joint.means[self.component])

    @property
    def is_key(self) -> bool:
        """Whether the variable is the key of sampled paths (`uqmbd.extend.path_key`)."""
        return self.joint.key

    @property
    def description(self) -> str:
        """Distribution as text, such as ``Normal(mu=0.15, sigma=0.003)`` or ``component 1 of MvNormal(...)``."""
        if self.is_key:
            return "key of a sampled path"
        if len(self.joint.names) == 1:
            return str(self.distribution)
        return f"component {self.component + 1} of {self.joint.distribution}"

    def _repr_html_(self) -> str | None:
        """Return the distribution, units and density, for notebooks."""
        return html_of(self)


@checked
def random_vector(
    names: Sequence[str], distribution: Distribution, units: str | Sequence[str] = ""
) -> tuple[RandomVariable, ...]:
    """Return dependent random variables of one joint distribution.

    Parameters
    ----------
    names : sequence of str
        Names of the variables, one for each dimension of the distribution.
    distribution : uqmbd.typing.Distribution
        Joint distribution, such as ``chaospy.MvNormal(mean, covariance)``. The function also accepts
        ``scipy.stats.multivariate_normal`` with its parameters, and distributions of OpenTURNS with a normal copula or
        independent components.
    units : str or sequence of str
        Units of all variables, or of each variable.

    Returns
    -------
    tuple of RandomVariable
        Random variables in the order of `names`.

    Raises
    ------
    uqmbd.StudyError
        If the number of names differs from the dimension of the distribution.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]), ["N/m", "N s/m"])
    >>> k.mean, c.units
    (10.0, 'N s/m')
    """
    if isinstance(names, str):
        raise StudyError(
            f"random_vector: names is the string {names!r}; expected a sequence with one name for each variable."
        )
    if not isinstance(names, Sequence):
        raise StudyError(f"random_vector: names is {names!r}; expected a sequence with one name for each variable.")
    names = tuple(check_name(name, "random_vector, one of names") for name in names)
    where = f"random_vector {names}"
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise StudyError(
            f"{where}: the name {twice[0]!r} occurs twice; expected a different name for each random variable."
        )
    distribution = _checked_distribution(where, distribution, len(names))
    if not isinstance(units, (str, Sequence)):
        raise StudyError(
            f"{where}: units is {units!r}; expected one string for all variables, or a sequence with one string for "
            "each variable."
        )
    given = (units,) * len(names) if isinstance(units, str) else units
    unit = tuple(check_units(x, where) for x in given)
    if len(unit) != len(names):
        raise StudyError(
            f"{where}: {len(unit)} units are given for {len(names)} names; expected one for each name, or one for all."
        )
    return JointDistribution(distribution, names, unit).members()


@typechecked
def uniform_variable(name: str, lower: float, upper: float, units: str = "") -> RandomVariable:
    """Return a uniformly distributed random variable without an import of chaospy.

    Parameters
    ----------
    name : str
        Name of the variable.
    lower, upper : float
        Ends of the interval, in `units`.
    units : str
        Units of the variable.

    Returns
    -------
    RandomVariable
        Uniform random variable.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, as for `RandomVariable`.

    Examples
    --------
    >>> uniform_variable("length", 0.9, 1.1, "m").description
    'Uniform(lower=0.9, upper=1.1)'
    """
    import chaospy

    return RandomVariable(name, chaospy.Uniform(lower, upper), units)


def _checked_distribution(where: str, given: Distribution, dimension: int) -> Any:
    """Return a valid distribution of chaospy with the given dimension; raise StudyError for other arguments."""
    import chaospy

    from uqmbd.randomness.distributions import adopt_distribution, flaw_of, is_dependent

    distribution = adopt_distribution(where, given)
    if isinstance(distribution, type) and issubclass(distribution, chaospy.Distribution):
        kind = f"chaospy.{distribution.__name__}"
        raise StudyError(
            f"{where}: the distribution is the class {kind}; expected an object with parameters, e.g. "
            "chaospy.Normal(0.15, 0.003)."
        )
    if not isinstance(distribution, chaospy.Distribution):
        raise StudyError(
            f"{where}: the distribution is {distribution!r} ({type(distribution).__name__}); expected a chaospy "
            "distribution, e.g. chaospy.Normal(0.15, 0.003), or a distribution of scipy.stats or OpenTURNS."
        )
    if len(distribution) != dimension:
        count = f"{len(distribution)} dimension{'s' * (len(distribution) != 1)}"
        remedy = (
            "for dependent variables use uqmbd.random_vector(names, distribution)"
            if dimension == 1
            else "give one name for each dimension"
        )
        raise StudyError(f"{where}: the distribution has {count}; expected {dimension}: {remedy}.")
    try:
        distribution = rewritten(distribution)
    except StudyError as error:
        raise StudyError(f"{where}: {error}.") from None
    flaw = _flaw_of_joint(where, distribution) if is_dependent(distribution) else flaw_of(distribution)
    if flaw:
        raise StudyError(
            f"{where}: {distribution} is not a valid distribution: {flaw}. Check its parameters: standard "
            "deviations, scales and shapes must be positive, and lower limits below upper limits. Use a plain "
            "number for a constant."
        )
    return distribution


def _flaw_of_joint(where: str, distribution: Any) -> str:
    """Return why a distribution of dependent variables is invalid; empty if it is valid.

    Raise StudyError if the structure cannot be evaluated.
    """
    import chaospy

    from uqmbd.randomness.distributions import flaw_of

    try:
        if isinstance(distribution, chaospy.CopulaDistribution) and (
            flaw := flaw_of(rewritten(distribution._parameters["dist"]))
        ):
            return flaw
        transform = Transform.of(distribution)
        return flaw_of(distribution) if transform.gaussian else transform.flaw()
    except NotUnderstood as part:
        raise StudyError(
            f"{where}: the joint distribution {distribution} is not supported: conditional quantiles of {part} are "
            "unknown, or chaospy computes them by a random search that a seed does not reproduce. Expected copulas, "
            "chaospy.J of distributions (their parameters may be numbers, other variables of J, or arithmetic of "
            "these), MvNormal, MvLogNormal, MvStudentT and GaussianMixture. Or declare independent random "
            "variables, and define dependent quantities as expressions of them."
        ) from None
    except StudyError as error:
        raise StudyError(f"{where}: {error}.") from None
    except Exception as error:  # any exception, because chaospy has no common class for bad parameters
        text = " ".join(str(error).split())
        return f"chaospy cannot sample it ({text or type(error).__name__})"


def _moments_known(distribution: Any) -> bool:
    """Return whether means of dependent variables are known, as for normal vectors and marginals of a copula."""
    import chaospy

    from uqmbd.randomness.distributions import is_dependent

    if isinstance(distribution, chaospy.CopulaDistribution):
        return not is_dependent(distribution._parameters["dist"])
    if not isinstance(distribution, (chaospy.MvNormal, chaospy.MvLogNormal)):
        return False
    return not any(isinstance(x, chaospy.Distribution) for x in distribution._parameters.values())


def mean_of(distribution: Any) -> np.ndarray:
    """Return the expectation of a chaospy distribution, shape ``(dimension,)``.

    The result is the median if a distribution has no mean because of heavy tails. For such a distribution, chaospy
    returns some number (4e13 for a Pareto distribution) that contradicts the quantiles.
    """
    import chaospy

    from uqmbd.randomness.distributions import AffineDistribution, heaviest_tail, is_dependent
    from uqmbd.randomness.germs import discretise, discretise_quantiles

    if isinstance(distribution, chaospy.CopulaDistribution):
        # chaospy has no moments of dependent variables; a copula does not change the moments of its marginals
        marginals = distribution._parameters["dist"]
        if not is_dependent(marginals):
            return np.concatenate([mean_of(rewritten(marginals[k])) for k in range(len(marginals))])
    if len(distribution) > 1 and not is_dependent(distribution):
        return np.concatenate([mean_of(d) for d in distribution])
    if len(distribution) == 1:
        law = AffineDistribution.of(distribution)
        if law.cut is None and law.mends:
            return law.shift + law.scale * mean_of(law.core)
        if law.cut is not None and heaviest_tail(law).moments > 1:
            found = discretise(law, 2)
            return np.array([found.shift + found.scale * found.alpha[0]])
    with np.errstate(all="ignore"):
        value = np.atleast_1d(np.asarray(chaospy.E(distribution), dtype=float))
    plausible = np.isfinite(value).all()
    if plausible and len(distribution) == 1:
        normal = np.linspace(-5, 5, 401)
        weight = np.exp(-(normal**2) / 2)
        quantiles = np.ravel(distribution.inv(scipy.special.ndtr(normal)))
        spread = quantiles[normal >= 0.6745][0] - quantiles[normal <= -0.6745][-1]
        plausible = abs(quantiles @ weight / weight.sum() - value[0]) <= 0.2 * spread + 1e-9 * abs(value[0])
    if not np.isfinite(value).all() and len(distribution) == 1 and not heaviest_tail(law).power_law:
        found = discretise_quantiles(law, 2)  # chaospy's formula overflows, as for Chi(400)
        value = np.array([found.shift + found.scale * found.alpha[0]])
    elif not plausible:
        value = np.atleast_1d(np.asarray(distribution.inv(np.full(len(distribution), 0.5)), dtype=float))
    return np.ravel(value)
