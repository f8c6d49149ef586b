"""Assembly by the driver, held against the iteration that decides what the driver leaves, and against least squares."""

import warnings

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd.dynamics.assembly.assembly import iterate_poses, statement_rows
from uqmbd.dynamics.assembly.programs import closed_poses, least_velocities
from uqmbd.dynamics.equations import state_arguments
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute, Spherical


def slider_crank():
    """Driven, with a random length, and a pose that is drawn roughly."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.3, 0.5), units="m")
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    crank = mechanism.body("crank", mass=1, inertia=0.1, position=(0.05, 0.05), angle=0.7)
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0.28, 0.05), angle=-0.27)
    slider = mechanism.body("slider", mass=1, inertia=0.1, position=(0.45, 0))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (-0.075, 0)))
    mechanism.add(Revolute("B", crank, rod, (0.075, 0), (-length / 2, 0)))
    mechanism.add(Revolute("C", rod, slider, (length / 2, 0), (0, 0)))
    mechanism.add(Prismatic("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, crank, angle=0.7 + 3 * uqmbd.t))
    return mechanism


def planar_loop():
    """A four-bar in space, in which three equations are redundant; its crank is told how fast it turns."""
    shift = uqmbd.RandomVariable("shift", chaospy.Uniform(-0.1, 0.1), units="m")
    mechanism = uqmbd.Mechanism("loop", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    points = [(0, 0, 0), (0.3, 0, 0.9), (1.3, 0, 1.2), (1.2 + shift, 0, 0)]
    before, far = mechanism.ground, (0, 0, 0)
    for k in range(3):
        inertia = {"mass": 1, "inertia": (0.1, 0.1, 0.1)}
        speed = {} if k else {"angular_velocity": (0, 2, 0)}
        body = mechanism.body(f"link{k}", **inertia, position=points[k], **speed)
        mechanism.add(Revolute(f"pin{k}", before, body, far, (0, 0, 0), axis_i=(0, 1, 0), axis_j=(0, 1, 0)))
        before, far = body, tuple(b - a for a, b in zip(points[k], points[k + 1], strict=True))
    mechanism.add(Revolute("last", before, mechanism.ground, far, (1.2, 0, 0), axis_i=(0, 1, 0), axis_j=(0, 1, 0)))
    return mechanism


def loose_chain():
    """Bodies on spherical joints, which may move in many ways; two velocities are stated."""
    offset = uqmbd.RandomVariable("offset", chaospy.Uniform(0, 0.2), units="m")
    mechanism = uqmbd.Mechanism("chain", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    before, far = mechanism.ground, (0, 0, 0)
    for k in range(3):
        speed = {"angular_velocity": (1, 2, 3)} if k == 1 else {}
        body = mechanism.body(f"b{k}", mass=1, inertia=(0.1, 0.2, 0.25), position=(k, 0.1 * k, 0), **speed)
        mechanism.add(Spherical(f"s{k}", before, body, far, (0, offset, 0)))
        before, far = body, (1, 0, 0)
    return mechanism


CASES = {"slider-crank": slider_crank, "loop": planar_loop, "chain": loose_chain}


@pytest.fixture(scope="module", params=CASES)
def model(request):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
        return build(CASES[request.param]())


@given(st.integers(1, 12), st.floats(0, 0.15), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_poses_are_those_of_the_iteration_with_singular_values(model, count, amount, seed):
    random = np.random.default_rng(seed)
    parameters = model.parameters(random.uniform(-0.09, 0.09, (count, 1)) + (model.name == "slider_crank") * 0.4)
    drawn = parameters[:, model.drawn]
    drawn = drawn + amount * random.uniform(-1, 1, drawn.shape)
    rows = model.layout.independent_holonomic
    found, undecided = closed_poses(model, drawn, 0.0, parameters, rows)
    expected, messages = iterate_poses(model, drawn, 0.0, parameters, rows)
    decided = np.flatnonzero(~undecided)
    assert len(decided) >= 0.5 * count - 1  # the driver does the work
    assert not any(messages[k] for k in decided)
    np.testing.assert_allclose(found[decided], expected[decided], rtol=0, atol=1e-9)
    for k in range(count):
        one = slice(k, k + 1)
        alone, left = closed_poses(model, drawn[one], 0.0, parameters[one], rows)
        assert left[0] == undecided[k]
        assert np.array_equal(alone[0], found[k])


def test_velocities_are_those_of_least_squares(model):
    values = np.linspace(-0.09, 0.09, 11)[:, None] + (model.name == "slider_crank") * 0.4
    ensemble = Ensemble(model, values)
    start, parameters = ensemble.start, ensemble.parameters
    assert start.ok.all()
    found, undecided = least_velocities(model, start.q, start.s, 0.0, parameters)
    assert not undecided.any()
    equations = model.evaluate("velocity", state_arguments(0.0, start.q, start.s, 0 * start.q), parameters)
    for k in range(len(values)):
        a = np.concatenate([equations["d"][k], *(x[k] for x in statement_rows(model, start.q))])
        b = np.concatenate([-equations["phi_t"][k], *(parameters[k, x.parameters] for x in model.statements)])
        expected = np.linalg.lstsq(a, b, rcond=1e-9)[0]
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(found[k], expected, rtol=0, atol=1e-10)


def test_an_ordinary_ensemble_is_assembled_without_decisions(model, watched_evaluator):
    """What is slow stays what it is for: nothing else comes there."""
    values = np.linspace(-0.09, 0.09, 20)[:, None] + (model.name == "slider_crank") * 0.4
    decided = []
    watched = watched_evaluator(watched_evaluator(model, "position", decided.append), "velocity", decided.append)
    assert Ensemble(watched, values).start.ok.all()
    assert not decided, "ordinary realisations were left to be decided"
    iterate_poses(watched, watched.parameters(values)[:, model.drawn], 0.0, watched.parameters(values), None)
    assert decided, "the iteration evaluates the constraints"
