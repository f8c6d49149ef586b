"""Sizes by their limits: the normal distribution of a centred process of known capability."""

from __future__ import annotations

import pickle

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.randomness import JointInput


def _space(distribution):
    return uqmbd.extend.GermSpace.of(JointInput.of([uqmbd.RandomVariable("d", distribution)]))


def _inputs(distribution, uniform):
    space = _space(distribution)
    return space.to_inputs(space.from_uniform(uniform))


@settings(max_examples=15)
@given(st.floats(0.1, 1e3), st.floats(1e-4, 0.1), st.floats(-5e-5, 0.1), st.floats(0.4, 3))
def test_the_process_has_the_capability_that_is_stated(nominal, plus, minus, cpk):
    """The nearer limit is 3 Cpk standard deviations from the mean, to both sides."""
    minus = max(minus, 0.0)
    variable = uqmbd.RandomVariable("d", uqmbd.tolerance(nominal, plus, minus, cpk))
    found = uqmbd.extend.stated_tolerance(variable.distribution)
    process = scipy.stats.norm(variable.mean, found.sigma)
    assert (nominal + plus - process.mean()) / (3 * process.std()) == pytest.approx(cpk, rel=1e-6)
    assert (process.mean() - nominal + minus) / (3 * process.std()) == pytest.approx(cpk, rel=1e-6)
    uniform = np.array([[1e-4], [0.2], [0.999]])
    values = JointInput.of([variable]).from_uniform(uniform)
    assert values[:, 0] == pytest.approx(process.ppf(uniform[:, 0]), rel=1e-12)


def test_parts_beyond_the_limits_are_those_of_the_process_unless_they_are_sorted_out():
    """At a capability of 0.5, 13.4 % are; inspection leaves a truncated normal distribution."""
    uniform = scipy.stats.qmc.Sobol(1, seed=3).random(2**14)
    made = _inputs(uqmbd.tolerance(10, 0.1, 0.1, cpk=0.5), uniform)
    outside = np.mean(np.abs(made - 10) > 0.1)
    assert outside == pytest.approx(2 * scipy.stats.norm.sf(1.5), abs=2e-4)
    left = _inputs(uqmbd.tolerance(10, 0.1, 0.1, cpk=0.5, inspected=True), uniform)
    assert np.abs(left - 10).max() <= 0.1
    cut = scipy.stats.truncnorm(-1.5, 1.5, loc=10, scale=0.1 / 1.5)
    assert left[:, 0] == pytest.approx(cut.ppf(uniform[:, 0]), rel=1e-8)


@pytest.mark.parametrize("inspected", [False, True])
def test_polynomials_of_the_germ_are_those_of_the_distribution(inspected):
    """A chaos of order 1 is exact for the size itself: its coefficients are the mean and the standard deviation."""
    space = _space(uqmbd.tolerance(30, 0.02, 0.01, cpk=0.6, inspected=inspected))
    rule = uqmbd.extend.gauss_tensor(space, 6)
    values = space.to_inputs(rule.nodes)[:, 0]
    bound = 1.8 if inspected else np.inf
    exact = scipy.stats.truncnorm(-bound, bound, loc=30.005, scale=0.015 / 1.8)
    assert rule.weights @ values == pytest.approx(30.005, rel=1e-12)
    assert np.sqrt(rule.weights @ (values - 30.005) ** 2) == pytest.approx(exact.std(), rel=1e-9)
    assert rule.weights @ (values - 30.005) ** 4 == pytest.approx(
        exact.stats("k") * exact.var() ** 2 + 3 * exact.var() ** 2, rel=1e-6
    )


@pytest.mark.parametrize("inspected", [False, True])
def test_the_source_is_stated_and_survives_other_processes(inspected):
    variable = uqmbd.RandomVariable("d", uqmbd.tolerance(30, 0.02, 0.01, inspected=inspected), units="mm")
    again = pickle.loads(pickle.dumps(variable))
    for one in (variable, again):
        assert "30 +0.02/-0.01, Cpk 1.33" in one.description and ("inspected" in one.description) == inspected
        assert uqmbd.extend.stated_tolerance(one.distribution).upper == 30.02
    assert "30 +0.02/-0.01" in uqmbd.RandomVariable("m", 1e-3 * variable.distribution).description
    assert uqmbd.extend.stated_tolerance(chaospy.Normal(30, 0.01)) is None
    assert sympy.diff(2 * variable, variable) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((30, 0.02, -0.01), "write 0.01; if it is 30.01.*tolerance\\(30.015, 0.005, 0.005\\)"),
        ((30, -0.007, -0.020), "write 0.02"),
        ((30, 0, 0), "expected an upper limit above the lower limit"),
        ((30, -0.02, 0.01), "expected an upper limit above the lower limit"),
        ((30, np.nan, 0), "plus is nan"),
        (("30", 0.1, 0.1), "nominal is '30'"),
        ((30, 0.1, 0.1, 0), "cpk is 0"),
        ((30, 0.1, 0.1, 1.33, "yes"), "inspected is 'yes'"),
    ],
)
def test_what_is_no_tolerance_is_refused(arguments, said):
    with pytest.raises(uqmbd.StudyError, match=said):
        uqmbd.tolerance(*arguments)


def test_both_limits_may_lie_below_the_nominal_size():
    found = uqmbd.extend.stated_tolerance(uqmbd.tolerance(30, -0.007, 0.020))
    assert (found.lower, found.upper) == (29.98, 29.993) and found.source == "30 -0.007/-0.02"
