"""When controllers are called, and what they see: rates, delays and cascades against exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd_springs import PointForce

MASS = 2.0


def outer(time, measured):
    return 2 * (1 - measured[:, 0])


def inner(time, measured):
    return 6 * (measured[:, 1] - measured[:, 0])


def cascade(rates, delays, begin, times):
    """Outputs (output, time): position, force, wanted speed of a mass on a line under two controllers."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=MASS)
    of_place = uqmbd.Controller(
        "outer", measured=["x"], commanded=["speed"], rate=rates[0], delay=float(delays[0]), function=outer
    )
    of_speed = uqmbd.Controller(
        "inner",
        measured=[cart.velocity[0], of_place.command()],
        commanded=["force"],
        rate=rates[1],
        delay=float(delays[1]),
        function=inner,
    )
    mechanism.add(of_place)
    mechanism.add(of_speed)
    mechanism.add(PointForce("motor", cart, 0, of_speed.command()))
    mechanism.output("x", cart.position, units="m")
    mechanism.output("force", of_speed.command(), units="N")
    mechanism.output("speed", of_place.command(), units="m/s")
    grid = begin + np.array([float(t) for t in times])
    found = uqmbd.simulate(mechanism, grid, rtol=1e-10, check=False)
    return np.array([found[name] for name in ("x", "force", "speed")])


def by_hand(rates, delays, times):
    """The same with parabolas between instants that are fractions."""
    end, found = times[-1], []
    samples = [{Fraction(k, rate) for k in range(int(end * rate) + 1)} for rate in rates]
    acting = [{t + delay for t in mine} for mine, delay in zip(samples, delays, strict=True)]
    instants = sorted(t for t in set().union(*samples, *acting, times) if t <= end)
    x = v = 0.0
    commands, waiting = [0.0, 0.0], [{}, {}]
    for now, after in zip(instants, [*instants[1:], end], strict=True):
        seen = [(x,), (v, commands[0])]
        for k, function in enumerate((outer, inner)):
            if now in samples[k]:
                waiting[k][now + delays[k]] = float(function(0.0, np.array([seen[k]]))[0])
        for k in range(2):
            if now in waiting[k]:
                commands[k] = waiting[k].pop(now)
        if now in times:
            found.append((x, commands[1], commands[0]))
        step, a = float(after - now), commands[1] / MASS
        x, v = x + v * step + a * step**2 / 2, v + a * step
    return np.array(found).T


DELAYS = st.sampled_from([Fraction(0), Fraction(1, 1000), Fraction(1, 40), Fraction(1, 10), Fraction(3, 20)])


@pytest.mark.thorough
@settings(max_examples=8, deadline=None)
@given(
    rates=st.tuples(st.sampled_from([5, 10, 12]), st.sampled_from([10, 30, 40])),
    delays=st.tuples(DELAYS, DELAYS),
    begin=st.sampled_from([0.0, -0.7, 123.4]),
    step=st.sampled_from([Fraction(1, 10), Fraction(1, 7), Fraction(1, 40)]),
    count=st.integers(1, 6),
)
def test_any_rates_and_delays_are_those_of_exact_arithmetic(rates, delays, begin, step, count):
    times = [k * step for k in range(count + 1)]
    np.testing.assert_allclose(cascade(rates, delays, begin, times), by_hand(rates, delays, times), rtol=0, atol=1e-8)
