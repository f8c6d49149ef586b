"""The explicit integrator, on oscillators q'' = -p q whose motion is known."""

import json
from importlib.resources import files

import numpy as np
import pytest
import symengine as se
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import DOP853, solve_ivp

from uqmbd.compiled import Dynamics, ExplicitOptions, ExplicitStatus, IntegrationState, ProgramWriter, compile_kernel

Q, V, T, ZERO, P = se.symbols("q v t zero p")
END = 2.0


def dynamics(acceleration):
    kernel = compile_kernel([Q, V, T, ZERO, P], [acceleration])
    writer = ProgramWriter(5)
    (found,) = writer.call(kernel, np.arange(5)[None]).ravel()
    return Dynamics(1, 1, 2, 1, writer.part(), np.array([1, found]), None, writer.size, 2)


OSCILLATOR = dynamics(-P * Q)


def method(rtol, **changes):
    given = dict(far=1e-3, surplus=4.0, stiff=6.1, patience=15, refusals=3, attempts=20000, guarded=False)
    return ExplicitOptions(rtol=rtol, **(given | changes))


def integrated(p, z, times, rtol, intervals=(((END, np.inf, False),),), of=OSCILLATOR, **changes):
    run = IntegrationState(of, method(rtol, **changes), z, p[:, None], times, intervals, np.full(len(z), rtol))
    run.advance()
    return run


def oscillation(p, z, times):
    w = np.sqrt(p)[:, None]
    q, v = z[:, :1], z[:, 1:]
    c, s = np.cos(w * times), np.sin(w * times)
    return np.stack([q * c + v / w * s, v * c - q * w * s], axis=2)


def oscillators(count, seed=0):
    random = np.random.default_rng(seed)
    return random.uniform(1, 200, count), random.normal(size=(count, 2))


@pytest.mark.parametrize("instants", [2, 5, 300])
def test_closed_form(instants):
    p, z = oscillators(100)
    times = np.linspace(0, END, instants)
    found = integrated(p, z, times, 1e-9)
    assert (found.status == ExplicitStatus.DONE).all()
    scale = np.abs(z).max() * np.sqrt(p.max())
    assert np.abs(found.result - oscillation(p, z, times)).max() < 1e-7 * scale


def test_order_of_convergence():
    p, z = oscillators(20)
    times = np.array([0, END])
    errors = []
    for steps in (20, 40):
        found = integrated(p, z, times, 1e-2, (((END, END / steps, False),),))
        errors.append(np.abs(found.result - oscillation(p, z, times))[:, -1].max())
    assert 7.7 < np.log2(errors[0] / errors[1]) < 8.6


def test_order_of_the_interpolant():
    p, z = oscillators(20)
    times = np.linspace(0, END, 201)
    errors = []
    for steps in (16, 32):
        found = integrated(p, z, times, 1e-2, (((END, END / steps, False),),))
        errors.append(np.abs(found.result - oscillation(p, z, times))[..., 0].max())
    assert 7.2 < np.log2(errors[0] / errors[1]) < 8.8


def test_as_many_steps_as_scipy():
    p, z = oscillators(12)
    found = integrated(p, z, np.array([0, END]), 1e-8)
    for k in range(12):
        one = solve_ivp(lambda t, y, k=k: [y[1], -p[k] * y[0]], (0, END), z[k], method="DOP853", rtol=1e-8, atol=1e-8)
        assert abs(found.steps[k] - (len(one.t) - 1)) <= 2


@given(st.integers(1, 40), st.integers(0, 2**32 - 1), st.sampled_from([1e-4, 1e-9]))
@settings(max_examples=20, deadline=None)
def test_a_realisation_does_not_depend_on_its_company(count, seed, rtol):
    p, z = oscillators(count, seed)
    times = np.linspace(0, END, 33)
    whole = integrated(p, z, times, rtol).result
    order = np.random.default_rng(seed).permutation(count)
    assert np.array_equal(integrated(p[order], z[order], times, rtol).result, whole[order])
    assert np.array_equal(integrated(p[:1], z[:1], times, rtol).result, whole[:1])


def test_interruptions_change_nothing(monkeypatch):
    p, z = oscillators(30)
    times = np.linspace(0, END, 33)
    whole = integrated(p, z, times, 1e-6)
    monkeypatch.setattr("uqmbd.compiled.explicit.BUDGET", 50)
    parts = integrated(p, z, times, 1e-6)
    assert np.array_equal(parts.result, whole.result)
    assert np.array_equal(parts.steps, whole.steps)


def test_legs_of_each():
    """A force that jumps at a time of its own in each: q'' = 1 from t = p on."""
    step = dynamics(se.Piecewise((1.0, P <= T), (0.0, True)))
    p = np.random.default_rng(0).uniform(0.1, 1.9, 50)
    times = np.linspace(0, END, 41)
    intervals = [((x, np.inf, True), (END, np.inf, False)) for x in p]
    run = IntegrationState(step, method(1e-6), np.zeros((50, 2)), p[:, None], times, intervals, np.full(50, 1e-6))
    run.advance()
    assert (run.status == ExplicitStatus.JUMP).all()
    assert np.array_equal(run.now, p)
    run.status[:] = ExplicitStatus.RUNNING
    run.advance()
    past = np.maximum(times - p[:, None], 0)
    assert np.abs(run.result[..., 0] - past**2 / 2).max() < 1e-13


def test_stiff_ones_are_reported():
    stiff = dynamics(-1e4 * V - P * Q)
    p, z = oscillators(10)
    found = integrated(p, z, np.array([0, END]), 1e-4, of=stiff)
    assert (found.status == ExplicitStatus.STIFF).all()
    assert (found.now < END).all()


def test_a_pole_is_reported():
    pole = dynamics(V**2 * P)  # v' = p v^2: infinite at t = 1 / p
    found = integrated(np.full(3, 2.0), np.array([[0.0, 1.0]] * 3), np.array([0, END]), 1e-6, of=pole)
    assert set(found.status.tolist()) <= {ExplicitStatus.SMALL, ExplicitStatus.MANY}
    assert np.abs(found.now - 0.5).max() < 1e-3
    assert (found.column == 1).all()


def test_coefficients_are_those_of_scipy():
    listed = json.loads(files("uqmbd.compiled").joinpath("source/dop853.json").read_text())
    stages = np.array([np.append(row, np.zeros(12 - len(row))) for row in listed["A"]])
    np.testing.assert_array_equal(stages, DOP853.A[:12, :12])
    np.testing.assert_array_equal(listed["C"], DOP853.C[:12])
    for name in ("A_EXTRA", "B", "C_EXTRA", "D", "E3", "E5"):
        np.testing.assert_array_equal(listed[name], getattr(DOP853, name))
