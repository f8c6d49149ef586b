"""Realisations for requirements and scalar outputs are part of the cost of a method."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.propagation import runner
from uqmbd.report.view import StudyResult
from uqmbd.results import assess
from uqmbd.results.schema import total_realisations
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

RTOL = 1e-6


def thrown(over_time: bool = True) -> uqmbd.Mechanism:
    """Return a stone with two requirements whose margins bend, which need nodes of their own."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3.0, 0.3), units="m/s")
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1.0, 0.05), units="kg")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    stone = mechanism.body("stone", mass=mass, velocity=speed)
    if over_time:
        mechanism.output("impulse", mass * stone.velocity[0], units="N s")
    mechanism.output("highest", uqmbd.maximum(stone.position[0]), units="m")
    mechanism.require("low", stone.position[0] <= 0.62)
    mechanism.require("slow", mass * stone.velocity[0] ** 2 <= 14)
    return mechanism


@pytest.mark.parametrize("method", [MonteCarlo(samples=300, seed=1), Collocation(order=2), Galerkin(order=2)])
def test_all_computed_realisations_are_counted(method: uqmbd.Propagator, monkeypatch: pytest.MonkeyPatch) -> None:
    compute, counts = runner.compute_chunk, []

    def counted(model, part, times, rtol, *about):
        counts.append(len(part) if rtol == RTOL else 0)
        return compute(model, part, times, rtol, *about)

    monkeypatch.setattr(runner, "compute_chunk", counted)
    study = uqmbd.Study("throw", thrown(), np.linspace(0, 0.5, 11), [method], rtol=RTOL)
    node = study.run()[method.node_name]
    # Galerkin integrates the nodes of outputs over time as one system
    system = 9 if isinstance(method, Galerkin) else 0
    assert total_realisations(node) == sum(counts) + system
    assert ("further_realisations" in node.attrs) == (not isinstance(method, MonteCarlo))


@pytest.mark.parametrize("method, over_time", [(Galerkin(order=2), True), (Collocation(order=3), False)])
def test_the_recommendation_and_the_report_count_them(method: uqmbd.Propagator, over_time: bool) -> None:
    methods = [MonteCarlo(samples=2000, seed=1), method]
    study = uqmbd.Study("throw", thrown(over_time), np.linspace(0, 0.5, 11), methods, rtol=RTOL)
    tree = study.run()
    node = tree[method.node_name]
    assert node.attrs["further_realisations"] > 0
    total = node.attrs["realisations"] + node.attrs["further_realisations"]
    compared = tree["comparison"].to_dataset().sel({"method": method.node_name})
    assert compared["realisations"] == total
    assert compared["wall_time"] == node.attrs["wall_time"]
    assert f"{total} realisations instead of 2000" in assess(tree).recommendation[0]
    assert StudyResult.of(tree).methods[method.node_name].total_realisations == total
    assert total_realisations(node["scalars"]) == total
    assert node["scalars"].attrs["method_wall_time"] == node.attrs["wall_time"]
