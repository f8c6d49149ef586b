"""Outputs that sum a motion up in every method: what does not happen is counted, and where peaks compete is told."""

from __future__ import annotations

import json
import warnings

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy

import uqmbd
from uqmbd.report import scalar_densities, write_report
from uqmbd.results import PolynomialChaos, Status, load, save, validate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

TIMES = np.linspace(0, 1, 11)


def oscillator(over_time=True):
    """A mass on a spring, x = 1.5 + a cos(10 t): it reaches 1.05 where a >= 0.45, which has a probability of 3/4."""
    amplitude = uqmbd.RandomVariable("a", chaospy.Uniform(0.4, 0.6))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1.5 + amplitude, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), 100, free_length=1.5))
    if over_time:
        mechanism.output("x", mass.position[0], units="m")
    mechanism.output("fastest", uqmbd.maximum(mass.velocity[0]), units="m/s")
    mechanism.output("reached", uqmbd.first_time(mass.position[0] <= 1.05), units="s")
    mechanism.output("middle", uqmbd.first_time(mass.position[0] <= 1.5), units="s")
    return mechanism


@pytest.fixture(scope="module")
def results():
    study = uqmbd.Study(
        "oscillator", oscillator(), TIMES, [MonteCarlo(samples=400, seed=1), Collocation(order=3), Galerkin(order=3)]
    )
    with pytest.warns(
        uqmbd.StudyWarning, match=r"output 'reached' has no statistics: its event does not occur in \d+ of"
    ):
        return study.run()


@pytest.mark.thorough
def test_monte_carlo_counts_where_it_does_not_happen(results):
    """Its statistics are those of the others: arccos(-0.45 / a) / 10 with a uniform on 0.45 .. 0.6."""
    data = results["monte-carlo/scalars/statistics"].to_dataset().sel(output="reached")
    share, count = float(data["censored"]), 400
    assert abs(share - 0.25) < 4 * np.sqrt(0.25 * 0.75 / count)
    amplitudes = np.linspace(0.45, 0.6, 200_001)
    exact = np.arccos(-0.45 / amplitudes) / 10
    assert abs(float(data["mean"]) - exact.mean()) < 5 * exact.std() / np.sqrt(0.75 * count)
    there = round((1 - share) * count)
    t, usual = scipy.stats.t(there - 1).ppf(0.975), float(data["std"]) / np.sqrt(there)
    reach = t + abs(float(data["skewness"])) * (1 + 2 * t**2) / (6 * np.sqrt(there))
    assert float(data["std_error_mean"]) == pytest.approx(reach / 1.959963985 * usual, rel=1e-9)
    others = results["monte-carlo/scalars/statistics"].to_dataset().sel(output=["fastest", "middle"])
    assert (others["censored"].values == 0).all()
    assert int(results["monte-carlo"].attrs["failures"]) == 0


@pytest.mark.thorough
@pytest.mark.parametrize("label", ["collocation", "galerkin"])
def test_a_chaos_refuses_it_alone(results, label):
    """The others are as accurate as ever; nothing is NaN in silence."""
    node = results[label]["scalars"]
    data = node["statistics"].to_dataset()
    assert list(json.loads(node.attrs["refused"])) == ["reached"]
    assert np.isnan(data["mean"].sel(output="reached"))
    # its nodes and verification realisations are no sample of the inputs: their share is no probability
    assert np.isnan(float(data["censored"].sel(output="reached")))
    assert float(data["mean"].sel(output="fastest")) == pytest.approx(5.0, rel=1e-5)
    assert float(data["mean"].sel(output="middle")) == pytest.approx(np.pi / 20, rel=1e-5)
    chaos = PolynomialChaos.from_dataset(node["chaos"])
    assert [output.name for output in chaos.labels.outputs] == ["fastest", "middle"]


@pytest.mark.thorough
def test_results_say_so(results, tmp_path):
    """Stored, compared without it, and in the report, with its density among the others."""
    validate(results)
    save(results, tmp_path / "results.nc")
    assert load(tmp_path / "results.nc").identical(results)
    compared = results["comparison"].to_dataset()
    assert compared.attrs["censored"] == "reached"
    assert compared["scalar"].values.tolist() == ["fastest", "middle"]
    words = "has no statistics of reached, which does not occur in all realisations; use monte-carlo for this output."
    recommended = json.loads(compared.attrs["recommended"])
    assert (words in compared.attrs["recommendation"]) == bool({"collocation", "galerkin"} & set(recommended))
    assert recommended
    text = write_report(results, tmp_path / "report.html").read_text()
    assert "could not be drawn" not in text
    names = [axes.get_xlabel() for axes in scalar_densities(results).axes]
    assert names == ["fastest [m/s]", "reached [s]", "middle [s]"]
    assert "reached does not occur in" in text
    assert "its statistics use the other realisations" in text
    assert "a surrogate would be an extrapolation" in text


@pytest.mark.thorough
def test_samples_hold_it_where_it_happens(results):
    """At arccos(-0.45 / a) / 10 where a >= 0.45, else NaN; no sample has failed."""
    samples = results["monte-carlo/scalars/samples"].to_dataset()
    amplitude = samples["inputs"].sel(input="a").values
    with np.errstate(invalid="ignore"):
        exact = np.arccos(-0.45 / amplitude) / 10
    found = samples["response"].sel(output="reached").values
    np.testing.assert_allclose(found, exact, rtol=1e-5)
    assert (samples["status"].values == Status.OK).all() and 0 < np.isnan(found).sum() < len(found)


@pytest.mark.thorough
def test_without_outputs_over_time():
    """Nothing else is asked for: all methods have a node."""
    mechanism = oscillator(over_time=False)
    for name in ("fastest", "middle"):
        del mechanism.scalars[name]
    study = uqmbd.Study("oscillator", mechanism, TIMES, [MonteCarlo(samples=50, seed=1), Collocation(order=2)])
    with (
        pytest.warns(uqmbd.StudyWarning, match="has no statistics"),
        pytest.warns(
            UserWarning, match="the comparison of the methods failed: there are no outputs to compare: reached"
        ),
    ):
        results = study.run()
    assert float(results["monte-carlo/scalars/statistics"]["censored"][0]) > 0
    assert np.isnan(float(results["collocation/scalars/statistics"]["mean"][0]))


@pytest.mark.thorough
def test_times_that_jump_between_peaks_are_reported():
    """Two pulses of a force, of which the larger one is either: the largest is kinked, its time jumps by 0.5 s."""
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.5, 1.5))
    mechanism = uqmbd.Mechanism("pulses", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1)
    force = sympy.exp(-(((uqmbd.t - 0.25) / 0.05) ** 2)) + height * sympy.exp(-(((uqmbd.t - 0.75) / 0.05) ** 2))
    mechanism.add(PointForce("force", mass, (0, 0), (force, 0)))
    mechanism.output("peak", uqmbd.maximum(mass.acceleration[0]), units="m/s^2")
    mechanism.output("when", uqmbd.time_of_maximum(mass.acceleration[0]), units="s")
    mechanism.output("smooth", uqmbd.integral(mass.acceleration[0]), units="m/s")
    study = uqmbd.Study(
        "pulses", mechanism, [0, 1], [Collocation(order=9), Collocation(order=3, elements=16, label="e")]
    )
    with pytest.warns(UserWarning) as told:
        results = study.run()
    assert any("when looks discontinuous, or has a kink" in str(warning.message) for warning in told)
    exact = {"peak": 1.125, "when": 0.5, "smooth": 2 * np.sqrt(np.pi) * 0.05}
    data = results["e/scalars/statistics"].to_dataset()
    for name, value in exact.items():
        assert float(data["mean"].sel(output=name)) == pytest.approx(value, rel=2e-2)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # which the recommendation tells, too
def test_what_is_wrong_without_a_time_is_reported_with_the_recommendation():
    """The position is a polynomial of the input, the kinked peak is none: the first line is about both."""
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.5, 1.5))
    mechanism = uqmbd.Mechanism("pulses", uqmbd.Line())
    mass = mechanism.body("mass", mass=1)
    mechanism.add(PointForce("force", mass, 0, sympy.sin(uqmbd.t) + height))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("peak", uqmbd.maximum(sympy.Abs(mass.position[0] - uqmbd.t**2 / 2)), units="m")
    mechanism.output("end", uqmbd.final(mass.position[0]), units="m")
    study = uqmbd.Study("pulses", mechanism, [0, 0.5, 1], [MonteCarlo(samples=500, seed=1), Collocation(order=1)])
    compared = study.run()["comparison"].to_dataset()
    assert compared["verdict_kind"].sel({"method": "collocation"}).values == "agrees"
    lead = compared.attrs["recommendation"].split("\n")[0]
    assert "Use collocation" in lead
    assert "Scalar outputs: do not rely on peak of collocation: under-resolved" in lead


@pytest.mark.thorough
def test_what_never_happens_is_reported_as_that():
    """Nothing has failed, and nothing is to be kept clear of."""
    mechanism = uqmbd.Mechanism("throw", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2))
    x = mechanism.body("body", mass=1, velocity=(speed, 0)).position[0]
    mechanism.output("reached", uqmbd.first_time(x >= 9))
    study = uqmbd.Study("throw", mechanism, [0, 1], [MonteCarlo(samples=20, seed=1), Collocation(order=2)])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        results = study.run()
    words = [str(one.message) for one in told if "has no statistics" in str(one.message)]
    assert len(words) == 2
    assert all("does not occur in any realisation up to the last output time" in one for one in words)
    for label in ("monte-carlo", "collocation"):
        assert float(results[label]["scalars/statistics"]["censored"][0]) == 1


@pytest.mark.thorough
def test_what_happens_in_all_realisations_is_bounded_by_their_number(results):
    """By Clopper and Pearson: of 400 samples 0.75 %; nodes are no samples, verification realisations are some."""
    sampled = results["monte-carlo/scalars/statistics"].to_dataset()["censored_bound"]
    assert float(sampled.sel(output="middle")) == pytest.approx(1 - 0.05 ** (1 / 400))
    assert float(sampled.sel(output="fastest")) == 0  # a largest value there always is
    share = float(results["monte-carlo/scalars/statistics"]["censored"].sel(output="reached"))
    assert share < float(sampled.sel(output="reached")) < share + 0.06
    surrogate = results["collocation/scalars/statistics"].to_dataset()["censored_bound"]
    assert 1 - 0.05 ** (1 / 16) <= float(surrogate.sel(output="middle")) < 0.5
    assert np.isnan(surrogate.sel(output="reached"))
