"""The bodies' own terms, checked as every component is."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.testing.components.bench import Bench
from uqmbd.testing.components.cases import ComponentCase
from uqmbd.testing.components.component import check_broadcasting, check_jacobian

# Ones and zeros are written into the equations, other numbers are parameters: each pattern is another expression.
BODIES = {
    "spatial": (uqmbd.Spatial, {"mass": 1.3, "inertia": (2, 1.5, 3, 0.1, 0.2, 0.3), "com": (0.1, 0.2, 0.3)}),
    "spatial, ones": (uqmbd.Spatial, {"mass": 1, "inertia": (2, 1.5, 1, 0.1, 0.2, 0.3), "com": (0.1, 0.2, 1)}),
    "spatial, centred": (uqmbd.Spatial, {"mass": 1, "inertia": (1, 1, 1)}),
    "spatial, diagonal": (uqmbd.Spatial, {"mass": 1.3, "inertia": (1, 2, 3), "com": (0, 0, 0.5)}),
    "planar": (uqmbd.Planar, {"mass": 1.3, "inertia": 0.7, "com": (0.1, 0.2)}),
    "planar, ones": (uqmbd.Planar, {"mass": 1, "inertia": 1, "com": (1, 0)}),
    "translational": (uqmbd.Translational, {"mass": 1.3, "com": (0.1, 0.2)}),
}


@pytest.mark.parametrize(("space", "given"), BODIES.values(), ids=BODIES)
def test_body(space, given):
    mechanism = uqmbd.Mechanism("trial", space(gravity=(1.0, -2.0, 0.5)[: space.dimension]))
    body = mechanism.body("body", **given)
    rng = np.random.default_rng(5)
    bench = Bench.of("body", ComponentCase("alone", mechanism, body.terms, free=True), rng)
    check_jacobian(bench, rng)
    check_broadcasting(bench, rng)
