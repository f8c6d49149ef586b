"""Tables in equations of motion: against piecewise integration, closed forms, and the same function as a formula."""

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd.compiled import compilations
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.equations import ParameterMap
from uqmbd.dynamics.integration.knots import TimedTable
from uqmbd_joints import PointOnPlane
from uqmbd_springs import PointForce, SpringDamper

MASS, STIFFNESS, DAMPING = 2.0, 50.0, 0.3


def oscillator(force):
    """A body on a spring along x, with a force on it."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational(gravity=(0, 0)))
    body = mechanism.body("body", mass=MASS)
    mechanism.add(PointOnPlane("guide", mechanism.ground, body, (0, 0), (0, 0), axis_i=(0, 1)))
    mechanism.add(
        SpringDamper("spring", mechanism.ground, body, (-1, 0), (0, 0), STIFFNESS, damping=DAMPING, free_length=1)
    )
    mechanism.add(PointForce("force", body, (0, 0), (force, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("force", force, units="N")
    return mechanism


def piecewise(force, knots, times):
    """Integrate from knot to knot, where the force is one cubic: SciPy at the tightest tolerance that it has."""

    def rate(t, z):
        return [z[1], (force(t) - STIFFNESS * z[0] - DAMPING * z[1]) / MASS]

    state, found = np.zeros(2), [0.0]
    for begin, end in zip(times[:-1], times[1:], strict=True):
        stops = [begin, *knots[(knots > begin) & (knots < end)], end]
        for a, b in zip(stops[:-1], stops[1:], strict=True):
            state = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-13, atol=1e-16).y[:, -1]
        found.append(state[0])
    return np.array(found)


def noisy_force():
    knots = np.linspace(0, 3, 28)
    return knots, np.random.default_rng(3).normal(size=28) * 3


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_tabulated_force_is_integrated_as_piecewise_cubics_are(integrator):
    """A force that is noise at its 28 knots, at a tight tolerance."""
    knots, values = noisy_force()
    force, times = CubicSpline(knots, values), np.linspace(0, 3, 16)
    data = uqmbd.simulate(oscillator(uqmbd.spline(knots, values)), times, rtol=1e-9, integrator=integrator)
    expected = piecewise(force, knots, times)
    np.testing.assert_allclose(data["force"], force(times), rtol=1e-13, atol=1e-13)
    assert np.abs(data["x"] - expected).max() < 2e-9 * np.abs(expected).max()


@pytest.mark.thorough
@pytest.mark.parametrize(("count", "rtol"), [(28, 1e-6), (300, 1e-6), (300, 1e-9), (900, 1e-9)])
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_samples_of_a_smooth_force_keep_the_tolerance(count, rtol, integrator):
    """However many samples: within thrice the tolerance of the piecewise solution, which a step over knots is not."""
    knots, times = np.linspace(0, 3, count), np.linspace(0, 3, 4)
    values = 10 * np.sin(5 * knots) * np.cos(11 * knots**1.5)
    expected = piecewise(CubicSpline(knots, values), knots, times)
    mechanism = oscillator(uqmbd.spline(knots, values))
    found = uqmbd.simulate(mechanism, times, rtol=rtol, integrator=integrator, check=False)["x"]
    assert np.abs(found - expected).max() < 3 * rtol * np.abs(expected).max()


def shifted(place):
    """Argument of a table, a function of time with a random number in it, and what it is for a number."""
    x = uqmbd.RandomVariable("x", chaospy.Uniform(0.9, 1.1), "1")
    return {"slope": (uqmbd.t * x, lambda v: (v, 0.0)), "offset": (uqmbd.t + x - 0.9, lambda v: (1.0, v - 0.9))}[place]


@pytest.mark.thorough
@pytest.mark.parametrize(("count", "rtol"), [(3, 1e-9), (20, 1e-6)])
@pytest.mark.parametrize("place", ["slope", "offset"])
def test_a_table_over_random_times_keeps_the_tolerance(place, count, rtol):
    """Realisations that share steps, with knots at times of their own, few and many: the antiderivative of SciPy."""
    knots, times = np.linspace(0, 3, 301), np.linspace(0, 1.2, 4)
    values = np.random.default_rng(0).normal(size=301)
    argument, line = shifted(place)
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    body = mechanism.body("body", mass=MASS, velocity=(1, 0))
    mechanism.add(PointForce("force", body, (0, 0), (uqmbd.spline(knots, values)(argument), 0)))
    mechanism.output("x", body.position[0], units="m")
    shares = np.linspace(0.93, 1.07, count)
    found = integrate(Ensemble(build(mechanism), shares[:, None]), times, rtol, "dop853").states[:, :, 0]
    once, twice = (CubicSpline(knots, values).antiderivative(k) for k in (1, 2))
    slope, offset = (np.array(x)[:, None] for x in zip(*map(line, shares), strict=True))
    moved = twice(slope * times + offset) - twice(offset) - slope * times * once(offset)
    expected = times + moved / (MASS * slope**2)
    assert np.abs(found - expected).max() < 3 * rtol * np.abs(expected).max()


def test_integrators_of_others_receive_the_knots():
    argument, line = shifted("slope")
    knots, shares = np.array([0, 0.5, 1.2, 2.0]), [0.95, 1.05]
    model = build(oscillator(uqmbd.spline(knots, [0, 1, -1, 0], ends="flat")(argument)))
    intervals = Ensemble(model, np.array(shares)[:, None]).pace(np.array([0, 1.8]), 1e-9)
    expected = sorted(k / line(x)[0] for k in knots[1:-1] for x in shares)
    found = [interval.end for interval in intervals if not interval.jumps]
    assert [min(found, key=lambda x: abs(x - k)) for k in expected] == pytest.approx(expected, rel=1e-12)
    # of too many realisations all knots together: short steps instead
    many = Ensemble(model, np.linspace(0.95, 1.05, 500)[:, None]).pace(np.array([0, 1.8]), 1e-5)
    assert len(many) < 50
    assert all(
        interval.longest < 0.25 for interval, before in zip(many[1:], many, strict=False) if 0.55 < before.end < 1.1
    )


@pytest.mark.parametrize(("periodic", "begin", "end"), [(False, 0.1, 9.0), (True, -3.0, 5.0)])
def test_steps_end_at_knots_that_count(periodic, begin, end):
    """All of a table that is rough, within the times; none of one that is a cubic, but for what closes it."""
    knots = np.array([0, 0.5, 1.2, 2.0])
    rough = uqmbd.spline(knots, [0, 1, -1, 0], periodic)
    table = TimedTable(rough.table, 2.0, 0.5)
    found = table.knots(begin, end, 1e-9)
    if not periodic:  # not-a-knot: one cubic through four points
        assert len(found) == 0
        return
    expected = (np.add.outer(2.0 * np.arange(-9, 9), knots[:-1]).ravel() - 0.5) / 2
    assert found.tolist() == pytest.approx(sorted(expected[(expected > begin) & (expected < end)]))


@pytest.mark.thorough
def test_tables_compile_as_formulas_do(tmp_path, monkeypatch):
    """As many kernels with 3,000 knots as with 28, and two more at most than without a table."""
    counts = []
    for force in (sympy.sin(uqmbd.t), *(uqmbd.spline(np.linspace(0, 9, n), np.ones(n)) for n in (28, 3000))):
        monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / str(len(counts))))
        before = compilations[0]
        uqmbd.simulate(oscillator(force), [0, 0.1], check=False)
        counts.append(compilations[0] - before)
    assert counts[1] == counts[2] <= counts[0] + 2


def test_tables_of_tables_and_of_parameters():
    """A spline of a spline, one of a random variable, and one with random values: what is inserted by hand."""
    a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 1))
    profile = uqmbd.spline([0, 0.4, 1], [0.1, 0.9, a + a**2])
    other = uqmbd.spline([0, 0.3, 0.7, 1], [1, 0, 2, 1], periodic=True)
    expressions = [profile(a), other(3 * a), profile(other(a) / 2) + other(a), profile.diff(uqmbd.t)(a) * other(3 * a)]
    values = np.linspace(0.01, 0.99, 7)[:, None]
    found = ParameterMap.of(expressions, [a])(values)
    expected = [[float(e.subs(a, x)) for e in expressions] for x in values[:, 0]]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_what_is_no_number_stays_none():
    a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 1))
    profile = uqmbd.spline([0, 0.4, 1], [0.1, 0.9, 0.1], periodic=True)
    assert np.isnan(ParameterMap.of([profile(1 / a)], [a])(np.array([[0.0], [0.5]]))[:, 0]).tolist() == [True, False]
