"""Ten inputs at order 3: memory and realisations stay in bounds."""

from __future__ import annotations

import tracemalloc

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_springs import SpringDamper


@pytest.fixture(scope="module")
def row():
    """Five masses one below the other, on five springs: ten random inputs."""
    mechanism = uqmbd.Mechanism("row of masses", uqmbd.Translational(gravity=(0, -9.81)))
    above = mechanism.ground
    for k in range(5):
        stiffness = uqmbd.RandomVariable(f"k{k}", chaospy.Uniform(80, 120), units="N/m")
        mass = uqmbd.RandomVariable(f"m{k}", chaospy.Normal(1, 0.02), units="kg")
        body = mechanism.body(f"body{k}", mass=mass, position=(0, -k - 1))
        spring = SpringDamper(f"spring{k}", above, body, (0, 0), (0, 0), stiffness, damping=2, free_length=1)
        mechanism.add(spring)
        above = body
    mechanism.output("lowest", above.position[1], units="m")
    study = uqmbd.Study("row", mechanism, np.linspace(0, 1, 21))
    study.model  # noqa: B018 - compiled before memory is measured
    return study


WAYS = {  # options, most nodes
    "smolyak": ({"rule": "smolyak"}, 1581),
    "regression": ({"method": "regression"}, 572),
    "omp": ({"method": "omp"}, 286),
    "dimension": ({"adaptive": "dimension"}, 400),
}


@pytest.fixture(scope="module")
def reference(row):
    """Statistics at order 3 on 572 samples."""
    return row.propagate(Collocation(order=3, method="regression", seed=5))["statistics"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "way",
    [
        "omp",
        pytest.param("smolyak", marks=pytest.mark.thorough),
        *(pytest.param(way, marks=pytest.mark.slow) for way in ("regression", "dimension")),
    ],
)
def test_memory_realisations_and_results(row, reference, way):
    """Deviations to a thousandth of the largest, total indices after 0.25 s to some thousandths, whichever way."""
    options, most = WAYS[way]
    tracemalloc.start()
    try:
        node = row.propagate(Collocation(order=3, **options))
        memory = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert memory < 200e6
    assert node.attrs["nodes"] <= most
    assert node.attrs["terms"] <= 400
    statistics = node["statistics"]
    assert statistics.sizes["input"] == 10
    assert float(statistics["verification_error"].max()) < 0.01
    np.testing.assert_allclose(statistics["std"], reference["std"], atol=1e-3 * float(reference["std"].max()))
    late = {"time": slice(0.25, None)}
    np.testing.assert_allclose(statistics["sobol_total"].sel(late), reference["sobol_total"].sel(late), atol=5e-3)
