"""Packages that `uqmbd new plugin` wrote are installed, found, pass their tests, and are typed: all kinds at once."""

from __future__ import annotations

import json
import re

import pytest

from uqmbd.new import PLUGIN_KINDS

from .conftest import name_of

pytestmark = pytest.mark.thorough


def test_they_are_found_by_their_entry_points(python):
    run = python("-m", "uqmbd", "plugins", "--json")
    found = {info["distribution"]: info for info in json.loads(run.stdout)}
    for name, kind in PLUGIN_KINDS.items():
        info = found[name_of(name)]
        hooks = {kind.registered.hook, kind.fitted_hook} - {""}
        assert (info["status"], info["errors"], set(info["hooks"])) == ("loaded", [], hooks)
        assert all(len(info[registry]) == 1 for registry in {kind.registry, kind.fitted} - {""})


def test_their_own_tests_pass(python, written):
    """With the settings of one of them, which are those of all: warnings are errors."""
    tests = [str(written / name_of(kind) / "tests") for kind in PLUGIN_KINDS]
    settings = str(written / name_of("component") / "pyproject.toml")
    run = python("-m", "pytest", "-q", "-c", settings, "--rootdir", str(written), *tests)
    assert run.returncode == 0, run.stdout + run.stderr
    assert int(re.search(r"(\d+) passed", run.stdout)[1]) >= 2 * len(PLUGIN_KINDS)


def test_examples_of_their_readmes_run(python, written, tmp_path):
    """One after the other in one interpreter, which takes a tenth of the time."""
    texts = [(written / name_of(kind) / "README.md").read_text(encoding="utf-8") for kind in PLUGIN_KINDS]
    blocks = [block for text in texts for block in re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)]
    assert len(blocks) == len(PLUGIN_KINDS) - 1  # that of a command is typed in a shell
    code = f"for block in {blocks!r}:\n    exec(block, {{}})\n    print('next')"
    run = python("-W", "error::UserWarning", "-c", code, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    said = [text.strip() for text in run.stdout.split("next")[:-1]]
    assert len(said) == len(blocks) and "" not in said and "False" not in said


def test_mypy_finds_nothing_in_them(python, written):
    """By the settings that are written, which are strict."""
    folders = [str(written / name_of(kind) / folder) for kind in PLUGIN_KINDS for folder in ("src", "tests")]
    run = python("-m", "mypy", "--config-file", str(written / name_of("component") / "pyproject.toml"), *folders)
    assert run.returncode == 0, run.stdout + run.stderr
    # three files of each
    assert f"no issues found in {3 * len(PLUGIN_KINDS)} source files" in run.stdout


@pytest.mark.slow
def test_pyright_finds_nothing_in_them(python, written):
    pytest.importorskip("pyright")
    folders = [f"{name_of(kind)}/{folder}" for kind in PLUGIN_KINDS for folder in ("src", "tests")]
    (written / "pyrightconfig.json").write_text(json.dumps({"include": folders}))
    executable = python("-c", "import sys; print(sys.executable)").stdout.strip()
    run = python("-m", "pyright", "--stats", "--pythonpath", executable)
    assert run.returncode == 0, run.stdout + run.stderr
    assert f"Found {3 * len(PLUGIN_KINDS)} source files" in run.stdout


STUDIES = {
    "forces": """
import chaospy
import numpy as np
import uqmbd
from sample_component import SampleComponent
from sample_law import SampleLaw
from sample_propagator import SamplePropagator
from sample_surrogate import SampleSurrogate
from uqmbd.laws import length
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

strength = uqmbd.RandomVariable("strength", chaospy.Uniform(0.05, 0.15))
mechanism = uqmbd.Mechanism("two bodies", uqmbd.Planar(gravity=(0, 0)))
one = mechanism.body("one", mass=1, inertia=0.1, position=(0, 0))
other = mechanism.body("other", mass=1, inertia=0.1, position=(1, 0))
mechanism.add(SampleComponent("pull", one, other, point_i=(0, 0), point_j=(0, 0), strength=strength))
mechanism.add(SampleLaw("law", one, other, law=0.1 / (1 + length)))
mechanism.output("distance", other.position[0] - one.position[0], units="m")
mechanism.require("apart", other.position[0] - one.position[0] >= 0.7)
methods = [
    MonteCarlo(samples=16, seed=1),
    MonteCarlo(samples=64, seed=1, sampling="sample-design", label="design"),
    Collocation(order=2),
    Galerkin(order=2),
    SamplePropagator(),
    SampleSurrogate(nodes=12),
    Reliability(max_realisations=500),
]
study = uqmbd.Study("forces", mechanism, np.linspace(0, 1, 6), methods)
""",
    "contact": """
import chaospy
import numpy as np
import uqmbd
from sample_contact_law.contact_law import loss_factor
from sample_propagator import SamplePropagator
from sample_surrogate import SampleSurrogate
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneContact
from uqmbd_montecarlo import MonteCarlo

height = uqmbd.RandomVariable("height", chaospy.Uniform(0.19, 0.21), units="m")
mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, position=(0, height))
points, damping = ((0, 0), (0, 0), (0, 1)), loss_factor(0.9, 2)
law = "sample-contact-law"
mechanism.add(PlaneContact("floor", mechanism.ground, ball, *points, law=law, stiffness=1e4, damping=damping))
mechanism.output("height", ball.position[1], units="m")
methods = [MonteCarlo(samples=16, seed=1), Collocation(order=2), SamplePropagator(), SampleSurrogate(nodes=12)]
study = uqmbd.Study("contact", mechanism, np.linspace(0, 0.15, 6), methods)
""",
    "integrator": """
import chaospy
import numpy as np
import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

speed = uqmbd.RandomVariable("speed", chaospy.Uniform(2, 4), units="m/s")
mechanism = uqmbd.Mechanism("stone", uqmbd.Translational(gravity=(0, -9.81)))
stone = mechanism.body("stone", mass=1, velocity=(0, speed))
mechanism.output("height", stone.position[1], units="m")
methods = [MonteCarlo(samples=16, seed=1), Collocation(order=2)]
study = uqmbd.Study("integrator", mechanism, np.linspace(0, 1, 6), methods, integrator="sample-integrator")
""",
    "reader": """
from pathlib import Path

import numpy as np
import uqmbd
from sample_reader import SampleReader
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

Path("chain.csv").write_text("name, mass, x, stiffness\\nfirst, 2, 1, 200\\nsecond, 2, 2, 200\\n")
mechanism = SampleReader().read("chain.csv")
mechanism.randomise("*.mass", relative=0.02)
methods = [MonteCarlo(samples=16, seed=1), Collocation(order=2)]
study = uqmbd.Study("reader", mechanism, np.linspace(0, 0.2, 6), methods)
""",
}
"""Study scripts that use what the written packages offer, with every method that can propagate it."""


@pytest.mark.parametrize("name", STUDIES)
def test_they_work_in_a_run_with_all_methods(python, tmp_path, name):
    """The report of `uqmbd run` has the section, and no method, section or warning reports a failure."""
    (tmp_path / "study.py").write_text(STUDIES[name], encoding="utf-8")
    run = python("-W", "error", "-m", "uqmbd", "run", "study.py", "--out", "out", cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Rates of change</h2>" in page
    after = page.partition("<h2>Rates of change</h2>")[2]
    assert "rate of" in after and "left out" not in run.stdout + run.stderr
    listed = python("-m", "uqmbd", "sample-command", "study.py", cwd=tmp_path)
    assert listed.returncode == 0 and listed.stdout.strip(), listed.stderr
