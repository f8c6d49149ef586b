"""What a realisation yields depends on nothing but the realisation, to the bit."""

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_joints import Spherical
from uqmbd_springs import PointForce, SpringDamper

from ...mechanisms import driven_slider_crank

TIMES = np.linspace(0, 1, 41)
MANY = np.linspace(0, 1, 1601)


def swing():
    """A heavy body on a ball joint, pulled by a spring and by a force that ends at a random time: in space."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(20, 60), units="N/m")
    end = uqmbd.RandomVariable("end", chaospy.Uniform(0.2, 0.8), units="s")
    mechanism = uqmbd.Mechanism("swing", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    body = mechanism.body("body", mass=1.3, inertia=(0.02, 0.03, 0.04), position=(0.4, 0.1, 0))
    ball = mechanism.add(Spherical("ball", mechanism.ground, body, (0, 0, 0), (-0.4, -0.1, 0)))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (1, 0, 0.5), (0.1, 0, 0), stiffness, 0.1, 0.3))
    force = sympy.Piecewise((3.0, uqmbd.t < end), (0.0, True))
    mechanism.add(PointForce("pull", body, (0.2, 0, 0), (0, force, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("force", ball.reaction_force[2], units="N")
    return mechanism


def slider_crank():
    return driven_slider_crank(uqmbd.RandomVariable("rod", chaospy.Uniform(0.3, 0.5), units="m"))


def struck():
    """A mass on a spring, struck for a moment at a random time, and pulled by a table that begins at another one."""
    moment = uqmbd.RandomVariable("moment", chaospy.Uniform(0.2, 0.8), units="s")
    begin = uqmbd.RandomVariable("begin", chaospy.Uniform(0.0, 0.2), units="s")
    mechanism = uqmbd.Mechanism("struck", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 100.0, 0.5, 0.1))
    mechanism.add(PointForce("blow", body, 0, 100 * sympy.exp(-(((uqmbd.t - moment) / 1e-3) ** 2))))
    table = uqmbd.spline([0, 0.1, 0.2, 0.4], [0, 1, -2, 0])(uqmbd.t - begin)
    mechanism.add(PointForce("pull", body, 0, table))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


MODELS = {}


def model(name):
    if name not in MODELS:
        mechanism = {"swing": swing, "slider-crank": slider_crank, "struck": struck}[name]()
        MODELS[name] = mechanism, build(mechanism)
    return MODELS[name]


@pytest.mark.parametrize("name", ["swing", "slider-crank", "struck"])
@given(st.integers(1, 21), st.integers(0, 2**32 - 1), st.sampled_from([TIMES, MANY]))
@settings(max_examples=10, deadline=None)
def test_states_and_outputs(name, count, seed, times):
    mechanism, compiled = model(name)
    random = np.random.default_rng(seed)
    values = mechanism.inputs.from_uniform(random.uniform(size=(count, len(compiled.inputs))))
    whole = Ensemble(compiled, values)
    states = integrate(whole, times, 1e-6, "dop853").states
    outputs = whole.outputs(times, states)
    some = random.permutation(count)[: 1 + seed % count]
    part = whole.select(some)
    found = integrate(part, times, 1e-6, "dop853").states
    assert np.array_equal(found, states[some])
    assert np.array_equal(part.outputs(times, found), outputs[some])


@pytest.mark.parametrize("name", ["swing", "slider-crank"])
@pytest.mark.parametrize("times", [TIMES, TIMES[:2], TIMES[:6]])
def test_the_integrator_tells_residuals_that_states_have(name, times):
    """Of realisations that share a group of lanes as of those that fill several."""
    mechanism, compiled = model(name)
    values = mechanism.inputs.from_uniform(np.random.default_rng(1).uniform(size=(13, len(compiled.inputs))))
    ensemble = Ensemble(compiled, values)
    found = integrate(ensemble, times, 1e-6, "dop853")
    layout, drift = compiled.layout, compiled.evaluators["drift"]
    for k in range(13):
        states = found.states[k, 1:]
        arguments = np.column_stack([states, times[1:], np.zeros(len(states))])
        values = np.abs(drift(arguments, np.tile(ensemble.block[k], (len(states), 1)))).max(axis=0)
        index = [drift.index[letter][0] for letter in ("phi", "psi") if letter in drift.index]
        expected = np.append(values[np.concatenate(index)], np.abs(states[:, layout.velocities :]).max())
        assert np.allclose(found.off[k], expected, rtol=1e-6, atol=1e-13)
        assert expected[:-1].max() < 1e-7 < expected[-1]


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", ["swing", "slider-crank"])
def test_states_at_many_times_are_as_accurate_as_at_few(name, rtol):
    """Corrections are interpolated at many times of a step; at a few, each state is projected."""
    mechanism, compiled = model(name)
    values = mechanism.inputs.from_uniform(np.random.default_rng(2).uniform(size=(3, len(compiled.inputs))))
    ensemble = Ensemble(compiled, values)
    found, few = (integrate(ensemble, times, rtol, "dop853") for times in (MANY, TIMES))
    exact = integrate(ensemble, TIMES, 1e-12, "dop853").states
    states, size = found.states[:, :: len(MANY) // len(TIMES) + 1], np.maximum(1.0, np.abs(exact).max(axis=1))
    assert not np.array_equal(states, few.states)
    assert np.abs(states - few.states).max(axis=1) / size == pytest.approx(0, abs=0.2 * rtol)
    wrong, known = (np.abs(x - exact).max(axis=1) / size for x in (states, few.states))
    assert wrong.max() < known.max() + 0.1 * rtol
    arguments = np.concatenate(
        [found.states, np.broadcast_to(MANY[:, None], (3, len(MANY), 1)), 0 * found.states[..., :1]], 2
    )
    drift = compiled.evaluators["drift"](
        arguments.reshape(3 * len(MANY), -1), np.repeat(ensemble.block, len(MANY), axis=0)
    )
    columns = np.concatenate([drift_index[0] for drift_index in compiled.evaluators["drift"].index.values()])
    assert np.abs(drift[:, columns]).max() < rtol * max(1.0, size.max())
