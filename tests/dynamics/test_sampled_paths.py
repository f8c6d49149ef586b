"""Sampled paths of excitations: values, derivatives, refusals, and independence of workers and chunks."""

from __future__ import annotations

from dataclasses import dataclass, field

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

OMEGA, STEP = 3.0, 0.05
TIMES = np.linspace(0, 4, 41)


@dataclass(frozen=True)
class Wave:
    """Sine of unit amplitude whose phase is the key, over any argument."""

    name: str = "shaking"
    units: str = "m"
    key: uqmbd.RandomVariable = field(default_factory=lambda: uqmbd.extend.path_key("shaking"), repr=False)

    def sample_paths(self, sources, keys, begin, end):
        start = int(np.floor(begin / STEP)) - 4
        count = int(np.ceil(end / STEP)) + 8 - start
        # coefficients of a cosine: those of its knots divided by the transfer function of the B-spline
        x = (start - 1 + np.arange(count)) * STEP
        gain = (4 + 2 * np.cos(OMEGA * STEP)) / 6
        values = np.sin(OMEGA * x + 2 * np.pi * np.asarray(keys)[:, None]) / gain
        return start * STEP, STEP, np.repeat(values[:, None], len(sources), axis=1)


def exact(phase, argument=uqmbd.t):
    return sympy.sin(OMEGA * argument + 2 * sympy.pi * phase)


def oscillator(shaking, outside=0, *, also=None):
    """Mass on a spring whose free length is shaken."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
    body = mechanism.body("body", mass=mass, position=2.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 50, damping=1.0, free_length=2 + shaking))
    mechanism.output("position", body.position[0], units="m")
    mechanism.output("acceleration", body.acceleration[0], units="m/s^2")
    mechanism.output("relative", body.position[0] - shaking, units="m")
    if also is not None:
        mechanism.output("also", also(body))
    return mechanism


def phase():
    return uqmbd.RandomVariable("shaking", chaospy.Uniform(0, 1), units="1")


def samples(mechanism, workers=1, count=12, **options):
    study = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=count, seed=5)], **options)
    return study.run(workers=workers)["monte-carlo/samples"].to_dataset()


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_paths_are_the_functions_that_their_coefficients_describe(integrator):
    found = samples(oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t)), integrator=integrator, rtol=1e-9)
    expected = samples(oscillator(exact(phase())), integrator=integrator, rtol=1e-9)
    assert found["input"].values.tolist() == ["mass", "shaking"]
    assert found["input_key"].values.tolist() == [False, True]
    np.testing.assert_array_equal(found["inputs"], expected["inputs"])
    scale = np.abs(expected["response"].values).max(axis=(0, 2))
    # the spline deviates by (w h)^4 / 384 between knots, and its curvature, which is a force here, does not enter
    deviation = (OMEGA * STEP) ** 4 / 384
    difference = np.abs(found["response"].values - expected["response"].values).max(axis=(0, 2)) / scale
    assert (difference < 20 * deviation).all(), difference
    assert (difference > 1e-12).any()


@pytest.mark.parametrize(("speed", "offset"), [(2.0, 0.0), (0.7, -3.0), (-1.5, 0.4)])
def test_arguments_with_a_speed_and_an_offset(speed, offset):
    argument = speed * uqmbd.t + offset
    found = samples(oscillator(uqmbd.extend.excitation(Wave(), argument)))["response"]
    expected = samples(oscillator(exact(phase(), argument)))["response"]
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


def test_a_random_speed_and_two_points_of_one_path():
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.5, 2.0), units="1/s")
    wave = Wave()

    def both(of):
        return of(speed * uqmbd.t) - 0.5 * of(speed * uqmbd.t - 1.3)

    found = samples(oscillator(both(lambda x: uqmbd.extend.excitation(wave, x))))["response"]
    angle = phase()
    expected = samples(oscillator(both(lambda x: exact(angle, x))))["response"]
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


def test_a_prescribed_position_follows_the_path():
    """The constraint, its rate and its second rate contain the value, slope and curvature of the path."""

    def moved(shaking):
        mechanism = uqmbd.Mechanism("table", uqmbd.Line())
        table = mechanism.body("table", mass=2.0, position=0.0)
        body = mechanism.body("body", mass=1.0, position=1.0)
        mechanism.add(PositionDriver("drive", mechanism.ground, table, 0, 0, 1, shaking))
        mechanism.add(SpringDamper("spring", table, body, 0, 0, 50, damping=1.0, free_length=1))
        mechanism.output("table", table.position[0], units="m")
        mechanism.output("rate", table.velocity[0], units="m/s")
        mechanism.output("body", body.position[0], units="m")
        return mechanism

    found = samples(moved(uqmbd.extend.excitation(Wave(), uqmbd.t)))["response"]
    expected = samples(moved(exact(phase())))["response"]
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_a_simulation_has_the_path_of_its_key():
    """By default that of the mean of the key; the key 0 is the mean of all paths."""
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    still = uqmbd.simulate(mechanism, TIMES, {"shaking": 0.0})
    np.testing.assert_allclose(still["position"], 2.0, atol=1e-9)
    for values, key in ((None, 0.5), ({"shaking": 0.2}, 0.2)):
        found = uqmbd.simulate(mechanism, TIMES, values)
        expected = uqmbd.simulate(oscillator(exact(sympy.Float(key))), TIMES)
        np.testing.assert_allclose(found["position"], expected["position"], atol=1e-4)


def test_results_do_not_depend_on_workers():
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    alone, shared = samples(mechanism, 1, 40), samples(mechanism, 2, 40)
    np.testing.assert_array_equal(alone["response"], shared["response"])


@settings(max_examples=20)
@given(st.lists(st.floats(0.01, 0.99), min_size=1, max_size=5), st.floats(0.0, 3.0), st.floats(0.5, 9.0))
def test_a_realisation_does_not_depend_on_others_or_on_the_interval(keys, begin, length):
    """Forces of an ensemble, of each member alone, and of paths that reach further have the same bits."""
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    model = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=2)]).model
    values = np.array([[1.5, key] for key in keys])
    states = np.tile([2.1, 0.3], (len(keys), 1))
    time = begin + 0.25 * length
    whole = Ensemble(model, values, until=begin + length)
    expected = whole.rates(time, states)
    for k in range(len(keys)):
        one = Ensemble(model, values[k : k + 1], until=time)
        np.testing.assert_array_equal(one.rates(time, states[k : k + 1])[0], expected[k])
        chosen = whole.select(np.array([k]))
        np.testing.assert_array_equal(chosen.rates(time, states[k : k + 1])[0], expected[k])


def test_beyond_its_interval_a_path_is_not_a_number():
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    model = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=2)]).model
    ensemble = Ensemble(model, np.array([[1.5, 0.3]]), until=1.0)
    assert np.isfinite(ensemble.rates(1.0, np.array([[2.1, 0.3]]))).all()
    assert np.isnan(ensemble.rates(7.0, np.array([[2.1, 0.3]]))).any()


def test_summaries_and_requirements_use_the_path():
    def of(shaking):
        mechanism = oscillator(shaking)
        body = mechanism.bodies["body"]
        mechanism.output("highest", uqmbd.maximum(body.position[0]), units="m")
        mechanism.require("low", body.position[0] <= 3.4)
        return uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=40, seed=5)]).run()["monte-carlo"]

    found, expected = of(uqmbd.extend.excitation(Wave(), uqmbd.t)), of(exact(phase()))
    name = "scalars/samples"
    np.testing.assert_allclose(found[name]["response"], expected[name]["response"], rtol=1e-4)
    probability = found["requirements"]["violation_probability"].values
    np.testing.assert_array_equal(probability, expected["requirements"]["violation_probability"].values)
    assert 0 < probability.max() < 1


@pytest.mark.parametrize("method", [Collocation(order=2), Galerkin(order=2)])
def test_methods_that_need_smoothness_refuse_keys(method):
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    mechanism.require("low", mechanism.bodies["body"].position[0] <= 3.4)
    study = uqmbd.Study("s", mechanism, TIMES, [method])
    with pytest.raises(uqmbd.StudyError, match=r"sampled paths of 'shaking'.*accepts them, such as .*'monte-carlo'"):
        study.run()


def test_a_surrogate_cannot_be_the_control():
    method = MonteCarlo(samples=60, control=Collocation(order=2))
    study = uqmbd.Study("s", oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t)), TIMES, [method])
    with pytest.raises(uqmbd.StudyError, match="no surrogate exists for outputs that depend on sampled paths"):
        study.run()


def test_without_outputs_over_time_the_key_is_no_input():
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=2.0)
    shaking = uqmbd.extend.excitation(Wave(), uqmbd.t)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 50, damping=1.0, free_length=2 + shaking))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    assert mechanism.inputs.names == ()
    mechanism.output("position", body.position[0], units="m")
    assert mechanism.inputs.names == ("shaking",)


def test_results_of_another_shape_are_refused():
    class Wrong(Wave):
        def sample_paths(self, sources, keys, begin, end):
            first, step, found = super().sample_paths(sources, keys, begin, end)
            return first, step, found[:, :, : found.shape[2] // 2]

    with pytest.raises(uqmbd.StudyError, match=r"excitation 'shaking': sample_paths returned coefficients between"):
        samples(oscillator(uqmbd.extend.excitation(Wrong(), uqmbd.t)))


def test_keys_outside_their_range_are_refused():
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    for key in (-2.0, 1.5, 1e6):
        with pytest.raises(
            uqmbd.StudyError, match="shaking = .* this variable selects a sampled path; expected a number from 0"
        ):
            uqmbd.simulate(mechanism, TIMES, {"shaking": key})


def test_a_surrogate_over_keys_is_refused_wherever_it_is_fitted():
    mechanism = oscillator(uqmbd.extend.excitation(Wave(), uqmbd.t))
    study = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=2)])
    with pytest.raises(uqmbd.StudyError, match="collocation: the outputs depend on sampled paths of 'shaking'"):
        study.problem(Collocation(order=2))


@dataclass(frozen=True)
class Short(Wave):
    """Wave with paths up to 6 only."""

    def sample_paths(self, sources, keys, begin, end):
        if end > 6:
            raise uqmbd.StudyError(f"the path to {end:.3g} is too long.")
        return super().sample_paths(sources, keys, begin, end)


def test_only_realisations_beyond_the_end_of_a_path_fail():
    """Speeds up to 2 per second over four seconds: those above 1.5 leave the path; the others are unchanged."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1.0, 2.0), units="1/s")
    with pytest.warns(UserWarning, match="17 of 40 realisations failed"):
        found = samples(oscillator(uqmbd.extend.excitation(Short(), speed * uqmbd.t)), count=40)
    expected = samples(oscillator(uqmbd.extend.excitation(Wave(), speed * uqmbd.t)), count=40)
    fast = found["inputs"].sel(input="speed").values > 1.5
    assert 5 < fast.sum() < 35
    np.testing.assert_array_equal(found["status"].values != 0, fast)
    assert all("is too long" in message for message in found["message"].values[fast])
    np.testing.assert_array_equal(found["response"][~fast], expected["response"][~fast])
    with pytest.raises(uqmbd.StudyError, match="the path to 8 is too long"):
        samples(oscillator(uqmbd.extend.excitation(Short(), 2.0 * uqmbd.t)))


def test_equal_keys_share_a_path_and_means_have_none():
    calls = []

    class Counted(Wave):
        def sample_paths(self, sources, keys, begin, end):
            calls.append(len(keys))
            return super().sample_paths(sources, keys, begin, end)

    mechanism = oscillator(uqmbd.extend.excitation(Counted(), uqmbd.t))
    model = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=2)]).model
    calls.clear()
    Ensemble(model, np.array([[1.0, 0.3], [1.1, 0.0], [1.2, 0.3], [1.3, 0.7]]), until=4.0)
    assert sum(calls) == 2
    Ensemble(model, np.array([[1.0, 0.0]]), until=4.0)
    assert sum(calls) == 2


def test_knots_must_be_multiples_of_the_step():
    class Shifted(Wave):
        def sample_paths(self, sources, keys, begin, end):
            first, step, found = super().sample_paths(sources, keys, begin, end)
            return first + 0.3 * step, step, found

    with pytest.raises(uqmbd.StudyError, match="expected a knot that is a multiple of the step"):
        samples(oscillator(uqmbd.extend.excitation(Shifted(), uqmbd.t)))


def test_a_source_without_paths_has_no_motion():
    @dataclass(frozen=True)
    class Force:
        name: str = "force"
        units: str = "m"

    with pytest.raises(
        uqmbd.StudyError, match=r"output 'position' requires a simulated motion.* without sampled paths"
    ):
        samples(oscillator(uqmbd.extend.excitation(Force(), uqmbd.t)))


def test_long_paths_make_small_chunks():
    class Fine(Wave):
        def sample_paths(self, sources, keys, begin, end):
            return 0.0, STEP, np.zeros((len(keys), len(sources), 1_000_000))

    sizes = []
    for wave in (Wave(), Fine()):
        study = uqmbd.Study("s", oscillator(uqmbd.extend.excitation(wave, uqmbd.t)), TIMES, [MonteCarlo(samples=2)])
        sizes.append(study.problem(study.propagators[0]).chunk_of(50_000))
    assert sizes[0] > sizes[1] == 64
