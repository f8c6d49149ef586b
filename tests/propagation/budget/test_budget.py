"""Sizes that follow from a budget and an accuracy: against closed forms, with counted realisations and a counted clock."""

from __future__ import annotations

import json
import math
import warnings
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.propagation.budget import Amount, BudgetTerms
from uqmbd.propagation.studies.outcome import run_methods
from uqmbd.results import stated_accuracy
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import LowFidelity, MonteCarlo
from uqmbd_reliability import Reliability

MEAN, STD = 3.0, 0.2


def fall(*methods, of=lambda x: x, distribution=None, require=None):
    """A mass with a random velocity, and a function of where it is after a second."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", distribution or chaospy.Normal(MEAN, STD), units="m/s")
    mass = mechanism.body("mass", mass=1, velocity=(speed, 0))
    mechanism.output("x", of(mass.position[0]), units="m")
    if require is not None:
        mechanism.require("near", mass.position[0] <= require)
    return uqmbd.Study("fall", mechanism, [0.0, 1.0], methods)


def option(node, name):
    return json.loads(node.attrs["options"])[name]


def told(tree):
    return json.loads(tree.attrs["budget"])["methods"]


def rows_of(given):
    """How many realisations a task is about: the rows of its inputs, wherever they are among its arguments."""
    if isinstance(given, np.ndarray) and given.ndim == 2:
        return len(given)
    inner = given.values() if isinstance(given, dict) else given if isinstance(given, (tuple, list)) else ()
    return next(filter(None, map(rows_of, inner)), 0)


class Counting(Executor):
    """Computes at once, and counts realisations; a clock that goes on by what they cost."""

    def __init__(self, each=0.0):
        self.rows, self.each, self.now, self.piece = 0, each, 0.0, 0

    def submit(self, function, /, *arguments, **keywords):
        assert (rows := rows_of(arguments))
        self.rows += rows
        self.piece = max(self.piece, rows)
        cost = self.each(self.rows) if callable(self.each) else self.each
        self.now += cost * rows
        found = Future()
        found.set_result(function(*arguments, **keywords))
        return found

    def clock(self):
        return self.now


def within(study, executor, **terms):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return run_methods(study, study.propagators, executor, terms=BudgetTerms(clock=executor.clock, **terms))


def repeated(outcome):
    """How many realisations the executor integrates again for the error of the integration, outside of any budget."""
    found = 0
    for node in outcome.nodes:
        if "integration_error" in node["statistics"]:
            about = node["statistics"]["integration_error"].attrs
            # of a polynomial motion, some realisations are integrated a third time
            third = about["rtol"] < 1e-12
            found += about["realisations"] + third * max(3, min(100, node.attrs["realisations"] // 20))
    return found


def same(first, second):
    for name in ("statistics", "samples"):
        if name in first.children:
            assert first[name].to_dataset().identical(second[name].to_dataset()), name


@pytest.mark.parametrize("accuracy", [0.2, 0.1])
def test_samples_are_those_of_the_closed_form_and_give_the_same_bits_again(accuracy):
    """1.96 sigma / sqrt(N) is the accuracy times sigma, with a margin of a tenth of the samples."""
    study = fall(MonteCarlo(seed=3))
    found = study.run(accuracy=accuracy)["monte-carlo"]
    needed = (1.96 / accuracy) ** 2
    assert needed <= option(found, "samples") <= 1.11 * needed + 1
    assert stated_accuracy(found).value <= accuracy
    again = study.with_propagators([MonteCarlo(seed=3, samples=option(found, "samples"))]).run()["monte-carlo"]
    same(found, again)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "mean", "std"),
    [
        (lambda x: x, MEAN, STD),
        # a lognormal output of kurtosis 41: few samples see its tail
        (
            lambda x: sympy.exp(4 * (x - MEAN)),
            math.exp(0.32),
            math.exp(0.32) * math.sqrt(math.expm1(0.64)),
        ),
    ],
    ids=["linear", "heavy tail"],
)
def test_the_true_error_is_within_the_accuracy_as_often_as_stated(of, mean, std):
    study, accuracy, seeds = fall(of=of), 0.1, 60
    held = []
    for seed in range(seeds):
        found = study.with_propagators([MonteCarlo(seed=seed)]).run(accuracy=accuracy)["monte-carlo"]["statistics"]
        errors = abs(float(found["mean"][0, 1]) - mean) / std, abs(float(found["std"][0, 1]) - std) / std
        held.append([error <= accuracy for error in errors])
    # each of both by itself; 60 seeds of a share of 95 % have less than 88 % once in a hundred times
    assert np.mean(held, axis=0).min() >= 0.88


@pytest.mark.parametrize("sampling", ["latin-hypercube", "sobol"])
def test_designs_take_numbers_that_they_allow(sampling):
    method = MonteCarlo(samples=512, seed=1, sampling=sampling, replicates=8)
    found = fall(method).run(accuracy=0.05)["monte-carlo"]
    assert stated_accuracy(found).value <= 0.05
    assert option(found, "samples") < (1.96 / 0.05) ** 2  # a smooth function of one input: fewer than random ones
    sizes = {name: option(found, name) for name in ("samples", "replicates")}
    same(found, fall(replace(method, **sizes)).run()["monte-carlo"])


@pytest.mark.parametrize("accuracy", [0.05, 0.002])
def test_a_design_ends_at_the_first_of_steps_of_up_to_four_that_reaches_the_accuracy(accuracy):
    """Its error may fall like 1 / samples: a larger step would pay for an accuracy that nobody requested."""
    found = fall(MonteCarlo(samples=512, seed=1, sampling="sobol")).run(accuracy=accuracy)
    stages = told(found)["monte-carlo"]["stages"]
    sizes = np.array([one["size"] for one in stages])
    assert np.all(sizes[1:] / sizes[:-1] <= 4) and np.all(sizes[1:] / sizes[:-1] >= 1.1)
    assert [one["accuracy"] <= accuracy for one in stages] == [False] * (len(stages) - 1) + [True]


@pytest.mark.parametrize("budget", [100, 700, 3000])
def test_a_budget_of_realisations_is_never_exceeded_and_is_used(budget):
    executor = Counting()
    study = fall(MonteCarlo(seed=1))
    outcome = within(study, executor, budget=Amount(realisations=budget), accuracy=0.001)
    assert 0.8 * budget <= executor.rows - repeated(outcome) <= budget
    (node,) = outcome.nodes
    assert option(node, "samples") >= min(budget - 64, 0.85 * budget)
    (about,) = json.loads(outcome.attrs["budget"])["methods"].values()
    assert about["met"] is False
    assert "but not reached" in about["summary"]
    assert about["spent"] <= budget


@pytest.mark.parametrize("options", ["sobol", "control"])
def test_a_budget_of_realisations_is_used_beyond_keep_and_beside_a_control(options):
    """What is kept bounds no size of Sobol' indices, and realisations of a cheaper study are none of this one."""
    budget = 3000
    if options == "sobol":
        method = MonteCarlo(seed=1, keep=100, sobol_indices=True)
    else:
        method = MonteCarlo(seed=1, control=LowFidelity(fall(of=lambda x: x + 0.1 * sympy.sin(9 * x)), cost=0.1))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*Monte Carlo without control")
        outcome = within(fall(method), Counting(), budget=Amount(realisations=budget), accuracy=1e-6)
    (node,) = outcome.nodes
    assert 0.8 * budget <= node.attrs["realisations"] <= budget


def test_methods_share_a_budget_and_one_that_fails_costs_only_itself():
    @dataclass(frozen=True, kw_only=True)
    class Broken(uqmbd.extend.Propagator):
        name: ClassVar[str] = "broken"
        size: int = 1

        def sizing(self, study, accuracy):
            return uqmbd.extend.Sizing(option="size", at=lambda size: replace(self, size=size), least=10)

        def propagate(self, problem):
            raise uqmbd.IntegrationError("broken: as ever.")

    executor = Counting()
    study = fall(Broken(), Collocation(), Galerkin(), MonteCarlo(seed=1), of=lambda x: 1.0 * x**3)
    outcome = within(study, executor, budget=Amount(realisations=2000), accuracy=0.01)
    assert [node.name for node in outcome.nodes] == ["collocation", "galerkin", "monte-carlo"]
    assert list(outcome.errors) == ["broken"]
    about = json.loads(outcome.attrs["budget"])["methods"]
    assert about["collocation"]["met"]
    assert about["galerkin"]["met"]
    # what the others did not need is the last one's
    assert option(outcome.nodes[-1], "samples") > 1500
    assert sum(one["spent"] for one in about.values()) <= 2000


@pytest.mark.parametrize("each", [0.01, lambda rows: 0.01 if rows < 2000 else 0.02], ids=["steady", "slower"])
def test_a_budget_of_seconds_is_exceeded_by_a_chunk_at_most(each):
    executor = Counting(each)
    outcome = within(fall(MonteCarlo(seed=1)), executor, budget=Amount(seconds=60.0))
    costliest = 0.02 if callable(each) else 0.01
    assert executor.now <= 60.0 + (executor.piece + repeated(outcome)) * costliest
    (node,) = outcome.nodes
    assert option(node, "samples") > 1500
    if not callable(each):
        assert option(node, "samples") > 4000  # of 6000 that there was time for


def test_a_time_that_is_over_within_a_size_leaves_what_is_finished():
    """Realisations become a thousand times as dear: the chunks before that are a size of their own."""
    executor = Counting(lambda rows: 0.01 if rows <= 640 else 10.0)
    study = fall(MonteCarlo(seed=1))
    outcome = within(study, executor, budget=Amount(seconds=30.0))
    (node,) = outcome.nodes
    assert 640 <= option(node, "samples") <= 640 + 64
    (about,) = json.loads(outcome.attrs["budget"])["methods"].values()
    assert about["size"] == option(node, "samples")
    assert executor.now <= 30 + 10 * (executor.piece + repeated(outcome))
    same(node, study.with_propagators([MonteCarlo(seed=1, samples=about["size"])]).run()["monte-carlo"])


@pytest.mark.parametrize("method", [Collocation(), Galerkin()], ids=lambda m: m.name)
def test_the_order_that_is_chosen_holds_against_a_reference(method):
    """The true error against order 14 is within the accuracy, and an order less would state too much."""
    accuracy = 1e-3
    study = fall(method, of=lambda x: sympy.sin(3 * x))
    tree = study.run(accuracy=accuracy)
    found, about = tree[method.name], told(tree)[method.name]
    assert about["met"]
    assert about["size"] == option(found, "order")
    exact = study.with_propagators([Collocation(order=14)]).run()["collocation"]["statistics"]
    scale = float(exact["std"].max())
    for name in ("mean", "std"):
        assert float(abs(found["statistics"][name] - exact[name]).max()) <= accuracy * scale
    same(found, study.with_propagators([replace(method, order=about["size"])]).run()[method.name])


def test_reliability_ends_at_the_accuracy_of_the_probability():
    study = fall(Reliability(seed=1), require=MEAN + 3.5 * STD)
    tree = study.run(accuracy="20%")
    found = tree["reliability"]["requirements"]
    probability = 2.326e-4  # of a normal variable beyond 3.5 deviations
    assert float(found["violation_probability"][0]) == pytest.approx(probability, rel=0.2)
    assert told(tree)["reliability"]["met"]
    with pytest.warns(UserWarning, match="did not reach target_cov=0.0050767"):
        bounded = study.run(budget=600, accuracy="1%", planned=str)
    assert bounded["reliability"].attrs["realisations"] <= 600
    assert told(bounded)["reliability"]["met"] is False


def test_one_that_ends_by_itself_does_not_take_what_the_others_need():
    """In a budget of realisations it needs no pilot; its part is what the others leave it."""
    study = fall(
        Reliability(seed=1), MonteCarlo(seed=1), Collocation(), of=lambda x: 1.0 * x**2, require=MEAN + 3 * STD
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = study.run(budget=4000, accuracy=0.1)
    about = told(tree)
    assert about["collocation"]["met"]
    assert about["monte-carlo"]["met"]
    assert about["reliability"]["met"]
    assert sum(one["spent"] for one in about.values()) <= 4000


def test_a_refinement_is_bounded_and_ends_at_the_accuracy():
    study = fall(Collocation(adaptive="order"), of=lambda x: sympy.sin(3 * x))
    tree = study.run(accuracy=0.01, budget=400)
    assert told(tree)["collocation"]["met"]
    assert option(tree["collocation"], "max_error") < 0.01
    assert tree["collocation"].attrs["realisations"] <= 400


@dataclass(frozen=True, kw_only=True)
class Optimist(uqmbd.extend.Propagator):
    """Ends by a tolerance; its error is `factor` over the root of its realisations, and falls more slowly."""

    name: ClassVar[str] = "optimist"
    factor: float = 3.0
    tolerance: float = 0.01
    most: int = 1000

    def sizing(self, study, accuracy):
        return uqmbd.extend.Sizing(
            option="most", at=lambda most: replace(self, most=most, tolerance=accuracy), least=10, falls="itself",
            bound=1000, tighten=lambda factor: self.sizing(study, factor * accuracy),
        )  # fmt: skip

    def propagate(self, problem):
        count = min(self.most, int(1 / self.tolerance))
        problem.realise(np.full((count, 1), MEAN))
        error = [[self.factor / math.sqrt(count)] * 2]
        known = uqmbd.extend.statistics_dataset(
            problem.labels, mean=[[0.0, MEAN]], std=[[STD, STD]], std_error_mean=error, std_error_std=error
        )
        return problem.node(self, known, realisations=count)


@pytest.mark.parametrize(
    ("factor", "runs", "met"), [(0.02, 1, True), (0.03, 2, True), (0.04, 3, True), (0.3, 3, False)]
)
def test_a_method_that_ends_above_the_accuracy_runs_again_with_smaller_tolerances(factor, runs, met):
    """Its own estimate may be too small; twice at most, and the best result is the one that is kept."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        tree = fall(Optimist(factor=factor)).run(accuracy=0.05)
    about = told(tree)["optimist"]
    assert len(about["stages"]) == runs
    assert about["met"] is met
    costs = [one["cost"] for one in about["stages"]]
    assert costs == sorted(costs)
    assert tree["optimist"].attrs["realisations"] == costs[-1]


def test_a_refinement_of_many_inputs_that_missed_the_accuracy_reaches_it_with_a_smaller_tolerance():
    """A sum of waves of eight inputs: its variance in closed form."""
    mechanism = uqmbd.Mechanism("sum", uqmbd.Line())
    mechanism.body("mass", mass=1)
    inputs = [uqmbd.RandomVariable(f"x{k}", chaospy.Uniform(-1, 1)) for k in range(8)]
    mechanism.output("sum", sum(sympy.sin(2 * x) * (1 + 0.3 * inputs[k - 1]) for k, x in enumerate(inputs)))
    tree = uqmbd.Study("sum", mechanism, [0.0, 1.0], [Collocation(adaptive="dimension")]).run(accuracy=0.003)
    node, one = tree["collocation"], 0.5 * (1 - np.sinc(4 / np.pi))
    assert told(tree)["collocation"]["met"]
    variance = 8 * one * (1 + 0.09 / 3)
    assert abs(node["statistics"]["variance"].values.max() - variance) <= 0.01 * variance


def test_a_method_without_sizes_runs_as_it_is_and_that_is_reported():
    said = []
    tree = fall(Collocation(nodes=5, order=2)).run(accuracy=0.5, planned=said.append)
    assert option(tree["collocation"], "nodes") == [5]
    assert told(tree)["collocation"]["sized"] is False
    assert any("runs with the given options" in sentence for sentence in said)
    with pytest.raises(uqmbd.StudyError, match="needs 21 realisations, more than the remaining budget"):
        fall(Collocation(nodes=5, order=2)).run(budget=20)


def test_an_accuracy_that_is_not_reached_is_a_warning():
    with pytest.warns(uqmbd.StudyWarning, match=r"1 % was requested, but not reached: about samples=\d+ needs"):
        fall(MonteCarlo(seed=1)).run(accuracy=0.01, budget=200)


def test_an_output_of_infinite_variance_ends_with_the_budget():
    """Nothing goes on for ever where the spread grows with the samples."""
    study = fall(MonteCarlo(seed=1), of=lambda x: x, distribution=chaospy.StudentT(2.1, 3, 0.2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        tree = study.run(budget=4000, accuracy=0.02)
    assert told(tree)["monte-carlo"]["met"] is False
    assert told(tree)["monte-carlo"]["spent"] <= 4000


def test_a_run_goes_on_at_the_sizes_that_it_had_chosen(tmp_path):
    class Until(Executor):
        def __init__(self, most):
            self.rows, self.most = 0, most

        def submit(self, function, /, *arguments, **keywords):
            self.rows += rows_of(arguments)
            found = Future()
            if self.rows > self.most:
                found.set_exception(KeyboardInterrupt())
            else:
                found.set_result(function(*arguments, **keywords))
            return found

    study = fall(MonteCarlo(seed=4))
    with pytest.raises(KeyboardInterrupt):
        study.run(Until(700), budget="1h", accuracy=0.05, folder=tmp_path)
    record = json.loads((tmp_path / "unfinished" / "budget.json").read_text())
    chosen = record["methods"]["monte-carlo"][-1]["size"]
    executor = Until(10**6)
    found = study.run(executor, budget="1h", accuracy=0.05, folder=tmp_path, resume=True)["monte-carlo"]
    assert option(found, "samples") == chosen
    assert executor.rows < chosen  # the chunks that were finished are not computed again
    same(found, study.run(budget="1h", accuracy=0.05)["monte-carlo"])


@pytest.mark.parametrize(
    "sizes", ["[{}]", '[{"size": "a"}]', "[3]", '[{"size": 64, "seconds": "x"}]', '[{"size": 64, "seconds": 1}]', "7"]
)
def test_a_record_of_sizes_that_is_damaged_is_none(tmp_path, sizes):
    study = fall(MonteCarlo(seed=4))
    expected = study.run(budget=200)["monte-carlo"]
    (tmp_path / "unfinished").mkdir()
    text = '{"asked": {"realisations": 200}, "methods": {"monte-carlo": SIZES}}'.replace("SIZES", sizes)
    (tmp_path / "unfinished" / "budget.json").write_text(text)
    (tmp_path / "unfinished" / "asked.json").write_text(json.dumps({"study": "0" * 32, "methods": {}}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)  # of another study
        found = study.run(budget=200, folder=tmp_path, resume=True)["monte-carlo"]
    same(found, expected)


@pytest.mark.parametrize("budget", ["3parsec", 0, -5, True, 2.5, "0s", ""])
def test_a_budget_that_is_none_is_refused(budget):
    with pytest.raises(
        uqmbd.StudyError, match="budget is .*; expected a number of realisations such as 5000, or a time"
    ):
        fall(MonteCarlo()).run(budget=budget)


@pytest.mark.parametrize("accuracy", ["a lot", 0, 1, "100%", -0.1, True, math.nan])
def test_an_accuracy_that_is_none_is_refused(accuracy):
    with pytest.raises(uqmbd.StudyError, match="accuracy is .*; expected a share"):
        fall(MonteCarlo()).run(accuracy=accuracy)


@pytest.mark.parametrize("count", [2, 40])
def test_a_refinement_of_many_inputs_begins_with_three_nodes_of_each(count):
    """The first step has 2 I + 1 nodes, not 3^I, with 16 verification points, and is exact for a sum."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    speeds = [uqmbd.RandomVariable(f"v{k}", chaospy.Normal(MEAN, STD), units="m/s") for k in range(count)]
    mass = mechanism.body("mass", mass=1, velocity=(sum(speeds), 0))
    mechanism.output("x", mass.position[0], units="m")
    method = Collocation(adaptive="dimension")
    study = uqmbd.Study("fall", mechanism, [0.0, 1.0], [method])
    least = method.sizing(study, 0.01).least
    assert least == 2 * count + 1 + 16
    node = study.run(accuracy=0.01, budget=least + 2, planned=print)["collocation"]
    assert least - 2 <= node.attrs["realisations"] <= least + 2
    assert node["statistics/std"].values[0, -1] == pytest.approx(STD * math.sqrt(count), rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("accuracy", [0.05, 0.01])
def test_elements_are_split_until_the_accuracy_is_reached(accuracy):
    """The distance from the mean has a kink: mean s sqrt(2 / pi), variance s^2 (1 - 2 / pi); more elements for less."""
    method = Collocation(order=2, elements="adaptive")
    tree = fall(method, of=lambda x: sympy.Abs(x - MEAN)).run(accuracy=accuracy)
    node, spread = tree["collocation"], STD * math.sqrt(1 - 2 / math.pi)
    assert told(tree)["collocation"]["met"] and stated_accuracy(node).value <= accuracy
    assert option(node, "threshold") == accuracy / 1.25
    mean, std = (node[f"statistics/{name}"].values[0, -1] for name in ("mean", "std"))
    assert abs(mean - STD * math.sqrt(2 / math.pi)) <= accuracy * spread
    assert abs(std - spread) <= accuracy * spread


def test_curves_of_error_against_cost_are_left_out_of_a_budget():
    study = fall(MonteCarlo(seed=1))
    study = uqmbd.Study(
        "fall",
        study.mechanism,
        study.times,
        study.propagators,
        convergence={"propagators": [MonteCarlo(seed=2)], "samples": [50, 100], "reference": "monte-carlo"},
    )
    with pytest.warns(UserWarning, match="not part of the budget of 300 realisations"):
        tree = study.run(budget=300)
    assert "not part of the budget" in tree["convergence"].attrs["problem"]
    assert "method" in study.run(accuracy=0.2)["convergence"].dims
