"""Laws of contact by anybody: an expression in public symbols, beside those of the package, which are made alike."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.testing import check_component
from uqmbd_contact import (
    ContactLaw,
    PlaneContact,
    RoadContact,
    SphereContact,
    damping,
    depth,
    depth_rate,
    distance,
    exponent,
    friction,
    speed,
    stiffness,
)


def dropped(velocity=(0.0, -2.0), times=(0.0, 0.05), **contact):
    """A ball of 1 kg that touches a floor."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(0, 0), velocity=velocity)
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), **contact))
    for k, name in enumerate("xy"):
        mechanism.output(name, ball.velocity[k], units="m/s")
    return uqmbd.simulate(mechanism, times, rtol=1e-9)


def test_law_of_ones_own_is_that_of_the_package_where_it_is_stated_alike():
    hunt = ContactLaw(stiffness * depth**exponent * (1 + damping * depth_rate), acts=1 + damping * depth_rate > 0)
    numbers = {"stiffness": 1e5, "exponent": 1.2, "damping": 0.3, "friction": 0.2}
    one, other = (dropped((1.0, -2.0), law=law, **numbers) for law in (hunt, "hunt-crossley"))
    assert all(np.array_equal(one[name], other[name]) for name in ("x", "y"))


def test_restitution_of_lankarani_and_nikravesh():
    """Their damping returns the coefficient of restitution that it is made from, as good as 1 - e is small."""
    e, start = 0.95, 2.0
    law = ContactLaw(1e5 * depth ** sympy.Rational(3, 2) * (1 + 3 * (1 - e**2) / 4 * depth_rate / start))
    assert float(dropped(law=law)["y"][-1]) == pytest.approx(e * start, rel=5e-3)


def test_a_law_never_pulls():
    """Damping so strong that an expression alone would hold the ball back."""
    law = ContactLaw(1e4 * depth + 60 * depth_rate)
    rebound = dropped(law=law)
    assert np.array_equal(rebound["y"], dropped(law="kelvin-voigt", stiffness=1e4, damping=60)["y"])
    assert float(dropped(law=ContactLaw(law.force, acts=True))["y"][-1]) < float(rebound["y"][-1])


def test_friction_that_falls_with_the_speed():
    """A block slides under its weight of 10 N: what it loses is the coefficient, over the speed, integrated."""
    law = ContactLaw(stiffness * depth, acts=True, friction=friction * (1 + sympy.exp(-speed)))
    mechanism = uqmbd.Mechanism("block", uqmbd.Translational(gravity=(0, -10)))
    block = mechanism.body("block", mass=1, position=(0, -1e-3), velocity=(2, 0))
    mechanism.add(
        PlaneContact("floor", mechanism.ground, block, (0, 0), (0, 0), (0, 1), law=law, stiffness=1e4, friction=0.1)
    )
    mechanism.output("speed", block.velocity[0], units="m/s")
    found = float(uqmbd.simulate(mechanism, [0, 0.5], rtol=1e-9)["speed"][-1])
    # dv / (1 + exp(-v)) = -dt, and the integral of the left is log(1 + exp(v))
    assert found == pytest.approx(np.log(np.exp(np.log1p(np.exp(2)) - 0.5) - 1), rel=1e-5)


def test_numbers_of_a_law_may_be_random():
    loss = uqmbd.RandomVariable("loss", chaospy.Uniform(0, 0.5), units="s/m")
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(0, 0), velocity=(0, -2))
    law = ContactLaw(1e5 * depth * (1 + loss * depth_rate))
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), law=law))
    mechanism.output("v", ball.velocity[1], units="m/s")
    for value in (0.0, 0.2):
        found = uqmbd.simulate(mechanism, [0, 0.05], values={"loss": value}, rtol=1e-9)["v"][-1]
        alone = dropped(law=ContactLaw(1e5 * depth * (1 + value * depth_rate)))["y"][-1]
        assert float(found) == pytest.approx(float(alone), rel=1e-7)


@pytest.mark.thorough
def test_a_law_passes_the_conformance_kit():
    loss = uqmbd.RandomVariable("loss", chaospy.Uniform(0.1, 0.2), units="s/m")
    law = ContactLaw(stiffness * depth * (1 + loss * depth_rate), friction=friction * (1 + sympy.exp(-speed)))
    given = {"law": law, "exponent": None, "damping": None}
    check_component(SphereContact, spaces=(uqmbd.Planar,), given=given, propagators=["monte-carlo"])


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: ContactLaw("stiff"), "force is 'stiff'; expected an expression in uqmbd_contact.depth, "),
        (
            lambda: ContactLaw(depth, friction=sympy.Symbol("mu")),
            "friction is mu, which contains the unknown symbol 'mu'",
        ),
        (lambda: dropped(law="hetz"), "law is the text 'hetz'; expected one of 'linear', .*, ContactLaw"),
        (lambda: dropped(law=ContactLaw(depth, acts=sympy.Symbol("u") > 0)), "PlaneContact 'floor': .*symbol 'u'"),
    ],
)
def test_what_is_no_law(make, told):
    with pytest.raises(uqmbd.StudyError, match=told):
        make()


@pytest.mark.filterwarnings("ignore:.*starts .* deep")
def test_slope_of_a_road_knows_the_random_variables_of_its_own():
    """The level has no part in the slope: a ball at rest on an inclined road is accelerated by the slope alone."""
    units = {"level": "m", "slope": "1"}
    level, slope = (uqmbd.RandomVariable(name, chaospy.Uniform(0.1, 0.9), units=units[name]) for name in units)
    mechanism = uqmbd.Mechanism("incline", uqmbd.Translational(gravity=(0, -10)))
    ball = mechanism.body("ball", mass=1, position=(0, 0.3))
    contact = mechanism.add(
        RoadContact("road", mechanism.ground, ball, (0, 0), level + slope * distance, law="linear", stiffness=1e4)
    )
    mechanism.output("push", contact.reaction_force[0], units="N")
    found = uqmbd.simulate(mechanism, [0, 0.001], values={"level": 0.31, "slope": 0.5})
    normal = 1e4 * 0.01 / np.sqrt(1.25)
    assert float(found["push"][0]) == pytest.approx(-normal * 0.5 / np.sqrt(1.25), rel=1e-6)


@pytest.mark.parametrize("force", [stiffness * depth * sympy.sqrt(depth_rate - 10), stiffness * sympy.log(depth - 1)])
def test_a_force_that_is_no_number_fails_the_motion(force):
    with pytest.raises(uqmbd.IntegrationError, match="the integration stopped at t = 0 s"):
        dropped(law=ContactLaw(force), stiffness=1e4)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"acts": "x"}, "acts is 'x'; expected a condition"),
        ({"acts": depth}, "acts is depth; expected a condition"),
        ({"friction": -0.3}, "friction is -0.3; expected a coefficient of friction"),
    ],
)
def test_what_is_no_condition_and_no_coefficient_is_refused(arguments, told):
    with pytest.raises(uqmbd.StudyError, match=told):
        ContactLaw(stiffness * depth, **arguments)
