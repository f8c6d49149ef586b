"""The choice between the explicit and the implicit integrator is made by counts, for each realisation on its own."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integration import integrate_by_dop853
from uqmbd.dynamics.integration.ida import can_finish_with_ida
from uqmbd_joints import Revolute
from uqmbd_springs import Bushing, SpringDamper

MASS, BALL, INERTIA, BALL_INERTIA, ANGLE, G = 1.0, 1e-3, 0.1, 0.01, 0.3, 9.81


def oscillator(stiffness, damping=0.0):
    """A mass on a spring, from 0.5 m at rest."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=(1.5,))
    k = uqmbd.RandomVariable("k", chaospy.Uniform(0.5 * stiffness, 2 * stiffness))
    mechanism.add(
        SpringDamper("spring", mechanism.ground, mass, (0,), (0,), stiffness=k, damping=damping, free_length=1)
    )
    return build(mechanism)


def pendulum_with_a_ball():
    """A light ball on a stiff bushing with damping: explicit steps are limited by stability."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    at = (np.sin(ANGLE), -np.cos(ANGLE))
    rod = mechanism.body("rod", mass=MASS, inertia=INERTIA, position=at)
    mechanism.add(Revolute("pin", mechanism.ground, rod, at=(0, 0)))
    ball = mechanism.body("ball", mass=BALL, inertia=BALL_INERTIA, position=at)
    mechanism.add(Bushing("weld", rod, ball, at=at, stiffness=1e6, damping=1.2 * np.sqrt(1e6 * BALL)))
    return build(mechanism)


def test_stiff_steps_are_implicit():
    """The ball as good as welded: a physical pendulum; IDA would need a million residuals."""
    times = np.linspace(0, 2, 21)
    found = integrate(Ensemble(pendulum_with_a_ball(), np.zeros((1, 0))), times)
    assert found.messages == ("",)
    assert found.counters.by_radau == found.counters.stiff == 1
    assert found.counters.steps < 500
    assert found.counters.residuals == 0
    mass, inertia = MASS + BALL, INERTIA + BALL_INERTIA

    def rate(_, y):
        return [y[1], -mass * G * np.sin(y[0]) / (mass + inertia)]

    expected = solve_ivp(rate, (0, 2), [ANGLE, 0], "DOP853", times, rtol=1e-11, atol=1e-12).y[0]
    np.testing.assert_allclose(found.states[0, :, 0], np.sin(expected), atol=2e-4)  # the bushing yields


@pytest.mark.thorough
def test_many_steps_that_are_cheaper_are_taken():
    """More than the explicit method takes where it is not compared; x = cos(1e4 t) / 2."""
    times = np.linspace(0, 8, 9)
    ensemble = Ensemble(oscillator(1e8), np.array([[1e8]]))
    alone = integrate(ensemble, times, 1e-9, "dop853")
    assert "more than 20000 steps" in alone.messages[0]
    found = integrate(ensemble, times, 1e-9)
    assert found.messages == ("",)
    assert found.counters.steps > 20_000
    assert found.counters.by_dop853 == 1
    np.testing.assert_allclose(found.states[0, :, 0], 1 + np.cos(1e4 * times) / 2, atol=1e-3)


def test_what_costs_little_is_not_compared():
    ensemble = Ensemble(oscillator(100.0), np.full((9, 1), 100.0))
    found = integrate(ensemble, np.linspace(0, 10, 11))
    assert found.counters.residuals == 0
    assert found.counters.by_dop853 == 9


def test_who_integrates_depends_on_nothing_but_the_realisation():
    """Overdamped by far, beside others: what is left to the implicit method is the same alone."""
    times, damping = np.linspace(0, 2, 11), 1e5
    model = oscillator(100.0, damping)
    values = np.array([[60.0], [100.0], [150.0]])
    together = integrate_by_dop853(Ensemble(model, values), np.arange(3), times, 1e-6, comparing=True)
    for k in range(3):
        alone = integrate_by_dop853(Ensemble(model, values[k : k + 1]), np.arange(1), times, 1e-6, comparing=True)
        assert alone.messages[0] == together.messages[k]
        assert alone.explicit_cost[0] == together.explicit_cost[k] > 0
    found = integrate(Ensemble(model, values), times)
    assert found.counters.by_radau == found.counters.stiff == 3
    slow = (damping - np.sqrt(damping**2 - 4 * values)) / 2
    np.testing.assert_allclose(found.states[:, :, 0], 1 + np.exp(-slow * times) / 2, atol=1e-5)


def test_a_comparison_ends_where_it_costs_more_than_was_spent():
    ensemble, times = Ensemble(oscillator(100.0), np.array([[100.0]])), np.linspace(0, 10, 11)
    enough, whole = can_finish_with_ida(ensemble, times, 1e-6, 1e12)
    assert enough
    too_little, part = can_finish_with_ida(ensemble, times, 1e-6, 12_000 * whole.residuals / 2)
    assert not too_little
    assert 0 < part.residuals < whole.residuals / 2
