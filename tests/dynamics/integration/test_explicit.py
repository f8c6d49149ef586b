"""The explicit integrator and its compiled linear algebra."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate, integrator_class
from uqmbd.dynamics.integration import dop853
from uqmbd.dynamics.linear import unrolled
from uqmbd.dynamics.linear.elimination import plan
from uqmbd.dynamics.linear.unrolled import residual_kernel, unroll
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque

from ...mechanisms import driven_slider_crank

TIMES = np.linspace(0, 2, 41)


def random_systems(seed, size=14, count=20):
    """Sparse systems of one pattern with some structural zeros on the diagonal, as index-1 systems have."""
    generator = np.random.default_rng(seed)
    pattern = generator.random((size, size)) < 0.3
    pattern |= np.roll(np.eye(size, dtype=bool), 3, axis=1)
    rows, columns = np.nonzero(pattern)
    entries = generator.normal(size=(count, len(rows)))
    matrix = np.zeros((count, size, size))
    matrix[:, rows, columns] = entries
    return rows, columns, entries, matrix, generator


def test_straight_line_code_solves_as_lapack_does(monkeypatch, tmp_path):
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    for seed in range(3):
        rows, columns, entries, matrix, generator = random_systems(seed)
        size, count = matrix.shape[1], len(rows)
        given = np.concatenate([entries, generator.normal(size=(len(entries), size))], axis=1)
        rights = np.stack([np.arange(count, count + size), np.full(size, -1)])
        rights[1, 2] = count + 5  # a right-hand side with zeros
        order = plan(rows, columns, matrix[:2])
        code = unroll(order, rows, columns, np.arange(count), rights, given.shape[1], size)
        found = code(given).reshape(len(given), 2, size)
        right = np.zeros((len(given), 2, size))
        right[:, 0], right[:, 1, 2] = given[:, count:], given[:, count + 5]
        expected = np.linalg.solve(matrix[:, None], right[..., None])[..., 0]
        # fixed pivots lose digits in some systems: those are told by their residual
        residual = residual_kernel(rows, columns, np.arange(count), rights[0], given.shape[1])
        poor = residual(np.concatenate([given, found[:, 0]], axis=1))[:, 0] > 1e-24
        assert poor.sum() < 5
        np.testing.assert_allclose(found[~poor], expected[~poor], rtol=1e-6, atol=1e-8)


def test_too_long_an_elimination_is_not_compiled(monkeypatch):
    monkeypatch.setattr(unrolled, "LIMIT", 10)
    rows, columns, entries, matrix, _ = random_systems(0)
    right = np.arange(14)[None]
    assert unroll(plan(rows, columns, matrix), rows, columns, np.arange(len(rows)), right, 99, 14) is None


def oscillator(stiffness, damping=0.0):
    """Mass on a spring without length: x = cos(w t)."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness, damping))
    mechanism.output("x", mass.position[0], units="m")
    return mechanism


def run(mechanism, values, method="auto", rtol=1e-7, times=TIMES, stack=64):
    model = build(mechanism)
    ensemble = Ensemble(model, np.asarray(values, dtype=float).reshape(-1, len(model.inputs)))
    found = integrator_class(method)(stack=stack).integrate(ensemble, np.asarray(times), rtol)
    return ensemble.outputs(times, found.states)[:, 0], found


def test_order_of_the_interpolated_solution():
    """With fixed work the error falls as h^8 at most and h^7 at least: slope of the error in the number of steps."""
    k = uqmbd.RandomVariable("k", chaospy.Uniform(50, 150))
    mechanism, steps, errors = oscillator(k), [], []
    for rtol in 10.0 ** np.arange(-5, -12, -1.0):
        x, found = run(mechanism, [100.0], "dop853", rtol)
        steps.append(found.counters.steps)
        errors.append(np.abs(x[0] - np.cos(10 * TIMES)).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert -9.5 < slope < -6.5


@pytest.mark.thorough
def test_one_of_many_that_is_a_hundred_times_faster_loses_nothing():
    k = uqmbd.RandomVariable("k", chaospy.Uniform(50, 150))
    values = np.full(64, 100.0)
    values[17] = 1e4 * 100
    x, found = run(oscillator(k), values)
    expected = np.cos(np.sqrt(values)[:, None] * TIMES)
    assert not found.counters.stiff
    assert np.abs(x - expected)[np.arange(64) != 17].max() < 2e-6
    assert np.abs(x - expected)[17].max() < 2e-4  # a phase of 2000 rad


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_what_is_stiff_is_left_to_an_implicit_integrator(method):
    """Overdamped by far: x decays slowly, the other root of the equation limits an explicit step."""
    k = uqmbd.RandomVariable("k", chaospy.Uniform(50, 150))
    damping = 1e5
    values = np.linspace(90, 110, 8)
    x, found = run(oscillator(k, damping), values, method)
    counters = found.counters
    if method == "auto":
        assert (counters.stiff, counters.by_radau, counters.by_dop853, counters.by_ida) == (8, 8, 0, 0)
    else:
        assert counters.by_radau == counters.by_dop853 == 0 and counters.residuals > 0
    assert found.messages == ("",) * 8
    slow = (damping - np.sqrt(damping**2 - 4 * values)) / 2
    np.testing.assert_allclose(x, np.exp(-slow[:, None] * TIMES), atol=1e-5)


def test_forced_it_says_what_is_wrong_instead(monkeypatch):
    monkeypatch.setattr(dop853, "STEPS", 50)
    k = uqmbd.RandomVariable("k", chaospy.Uniform(50, 150))
    _, found = run(oscillator(k), [1e6], "dop853")
    assert "more than 50 steps" in found.messages[0]
    assert np.isnan(found.states[0, -1]).all()


def test_too_large_a_mechanism_is_refused_if_forced_and_integrated_otherwise(monkeypatch, tmp_path):
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    monkeypatch.setattr(unrolled, "LIMIT", 1)
    k = uqmbd.RandomVariable("k", chaospy.Uniform(50, 150))
    with pytest.raises(uqmbd.StudyError, match="'oscillator' has too many equations.*'auto' or 'ida'"):
        run(oscillator(k), [100.0], "dop853")
    x, found = run(oscillator(k), [100.0])
    assert found.counters.residuals > 0
    np.testing.assert_allclose(x[0], np.cos(10 * TIMES), atol=1e-4)


@pytest.mark.parametrize("method", ["auto", "ida"])
def test_a_force_that_jumps_at_random_times(method):
    """A force that ends at a random time: constant acceleration, then constant speed, to rounding."""
    end = uqmbd.RandomVariable("end", chaospy.Uniform(0.3, 1.7))
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2)
    import sympy

    force = sympy.Piecewise((6.0, uqmbd.t < end), (0.0, True))
    mechanism.add(PointForce("push", mass, (0, 0), (force, 0)))
    mechanism.output("x", mass.position[0], units="m")
    values = np.linspace(0.31, 1.69, 20)
    x, found = run(mechanism, values, method)
    until = np.minimum(TIMES, values[:, None])
    expected = 1.5 * until**2 + 3 * until * (TIMES - until)
    assert not any(found.messages)
    np.testing.assert_allclose(x, expected, atol=1e-12 if method == "auto" else 5e-5)


@pytest.mark.parametrize("count", [7, 13, 31])
def test_an_output_time_that_is_a_break_time_is_written(count):
    """Ends of segments are met by rounding only: a step that begins at 0.1 s, which is an output time."""
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2)
    mechanism.add(PointForce("push", mass, (0, 0), (uqmbd.step(uqmbd.t, 0.1, 0, 0.3, 4), 0)))
    mechanism.output("v", mass.velocity[0], units="m/s")
    times = np.linspace(0, 0.6, count)
    data = uqmbd.simulate(mechanism, times)
    x = np.clip((times - 0.1) / 0.2, 0, 1)
    # the integral of the cubic step 3 x^2 - 2 x^3, then of the whole force
    exact = 2 * (0.2 * (x**3 - x**4 / 2) + np.maximum(times - 0.3, 0))
    np.testing.assert_allclose(data.v, exact, atol=1e-10)


def slider_crank(length):
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    ground = mechanism.ground
    crank = mechanism.body("crank", mass=1, inertia=0.01, angle=1.0)
    rod = mechanism.body("rod", mass=1, inertia=0.01, position=(0.15, 0))
    slider = mechanism.body("slider", mass=1, inertia=0.01, position=(0.45, 0))
    mechanism.add(Revolute("A", ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, rod, (0.15, 0), (0, 0)))
    mechanism.add(Revolute("C", rod, slider, (length, 0), (0, 0)))
    mechanism.add(Prismatic("D", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(Torque("motor", crank, 0.3 * uqmbd.t))
    mechanism.output("x", slider.position[0], units="m")
    return mechanism


@pytest.mark.thorough
def test_both_integrators_agree_and_stay_on_the_constraints():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.3, 0.4), units="m")
    values = np.linspace(0.3, 0.4, 10)
    model = build(slider_crank(length))
    ensemble = Ensemble(model, values[:, None])
    explicit = integrate(ensemble, TIMES, 1e-7, method="dop853")
    implicit = integrate(ensemble, TIMES, 1e-10, method="ida")
    np.testing.assert_allclose(explicit.states, implicit.states, atol=5e-5)
    states = explicit.states.reshape(-1, explicit.states.shape[2])
    arguments = np.concatenate([states, np.tile(TIMES, 10)[:, None], np.zeros((len(states), 1))], axis=1)
    drift = model.evaluators["drift"](arguments, np.repeat(ensemble.block, len(TIMES), axis=0))
    assert np.abs(drift).max() < 1e-7 * np.abs(states).max()


def test_the_bits_of_a_stack_do_not_depend_on_what_ran_before():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.3, 0.4), units="m")
    values = np.linspace(0.3, 0.4, 10)
    mechanism = slider_crank(length)
    first, _ = run(mechanism, values)
    run(mechanism, values[::-1])
    again, _ = run(mechanism, values)
    np.testing.assert_array_equal(first, again)


@pytest.mark.thorough
def test_a_realisation_that_cannot_go_on_fails_alone():
    """A crank that is driven into a pose beyond the rod's reach."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.1, 0.4), units="m")
    mechanism = driven_slider_crank(length)
    values = np.linspace(0.2, 0.4, 12)
    values[5] = 0.12
    x, found = run(mechanism, values)
    assert [bool(m) for m in found.messages] == [k == 5 for k in range(12)]
    assert "integration stopped at t = 0.4" in found.messages[5]
    phi = 2 * TIMES
    good = np.arange(12) != 5
    exact = 0.15 * np.cos(phi) + np.sqrt(values[good, None] ** 2 - (0.15 * np.sin(phi)) ** 2)
    np.testing.assert_allclose(x[good], exact, atol=1e-6)
