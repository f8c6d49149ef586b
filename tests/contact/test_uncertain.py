"""Event times and heights with distributions, by sampling and by expansion; what Galerkin says."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import Status
from uqmbd.testing import check_component
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact, SphereImpact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

G = 9.81


def bouncing(times, *propagators):
    h = uqmbd.RandomVariable("h", chaospy.Uniform(0.9, 1.1), units="m")
    e = uqmbd.RandomVariable("e", chaospy.Uniform(0.75, 0.85))
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    ball = mechanism.body("ball", mass=1, position=(0, h))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=e))
    mechanism.output("height", ball.position[1], units="m")
    mechanism.output("second", floor.event_time("impact", 2), units="s")
    return uqmbd.Study("bouncing", mechanism, times, propagators)


def second(h, e):
    return np.sqrt(2 * h / G) * (1 + 2 * e)


def moments():
    """Mean and standard deviation of the second impact, by Gauss rules of sixty nodes."""
    x, w = np.polynomial.legendre.leggauss(60)
    t = second(1 + 0.1 * x[:, None], 0.8 + 0.05 * x[None])
    weights = np.outer(w, w) / 4
    mean = (weights * t).sum()
    return mean, np.sqrt((weights * (t - mean) ** 2).sum())


@pytest.mark.thorough
def test_second_impact():
    study = bouncing([0, 0.7, 1.4], MonteCarlo(samples=60, seed=1), Collocation(order=5))
    results = study.run()
    mean, std = moments()
    chaos = results["collocation/scalars/statistics"].to_dataset().isel(output=0)
    np.testing.assert_allclose([chaos["mean"], chaos["std"]], [mean, std], rtol=1e-9)
    sampled = results["monte-carlo/scalars/statistics"].to_dataset().isel(output=0)
    assert abs(float(sampled["mean"]) - mean) < 4 * std / np.sqrt(60)
    assert abs(float(sampled["std"]) - std) < 4 * std / np.sqrt(120)
    samples = results["monte-carlo/scalars/samples"].to_dataset()
    h, e = (samples["inputs"].sel(input=name).values for name in ("h", "e"))
    np.testing.assert_allclose(samples["response"].isel(output=0), second(h, e), rtol=1e-11)


@pytest.mark.thorough
def test_samples_without_an_event_are_counted():
    """Some realisations have no second impact by the last time: they have not failed, and are counted."""
    study = bouncing([0, 0.7, 1.2], MonteCarlo(samples=20, seed=2))
    node = study.propagate(study.propagators[0])
    assert node.attrs["failures"] == node["scalars"].attrs["failures"] == 0
    status = node["scalars/samples"]["status"].values
    assert "'floor: impact 2' does not occur" in str(node["scalars/samples"]["message"].values)
    h, e = (node["scalars/samples"]["inputs"].sel(input=name).values for name in ("h", "e"))
    happens = second(h, e) < 1.2
    assert ((status == Status.OK) == happens).all() and 0 < happens.sum() < 20
    assert (status[~happens] == Status.CENSORED).all()
    statistics = node["scalars/statistics"].to_dataset().isel(output=0)
    assert float(statistics["censored"]) == np.mean(~happens)
    assert float(statistics["mean"]) == pytest.approx(second(h, e)[happens].mean(), rel=1e-9)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of the height, which jumps
def test_an_event_that_does_not_happen_costs_its_own_output_alone():
    """The first impact always happens: a surrogate gives it, exactly, and refuses the second."""
    study = bouncing([0, 0.7, 1.2], Collocation(order=4))
    floor = next(iter(study.mechanism.components.values()))
    study.mechanism.output("first", floor.event_time("impact", 1), units="s")
    study.mechanism.require("not soon", floor.event_time("impact", 2) >= 1.1)
    study = uqmbd.Study("bouncing", study.mechanism, study.times, study.propagators)
    with pytest.warns(
        uqmbd.StudyWarning, match=r"has no statistics: its event does not occur in \d+ of 41 realisations"
    ):
        node = study.propagate(study.propagators[0])
    assert len(json.loads(node["scalars"].attrs["refused"])) == 1
    first = node["scalars/statistics"].to_dataset().sel(output="first")
    x, w = np.polynomial.legendre.leggauss(60)
    times = np.sqrt(2 * (1 + 0.1 * x) / G)
    assert float(first["mean"]) == pytest.approx(float(w @ times) / 2, rel=1e-9)
    assert node["scalars"].attrs["failures"] == node["requirements"].attrs.get("margin_failures", 0) == 0


@pytest.mark.thorough
def test_galerkin_with_as_many_terms_as_nodes_follows_impacts():
    """The projected laws of impact hold at each node then: velocities at a time between impacts in closed form."""
    times = np.array([0, 0.8, 1.5])  # the second is between the first impact and the second
    study = bouncing(times)
    node = study.propagate(Galerkin(order=4, index_set="tensor", verify=0))
    chaos = uqmbd.results.PolynomialChaos.from_dataset(node["chaos"])
    h, e = np.meshgrid(np.linspace(0.92, 1.08, 5), np.linspace(0.76, 0.84, 5))
    known = {"h": h.ravel(), "e": e.ravel()}
    found = chaos.evaluate(np.stack([known[name] for name in chaos.germ_names], axis=1))[:, 0, 1]
    since = times[1] - np.sqrt(2 * known["h"] / 9.81)
    expected = known["e"] * np.sqrt(2 * 9.81 * known["h"]) * since - 9.81 * since**2 / 2
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_galerkin_says_that_impacts_are_not_for_fewer_terms():
    study = bouncing([0, 0.5])
    found = Galerkin().obstacle(study)
    assert found.startswith("velocities or forces jump at the events of 'floor'") and "elements='adaptive'" in found
    with pytest.raises(uqmbd.StudyError, match="galerkin: velocities or forces jump at the events of 'floor'"):
        study.propagate(Galerkin())
    assert Collocation().obstacle(study) is None and MonteCarlo(samples=2, seed=1).obstacle(study) is None


class Slow(PlaneImpact):
    """An impact with half the speed."""

    def terms(self, p):
        for event in super().terms(p):
            yield uqmbd.Event(
                event.guard, uqmbd.extend.Impact(event.jump.speed / 2, p.restitution, event.jump.sliding, p.friction)
            )


class Anchored(SphereImpact):
    """An impact that acts on one of its bodies alone."""

    def terms(self, p):
        for _ in super().terms(p):
            speed = p.body_j.velocity[0]
            yield uqmbd.Event(
                p.body_j.position[0], uqmbd.extend.Impact(speed, p.restitution, speed, p.friction * p.radius_i)
            )


@pytest.mark.parametrize(
    ("component", "told"),
    [(Slow, "is .*; central differences of its gap give"), (Anchored, "the impulses of its events do not")],
)
def test_the_kit_finds_faults_of_events(component, told):
    with pytest.raises(AssertionError, match=told):
        check_component(component, spaces=(uqmbd.Planar,), propagators=())
