"""Verdicts: planted disagreements are called by name, and methods that agree are not said to differ.

The family of one comparison (all methods, outputs and times) is tested at the level 5 %.
"""

from __future__ import annotations

import re
import timeit
from collections.abc import Callable
from pathlib import Path

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy
import xarray as xr

import uqmbd
from uqmbd import extend, results
from uqmbd.cli.compare import show_comparison
from uqmbd.errors import StudyError
from uqmbd.randomness import GermSpace, JointInput, gauss_tensor, index_set
from uqmbd.report import error_cost
from uqmbd.report.sections.about_methods.comparison import agreement
from uqmbd.report.view import StudyResult
from uqmbd.results.assessment import verdicts
from uqmbd.results.assessment.distances import ks_by_chance, sample_distances
from uqmbd.results.assessment.simultaneous import chance, curve_length, pointwise_level
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0.0, 2.0, 101)
OUTPUTS = [("x", "m"), ("v", "m/s"), ("f", "N")]
SPACE = GermSpace.of(
    JointInput.of(
        [
            uqmbd.RandomVariable("stiffness", chaospy.Normal(40, 2), units="N/m"),
            uqmbd.RandomVariable("mass", chaospy.Uniform(0.95, 1.05), units="kg"),
        ]
    )
)
AXES = extend.labels(OUTPUTS, list(SPACE.inputs), TIMES)


def oscillator(germs: np.ndarray) -> np.ndarray:
    """Motion, velocity and spring force of an oscillator released at 1 m, (K, 3, T)."""
    columns = [SPACE.inputs.index(name) for name in ("stiffness", "mass")]
    stiffness, mass = np.asarray(SPACE.to_inputs(germs))[:, columns].T[:, :, None]
    rate = np.sqrt(stiffness / mass)
    x = np.cos(rate * TIMES)
    return np.stack([x, -rate * np.sin(rate * TIMES), stiffness * x], axis=1)


def sampled(label: str, count: int, seed: int, change=lambda response: response, axes=AXES) -> xr.DataTree:
    """Return a Monte Carlo node, whose responses may be changed."""
    germs = SPACE.from_uniform(np.random.default_rng(seed).random((count, 2)))
    data = extend.sample_dataset(change(oscillator(germs)), np.asarray(SPACE.to_inputs(germs)), axes)
    return results.propagator_node(
        label,
        extend.statistics_of_samples(data),
        data,
        propagator="monte-carlo",
        realisations=count,
        wall_time=0.01 * count,
        options={"samples": count, "sampling": "random"},
    )


def projected(label: str, order: int, *, shift=0.0, factor=1.0, stretch=1.0, verify=8) -> xr.DataTree:
    """Return the chaos of the oscillator, or of one of another mean, deviation, or range of times."""
    rule, index = gauss_tensor(SPACE, order + 1), index_set(2, order)
    coefficients = extend.project(oscillator(rule.nodes), SPACE.evaluate(rule.nodes, index), rule.weights)
    points = SPACE.from_uniform(np.random.default_rng(5).random((verify, 2)))
    more = {"verification_germs": points, "verification_response": oscillator(points)} if verify else {}
    chaos = results.PolynomialChaos(coefficients, index, SPACE, AXES, **more)
    statistics = chaos.statistics(samples=256)
    statistics["std"] = factor * statistics["std"]
    statistics["variance"] = statistics["std"] ** 2
    statistics["mean"] = statistics["mean"] + shift * statistics["std"].max("time")
    return results.propagator_node(
        label,
        statistics,
        propagator="collocation",
        realisations=len(rule.nodes),
        wall_time=0.01 * len(rule.nodes),
        children={"chaos": chaos.to_dataset()},
    )


@pytest.fixture(scope="module")
def exact() -> xr.DataTree:
    """Return a chaos that is exact to some 1e-5."""
    return projected("exact", 8)


def kinds(nodes: list[xr.DataTree], reference: str, method: str) -> list[str]:
    return results.compare(nodes, reference).sel({"method": method})["verdict_kind"].values.tolist()


@pytest.mark.thorough
@pytest.mark.parametrize(("repetitions", "most"), [(20, 1), pytest.param(100, 5, marks=pytest.mark.slow)])
def test_methods_that_agree_are_not_said_to_differ(exact: xr.DataTree, repetitions: int, most: int) -> None:
    """In seeded repetitions with three methods a false alarm in any output at any time is rarer than 5 %."""
    surrogate = projected("surrogate", 5)
    statistics = surrogate["statistics"].to_dataset()
    bare = results.propagator_node("surrogate", statistics, propagator="collocation", realisations=36, wall_time=0.36)
    alarms = 0
    for seed in range(repetitions):
        nodes = [sampled("a", 100, 2 * seed), sampled("b", 100, 2 * seed + 1), bare]
        found = results.compare(nodes, ["a", "surrogate"][seed % 2])
        alarms += bool((found["verdict_kind"] == verdicts.DIFFERS).any())
    assert alarms <= most
    assert kinds([exact, surrogate], "exact", "surrogate") == ["agrees"] * 3


@pytest.mark.slow
def test_false_alarms_of_normal_processes_meet_the_level() -> None:
    """Smooth normal processes with different correlation lengths: at most 5 % over a hundred repetitions."""
    rate = np.arange(1, 7)[:, None] * np.pi
    axes = extend.labels(OUTPUTS, list(SPACE.inputs), TIMES)
    alarms = 0
    for seed in range(100):
        nodes = []
        for label in ("a", "b"):
            rng = np.random.default_rng([seed, label == "a"])

            def process(response: np.ndarray, rng=rng) -> np.ndarray:
                a, b = rng.standard_normal((2, len(response), 3, 6))
                weights = np.exp(-np.outer([1.0, 0.5, 0.1], np.arange(6)))[None]
                return (weights * a) @ np.cos(rate * TIMES) + (weights * b) @ np.sin(rate * TIMES)

            nodes.append(sampled(label, 100, seed, process, axes))
        alarms += verdicts.DIFFERS in kinds(nodes, "a", "b")
    assert alarms <= 5


@pytest.mark.thorough
def test_a_shifted_mean_is_named(exact: xr.DataTree) -> None:
    """A third of a standard deviation is seen among 400 samples, and the size and the units are said."""
    for seed in range(10):
        found = results.compare([exact, sampled("mc", 400, seed, lambda r: r + 0.35 * r.std(axis=0).max(-1)[:, None])])
        row = found.sel({"method": "mc" if found.attrs["reference"] == "exact" else "exact"})
        assert row["verdict_kind"].values.tolist() == ["differs"] * 3
        assert all("mean shifted by" in text for text in row["verdict"].values)
    planted = results.compare([exact, projected("planted", 5, shift=0.1)], "exact").sel({"method": "planted"})
    assert "differs: mean shifted by" in planted["verdict"].values[0] and " m (10 % of" in planted["verdict"].values[0]
    assert "standard deviation too" not in " ".join(planted["verdict"].values)


@pytest.mark.thorough
def test_a_wrong_standard_deviation_is_named(exact: xr.DataTree) -> None:
    """23 % too small: by that number against a chaos, and within the noise of 600 samples against Monte Carlo."""
    planted = projected("planted", 5, factor=0.77)
    found = results.compare([exact, planted], "exact").sel({"method": "planted"})["verdict"].values.tolist()
    assert found == ["differs: standard deviation too small by 23 %"] * 3
    for seed in range(10):
        one = results.compare([sampled("mc", 600, seed), planted])
        assert one.attrs["reference"] == "mc"
        text = one.sel({"method": "planted"})["verdict"].values.tolist()
        # the standard deviation of 600 samples is itself known to 3 %, three times of which is allowed here
        assert all(14 <= int(t.removeprefix("differs: standard deviation too small by ")[:2]) <= 31 for t in text), text


@pytest.mark.thorough
def test_an_order_that_is_too_low_is_named(exact: xr.DataTree) -> None:
    """With its own verification or without: by the difference, and by the terms that are missing."""
    for verify in (8, 0):
        low = projected("low", 1, verify=verify)
        for other in (exact, sampled("mc", 1000, 3)):
            found = results.compare([other, low], str(other.name)).sel({"method": "low"})
            assert "under-resolved" in found["verdict_kind"].values
            if verify:
                assert any("order 1 is too low, its stated error is" in t for t in found["verdict"].values)


@pytest.mark.thorough
def test_too_few_samples_are_named(exact: xr.DataTree) -> None:
    """Twelve or thirty samples neither agree nor differ, in every repetition."""
    for count in (12, 30):
        for seed in range(5):
            found = results.compare([exact, sampled("mc", count, seed)], "exact").sel({"method": "mc"})
            assert found["verdict_kind"].values.tolist() == ["too few samples"] * 3
            assert f"mc has {count}" in found["verdict"].values[0]
    # the more converged one is the reference
    assert results.choose_reference({"mc": sampled("mc", 12, 1), "exact": exact}) == "exact"


@pytest.mark.thorough
def test_recommendation(exact: xr.DataTree) -> None:
    """The cheapest of those that agree; what is said of the others are the reasons not to take them."""
    nodes = [sampled("monte-carlo", 1000, 1), projected("fine", 5), projected("low", 1), projected("off", 5, shift=0.5)]
    found = results.compare(nodes)
    lead, *others = results.recommend(found)
    # the largest error, not an average over time: the number that stands in the table of the report
    largest = float(found["stated_error_max"].sel({"method": "fine"}).max())
    assert largest == nodes[1]["statistics/verification_error"].max()
    assert lead.startswith(
        f"Use fine: it agrees with monte-carlo, its stated error is at most {100 * largest:.2g} % of the standard "
        "deviation (of x, at 2 s), and it is "
    )
    # realisations are the costs of runs of at most a minute
    assert "28 times cheaper than monte-carlo (36 realisations instead of 1000)." in lead
    slower = [node.copy() for node in nodes]
    for node in slower:
        node.attrs["wall_time"] = 10 * node.attrs["wall_time"]
    words = "28 times cheaper than monte-carlo (3.6 s instead of 1 min 40 s for the whole method; 36 realisations instead of"
    assert words in results.recommend(results.compare(slower))[0]
    assert others[0].startswith("low") and "is under-resolved: order 1 is too low" in others[0]
    assert others[1].startswith("off differs from monte-carlo: mean shifted by ")
    assert found.attrs["recommendation"] == "\n".join((lead, *others))
    alone = results.recommend(results.compare([nodes[0], nodes[3]]))
    assert alone[0].startswith("No other method agrees with monte-carlo")
    unresolved = results.recommend(results.compare([nodes[0], nodes[2]]))
    assert unresolved[0].startswith("No other method is accurate enough to verify monte-carlo")
    shown = agreement(StudyResult.of(results.study_tree(nodes, study="s", mechanism="m")))
    assert shown is not None and shown["lead"] == lead and len(shown["each"]) == len(OUTPUTS) * len(nodes)


def test_chance_of_a_process_in_closed_form() -> None:
    """X cos t + Y sin t over half a turn: the largest size is Rayleigh distributed."""
    t = np.linspace(0, np.pi, 2001)
    assert curve_length([np.array([np.cos(t), np.sin(t)])]) == pytest.approx(np.pi, rel=1e-6)
    for bound in (2.5, 3.5, 4.5):
        exactly = np.exp(-0.5 * bound**2)
        assert exactly <= chance(bound, np.pi, 2001) <= 1.3 * exactly
    assert pointwise_level(0.05, np.inf, 401) == pytest.approx(0.05 / 401)


def test_distances_against_scipy() -> None:
    """The distances of SciPy, for samples of different numbers with ties; Massart's bound."""
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=300).round(1), rng.normal(0.3, 1.2, 170).round(1)
    wasserstein, ks = sample_distances(one, other)
    assert wasserstein == pytest.approx(scipy.stats.wasserstein_distance(one, other))
    assert ks == pytest.approx(scipy.stats.ks_2samp(one, other).statistic)
    assert scipy.stats.kstwo.sf(ks_by_chance([200, np.inf], 0.05), 200) == pytest.approx(0.05, abs=0.005)
    found = results.compare([sampled("a", 500, 1), projected("b", 5)])
    assert (found["ks"].sel({"method": "b"}) < found["ks_by_chance"].sel({"method": "b"})).all()


@pytest.mark.slow
def test_scipy_takes_longer_for_the_distances() -> None:
    """Once it is as quick, it takes over."""
    one, other = np.random.default_rng(0).normal(size=(2, 4096))

    def seconds(made: Callable[[], object]) -> float:
        return min(timeit.repeat(made, number=1, repeat=9))

    sold = seconds(lambda: (scipy.stats.wasserstein_distance(one, other), scipy.stats.ks_2samp(one, other).statistic))
    assert sold > 1.5 * seconds(lambda: sample_distances(one, other))


def test_outputs_without_time() -> None:
    """The same verdicts hold for results that have no time."""
    axes = extend.labels([("frequency", "Hz")], [], None)

    def node(label: str, seed: int, mean: float) -> xr.DataTree:
        values = np.random.default_rng(seed).normal(mean, 1.0, (300, 1))
        data = extend.sample_dataset(values, np.zeros((300, 0)), axes)
        statistics = extend.statistics_of_samples(data)
        return results.propagator_node(label, statistics, data, propagator="p", realisations=300, wall_time=1.0)

    nodes = [node("a", 1, 5.0), node("b", 2, 5.0), node("c", 3, 5.5)]
    assert kinds(nodes, "a", "b") == ["agrees"]
    assert kinds(nodes, "a", "c") == ["differs"]


@pytest.mark.thorough
def test_files_of_different_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Common times only, and what else differs is said; what cannot be compared is a StudyError."""
    nodes = {"mc": sampled("mc", 200, 1), "surrogate": projected("surrogate", 4)}
    coarse = results.align({"surrogate": nodes["surrogate"]})[0]["surrogate"]
    every = {n: coarse[n].to_dataset().isel(time=slice(None, None, 4)) for n in ("statistics", "chaos")}
    part = xr.DataTree.from_dict({"/": xr.Dataset(attrs=coarse.attrs), **every}, name="other")
    paths = []
    for name, group, more in (("one", nodes.values(), {"rtol": 1e-6}), ("two", [part], {"rtol": 1e-8})):
        tree = results.study_tree(group, study="s", mechanism="m", attrs=more)
        paths.append(results.save(tree, tmp_path / name / "results.nc").parent)
    monkeypatch.setattr("uqmbd.cli.report.write", lambda tree, path, **_: path)  # whose figures take their time
    show_comparison(paths, out=tmp_path / "both")
    said = capsys.readouterr().out
    assert "Only 26 times are common to all results (A mc has 101, A surrogate has 101, B other has 26)" in said
    assert "rtol" in said and "1e-08" in said
    assert "B other compared with A mc" in said
    # what could go unnoticed reads like no error
    unseen = r"agrees with A mc \(a difference of the standard deviation below \d+ % cannot be detected"
    assert re.search(unseen, " ".join(said.split()))
    both = results.load(tmp_path / "both" / "comparison.nc")
    results.validate(both)
    assert both["comparison"].attrs["reference"] == "A mc" and "what differs: rtol" in both.attrs
    with pytest.raises(StudyError, match="no such method; expected one of"):
        show_comparison(paths, reference="nobody")
    with pytest.raises(StudyError, match="no results.nc"):
        show_comparison([tmp_path, paths[0]])


def test_results_that_have_nothing_in_common() -> None:
    """Other units leave an output out; other times or outputs cannot be compared."""
    node = sampled("a", 30, 1)
    moved = node.copy()
    data = {n: moved[n].to_dataset() for n in ("statistics", "samples")}
    later = {n: d.assign_coords(time=d["time"] + 0.001) for n, d in data.items()}
    with pytest.raises(StudyError, match="no time in common"):
        results.align({"a": node, "b": xr.DataTree.from_dict(later, name="b")})
    other = {n: d.assign_coords(output_units=("output", ["mm", "m/s", "N"])) for n, d in data.items()}
    aligned, notes = results.align({"a": node, "b": xr.DataTree.from_dict(other, name="b")})
    assert aligned["a"]["statistics"]["output"].values.tolist() == ["v", "f"]
    assert "omits output x, because its units differ (m in a, mm in b)" in notes[0]


@pytest.mark.thorough
def test_error_against_cost() -> None:
    """The square of a normal output: order 1 misses the known part, order 2 nothing; a level that fails is one only."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.5), units="m/s")
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("square", stone.velocity[1] ** 2, units="m^2/s^2")
    study = uqmbd.Study("fall", mechanism, np.array([0.0, 0.1]))
    methods = [Collocation(), MonteCarlo(seed=3)]
    found = study.converge(methods, order=[1, 2, 9999], samples=[50, 800], reference=Collocation(order=3))
    # (m + s z)^2 = m^2 + s^2 + 2 m s z + s^2 (z^2 - 1): order 1 misses 2 s^4 of the variance 4 m^2 s^2 + 2 s^4
    m, s = 3 - 9.81 * np.array([0.0, 0.1]), 0.5
    whole = np.sqrt(4 * m**2 * s**2 + 2 * s**4)
    off = whole - 2 * m * s
    expected = np.sqrt(np.trapezoid(off**2) / np.trapezoid(whole**2))
    assert found["std_error_l2"].values[0, 0, 0] == pytest.approx(expected, rel=1e-4)
    assert found["std_error_l2"].values[0, 1, 0] < 1e-6
    assert "order is 9999; expected a whole number" in found["problem"].values[0, 2] and np.isnan(
        found["std_error_l2"].values[0, 2, 0]
    )
    assert found["realisations"].values[1, :2].tolist() == [50, 800]
    assert found["option"].values.tolist() == ["order", "samples"]
    drawn = error_cost(found, "square")
    assert len(drawn.axes) == 2
    for axes in drawn.axes:  # no point lies on an axis
        for line in (one for one in axes.lines if one.get_marker() != "None"):
            for values, (low, high) in ((line.get_xdata(), axes.get_xlim()), (line.get_ydata(), axes.get_ylim())):
                known = np.asarray(values)[np.isfinite(values)]  # a level that failed is a gap
                assert len(known) and np.all((low < known) & (known < high))
    with pytest.raises(StudyError, match="has no option tolerances"):
        study.converge(Collocation, tolerances=[1])
    with pytest.raises(StudyError, match="no levels are given"):
        study.converge(Collocation)


def rare_event(chance, seeds):
    """Two Monte Carlo runs of an output that is not zero in one of so many realisations."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1.5, 2.5))
    mechanism = uqmbd.Mechanism("stone", uqmbd.Translational())
    stone = mechanism.body("stone", mass=1, velocity=(speed, 0))
    mechanism.output("excess", sympy.Max(0, stone.velocity[0] - (2.5 - chance)), units="m/s")
    methods = [MonteCarlo(samples=200, seed=seed, label=f"mc{seed}") for seed in seeds]
    return uqmbd.Study("rare", mechanism, np.linspace(0, 1, 3), methods).run()["comparison"]


@pytest.mark.thorough
@pytest.mark.parametrize("chance", [0.0025, 0.005])
def test_what_is_so_rare_that_samples_miss_it_does_not_differ(chance):
    kinds = [str(k) for j in range(6) for k in rare_event(chance, (2 * j, 2 * j + 1))["verdict_kind"].values.ravel()]
    assert verdicts.DIFFERS not in kinds
    assert verdicts.FEW in kinds


def test_a_spread_that_is_not_rare_is_missed_by_no_samples():
    """A constant is told from an output of which every tenth realisation differs."""
    nodes = []
    for name, values in (("still", np.zeros(200)), ("moves", np.repeat([1.0, 0.0], [20, 180]))):
        axes = extend.labels(["x"], [], [0.0, 1.0])
        response = np.repeat(values[:, None, None], 2, axis=2)
        statistics = extend.statistics_dataset(axes, **results.sample_statistics(response))
        about = {"propagator": "p", "options": {"samples": 200}}
        nodes.append(results.propagator_node(name, statistics, realisations=200, wall_time=1.0, **about))
    found = results.compare(nodes, reference="moves")
    assert verdicts.DIFFERS in found["verdict_kind"].values


@pytest.mark.thorough
def test_an_integration_that_is_too_coarse_leads_the_recommendation():
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 1e-3))
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=length**2 / 12, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    methods = [Collocation(order=2), MonteCarlo(samples=60, seed=1)]
    for rtol, coarse in ((1e-3, True), (1e-9, False)):
        study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 20, 41), methods, rtol=rtol)
        said = study.run()["comparison"].attrs["recommendation"]
        assert said.startswith("Reduce rtol first: the error of the time integration is ") is coarse


@pytest.mark.parametrize("name", ["mean", "std"])
def test_what_does_not_know_its_statistics_at_a_time_is_never_recommended(name):
    """Cheaper and exact wherever it is known: at one time it is not."""
    axes = extend.labels(["x"], [], [0.0, 1.0, 2.0])

    def node(label, cost, **wrong):
        known = {"std_error_mean": [[1e-3] * 3], "std_error_std": [[1e-3] * 3]}
        values = {"mean": np.zeros((1, 3)), "std": np.ones((1, 3))} | wrong
        statistics = extend.statistics_dataset(axes, **values, **known)
        return results.propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01 * cost)

    hole = np.array([[0.0 if name == "mean" else 1.0] * 2 + [np.nan]])
    found = results.recommend(
        results.compare([node("many", 10000), node("few", 1000), node("holed", 500, **{name: hole})])
    )
    assert found[0].startswith("Use few:"), found
    assert any(s.startswith("holed has no mean or standard deviation at 1 time;") for s in found[1:]), found
    two = results.recommend(
        results.compare([node("many", 10000), node("holed", 500, **{name: hole})], reference="many")
    )
    assert two[0].startswith("No other method") and "Use holed" not in " ".join(two)
