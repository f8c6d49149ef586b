"""Realisations state whether they are draws or nodes, and nothing is counted from nodes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar, Literal

import chaospy
import numpy as np
import pytest
from scipy.stats import norm

import uqmbd
from uqmbd.extend import StatedError, labels, sample_dataset, statistics_dataset
from uqmbd.report import write_report
from uqmbd.results import assess, compare_requirements, propagator_node, unmet, validate
from uqmbd_montecarlo import MonteCarlo


@dataclass(frozen=True, kw_only=True)
class Spread(uqmbd.extend.Propagator):
    """Training points that fill the space from -4 to 4 standard deviations, weighted by the density."""

    name: ClassVar[str] = "spread"
    kind: Literal["draws", "nodes", "nothing"] = "nodes"
    child: Literal["samples", "nodes"] = "nodes"

    def propagate(self, problem):
        z = np.linspace(-4, 4, 101)[:, None]
        found = problem.realise(problem.inputs.from_uniform(norm.cdf(z)))
        weights = norm.pdf(z[:, 0]) / norm.pdf(z[:, 0]).sum()
        mean = np.tensordot(weights, found.response, 1)
        std = np.sqrt(np.tensordot(weights, (found.response - mean) ** 2, 1))
        about = {} if self.kind == "nothing" else {"kind": self.kind}
        rows = sample_dataset(found.response, found.values, problem.labels, status=found.status, **about)
        statistics = statistics_dataset(problem.labels, mean=mean, std=std)
        return problem.node(self, statistics, realisations=101, **{self.child: rows})


def stone():
    """A stone in free flight: its height at 1 s is the speed, N(3, 0.2) m/s."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    body = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("height", body.position[0], units="m")
    mechanism.require("low", body.position[0] <= 3.4)
    return mechanism


def run(*methods):
    return uqmbd.Study("throw", stone(), [0, 0.5, 1], methods).run()


def test_no_probability_is_counted_from_nodes():
    """Monte Carlo gives the exact 2.28 %; from nodes that fill the space it would be 26 of 101."""
    tree = run(MonteCarlo(samples=1024, sampling="sobol", seed=1), Spread())
    validate(tree)
    node = tree["spread"]
    assert "samples" not in node.children
    assert node["nodes"].dataset["response"].dims == ("node", "output", "time")
    found = node["requirements"].dataset
    assert np.isnan(found["violation_probability"].values).all()
    assert found["interval"].values.tolist() == [[0.0, 1.0]]
    assert np.isnan(node["statistics"].dataset["quantile"].values).all()
    counted = tree["monte-carlo/requirements"].dataset["interval"].values[0]
    assert counted[0] <= norm.sf(2.0) <= counted[1]


def test_a_method_that_does_not_know_is_not_among_those_that_agree():
    """It neither agrees nor keeps a requirement from being met."""
    tree = run(MonteCarlo(samples=1024, sampling="sobol", seed=1), Spread())
    nodes = {label: tree[label] for label in ("monte-carlo", "spread")}
    assert compare_requirements(nodes, "spread")["violation_verdict"].values.ravel().tolist() == [
        "reference",
        "not known",
    ]
    (one,) = assess(tree).of("low", "requirement")
    assert one.method == "monte-carlo"
    assert one.reason.endswith("; not compared: no other method states it")
    assert unmet(nodes, probability=0.1) == []
    assert unmet({"spread": nodes["spread"]}, probability=0.1)  # nobody knows


def test_a_method_without_a_stated_error_does_not_state_an_infinite_one():
    """No sentence has a percentage that is infinite."""
    tree = run(MonteCarlo(samples=1024, sampling="sobol", seed=1), Spread())
    assert "inf" not in tree["comparison"].attrs["recommendation"]
    assert "spread agrees with monte-carlo." in tree["comparison"].attrs["recommendation"]


@pytest.mark.parametrize(("kind", "child"), [("nothing", "samples"), ("nodes", "samples"), ("draws", "nodes")])
def test_rows_of_another_kind_are_refused(kind, child):
    """The message names the method and both ways to write it."""
    problem = uqmbd.Study("throw", stone(), [0, 1], [method := Spread(kind=kind, child=child)])
    with pytest.raises(uqmbd.StudyError, match="draws from the joint distribution") as caught:
        problem.propagate(method)
    assert 'sample_dataset(..., kind="nodes")' in str(caught.value)


def test_nodes_that_are_stated_as_draws_are_reported_once():
    """Each kind of outputs has such samples; the warning names the method, the input and the argument to write."""
    mechanism = stone()
    mechanism.output("highest", uqmbd.maximum(mechanism.bodies["stone"].position[0]), units="m")
    study = uqmbd.Study("throw", mechanism, [0, 1], [method := Spread(kind="draws", child="samples")])
    with pytest.warns(uqmbd.StudyWarning, match="not draws from the joint distribution") as caught:
        study.propagate(method)
    (text,) = [str(one.message) for one in caught if "not draws" in str(one.message)]
    assert "Spread" in text and "'speed'" in text and 'kind="nodes"' in text


def test_a_stored_result_whose_samples_are_nodes_is_refused():
    axes = labels(["x"], ["a"], [0.0])
    rows = sample_dataset(np.ones((3, 1, 1)), np.ones((3, 1)), axes, kind="draws")
    statistics = statistics_dataset(axes, mean=[[1.0]], std=[[0.0]])
    node = propagator_node("a", statistics, rows, propagator="p", realisations=3, wall_time=0.0)
    validate(node)
    node["samples"].attrs["kind"] = "nodes"
    with pytest.raises(uqmbd.StudyError, match="samples"):
        validate(node)


@dataclass(frozen=True, kw_only=True)
class Stating(uqmbd.extend.Propagator):
    """A method of one realisation that is wrong by 5 m, and states it."""

    name: ClassVar[str] = "stating"
    how: Literal["absolute", "relative", "noise"] = "absolute"
    size: float = 10.0
    remedy: str = "add training nodes"

    def propagate(self, problem):
        mean = problem.realise(problem.inputs.means[None, :]).response[0]
        std, error = 0 * mean + 1.0, 0 * mean + self.size
        if self.how == "noise":
            known = {"std_error_mean": error, "std_error_std": error}
        else:
            known = {"stated_error": StatedError(error, self.how, "leave-one-out error", remedy=self.remedy)}
        statistics = statistics_dataset(problem.labels, mean=mean + 5, std=std, **known)
        return problem.node(self, statistics, realisations=1)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
@pytest.mark.parametrize("how", ["absolute", "relative", "noise"])
def test_words_on_a_stated_error_fit_any_method(tmp_path, how):
    """Nobody tells a method without an order to raise it, or one without samples to draw more."""
    tree = run(MonteCarlo(samples=1024, sampling="sobol", seed=1), Stating(how=how))
    validate(tree)
    write_report(tree, tmp_path / "report.html")
    judgement = assess(tree).judgement("stating", "height")
    words = [judgement.text, tree["comparison"].attrs["recommendation"]]
    for text in words:
        assert not {"order", "surrogate", "samples"} & set(text.replace(",", " ").split()), text
    assert judgement.kind == "under-resolved"
    if how != "noise":
        statistics = tree["stating/statistics"].dataset
        assert statistics["stated_error"].attrs["units"] == "m"
        np.testing.assert_allclose(statistics["stated_error"], 10.0)
        assert statistics["verification_error"].attrs["named"] == "leave-one-out error"


def test_a_warning_of_a_stated_error_names_the_remedy_of_the_method():
    study = uqmbd.Study("throw", stone(), [0, 1], [method := Stating()])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        study.propagate(method)
    said = [str(one.message) for one in caught if issubclass(one.category, uqmbd.SurrogateWarning)]
    assert "stated error exceeds 10%" in said[0]
    assert all(text.endswith("Add training nodes.") for text in said)


@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
@pytest.mark.parametrize("remedy", ["add training nodes", ""])
@pytest.mark.parametrize("size", [0.07, 10.0])
def test_advice_on_a_stated_error_is_that_of_its_method(remedy, size):
    """Alone, or as the reference of methods that are no better, it has no order to raise."""
    alone = assess(run(Stating(remedy=remedy, size=size))).recommendation[0]
    others = (Stating(remedy=remedy, size=2 * size, label="other"), Stating(remedy=remedy, size=size))
    for text in (alone, run(*others)["comparison"].attrs["recommendation"]) if size > 1 else (alone,):
        assert not {"order", "surrogate", "samples"} & set(text.replace(",", " ").split()), text
        assert "use a sampling method" in text or (not remedy and "Use a sampling method" in text)
        assert ("Add training nodes; if that" in text) == bool(remedy)


@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
def test_a_stated_error_that_is_large_enough_covers_the_difference():
    """Of two methods that are wrong by 5 m, one states 0.01 m."""
    tree = run(MonteCarlo(samples=1024, sampling="sobol", seed=1), Stating(size=0.01))
    assert assess(tree).judgement("stating", "height").kind == "differs"
