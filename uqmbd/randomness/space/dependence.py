"""Germs of dependent inputs: exact Gaussian copulas, copulas by Nataf's equation, or the Rosenblatt transform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.special

from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.randomness.distributions import Tail, tail_of
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.rosenblatt import Transform
from uqmbd.randomness.space.families import normal_marginal, refuse_tail
from uqmbd.randomness.space.marginals import Marginal
from uqmbd.randomness.space.transforms import CorrelatedTransform, Group, Rosenblatt, conditional_names
from uqmbd.randomness.variable import JointDistribution
from uqmbd.typing import Array

__all__ = ["dependent_part", "nataf_correlation"]


Copula = tuple[tuple[Marginal, ...], Array]
"""Maps of standard normal variables to the inputs, and the correlation of these variables."""


def dependent_part(
    joint: JointDistribution, columns: tuple[int, ...], transform: str
) -> tuple[tuple[Germ, ...], Group]:
    """Return germs and map of dependent inputs, at `columns` of all inputs; see `GermSpace.of`.

    Raise StudyError if moments are infinite, or if Nataf's transform needs marginals or a correlation that are
    unavailable.

    >>> import chaospy
    >>> joint = JointDistribution(chaospy.MvNormal([1, 2], [[4, 3], [3, 9]]), ("a", "b"), ("m", "m"))
    >>> germs, group = dependent_part(joint, (0, 1), "rosenblatt")
    >>> [germ.name for germ in germs], group.factor.round(6).tolist()
    (['a', 'b | a'], [[1.0, 0.0], [0.5, 0.866025]])
    """
    import chaospy

    names, distribution = joint.names, joint.distribution
    transform_, described = joint.transform, str(distribution)
    order = tuple(int(k) for k in transform_.law.order)
    for k, name in enumerate(names):
        if transform_.law.discrete[k]:
            why = (
                "is part of an expression of several variables"
                if transform_.alone(k)
                else "is statistically dependent on other inputs"
            )
            raise StudyError(
                f"Input {name!r}, of {described}, is discrete, and {why}. Surrogates need inputs that are smooth "
                f"functions of independent germs. Use a method without a surrogate{such_as(InputTreatment.SAMPLE)}, or "
                "declare a separate random variable for it, and define dependent quantities as expressions in the "
                "mechanism."
            )
    if isinstance(distribution, chaospy.MvStudentT):
        freedom = float(np.ravel(distribution._dist._owners[0][1]._parameters["a"])[0])
        refuse_tail(", ".join(names), described, Tail(freedom, 1.0))
    copula = _gaussian_copula(names, distribution, transform_, order)
    if copula is None and transform == "nataf":
        copula = _nataf(names, distribution, transform_)
    if copula is not None:
        return _coupled(names, copula, columns, order)
    return _rosenblatt(names, distribution, transform_, columns)


def nataf_correlation(first: Marginal, second: Marginal, correlation: float) -> float:
    """Solve Nataf's equation for the correlation of two standard normal variables whose images have `correlation`.

    By Mehler's formula, the double integral over the bivariate normal density is a power series in the unknown
    correlation. A Gauss-Hermite rule gives the Hermite coefficients of the two maps (Liu and Der Kiureghian, Probab.
    Eng. Mech. 1 (1986) 105; Xiao, Struct. Saf. 49 (2014) 33). Raise StudyError if no Gaussian copula gives that
    correlation.
    """
    from scipy.optimize import brentq

    hermite = Germ.classical("z", "hermite")
    nodes, weights = hermite.gauss(64)
    psi = hermite.polynomials(nodes, 30)[:, 1:]
    series = np.ones(psi.shape[1])
    for marginal in (first, second):
        values = marginal.to_input(nodes)
        centred = values - weights @ values
        series = series * ((weights * centred) @ psi) / np.sqrt(weights @ centred**2)
    powers = np.arange(1, len(series) + 1)

    def miss(rho: float) -> float:
        return float(series @ rho**powers) - correlation

    if miss(-1.0) > 0 or miss(1.0) < 0:
        raise StudyError(
            f"no Gaussian copula gives these marginal distributions the correlation {correlation:.6g} (the possible "
            f"range is {miss(-1.0) + correlation:.6g} to {miss(1.0) + correlation:.6g}); use transform='rosenblatt'."
        )
    return float(brentq(miss, -1.0, 1.0, xtol=1e-15))


def _coupled(
    names: Sequence[str], copula: Copula, columns: tuple[int, ...], order: tuple[int, ...]
) -> tuple[tuple[Germ, ...], Group]:
    marginals, correlation = copula
    sorted_rows = np.ix_(order, order)
    factor = np.zeros_like(correlation)
    try:
        factor[sorted_rows] = np.linalg.cholesky(correlation[sorted_rows])
    except np.linalg.LinAlgError:
        raise StudyError(
            f"The correlation of the inputs {', '.join(names)} is singular or indefinite for a Gaussian copula: "
            f"{correlation.round(6).tolist()}. Omit an input that is a function of the others, or use "
            "transform='rosenblatt'."
        ) from None
    labels = conditional_names(tuple(names), order, factor)
    germs = tuple(Germ.classical(label, "hermite") for label in labels)
    return germs, CorrelatedTransform(columns, marginals, factor, order)


def _rosenblatt(
    names: Sequence[str], distribution: Any, transform: Transform, columns: tuple[int, ...]
) -> tuple[tuple[Germ, ...], Group]:
    normal: list[bool] = []
    for k, name in enumerate(names):

        def conditional(u: Array, k: int = k) -> Array:
            """Return quantiles of one input with the earlier inputs at their medians."""
            uniform = np.full((len(u), len(names)), 0.5)
            uniform[:, k] = u
            return transform.inverse(uniform)[:, k]

        with np.errstate(all="ignore"):
            tail = tail_of(conditional)
        refuse_tail(name, f"a component of {distribution}", tail)
        normal.append(not tail.bounded)
    order, given = transform.law.order, transform.law.given
    depends = np.array([[j in given[k] for j in range(len(names))] for k in range(len(names))])
    labels = conditional_names(tuple(names), order, depends)
    germs = tuple(
        Germ.classical(label, "hermite" if unbounded else "legendre")
        for label, unbounded in zip(labels, normal, strict=True)
    )
    return germs, Rosenblatt(columns, order, tuple(normal), transform)


def _gaussian_copula(
    names: Sequence[str], distribution: Any, transform: Transform, order: tuple[int, ...]
) -> Copula | None:
    """Return marginals and correlation of a Gaussian copula, verified by its values; None for other distributions."""
    import chaospy

    given = distribution._parameters
    if isinstance(distribution, (chaospy.MvNormal, chaospy.MvLogNormal)):
        logarithmic = isinstance(distribution, chaospy.MvLogNormal)
        mean = np.asarray(given["mu" if logarithmic else "mean"], dtype=object)
        covariance = np.asarray(given["sigma" if logarithmic else "covariance"], dtype=object)
        if any(isinstance(v, chaospy.Distribution) for v in (*mean.ravel(), *covariance.ravel())):
            return None
        mean, covariance = np.broadcast_to(mean.astype(float), len(names)), covariance.astype(float)
        deviation = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(deviation, deviation)
        if logarithmic:
            marginals = tuple(
                Marginal("exponential", mu=float(m), sigma=float(s), bounds=(0.0, np.inf))
                for m, s in zip(mean, deviation, strict=True)
            )
        else:
            marginals = tuple(Marginal("affine", float(m), float(s)) for m, s in zip(mean, deviation, strict=True))
    elif isinstance(distribution, chaospy.Nataf):
        inner = _inner_marginals(names, distribution)
        if inner is None:
            return None
        permute = distribution._parameters["trans"]._permute
        marginals, correlation = inner, permute.T @ distribution._parameters["trans"]._correlation @ permute
    else:
        return None
    np.fill_diagonal(correlation, 1.0)
    copula = (marginals, np.asarray(correlation, dtype=float))
    _, group = _coupled(names, copula, tuple(range(len(names))), order)
    uniform = np.random.default_rng(0).uniform(0.02, 0.98, (16, len(names)))
    theirs = transform.inverse(uniform)
    ours = group.to_inputs(scipy.special.ndtri(uniform))
    return copula if np.abs(ours - theirs).max(axis=0).max() <= 1e-6 * np.ptp(theirs, axis=0).min() else None


def _inner_marginals(names: Sequence[str], distribution: Any) -> tuple[Marginal, ...] | None:
    inner = distribution._parameters["dist"]
    if inner.stochastic_dependent:
        return None
    return tuple(normal_marginal(name, inner[k]) for k, name in enumerate(names))


def _nataf(names: Sequence[str], distribution: Any, transform: Transform) -> Copula:
    """Return a Gaussian copula with the marginals and the correlation of a joint distribution."""
    import chaospy

    marginals = _inner_marginals(names, distribution) if isinstance(distribution, chaospy.CopulaDistribution) else None
    if marginals is None:
        raise StudyError(
            f"Nataf's transform needs the marginal distributions of the inputs {', '.join(names)}, which chaospy "
            f"does not provide for {distribution}; use transform='rosenblatt', or declare the inputs with a copula, "
            "e.g. chaospy.Nataf(chaospy.J(...), correlation)."
        )
    target = _correlation(transform)
    correlation = np.eye(len(names))
    for i in range(len(names)):
        for j in range(i):
            try:
                solved = nataf_correlation(marginals[i], marginals[j], target[i, j])
            except StudyError as error:
                raise StudyError(f"Inputs {names[j]!r} and {names[i]!r}: {error}") from error
            correlation[i, j] = correlation[j, i] = solved
    return marginals, correlation


def _correlation(transform: Transform) -> Array:
    """Return the correlation matrix of a joint distribution, by quadrature over its Rosenblatt transform."""
    dimension = transform.dimension
    if dimension <= 3:
        points, rule = Germ.classical("z", "hermite").gauss(40 if dimension == 2 else 20)
        grid = np.stack(np.meshgrid(*[points] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
        weights = np.prod(np.stack(np.meshgrid(*[rule] * dimension, indexing="ij"), axis=-1), axis=-1).ravel()
        uniform = scipy.special.ndtr(grid)
    else:
        from scipy.stats import qmc

        uniform = qmc.Sobol(dimension, seed=0).random(2**14)
        weights = np.full(len(uniform), 1 / len(uniform))
    values = transform.inverse(np.clip(uniform, 1e-12, 1 - 1e-12))
    centred = values - weights @ values
    covariance = centred.T @ (weights[:, None] * centred)
    deviation = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(deviation, deviation), dtype=float)
