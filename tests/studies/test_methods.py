"""The comparison of methods: true statistics by closed forms, regret by brute force, and rows of one mechanism."""

from __future__ import annotations

import importlib
import itertools
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st


def module(name):
    """Import a module of the comparison when a test needs it: it imports all studies."""
    return importlib.import_module(f"studies.methods.{name}")


@pytest.mark.thorough
def test_indices_of_a_sum_are_the_shares_of_its_variance():
    """y = sum of a_i x_i with uniform x_i: first and total index are a_i^2 over the sum of a_i^2."""
    truths = module("truths")
    a = np.array([3.0, 1.0, 0.0])
    points = truths.scrambled(6, 12, 0)
    one, two = points[:, :3], points[:, 3:]
    for i in range(3):
        mixed = one.copy()
        mixed[:, i] = two[:, i]
        y, z, m = ((x @ a)[:, None, None] for x in (one, two, mixed))
        assert np.allclose(truths.index_estimates(y, z, m), a[i] ** 2 / (a**2).sum(), atol=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["oscillator", "censored passage", "two natural frequencies"])
def test_true_statistics_are_those_of_a_quadrature_within_their_errors(name, monkeypatch, tmp_path):
    """Gauss rules of chaospy, of the same closed form: another quadrature."""
    truths = module("truths")
    monkeypatch.setattr(truths, "FOLDER", tmp_path)
    monkeypatch.setattr(truths, "CLOSED", 13)
    monkeypatch.setattr(truths, "PAIRS", 8)
    found = truths.load_truth(name)
    reference = truths.Reference(truths.CASES[name])
    assert found.route < 1e-6
    if name == "censored passage":  # its outputs end where the level is not reached: no polynomial is exact
        assert np.isfinite(found.values["mean"][found.outputs.index("peak")]).all()
    else:
        import chaospy

        joint = chaospy.J(*(one.distribution for one in reference.inputs.variables))
        nodes, weights = chaospy.generate_quadrature(60, joint, rule="gaussian")
        y = np.stack(list(reference.responses(nodes.T, reference.coarse).values()), axis=1)
        mean = np.tensordot(weights, y, 1)
        std = np.sqrt(np.tensordot(weights, (y - mean) ** 2, 1))
        for value, statistic in ((mean, "mean"), (std, "std")):
            off = np.abs(value - found.values[statistic])
            assert (off <= 6 * found.errors[statistic] + 1e-6 * found.scale).all()
    again = truths.load_truth(name)
    assert all(np.allclose(again.values[key], found.values[key], rtol=1e-9, equal_nan=True) for key in found.values)
    assert again.levels == found.levels


def rows():
    """Return a strategy of rows of two mechanisms, three methods and two sizes."""
    one = st.builds(
        module("runs").Row,
        mechanism=st.sampled_from(["a", "b"]),
        kind=st.just("smooth"),
        method=st.sampled_from(["one", "two", "three"]),
        size=st.sampled_from(["1", "2"]),
        seed=st.integers(0, 2),
        question=st.sampled_from(["mean", "std"]),
        error=st.floats(1e-5, 1.0),
        truth_error=st.sampled_from([1e-6, 0.01]),
        stated=st.just(0.1),
        realisations=st.integers(1, 1000),
        seconds=st.floats(0.1, 1.0),
    )
    return st.lists(one, max_size=40)


@pytest.mark.thorough
@given(st.deferred(rows), st.sampled_from([0.1, 0.01, 0.001]), st.integers(1, 1000))
def test_the_regret_is_that_of_all_sizes_that_reach_the_accuracy(rows, accuracy, cost):
    """Against a search over all sizes: a size counts where its errors of both moments hold at every seed."""
    about = "a", "smooth", accuracy, "now", "one", 0.01, 0.01, cost, cost
    advised = module("recommendations").Recommendation(*about, 0, 1.0)
    costs = []
    for method in ("one", "two", "three"):
        least = {}
        for question in ("mean", "std"):
            for size in ("1", "2"):
                own = [r for r in rows if (r.mechanism, r.method, r.size, r.question) == ("a", method, size, question)]
                if own and all(r.error <= accuracy and r.truth_error <= accuracy / 3 for r in own):
                    mean = round(float(np.mean([r.realisations for r in own])))
                    least[question] = min(least.get(question, mean), mean)
        if len(least) == 2:
            costs.append(max(least.values()))
    (found,) = module("regret").regrets(rows, [advised])
    if costs:
        assert found.regret == pytest.approx(cost / min(costs))
    else:
        assert np.isnan(found.regret)
    # a method of the run that reaches the accuracy counts as well
    (other,) = module("regret").regrets(rows, [module("recommendations").Recommendation(*about, 5, 1.0)])
    assert other.regret == pytest.approx(cost / min([5, *costs]))


@pytest.mark.thorough
def test_new_recommendations_replace_those_of_the_stored_table(tmp_path):
    """Their regrets refer to the stored best method, of 20 realisations, or to a better one of a run, of 10."""
    tables, path = module("tables"), tmp_path / "methods.csv"
    head = "mechanism,kind,accuracy,rules,best,best_realisations,recommended,reached,realisations,stated,error,regret"
    first = 'a,smooth,0.1,now,"Galerkin, order=2",20,collocation,yes,100,0.05,0.01,5'
    path.write_text(f"{head}\n{first}\nb,smooth,0.1,now,a method of the run,,collocation,yes,40,0.05,0.01,2\n")

    def regrets(least):
        made = [
            module("recommendations").Recommendation(name, "smooth", 0.1, "now", "grid", 0.01, 0.05, 50, 50, least, 1.0)
            for name in "ab"
        ]
        return [(one["recommended"], one["best"], float(one["regret"])) for one in tables.revised_table(made, path)]

    assert regrets(0) == [("grid", "Galerkin, order=2", 2.5), ("grid", "a method of the run", 2.5)]
    assert regrets(10) == [("grid", "a method of the run", 5.0)] * 2


@pytest.mark.thorough
@given(st.deferred(rows))
def test_the_stored_table_has_the_least_costs_and_draws_the_diagram(rows):
    """Each number of the table against a search; the drawing is well-formed, for any rows."""
    tables, diagram = module("tables"), module("diagram")
    if not rows:
        return
    data = tables.cost_table(rows)
    for mechanism, question, accuracy, method in itertools.product("ab", ["mean", "std"], [0.1, 0.01, 0.001], ["one"]):
        own = [r for r in rows if (r.mechanism, r.question, r.method) == (mechanism, question, method)]
        sizes = {r.size: [x for x in own if x.size == r.size] for r in own}
        costs = [
            round(float(np.mean([r.realisations for r in some])))
            for some in sizes.values()
            if all(r.error <= accuracy and r.truth_error <= accuracy / 3 for r in some)
        ]
        if not own:
            continue
        where = {"mechanism": mechanism, "question": question, "accuracy": accuracy, "method": method}
        found = float(data["realisations"].sel(where))
        assert found == min(costs) if costs else np.isnan(found)
    if {"mean", "std"} <= set(data["question"].values):
        ElementTree.fromstring(diagram.diagram(data))
