"""Conversion of distributions of scipy.stats and OpenTURNS to distributions of chaospy.

A family with classical polynomials becomes the same family of chaospy, which provides the polynomials. Any other
distribution is wrapped, and its package evaluates it. The package of an object is determined without imports.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.randomness.distributions.sources import DistributionSource, Frozen, Infrastructure, OpenTurns

__all__ = ["adopt_distribution", "distribution_of"]


PROBE = np.array([1e-6, 1e-3, 0.05, 0.25, 0.5, 0.75, 0.95, 0.999, 1 - 1e-6])
"""Probabilities at which a translated family is compared with the original."""

OF_DATA = {"rv_histogram", "rv_sample"}
"""Distributions of scipy that are constructed from data and need no parameters."""

Parameters = Mapping[str, float]

FAMILIES: Mapping[str, Callable[[Any, Parameters], Any]] = {
    # scipy.stats.rv_continuous: shapes, loc and scale
    "norm": lambda c, p: c.Normal(p["loc"], p["scale"]),
    "uniform": lambda c, p: c.Uniform(p["loc"], p["loc"] + p["scale"]),
    "beta": lambda c, p: c.Beta(p["a"], p["b"], p["loc"], p["loc"] + p["scale"]),
    "arcsine": lambda c, p: c.Beta(0.5, 0.5, p["loc"], p["loc"] + p["scale"]),
    "gamma": lambda c, p: c.Gamma(p["a"], p["scale"], p["loc"]),
    "expon": lambda c, p: c.Exponential(p["scale"], p["loc"]),
    "chi2": lambda c, p: c.Gamma(p["df"] / 2, 2 * p["scale"], p["loc"]),
    "lognorm": lambda c, p: c.LogNormal(np.log(p["scale"]), p["s"], p["loc"]),
    # scipy.stats of the newer infrastructure
    "StandardNormal": lambda c, p: c.Normal(0.0, 1.0),
    "scipy Normal": lambda c, p: c.Normal(p["mu"], p["sigma"]),
    "scipy Uniform": lambda c, p: c.Uniform(p["a"], p["b"]),
    # OpenTURNS
    "Normal": lambda c, p: c.Normal(p["mu_0"], p["sigma_0"]),
    "Uniform": lambda c, p: c.Uniform(p["a"], p["b"]),
    "Beta": lambda c, p: c.Beta(p["alpha"], p["beta"], p["a"], p["b"]),
    "Arcsine": lambda c, p: c.Beta(0.5, 0.5, p["a"], p["b"]),
    "Gamma": lambda c, p: c.Gamma(p["k"], 1 / p["lambda"], p["gamma"]),
    "Exponential": lambda c, p: c.Exponential(1 / p["lambda"], p["gamma"]),
    "ChiSquare": lambda c, p: c.Gamma(p["nu"] / 2, 2.0),
    "LogNormal": lambda c, p: c.LogNormal(p["muLog"], p["sigmaLog"], p["gamma"]),
}
"""Families with classical polynomials, and functions of a normal variable, by their names in each package."""


def adopt_distribution(where: str, distribution: Any) -> Any:
    """Convert a distribution of scipy.stats or OpenTURNS to chaospy; return any other argument unchanged.

    Distributions of scipy.stats are frozen, or belong to its new infrastructure. `where` begins each message. Raise
    StudyError for missing parameters, arrays of distributions, discrete values that are not whole numbers, or a
    dependence that cannot be converted.

    >>> import scipy.stats
    >>> adopt_distribution("here", scipy.stats.norm(0.15, 0.003))
    Normal(mu=0.15, sigma=0.003)
    >>> adopt_distribution("here", scipy.stats.weibull_min(2, scale=3))
    scipy.stats.weibull_min(2, scale=3)
    >>> adopt_distribution("here", "normal")
    'normal'
    """
    kind = distribution if isinstance(distribution, type) else type(distribution)
    bases = {(base.__module__, base.__name__) for base in kind.__mro__}
    names = {name for module, name in bases if module.startswith("scipy.stats")}
    if names & {"rv_generic", "rv_frozen", "_ProbabilityDistribution"}:
        _require_parameters(where, distribution, names)
        if "rv_generic" in names:  # from data, without parameters
            return distribution_of(where, Frozen(distribution), f"scipy.stats.{kind.__name__}(...)")
        return _of_frozen(where, distribution) if "rv_frozen" in names else _of_infrastructure(where, distribution)
    if "multivariate_normal_frozen" in names:
        import chaospy

        return chaospy.MvNormal(np.asarray(distribution.mean), np.asarray(distribution.cov_object.covariance))
    if "multivariate_t_frozen" in names:
        import chaospy

        return chaospy.MvStudentT(float(distribution.df), np.asarray(distribution.loc), np.asarray(distribution.shape))
    if "multi_rv_frozen" in names or "multi_rv_generic" in names:
        raise StudyError(
            f"{where}: the distribution is {kind.__name__} of scipy.stats; multivariate distributions of scipy.stats "
            "can only be multivariate_normal(mean, covariance) and multivariate_t(loc, shape, df). Construct others "
            "from marginal distributions by chaospy.Nataf(chaospy.J(...), correlation)."
        )
    if any(module.startswith("openturns.") and name == "DistributionImplementation" for module, name in bases) or (
        kind.__module__.startswith("openturns.") and hasattr(kind, "computeQuantile")
    ):
        return _of_openturns(where, distribution)
    return distribution


def _require_parameters(where: str, distribution: Any, names: set[str]) -> None:
    """Raise StudyError for a class, or for a family of scipy without parameters."""
    if isinstance(distribution, type):
        text = f"the class scipy.stats.{distribution.__name__}"
        example = "scipy.stats.Normal(mu=0.15, sigma=0.003)"
    elif "rv_generic" in names and not names & OF_DATA:
        text = f"scipy.stats.{distribution.name} without parameters"
        example = f"scipy.stats.{distribution.name}({'..., ' if distribution.numargs else ''}loc=0.15, scale=0.003)"
    else:
        return
    raise StudyError(f"{where}: the distribution is {text}; expected an object with parameters, e.g. {example}.")


def _of_frozen(where: str, given: Any) -> Any:
    family, shapes = given.dist, given.args[: given.dist.numargs]
    names = [name.strip() for name in (family.shapes or "").split(",") if name.strip()]
    moved = dict(zip(("loc", "scale"), given.args[family.numargs :], strict=False))
    parameters = {"loc": 0.0, "scale": 1.0, **dict(zip(names, shapes, strict=False)), **moved, **given.kwds}
    name = type(family).__name__ if type(family).__name__ in OF_DATA else family.name
    text = f"scipy.stats.{name}({_arguments(given.args, given.kwds) or '...'})"
    several = {name: np.shape(x) for name, x in parameters.items() if np.size(x) != 1}
    if several:
        name, shape = next(iter(several.items()))
        raise StudyError(
            f"{where}: the distribution is {text}, whose {name} has the shape {shape}; expected one number. Declare "
            "several variables as several random variables."
        )
    numbers = {name: float(np.ravel(x)[0]) for name, x in parameters.items()}
    if hasattr(given, "pmf"):
        return distribution_of(where, Frozen(given), text)
    if found := _translated(Frozen(given), family.name, numbers):
        return found
    shift, scale = numbers.pop("loc"), numbers.pop("scale")
    if (shift, scale) == (0.0, 1.0) or not (np.isfinite(shift) and 0 < scale < np.inf):
        return distribution_of(where, Frozen(given), text)
    from uqmbd.randomness.distributions.wrapped import MovedDistribution, WrappedDistribution

    # avoids the loss of digits if the mean is much larger than the deviation
    standard = WrappedDistribution(Frozen(family(**numbers)), text)
    return MovedDistribution(standard, shift, scale, text)


def _of_infrastructure(where: str, given: Any) -> Any:
    text = _shortened(f"{given} of scipy.stats")
    if np.size(given.median()) != 1:
        raise StudyError(
            f"{where}: the distribution is {text}, a distribution of several variables (shape "
            f"{np.shape(given.median())}); "
            "expected one variable. Declare several variables as several random variables."
        )
    source = Infrastructure(given)
    name = type(given).__name__
    own = name if name == "StandardNormal" else f"scipy {name}"
    if not source.discrete and own in FAMILIES:
        numbers = {key: float(getattr(given, key)) for key in ("mu", "sigma", "a", "b") if hasattr(given, key)}
        if found := _translated(source, own, numbers):
            return found
    return distribution_of(where, source, text)


def _of_openturns(where: str, given: Any) -> Any:
    if isinstance(given, type):
        raise StudyError(
            f"{where}: the distribution is the class openturns.{given.__name__}; expected an object with parameters, "
            "e.g. openturns.Normal(0.15, 0.003)."
        )
    if given.getDimension() > 1:
        return _coupled(where, given)
    text, source = _shortened(f"openturns.{given}"), OpenTurns(given)
    family = (given.getImplementation() if hasattr(given, "getImplementation") else given).getClassName()
    if not source.discrete and family in FAMILIES:
        numbers = dict(zip(given.getParameterDescription(), map(float, given.getParameter()), strict=True))
        if found := _translated(source, family, numbers):
            return found
    return distribution_of(where, source, text)


def _coupled(where: str, given: Any) -> Any:
    """Convert a joint distribution of OpenTURNS with a Gaussian copula or independent variables."""
    import chaospy

    marginals = [_of_openturns(where, given.getMarginal(k)) for k in range(given.getDimension())]
    if given.hasIndependentCopula():
        return chaospy.J(*marginals)
    copula = given.getCopula()
    kind = (copula.getImplementation() if hasattr(copula, "getImplementation") else copula).getClassName()
    if kind != "NormalCopula":
        raise StudyError(
            f"{where}: the distribution {given} has the copula {kind} of OpenTURNS; expected NormalCopula, or no "
            "copula. For other copulas use chaospy, e.g. chaospy.Clayton(chaospy.J(...), 2)."
        )
    if all(type(m).__name__ == "Normal" for m in marginals):
        return chaospy.MvNormal(list(given.getMean()), np.array(given.getCovariance()))
    return chaospy.Nataf(chaospy.J(*marginals), np.array(copula.getShapeMatrix()))


def _translated(source: DistributionSource, family: str, parameters: Parameters) -> Any:
    """Return chaospy's distribution of a family; None if chaospy lacks it or its quantiles differ."""
    import chaospy

    make = FAMILIES.get(family)
    if make is None:
        return None
    with np.errstate(all="ignore"):
        try:
            found, theirs = make(chaospy, parameters), source.quantile(PROBE)
            ours = np.asarray(found.inv(PROBE), dtype=float)
        except Exception:  # the wrapper reports invalid parameters
            return None
        slack = 1e-9 * np.ptp(theirs) + 1e-14 * np.abs(theirs).max()
        return found if np.abs(ours - theirs).max() <= slack else None


def distribution_of(where: str, source: DistributionSource, text: str) -> Any:
    """Return a distribution of chaospy that evaluates `source` and is printed as `text`."""
    from uqmbd.randomness.distributions.wrapped import WholeNumbers, WrappedDistribution

    if not source.discrete:
        return WrappedDistribution(source, text)
    try:
        return WholeNumbers(source, text)
    except StudyError as error:
        raise StudyError(f"{where}: the distribution is {text}: {error}.") from None


def _shortened(text: str) -> str:
    """Shorten a text to one line of at most 100 characters for tables; kernel densities print all of their data."""
    return textwrap.shorten(text, 100, placeholder=" ...")


def _arguments(args: Sequence[Any], keywords: Mapping[str, Any]) -> str:
    return ", ".join([f"{x!r}" for x in args] + [f"{name}={x!r}" for name, x in keywords.items()])
