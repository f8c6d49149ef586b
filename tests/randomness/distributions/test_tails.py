"""Distributions without finite moments are refused with a remedy; heavy tails that have them all are not."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats

import uqmbd
from uqmbd.randomness import GermSpace, JointInput, gauss_tensor
from uqmbd.randomness.distributions.decomposed import AffineDistribution
from uqmbd.randomness.distributions.tails import heaviest_tail

INFINITE = {
    "Cauchy": (chaospy.Cauchy(1, 3), 1),
    "Cauchy, folded": (chaospy.FoldedCauchy(1), 1),
    "Student 1": (chaospy.StudentT(1), 1),
    "Student 3": (chaospy.StudentT(3, 5, 2), 3),
    "Student 4": (chaospy.StudentT(4), 4),
    "Pareto": (chaospy.Pareto1(3), 3),
    "Pareto 2": (chaospy.Pareto2(2), 2),
    "Levy": (chaospy.Levy(), 0.5),
    "F": (chaospy.F(3, 6), 3),
    "Burr": (chaospy.Burr(1, 2), 2),
    "Fisk": (chaospy.Fisk(3), 3),
    "log-Laplace": (chaospy.LogLaplace(2), 2),
    "inverse gamma": (chaospy.InverseGamma(2), 2),
    "extreme value": (chaospy.GeneralizedExtreme(-0.3), 1 / 0.3),
    "scaled": (3 - 2 * chaospy.Cauchy(), 1),
    "truncated on the wrong side": (chaospy.Trunc(chaospy.StudentT(3), lower=0), 3),
}


@pytest.mark.parametrize(("distribution", "order"), INFINITE.values(), ids=INFINITE)
def test_no_finite_moments(distribution, order):
    tail = heaviest_tail(AffineDistribution.of(distribution))
    assert tail.power_law and tail.moments == pytest.approx(order, rel=0.05)
    inputs = JointInput.of([uqmbd.RandomVariable("gap", distribution), uqmbd.RandomVariable("ok", chaospy.Normal())])
    with pytest.raises(uqmbd.StudyError, match=r"Input 'gap'.*Use a sampling method.*or truncate it: chaospy\.Trunc"):
        GermSpace.of(inputs)
    assert np.isfinite(inputs.from_uniform(np.array([[0.3, 0.4]]))).all()  # Monte Carlo works


def test_no_finite_moments_of_dependent_inputs():
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvStudentT(3, [0, 0], [[1, 0.5], [0.5, 2]]))
    with pytest.raises(uqmbd.StudyError, match="Input 'a, b', MvStudentT.*Use a sampling method"):
        GermSpace.of(JointInput.of([a, b]))
    c, d = uqmbd.random_vector(
        ["c", "d"], chaospy.Nataf(chaospy.J(chaospy.Cauchy(), chaospy.Uniform()), [[1, 0.5], [0.5, 1]])
    )
    with pytest.raises(uqmbd.StudyError, match="Input 'c', Cauchy.*Use a sampling method"):
        GermSpace.of(JointInput.of([c, d]))


ALL_MOMENTS = {
    "normal": (chaospy.Normal(5, 2), "hermite", "affine"),
    "lognormal": (chaospy.LogNormal(0, 2), "hermite", "exponential"),
    "Weibull 2": (chaospy.Weibull(2), "stieltjes", "affine"),
    "Weibull 1/2": (chaospy.Weibull(0.5), "stieltjes", "affine"),
    "exponential": (chaospy.Exponential(3), "laguerre", "affine"),
    "Laplace": (chaospy.Laplace(), "stieltjes", "affine"),
    "truncated Cauchy": (chaospy.Trunc(chaospy.Cauchy(), -5, 5), "stieltjes", "affine"),
    # all moments, but polynomials do not converge
    "Weibull 0.3": (chaospy.Weibull(0.3), "hermite", "quantile"),
    "power lognormal": (chaospy.PowerLogNormal(1, 1), "hermite", "quantile"),
    # the moments that statistics need
    "Student 6": (chaospy.StudentT(6), "hermite", "quantile"),
    "Student 30": (chaospy.StudentT(30), "hermite", "quantile"),
}


@pytest.mark.parametrize(("distribution", "family", "kind"), ALL_MOMENTS.values(), ids=ALL_MOMENTS)
def test_finite_moments(distribution, family, kind):
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", distribution)]))
    assert (space.germs[0].family, space.groups[0].marginals[0].kind) == (family, kind)


def test_moments_of_student_through_a_normal_germ():
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", chaospy.StudentT(12, 5, 2))]))
    rule = gauss_tensor(space, 40)
    x = space.to_inputs(rule.nodes)[:, 0]
    law = scipy.stats.t(12, 5, 2)
    assert rule.weights @ x == pytest.approx(law.mean(), rel=1e-9)
    assert rule.weights @ (x - 5) ** 2 == pytest.approx(law.var(), rel=1e-5)
