"""Events and equal phases as landmarks of one sequence: what depends on both is followed where neither alone does."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import uqmbd
from uqmbd.results import load, save, study_tree, surrogate, validate
from uqmbd_collocation import Collocation
from uqmbd_collocation.alignment import merged
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_joints import PointOnLine, Prismatic, Revolute
from uqmbd_springs import SpringDamper

G = 9.81
ECCENTRICITY, START, RESTITUTION = 0.005, 0.3, 0.9
QUARTER = np.pi / 2


def eccentric(times):
    """A ball that bounces on a plate, which a wheel with a random speed moves up and down."""
    height = uqmbd.RandomVariable("h0", chaospy.Uniform(0.95, 1.05), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(29, 31), units="rad/s")
    mechanism = uqmbd.Mechanism("eccentric", uqmbd.Planar(gravity=(0, -G)))
    ground = mechanism.ground
    wheel = mechanism.body("wheel", mass=1, inertia=0.1, position=(0, 0), angle=START)
    mechanism.add(Revolute("axle", ground, wheel, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(RotationDriver("drive", ground, wheel, START + speed * uqmbd.t))
    plate = mechanism.body("plate", mass=1, inertia=0.1, position=(0, ECCENTRICITY * np.sin(START)))
    mechanism.add(Prismatic("guide", ground, plate, (0, 0), (0, 0), (0, 1), (0, 1)))
    mechanism.add(PointOnLine("slot", plate, wheel, (0, 0), (ECCENTRICITY, 0), (1, 0)))
    ball = mechanism.body("ball", mass=1, inertia=0.1, position=(0, height), velocity=(0, 0))
    mechanism.add(PlaneImpact("contact", plate, ball, (0, 0), (0, 0), (0, 1), restitution=RESTITUTION))
    mechanism.output("above", ball.position[1] - wheel.point((0.2, 0))[1], units="m")
    mechanism.output("plate", plate.position[1], units="m")
    return uqmbd.Study("eccentric", mechanism, times=times, rtol=1e-9, propagators=[])


def bouncing(height, speed, times):
    """Heights (T,) of the ball: free flights between impacts, which are roots of its distance from the plate."""

    def plate(t):
        return ECCENTRICITY * np.sin(START + speed * t)

    begin, y, v, found = 0.0, height, 0.0, np.full(len(times), np.nan)
    while begin <= times[-1]:

        def flight(t, y=y, v=v, begin=begin):
            return y + v * (t - begin) - G * (t - begin) ** 2 / 2

        scan = begin + np.arange(1e-3, 3.0, 1e-3)
        first = scan[np.argmax(flight(scan) < plate(scan))]
        at = scipy.optimize.brentq(lambda t, f=flight: f(t) - plate(t), first - 1e-3, first, xtol=1e-15)
        inside = (times >= begin) & (times <= at)
        found[inside] = flight(times[inside])
        lift = ECCENTRICITY * speed * np.cos(START + speed * at)
        begin, y, v = at, plate(at), lift - RESTITUTION * (v - G * (at - begin) - lift)
    return found


def error(chaos, name, inputs, exact):
    """Root mean square over realisations and time, over the largest standard deviation."""
    wrong = surrogate(chaos, name).evaluate(inputs)[:, 0] - exact
    return float(np.sqrt((wrong**2).mean()) / exact.std(axis=0).max())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of 15 % at one time, near an event
def test_ball_on_a_plate_that_an_eccentric_moves(tmp_path):
    """Free flights and roots of independent realisations: a third of the error of either kind of landmarks, or less."""
    study = eccentric(np.linspace(0, 2, 101))
    node = study.propagate(Collocation(order=4, alignment=("events", "phase")))
    assert list(study.mechanism.inputs.names) == ["h0", "speed"]
    draw = np.random.default_rng(0)
    inputs = np.stack([draw.uniform(0.95, 1.05, 100), draw.uniform(29, 31, 100)], axis=1)
    angle = START + inputs[:, 1:] * study.times
    exact = np.array([bouncing(*row, study.times) for row in inputs]) - 0.2 * np.sin(angle)
    families, stated = (json.loads(node.attrs[name]) for name in ("alignment", "alignment_error"))
    assert families == {"above": "events+phase", "plate": "phase"}
    wrong = error(node, "above", inputs, exact)
    alone = [
        error(study.propagate(Collocation(order=4, alignment=name)), "above", inputs, exact)
        for name in ("events", "phase")
    ]
    assert wrong < 1e-3 and min(alone) > 3 * wrong
    assert wrong / 3 < stated["above"] < 3 * wrong
    # the phases of impacts differ by more than a quarter turn: marks there are no landmarks
    assert node.attrs["phases_dropped"] > 0 and node.attrs["phases_between_events"] > 20
    assert node.attrs["clock"] in ("wheel", "axle") and node.attrs["mixed"] == 0
    tree = study_tree([node], study="eccentric", mechanism="eccentric")
    validate(tree)
    save(tree, tmp_path / "eccentric.nc")
    read = load(tmp_path / "eccentric.nc")[node.name]
    np.testing.assert_array_equal(surrogate(read).evaluate(inputs[:9]), surrogate(node).evaluate(inputs[:9]))


@pytest.mark.slow
def test_one_impact_in_a_long_rotation():
    """Nothing ends the motion behind the impact: it goes on until all have the same phase; a closed form."""
    distance = uqmbd.RandomVariable("d", chaospy.Uniform(0.95, 1.05), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(9, 11), units="rad/s")
    mechanism = uqmbd.Mechanism("wall", uqmbd.Planar())
    disc = mechanism.body("disc", mass=1, inertia=0.5, position=(0, 3), angle=START, angular_velocity=speed)
    mechanism.add(Revolute("axle", mechanism.ground, disc, point_i=(0, 3), point_j=(0, 0)))
    ball = mechanism.body("ball", mass=1, inertia=0.1, position=(distance, 0), velocity=(-1, 0))
    mechanism.add(PlaneImpact("wall", mechanism.ground, ball, (0, 0), (0, 0), (1, 0), restitution=0.5))
    mechanism.output("both", 1.0 * ball.velocity[0] + disc.point((1, 0))[0], units="m")
    study = uqmbd.Study("wall", mechanism, times=np.linspace(0, 10, 201), rtol=1e-9, propagators=[])
    node = study.propagate(Collocation(order=4, alignment=("events", "phase")))
    draw = np.random.default_rng(0)
    inputs = np.stack([draw.uniform(0.95, 1.05, 300), draw.uniform(9, 11, 300)], axis=1)
    assert list(study.mechanism.inputs.names) == ["d", "speed"]
    exact = np.where(study.times < inputs[:, :1], -1, 0.5) + np.cos(START + inputs[:, 1:] * study.times)
    assert json.loads(node.attrs["alignment"]) == {"both": "events+phase"}
    assert error(node, "both", inputs, exact) < 1e-3
    table = node["families"]["error"].sel(output="both")
    assert float(table.sel(family="events")) > 0.3 and float(table.sel(family="phase")) > 0.02
    assert np.isfinite(node["statistics"]["mean"]).all()


@pytest.mark.thorough
def test_an_oscillation_is_no_clock_between_events():
    """The phase of a swing jumps where an impact resets it: landmarks of both kinds are left out, and it is said."""
    stiffness = uqmbd.RandomVariable("k", chaospy.Uniform(95, 105), units="N/m")
    mechanism = uqmbd.Mechanism("swing", uqmbd.Line(gravity=-G))
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=stiffness, free_length=0))
    ball = mechanism.body("ball", mass=1, position=1.0)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=0.8))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("height", ball.position[0], units="m")
    study = uqmbd.Study("swing", mechanism, times=np.linspace(0, 1.4, 71), rtol=1e-8, propagators=[])
    node = study.propagate(Collocation(order=2, alignment=("events", "phase"), clock="x"))
    left_out = json.loads(node.attrs["alignment_left_out"])
    assert set(left_out) == {"events+phase"} and "is not a growing angle" in left_out["events+phase"]


@pytest.mark.thorough
@settings(deadline=None, max_examples=150)
@given(
    arrays(float, st.tuples(st.integers(1, 5), st.integers(2, 6)), elements=st.floats(0.01, 6.0)),
    st.floats(-7, 7),
)
def test_sequences_of_landmarks_are_common(steps, start):
    """Each mark is a landmark if and only if it has the same place among the events of all realisations."""
    edges = start + np.cumsum(steps, axis=1)
    found = merged(edges)
    marks = QUARTER * np.arange(np.floor(edges.min() / QUARTER) - 1, np.ceil(edges.max() / QUARTER) + 2)
    expected = [list[float]() for _ in range(edges.shape[1] - 1)]
    unsure = set()
    passed = 0
    for mark in marks:
        # a mark within a tenth of their distance from an event has no sure place
        places = {int((row < at).sum()) for row in edges for at in (mark - QUARTER / 10, mark + QUARTER / 10)}
        near = np.abs(np.abs(edges - mark) - QUARTER / 10).min() < 1e-9
        passed += all(row[0] <= mark <= row[-1] for row in edges)
        if near:
            unsure.add(round(float(mark / QUARTER)))
        elif len(places) == 1 and 0 < (place := places.pop()) < edges.shape[1]:
            expected[place - 1].append(float(mark))
    for own, right in zip(found.phases, expected, strict=True):
        sure = [round(float(x / QUARTER)) for x in own]
        assert [n for n in sure if n not in unsure] == [round(x / QUARTER) for x in right]
        # the order of all landmarks is that of each realisation
    for row in edges:
        whole = np.concatenate([np.append(own, row[k + 1]) for k, own in enumerate(found.phases)])
        assert (np.diff(np.append(row[0], whole)) > 0).all()
    assert found.kept + found.dropped == passed
    labels = found.labels(tuple("event" for _ in found.phases))
    assert len(labels) == found.kept + len(found.phases) and labels.count("event") == len(found.phases)


@pytest.mark.thorough
@settings(deadline=None)
@given(st.integers(1, 40), arrays(float, st.tuples(st.integers(1, 4), st.just(2)), elements=st.floats(0.1, 6.0)))
def test_a_motion_without_an_end_ends_at_a_mark(more, steps):
    """Behind the last event there are all marks that are reached, and the last segment ends at the last of these."""
    edges = np.cumsum(np.append(steps, np.full((len(steps), 1), 100.0), axis=1), axis=1)
    first = int(np.ceil(edges[:, -2].max() / QUARTER + 0.1))
    found = merged(edges, (first + more) * QUARTER)
    assert found.ending
    np.testing.assert_allclose(found.phases[-1], QUARTER * np.arange(first, first + more + 1))
    assert found.labels(("hit", ""))[-1] == "" and len(found.labels(("hit", ""))) == found.kept + 1
    on = found.farther(1.0, 0.3)
    np.testing.assert_allclose(on.phases[-1][: more + 1], found.phases[-1])
    np.testing.assert_allclose(np.diff(on.phases[-1]), QUARTER)
    assert len(on.phases[-1]) == more + 1 + min(5, found.kept)
