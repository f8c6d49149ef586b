"""Propagators of another package in the comparison of methods: errors against stored truths, costs, and regret."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent / "uqmbd-gaussian-process-plugin"
ROOT = Path(__file__).resolve().parents[2]

SCRIPT = """
import json
import sys

sys.path.insert(0, sys.argv[1])
from studies.methods.cases import CASES, Reference
from studies.methods.regret import costs_of, moments
from studies.methods.runs import rows_of

from uqmbd.extend import error_against_cost
from uqmbd_gaussian_process import GaussianProcess, UnscentedTransform
from uqmbd_montecarlo import MonteCarlo

name = "strong damper"
rows = [row for only in ("gaussian-process", "unscented") for row in rows_of(name, only)]
methods = [MonteCarlo(samples=4096, sampling="sobol", seed=1), GaussianProcess(), UnscentedTransform()]
study = Reference(CASES[name]).study().with_propagators(methods)
tree = study.run()
found = error_against_cost({one.node_name: tree[one.node_name] for one in methods}, "monte-carlo", (0.1,))
print(json.dumps({
    "rows": [(row.method, row.question, row.error, row.realisations, row.failure) for row in rows],
    "best": {method: one.realisations for method, one in moments(costs_of(rows), name, 0.1).items()},
    "regret": dict(zip(map(str, found["method"].values), found["regret"].values[:, 0].tolist())),
}))
"""


@pytest.mark.thorough
def test_propagators_of_another_package_are_compared_by_the_same_rows(python, tmp_path):
    """Their costs are 40 nodes with 16 verification points, and 2 I + 1 = 5 points; both reach 10 %."""
    script = tmp_path / "compare.py"
    script.write_text(SCRIPT)
    found = json.loads(python(str(script), str(ROOT)).splitlines()[-1])
    moments = [row for row in found["rows"] if row[1] in ("mean", "std")]
    assert {row[0] for row in moments} == {"gaussian-process", "unscented"} and not any(row[4] for row in found["rows"])
    assert all(0 < row[2] < 0.1 for row in moments)
    assert found["best"] == {"gaussian-process": 56, "unscented": 5}
    assert found["regret"] == {"gaussian-process": 56 / 5, "unscented": 1.0}
