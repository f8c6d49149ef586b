"""Steps of order 5 between samples of controllers, compared with the exact motion of linear systems."""

import math

import chaospy
import numpy as np
import pytest
import scipy.linalg
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_springs import PointForce

STIFFNESS = (10.0, 40.0, 900.0, 2.5e3, 1e4, 9e4, 25.0, 1e6, 4e4, 100.0)


def oscillator(rate, delay=0.0):
    """A mass of 1 kg on a spring and a damper, pulled to 1 m by a sampled force."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(1, 1e6), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=0.3, velocity=-0.2)
    spring = -stiffness * body.position[0] - 0.4 * body.velocity[0]
    mechanism.add(PointForce("spring", body, 0, spring))

    def law(time, measured):
        place, speed = measured
        return 5 * (1 - place) - speed

    measured = [body.position[0], body.velocity[0]]
    loop = mechanism.add(uqmbd.Controller("loop", measured, {"force": "N"}, rate=rate, law=law, delay=delay))
    mechanism.add(PointForce("pull", body, 0, loop.command()))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


def exact(stiffness, rate, delay, times):
    """Places (T,) at times, by exponentials between samples and changes of the force."""
    matrix = np.zeros((3, 3))
    matrix[0, 1], matrix[1] = 1, [-stiffness, -0.4, 1]
    state, now, found, waiting = np.array([0.3, -0.2, 0.0]), 0.0, [], []
    samples = np.arange(int(times[-1] * rate) + 1) / rate
    stops = [(t, 0, k) for k, t in enumerate(samples)] + [(t + delay, 1, k) for k, t in enumerate(samples)]
    stops += [(t, 2, k) for k, t in enumerate(times)]
    for at, kind, _ in sorted(stops):
        if at > times[-1]:
            break
        state, now = scipy.linalg.expm(matrix * (at - now)) @ state, at
        if kind == 0:
            waiting.append(5 * (1 - state[0]) - state[1])
        elif kind == 1:
            state[2] = waiting.pop(0)
        else:
            found.append(state[0])
    return np.array(found)


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
@pytest.mark.parametrize(("rate", "delay"), [(100, 0.0), pytest.param(100, 0.003, marks=pytest.mark.thorough)])
def test_motions_are_exact_at_samples_and_between(rate, delay, rtol):
    """Soft springs allow order 5, stiff ones more steps of order 8; samples and output times differ."""
    values = np.array(STIFFNESS)[:, None]
    ensemble, times = Ensemble(build(oscillator(rate, delay)), values), np.linspace(0, 0.35, 47)
    found = integrate(ensemble, times, rtol, "dop853")
    assert not any(found.messages)
    places = ensemble.outputs(found.times, found.states)[:, 0]
    for row, stiffness in enumerate(STIFFNESS):
        # errors of the phase grow with the number of radians
        allowed = 10 * rtol * (1 + np.sqrt(stiffness) * times[-1])
        np.testing.assert_allclose(places[row], exact(stiffness, rate, delay, times), rtol=0, atol=allowed)


@pytest.mark.parametrize(("rtol", "allowed"), [(1e-6, 1e-3), (1e-8, 1e-5)])
def test_pulses_with_the_period_of_the_samples_are_not_missed(rtol, allowed):
    """A force sin^200 of the phase acts for a twentieth of each interval, where steps may have no stage."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    size = uqmbd.RandomVariable("size", chaospy.Uniform(0.5, 2), units="N")
    body = mechanism.body("body", mass=1)
    loop = mechanism.add(
        uqmbd.Controller(
            "loop", [body.position[0]], {"force": "N"}, rate=100, law=lambda time, measured: 0 * measured[0]
        )
    )
    mechanism.add(PointForce("command", body, 0, loop.command()))
    mechanism.add(PointForce("pulses", body, 0, size * sympy.sin(100 * sympy.pi * uqmbd.t) ** 200))
    mechanism.output("speed", body.velocity[0], units="m/s")
    values = np.linspace(0.5, 2, 8)[:, None]
    ensemble = Ensemble(build(mechanism), values)
    found = integrate(ensemble, np.array([0.0, 1.0]), rtol, "dop853")
    expected = values[:, 0] * math.comb(200, 100) / 2**200
    np.testing.assert_allclose(ensemble.outputs(found.times, found.states)[:, 0, -1], expected, rtol=allowed)


def test_intervals_of_samples_need_seven_evaluations():
    """A start, six stages and the end; order 8 needs thirteen."""
    ensemble = Ensemble(build(oscillator(500)), np.array([[10.0], [40.0], [25.0]]))
    found = integrate(ensemble, np.array([0.0, 1.0]), 1e-6, "dop853")
    assert 7 * 500 <= found.counters.accelerations <= 8 * 500


def test_orders_of_steps_depend_on_no_other_realisation():
    """Lanes with steps of both orders: parts of an ensemble have the same bits."""
    ensemble, times = Ensemble(build(oscillator(100)), np.array(STIFFNESS)[:, None]), np.linspace(0, 0.35, 47)
    found = integrate(ensemble, times, 1e-7, "dop853")
    for part in (np.arange(10)[::-2], np.array([3]), np.array([0, 7])):
        some = integrate(ensemble.select(part), times, 1e-7, "dop853")
        assert np.array_equal(some.states, found.states[part])
    few = integrate(ensemble, times[[0, 20, 46]], 1e-7, "dop853")
    assert np.array_equal(few.states, found.states[:, [0, 20, 46]])
