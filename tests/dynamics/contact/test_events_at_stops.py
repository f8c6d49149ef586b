"""Events at the ends of intervals, at samples and at the last output time: once, never twice, never lost."""

from __future__ import annotations

from functools import cache

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integrators import integrator_class
from uqmbd_contact import PlaneImpact
from uqmbd_springs import PointForce

G = 10.0


def dropped(height):
    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-G))
    body = mechanism.body("ball", mass=1, position=height)
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, 0, 0, 1, restitution=0.5))
    return mechanism, body


@pytest.mark.parametrize("end", [0.5, 0.5 + 3e-13, 0.5 - 3e-13])
def test_an_impact_at_the_last_time_begins_no_segment(end):
    """From 1.25 m a ball falls for 0.5 s."""
    ensemble = Ensemble(build(dropped(1.25)[0]), np.zeros((1, 0)))
    found = integrator_class("dop853")().integrate_segments(ensemble, np.array([0, end]), 1e-9)
    assert not found.message
    (segment,) = found.segments
    assert (segment.begin, segment.end) == pytest.approx((0, end), abs=1e-12)
    states = segment.states(np.array([0, end / 2, end]))
    expected = [[1.25, 0], [1.25 - G * end**2 / 8, -G * end / 2], [0, -G * end]]
    np.testing.assert_allclose(states, expected, atol=1e-9)


@pytest.mark.parametrize("shift", [0.0, -2e-14, 2e-14, 1e-13])
def test_knots_that_differ_from_samples_by_rounding_are_these(shift):
    """A force through knots and a constant command, sampled where the knots are, integrated exactly."""
    knots, forces = np.arange(11) / 10 + shift, np.array([0, 3.0, -5, 4, 7, -9, 2, 5, -7, 4, 1])
    mechanism, body = dropped(5.0)
    options = {"measured": [body.position], "commanded": ["lift"], "function": lambda time, x: 0 * x + 2.0}
    controller = mechanism.add(uqmbd.Controller(rate=10, initial=2, **options))
    mechanism.add(PointForce("lift", body, 0, controller.command() + uqmbd.spline(knots, forces)))
    times = np.array([0, 0.5, 0.95])
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-10)
    assert not found.messages[0]
    force = CubicSpline(knots, forces)
    speed, way = (force.antiderivative(k) for k in (1, 2))
    expected = 5 + (2 - G) * times**2 / 2 + way(times) - way(0) - speed(0) * times
    np.testing.assert_allclose(found.states[0, :, 0], expected, atol=1e-8)


class Gate(uqmbd.Component):
    """It is noted that a body falls past a height."""

    bodies = ("body",)
    spaces = (uqmbd.Line,)
    height = uqmbd.Parameter("m", "height")

    def terms(self, p):
        yield uqmbd.Event(p.body.position[0] - p.height, label="passing")


TOP, PUSH, TENTHS = 5.0, (1.0, 2.0), np.linspace(0, 1, 11)


@cache
def gated(sampled):
    """A ball falls past two gates; a force jumps at a given time, and a controller may do nothing every tenth of 1 s."""
    stop, first, second = (uqmbd.RandomVariable(name, chaospy.Uniform(0, 9)) for name in ("stop", "first", "second"))
    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-G))
    body = mechanism.body("ball", mass=1, position=TOP)
    push = sympy.Piecewise((PUSH[0], uqmbd.t < stop), (PUSH[1], True))
    if sampled:
        options = {"measured": [body.position], "commanded": ["lift"], "function": lambda time, x: 0 * x}
        push += mechanism.add(uqmbd.Controller(rate=10, **options)).command()
    mechanism.add(PointForce("push", body, 0, push))
    mechanism.add(Gate("gate", body, height=first))
    mechanism.add(Gate("other", body, height=second))
    return build(mechanism)


def fallen(time, stop):
    """Height at a time."""
    slow, fast = (G - push for push in PUSH)
    after = np.maximum(time - stop, 0)
    return TOP - slow * np.minimum(time, stop) ** 2 / 2 - slow * stop * after - fast * after**2 / 2


@pytest.mark.parametrize("sampled", [False, pytest.param(True, marks=pytest.mark.thorough)])
@given(
    st.lists(
        st.tuples(
            st.one_of(st.sampled_from(TENTHS[1:-1].tolist()), st.floats(0.05, 0.95)),
            st.sampled_from([0.0, 1e-16, -1e-16, 3e-15, -3e-15, 1e-13, -1e-13, 1e-12, -1e-12, 1e-10, 1e-6, -1e-3]),
            st.one_of(st.sampled_from(TENTHS[1:].tolist()), st.floats(0.05, 1.0)),
        ),
        min_size=1,
        max_size=20,
    )
)
@settings(max_examples=25, deadline=None)
def test_a_gate_that_is_passed_where_a_leg_ends_is_noted_once(sampled, cases):
    """The first at the jump of the force or next to it, the second where an output time, a sample or the end may be."""
    model = gated(sampled)
    stop, near, later = np.array(cases).T
    first = stop + near
    values = {"stop": stop, "first": fallen(first, stop), "second": fallen(later, stop)}
    ensemble = Ensemble(model, np.stack([values[name] for name in model.inputs], axis=1))
    found = integrate(ensemble, TENTHS, 1e-9)
    assert not any(found.messages)
    np.testing.assert_allclose(found.states[..., 0], fallen(TENTHS, stop[:, None]), atol=1e-12)
    none = np.full(len(cases), np.nan)
    for name, exact in (("gate", first), ("other", later)):
        noted = found.scalars.get(f"{name}: passing 1", none)
        inside = exact < 1 - 1e-12  # at the last time itself rounding decides
        np.testing.assert_allclose(noted[inside], exact[inside], rtol=0, atol=1e-12)
        assert np.all(np.isnan(noted[~inside]) | (np.abs(noted[~inside] - 1) < 1e-12))
        assert f"{name}: passing 2" not in found.scalars
