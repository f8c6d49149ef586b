"""Phases of swings that die down and whose middles move, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from uqmbd.propagation.chaos.dense_output import spline_through
from uqmbd.propagation.chaos.swings import QUARTER, Swing

END = 30.0


def swing_of(function, count=4096):
    times = np.linspace(0, END, count)
    values = function(times)
    return Swing.of(times, values, spline_through(times, values)), times, values


@pytest.mark.thorough
@settings(max_examples=30, deadline=None)
@given(
    st.floats(2.0, 12.0),
    st.floats(0.0, 0.05),
    st.floats(-0.5, 0.5),
    st.floats(-3.0, 3.0),
    st.booleans(),
)
def test_moments_are_the_extremes_and_the_middles_between(rate, decay, drift, phase, upwards):
    """A decaying oscillation about a middle that moves at up to half the least speed of the swing: roots by SciPy."""
    decay, sign = decay * rate, 1.0 if upwards else -1.0
    moved = drift * rate * np.exp(-decay * END)

    def value(t):
        return sign * (np.exp(-decay * t) * np.cos(rate * t + phase) + moved * t)

    def slope(t):
        return -sign * (
            np.exp(-decay * t) * (decay * np.cos(rate * t + phase) + rate * np.sin(rate * t + phase)) - moved
        )

    found, times, values = swing_of(value)
    fine = np.linspace(0, END, 40001)
    turned = np.flatnonzero(np.diff(np.sign(slope(fine))))
    extremes = np.array([brentq(slope, fine[n], fine[n + 1], xtol=1e-13) for n in turned])
    extremes = extremes[np.append(True, np.diff(extremes) > 1e-9)]  # one that is a point of the grid is found twice
    whole = found.moments[np.arange(found.first, found.first + len(found.moments)) % 2 == 0]
    # the start may be an extreme by rounding, and the end one that is not passed
    known = whole[(whole > 1e-3) & (whole < END - 1e-3)]
    size = np.abs(np.diff(value(extremes)))
    large = extremes[: 1 + int(np.flatnonzero(size >= 1e-5 * size.max())[-1]) + 1]
    large = large[(large > 1e-3) & (large < END - 1e-3)]
    assert len(known) == len(large)
    # how well an extreme is known depends on the curvature, which falls with the size
    curved = rate**2 * np.exp(-decay * large)
    assert (np.abs(known - large) * curved < 1e-6 * rate**2).all()
    # a phase that is a multiple of a turn is a highest one
    tops = found.moments[np.arange(found.first, found.first + len(found.moments)) % 4 == 0]
    bottoms = found.moments[np.arange(found.first, found.first + len(found.moments)) % 4 == 2]
    assert value(tops).mean() > value(bottoms).mean() or abs(moved) > 0
    first = int(found.first % 2)
    extreme, middle = found.moments[first::2], found.moments[first + 1 :: 2][: len(found.moments[first::2]) - 1]
    np.testing.assert_allclose(value(middle), (value(extreme)[1:] + value(extreme)[:-1]) / 2, atol=1e-6)
    # the phases grow, and are those of the moments
    until = times <= found.rest
    assert (np.diff(found.values[until & (times >= found.begin)]) > 0).all()
    marks = (found.first + np.arange(len(found.moments))) * QUARTER
    np.testing.assert_array_equal(found.passed(marks), found.moments)
    early = found.moments <= found.rest
    np.testing.assert_allclose(np.interp(found.moments[early], times, found.values), marks[early], atol=0.05)


def test_a_swing_comes_to_rest():
    """A thousandth is left after ln 1000 decay times; then it is at rest, and a smaller rest is known behind."""
    found, _, _ = swing_of(lambda t: np.exp(-0.5 * t) * np.cos(5 * t))
    assert found.rests and found.rest == pytest.approx(np.log(1000) / 0.5, abs=np.pi / 5)
    assert found.moments[-1] == pytest.approx(np.log(1e5) / 0.5, abs=2 * np.pi / 5)
    assert not swing_of(lambda t: np.exp(-0.1 * t) * np.cos(5 * t))[0].rests


def test_a_swing_that_stops_has_come_to_rest():
    found, _, _ = swing_of(lambda t: np.where(t < 4 * np.pi, np.cos(t), 1.0))
    assert found.rests and found.rest == pytest.approx(4 * np.pi, abs=0.1)


@pytest.mark.parametrize("weak", [0.05, 0.25, 0.5])
def test_sizes_that_jump_are_no_swing(weak):
    """Two frequencies: either swing is one, but none where further extremes of the other come and go."""
    found, _, _ = swing_of(lambda t: np.cos(2 * t) + weak * np.cos(9.1 * t))
    assert found.even == (weak != 0.25)


def test_what_does_not_turn_back_has_no_swing():
    assert swing_of(lambda t: t)[0] is None
    assert swing_of(lambda t: 0 * t)[0] is None
    assert swing_of(lambda t: np.exp(-t))[0] is None


def test_what_stands_has_no_swing():
    """Nor is it one that swings later: half-swings of rounding are of other sizes."""
    assert swing_of(lambda t: 0 * t + 0.7)[0] is None
    later, _, _ = swing_of(lambda t: np.where(t < 5, 1.0, np.cos(2 * (t - 5))))
    assert not later.even
    assert np.isfinite(later.values).all()


@pytest.mark.parametrize("exponent", [-600, 600])
def test_swings_know_no_units(exponent):
    """To the bit in powers of two, whose squares no number holds."""
    found, _, _ = swing_of(lambda t: np.exp(-0.1 * t) * np.cos(5 * t))
    other, _, _ = swing_of(lambda t: np.ldexp(np.exp(-0.1 * t) * np.cos(5 * t), exponent))
    np.testing.assert_array_equal(other.moments, found.moments)
    np.testing.assert_array_equal(other.values, found.values)
