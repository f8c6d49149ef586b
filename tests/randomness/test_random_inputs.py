"""Random variables and their joint distribution, against scipy.stats and the laws that samples must obey."""

from __future__ import annotations

import pickle

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy

import uqmbd
from uqmbd.randomness import JointInput

PAIRS = {
    "uniform": (chaospy.Uniform(-1, 3), scipy.stats.uniform(-1, 4)),
    "normal": (chaospy.Normal(0.15, 0.003), scipy.stats.norm(0.15, 0.003)),
    "lognormal": (chaospy.LogNormal(0.2, 0.3), scipy.stats.lognorm(0.3, scale=np.exp(0.2))),
    "beta": (chaospy.Beta(2, 5, 1, 3), scipy.stats.beta(2, 5, loc=1, scale=2)),
    "gamma": (chaospy.Gamma(2, 3), scipy.stats.gamma(2, scale=3)),
    "exponential": (chaospy.Exponential(2), scipy.stats.expon(scale=2)),
    "triangle": (chaospy.Triangle(0, 1, 4), scipy.stats.triang(0.25, 0, 4)),
    "truncated": (chaospy.TruncNormal(-1, 2, 0, 1), scipy.stats.truncnorm(-1, 2)),
}


@pytest.mark.parametrize(("ours", "theirs"), PAIRS.values(), ids=PAIRS)
def test_inverse_transform_and_mean(ours, theirs):
    variable = uqmbd.RandomVariable("x", ours)
    uniform = np.array([1e-6, 0.01, 0.3, 0.5, 0.77, 0.999])
    values = JointInput.of([variable]).from_uniform(uniform[:, None])
    assert values.shape == (6, 1)
    assert values[:, 0] == pytest.approx(theirs.ppf(uniform), rel=1e-7)
    assert variable.mean == pytest.approx(theirs.mean(), rel=1e-7)


def test_heavy_tails_have_a_median_instead_of_a_mean():
    """The expectation does not exist; chaospy returns 4e13 for the Pareto distribution."""
    for distribution in (chaospy.Cauchy(1, 3), chaospy.Pareto1(0.5), chaospy.Levy()):
        variable = uqmbd.RandomVariable("x", distribution)
        assert variable.mean == pytest.approx(float(distribution.inv(0.5)), rel=1e-9)
    skewed = uqmbd.RandomVariable("x", chaospy.LogNormal(0, 2))
    assert skewed.mean == pytest.approx(np.exp(2), rel=1e-6)


def test_columns_are_in_the_order_of_the_names():
    b, a = uqmbd.RandomVariable("b", chaospy.Uniform(0, 1)), uqmbd.RandomVariable("a", chaospy.Uniform(10, 20))
    joint = JointInput.of([b, a, b])
    assert joint.names == ("a", "b") and len(joint) == 2
    assert joint.from_uniform(np.array([[0.5, 0.25]])) == pytest.approx(np.array([[15, 0.25]]))
    assert joint.means == pytest.approx([15, 0.5])


def test_dependent_variables_have_the_covariance_that_was_asked_for():
    covariance = np.array([[1.0, 0.05], [0.05, 0.01]])
    k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], covariance), ["N/m", "N s/m"])
    joint = JointInput.of([k])  # one member brings the other
    assert joint.names == ("c", "k") and joint.units == ("N s/m", "N/m")
    uniform = scipy.stats.qmc.Sobol(2, seed=1).random(2**14)
    values = joint.from_uniform(np.clip(uniform, 1e-12, 1 - 1e-12))
    assert values.mean(axis=0) == pytest.approx([1, 10], abs=2e-3)
    assert np.cov(values.T) == pytest.approx(covariance[::-1, ::-1], abs=2e-3)


def test_further_rows_do_not_change_the_first_ones():
    x, y = uqmbd.random_vector(["x", "y"], chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]]))
    joint = JointInput.of([x, y, uqmbd.RandomVariable("z", chaospy.Beta(2, 3))])
    uniform = np.random.default_rng(3).random((2500, 3))
    together = joint.from_uniform(uniform)
    for count in (1, 31, 64, 1024, 1100):
        assert np.array_equal(together[:count], joint.from_uniform(uniform[:count]))


@pytest.mark.parametrize("shape", [(3,), (4, 1), (2, 2, 2)])
def test_uniform_numbers_of_another_shape(shape):
    joint = JointInput.of([uqmbd.RandomVariable(n, chaospy.Uniform()) for n in "ab"])
    with pytest.raises(uqmbd.StudyError, match=r"expected \(samples, 2\)"):
        joint.from_uniform(np.full(shape, 0.5))


def test_variables_are_symbols():
    x = uqmbd.RandomVariable("x", chaospy.Uniform(0, 2), units="m")
    assert (x**2).diff(x) == 2 * x and sympy.sin(x).subs(x, 0) == 0 and x.is_real
    assert x.units == "m" and x.description == "Uniform(lower=0, upper=2)"


def test_same_name_but_other_distribution_is_another_variable():
    one, two = (uqmbd.RandomVariable("x", chaospy.Uniform(0, k)) for k in (1, 2))
    assert one != two and len((one + two).free_symbols) == 2
    with pytest.raises(uqmbd.StudyError, match="'x' exists twice, as Uniform.* and as Uniform"):
        JointInput.of([one, two])


def test_members_of_a_vector_say_which_they_are():
    k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]))
    assert k.description == "component 1 of MvNormal(mu=[10, 1], sigma=[[1, 0.05], [0.05, 0.01]])"
    assert JointInput.of([k]).descriptions[0].startswith("component 2 of MvNormal(")


def test_pickling_keeps_identity_within_an_expression():
    k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]), "N/m")
    x = uqmbd.RandomVariable("x", chaospy.Normal(1, 2), units="m")
    copied = pickle.loads(pickle.dumps((k * x + c, x, JointInput.of([k, x]))))
    expression, symbol, joint = copied
    assert symbol in expression.free_symbols
    assert {s.name: s.units for s in expression.free_symbols} == {"k": "N/m", "c": "N/m", "x": "m"}
    uniform = np.array([[0.2, 0.3, 0.4]])
    assert np.array_equal(joint.from_uniform(uniform), JointInput.of([k, x]).from_uniform(uniform))


WRONG = {
    "a class": (lambda: uqmbd.RandomVariable("x", chaospy.Normal), "is the class chaospy.Normal; expected an object with parameters"),
    "a number": (lambda: uqmbd.RandomVariable("x", 3.0), "the distribution is 3.0 (float); expected a chaospy distribution"),
    "a kernel density of scipy": (lambda: uqmbd.RandomVariable("x", scipy.stats.gaussian_kde([1.0, 2.0, 4.0])), "expected a chaospy distribution"),
    "none": (lambda: uqmbd.RandomVariable("x", None), "the distribution is None"),
    "joint": (lambda: uqmbd.RandomVariable("x", chaospy.MvNormal([0, 0], np.eye(2))), "has 2 dimensions; expected 1: for dependent variables use uqmbd.random_vector"),
    "no name": (lambda: uqmbd.RandomVariable("", chaospy.Normal()), "the name is empty"),
    "slash": (lambda: uqmbd.RandomVariable("a/b", chaospy.Normal()), "cannot contain '/'"),
    "time": (lambda: uqmbd.RandomVariable("time", chaospy.Normal()), "reserved for the time axis"),
    "turned round": (lambda: uqmbd.RandomVariable(chaospy.Normal(), "x"), "expected a string as the first argument"),
    "units": (lambda: uqmbd.RandomVariable("x", chaospy.Normal(), units=3), "random variable 'x': units is 3"),
    "vector of too many": (lambda: uqmbd.random_vector(["a"], chaospy.MvNormal([0, 0], np.eye(2))), "use uqmbd.random_vector|has 2 dimensions, expected 1"),
    "vector of too few": (lambda: uqmbd.random_vector(["a", "b", "c"], chaospy.MvNormal([0, 0], np.eye(2))), "expected 3: give one name for each dimension"),
    "vector of one name": (lambda: uqmbd.random_vector("ab", chaospy.MvNormal([0, 0], np.eye(2))), "names is the string 'ab'"),
    "vector with a name twice": (lambda: uqmbd.random_vector(["a", "a"], chaospy.MvNormal([0, 0], np.eye(2))), "the name 'a' occurs twice"),
    "vector with units": (lambda: uqmbd.random_vector(["a", "b"], chaospy.MvNormal([0, 0], np.eye(2)), ["m"]), "1 units are given for 2 names"),
    "vector of a class": (lambda: uqmbd.random_vector(["a", "b"], chaospy.MvNormal), "is the class chaospy.MvNormal"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "words"), WRONG.values(), ids=WRONG)
def test_what_is_no_random_variable(make, words):
    with pytest.raises(uqmbd.StudyError) as caught:
        make()
    assert any(choice in str(caught.value) for choice in words.split("|")), str(caught.value)


def test_discrete_distributions_give_whole_numbers_as_often_as_declared():
    teeth = uqmbd.RandomVariable("teeth", chaospy.DiscreteUniform(20, 23))
    values = JointInput.of([teeth]).from_uniform(np.random.default_rng(0).random((4000, 1)))[:, 0]
    numbers, counts = np.unique(values, return_counts=True)
    assert numbers.tolist() == [20, 21, 22, 23]
    assert np.abs(counts / 4000 - 0.25).max() < 4 * np.sqrt(0.25 * 0.75 / 4000)
