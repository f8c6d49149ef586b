"""A distribution that no random number has is refused where it is given; every one that exists is accepted."""

from __future__ import annotations

import inspect
import re

import chaospy
import chaospy.distributions.collection as collection
import numpy as np
import pytest

import uqmbd

NEEDED = {
    "Beta": {"alpha": 2, "beta": 3},
    "Binomial": {"size": 5, "prob": 0.4},
    "DiscreteUniform": {"lower": 1, "upper": 4},
    "GeneralizedGamma": {"shape1": 2, "shape2": 2},
    "GeneralizedHalfLogistic": {"shape": 0.5},
    "Gompertz": {"shape": 1},
    "InverseGamma": {"shape": 3},
    "Kumaraswamy": {"alpha": 2, "beta": 3},
    "PERT": {"lower": 0, "mode": 0.4, "upper": 1},
    "Reciprocal": {"lower": 1, "upper": 2},
}
SLOW = ("GeneralizedExponential", "Wald")  # chaospy looks for their quantiles step by step
LEVELS = np.linspace(0.02, 0.98, 7)


def families():
    for name, made in sorted(vars(collection).items()):
        if isinstance(made, type) and issubclass(made, chaospy.Distribution) and not name.startswith("Mv"):
            defaults = {p.name: p.default for p in inspect.signature(made).parameters.values()}
            yield name, made, {**defaults, **NEEDED.get(name, {})}


FAMILIES = {name: (made, given) for name, made, given in families()}
QUICK = [name for name in FAMILIES if name not in SLOW]


def test_the_families_are_those_of_chaospy():
    assert len(FAMILIES) > 50 and {"Normal", "Uniform", "Cauchy", "Weibull", "Pareto1"} <= FAMILIES.keys()


@pytest.mark.parametrize("name", QUICK)
def test_every_distribution_is_accepted(name):
    made, given = FAMILIES[name]
    assert uqmbd.RandomVariable("x", made(**given)).name == "x"


def sampled_or_refused(name, bad):
    """For every parameter in turn: either refused, or the quantiles are finite, increase, and have their probability."""
    made, given = FAMILIES[name]
    for key, value in given.items():
        if isinstance(value, (int, float)) and value == bad:
            continue
        try:
            distribution = made(**{**given, key: bad})
        except Exception:  # chaospy refuses it itself
            continue
        try:
            uqmbd.RandomVariable("x", distribution)
        except uqmbd.StudyError as error:
            assert "random variable 'x': " in str(error) and "is not a valid distribution" in str(error)
            continue
        with np.errstate(all="ignore"):
            x = np.ravel(distribution.inv(LEVELS))
            passed = np.ravel(distribution.fwd(x))
        assert np.isfinite(x).all() and x[-1] > x[0], f"{name}({key}={bad}): {x}"
        if not getattr(distribution, "interpret_as_integer", False):
            assert abs(passed - LEVELS).max() < 0.1, f"{name}({key}={bad}): {x}, {passed}"


@pytest.mark.parametrize("bad", [-1, 0, np.nan])
@pytest.mark.parametrize("name", QUICK)
def test_parameters_that_belong_to_no_distribution_are_refused(name, bad):
    sampled_or_refused(name, bad)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "bad"), [*((x, np.inf) for x in QUICK), *((x, np.nan) for x in SLOW)])
def test_other_parameters_that_belong_to_no_distribution_are_refused(name, bad):
    """The search for quantiles of the slow ones takes a quarter of an hour with other parameters that are none."""
    sampled_or_refused(name, bad)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: chaospy.Normal(1.0, -0.02), "all of its quantiles are 0.8356"),
        (lambda: chaospy.Normal(1.0, 0), "chaospy cannot sample it (condition not satisfied: `scale > 0`)"),
        (lambda: chaospy.Uniform(2, 1), "`upper > lower`"),
        (lambda: chaospy.LogNormal(0, 0), "all of its quantiles are 1."),
        (lambda: chaospy.Weibull(2, -1), "all of its quantiles are -5.477"),
        (lambda: 2 * chaospy.Normal(1, -0.02) + 3, "all of its quantiles are"),
        (lambda: 0 * chaospy.Normal(1, 0.02), "all of its quantiles are 0"),
        (lambda: chaospy.TruncNormal(2, 1, 0, 1), "all of its quantiles are 1"),
        (lambda: chaospy.Trunc(chaospy.Normal(0, 1), 50, 60), "all of its quantiles are"),
        (lambda: chaospy.Normal(0, 1) ** 2, "all of its quantiles are"),
        (lambda: chaospy.DiscreteUniform(2, 2), "all of its quantiles are 2"),
        (lambda: chaospy.DiscreteUniform(3, 1), "all of its quantiles are"),
        (lambda: chaospy.Binomial(5, 1), "all of its quantiles are 5"),
        (lambda: chaospy.StudentT(-1), "its quantiles are nan"),
        (lambda: chaospy.J(chaospy.Normal(0, -1)), "all of its quantiles are"),
    ],
)
def test_what_is_wrong_with_a_distribution_is_reported(make, words):
    with pytest.raises(
        uqmbd.StudyError, match=f"random variable 'x': .* is not a valid distribution: .*{re.escape(words)}"
    ):
        uqmbd.RandomVariable("x", make())


def test_what_is_wrong_with_one_of_several_is_reported():
    joint = chaospy.J(chaospy.Normal(0, 1), chaospy.Normal(0, -1))
    with pytest.raises(
        uqmbd.StudyError, match=r"random_vector \('a', 'b'\): .* is not a valid distribution: .*of component 2 all of"
    ):
        uqmbd.random_vector(["a", "b"], joint)
    with pytest.raises(uqmbd.StudyError, match=r"random_vector \('a', 'b'\): .* is not a valid distribution"):
        uqmbd.random_vector(["a", "b"], chaospy.MvStudentT(-1, [0, 0], [[1, 0], [0, 1]]))
    uqmbd.random_vector(["a", "b"], chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]]))
    uqmbd.random_vector(["a", "b"], chaospy.Clayton(chaospy.Iid(chaospy.Uniform(), 2), 2.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: 3 - 2 * chaospy.Normal(1, 0.5),
        lambda: chaospy.Trunc(chaospy.Normal(0, 1), -1, 2),
        lambda: chaospy.Trunc(chaospy.Normal(0, 1), 5, 6),
        lambda: chaospy.Binomial(1, 1e-6),
        lambda: chaospy.DiscreteUniform(1, 2),
        lambda: chaospy.Pareto1(0.05),
        lambda: chaospy.Cauchy(),
        lambda: chaospy.Normal(1e6, 1e-6),
        lambda: chaospy.Beta(0.05, 0.05),
        lambda: chaospy.GaussianKDE([1.0, 2.0, 4.0]),
        lambda: chaospy.GaussianMixture([0, 100], [1, 1]),
        lambda: chaospy.Uniform(-1e-300, 1e-300),
    ],
)
def test_odd_ones_that_exist_are_accepted(make):
    uqmbd.RandomVariable("x", make())
