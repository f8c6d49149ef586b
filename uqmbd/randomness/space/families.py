"""Germ and map of an input. The class of a distribution suggests its family, and quantiles verify it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.special

from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import FEWEST, AffineDistribution, Tail, heaviest_tail
from uqmbd.randomness.germs import COUNT, KNOTS, LARGEST, Discretised, Germ, discretise, discretise_quantiles, lanczos
from uqmbd.randomness.space.marginals import Marginal

__all__ = ["independent_part", "normal_marginal", "refuse_tail"]


PROBE = np.array([1e-3, 0.05, 0.25, 0.5, 0.75, 0.95, 0.999])
"""Probabilities at which quantiles verify the family of a distribution."""


def independent_part(name: str, distribution: Any) -> tuple[Germ, Marginal]:
    """Return the germ of an independent input, and the map from the germ to the input.

    Raise StudyError if the distribution has no finite moments, or cannot be evaluated.
    """
    law = checked_law(name, distribution)
    if law.discrete:
        return _discrete(name, law)
    tail = heaviest_tail(replace(law, shift=0.0))
    refuse_tail(name, str(distribution), tail)
    found = _recognised(name, law)
    if found is not None:
        return found
    # the power law of Student's t distribution begins too far out to be measured
    if not tail.polynomial or (law.kind == "student_t" and law.parameters("a")[0] < 2.5 * COUNT):
        return Germ.classical(name, "hermite"), _tabulated(law)
    return _discretised(name, law)


def normal_marginal(name: str, distribution: Any) -> Marginal:
    """Return the map from a standard normal variable to an input: affine or exponential if possible, else a table."""
    law = checked_law(name, distribution)
    if law.discrete:
        raise StudyError(
            f"Input {name!r} has only integer values; inputs with integer values cannot depend on other inputs."
        )
    refuse_tail(name, str(distribution), heaviest_tail(law))
    found = _recognised(name, law)
    if found is not None and found[0].family == "hermite":
        return found[1]
    return _tabulated(law)


def refuse_tail(name: str, description: str, tail: Tail) -> None:
    """Raise StudyError if moments that statistics need are infinite."""
    if tail.power_law and tail.index <= FEWEST * 1.02:
        raise StudyError(
            f"Input {name!r}, {description}, has a tail so heavy that its moments of order {max(tail.index, 0):.2g} "
            "and above are infinite. It has neither a complete set of orthogonal polynomials nor a finite kurtosis. "
            "Use a sampling method, whose quantiles are valid, or truncate it: "
            "chaospy.Trunc(distribution, lower, upper)."
        )


def checked_law(name: str, distribution: Any) -> AffineDistribution:
    """Decompose a distribution; raise StudyError if it cannot be evaluated or is inconsistent."""
    try:
        law = AffineDistribution.of(distribution)
        quantiles = law.quantile(PROBE)
        back = law.cdf(quantiles)
    except Exception as error:
        raise StudyError(
            f"Input {name!r}: chaospy cannot evaluate the distribution {distribution} "
            f"({type(error).__name__}: {error}). Write the arithmetic as an expression in random "
            "variables in the mechanism, not in the distribution."
        ) from error
    if law.discrete:
        if (law.shift, law.scale) != (0.0, 1.0):
            raise StudyError(
                f"Input {name!r}, {distribution}: chaospy treats the result of arithmetic with a distribution of "
                "whole numbers as continuous. Declare the distribution without arithmetic, and write the arithmetic "
                "into the mechanism."
            )
    elif not (np.all(np.diff(quantiles) > 0) and np.allclose(back, PROBE, atol=1e-6, rtol=0)):
        raise StudyError(
            f"Input {name!r}: the distribution {distribution} is inconsistent: F(Q(p)) for p = {PROBE.tolist()} is "
            f"{back.round(6).tolist()}, or the quantiles Q(p) do not increase. If the distribution results from "
            "arithmetic with distributions, write this arithmetic in the mechanism, with random variables."
        )
    return law


def _recognised(name: str, law: AffineDistribution) -> tuple[Germ, Marginal] | None:
    """Return germ and map of a lognormal distribution or a family of Askey's scheme, if quantiles agree; else None."""
    kind, shift, scale = law.kind, law.shift, law.scale
    if kind == "normal":
        germ, marginal = Germ.classical(name, "hermite"), Marginal("affine", shift, abs(scale))
    elif kind == "log_normal":
        (sigma,) = law.parameters("a")
        bounds = (shift, np.inf) if scale > 0 else (-np.inf, shift)
        germ = Germ.classical(name, "hermite")
        mu = float(np.log(abs(scale)))
        marginal = Marginal("exponential", shift, float(np.sign(scale)), mu, sigma * np.sign(scale), bounds)
    elif kind in ("uniform", "beta_"):
        low, high = law.bounds
        if kind == "uniform":
            germ = Germ.classical(name, "legendre")
        else:
            germ = Germ.classical(name, "jacobi", *law.parameters("a", "b")[:: 1 if scale > 0 else -1])
        marginal = Marginal("affine", (low + high) / 2, (high - low) / 2, bounds=(low, high))
    elif kind == "gamma" or (kind == "chi_squared" and law.parameters("nc") == (0.0,)):
        factor = 1.0 if kind == "gamma" else 2.0
        shape = law.parameters("a")[0] if kind == "gamma" else law.parameters("df")[0] / 2
        germ = Germ.classical(name, "laguerre", shape)
        bounds = (shift, np.inf) if scale > 0 else (-np.inf, shift)
        marginal = Marginal("affine", shift, factor * scale, bounds=bounds)
    else:
        return None
    falls = marginal.kind == "affine" and marginal.scale < 0
    ours = marginal.to_input(germ.from_uniform(1 - PROBE if falls else PROBE))
    theirs = law.quantile(PROBE)
    slack = 1e-8 * np.ptp(theirs) + 1e-14 * np.abs(theirs).max()
    return (germ, marginal) if np.abs(ours - theirs).max() <= slack else None


def _discretised(name: str, law: AffineDistribution) -> tuple[Germ, Marginal]:
    # without shift and scale, a mean that is large compared with the deviation costs no digits
    core = replace(law, shift=0.0, scale=float(np.sign(law.scale)))
    found = _best_discretisation(core)
    shift, scale = law.shift + abs(law.scale) * found.shift, abs(law.scale) * found.scale
    low, high = (shift + scale * end for end in found.bounds)
    quantiles = _tabulated(core).table
    assert quantiles is not None
    table = np.array([KNOTS, (quantiles[1] - found.shift) / found.scale])
    germ = Germ(name, "stieltjes", found.alpha, found.beta, (), found.bounds, table)
    return germ, Marginal("affine", shift, scale, bounds=(low, high))


def _best_discretisation(law: AffineDistribution) -> Discretised:
    import chaospy

    try:
        found = discretise(law)
        if abs(found.mass - 1) < 1e-8 and found.change < 1e-8:
            return found
    except chaospy.UnsupportedFeature:
        pass
    return discretise_quantiles(law, COUNT // 2)


def _tabulated(law: AffineDistribution) -> Marginal:
    """Return a table of quantiles over the probit scale."""
    uniform = np.minimum(scipy.special.ndtr(KNOTS), LARGEST)
    low, high = law.bounds
    values = law.far_quantile(uniform)
    if not np.isfinite(values).all():
        values = law.quantile(uniform)
    values = np.maximum.accumulate(values)
    bounds = (low if values[0] >= low else -np.inf, high if values[-1] <= high else np.inf)
    return Marginal("quantile", bounds=bounds, table=np.array([KNOTS, values]))


def _discrete(name: str, law: AffineDistribution) -> tuple[Germ, Marginal]:
    low, high = law.bounds
    numbers = np.arange(np.ceil(low), np.floor(high) + 1)
    steps = law.cdf(np.r_[numbers[0] - 0.5, numbers + 0.5])
    probability = np.diff(steps)
    numbers, probability = numbers[probability > 1e-18], probability[probability > 1e-18]
    probability = probability / probability.sum()
    shift, scale = (numbers[0] + numbers[-1]) / 2, max((numbers[-1] - numbers[0]) / 2, 0.5)
    values = (numbers - shift) / scale
    alpha, beta = lanczos(values, probability, min(len(values), COUNT))
    table = np.array([np.cumsum(probability), values])
    germ = Germ(name, "discrete", alpha, beta, (), (float(values[0]), float(values[-1])), table)
    return germ, Marginal("affine", float(shift), float(scale), bounds=(float(numbers[0]), float(numbers[-1])))
