"""The section on cost states how long a method fitted its surrogate."""

from __future__ import annotations

import pytest

from uqmbd.extend import labels, statistics_dataset
from uqmbd.report import write_report
from uqmbd.results import propagator_node, study_tree


@pytest.mark.parametrize(("fitting", "stated"), [(0.5, "500 ms"), (0.001, ""), (0.0, "")])
def test_time_for_fitting_is_stated_where_it_counts(tmp_path, fitting, stated):
    """From a hundredth of the wall time on; the wall time contains it."""
    statistics = statistics_dataset(labels(["x"], [], [0.0, 1.0]), mean=[[0.0, 1.0]], std=[[0.1, 0.2]])
    about = {"propagator": "p", "realisations": 10, "wall_time": 2.0, "attrs": {"wall_time_fitting": fitting}}
    tree = study_tree([propagator_node("mine", statistics, **about)], study="s", mechanism="m")
    page = write_report(tree, tmp_path / "report.html").read_text()
    sentence = f"The wall time of mine contains {stated} for fitting its surrogate."
    assert (sentence in page) == bool(stated)
    assert ("for fitting its surrogate" in page) == bool(stated)
