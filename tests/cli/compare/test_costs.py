"""Errors against costs of several results: against closed forms and a search over all methods, and as tables."""

import chaospy
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import extend, results
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

MEAN, STD = 3.0, 0.2


def stone(methods):
    """Return the result of a stone with a normal speed: its position at 2 s is twice the speed."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(MEAN, STD), units="m/s")
    body = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("position", body.position[0], units="m")
    return uqmbd.Study("throw", mechanism, [0, 1, 2], methods).run()


@pytest.mark.thorough
def test_errors_are_those_of_the_closed_form_and_the_table_contains_them(command_line, tmp_path):
    """The mean is 3 t and the standard deviation 0.2 t; collocation is exact for a linear response."""
    trees = {"small": stone([MonteCarlo(samples=50, seed=1)]), "large": stone([MonteCarlo(samples=800, seed=2)])}
    trees["exact"] = stone([Collocation(order=1)])
    for name, tree in trees.items():
        (tmp_path / name).mkdir()
        results.save(tree, tmp_path / name / "results.nc")
    given = "compare", "small", "large", "exact", "--reference", "collocation", "--table"
    status, out, err = command_line(*given, "costs.csv")
    assert status == 0, err
    assert "Errors and costs compared with C collocation" in out
    frame = pd.read_csv(tmp_path / "costs.csv").set_index("method")
    assert list(frame.index) == ["A monte-carlo", "B monte-carlo"]  # the fewest realisations first
    for letter, name in (("A", "small"), ("B", "large")):
        statistics = trees[name]["monte-carlo/statistics"].to_dataset().sel(output="position")
        row = frame.loc[f"{letter} monte-carlo"]
        t = statistics["time"].values
        assert row["mean_error"] == pytest.approx(abs(statistics["mean"].values - MEAN * t).max() / (2 * STD), rel=1e-3)
        assert row["std_error"] == pytest.approx(abs(statistics["std"].values - STD * t).max() / (2 * STD), rel=1e-3)
    assert frame["realisations"].tolist() == [50, 800]
    for name in ("regret_0.1", "regret_0.01", "regret_0.001"):
        reached = frame[["mean_error", "std_error"]].max(axis=1) <= float(name.removeprefix("regret_"))
        expected = frame["realisations"].where(reached) / frame["realisations"].where(reached).min()
        assert np.array_equal(frame[name], expected, equal_nan=True)
    status, _, err = command_line(*given, "costs.tex")
    assert status == 0, err
    lines = (tmp_path / "costs.tex").read_text().splitlines()
    rows = [line for line in lines if "&" in line]
    assert len(rows) == 3 and all(row.count("&") == 8 and row.endswith(r"\\") for row in rows)
    assert rows[0].endswith(r"regret at 10\,\% & regret at 1\,\% & regret at 0.1\,\% \\")
    assert [r"\toprule" in line for line in lines].count(True) == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--table", "costs.csv"), "also give --reference"),
        (("--reference", "a", "--table", "costs.xls"), ".csv or .tex"),
    ],
)
def test_a_table_needs_a_reference_and_a_format(options, words, command_line, tmp_path):
    results.save(stone([MonteCarlo(samples=20, seed=1), Collocation(order=1)]), tmp_path / "results.nc")
    status, _, err = command_line("compare", "results.nc", *options)
    assert status == 2 and words in err.replace("\n", " ")


ERRORS = st.lists(st.tuples(st.floats(1e-4, 0.5), st.floats(1e-4, 0.5), st.integers(1, 10**6)), min_size=1, max_size=5)


@settings(max_examples=30, deadline=None)
@given(ERRORS, st.sampled_from([0.3, 0.1, 0.01]), st.floats(1e-4, 0.02))
def test_the_regret_is_that_of_a_search(methods, accuracy, own):
    """Against a search over all methods; an accuracy that the reference itself misses has no regret."""
    axes = extend.labels(["x"], [], [0.0, 1.0])

    def node(label, mean, std, cost):
        stated = {f"std_error_{name}": [[own, own]] for name in ("mean", "std")}
        statistics = extend.statistics_dataset(axes, mean=[[mean, mean]], std=[[std, std]], **stated)
        return results.propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=1.0)

    nodes = {f"m{k}": node(f"m{k}", mean, 1 + std, cost) for k, (mean, std, cost) in enumerate(methods)}
    found = uqmbd.extend.error_against_cost({**nodes, "all": node("all", 0.0, 1.0, 10**7)}, "all", [accuracy])
    assert found.attrs["reference_accuracy"] == pytest.approx(1.96 * own)
    costs = [cost for mean, std, cost in methods if max(mean, 1 + std - 1) <= accuracy]
    for (mean, std, cost), regret in zip(methods, found["regret"].values[:, 0], strict=True):
        if max(mean, 1 + std - 1) <= accuracy and 1.96 * own <= accuracy:
            assert regret == pytest.approx(cost / min(costs))
        else:
            assert np.isnan(regret)
