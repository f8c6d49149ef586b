"""What sums a motion up, against closed forms, SciPy's dense output and its events, and by order of convergence."""

from __future__ import annotations

import functools
import sys
from dataclasses import replace

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import uqmbd
from tests.mechanisms import pendulum
from uqmbd.dynamics import Ensemble, Trajectories, integrate, running_minimum, scalars_of
from uqmbd.dynamics.summaries import Domain
from uqmbd.propagation.observed_model import build_observed_model
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Distance, Revolute
from uqmbd_springs import PointForce, SpringDamper, TorsionSpringDamper

ANYWHERE = Domain(None, ())
"""An expression that is real and finite."""


class Stages:
    """The classical method of order 4 with steps of its own, which returns states at the times alone."""

    name = "stages"
    longest = 1e-3

    def integrate(self, ensemble, times, rtol):
        """Integrate by steps of even length between the times."""
        states = [ensemble.start.state]
        for begin, end in zip(times[:-1], times[1:], strict=True):
            count = int(np.ceil((end - begin) / self.longest))
            h, y = (end - begin) / count, states[-1]
            for k in range(count):
                t = begin + k * h
                a = ensemble.rates(t, y)
                b = ensemble.rates(t + h / 2, y + h / 2 * a)
                c = ensemble.rates(t + h / 2, y + h / 2 * b)
                d = ensemble.rates(t + h, y + h * c)
                y = y + h / 6 * (a + 2 * b + 2 * c + d)
            states.append(y)
        return Trajectories(np.asarray(times), np.stack(states, axis=1), ("",) * len(ensemble))


@pytest.fixture
def stages(monkeypatch):
    """Offer that method for one test."""
    module = sys.modules["uqmbd.dynamics.integrators.dispatch"]
    known = module.integrator_class
    monkeypatch.setattr(module, "integrator_class", lambda name: Stages if name == "stages" else known(name))
    monkeypatch.setattr(module, "require_for", lambda *_: None)


def drawn(self, ensemble, times, rtol):
    """Draw the states at all times: a motion that no number of times resolves."""
    shape = (len(ensemble), len(times), ensemble.model.layout.width)
    return Trajectories(np.asarray(times), np.random.default_rng(1).normal(size=shape), ("",) * shape[0])


def oscillator():
    """A mass on a spring: x = 1.5 + cos(10 t) / 2."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(2, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), 100, free_length=1.5))
    x, v = mass.position[0], mass.velocity[0]
    expected = {
        "largest": (uqmbd.maximum(x), 2.0),
        "smallest": (uqmbd.minimum(x), 1.0),
        "fastest": (uqmbd.maximum(v), 5.0),
        "when": (uqmbd.time_of_maximum(v), 0.15 * np.pi),
        "area": (uqmbd.integral(x), 1.5 + 0.05 * np.sin(10)),
        "rms": (uqmbd.root_mean_square(v), np.sqrt(12.5 - 25 * np.sin(20) / 40)),
        "last": (uqmbd.final(x), 1.5 + 0.5 * np.cos(10)),
        "middle": (uqmbd.first_time(x <= 1.5), 0.05 * np.pi),
        "range": (uqmbd.maximum(v) - uqmbd.minimum(v), 10.0),
        "turning": (uqmbd.minimum(sympy.Abs(v)), 0.0),
        "path": (uqmbd.integral(sympy.Abs(v)), 3 + 0.5 * (1 + np.cos(10))),
        "least": (uqmbd.time_of_minimum((x - 1.2) ** 2), np.arccos(-0.6) / 10),
    }
    for name, (expression, _) in expected.items():
        mechanism.output(name, expression)
    return mechanism, np.array([value for _, value in expected.values()])


def found(mechanism, times, rtol=1e-6, method="auto", values=None):
    model = build_observed_model(mechanism, float(times[0]))
    means = model.parameters.__class__ and np.array([mechanism.inputs.means]) if values is None else values
    ensemble = Ensemble(model, means)
    return scalars_of(ensemble, integrate(ensemble, np.asarray(times, dtype=float), rtol, method, between=True))


@pytest.mark.parametrize("method", ["auto", "dop853", "ida", "stages"])
def test_closed_forms_of_an_oscillator(method, stages):
    """Two output times are enough: what is between them comes from the steps of the integrator."""
    mechanism, expected = oscillator()
    got = found(mechanism, [0, 1], 1e-7, method)
    assert got.messages == ("",)
    assert not got.censored.any()
    np.testing.assert_allclose(got.values[0], expected, atol=5e-6, rtol=2e-6)


def test_errors_fall_with_the_tolerance():
    """As those of the integration do: nothing of the interpolation is left over."""
    mechanism, expected = oscillator()
    for method in ("dop853", "ida"):
        errors = [np.abs(found(mechanism, [0, 1], rtol, method).values[0] - expected) for rtol in (1e-4, 1e-7, 1e-10)]
        assert (errors[1] < 1e-5).all()
        assert (errors[2] < 3e-9).all()
        assert errors[2].max() < errors[1].max() < errors[0].max() < 1e-3


def test_errors_of_a_given_spacing_fall_with_its_order(stages, monkeypatch):
    """Of an integrator without steps of its own: with the eighth power of the spacing of its states."""
    from uqmbd.dynamics.integration import interpolate_steps
    from uqmbd.dynamics.summaries.motion import motion_of

    mechanism, _ = oscillator()
    ensemble = Ensemble(build_observed_model(mechanism, 0.0), np.zeros((1, 0)))
    errors = []
    for count in (17, 33, 65):
        times = np.linspace(0, 1, count)

        def exact(t):
            return np.stack([1.5 + 0.5 * np.cos(10 * t), 0 * t, -5 * np.sin(10 * t), 0 * t], axis=-1)

        path = interpolate_steps(times, exact(times)[None], None, np.zeros(1, dtype=np.int64))
        motion = motion_of(ensemble, path, np.zeros(1, dtype=np.int64), 0.0, np.zeros((1, 4)))
        steps = np.arange(len(motion.course.owner))
        states, moments = motion.course.states_of(steps, 0.0 * steps, np.ones(len(steps)))
        errors.append(np.abs(states - exact(moments)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 7).all(), orders


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_output_times_change_nothing(method):
    """The integrator's steps do not depend on them, and so what is found on the steps does not: to the bit."""
    mechanism, _ = oscillator()
    few, many = (found(mechanism, times, method=method).values for times in ([0, 1], np.linspace(0, 1, 78)))
    last = list(mechanism.scalars).index("last")
    np.testing.assert_array_equal(np.delete(few, last, axis=1), np.delete(many, last, axis=1))


def test_realisations_depend_on_nothing_but_themselves(monkeypatch):
    """To the bit: alone, and among others in another order, however many are resolved at once."""
    mechanism = pendulum(loaded=True)
    tip, pin = mechanism.outputs["x"].expression, mechanism.components["pin"]
    mechanism.output("peak", uqmbd.maximum(sympy.Abs(pin.reaction_force[0])))
    mechanism.output("rms", uqmbd.root_mean_square(tip))
    mechanism.output("kinked", uqmbd.integral(sympy.Abs(tip - 0.5)))
    mechanism.output("first", uqmbd.first_time(tip <= -0.9))
    values = np.stack([np.random.default_rng(0).normal(1, 0.02, 70), np.linspace(0.8, 1.2, 70)], axis=1)
    model = build_observed_model(mechanism, 0.0)
    outputs = model.outputs

    def run(rows):
        ensemble = Ensemble(model, values[rows])
        trajectories = integrate(ensemble, np.linspace(0, 2, 11), 1e-6, "dop853", between=True)
        return scalars_of(ensemble, trajectories), running_minimum(ensemble, outputs, trajectories, ANYWHERE)[0]

    whole, margins = run(np.arange(70))
    assert (whole.status == 0).all()
    monkeypatch.setattr(sys.modules["uqmbd.dynamics.summaries.summaries"], "AT_ONCE", 4)
    for rows in ([5], [69, 3, 17, 44, 1, 0, 12, 13, 30], [2, 68]):
        some, its = run(np.array(rows))
        np.testing.assert_array_equal(some.values, whole.values[rows])
        np.testing.assert_array_equal(some.censored, whole.censored[rows])
        np.testing.assert_array_equal(its, margins[rows])


@pytest.mark.parametrize("method", ["auto", "ida"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10])
def test_the_first_of_equal_peaks_is_when_it_is_largest(method, rtol):
    """Fifteen periods of an oscillator, whose peaks differ by errors of the integration alone; and half periods."""
    mechanism = oscillator()[0]
    v = mechanism.bodies["mass"].velocity[0]
    mechanism.output("slowest", uqmbd.time_of_minimum(v))
    mechanism.output("size", uqmbd.time_of_maximum(sympy.Abs(v)))
    got = dict(zip(mechanism.scalars, found(mechanism, [0, 10], rtol, method).values[0], strict=True))
    expected = {"when": 0.15 * np.pi, "slowest": 0.05 * np.pi, "size": 0.05 * np.pi}
    assert {name: got[name] for name in expected} == pytest.approx(expected, abs=2e-3 if rtol > 1e-5 else 1e-4)


def swinging():
    """A rod on a pin with a spring and a damper, all of it random."""
    angle, speed, damping, level = (
        uqmbd.RandomVariable(name, chaospy.Uniform(low, high))
        for name, low, high in (
            ("angle", -1.5, 1.5),
            ("speed", -4, 4),
            ("damping", 0, 0.4),
            ("level", -0.9, 0.9),
        )
    )
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    pose = (sympy.cos(angle) / 2, sympy.sin(angle) / 2)
    rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=pose, angle=angle, angular_velocity=speed)
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, rod, stiffness=0, damping=damping))
    tip = rod.point((0.5, 0))[0]
    mechanism.output("largest", uqmbd.maximum(tip))
    mechanism.output("smallest", uqmbd.minimum(tip))
    mechanism.output("area", uqmbd.integral(tip))
    mechanism.output("first", uqmbd.first_time(tip <= level))
    return mechanism


SWINGING = functools.cache(lambda: build_observed_model(swinging(), 0.0))


@settings(max_examples=15, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    angle=st.floats(-1.5, 1.5),
    speed=st.floats(-4, 4),
    damping=st.floats(0, 0.4),
    level=st.floats(-0.9, 0.9),
    end=st.floats(0.3, 4),
)
@pytest.mark.thorough
def test_a_pendulum_agrees_with_scipy(angle, speed, damping, level, end):
    """Extremes and first times of its tip, by SciPy's dense output and events at a tight tolerance."""
    ensemble = Ensemble(SWINGING(), np.array([[angle, damping, level, speed]]))
    got = scalars_of(ensemble, integrate(ensemble, np.array([0, end]), 1e-8, "dop853", between=True))

    def rates(t, y):
        moment = -0.5 * 9.81 * np.cos(y[0]) - damping * y[1]
        return [y[1], 3 * moment, np.cos(y[0])]

    def level_reached(t, y):
        return np.cos(y[0]) - level

    solution = solve_ivp(
        rates, (0, end), [angle, speed, 0], "DOP853", dense_output=True, rtol=1e-11, atol=1e-12, events=level_reached
    )
    grid = np.linspace(0, end, 1001)
    for k, sign in enumerate((-1, 1)):
        values = sign * np.cos(solution.sol(grid)[0])
        best = int(values.argmin())
        inside = (grid[max(best - 1, 0)], grid[min(best + 1, 1000)])
        refined = minimize_scalar(
            lambda t, sign=sign: sign * np.cos(solution.sol(t)[0]),
            bounds=inside,
            method="bounded",
            options={"xatol": 1e-10},
        )
        assert got.values[0, k] == pytest.approx(sign * min(refined.fun, values.min()), abs=3e-6)
    assert got.values[0, 2] == pytest.approx(solution.y[2, -1], abs=3e-6)
    lowest = -got.values[0, 1] + level
    if np.cos(angle) <= level:
        assert got.values[0, 3] == 0.0
    elif lowest < -1e-5:
        assert got.censored[0, 3]
    elif lowest > 1e-5:
        assert not got.censored[0, 3]
        slope = max(abs(np.sin(got.values[0, 3])), 1e-2)
        crossing = solution.t_events[0][0]
        there = np.cos(solution.sol(got.values[0, 3])[0])
        assert abs(there - level) < 1e-5
        assert got.values[0, 3] <= crossing + 1e-4 / slope


def test_both_sides_of_an_impact_count():
    """A ball falls by 1 m and bounces with a restitution of 0.8: its speeds right before and after are extremes."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=(0, 1))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
    speed = ball.velocity[1]
    mechanism.output("down", uqmbd.minimum(speed))
    mechanism.output("up", uqmbd.maximum(speed))
    mechanism.output("when", uqmbd.time_of_maximum(speed))
    mechanism.output("low", uqmbd.minimum(ball.position[1]))
    mechanism.output("second", uqmbd.maximum(sympy.Piecewise((ball.position[1], uqmbd.t > 0.5), (0, True))))
    fall, fast = np.sqrt(2 / 9.81), np.sqrt(2 * 9.81)
    got = found(mechanism, [0, 1.0])
    np.testing.assert_allclose(got.values[0], [-fast, 0.8 * fast, fall, 0, 0.64], atol=1e-6)


def test_a_ball_that_comes_to_rest():
    """Contact forces where it lasts are those of rest, and no state in between is beside the contact."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=2, position=(0, 0.01))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.5))
    mechanism.output("least", uqmbd.minimum(sympy.Piecewise((ball.acceleration[1], uqmbd.t > 0.5), (0, True))))
    mechanism.output("up", uqmbd.maximum(sympy.Piecewise((ball.position[1], uqmbd.t > 0.5), (0, True))))
    got = found(mechanism, [0, 1.0])
    np.testing.assert_allclose(got.values[0], [0, 0], atol=1e-8)


def test_forces_that_jump_count_on_both_sides():
    """A force is 3 N until 0.4 s, then 7 N, and pulls back from 0.7 s on."""
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2)
    force = sympy.Piecewise((3, uqmbd.t < 0.4), (7, uqmbd.t < 0.7), (-1, True))
    mechanism.add(PointForce("force", mass, (0, 0), (force, 0)))
    mechanism.output("most", uqmbd.maximum(mass.acceleration[0]))
    mechanism.output("when", uqmbd.time_of_maximum(mass.acceleration[0]))
    mechanism.output("least", uqmbd.minimum(mass.acceleration[0]))
    mechanism.output("first", uqmbd.first_time(mass.acceleration[0] >= 3))
    mechanism.output("work", uqmbd.integral(mass.acceleration[0]))
    for method in ("auto", "ida"):
        got = found(mechanism, [0, 1.0], method=method)
        np.testing.assert_allclose(got.values[0], [3.5, 0.4, -0.5, 0.4, 0.6 + 1.05 - 0.15], atol=1e-9)


def test_what_does_not_happen_is_censored():
    """Neither a failure nor a number, and what else there is stays."""
    mechanism, _ = oscillator()
    mechanism.output("never", 2 * uqmbd.first_time(mechanism.bodies["mass"].position[0] >= 3))
    got = found(mechanism, [0, 1])
    assert (got.status == 0).all()
    assert got.censored[0].tolist() == [False] * (len(mechanism.scalars) - 1) + [True]
    assert np.isnan(got.values[0, -1])
    assert np.isfinite(got.values[0, :-1]).all()


def test_what_is_not_finite_before_is_not_censored():
    """A logarithm that is none at first, in a body that moves evenly: nothing is known of when it is reached."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Translational())
    x = mechanism.body("body", mass=1, position=(1, 0), velocity=(1, 0)).position[0]
    mechanism.output(
        "before", uqmbd.first_time(-sympy.log(3.0 - 1.0 * x) >= 0), units="s"
    )  # at x = 2, undefined from 3 on
    got = found(mechanism, [0, 10])
    assert got.status[0] == 0 and got.values[0, 0] == pytest.approx(1, abs=1e-6)
    mechanism.output("unknown", uqmbd.first_time(sympy.log(1.0 * x - 3) >= 0), units="s")
    got = found(mechanism, [0, 10])
    assert got.status[0] != 0 and not got.censored.any()
    assert "'unknown' is not finite" in got.messages[0]


@pytest.mark.parametrize("method", ["dop853", "ida"])
def test_running_minima_are_those_of_many_times(method):
    """Not above any value so far, and no lower than the lowest of 24,001 by more than these are apart."""
    mechanism = pendulum(loaded=True)
    model = build_observed_model(mechanism, 0.0)
    ensemble = Ensemble(model, np.array([[1.0, 1.0], [0.98, 1.1]]))
    times, dense = np.linspace(0, 3, 13), np.linspace(0, 3, 24_001)
    path = integrate(ensemble, times, 1e-8, method, between=True)
    got, _ = running_minimum(ensemble, model.outputs, path, ANYWHERE)
    values = ensemble.outputs(dense, integrate(ensemble, dense, 1e-8, method).states)
    so_far = np.minimum.accumulate(values, axis=2)[:, :, np.searchsorted(dense, times - 1e-9)]
    np.testing.assert_allclose(got, so_far, atol=2e-6)
    assert (np.diff(got, axis=2) <= 0).all()


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@pytest.mark.parametrize("count", [2, 11])
def test_an_output_that_jumps_with_the_state_has_no_value_that_it_never_takes(integrator, count):
    """A polynomial through values on both sides of a jump overshoots; the last step of IDA passes many times."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Translational())
    x = mechanism.body("body", mass=1, velocity=(1, 0)).position[0]
    between = sympy.Piecewise((1, (x > 2.2) & (x < 2.3)), (0, True))
    expected = {
        "pulse": (uqmbd.maximum(between), 1.0),
        "until": (uqmbd.maximum(sympy.Piecewise((x, x <= 4.4), (0, True))), 4.4),
        "least": (uqmbd.minimum(sympy.sign(x - 3.3)), -1.0),
        "first": (uqmbd.first_time(between >= 1), 2.2),
        "within": (uqmbd.integral(between), 0.1),
    }
    for name, (expression, _) in expected.items():
        mechanism.output(name, expression)
    found = uqmbd.simulate(mechanism, np.linspace(0, 10, count), integrator=integrator)
    for name, (_, value) in expected.items():
        assert float(found[name]) == pytest.approx(value, abs=1e-5), name


@pytest.mark.thorough
def test_tiny_steps_beside_long_ones_do_not_spoil_the_motion_between_them():
    """IDA goes on with steps a thousand times shorter where one was refused, and their states have noise."""
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1, position=(1, 0), velocity=(0, 20), angular_velocity=20)
    mechanism.add(Revolute("bearing", mechanism.ground, body, (0, 0), (-1, 0)))
    x, v = body.position, body.velocity
    mechanism.output("slowest", uqmbd.minimum(v[0] ** 2 + v[1] ** 2))
    mechanism.output("nearest", uqmbd.minimum(x[0] ** 2 + x[1] ** 2))
    found = uqmbd.simulate(mechanism, [0, 3], integrator="ida", rtol=1e-8)
    assert float(found["slowest"]) == pytest.approx(400, rel=1e-7)
    assert float(found["nearest"]) == pytest.approx(1, rel=1e-7)


@pytest.mark.thorough
def test_a_motion_that_no_number_of_times_resolves_is_reported(stages, monkeypatch):
    monkeypatch.setattr(Stages, "integrate", drawn)
    model, values = build_observed_model(oscillator()[0], 0.0), np.zeros((2, 0))
    with pytest.warns(
        UserWarning, match="'oscillator'.*not resolved in 2 of 2.*16384 further times.*another integrator"
    ):
        integrate(Ensemble(model, values), np.array([0.0, 1.0]), 1e-6, "stages", between=True)


def test_a_realisation_that_fails_at_more_times_only_is_that_of_fewer(stages, monkeypatch):
    """Which is told, too; one that fails from the first on has failed."""

    def fussy(self, ensemble, times, rtol):
        found = drawn(self, ensemble, times, rtol)
        return replace(found, messages=("no",) * len(ensemble)) if len(times) > most else found

    monkeypatch.setattr(Stages, "integrate", fussy)
    ensemble = Ensemble(build_observed_model(oscillator()[0], 0.0), np.zeros((2, 0)))
    most = 1000
    with pytest.warns(UserWarning, match="in 2 of 2.*the integrator fails at further times"):
        got = integrate(ensemble, np.array([0.0, 1.0]), 1e-6, "stages", between=True)
    assert got.messages == ("", "")
    most = 100
    got = integrate(ensemble, np.array([0.0, 1.0]), 1e-6, "stages", between=True)
    assert got.messages == ("no", "no")


def test_where_all_motions_fail_the_reason_is_reported_and_not_that_there_is_nothing_to_sum_up():
    """A body on a string of 1 m is pulled aside from 0.5 m by 2 m/s: the string is taut after 0.25 s, whatever its mass."""
    mechanism = uqmbd.Mechanism("string", uqmbd.Planar())
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
    body = mechanism.body("body", mass=mass, inertia=1, position=(0.5, 0.8))
    mechanism.add(Distance("string", mechanism.ground, body, (0, 0), (0, 0), 1.0))
    pull = 0.5 + 2 * uqmbd.t
    mechanism.add(PositionDriver("pull", mechanism.ground, body, (0, 0), (0, 0), axis_i=(1, 0), displacement=pull))
    mechanism.output("highest", uqmbd.maximum(body.position[1]), units="m")
    mechanism.require("low", body.position[1] <= 2)
    study = uqmbd.Study("string", mechanism, np.linspace(0, 1, 11), [Collocation(order=2)])
    with pytest.raises(uqmbd.IntegrationError, match=r"3 of 3 nodes failed.*at t = 0\.25 s: the mechanism locks up"):
        study.run()
