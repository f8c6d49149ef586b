"""In a kernel of Jupyter: progress is one output that changes in place, and results show charts."""

import pytest

pytestmark = pytest.mark.slow

CELLS = (
    """
import chaospy, uqmbd
from uqmbd_montecarlo import MonteCarlo
mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
stone = mechanism.body("stone", mass=uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg"))
mechanism.output("x", stone.position[0] + uqmbd.t, units="m")
study = uqmbd.Study("fall", mechanism, [0.0, 0.5, 1.0], [MonteCarlo(samples=40, seed=1), MonteCarlo(samples=50, seed=2, label="b")])
""",
    "tree = study.run()",
    "study",
    "uqmbd.report.show(tree)",
    "%load_ext uqmbd.report",
    "tree",
    "study.mechanism.inputs.variables[0]",
)


def test_a_notebook_runs():
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed: a real notebook is not verified")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: a real notebook is not verified")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: a real notebook is not verified")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    _, run, study, shown, _, tree, variable = (cell.outputs for cell in notebook.cells)
    (progress,) = run
    assert "all methods" in progress["data"]["text/html"] and "90" in progress["data"]["text/html"]
    for outputs in (study, shown, tree):
        (one,) = outputs
        assert one["data"]["text/html"].count('<figure class="charted">') == 1
    assert "Reliability of the results" in tree[0]["data"]["text/html"]
    (one,) = variable
    assert "Uniform(lower=1, upper=2)" in one["data"]["text/html"] and "Density of mass" in one["data"]["text/html"]
