"""Packages of somebody else's are discovered by their entry points alone: installed into a folder, and put on the path."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
import scipy.integrate

from uqmbd import results
from uqmbd.report.charts import unpacked

WRITTEN = {"magnet": "component", "taylor": "propagator", "rates": "section"}
"""What `uqmbd new plugin` writes, by the names that are given to it."""


def python(site, *words, **environment):
    """Run Python with the folder on its path, where nothing else of this test is known."""
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=site.parent,
        env={**os.environ, "PYTHONPATH": path, **environment},
    )


def listed(site, **environment):
    run = python(site, "-m", "uqmbd.cli", "plugins", "--json", **environment)
    assert run.returncode == 0, run.stderr
    return {info["name"]: info for info in json.loads(run.stdout)}


@pytest.mark.thorough
def test_they_are_discovered_by_their_entry_points_alone(site):
    found = listed(site)
    for name in WRITTEN:
        info = found[name]
        assert (info["distribution"], info["version"]) == (name, "0.1.0")
        assert info["status"] == "loaded", info["errors"]
    assert found["magnet"]["components"] == ["Magnet"] and found["taylor"]["propagators"] == ["taylor"]
    assert found["rates"]["hooks"] == ["uqmbd_report_sections"]


@pytest.mark.thorough
def test_one_can_be_switched_off(site):
    assert listed(site, UQMBD_DISABLE_PLUGINS="magnet")["magnet"]["status"] == "disabled"


@pytest.mark.thorough
def test_broken_neighbour_is_a_warning_and_no_obstacle(site, tmp_path):
    """A package that raises on import, installed by hand: a module and its metadata."""
    broken = tmp_path / "broken"
    information = broken / "uqmbd_broken-0.4.dist-info"
    information.mkdir(parents=True)
    (broken / "uqmbd_broken.py").write_text("raise OSError('the driver of the device is missing')\n")
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: uqmbd-broken\nVersion: 0.4\n")
    (information / "entry_points.txt").write_text("[uqmbd]\nbroken = uqmbd_broken\n")
    code = "import uqmbd.plugins as p; print('Magnet' in p.components())"
    run = python(site, "-c", code, PYTHONPATH=os.pathsep.join([str(site), str(broken)]))
    assert run.stdout.strip() == "True"
    assert "PluginWarning: plugin 'broken' of uqmbd-broken 0.4: it cannot be loaded: " in run.stderr
    assert "OSError: the driver of the device is missing" in run.stderr
    assert "Traceback" not in run.stderr


STUDY = """
import chaospy
import numpy as np

import uqmbd
import uqmbd.plugins

Magnet, Taylor = uqmbd.plugins.component("Magnet"), uqmbd.plugins.propagator("taylor")
strength = uqmbd.RandomVariable("strength", chaospy.Uniform(0.9, 1.1), units="N m^2")
mechanism = uqmbd.Mechanism("attraction", uqmbd.Translational())
bodies = [mechanism.body(name, mass=2, position=(x, 0)) for name, x in (("left", -1), ("right", 1))]
magnet = mechanism.add(Magnet("magnet", *bodies, point_i=(0, 0), point_j=(0, 0), strength=strength))
mechanism.output("left", bodies[0].position[0], units="m")
mechanism.output("right", bodies[1].position[0], units="m")
mechanism.output("pull", magnet.reaction_force[0], units="N")
study = uqmbd.Study("attraction", mechanism, np.linspace(0, 1, 5), [Taylor(), Taylor(label="again")])
"""


COMMANDS = """
import sys
import warnings

warnings.simplefilter("error", UserWarning)
import uqmbd.cli.run.run
import uqmbd.plugins

print(uqmbd.plugins.component("Magnet").__module__, "Revolute" in uqmbd.plugins.components())
uqmbd.cli.run.run.write = lambda tree, path, **_: path  # whose figures take their time
for words in (["check", sys.argv[1]], ["run", sys.argv[1], "--out", sys.argv[2]]):
    try:
        uqmbd.cli.main(words)
    except SystemExit as ended:
        assert not ended.code, ended.code
"""


@pytest.mark.thorough
def test_study_runs_with_its_component_and_its_propagator(site, tmp_path):
    """Two masses of 2 kg at a distance of 2 m: the magnet pulls with strength / distance^2, on both alike."""
    (tmp_path / "attraction.py").write_text(STUDY)
    run = python(site, "-c", COMMANDS, str(tmp_path / "attraction.py"), str(tmp_path / "out"))
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("magnet.component True\n")
    assert "Taylor" in run.stdout and "Magnet" in run.stdout
    tree = results.load(tmp_path / "out" / "results.nc")
    assert sorted(tree.children) == ["again", "comparison", "taylor"]
    mean = tree["taylor"]["statistics"]["mean"]
    assert np.array_equal(mean, tree["again"]["statistics"]["mean"])
    left, right, pull = (mean.sel(output=name).values for name in ("left", "right", "pull"))
    assert left == pytest.approx(-right, abs=1e-9) and right[0] == 1 and right[-1] < 0.99
    assert pull == pytest.approx(-1 / (right - left) ** 2, rel=1e-6)
    # energy: what the potential -1 / distance gives is the kinetic energy of both masses
    speed = np.sqrt(1 / (2 * right[-1]) - 1 / 2) / np.sqrt(2)
    later = np.gradient(right, mean["time"].values, edge_order=2)[-1]
    assert later == pytest.approx(-speed, rel=0.05)


GALERKIN = """
import chaospy
import numpy as np

import uqmbd
import uqmbd.plugins

Magnet, Galerkin = uqmbd.plugins.component("Magnet"), uqmbd.plugins.propagator("galerkin")
strength = uqmbd.RandomVariable("strength", chaospy.Uniform(0.9, 1.1), units="N m^2")
mass = uqmbd.RandomVariable("mass", chaospy.Normal(2, 0.05), units="kg")
mechanism = uqmbd.Mechanism("attraction", uqmbd.Translational())
bodies = [mechanism.body(name, mass=mass, position=(x, 0)) for name, x in (("left", -1), ("right", 1))]
magnet = mechanism.add(Magnet("magnet", *bodies, point_i=(0, 0), point_j=(0, 0), strength=strength))
mechanism.output("right", bodies[1].position[0], units="m")
mechanism.output("pull", magnet.reaction_force[0], units="N")
study = uqmbd.Study("attraction", mechanism, np.linspace(0, 1, 5), rtol=1e-8)
for integrator in ("dop853", "ida"):
    found = study.propagate(Galerkin(order=2, integrator=integrator))["statistics"]
    print(*found["mean"].sel(time=1).values, *found["std"].sel(time=1).values)
"""


@pytest.mark.thorough
def test_its_component_runs_through_galerkin_unchanged(site, tmp_path):
    """Its potential is no polynomial, and it knows nothing of chaos: against SciPy over a fine quadrature."""
    (tmp_path / "attraction.py").write_text(GALERKIN)
    run = python(site, "-W", "error::UserWarning", str(tmp_path / "attraction.py"))
    assert run.returncode == 0, run.stderr
    uniform, normal = np.polynomial.legendre.leggauss(6), np.polynomial.hermite_e.hermegauss(6)
    x = []
    for strength in 1 + 0.1 * uniform[0]:
        for mass in 2 + 0.05 * normal[0]:
            # each is pulled with strength / (2 x)^2
            motion = scipy.integrate.solve_ivp(
                lambda t, z, a=strength / mass: [z[1], -a / (4 * z[0] ** 2)], (0, 1), [1, 0], rtol=1e-10, atol=1e-12
            )
            x.append((motion.y[0, -1], -strength / (4 * motion.y[0, -1] ** 2)))
    weights = np.outer(uniform[1] / 2, normal[1] / normal[1].sum()).ravel()
    mean = weights @ x
    std = np.sqrt(weights @ (np.array(x) - mean) ** 2)
    for line in run.stdout.splitlines():
        found = np.array(line.split(), dtype=float)
        assert found[:2] == pytest.approx(mean, rel=1e-4)
        assert found[2:] == pytest.approx(std, rel=1e-3)


REPORT = """
import sys

import numpy as np

from uqmbd.report import installed_sections, write_report
from uqmbd.extend import labels, statistics_dataset
from uqmbd.results import propagator_node, study_tree

times = np.linspace(0, 2, 21)
axes = labels([("fall", "m"), ("<script>", "")], [], times)
mean = np.array([times**2, 0 * times])
nodes = [
    propagator_node(label, statistics_dataset(axes, mean=k * mean, std=0.1 * mean), propagator="p", realisations=1, wall_time=0.0)
    for k, label in enumerate(("still", "falling"))
]
write_report(study_tree(nodes, study="s", mechanism="m"), sys.argv[1], sections=installed_sections())
"""


@pytest.mark.thorough
def test_its_section_has_charts_of_its_own_data(site, tmp_path):
    """The rate of t^2 is 2 t, and that of its standard deviation 0.2 t."""
    run = python(site, "-W", "error::UserWarning", "-c", REPORT, str(tmp_path / "report.html"))
    assert run.returncode == 0, run.stdout + run.stderr
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    section = page.partition("<h2>Rates of change</h2>")[2].partition("<h2>")[0]
    data = [json.loads(text) for text in re.findall(r'<script type="application/json">(.*?)</script>', section)]
    assert [(one["output"], one["units"]) for one in data] == [("rate of fall", "m/s"), ("rate of <script>", "1/s")]
    still, falling = data[0]["methods"]
    assert (still["label"], falling["label"]) == ("still", "falling")
    shared = json.loads(re.search(r'id="shared-arrays">(.*?)</script>', page).group(1))
    stored = [line["values"] for line in falling["lines"]]
    values = [
        unpacked({**one, "base64": shared[one["base64"]] if isinstance(one["base64"], int) else one["base64"]})
        for one in stored
    ]
    inner = slice(1, -1)
    times = np.linspace(0, 2, 21)[inner]
    assert values[0][inner] == pytest.approx(2 * times, rel=1e-4)
    assert values[1][inner] == pytest.approx(-0.2 * times, rel=1e-4)
    assert values[2][inner] == pytest.approx(0.2 * times, rel=1e-4)
    assert "startCharts()" in page and section.count("data:image/svg+xml") == 2


@pytest.mark.thorough
def test_its_component_runs_with_all_methods_that_are_installed(site):
    """Those of others among them, which the tests that are written with it leave out."""
    run = python(site, "-c", "from magnet import Magnet; from uqmbd.testing import check_component as c; c(Magnet)")
    assert run.returncode == 0, run.stdout + run.stderr
