"""Samples are stops of one integration: as if it began anew after each, with one call for all who are there."""

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integrators.built_in import Dop853
from uqmbd.dynamics.integrators.sampled import trajectories_in_samples
from uqmbd_drivers import SpeedDriver
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque

from ..integration.test_singular import G, locomotive, redundant, windows

TIMES = np.linspace(0, 1, 14)  # hardly any of them is a sample
MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2), units="kg")
END = uqmbd.RandomVariable("end", chaospy.Uniform(0.2, 0.8), units="s")


def two_loops(time, measured, state):
    angle, speed = measured.T
    return 5 * (0.5 - angle) - speed + state[:, 0], state + 0.1 * (0.5 - angle[:, None])


def to_speed(time, measured):
    return 0.4 * (1 + time - measured)


def arm(kind):
    """An arm under two controllers, and a force that ends at a random time, follows time, or a prescribed speed."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("arm", mass=MASS, inertia=0.1, position=(0.5, 0), angle=0.0)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    options = {"measured": [rod.angle, rod.angular_velocity], "commanded": ["torque"], "function": two_loops}
    slow = mechanism.add(uqmbd.Controller("slow", rate=17, delay=0.013, state=[0.1], **options))
    wheel = mechanism.body("wheel", mass=1, inertia=0.02, position=(1, 0))
    mechanism.add(Revolute("tip", rod, wheel, (0.5, 0), (0, 0)))
    options = {"measured": [wheel.angular_velocity], "commanded": ["torque"], "function": to_speed}
    fast = mechanism.add(uqmbd.Controller("fast", rate=40, **options))
    mechanism.add(Torque("motor", rod, slow.command()))
    if kind == "speed":
        speed = sympy.Piecewise((1.0, uqmbd.t < 0.4), (-1.0, True)) + 0.1 * fast.command()
        mechanism.add(SpeedDriver("drive", rod, wheel, speed))
    else:
        mechanism.add(Torque("spin", wheel, fast.command()))
    if kind == "breaks":
        force = sympy.Piecewise((3.0, uqmbd.t < END), (0.0, True))
        mechanism.add(PointForce("pull", rod, (0.5, 0), (0, force)))
    if kind == "time":
        mechanism.add(PointForce("pull", rod, (0.5, 0), (0, sympy.exp(-(((uqmbd.t - END) / 0.01) ** 2)))))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    mechanism.output("torque", fast.command(), units="N m")
    return mechanism


MODELS = {}


def model(kind):
    if kind not in MODELS:
        mechanism = arm(kind)
        MODELS[kind] = mechanism, build(mechanism)
    return MODELS[kind]


def some(kind, count, seed=0):
    mechanism, compiled = model(kind)
    random = np.random.default_rng(seed)
    return Ensemble(compiled, mechanism.inputs.from_uniform(random.uniform(size=(count, len(compiled.inputs)))))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["plain", "breaks", pytest.param("time", marks=pytest.mark.slow), "speed"])
def test_it_is_the_motion_that_begins_anew_after_each_sample(kind):
    """The integrator that knows nothing of samples is called for each stretch between two of them."""
    ensemble = some(kind, 11)
    found = integrate(ensemble, TIMES, 1e-10, "dop853")
    anew = trajectories_in_samples(Dop853().integrate, ensemble, TIMES, 1e-10)
    assert not any(found.messages) and not any(anew.messages)
    scale = np.abs(anew.states).max(axis=(0, 1))
    np.testing.assert_allclose(found.states / scale, anew.states / scale, rtol=0, atol=1e-7 if kind == "time" else 1e-8)
    assert found.counters.integrations == len(ensemble) < anew.counters.integrations
    assert found.counters.accelerations < anew.counters.accelerations


def test_a_stop_costs_one_evaluation_and_one_call_for_all():
    times, seen = np.linspace(0, 1, 3), []

    def counted(time, measured):
        seen.append((time, len(measured)))
        return 3 * (1 - measured)

    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=MASS, inertia=0.5)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    options = {"measured": [wheel.angular_velocity], "commanded": ["torque"], "rate": 50, "function": counted}
    controller = mechanism.add(uqmbd.Controller(**options))
    mechanism.add(Torque("motor", wheel, controller.command()))
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    found = integrate(Ensemble(build(mechanism), np.linspace(0.8, 1.2, 16)[:, None]), times, 1e-6, "dop853")
    assert found.counters.steps == 16 * 50  # a step from each sample to the next
    # the rate where a step of order 5 begins, five stages and the end, for two groups
    # of eight; the first size is guessed, and interpolants need no further stages
    assert found.counters.accelerations == 2 * (50 * 7 + 1)
    whole = [time for time, count in seen if count == 16]
    np.testing.assert_allclose(whole, np.arange(51) / 50, rtol=0, atol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["plain", "breaks"])
@given(st.integers(1, 19), st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_no_company_changes_a_bit(kind, count, seed):
    whole = some(kind, count, seed)
    chosen = np.random.default_rng(seed).permutation(count)[: 1 + seed % count]
    states = integrate(whole, TIMES, 1e-6, "auto").states
    assert np.array_equal(integrate(whole.select(np.sort(chosen)), TIMES, 1e-6, "auto").states, states[np.sort(chosen)])


def braking(time, measured):
    return -0.5 * measured


def braked(mechanism):
    """The first crank is braked from sample to sample."""
    crank = mechanism.bodies["crank0"]
    controller = mechanism.add(
        uqmbd.Controller(measured=[crank.angular_velocity], commanded=["torque"], rate=10, function=braking)
    )
    mechanism.add(Torque("brake", crank, controller.command()))
    return build(mechanism)


@pytest.mark.thorough
@redundant
def test_samples_between_singular_poses():
    """A four-bar passes its singular poses at other times in each realisation."""
    ensemble, times = (
        Ensemble(braked(windows(1, speed=MASS * 4)), np.linspace(0.8, 1.2, 5)[:, None]),
        np.linspace(0, 3, 31),
    )
    found = integrate(ensemble, times, 1e-11, "dop853")
    anew = trajectories_in_samples(Dop853().integrate, ensemble, times, 1e-11)
    assert not any(found.messages) and not any(anew.messages)
    assert found.counters.passages > 0
    np.testing.assert_allclose(found.states, anew.states, rtol=0, atol=1e-7)


@pytest.mark.thorough
@redundant
def test_samples_where_other_equations_are_chosen_on_the_way():
    """Three parallel cranks have one degree of freedom, which SciPy integrates from sample to sample."""
    times = np.linspace(0, 3, 31)
    found = integrate(Ensemble(braked(locomotive(-12.0)), np.zeros((1, 0))), times, 1e-9, "dop853")
    assert not found.messages[0]
    assert found.counters.repivots > 0
    state, angles = np.array([-1.0, -12.0]), [-1.0]
    for begin, end in zip(times[:-1], times[1:], strict=True):

        def rates(t, y, torque=-0.5 * state[1]):
            return [y[1], (torque - G * 0.4 * np.cos(y[0])) / (0.03 + 0.16)]

        state = solve_ivp(rates, (begin, end), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        angles.append(state[0])
    np.testing.assert_allclose(found.states[0, :, 0], 0.4 * np.cos(angles), rtol=0, atol=1e-6)


def damped(stiffness):
    """A mass on a line between a stiff damper and a controller."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    cart = mechanism.body("cart", mass=MASS, position=(1.1, 0))
    mechanism.add(SpringDamper("buffer", mechanism.ground, cart, (0, 0), (0, 0), stiffness, stiffness, 1.0))
    options = {
        "measured": [cart.position[0]],
        "commanded": ["force"],
        "function": lambda time, x: 10 * np.cos(3 * time),
    }
    controller = mechanism.add(uqmbd.Controller(rate=4, **options))
    mechanism.add(PointForce("push", cart, (0, 0), (controller.command(), 0)))
    mechanism.output("x", cart.position[0], units="m")
    return mechanism


@pytest.mark.thorough
def test_what_is_stiff_is_left_to_implicit_steps_between_samples():
    """The gap decays like exp(-t), and each command adds its own, but for a transient of a nanosecond."""
    stiffness = 1e8
    times = np.arange(9) / 4
    ensemble = Ensemble(build(damped(stiffness)), np.array([[0.9], [1.1]]))
    found = integrate(ensemble, times, 1e-8, "auto")
    assert not any(found.messages)
    assert found.counters.by_radau == 2
    x = np.array([0.1])
    for t in times[:-1]:
        pushed = 10 * np.cos(3 * t) / stiffness
        x = np.append(x, pushed + (x[-1] - pushed) * np.exp(-0.25))
    np.testing.assert_allclose(found.states[:, :, 0], np.array([1 + x] * 2), rtol=0, atol=1e-6)
