"""Outputs that are declared angles: unwrapped in every realisation, whoever computes it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd import extend, results
from uqmbd.dynamics import integrate
from uqmbd_montecarlo import MonteCarlo

TURN = 2 * np.pi
RATE, SPREAD = 6.0, 1.0
"""Mean and deviation of the angular velocity, rad/s."""
START, AROUND = np.pi, 0.3
"""Mean and deviation of the angle at the start, rad: about the jump of atan2."""
TIMES = np.linspace(0, 10, 101)


def wheel(angle=True, rate=RATE, drawn=None):
    """A wheel that turns freely; a spoke of it is observed: angle(t) = start + rate t."""
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    start = uqmbd.RandomVariable("start", chaospy.Normal(START, AROUND), units="rad") if drawn is None else drawn
    speed = uqmbd.RandomVariable("rate", chaospy.Normal(rate, SPREAD), units="rad/s")
    body = mechanism.body("wheel", mass=1, inertia=1, angle=start, angular_velocity=speed)
    x, y = body.point((1, 0))
    mechanism.output("direction", sympy.atan2(y, x), units="rad", angle=angle)
    mechanism.output("degrees", sympy.deg(sympy.atan2(y, x)), units="deg", angle=angle)
    mechanism.output("x", x, units="m")
    mechanism.output("raw", sympy.atan2(y, x), units="rad")
    mechanism.output("counted", body.angle, units="rad")
    return mechanism


def study_of(mechanism, samples=200, times=TIMES):
    return uqmbd.Study("wheels", mechanism, times, [MonteCarlo(samples=samples, seed=1)], rtol=1e-8)


@pytest.fixture(scope="module")
def study():
    return study_of(wheel())


@pytest.fixture(scope="module")
def problem(study):
    return study.problem(study.propagators[0])


@pytest.fixture(scope="module")
def node(study):
    return study.run()["monte-carlo"]


def closed_form(inputs):
    """Angles (sample, time) of inputs (rate, start), from the turn that is within half a turn of the mean start."""
    rate, start = inputs[:, :1], inputs[:, 1:]
    return start - TURN * np.round((start - START) / TURN) + rate * TIMES


@pytest.mark.thorough
def test_samples_that_end_turns_apart(node):
    """Every realisation is its closed form, and so are mean and deviation; so does the body's own angle say."""
    samples, statistics = node["samples"].to_dataset(), node["statistics"].to_dataset()
    angles = closed_form(samples["inputs"].values)
    assert np.ptp(angles[:, -1]) > 5 * TURN
    found = samples["response"].sel(output="direction").values
    np.testing.assert_allclose(found, angles, atol=1e-5)
    np.testing.assert_allclose(samples["response"].sel(output="degrees"), np.degrees(found), atol=1e-9)
    at = statistics.sel(output="direction")
    np.testing.assert_allclose(at["mean"], angles.mean(axis=0), atol=1e-5)
    np.testing.assert_allclose(at["std"], angles.std(axis=0, ddof=1), atol=1e-5)
    # within five standard errors of what the distributions say
    exact = np.hypot(AROUND, SPREAD * TIMES)
    np.testing.assert_allclose(at["mean"], START + RATE * TIMES, atol=5 * exact.max() / np.sqrt(200))
    assert (np.abs(at["mean"] - (START + RATE * TIMES)) < 5 * exact / np.sqrt(200)).all()
    for name in ("mean", "std"):
        counted = statistics[name].sel(output="counted").values
        np.testing.assert_allclose(at[name], counted, atol=1e-9)


def test_start_about_the_jump(node):
    """Plainly averaged, directions about pi have their mean near 0; declared, it is pi, and so is the circular one."""
    start = node["statistics"].to_dataset().isel(time=0)
    error = 5 * AROUND / np.sqrt(200)
    assert abs(start["mean"].sel(output="raw")) < 5 * np.pi / np.sqrt(200)
    assert start["std"].sel(output="raw") > 2.5
    assert float(start["mean"].sel(output="direction")) == pytest.approx(START, abs=error)
    assert np.cos(start["circular_mean"].sel(output="direction") - np.pi) > np.cos(error)
    assert float(start["circular_std"].sel(output="direction")) == pytest.approx(AROUND, rel=5 / np.sqrt(2 * 200))
    assert float(start["circular_std"].sel(output="degrees")) == pytest.approx(
        np.degrees(float(start["circular_std"].sel(output="direction"))), rel=1e-9
    )
    assert np.isnan(start["circular_mean"].sel(output=["x", "raw", "counted"])).all()
    assert np.isnan(start["circular_std"].sel(output=["x", "raw", "counted"])).all()


@pytest.mark.thorough
def test_what_is_no_angle_stays_as_it_is(node):
    """The same bits as without any declaration."""
    plain = study_of(wheel(angle=False)).run()["monte-carlo"]
    for name in ("x", "raw", "counted"):
        one, two = (n["samples"]["response"].sel(output=name).values for n in (node, plain))
        assert one.tobytes() == two.tobytes()
    assert "output_angle" not in plain["statistics"].coords and "circular_mean" not in plain["statistics"]


@pytest.mark.thorough
def test_results_know_their_angles(node, tmp_path):
    for child in ("samples", "statistics"):
        assert node[child]["output_angle"].values.tolist() == [TURN, 360, 0, 0, 0]
    tree = results.study_tree([node], study="s", mechanism="m")
    results.validate(tree)
    loaded = results.load(results.save(tree, tmp_path / "a.nc"))
    assert loaded.identical(tree)
    again = extend.statistics_of_samples(loaded["monte-carlo/samples"].to_dataset())
    # samples know nothing of how they were integrated
    stated = ["integration_error", "integration_error_rms", "integration_error_factor"]
    assert again.identical(node["statistics"].to_dataset().drop_vars(stated))


@pytest.mark.thorough
def test_turns_depend_on_the_realisation_alone(study, problem, node):
    """Neither on workers, nor on chunks, nor on those beside it, failed ones included."""
    response = node["samples"]["response"].values
    with ThreadPoolExecutor(2) as threads:
        tree = study.run(workers=threads)
    assert tree["monte-carlo"]["samples"]["response"].values.tobytes() == response.tobytes()
    inputs = node["samples"]["inputs"].values
    alone = problem.realise(inputs[[70]]).response
    np.testing.assert_allclose(alone[0], response[70], atol=1e-5)
    far = np.array([[RATE, START + 9 * TURN], [np.nan, START]])
    mixed = problem.realise(np.concatenate([far, inputs[::-1]]))
    assert mixed.status.tolist() == [0, 1] + 200 * [0]
    np.testing.assert_allclose(mixed.response[:1:-1], response, atol=1e-5)
    # nine turns more at the start are none, but the body's own angle keeps them
    np.testing.assert_allclose(mixed.response[0, 0], START + RATE * TIMES, atol=1e-5)
    np.testing.assert_allclose(mixed.response[0, 4], START + 9 * TURN + RATE * TIMES, atol=1e-5)


@pytest.mark.parametrize("start", [-3.0, 3.0, 3.0 + 8 * np.pi])
def test_simulation(start):
    """One motion takes the turn that a study takes: the one that is nearest to the start at the means."""
    found = uqmbd.simulate(wheel(), TIMES, values={"start": start}, rtol=1e-8)
    expected = closed_form(np.array([[RATE, start]]))[0]
    assert abs(expected[0] - np.pi) < 0.2
    np.testing.assert_allclose(found["direction"], expected, atol=1e-5)
    assert (
        found["degrees"].attrs == {"long_name": "degrees", "units": "deg", "turn": 360.0}
        and "turn" not in found["x"].attrs
    )


@pytest.mark.parametrize("drawn", [np.pi, -np.pi, np.nextafter(np.pi, 4), np.nextafter(-np.pi, -4)])
def test_rounding_does_not_choose_the_turn(drawn):
    """At the jump of atan2 itself the angle is pi, never -pi."""
    assert float(uqmbd.simulate(wheel(drawn=drawn), [0, 0.1])["direction"][0]) == pytest.approx(np.pi)


@pytest.mark.thorough
def test_chaos_of_an_angle(problem):
    """The unwrapped angle is linear in the inputs: order 1 has its moments exactly, and the direction's closely."""
    space = uqmbd.extend.GermSpace.of(problem.inputs)
    rule, index = uqmbd.extend.gauss_tensor(space, 3), uqmbd.extend.index_set(2, 1)
    response = problem.realise(space.to_inputs(rule.nodes)).response
    coefficients = extend.project(response, space.evaluate(rule.nodes, index), rule.weights)
    chaos = results.PolynomialChaos(coefficients, index, space, problem.labels)
    sigma = np.hypot(AROUND, SPREAD * TIMES)
    np.testing.assert_allclose(chaos.mean[0], START + RATE * TIMES, atol=1e-5)
    np.testing.assert_allclose(chaos.std[0], sigma, atol=1e-5)
    np.testing.assert_allclose(chaos.std[1], np.degrees(sigma), atol=1e-3)
    assert chaos.std[3, 0] > 4 * AROUND  # undeclared: nodes on both sides of the jump
    statistics = chaos.statistics().sel(output="direction")
    early = sigma < 1.5
    assert early.sum() > 10
    away = statistics["circular_mean"].values - (START + RATE * TIMES)
    np.testing.assert_allclose(np.exp(1j * away)[early], 1, atol=2e-3)
    np.testing.assert_allclose(statistics["circular_std"].values[early], sigma[early], rtol=2e-3)
    again = results.PolynomialChaos.from_dataset(chaos.to_dataset())
    assert again.statistics().identical(chaos.statistics())


def test_ensembles_unwrap_alike(problem):
    """For methods that integrate themselves; pieces of time are joined and unwrapped once more."""
    values = problem.inputs.from_uniform(np.random.default_rng(2).uniform(0.01, 0.99, (5, 2)))
    ensemble = problem.ensemble(values)
    states = integrate(ensemble, TIMES, 1e-8).states
    whole = ensemble.outputs(TIMES, states)
    np.testing.assert_allclose(whole[:, 0], closed_form(values), atol=1e-5)
    pieces = [ensemble.outputs(TIMES[part], states[:, part]) for part in (slice(0, 40), slice(40, None))]
    joined = np.concatenate(pieces, axis=2)
    assert np.abs(joined - whole).max() > 1
    np.testing.assert_allclose(problem.model.outputs.unwrap(joined), whole, atol=1e-9)


def test_what_is_not_finite_spoils_nothing_else(problem):
    """An angle that is lost at one time leaves other times and other realisations as they are, without a warning."""
    response = np.zeros((3, 5, 4)) + np.linspace(3.0, 3.6, 4)
    response[1, 0, 2], response[2, 0, 1] = np.nan, np.inf
    found = problem.model.outputs.unwrap(response)
    assert np.array_equal(found, response, equal_nan=True)


def test_counted_angles_survive_coarse_times():
    """Five turns between output times: an atan2 cannot know, the body's own angle does, declared or not."""
    mechanism = wheel(rate=10 * np.pi)
    mechanism.output("own", 2 * mechanism.bodies["wheel"].angle, units="rad", angle=True)
    found = uqmbd.simulate(mechanism, [0, 1, 2], rtol=1e-8)
    np.testing.assert_allclose(found["own"], 2 * (START + 10 * np.pi * np.arange(3)), atol=1e-4)
    np.testing.assert_allclose(found["direction"], START, atol=1e-4)


def test_stored_chunks_are_those_of_the_declaration(tmp_path):
    """A chunk of another declaration, or of another mean, from which turns are counted, is not taken."""
    near = uqmbd.RandomVariable("start", chaospy.Normal(-3, 0.1), units="rad")
    end = 0.5 + RATE * 10
    cases = [(wheel(), end), (wheel(angle=False), end - 10 * TURN), (wheel(drawn=near), end - TURN)]
    for mechanism, expected in cases:
        study = study_of(mechanism)
        problem = study.problem(study.propagators[0], folder=tmp_path)
        found = problem.realise(np.array([[RATE, 0.5]])).response[0, 0, -1]
        assert found == pytest.approx(expected, abs=1e-5)
