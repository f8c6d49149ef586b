"""What acts for a moment only is not stepped over: free particles under pulses, whose impulses are closed forms."""

from __future__ import annotations

import json
from dataclasses import replace

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf, fresnel

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.contact import event_driven as hybrid
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

t = uqmbd.t
INTEGRATORS = ("auto", "dop853", "ida")
BOTH = [*((name, False) for name in INTEGRATORS), ("auto", True), ("dop853", True)]
"""Integrators, and whether there are events to follow, which IDA does not."""
TIMES = np.linspace(0, 1, 6)


class Mark(uqmbd.Component):
    """Notes when a body passes a place that it never comes to."""

    bodies = ("body",)

    def terms(self, p):
        """Yield the event."""
        yield uqmbd.Event(p.body.position[0] + 1e9, label="passes")


def particle(force, *, mark=False):
    """1 kg, free, with a force along x."""
    mechanism = uqmbd.Mechanism("particle", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    mechanism.add(PointForce("force", body, (0, 0), (force, 0)))
    if mark:
        mechanism.add(Mark("mark", body))
    mechanism.output("speed", body.velocity[0], units="m/s")
    return mechanism


def gauss(impulse, place, width):
    """A pulse of an impulse."""
    return impulse / (width * sympy.sqrt(2 * sympy.pi)) * sympy.exp(-(((t - place) / width) ** 2) / 2)


def speed_after(times, impulse, place, width):
    """What the pulse has given until then."""
    at = [erf((x - place) / (width * np.sqrt(2))) for x in (times, 0.0)]
    return impulse * (at[0] - at[1]) / 2


def chirp(rate, place):
    """A force of 1 N whose frequency falls to zero at a time and then grows."""
    return sympy.cos(rate * (t - place) ** 2)


def speed_of_chirp(times, rate, place):
    """The closed form, by the Fresnel integral."""
    scale = np.sqrt(2 * rate / np.pi)
    return (fresnel((times - place) * scale)[1] - fresnel(-place * scale)[1]) / scale


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(("rate", "place"), [(20.0, 0.0), (400.0, 0.37), (3000.0, 0.0), (3000.0, 0.9)])
def test_a_sine_whose_frequency_grows_needs_no_samples(integrator, rate, place):
    """Its steps adapt: a quiet start is followed by fast oscillations without an end, which no step misses."""
    mechanism = particle(chirp(rate, place))
    assert build(mechanism).timed is None
    data = uqmbd.simulate(mechanism, TIMES, integrator=integrator, check=False)
    np.testing.assert_allclose(data["speed"], speed_of_chirp(TIMES, rate, place), atol=2e-5)


def test_pieces_of_chirps_need_no_samples_and_jumps_between_them_are_found():
    """A torque that starts after a rest, with a random start, against the closed form."""
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.2, 0.7), units="s")
    mechanism = particle(sympy.Piecewise((0, t < start), (chirp(500.0, start), True)))
    assert build(mechanism).timed is None
    study = uqmbd.Study("late", mechanism, TIMES, [MonteCarlo(samples=16, seed=1)])
    samples = study.run()["monte-carlo/samples"].dataset
    late = np.clip(TIMES - samples["inputs"].values, 0, None)
    np.testing.assert_allclose(samples["response"].values[:, 0], speed_of_chirp(late, 500.0, 0.0), atol=2e-5)


PULSES = {
    "impulse": st.floats(0.1, 10.0),
    "place": st.floats(0.02, 0.98),
    "width": st.floats(np.log10(2e-4), np.log10(5e-2)).map(lambda x: 10.0**x),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("integrator", "mark"), BOTH)
@settings(max_examples=4, deadline=None)
@given(**PULSES)
def test_no_pulse_is_stepped_over(integrator, mark, impulse, place, width):
    """From 0.2 ms to 50 ms within a second, anywhere, of any size, against the closed form."""
    mechanism = particle(gauss(impulse, place, width), mark=mark)
    data = uqmbd.simulate(mechanism, TIMES, integrator=integrator, check=False)
    np.testing.assert_allclose(data["speed"], speed_after(TIMES, impulse, place, width), atol=1e-4 * max(1, impulse))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
@settings(max_examples=200, deadline=None)
@given(**PULSES, offset=st.floats(-3, 3))
def test_no_pulse_is_stepped_over_in_a_large_sample(integrator, impulse, place, width, offset):
    """The same, with a force that acts always."""
    mechanism = particle(gauss(impulse, place, width) + offset)
    data = uqmbd.simulate(mechanism, TIMES, integrator=integrator, check=False)
    expected = speed_after(TIMES, impulse, place, width) + offset * TIMES
    np.testing.assert_allclose(data["speed"], expected, atol=1e-4 * max(1, impulse))


CAP = float(np.cos(2e-3 * np.pi))
SHAPES = {
    "tanh": (sympy.tanh((t - 0.3) / 1e-3) - sympy.tanh((t - 0.302) / 1e-3), 4e-3),
    "half sine": (
        sympy.Piecewise((sympy.sin(1000 * sympy.pi * (t - 0.3)), (t > 0.3) & (t < 0.301)), (0, True)),
        2e-3 / np.pi,
    ),
    "caps": (sympy.Max(0, sympy.cos(2 * sympy.pi * (t - 0.4321)) - CAP), np.sin(2e-3 * np.pi) / np.pi - 2e-3 * CAP),
    "square of a sine": (
        sympy.sin(2 * sympy.pi * t + 1) ** 400,
        float(sympy.binomial(400, 200) / sympy.Integer(2) ** 400),
    ),
    "window": (sympy.Piecewise((1, sympy.cos(2 * sympy.pi * t) < -0.9999), (0, True)), np.arccos(0.9999) / np.pi),
    "wave packet": (sympy.exp(-(((t - 0.6) / 2e-3) ** 2)) * sympy.cos(9000 * (t - 0.6)) ** 2, np.sqrt(np.pi) * 1e-3),
}


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("shape", SHAPES)
def test_pulses_of_other_shapes_are_found_too(shape, integrator):
    """The speed at the end is the integral."""
    force, integral = SHAPES[shape]
    data = uqmbd.simulate(particle(force / integral), TIMES, integrator=integrator, check=False)
    assert float(data["speed"][-1]) == pytest.approx(1, abs=2e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_each_realisation_of_a_stack_has_its_own_pulse(integrator):
    """Random impulses at random times of random widths."""
    variables = [
        uqmbd.RandomVariable("impulse", chaospy.Uniform(0.5, 2), units="N s"),
        uqmbd.RandomVariable("place", chaospy.Uniform(0.1, 0.9), units="s"),
        uqmbd.RandomVariable("width", chaospy.LogUniform(np.log(5e-4), np.log(2e-2)), units="s"),
    ]
    propagator = MonteCarlo(samples=20, seed=3)
    study = uqmbd.Study("pulses", particle(gauss(*variables)), TIMES, [propagator], integrator=integrator)
    samples = study.propagate(propagator)["samples"]
    values = samples["inputs"].sel(input=[v.name for v in variables]).transpose("sample", "input").values
    response = samples["response"].sel(output="speed").transpose("sample", "time").values
    np.testing.assert_allclose(response, [speed_after(TIMES, *row) for row in values], atol=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_galerkin_and_collocation_see_the_pulse(integrator):
    """Linear in a random impulse."""
    impulse = uqmbd.RandomVariable("impulse", chaospy.Uniform(0.5, 2), units="N s")
    mechanism = particle(gauss(impulse, 0.37, 1e-3))
    study = uqmbd.Study("pulse", mechanism, TIMES, integrator=integrator)
    for propagator in (Galerkin(order=2, verify=0), Collocation(order=2, verify=0)):
        statistics = study.propagate(propagator)["statistics"].sel(output="speed")
        np.testing.assert_allclose(statistics["mean"], 1.25 * (TIMES > 0.37), atol=1e-4)
        np.testing.assert_allclose(statistics["std"], 1.5 / np.sqrt(12) * (TIMES > 0.37), atol=1e-4)


SMOOTH = {
    "sines": sympy.sin(10 * t) + sympy.cos(33 * t),
    "ramp": uqmbd.step(t, 0.2, 0, 0.7, 5),
    "periodic": sympy.exp(sympy.sin(20 * t)),
    "decay": sympy.exp(-t / 0.1),
    "rational": 1 / (1 + t**2),
    "run-up": sympy.sin(30 * t**2),
    "root": sympy.sqrt(1 + 100 * t),
}


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_forces_cost_no_more_than_without_the_look(name, integrator):
    """Evaluations of an oscillator with and without: none more, or few."""
    mechanism = particle(100 * SMOOTH[name])
    mechanism.add(SpringDamper("spring", mechanism.ground, mechanism.bodies["body"], (-1, 0), (0, 0), 400, 2, 1))
    model = build(mechanism)
    cost = []
    for some in (model, replace(model, timed=None)):
        counters = integrate(Ensemble(some, np.zeros((1, 0))), np.linspace(0, 1, 11), 1e-6, method=integrator).counters
        cost.append(counters.accelerations + counters.residuals)
    assert cost[0] <= 1.25 * cost[1]


# -- what a user may say ----------------------------------------------------------------------------------------------
def travelling():
    """A wave of 1 ms that runs along with the place of the particle: no function of time alone."""
    mechanism = uqmbd.Mechanism("particle", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    force = sympy.exp(-(((t - 0.55 - body.position[0]) / 1e-3) ** 2) / 2)
    mechanism.add(PointForce("force", body, (0, 0), (100 * force, 0)))
    mechanism.output("speed", body.velocity[0], units="m/s")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    "options", [{"max_step": 1e-3}, {"breaks": [0.545, 0.548, 0.55, 0.552, 0.555]}], ids=["step", "breaks"]
)
def test_what_depends_on_the_state_is_found_with_a_bound_or_with_breaks(options, integrator):
    """The particle gains about 0.25 m/s."""
    data = uqmbd.simulate(travelling(), [0, 0.5, 1], integrator=integrator, rtol=1e-8, check=False, **options)
    reference = uqmbd.simulate(travelling(), [0, 0.5, 1], integrator="dop853", rtol=1e-10, max_step=4e-4, check=False)
    assert float(reference["speed"][-1]) > 0.2
    np.testing.assert_allclose(data["speed"], reference["speed"], atol=1e-5)


@pytest.mark.parametrize(("integrator", "mark"), [x for x in BOTH if x[0] != "auto"])
def test_a_longest_step_bounds_the_steps_of_every_integrator(integrator, mark, monkeypatch):
    """There are at least as many evaluations as steps, also where these are more than any motion needs."""
    monkeypatch.setattr("uqmbd.dynamics.integration.dop853.STEPS", 200)
    monkeypatch.setattr(hybrid, "STEPS", 200)
    model = replace(build(particle(1, mark=mark)), max_step=1e-3)
    found = integrate(Ensemble(model, np.zeros((1, 0))), np.array([0.0, 0.5, 1.0]), method=integrator)
    assert found.messages == ("",)
    assert max(found.counters.steps, found.counters.residuals) >= 1000


@pytest.mark.thorough
def test_the_steps_of_galerkin_are_bounded_too():
    """By both of its integrators."""
    impulse = uqmbd.RandomVariable("impulse", chaospy.Uniform(0.5, 2), units="N")
    mechanism = particle(impulse)
    for integrator, what in (("dop853", "steps"), ("ida", "residuals")):
        few, many = (
            uqmbd.Study("pulse", mechanism, TIMES, max_step=bound).propagate(
                Galerkin(order=2, verify=0, integrator=integrator)
            )
            for bound in (None, 1e-3)
        )
        counts = [int(json.loads(node.attrs["solver_counters"])[what]) for node in (few, many)]
        assert counts[0] < 500 < 1000 <= counts[1]


@pytest.mark.parametrize("value", [0, -1e-3, np.inf, np.nan, "short", True, [1e-3]])
def test_a_longest_step_that_is_none_is_refused(value):
    """In a study and in a simulation."""
    mechanism = particle(1)
    for make in (
        lambda: uqmbd.Study("s", mechanism, TIMES, max_step=value),
        lambda: uqmbd.simulate(mechanism, TIMES, max_step=value),
    ):
        with pytest.raises(uqmbd.StudyError, match="max_step is .*; expected"):
            make()


@pytest.mark.parametrize("value", [0.5, "0.5", [np.nan], [np.inf], ["a"], [None], [[0.1]], None])
def test_breaks_that_are_no_times_are_refused(value):
    """In a study and in a simulation."""
    mechanism = particle(1)
    for make in (
        lambda: uqmbd.Study("s", mechanism, TIMES, breaks=value),
        lambda: uqmbd.simulate(mechanism, TIMES, breaks=value),
    ):
        with pytest.raises(uqmbd.StudyError, match="breaks .*; expected times"):
            make()


@pytest.mark.thorough
def test_the_results_say_how_steps_were_bounded(tmp_path):
    """In the attributes of the study, of the node and of a simulation; a checkpoint of other steps is not taken."""
    impulse = uqmbd.RandomVariable("impulse", chaospy.Uniform(0.5, 2), units="N")
    mechanism, propagator = particle(impulse), MonteCarlo(samples=4, seed=1)
    options = [{}, {"max_step": 0.01}, {"breaks": np.array([0.3, 0.1])}]
    studies = [uqmbd.Study("s", mechanism, TIMES, [propagator], **some) for some in options]
    expected = [{}, {"max_step": 0.01}, {"breaks": [0.1, 0.3]}]
    for study, said in zip(studies, expected, strict=True):
        tree = study.run(folder=tmp_path)
        for attrs in (tree.attrs, tree["monte-carlo"].attrs):
            assert {k: attrs[k] for k in ("max_step", "breaks") if k in attrs} == said
    said = uqmbd.simulate(mechanism, TIMES, max_step=0.01, breaks=[0.2]).attrs
    assert said["max_step"] == 0.01
    assert said["breaks"] == [0.2]
    prints = {study.problem(propagator).identity for study in studies}
    assert len(prints) == 3


def test_breaks_outside_of_the_times_are_none():
    """They may be those of a longer study."""
    data = uqmbd.simulate(particle(2), TIMES, breaks=[-1, 0, 1, 5])
    np.testing.assert_allclose(data["speed"], 2 * TIMES, atol=1e-6)


def test_an_integrator_of_a_plugin_that_cannot_bound_its_steps_is_refused(monkeypatch):
    """Before anything is computed; one that declares it is not."""

    class Steady:
        """Takes whatever steps it likes."""

        name = "steady"

        def integrate(self, ensemble, times, rtol):
            return integrate(ensemble, times, rtol)

    monkeypatch.setattr(
        uqmbd.plugins.registry, "registered", lambda: uqmbd.plugins.Registry((), {"integrators": {"steady": Steady}})
    )
    for options in ({"max_step": 0.1}, {"breaks": [0.5]}):
        with pytest.raises(uqmbd.StudyError, match="'steady' cannot bound its steps.*bounded_steps=True"):
            uqmbd.simulate(particle(1), TIMES, integrator="steady", check=False, **options)
    Steady.capabilities = uqmbd.extend.Capabilities(bounded_steps=True)
    data = uqmbd.simulate(particle(1), TIMES, integrator="steady", check=False, max_step=0.1)
    np.testing.assert_allclose(data["speed"], TIMES, atol=1e-6)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("width", [1e-3, 1e-4])
@pytest.mark.parametrize("at", [sympy.Rational(3, 2), 1.511])
def test_a_pulse_with_a_hole_in_it_is_seen(integrator, width, at):
    """u / sinh(u) is no number at u = 0, which is a point of the grid; its integral is pi^2 / 2."""
    u = (t - at) / width
    found = uqmbd.simulate(particle(u / sympy.sinh(u) / width), np.linspace(0, 3, 31), integrator=integrator)
    assert found["speed"].values[-1] == pytest.approx(np.pi**2 / 2, rel=1e-4)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("at", [0.7, 1.0, 1.5])
def test_an_exponential_whose_constant_is_out_of_range_is_computed(integrator, at):
    """SymPy writes exp((t - 1) / 0.001) as 5e-435 exp(1000 t); the impulse of each flank is 1 N s."""
    rises = sympy.Piecewise((1000 * sympy.exp((t - at) / 1e-3), t < at), (0, True))
    falls = sympy.Piecewise((0, t < at), (1000 * sympy.exp(-(t - at) / 1e-3), True))
    for force in (rises, falls, -rises / 2 + 1.5 * falls):
        found = uqmbd.simulate(particle(force), np.linspace(0, 2, 21), integrator=integrator)
        assert found["speed"].values[-1] == pytest.approx(1, abs=1e-5)


def test_a_function_that_is_rough_for_a_tenth_of_the_time_is_not_looked_at_without_end():
    waves = sum(sympy.sin(10_000 * np.sqrt(p) * t**2) for p in (2, 3, 5))
    rough = sympy.Piecewise((waves, (t > 0.4) & (t < 0.5)), (0, True))
    ensemble = Ensemble(build(particle(rough)), np.zeros((1, 0)))
    intervals = uqmbd.dynamics.integration.intervals.pace(ensemble, TIMES, 1e-6)
    assert len(intervals) < 20_000


class Spike(uqmbd.Component):
    """Notes when a body falls below a wall that stands for a moment only."""

    bodies = ("body",)
    width = uqmbd.Parameter("s")

    def terms(self, p):
        """Yield the event."""
        yield uqmbd.Event(p.body.position[0] + 1 - 3 * sympy.exp(-(((p.time - 0.637) / p.width) ** 2)), label="spike")


@pytest.mark.thorough
@pytest.mark.parametrize("width", [0.1, 1e-2, 3e-3, 1e-3, 1e-4])
def test_a_pulse_in_the_guard_of_an_event_is_seen(width):
    mechanism = uqmbd.Mechanism("particle", uqmbd.Translational())
    body = mechanism.body("particle", mass=1)
    spike = mechanism.add(Spike("spike", body, width))
    mechanism.output("when", spike.event_time("spike", 1), units="s")
    assert float(uqmbd.simulate(mechanism, TIMES)["when"]) == pytest.approx(
        0.637 - width * np.sqrt(np.log(3)), abs=1e-6
    )
