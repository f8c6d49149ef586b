"""Where a realisation ends at a sample, and where speeds jump at one: the same with impacts, without and projected."""

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import LinearSpeedDriver, SpeedDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce

MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2), units="kg")
TENTHS = np.linspace(0, 1, 11)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1])
def test_a_realisation_with_impacts_that_fails_at_a_sample_is_sampled_no_more(delay):
    """Also where a command that was delayed would act then; the others go on, with the motion that they have alone."""
    seen = []

    def heavy_fails(time, measured):
        seen.append((time, measured[0, 0]))
        return np.where((time > 0.45) & (measured[:, 0] > 1.1), np.nan, 2.0)

    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-10))
    ball = mechanism.body("ball", mass=MASS, position=0.5)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=0.5))
    options = {"measured": [MASS], "commanded": ["lift"], "rate": 10, "function": heavy_fails}
    controller = mechanism.add(uqmbd.Controller(delay=delay, initial=2, **options))
    mechanism.add(PointForce("lift", ball, 0, controller.command()))
    mechanism.output("x", ball.position, units="m")
    found = integrate(Ensemble(build(mechanism), np.array([[1.15], [1.0]])), TENTHS, 1e-8)
    assert "'lift' is nan at t = 0.5 s" in found.messages[0] and not found.messages[1]
    assert {time for time, mass in seen if mass > 1.1 and time > 0.45} == {0.5}
    # 8 m/s^2 downwards: it falls for sqrt(2 / 16) s, and rises again with half the speed
    hit = np.sqrt(0.125)
    after = 0.5 * 8 * hit * (0.7 - hit) - 4 * (0.7 - hit) ** 2
    assert after > 0
    assert found.states[1, 7, 0] == pytest.approx(after, abs=1e-6)


def shafts(second):
    """Two wheels on an axis, driven by commands u and w, the second relative to the first and by 2 u as well."""
    mechanism = uqmbd.Mechanism("shafts", uqmbd.Planar())
    one = mechanism.body("one", mass=MASS, inertia=0.1)
    two = mechanism.body("two", mass=1, inertia=0.1)
    mechanism.add(Revolute("first bearing", mechanism.ground, one, (0, 0), (0, 0)))
    mechanism.add(Revolute("second bearing", one, two, (0, 0), (0, 0)))
    controller = mechanism.add(
        uqmbd.Controller(measured=[MASS], commanded=["u", "w"], rate=10, function=second, initial=1)
    )
    mechanism.add(SpeedDriver("of one", mechanism.ground, one, controller.command("u")))
    mechanism.add(SpeedDriver("between", one, two, controller.command("w")))
    mechanism.add(SpeedDriver("of two", mechanism.ground, two, 2 * controller.command("u")))
    mechanism.output("angle", two.angle, units="rad")
    return mechanism


def agreeing(time, measured):
    speed = 1 + time * np.sin(20 * measured[:, 0])
    return speed, speed


def contradicting(time, measured):
    speed = np.ones(len(measured))
    return speed, speed if time < 0.45 else 2 * speed


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
def test_commanded_speeds_that_contradict_each_other_end_a_projection():
    study = uqmbd.Study("shafts", shafts(contradicting), TENTHS)
    with pytest.warns(
        UserWarning, match="a commanded speed jumps at t = 0.5 s, but other constraints contradict this jump"
    ):
        found = study.propagate(Galerkin(order=2, verify=0))
    mean = found["statistics"]["mean"].values[0]
    np.testing.assert_allclose(mean[:5], 2 * TENTHS[:5], atol=1e-9)
    assert np.isnan(mean[6:]).all()


@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
@pytest.mark.filterwarnings("error:.*contradict.*")
@pytest.mark.parametrize("order", [1, 3])
def test_commanded_speeds_that_agree_are_followed_by_a_projection(order):
    """However rough their expansion is: they depend on the mass as a sine that no polynomial of the order is."""
    found = uqmbd.Study("shafts", shafts(agreeing), TENTHS).propagate(Galerkin(order=order, verify=0))
    nodes, weights = np.polynomial.legendre.leggauss(order + 1)
    speeds = 1 + TENTHS[:, None] * np.sin(20 * (1 + 0.2 * nodes))
    exact = 2 * 0.1 * np.concatenate([[0], np.cumsum(speeds @ weights / 2)[:-1]])
    np.testing.assert_allclose(found["statistics"]["mean"].values[0], exact, atol=1e-7)


def as_it_is(time, measured):
    return measured[:, 0]


def sled(contact, rate=10, at=0.5, function=as_it_is):
    """A sled whose speed jumps from 1 to 3 m/s, and a load of 1 kg that is pushed with as many N as the sled's speed."""
    mechanism = uqmbd.Mechanism("sled", uqmbd.Translational())
    body = mechanism.body("sled", mass=MASS)
    load = mechanism.body("load", mass=1, position=(0, 1))
    speed = sympy.Piecewise((1.0, uqmbd.t < at), (3.0, True))
    mechanism.add(LinearSpeedDriver("drive", mechanism.ground, body, (0, 0), (0, 0), (1, 0), speed=speed))
    options = {"measured": [body.velocity[0]], "commanded": ["push"], "function": function}
    controller = mechanism.add(uqmbd.Controller(rate=rate, **options))
    mechanism.add(PointForce("push", load, (0, 0), (controller.command(), 0)))
    if contact:
        mechanism.add(PlaneImpact("wall", mechanism.ground, load, (1e3, 0), (0, 0), (-1, 0), restitution=0.5))
    mechanism.output("speed", body.velocity[0], units="m/s")
    mechanism.output("push", controller.command(), units="N")
    mechanism.output("load", load.velocity[0], units="m/s")
    return mechanism


@pytest.mark.filterwarnings("ignore:.*no output depends on the random input 'mass':uqmbd.UnusedInputWarning")
@pytest.mark.parametrize("at", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("way", ["dop853", "ida", "impacts", pytest.param("galerkin", marks=pytest.mark.thorough)])
def test_a_prescribed_speed_jumps_before_it_is_sampled(way, at):
    """What is recorded at that time is right after the jump, and the controller sees it, at the last time as well."""
    mechanism = sled(contact=way == "impacts", at=at)
    if way == "galerkin":
        found = uqmbd.Study("sled", mechanism, TENTHS).propagate(Galerkin(order=1, verify=0))["statistics"]["mean"]
        speed, push, load = found.values
    else:
        integrator = way if way != "impacts" else "auto"
        values = uqmbd.simulate(mechanism, TENTHS, {"mass": 1}, integrator=integrator, rtol=1e-8, check=False)
        speed, push, load = values["speed"], values["push"], values["load"]
    expected = np.where(TENTHS > at - 1e-9, 3.0, 1.0)
    np.testing.assert_allclose(speed, expected, atol=1e-9)
    np.testing.assert_allclose(push, expected, atol=1e-9)
    np.testing.assert_allclose(load, 0.1 * np.concatenate([[0], np.cumsum(expected)[:-1]]), atol=1e-7)
