"""Ranges of numbers hold in every realisation, and what leaves them is known before anything is computed."""

from __future__ import annotations

import functools

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import find_risks, range_findings
from uqmbd.dynamics.equations import ParameterMap, impossible, limits_of
from uqmbd.testing.components.cases import component_cases
from uqmbd_contact import PlaneImpact
from uqmbd_springs import RotationalFriction, SpringDamper

RANGED = sorted(
    name
    for name, kind in plugins.components().items()
    if kind.__module__.startswith("uqmbd_") and any(p.ranged for p in kind.parameters().values())
)


@functools.cache
def case(name):
    """A component between bodies, each number of which has a random variable of its own name."""
    kind = plugins.component(name)
    space = next(s for s in (uqmbd.Planar, uqmbd.Spatial, uqmbd.Line) if s in kind.spaces)
    return next(component_cases(kind, space, {}, np.random.default_rng(5)))


def expected_outside(component, inputs, values):
    """Whether a number is outside of its range: every expression evaluated by NumPy, one realisation at a time."""
    found = np.zeros(len(values), dtype=bool)
    for key, parameter in component.parameters().items():
        given = component.values.get(key)
        for entry in np.ravel(given if isinstance(given, (tuple, list)) else [given]) if parameter.ranged else []:
            known = np.broadcast_to(sympy.lambdify(inputs.variables, entry, "numpy")(*values.T), len(values))
            if parameter.exclusive:
                found |= ~((known > parameter.minimum) & (known < parameter.maximum))
            else:
                found |= ~((known >= parameter.minimum) & (known <= parameter.maximum))
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("name", RANGED)
@given(data=st.data())
@settings(max_examples=15, deadline=None)
def test_realisations_outside_are_found_of_every_component(name, data):
    tried = case(name)
    inputs = tried.mechanism.inputs
    seed = data.draw(st.integers(0, 2**32 - 1))
    spread = data.draw(st.sampled_from([0.5, 1.5, 5.0]))
    values = np.random.default_rng(seed).uniform(-spread, spread, (20, len(inputs)))
    expressions = []
    limits, tensors = limits_of(tried.mechanism, expressions)
    said = impossible(limits, tensors, ParameterMap.of(expressions, inputs.variables)(values))
    assert [bool(text) for text in said] == expected_outside(tried.component, inputs, values).tolist()
    for text in filter(None, said):
        assert f"of {name} 'trial' is " in text and ": expected " in text and " = " in text.partition("expected")[2]


def test_every_component_with_a_range_is_tried():
    assert {"RadialTyre", "PlaneImpact", "RotationalFriction", "RotorInertia", "Distance"} <= set(RANGED)


def body_on_springs(**numbers):
    mechanism = uqmbd.Mechanism("machine", uqmbd.Planar())
    body = mechanism.body("body", mass=numbers.get("mass", 1), inertia=1, position=(0.1, 0))
    given = {"stiffness": 10, **{k: v for k, v in numbers.items() if k != "mass"}}
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), **given))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


@pytest.mark.thorough
@given(st.floats(0.05, 3), st.floats(0.1, 10), st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_probability_of_a_normal_number_is_that_of_its_tail(deviation, slope, turned):
    x = uqmbd.RandomVariable("x", chaospy.Normal(1, deviation))
    number = slope * (3 - x) if turned else slope * x
    (risk,) = find_risks(body_on_springs(mass=number)) or (None,)
    tail = scipy.stats.norm.sf(2 if turned else 1, scale=deviation)
    assert tail < 1e-14 if risk is None else risk.probability == pytest.approx(tail, rel=1e-6, abs=1e-14)


def test_the_probability_of_other_expressions_is_counted():
    a, b = (uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)) for name in "ab")
    (product,) = find_risks(body_on_springs(mass=a * b - sympy.Rational(1, 10)))
    # of two uniform numbers the product is below c with the probability c (1 - log(c))
    assert product.probability == pytest.approx(0.1 * (1 - np.log(0.1)), abs=0.015)
    pair = uqmbd.random_vector(("c", "d"), chaospy.MvNormal([1, 1], [[0.25, 0.1], [0.1, 0.25]]))
    (marginal,) = find_risks(body_on_springs(mass=pair[1]))
    assert marginal.probability == pytest.approx(scipy.stats.norm.sf(2), abs=0.005)
    count = uqmbd.RandomVariable("count", chaospy.DiscreteUniform(-1, 3))
    (whole,) = find_risks(body_on_springs(mass=count))
    assert whole.probability == pytest.approx(0.2, abs=1e-3)
    third = uqmbd.RandomVariable("third", chaospy.Uniform(1.0, 2.8))
    top = uqmbd.Mechanism("top", uqmbd.Spatial())
    top.body("top", mass=1, inertia=(1, third, 1, 0, 0, 0))
    (tensor,) = find_risks(top)
    assert tensor.name == "inertia of body 'top'" and tensor.probability == pytest.approx(
        0.8 / 1.8, abs=0.015
    )  # rounded numbers pass


def test_numbers_that_stay_in_their_range_are_no_risk():
    above = uqmbd.RandomVariable("above", chaospy.Uniform(0, 1))
    cut = uqmbd.RandomVariable("cut", chaospy.Trunc(chaospy.Normal(1000, 400), lower=0))
    assert find_risks(body_on_springs(mass=above, stiffness=cut, damping=0.1)) == ()
    assert find_risks(body_on_springs()) == ()
    mechanism = body_on_springs()
    rebound = uqmbd.RandomVariable("rebound", chaospy.Beta(5, 2))
    body = mechanism.bodies["body"]
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, -1), (0, 0), (0, 1), restitution=rebound))
    assert find_risks(mechanism) == ()


def test_a_change_of_sign_is_reported_and_a_sign_that_is_meant_is_not():
    k = uqmbd.RandomVariable("k", chaospy.Normal(1000, 400), units="N/m")
    (weak,) = find_risks(body_on_springs(stiffness=k))
    assert not weak.fails and weak.probability == pytest.approx(scipy.stats.norm.sf(2.5), rel=1e-9)
    (buckled,) = find_risks(body_on_springs(stiffness=-k))
    assert buckled.probability == weak.probability and buckled.expected == "0 or less"
    below = uqmbd.RandomVariable("below", chaospy.Uniform(-3, -1), units="N/m")
    about_none = uqmbd.RandomVariable("c", chaospy.Normal(0, 1), units="N s/m")
    assert find_risks(body_on_springs(stiffness=below, damping=about_none)) == ()
    (found,) = range_findings((buckled,), 1000)
    said = found.text
    assert "the stiffness of SpringDamper 'spring' is positive in 0.62 % of the realisations, and negative at" in said
    assert range_findings((buckled,), 5) == ()


def test_a_parameter_that_is_no_number_has_no_sign():
    with pytest.raises(uqmbd.StudyError, match="kind 'vector' has no sign"):
        uqmbd.Parameter("N", "forces", kind="vector", one_sign=True)


def test_many_numbers_are_reported_in_one_sentence():
    m = uqmbd.RandomVariable("m", chaospy.Normal(1, 0.5), units="kg")
    mechanism = uqmbd.Mechanism("row", uqmbd.Translational())
    for k in range(7):
        mechanism.body(f"b{k}", mass=m)
    (found,) = range_findings(find_risks(mechanism), 100)
    said = found.text
    assert said.count("is outside of its range") == 4 and "3 similar numbers: these fail" in said
    assert said.count("m = Normal(mu=1, sigma=0.5)") == 1


def test_limits_and_signs_of_one_study_are_two_sentences():
    x = uqmbd.RandomVariable("x", chaospy.Normal(0.2, 0.1), units="N m s/rad")
    c = uqmbd.RandomVariable("c", chaospy.Normal(0.2, 0.1), units="N s/m")
    mechanism = body_on_springs(damping=c)
    mechanism.add(RotationalFriction("seal", mechanism.ground, mechanism.bodies["body"], friction=0, damping=x))
    fails, runs = (found.text for found in range_findings(find_risks(mechanism), 100))
    assert "'seal' is outside of its range (0 or more) in 2.3 % of the realisations: these fail" in fails
    assert (
        "'spring' is negative in 2.3 % of the realisations, and positive at the means: these realisations succeed"
        in runs
    )
