"""The first screen says what was asked, why, and how reliable it is, by numbers that can be computed otherwise."""

import json
import re

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr

import uqmbd
from tests.mechanisms import pendulum
from uqmbd import extend, report, results
from uqmbd.report.overview.answers import ANSWERS, in_view, results_table
from uqmbd.report.overview.influences import of_history
from uqmbd.report.view import StudyResult
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0.0, 1.0, 11)


def sampled(label="mc", count=400, seed=0):
    """Samples of two outputs: y = t (2 a - b) is uncertain, x = 10 + t a / 100 hardly."""
    a, b = np.random.default_rng(seed).normal(size=(2, count))
    y = TIMES * (2 * a - b)[:, None]
    axes = extend.labels([("x", "m"), ("y", "N")], [("a", "m"), ("b", "m")], TIMES)
    data = extend.sample_dataset(np.stack([10 + 0.01 * TIMES * a[:, None], y], axis=1), np.stack([a, b], axis=1), axes)
    return results.propagator_node(
        label, extend.statistics_of_samples(data), data, propagator="monte-carlo", realisations=count, wall_time=1.0,
        options={"samples": count, "sampling": "random"},
    )  # fmt: skip


def required(node, probability, lower, upper):
    """Give a method probabilities of two requirements and of any."""
    data = extend.requirements_dataset(["one", "two"], violation_probability=probability, lower=lower, upper=upper)
    node["requirements"] = xr.DataTree(data)
    return node


def test_numbers_that_tell_most_are_those_of_the_statistics():
    result = StudyResult.of(results.study_tree([sampled()], study="s", mechanism="m"))
    y, x = results_table(result)["rows"]
    assert [row["known"] for row in (y, x)] == [result.assessment.of(name)[0] for name in "yx"]
    data = result.methods["mc"].of("y")
    assert (y["name"], x["name"]) == ("y", "x") and in_view(result) == "y"
    assert y["when"] == "1 s" and float(y["spread"].removesuffix(" N")) == pytest.approx(
        float(data["std"].max()), rel=2e-4
    )
    ends = data["quantile"].sel(probability=[0.025, 0.975]).isel(time=-1).values
    low, high = y["extremes"]["low"], y["extremes"]["high"]
    assert [float(low.replace("−", "-")), float(high.removesuffix(" N"))] == pytest.approx(ends, rel=2e-4)
    assert y["extremes"]["low_at"] == y["extremes"]["high_at"] == "1 s"


def test_effects_are_those_of_the_model():
    """Of 2 a - b with independent normal inputs the standardised coefficients are 2 and -1 over the root of 5."""
    result = StudyResult.of(results.study_tree([sampled(count=20_000)], study="s", mechanism="m"))
    found = of_history(result, "y")
    assert found.names == ("a", "b") and found.signed
    np.testing.assert_allclose(found.shares, np.array([2, -1]) / 5**0.5, atol=0.02)
    assert found.words == "a (89 %, increases it)" and "100 % of the variance" in found.kind


@pytest.mark.parametrize(("product", "first", "total"), [(1, 1 / 3, 2 / 3), (0, 1 / 2, 1 / 2)])
def test_total_indices_that_add_up_to_more_than_all_say_so(product, first, total):
    """Of a + b + ab, of independent normal inputs, each explains a third alone and takes part in two: 133 % in all."""
    axes = extend.labels([("y", "N")], [("a", "m"), ("b", "m")], TIMES)
    ones = np.ones((1, len(TIMES)))
    data = extend.statistics_dataset(
        axes, mean=0 * ones, std=ones, sobol_first=first * np.stack([ones, ones]), sobol_total=total * np.stack([ones, ones])
    )  # fmt: skip
    node = results.propagator_node("c", data, propagator="collocation", realisations=9, wall_time=1.0, options={})
    result = StudyResult.of(results.study_tree([node], study="s", mechanism="m"))
    found = of_history(result, "y")
    np.testing.assert_allclose([found.shares, found.alone], [[total, total], [first, first]])
    assert ("133 %" in found.together) == bool(product)
    bars = ANSWERS.content(result)["matters"]["bars"]
    assert [bar["alone"] for bar in bars] == (["50.0", "50.0"] if product else [None, None])


def test_inputs_that_depend_on_one_another_have_correlations_and_no_shares():
    """A regression on inputs of correlation 0.99 has effects of several times the spread; correlations are at most 1."""
    first, second = np.random.default_rng(0).normal(size=(2, 400))
    a, b = first, 0.99 * first + np.sqrt(1 - 0.99**2) * second
    axes = extend.labels([("y", "N")], [("a", "m"), ("b", "m")], TIMES)
    response = (TIMES * (5 * a - 4.9 * b)[:, None])[:, None]
    data = extend.sample_dataset(response, np.stack([a, b], axis=1), axes)
    node = results.propagator_node(
        "after", extend.statistics_of_samples(data), data, propagator="p", realisations=400, wall_time=1.0
    )
    found = of_history(StudyResult.of(results.study_tree([node], study="s", mechanism="m")), "y")
    expected = {name: np.corrcoef(x, response[:, 0, -1])[0, 1] for name, x in (("a", a), ("b", b))}
    assert dict(zip(found.names, found.shares, strict=True)) == pytest.approx(expected)
    assert found.words.startswith(f"{found.names[0]} (correlation ") and "whose inputs are dependent" in found.kind


def test_a_requirement_is_met_where_all_methods_say_so():
    first = required(sampled("first"), [0.02, 0.001, 0.021], [0.01, 0.0, 0.011], [0.03, 0.002, 0.031])
    second = required(sampled("second", seed=1), [0.06, 0.001, 0.061], [0.04, 0.0, 0.041], [0.08, 0.002, 0.081])
    for allowed, verdicts in (
        (0.09, ["met"] * 3),
        (0.005, ["not met", "met", "not met"]),
        (0.035, ["met by first, not met by second", "met"]),
        (0.07, ["met by first, not certain by second", "met"]),
        (0.025, ["not met", "met"]),  # the other is sure, and the one does not contradict it
    ):
        tree = results.study_tree([first, second], study="s", mechanism="m", attrs={"allowed_probability": allowed})
        rows = results_table(StudyResult.of(tree))["rows"]
        assert [row["name"] for row in rows] == ["one", "two", "any"]
        assert [row["verdict"] for row in rows][: len(verdicts)] == verdicts
    # their intervals have nothing in common: that is worst, and said first
    lines = results.assess(tree).reliability
    assert lines[0].level == 0 and "contradict each other" in lines[0].reason
    assert [line.level for line in lines] == sorted(line.level for line in lines)


@pytest.mark.filterwarnings("ignore::uqmbd.errors.UnusedInputWarning")
def test_a_limit_is_drawn_where_a_requirement_compares_an_output_with_a_number(tmp_path):
    mechanism = pendulum()
    x, y = (mechanism.outputs[name].expression for name in "xy")
    mechanism.require("right", x <= 0.9)
    mechanism.require("high", y >= -0.6)
    mechanism.require("other", 2 * x + y <= 3)
    study = uqmbd.Study("s", mechanism, np.linspace(0, 0.2, 3), [MonteCarlo(samples=40, seed=1, label="mc")])
    tree = study.run()
    assert json.loads(tree.attrs["limits"]) == [
        {"requirement": "right", "output": "x", "limit": 0.9, "end": "highest"},
        {"requirement": "high", "output": "y", "limit": -0.6, "end": "lowest"},
    ]
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    limits = [
        json.loads(text).get("limits", [])
        for text in re.findall(r'<script type="application/json">(.*?)</script>', page)
    ]
    # those of charts; the data of the sliders name the output, too
    limits = [limit for limit in limits if limit and "name" in limit[0]]
    assert limits[1:] == [[{"name": "right", "value": 0.9}], [{"name": "high", "value": -0.6}]]
    assert limits[0] in limits[1:]
    model = json.loads(tree.attrs["model"])
    assert model["components"]["pin"]["parameters"]["point_i"] == "(0, 0) m"
    assert model["bodies"]["rod"]["mass"].endswith(" kg")
    provenance = page.split('<section id="provenance">')[1].split("</section>")[0]
    assert "null" not in provenance and "(0, 0) m" in provenance


@pytest.mark.parametrize("count", [20, 400])
def test_what_a_method_with_few_samples_says_is_not_trusted(count):
    lines = results.assess(results.study_tree([sampled(count=count)], study="s", mechanism="m")).reliability
    # 1.96 standard errors of a standard deviation of normal samples are 1.39 of it over the root of their number
    assert {line.level for line in lines} == ({0} if count == 20 else {1})


def test_a_method_that_is_alone_and_not_known_well_comes_with_what_would_help(make_chaos):
    """It is not told to be used again as it was; nor is a requirement that was never violated by few samples."""
    alone = results.assess(results.study_tree([make_chaos("c", 1)], study="s", mechanism="m"))
    (said,) = alone.recommendation
    assert min(line.level for line in alone.reliability) < 2 and "Raise the order; if that does not" in said
    known = results.assess(results.study_tree([make_chaos("c", 7)], study="s", mechanism="m"))
    assert min(line.level for line in known.reliability) == 2 and known.recommendation == ()
    never = required(sampled(count=100), [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.03, 0.03, 0.03])
    words = results.assess(results.study_tree([never], study="s", mechanism="m")).recommendation
    assert "one, two: ten times as many realisations" in words[-1]


def test_a_page_of_samples_alone_shows_the_nearest_realisation_and_says_so(tmp_path):
    def page(node):
        tree = results.study_tree([node], study="s", mechanism="m")
        return report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")

    assert "This page evaluates no surrogate: outputs and charts show the nearest of" in page(sampled())
    alone = sampled()
    assert 'id="explore"' not in page(alone.drop_nodes("samples"))


def test_a_page_without_histories_has_no_section_of_them(tmp_path):
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("highest", uqmbd.maximum(stone.position[1]), units="m")
    study = uqmbd.Study("s", mechanism, TIMES, [MonteCarlo(samples=8, seed=1)])
    page = report.write_report(study.run(), tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'id="scalars"' in page and 'id="outputs"' not in page and 'href="#outputs"' not in page


def test_outputs_before_and_after_a_calibration_stand_side_by_side():
    """The chart in view begins with the last population, whose inputs are below it."""
    before, after = sampled("before"), sampled("after", seed=1)
    after.attrs["population"] = "what a record told"
    result = StudyResult.of(results.study_tree([before, after], study="s", mechanism="m"))
    picture = ANSWERS.content(result)["picture"]
    assert picture["caption"].startswith("y by after, before: ")
    assert [row["name"] for row in results_table(result)["rows"]] == [
        "y (before)",
        "y (after)",
        "x (before)",
        "x (after)",
    ]
    lines = result.assessment.reliability
    other = "not compared: no other method has the same distributions of the inputs"
    assert len(lines) == 4 and all(line.reason.endswith(other) for line in lines)


def test_a_quantity_that_is_not_compared_has_a_reason_and_its_method():
    """Of several methods the one of each row is named; one may be alone, or the only one that states a probability."""
    (alone, _) = results.assess(results.study_tree([sampled()], study="s", mechanism="m")).reliability
    assert alone.reason.startswith("stated error ") and alone.reason.endswith("; not compared: this is the only method")
    never = required(sampled(), [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.01, 0.01, 0.01])
    found = results.assess(results.study_tree([never, sampled("second", seed=1)], study="s", mechanism="m"))
    for name in ("one", "two", "any"):
        (line,) = found.of(name, "requirement")
        assert line.reason.startswith("by mc, no violation occurred, ")
        assert line.reason.endswith("; not compared: no other method states it")
    (compared,) = found.of("y")
    assert compared.reason.startswith(f"by {compared.method}, stated error ")


def test_a_reference_that_is_blind_to_a_spread_is_not_trusted():
    axes = extend.labels([("x", "m")], [], TIMES)
    still = extend.statistics_dataset(axes, mean=[np.ones(11)], std=[np.zeros(11)])
    blind = results.propagator_node("blind", still, propagator="p", realisations=1, wall_time=0.1)
    moving = extend.statistics_dataset(axes, mean=[np.ones(11)], std=[np.full(11, 0.2)])
    other = results.propagator_node("other", moving, propagator="p", realisations=9, wall_time=0.1)
    tree = results.study_tree([blind, other], study="s", mechanism="m")
    tree["comparison"].attrs |= {"reference": "blind", "recommended": "[]"}
    (row,) = results_table(StudyResult.of(tree))["rows"]
    assert row["method"] == "other" and float(row["spread"].removesuffix(" m")) == pytest.approx(0.2)


def test_an_output_is_reported_by_the_method_that_knows_it():
    """A distance has a kink where it passes zero, which no polynomial of order 2 follows; the place itself is linear."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(0, 1), units="m/s")
    mechanism = uqmbd.Mechanism("slide", uqmbd.Line())
    stone = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("place", stone.position[0], units="m")
    mechanism.output("distance", sympy.sqrt(stone.position[0] ** 2), units="m")
    methods = [MonteCarlo(samples=100, seed=1), Collocation(order=2)]
    with pytest.warns(uqmbd.SurrogateWarning, match="exceeds 10% of the standard deviation: 'distance' from t = 1.5 s"):
        result = StudyResult.of(uqmbd.Study("s", mechanism, np.linspace(1, 2, 3), methods).run())
    place, distance = sorted(result.assessment.reliability, key=lambda line: line.name, reverse=True)
    assert (place.level, distance.level) == (2, 0)
    assert place.reason.startswith("by collocation, stated error ") and "agrees with monte-carlo" in place.reason
    assert "by collocation" not in distance.reason
    assert {row["name"]: row["method"] for row in results_table(result)["rows"]} == {
        "place": "collocation",
        "distance": "monte-carlo",
    }
    lead = result.assessment.recommendation[0]
    assert lead.startswith("No other method is accurate enough to verify monte-carlo, the reference, on distance (")
    assert lead.endswith(" on place.")
