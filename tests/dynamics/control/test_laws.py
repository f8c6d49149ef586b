"""Laws of controllers, which the driver samples: against Python, functions, closed forms, and for each lane alone."""

import chaospy
import numpy as np
import pytest
import scipy.linalg
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.control import Sampling
from uqmbd_collocation import Collocation
from uqmbd_drivers import SpeedDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, Torque

TIMES = np.linspace(0, 1, 14)  # hardly any of them is a sample
MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2), units="kg")
GAIN = uqmbd.RandomVariable("gain", chaospy.Uniform(0.5, 1.5))


def integral_law(time, measured, state):
    angle, speed = measured
    return GAIN * 5 * (0.5 - angle) - speed + state[0] * sympy.cos(time), state[0] + 0.1 * (0.5 - angle)


def integral_function(time, measured, state):
    angle, speed, gain = measured.T
    return gain * 5 * (0.5 - angle) - speed + state[:, 0] * np.cos(time), state + 0.1 * (0.5 - angle[:, None])


def bang_law(time, measured):
    return sympy.Piecewise((1.0, measured[0] < 0.5 + time), (-1.0, True)), sympy.Min(measured[1], 0.3)


def bang_function(time, measured):
    return np.where(measured[:, 0] < 0.5 + time, 1.0, -1.0), np.minimum(measured[:, 1], 0.3)


def arm(law, rates=(17, 40), delays=(0.013, 0.0), acceleration=False):
    """An arm with a wheel, under two controllers given as laws or as functions."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("arm", mass=MASS, inertia=0.1, position=(0.5, 0), angle=0.0)
    wheel = mechanism.body("wheel", mass=1, inertia=0.02, position=(1, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("tip", rod, wheel, (0.5, 0), (0, 0)))
    last = rod.angular_acceleration / 20 if acceleration else rod.angular_velocity
    slow, fast = {"law": integral_law}, {"law": bang_law}
    if not law:
        slow, fast = {"function": integral_function}, {"function": bang_function}
    slow = uqmbd.Controller(
        "slow",
        measured=[rod.angle, rod.angular_velocity, *([] if law else [GAIN])],
        commanded=["torque"],
        state=[0.1],
        rate=rates[0],
        delay=delays[0],
        limits=(-2 * GAIN, 3.0),
        **slow,
    )
    fast = uqmbd.Controller(
        "fast",
        measured=[wheel.angular_velocity, last],
        commanded=["spin", "force"],
        rate=rates[1],
        delay=delays[1],
        **fast,
    )
    mechanism.add(slow)
    mechanism.add(fast)
    mechanism.add(Torque("motor", rod, slow.command()))
    mechanism.add(Torque("spin", wheel, fast.command("spin")))
    mechanism.add(PointForce("push", rod, (0.5, 0), (0, fast.command("force"))))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("torque", slow.command(), units="N m")
    mechanism.output("integral", slow.state(0))
    mechanism.output("spin", fast.command("spin"), units="N m")
    return mechanism


def some(mechanism, count, seed=0):
    random = np.random.default_rng(seed)
    model = build(mechanism)
    return Ensemble(model, mechanism.inputs.from_uniform(random.uniform(size=(count, len(model.inputs)))))


def in_python(ensemble, times, rtol, method="dop853"):
    """Integrate with samples that Python takes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sampling, "control", lambda self: None)
        return integrate(ensemble, times, rtol, method)


@pytest.mark.parametrize(
    ("law", "delay", "method"),
    [(True, 0.013, "dop853"), (False, 0.09, "dop853"), pytest.param(True, 0.09, "radau", marks=pytest.mark.thorough)],
)
def test_the_driver_and_python_take_the_same_samples_to_the_bit(law, delay, method):
    """The delay of 0.09 s is longer than a period, so that two commands wait."""
    ensemble = some(arm(law, delays=(delay, 0.004)), 11)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sampling, "after", lambda *given: pytest.fail("Python took a sample"))
        found = integrate(ensemble, TIMES, 1e-6, method)
    assert not any(found.messages)
    assert np.array_equal(found.states, in_python(ensemble, TIMES, 1e-6, method).states)


@pytest.mark.thorough
@given(
    st.tuples(st.integers(1, 60), st.integers(1, 60)),
    st.tuples(st.sampled_from([0.0, 0.004, 0.05, 0.3]), st.sampled_from([0.0, 0.025, 0.1])),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=12, deadline=None)
def test_random_rates_and_delays(rates, delays, acceleration, seed):
    """Functions compute the same to rounding; a part of the realisations has the same bits."""
    laws = some(arm(True, rates, delays, acceleration), 9, seed)
    functions = some(arm(False, rates, delays, acceleration), 9, seed)
    found = integrate(laws, TIMES, 1e-9, "dop853")
    assert np.array_equal(found.states, in_python(laws, TIMES, 1e-9).states)
    other = integrate(functions, TIMES, 1e-9, "dop853")
    assert found.messages == other.messages
    assert np.array_equal(other.states, in_python(functions, TIMES, 1e-9).states)
    # a comparison in the law may turn out differently by rounding, so that only one sample may differ
    same = np.abs(found.states - other.states).max(axis=(1, 2)) < 1e-7
    assert same.mean() > 0.7
    part = np.arange(9)[seed % 4 :: 2]
    assert np.array_equal(integrate(laws.select(part), TIMES, 1e-9, "dop853").states, found.states[part])


def test_a_delayed_loop_is_the_recursion_of_sampled_systems():
    """A mass under PD control with zero-order hold and a delay of half a period (Astrom and Wittenmark, section 2.3)."""
    mass, rate, delay, kp, kd = 2.0, 10.0, 0.05, 8.0, 6.0
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=mass, position=1.0)
    controller = uqmbd.Controller(
        measured=[cart.position[0], cart.velocity[0]],
        commanded=["force"],
        rate=rate,
        delay=delay,
        law=lambda time, measured: -kp * measured[0] - kd * measured[1],
    )
    mechanism.add(controller)
    mechanism.add(PointForce("motor", cart, 0, controller.command()))
    mechanism.output("x", cart.position[0], units="m")
    times = np.arange(21) / rate
    found = uqmbd.simulate(mechanism, times, check=False)["x"].values
    held = [
        scipy.linalg.expm(np.array([[0, 1, 0], [0, 0, 1 / mass], [0, 0, 0]]) * t) for t in (delay, 1 / rate - delay)
    ]
    state, expected = np.array([1.0, 0.0, 0.0]), [1.0]
    for _ in times[1:]:
        command = -kp * state[0] - kd * state[1]
        state = held[0] @ state
        state[2] = command
        state = held[1] @ state
        expected.append(state[0])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def failing(law):
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=MASS)
    given = {"law": lambda time, x: sympy.log(1.5 - x[0])} if law else {"function": logarithm}
    controller = uqmbd.Controller(measured=["x"], commanded=["force"], rate=20, limits=(-1, 4 * MASS - 3.5), **given)
    mechanism.add(controller)
    mechanism.add(PointForce("motor", cart, 0, 2 + controller.command()))
    mechanism.output("x", cart.position[0], units="m")
    return mechanism


def logarithm(time, x):
    with np.errstate(all="ignore"):
        return np.log(1.5 - x[:, 0])


def test_a_sample_without_a_value_ends_one_realisation():
    """The message is that of a function; the others have the bits that they have without it."""
    mass, times = np.array([[0.7], [0.9], [40.0], [0.8], [80.0]]), np.linspace(0, 2, 9)
    ensembles = [Ensemble(build(failing(law)), mass) for law in (True, False)]
    found, other = (integrate(ensemble, times, 1e-8, "dop853") for ensemble in ensembles)
    assert found.messages == other.messages
    assert [bool(text) for text in found.messages] == [True, True, False, True, False]
    assert "its command 'force' is nan" in found.messages[0]
    alone = integrate(ensembles[0].select(np.array([2, 4])), times, 1e-8, "dop853")
    assert np.array_equal(alone.states, found.states[[2, 4]])
    np.testing.assert_allclose(found.states, other.states, rtol=1e-9, atol=1e-9)


def test_limits_in_the_wrong_order_fail_at_the_start():
    mechanism = failing(law=True)
    found = integrate(Ensemble(build(mechanism), np.array([[1.0], [0.6]])), TIMES, 1e-6, "dop853")
    assert not found.messages[0]
    assert "limits of 'force' are -1 and -1.1" in found.messages[1]


@pytest.mark.thorough
def test_other_methods_and_integrators_take_the_same_samples():
    mechanism = arm(law=True, delays=(0.013, 0.004))
    ensemble = some(mechanism, 3)
    found = integrate(ensemble, TIMES, 1e-9, "dop853").states
    for method, allowed in (("ida", 1e-5), ("auto", 1e-8), ("radau", 1e-6)):
        np.testing.assert_allclose(integrate(ensemble, TIMES, 1e-9, method).states, found, rtol=0, atol=allowed)


def cart_to(place):
    """A cart that a law moves to a place, with an integral of the difference."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=MASS)

    def law(time, measured, state):
        position, speed = measured
        return 8 * (place - position) - 6 * speed + state[0], state[0] + 0.1 * (place - position)

    controller = uqmbd.Controller(
        measured=["x", cart.velocity[0]], commanded=["force"], rate=20, law=law, state=[0.0], delay=0.01
    )
    mechanism.add(controller)
    mechanism.add(PointForce("motor", cart, 0, controller.command()))
    mechanism.output("x", cart.position[0], units="m")
    mechanism.output("force", controller.command(), units="N")
    return mechanism


@pytest.mark.thorough
def test_workers_change_no_bit_and_methods_agree():
    methods = [MonteCarlo(samples=20, seed=1), Galerkin(order=3), Collocation(order=3)]
    study = uqmbd.Study("cart", cart_to(1.0), TIMES, methods, rtol=1e-9)
    one, two = study.run(workers=1), study.run(workers=2)
    for node in ("monte-carlo", "galerkin", "collocation"):
        for name in ("mean", "std"):
            assert np.array_equal(one[node]["statistics"][name], two[node]["statistics"][name])
            chaoses = (one[label]["statistics"][name] for label in ("galerkin", "collocation"))
            np.testing.assert_allclose(*chaoses, rtol=0, atol=1e-4)


def test_a_commanded_speed_is_sampled_in_python():
    """The impulse at a sample needs a decision: the speed is that of the law right after each sample."""
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=0.1)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    controller = uqmbd.Controller(measured=[wheel.angle], commanded=["speed"], rate=4, law=lambda t, x: 1 + t - x[0])
    mechanism.add(controller)
    mechanism.add(SpeedDriver("drive", mechanism.ground, wheel, controller.command()))
    mechanism.output("angle", wheel.angle, units="rad")
    times, angle = np.arange(5) / 4, [0.0]
    found = uqmbd.simulate(mechanism, times)["angle"]
    for time in times[:-1]:
        angle.append(angle[-1] + 0.25 * (1 + time - angle[-1]))
    np.testing.assert_allclose(found, angle, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"law": lambda time, x: x[3]}, "its law raised IndexError"),
        ({"law": lambda time, x: np.where(x[0] > 1, 1, 2)}, "its law raised TypeError"),
        ({"law": lambda time, x: (x[0], x[0])}, "the law's commands has 2 numbers, expected 1"),
        ({"law": lambda time, x: x[0] + sympy.Symbol("k")}, "the law of 'force' contains k; expected an expression"),
        ({"law": lambda time, x: sympy.besselj(0, x[0])}, "besselj is not supported"),
        ({"law": lambda time, x, s: x[0], "state": [1]}, r"expected the pair \(commands, state\)"),
        ({"law": 3}, "law is 3; expected a function"),
        ({"law": bang_law, "function": bang_function}, "function and law are both given; expected one of them"),
        ({}, "function is None; expected a function"),
    ],
)
def test_invalid_laws_have_a_message(given, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        uqmbd.Controller(measured=["x"], commanded=["force"], **given)
