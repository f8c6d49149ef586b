"""What is prescribed may jump: a position is refused, a speed is an impulse; no result is off the constraints."""

from __future__ import annotations

import dataclasses
import re
import warnings

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate, position_jumps
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import DistanceDriver, LinearSpeedDriver, PositionDriver, RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo

t = uqmbd.t
INTEGRATORS = ("auto", "dop853", "ida")
LENGTH, HALF, INERTIA = 1.0, 0.5, 1 / 12


def turned_rod(angle):
    """Rod on a pivot whose angle is driven."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=INERTIA, position=(HALF, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-HALF, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, rod, angle))
    mechanism.output("tip", rod.point((HALF, 0))[1], units="m")
    return mechanism


def slid_block(displacement):
    """Block on a guide whose displacement is driven."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Planar())
    block = mechanism.body("block", mass=1, inertia=1)
    mechanism.add(Prismatic("guide", mechanism.ground, block, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(PositionDriver("motor", mechanism.ground, block, (0, 0), (0, 0), (1, 0), displacement))
    mechanism.output("x", block.position[0], units="m")
    return mechanism


def drawn_rope(length):
    """Body at a driven distance."""
    mechanism = uqmbd.Mechanism("rope", uqmbd.Planar(gravity=(0, -9.81)))
    body = mechanism.body("body", mass=1, inertia=1, position=(0, -1), angle=0)
    mechanism.add(DistanceDriver("motor", mechanism.ground, body, (0, 0), (0, 0), length + 1))
    mechanism.output("y", body.position[1], units="m")
    return mechanism


def hung_rod(speed, begin, *, mark=False, up=None):
    """Free rod along x, one end of which is taken along in y at a speed from `begin` on, and does not move in x."""
    mechanism = uqmbd.Mechanism("hung", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=INERTIA, position=(HALF, 0))
    ground, end = mechanism.ground, (-HALF, 0)
    up = sympy.Piecewise((0, t < begin), (speed * (t - begin), True)) if up is None else up
    mechanism.add(PositionDriver("x", ground, rod, (0, 0), end, (1, 0), 0))
    mechanism.add(PositionDriver("y", ground, rod, (0, 0), end, (0, 1), up))
    if mark:  # something that only notes a time has the motion followed from event to event
        mechanism.add(Mark("mark", rod))
    mechanism.output("tip x", rod.point((HALF, 0))[0], units="m")
    mechanism.output("tip y", rod.point((HALF, 0))[1], units="m")
    mechanism.output("rate", rod.angular_velocity, units="rad/s")
    return mechanism


class Mark(uqmbd.Component):
    """Notes when a body passes a place that it never comes to."""

    bodies = ("body",)

    def terms(self, p):
        """Yield the event."""
        yield uqmbd.Event(p.body.position[0] + 100, label="passes")


def rate_of(speed):
    """Angular momentum about the end that is hit is that before, none: ``J w + m l (c + l w) = 0``."""
    return -HALF * speed / (INERTIA + HALF**2)


def tip_of(times, speed, begin):
    """The rod turns evenly about its end, which moves evenly."""
    later = np.maximum(times - begin, 0.0)
    angle = rate_of(speed) * later
    return LENGTH * np.cos(angle), speed * later + LENGTH * np.sin(angle)


# -- positions --------------------------------------------------------------------------------------------------------
@pytest.mark.thorough
@pytest.mark.parametrize("integrator", INTEGRATORS)
@settings(max_examples=5, deadline=None)
@given(
    make=st.sampled_from([turned_rod, slid_block, drawn_rope]),
    size=st.floats(1e-4, 3.0).flatmap(lambda x: st.sampled_from([x, -0.3 * x])),
    when=st.floats(0.01, 0.99),
)
def test_a_position_that_jumps_is_refused_with_its_time_and_size(make, size, when, integrator):
    """Before anything is computed, by every integrator, whatever the driver."""
    mechanism = make(sympy.Piecewise((0, t < when), (size, True)))
    with pytest.raises(uqmbd.StudyError, match="'motor'") as error:
        uqmbd.simulate(mechanism, np.linspace(0, 1, 6), integrator=integrator)
    assert f"at t = {when:.6g} s" in str(error.value)
    found = re.search(r"by (\S+) (m|rad)\)", str(error.value))
    assert float(found[1]) == pytest.approx(size, rel=1e-5)


def test_a_study_whose_position_jumps_is_refused_before_anything_is_computed():
    """At the means of the inputs."""
    size = uqmbd.RandomVariable("size", chaospy.Normal(0.5, 0.1), units="m")
    mechanism = slid_block(sympy.Piecewise((0, t < 0.3), (size, True)))
    study = uqmbd.Study("jump", mechanism, np.linspace(0, 1, 6), [MonteCarlo(samples=20, seed=1)])
    with pytest.raises(uqmbd.StudyError, match=r"at t = 0.3 s.*'motor' \(its displacement by 0.5 m\)"):
        study.run()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_samples_whose_position_jumps_fail_with_that_reason_and_the_others_do_not(integrator):
    """It jumps for a part of the samples, and not at the means."""
    size = uqmbd.RandomVariable("size", chaospy.Normal(-0.01, 0.1), units="m")
    mechanism = slid_block(sympy.Piecewise((0, t < 0.3), (sympy.Max(0, size), True)))
    propagator = MonteCarlo(samples=40, seed=1, max_failures=1.0)
    study = uqmbd.Study("jump", mechanism, np.linspace(0, 1, 6), [propagator], integrator=integrator)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        samples = study.propagate(propagator)["samples"]
    jumps = samples["inputs"].sel(input="size").values > 0
    assert 5 < jumps.sum() < 35
    assert ((samples["status"].values != 0) == jumps).all()
    response = samples["response"].sel(output="x").transpose("sample", "time").values
    assert np.isnan(response[jumps]).all()
    assert np.abs(response[~jumps]).max() < 1e-9


def test_a_jump_outside_of_the_times_of_the_study_is_none():
    """Nothing is computed there."""
    mechanism = turned_rod(sympy.Piecewise((0, t < 2.0), (1, True)))
    assert np.abs(uqmbd.simulate(mechanism, [0, 0.5, 1])["tip"].values).max() < 1e-12


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_angle_that_is_counted_back_by_whole_turns_does_not_jump(integrator):
    """The same pose: 2 pi more says the same."""
    mechanism = turned_rod(3 * t + sympy.Piecewise((0, t < 0.5), (2 * sympy.pi, True)))
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times, integrator=integrator)
    np.testing.assert_allclose(data["tip"].values, np.sin(3 * times), atol=1e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("size", [1e-3, 1.0, 3.0])
def test_a_jump_at_a_time_that_no_condition_tells_is_refused_too(size, integrator):
    """The time is found by looking: ``t^2 = 0.2``."""
    mechanism = turned_rod(sympy.Piecewise((0, t**2 < 0.2), (size, True)))
    with pytest.raises(uqmbd.StudyError, match=rf"at t = 0.447214 s.*by {size:g} rad"):
        uqmbd.simulate(mechanism, np.linspace(0, 1, 7), integrator=integrator)


# -- speeds -----------------------------------------------------------------------------------------------------------
@pytest.mark.thorough
@pytest.mark.parametrize(("integrator", "mark"), [*((name, False) for name in INTEGRATORS), ("dop853", True)])
@settings(max_examples=2, deadline=None)
@given(speed=st.floats(0.05, 5.0), begin=st.one_of(st.just(0.5), st.floats(0.05, 0.8)))
def test_a_speed_that_jumps_is_an_impulse(speed, begin, mark, integrator):
    """Of the end of a free rod, against the closed form; at the time of the jump the result is that right after."""
    times = np.linspace(0, 1, 5)
    data = uqmbd.simulate(hung_rod(speed, begin, mark=mark), times, rtol=1e-7, integrator=integrator)
    after = times >= begin
    np.testing.assert_allclose(data["rate"].values, np.where(after, rate_of(speed), 0), atol=2e-5 * speed)
    for name, expected in zip(("tip x", "tip y"), tip_of(times, speed, begin), strict=True):
        np.testing.assert_allclose(data[name].values, expected, atol=2e-5 * max(1, speed))


@pytest.mark.parametrize(("integrator", "mark"), [*((name, False) for name in INTEGRATORS), ("dop853", True)])
def test_a_speed_that_jumps_at_a_time_that_no_condition_tells_is_an_impulse(integrator, mark):
    """Nobody says when: at the root of ``t^2 = 0.2``, which is found by looking."""
    begin, times = np.sqrt(0.2), np.linspace(0, 1, 7)
    mechanism = hung_rod(1.5, 2.0, mark=mark, up=sympy.Piecewise((0, t**2 < 0.2), (1.5 * (t - begin), True)))
    data = uqmbd.simulate(mechanism, times, rtol=1e-7, integrator=integrator, check=False)
    np.testing.assert_allclose(data["tip y"], tip_of(times, 1.5, begin)[1], atol=3e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_realisation_of_a_stack_has_its_own_impulse(integrator):
    """Random speeds at random times."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.5, 3), units="m/s")
    begin = uqmbd.RandomVariable("begin", chaospy.Uniform(0.1, 0.9), units="s")
    times = np.linspace(0, 1, 6)
    propagator = MonteCarlo(samples=12, seed=2)
    study = uqmbd.Study("hung", hung_rod(speed, begin), times, [propagator], rtol=1e-7, integrator=integrator)
    samples = study.propagate(propagator)["samples"]
    values = samples["inputs"].sel(input=["speed", "begin"]).transpose("sample", "input").values
    response = samples["response"].sel(output="tip y").transpose("sample", "time").values
    expected = [tip_of(times, *row)[1] for row in values]
    np.testing.assert_allclose(response, expected, atol=5e-5)


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_galerkin_has_the_impulse_of_its_projected_equations(integrator):
    """The rate is linear in a random speed: an expansion of first order is exact."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.5, 3), units="m/s")
    times = np.linspace(0, 0.5, 6)
    study = uqmbd.Study("hung", hung_rod(speed, 0.2), times, rtol=1e-8)
    node = study.propagate(Galerkin(order=4, nodes=7, integrator=integrator, verify=0))
    statistics = node["statistics"].sel(output="rate")
    after = times >= 0.2
    np.testing.assert_allclose(statistics["mean"], np.where(after, rate_of(1.75), 0), atol=1e-5)
    np.testing.assert_allclose(statistics["std"], np.where(after, -rate_of(2.5) / np.sqrt(12), 0), atol=1e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_integrated_speed_may_jump_too(integrator):
    """A speed driver: the displacement is the integral, of a body of which nothing else is held."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Planar())
    block = mechanism.body("block", mass=2, inertia=1)
    speed = sympy.Piecewise((1, t < 0.3), (-2, t < 0.7), (0.5, True))
    mechanism.add(LinearSpeedDriver("motor", mechanism.ground, block, (0, 0), (0, 0), (1, 0), speed))
    mechanism.output("x", block.position[0])
    mechanism.output("v", block.velocity[0])
    times = np.linspace(0, 1, 21)
    data = uqmbd.simulate(mechanism, times, integrator=integrator)
    np.testing.assert_allclose(data["x"], np.interp(times, [0, 0.3, 0.7, 1], [0, 0.3, -0.5, -0.35]), atol=1e-6)
    even = np.select([times < 0.2999, times < 0.6999], [1, -2], 0.5)
    np.testing.assert_allclose(data["v"], even, atol=1e-5)


@pytest.mark.thorough
def test_an_impulse_reaches_what_rests_on_a_floor():
    """A ball that lies on the floor is pushed along it, and stays there."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
    along = sympy.Piecewise((0, t < 0.4), (2 * (t - 0.4), True))
    # pushed along a direction that leads into the floor, where the floor can only hold against it
    mechanism.add(PositionDriver("x", mechanism.ground, ball, (0, 0), (0, 0), (1, -0.5), along))
    mechanism.output("x", ball.position[0])
    mechanism.output("y", ball.position[1])
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times)
    np.testing.assert_allclose(data["y"], 0, atol=1e-9)
    np.testing.assert_allclose(data["x"], 2 * np.sqrt(1.25) * np.maximum(times - 0.4, 0), atol=1e-6)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_redundant_speeds_jump_together_or_not_at_all(integrator):
    """Two drivers of one point: alike they are redundant, and different they contradict each other."""
    times = np.linspace(0, 1, 5)
    for factor in (1, 2):
        mechanism = hung_rod(1.5, 0.4)
        rod = mechanism.bodies["rod"]
        again = sympy.Piecewise((0, t < 0.4), (factor * 1.5 * (t - 0.4), True))
        mechanism.add(PositionDriver("again", mechanism.ground, rod, (0, 0), (-HALF, 0), (0, 1), again))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
            if factor == 1:
                data = uqmbd.simulate(mechanism, times, integrator=integrator)
                np.testing.assert_allclose(data["tip y"], tip_of(times, 1.5, 0.4)[1], atol=1e-4)
            else:
                with pytest.raises(uqmbd.IntegrationError, match=r"t = 0.4 s.*contradict"):
                    uqmbd.simulate(mechanism, times, integrator=integrator)


# -- results ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("quantity", ["position", "velocity"])
def test_a_result_off_the_constraints_is_a_failed_realisation_whoever_integrates(monkeypatch, quantity):
    """An integrator of a plugin lets a pendulum drift off its pivot from a time on, for every other realisation."""
    times = np.linspace(0, 1, 11)

    class Drifting:
        """The built-in one, with an error of its own."""

        name = "drifting"

        def integrate(self, ensemble, times, rtol):
            found = integrate(ensemble, times, rtol)
            states = found.states.copy()
            states[1::2, 6:, 0 if quantity == "position" else 4] += 2e-3
            return dataclasses.replace(found, states=states)

    registry = uqmbd.plugins.Registry((), {"integrators": {"drifting": Drifting}})
    monkeypatch.setattr(uqmbd.plugins.registry, "registered", lambda: registry)
    angle = uqmbd.RandomVariable("angle", chaospy.Uniform(0.2, 0.4), units="rad")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body(
        "rod", mass=1, inertia=INERTIA, position=(HALF * sympy.cos(angle), HALF * sympy.sin(angle)), angle=angle
    )
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-HALF, 0)))
    mechanism.output("tip", rod.point((HALF, 0))[1], units="m")
    propagator = MonteCarlo(samples=8, seed=1, max_failures=1.0)
    study = uqmbd.Study("pendulum", mechanism, times, [propagator], integrator="drifting")
    with pytest.warns(UserWarning, match="violates the constraints 'pivot: point"):
        samples = study.propagate(propagator)["samples"]
    assert samples["status"].values.tolist() == [0, 2] * 4
    response = samples["response"].transpose("sample", "output", "time").values
    assert np.isfinite(response[::2]).all()
    assert not np.isfinite(response[1::2]).any()


@pytest.mark.parametrize("after", [-1, 0, 0.5])
def test_a_contact_does_not_pull_where_the_speed_of_what_pushes_jumps(after):
    """A pusher of a body that it touches slows down at once; the body goes on with the speed of before."""
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    pusher, body = mechanism.body("pusher", mass=1), mechanism.body("body", mass=1, position=(0.5, 0))
    mechanism.add(PlaneImpact("face", pusher, body, (0.5, 0), (0, 0), (1, 0), restitution=0.5))
    speed = sympy.Piecewise((t, t < 1), (after, True))
    mechanism.add(LinearSpeedDriver("push", mechanism.ground, pusher, (0, 0), (0, 0), (1, 0), speed))
    mechanism.output("v", body.velocity[0], units="m/s")
    mechanism.output("x", body.position[0], units="m")
    found = uqmbd.simulate(mechanism, np.linspace(0, 2, 21))
    assert found["v"].values[-1] == pytest.approx(1, abs=1e-9)
    assert found["x"].values[-1] == pytest.approx(2, abs=1e-6)


@pytest.mark.parametrize("length", [1.0, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Translational])
@pytest.mark.parametrize("rtol", [1e-6, 1e-3])
def test_a_position_that_jumps_is_refused_in_mechanisms_of_any_size(length, space, rtol):
    mechanism = uqmbd.Mechanism("small", space())
    inertia = {"inertia": length**2} if space is uqmbd.Planar else {}
    body = mechanism.body("body", mass=1, position=(length, 0), **inertia)
    jumps = length * sympy.Piecewise((1, t < 0.5), (1.5, True))
    mechanism.add(DistanceDriver("rod", mechanism.ground, body, (0, 0), (0, 0), jumps))
    mechanism.output("x", body.position[0], units="m")
    with pytest.raises(uqmbd.StudyError, match=r"at t = 0.5 s a position jumps that is prescribed by 'rod'"):
        uqmbd.simulate(mechanism, np.linspace(0, 1, 11), rtol=rtol)


@pytest.mark.parametrize(
    ("displacement", "times"),
    [
        (sympy.Piecewise((t / 1e-6, t < 1e-6), (1, True)), np.linspace(0, 2e-6, 11)),
        (uqmbd.step(t, 0.5, 0, 0.7, 1), np.linspace(0, 1, 11)),
        (sympy.Piecewise((0, t < 0.5), (500 * (t - 0.5) ** 2, True)), np.linspace(0, 1, 11)),
    ],
)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_what_is_fast_or_sets_off_is_no_jump(displacement, times, integrator):
    mechanism = uqmbd.Mechanism("slide", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    mechanism.add(PositionDriver("push", mechanism.ground, body, (0, 0), (0, 0), (1, 0), displacement))
    mechanism.output("x", body.position[0], units="m")
    found = uqmbd.simulate(mechanism, times, integrator=integrator, check=False)
    expected = sympy.lambdify(t, sympy.sympify(displacement).doit())(times[-1])
    assert found["x"].values[-1] == pytest.approx(float(expected), rel=1e-6)


def test_a_fast_rotor_with_a_break_does_not_jump():
    model = dataclasses.replace(build(turned_rod(100 * t)), added_breaks=(900.0,))
    assert position_jumps(Ensemble(model, np.zeros((1, 0))), np.array([0.0, 1000.0]), 1e-7) == {}
