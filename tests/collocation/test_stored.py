"""A stored collocation is complete: it is read, evaluated and sampled where there is no mechanism."""

from __future__ import annotations

import json
import subprocess
import sys

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.results import load, save, validate
from uqmbd_collocation import Collocation

READER = """
import json, sys
import numpy as np
from uqmbd.results import PolynomialChaos, load, validate

tree = load(sys.argv[1])
validate(tree)
chaos = PolynomialChaos.from_dataset(tree["collocation/chaos"])
points = np.array(json.loads(sys.argv[2]))
inputs, values = chaos.sample(2000, seed=1)
loaded = [name for name in sys.modules if name.split(".")[0] in ("chaospy", "symengine", "sksundae")]
loaded += [name for name in sys.modules if name.startswith(("uqmbd.mechanism", "uqmbd.dynamics", "uqmbd_"))]
print(json.dumps({
    "values": chaos.evaluate(points).tolist(),
    "mean": chaos.mean.tolist(),
    "sobol_total": chaos.sobol_total.tolist(),
    "sampled_mean": values.mean(axis=0).tolist(),
    "verdicts": chaos.verdicts(),
    "loaded": loaded,
}))
"""


def read_elsewhere(path, points):
    """Read in a process of its own."""
    words = [sys.executable, "-c", READER, str(path), json.dumps(points)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.thorough
@pytest.mark.parametrize("options", [{"adaptive": "dimension", "tolerance": 1e-8}, {}])
def test_a_stored_chaos_needs_no_mechanism(resting, chaos_of, tmp_path, options):
    def function(a, b):
        return sympy.exp(a) * (2 + b)

    distributions = chaospy.Uniform(-1, 1), chaospy.LogNormal(0, 0.25)
    study = resting(function, *distributions, second=lambda a, b: a + b)
    tree = study.with_propagators([Collocation(order=8, **options)]).run()
    validate(tree)
    path = save(tree, tmp_path / "results.nc")
    points = [[-0.5, 0.8], [0.9, 1.3]]
    found = read_elsewhere(path, points)
    assert found["loaded"] == []
    chaos = chaos_of(tree["collocation"])
    np.testing.assert_array_equal(found["values"], chaos.evaluate(points))
    exact = [[np.exp(a) * (2 + b), a + b] for a, b in points]
    np.testing.assert_allclose(np.array(found["values"])[..., 0], exact, rtol=1e-5)
    np.testing.assert_array_equal(found["sobol_total"], chaos.sobol_total)
    np.testing.assert_allclose(found["sampled_mean"], found["mean"], atol=4 * chaos.std.max() / np.sqrt(2000))
    assert found["verdicts"] == list(chaos.verdicts())


@pytest.mark.thorough
def test_children_survive(resting, tmp_path):
    study = resting(lambda a, b: a * b, chaospy.Normal(1, 1), chaospy.Normal(0, 1))
    tree = study.with_propagators([Collocation(adaptive="order", order=1)]).run()
    again = load(save(tree, tmp_path / "results.nc"))
    validate(again)
    node = again["collocation"]
    assert set(node.children) == {"statistics", "chaos", "nodes", "refinement"}
    assert node.attrs["tolerance_met"] == "True"
    assert node["nodes"]["purpose"].values.tolist() == tree["collocation/nodes"]["purpose"].values.tolist()
    for name in ("nodes", "refinement", "chaos", "statistics"):
        kept, stored = tree[f"collocation/{name}"].to_dataset(), node[name].to_dataset()
        for variable in kept.data_vars:
            np.testing.assert_array_equal(stored[variable], kept[variable], err_msg=f"{name}/{variable}")


@pytest.mark.thorough
def test_dependent_inputs(tmp_path, chaos_of):
    """The germ space of a normal vector is stored with it."""
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1, 2], [[1, 0.6], [0.6, 2]]), ["m", "kg"])
    mechanism = uqmbd.Mechanism("body at rest", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    mechanism.output("y", a * b + 0 * body.position[0])
    tree = uqmbd.Study("s", mechanism, [0, 1], [Collocation(order=2)]).run()
    validate(tree)
    node = load(save(tree, tmp_path / "results.nc"))["collocation"]
    validate(node)
    np.testing.assert_allclose(chaos_of(node).evaluate([[3.0, -1.0], [0.5, 2.0]])[:, 0, 0], [-3, 1], rtol=1e-12)
    assert "sobol_first" not in node["statistics"]
    assert node["statistics"]["sobol_first_germ"]["germ"].values.tolist() == ["a", "b | a"]
