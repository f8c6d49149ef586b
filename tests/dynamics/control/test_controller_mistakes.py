"""What goes wrong with controllers is told: where, what was given, and what was expected."""

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper, Torque

MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(1.0, 2.0), units="kg")
TIMES = [0.0, 0.1, 0.2]


def zero(time, measured):
    return np.zeros(len(measured))


def cart(function=zero, commanded=("force",), use=True, add=True, mass=MASS, **options):
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    body = mechanism.body("cart", mass=mass)
    options = {"measured": ["x"], "rate": 20} | options
    controller = uqmbd.Controller(commanded=commanded, function=function, **options)
    force = controller.command(next(iter(commanded))) if use else 1
    mechanism.add(PointForce("motor", body, (0, 0), (force, 0)))
    if add:
        mechanism.add(controller)
    mechanism.output("x", body.position[0], units="m")
    return mechanism


def two(time, measured):
    return np.zeros((len(measured), 2))


def divides(time, measured):
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(time < 0.09, 0.0, 0.0 / np.zeros(len(measured)))


def raises(time, measured):
    return measured[:, 3]


def mixes(time, measured):
    return measured[:, 0] - measured[:, 0].mean() + time * len(measured)


calls = []


def remembers(time, measured):
    calls.append(1)
    return np.full(len(measured), float(len(calls)))


def pair_missing(time, measured, state):
    return np.zeros(len(measured))


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (two, {}, r"returned commands of shape \(1, 2\) at t = 0 s; expected an array of shape \(1, 1\)"),
        (raises, {}, r"raised IndexError: .* \(test_controller_mistakes.py, line \d+\), at t = 0 s with measured of"),
        (remembers, {}, r"returns the commands 1 first, and 2 when it is called again with the same arguments"),
        (pair_missing, {"state": [0]}, r"returned an array of shape \(1,\) at t = 0 s; expected the pair"),
        (lambda t, m: "fast", {}, r"returned 'fast' as commands at t = 0 s; expected an array"),
        (zero, {"rate": 1e9}, r"1e\+09 Hz over 0.2 s needs 2e\+08 samples; expected at most 1e\+06"),
    ],
)
def test_what_a_function_does_wrong_ends_the_method(function, options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        uqmbd.simulate(cart(function, **options), TIMES)


def test_a_function_that_mixes_realisations_is_refused():
    study = uqmbd.Study("cart", cart(mixes), TIMES, propagators=[MonteCarlo(samples=10, seed=1)])
    with pytest.raises(uqmbd.UqmbdError, match="with the other 9 realisations"):
        study.run()


def any_is_fast(time, measured):
    return np.zeros(len(measured)) if (measured[:, 1] > 0.13).any() else np.ones(len(measured))


def all_are_fast(time, measured):
    return np.full(len(measured), 0.0 if (measured[:, 1] > 0.13).all() else 1.0)


@pytest.mark.parametrize("function", [any_is_fast, all_are_fast])
@pytest.mark.parametrize("samples", [8, 60])
def test_a_condition_on_any_or_all_of_a_group_is_refused(function, samples):
    """The speeds of carts of 1 to 2 kg under 1 N pass 0.13 m/s from 0.13 to 0.26 s: only then the rows differ."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    body = mechanism.body("cart", mass=MASS)
    measured = [body.position[0], body.velocity[0], body.velocity[1]]
    controller = mechanism.add(uqmbd.Controller(measured=measured, commanded=["f"], rate=33, function=function))
    mechanism.add(PointForce("motor", body, (0, 0), (controller.command("f"), 0)))
    mechanism.output("x", body.position[0], units="m")
    study = uqmbd.Study("cart", mechanism, [0.0, 0.5], propagators=[MonteCarlo(samples=samples, seed=1)])
    with pytest.raises(uqmbd.UqmbdError, match=r"with the other \d+ realisations"):
        study.run()


@pytest.mark.parametrize(
    ("function", "told"),
    [
        (lambda time, measured: measured[:, 0] + 1j, "complex numbers"),
        (lambda time, measured: np.ma.masked_greater(measured[:, 0], -1e9), "masked array with masked entries"),
        (lambda time, measured: (np.ma.masked_all(len(measured)),), "masked array with masked entries"),
        (lambda time, measured: None, "a return statement may be missing"),
    ],
)
def test_commands_that_are_no_numbers_are_refused(function, told):
    with pytest.raises(uqmbd.StudyError, match=told):
        uqmbd.simulate(cart(function), TIMES)


def test_an_initial_command_outside_of_its_limits_is_refused():
    with pytest.raises(uqmbd.StudyError, match="is 10, outside of its limits -5 to 5"):
        cart(limits=(-5, 5), initial=10)


def sometimes_nan(time, measured):
    return np.where((measured[:, 1] > 1.5) & (time > 0.09), np.nan, 1.0)


def test_a_realisation_whose_command_is_no_number_fails_and_the_others_go_on():
    mechanism = cart(sometimes_nan, measured=["x", MASS])
    problem = uqmbd.Study("cart", mechanism, TIMES, propagators=[MonteCarlo(samples=2)]).problem(MonteCarlo(samples=2))
    found = problem.realise([[1.2], [1.8], [1.4]])
    assert found.status.tolist() == [0, 2, 0]
    assert found.messages[1].endswith("'force' is nan at t = 0.1 s, where it measures x = 0.00277778, mass = 1.8")
    exact = 0.5 * 1.0 / np.array([1.2, 1.4]) * 0.2**2
    np.testing.assert_allclose(found.response[[0, 2], 0, -1], exact, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 0}, "rate is 0; expected a positive number"),
        ({"rate": "fast"}, "rate is the text 'fast'"),
        ({"delay": -1}, "delay is -1; expected a time of 0 s or more"),
        ({"limits": (1, 0)}, r"limits is \(1, 0\); expected \(smallest, largest\)"),
        ({"limits": 3}, "expected a pair"),
        (
            {"limits": {"torque": (0, 1)}},
            "limits has the key 'torque', which is not a command; the commands are: 'force'",
        ),
        ({"measured": "x"}, "expected a sequence of names of outputs"),
        ({"measured": []}, "measured is empty"),
        ({"commanded": []}, "expected the names of its commands"),
        ({"commanded": ["a", "a"]}, "contains a name twice"),
        ({"function": None}, "expected a function of"),
        ({"state": [uqmbd.t]}, "which contains t; expected a number"),
        ({"colour": "red"}, "there is no argument 'colour'"),
    ],
)
def test_arguments_are_looked_at(options, message):
    options = {"measured": ["x"], "commanded": ["force"], "function": zero} | options
    with pytest.raises(uqmbd.StudyError, match=message):
        uqmbd.Controller(**options)


def test_unknown_commands_and_states_are_reported():
    controller = uqmbd.Controller(measured=["x"], commanded=["force"], function=zero, state={"i": 0})
    with pytest.raises(uqmbd.StudyError, match="no command 'forse'; did you mean 'force'"):
        controller.command("forse")
    with pytest.raises(uqmbd.StudyError, match="no state 'j'.* Available: 'i'"):
        controller.state("j")


def test_what_is_measured_must_be_there():
    with pytest.raises(uqmbd.StudyError, match=r"measured\[0\] is 'y', but mechanism 'cart' has no such output"):
        uqmbd.simulate(cart(measured=["y"]), TIMES)
    mechanism = cart(measured=["x", "f"], mass=1)
    mechanism.output("f", uqmbd.eigenfrequency(1), units="Hz")
    with pytest.raises(uqmbd.StudyError, match="'f', which is a scalar output"):
        uqmbd.simulate(mechanism, TIMES)


def test_an_angle_that_is_wrapped_is_not_measured_by_its_name():
    """Results count its turns, and what the controller would see jumps by one."""
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=7)
    mechanism.output("wrapped", sympy.atan2(sympy.sin(wheel.angle), sympy.cos(wheel.angle)), units="rad", angle=True)
    mechanism.output("counted", wheel.angle, units="rad")
    controller = uqmbd.Controller(measured=["wrapped"], commanded=["torque"], rate=20, function=zero)
    mechanism.add(controller)
    mechanism.add(Torque("motor", wheel, controller.command()))
    with pytest.raises(
        uqmbd.StudyError, match=r"measured\[0\] is the output 'wrapped', an angle .*Measure joint.angle"
    ):
        uqmbd.simulate(mechanism, TIMES)


def test_a_command_of_a_controller_that_was_not_added_is_reported():
    with pytest.raises(
        uqmbd.StudyError, match=r"PointForce 'motor': the expression contains controller.force, but .* was not added"
    ):
        uqmbd.simulate(cart(add=False), TIMES)


def test_a_controller_without_effect_is_reported():
    with pytest.warns(uqmbd.StudyWarning, match="the command 'force' is not used"):
        uqmbd.simulate(cart(use=False), TIMES)


def test_commands_have_their_places():
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    controller = mechanism.add(uqmbd.Controller(measured=["x"], commanded=["angle"], function=zero))
    with pytest.raises(uqmbd.StudyError, match="mass: the expression contains controller.angle, which changes"):
        mechanism.body("heavy", mass=controller.command(), inertia=1)
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, wheel, controller.command()))
    mechanism.output("x", wheel.angle, units="rad")
    with pytest.raises(uqmbd.StudyError, match="its constraint contains a command of a controller. A command jumps"):
        uqmbd.simulate(mechanism, TIMES)


def test_names_are_shared_with_bodies_and_components():
    mechanism = cart()
    with pytest.raises(uqmbd.StudyError, match="the Controller 'controller' has the same name"):
        mechanism.body("controller", mass=1)
    with pytest.raises(uqmbd.StudyError, match="has already been added to mechanism 'cart'"):
        mechanism.add(mechanism.controllers["controller"])


def test_statics_and_modes_hold_commands_at_their_initial_values():
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational(gravity=(0, -10)))
    pan = mechanism.body("pan", mass=2, position=(0, -1))
    controller = mechanism.add(
        uqmbd.Controller(measured=["y"], commanded=["lift", "k"], function=two, initial={"lift": 5 * MASS, "k": 100})
    )
    mechanism.add(SpringDamper("spring", mechanism.ground, pan, (0, 0), (0, 0), controller.command("k"), free_length=1))
    mechanism.add(PointForce("lift", pan, (0, 0), (0, controller.command("lift"))))
    mechanism.output("y", pan.position[1], units="m")
    found = uqmbd.static_equilibrium(mechanism, {"mass": 1.2})
    assert float(found["y"]) == pytest.approx(-1 - (20 - 6) / 100, abs=1e-9)
    modes = uqmbd.eigenfrequencies(mechanism, {"mass": 1.2})
    assert float(modes["frequency"].max()) == pytest.approx(np.sqrt(50) / (2 * np.pi), rel=1e-6)
