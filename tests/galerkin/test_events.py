"""Events in Galerkin: what only notes a time stops nothing, nodes without an event are left out, remedies work."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin

G = 9.81


class Crossing(uqmbd.Component):
    """Notes when a body falls below a height; nothing happens there."""

    bodies = ("body",)
    height = uqmbd.Parameter("m", "height of the line")

    def terms(self, p):
        yield uqmbd.Event(p.body.position[1] - p.height, label="crossing")


def falling(times, *, motion=True, impact=False, end=None):
    """A thrown ball that crosses a line (or hits a floor) at y = 0; with closed forms of the time and of the height."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
    gravity = uqmbd.RandomVariable("pull", chaospy.Uniform(0.9, 1.1))
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Translational(gravity=(0, -G)))
    ball = mechanism.body("ball", mass=1, position=(0, 1), velocity=(0, speed * gravity))
    if impact:
        line = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
    else:
        line = mechanism.add(Crossing("line", ball, height=0))
    if motion:
        mechanism.output("y", ball.position[1], units="m")
    mechanism.output("when", line.event_time("impact" if impact else "crossing", 1), units="s")
    return uqmbd.Study("thrown", mechanism, times, [])


def landing(speed):
    return (speed + np.sqrt(speed**2 + 2 * G)) / G


def expected():
    """Mean and standard deviation of height at 0.5 s and of the time of crossing, by Gauss rules of sixty nodes."""
    x, w = np.polynomial.legendre.leggauss(60)
    weights = np.outer(w, w).ravel() / 4
    speed = np.outer(2 + x, 1 + 0.1 * x).ravel()
    results = []
    for values in (1 + speed * 0.5 - G * 0.5**2 / 2, landing(speed)):
        mean = weights @ values
        results += [mean, np.sqrt(weights @ (values - mean) ** 2)]
    return results


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["auto", "ida"])
@pytest.mark.parametrize("options", [{}, {"index_set": "tensor"}, {"elements": 2}])
def test_an_event_that_only_notes_a_time_stops_nothing(options, integrator):
    study = falling([0, 0.5, 1.0])
    method = Galerkin(order=4, integrator=integrator, **options)
    assert method.obstacle(study) is None
    node = study.propagate(method)
    height = node["statistics"].to_dataset().sel(output="y", time=0.5)
    when = node["scalars/statistics"].to_dataset().sel(output="when")
    found = [float(x) for x in (height["mean"], height["std"], when["mean"], when["std"])]
    np.testing.assert_allclose(found, expected(), rtol=2e-6)


@pytest.mark.thorough
def test_event_times_need_no_projection_of_the_motion():
    """Impacts too, where no output stands over time: realisations tell when they are."""
    study = falling([0, 0.5, 1.0], motion=False, impact=True)
    method = Galerkin(order=4)
    assert method.obstacle(study) is None
    when = study.propagate(method)["scalars/statistics"].to_dataset().sel(output="when")
    np.testing.assert_allclose([float(when["mean"]), float(when["std"])], expected()[2:], rtol=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("options", [{}, {"index_set": "tensor"}])
def test_an_event_that_does_not_always_happen_is_refused_as_by_collocation(options):
    """Of the highest throws no ball is down again by the last time: a surrogate of the others would go on there."""
    study = falling([0, 0.5, 0.78])
    for method in (Galerkin(order=3, **options), Collocation(order=3, **options)):
        with pytest.warns(
            uqmbd.StudyWarning, match=r"'when' has no statistics: its event does not occur in \d+ of \d+"
        ):
            node = study.propagate(method)
        assert list(json.loads(node["scalars"].attrs["refused"])) == ["when"]
        assert np.isnan(float(node["scalars/statistics"]["mean"].sel(output="when")))
        assert np.isfinite(node["statistics"]["mean"].values).all()


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        ({}, {"index_set": "tensor"}),
        ({"index_set": "hyperbolic"}, {"index_set": "tensor"}),
        ({"index_set": "tensor", "nodes": 6}, {"nodes": None}),
        ({"rule": "sobol", "samples": 50}, {"rule": "gauss", "samples": None, "index_set": "tensor"}),
    ],
)
def test_the_remedy_for_impacts_is_named_and_works(options, remedy):
    study = falling([0, 0.5], impact=True)
    words = Galerkin(order=3, **options).obstacle(study)
    for name, value in remedy.items():
        assert (f"omit {name}" if value is None else f"{name}={value!r}") in words
    assert Galerkin(order=3, **{**options, **remedy}).obstacle(study) is None
