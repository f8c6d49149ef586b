"""What may be meant, and often is not, is one warning, which is stored in the results and shown."""

from __future__ import annotations

import html
import json

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import load
from uqmbd_contact import ClearanceJoint, PlaneContact, RoadContact, SphereContact
from uqmbd_joints import Distance, Fixed, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

TIMES = [0, 0.01]


def ball_on(space=None, position=(0, 1), **more):
    mechanism = uqmbd.Mechanism("machine", space or uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=position, **more)
    mechanism.output("height", ball.position[1], units="m")
    return mechanism, ball


def told(mechanism):
    """What `simulate` warns of, which its result holds as well."""
    with pytest.warns(uqmbd.StudyWarning) as caught:
        found = uqmbd.simulate(mechanism, TIMES)
    said = [str(w.message) for w in caught]
    assert [f"{x}." for x in json.loads(found.attrs["warnings"])] == said
    return said


def quiet(mechanism):
    assert "warnings" not in uqmbd.simulate(mechanism, TIMES).attrs


# -- components that were never added ---------------------------------------------------------------------------------
def test_a_component_that_was_made_and_never_added_is_reported():
    mechanism, ball = ball_on()
    spring = SpringDamper("spring", mechanism.ground, ball, (0, 0), (0, 0), 100)
    (said,) = told(mechanism)
    assert said == (
        "SpringDamper 'spring' of body 'ball' was created but not added to the mechanism, so it has no effect. "
        "Add the SpringDamper by mechanism.add(...)."
    )
    mechanism.add(spring)
    quiet(mechanism)


def test_a_component_that_nobody_holds_is_reported_as_well():
    """The usual form of the slip: a line by itself."""
    mechanism, ball = ball_on()
    PointForce("push", ball, (0, 0), (1, 0))
    assert told(mechanism)[0].startswith("PointForce 'push' of body 'ball' was created but not added")


def test_a_component_that_was_replaced_by_one_of_its_name_is_not_reported():
    """A notebook's cell that is run again makes the components once more."""
    mechanism, ball = ball_on()
    for stiffness in (1, 2):
        spring = SpringDamper("spring", mechanism.ground, ball, (0, 0), (0, 0), stiffness)
    mechanism.add(spring)
    quiet(mechanism)


def test_a_component_of_a_name_that_was_added_is_not_reported():
    """The variable of an earlier try may still be there."""
    mechanism, ball = ball_on()
    first = SpringDamper("spring", mechanism.ground, ball, (0, 0), (0, 0), 1)
    mechanism.add(SpringDamper("spring", mechanism.ground, ball, (0, 0), (0, 0), 2))
    quiet(mechanism)
    assert mechanism.components["spring"] is not first


def test_a_component_that_was_refused_has_been_reported_already():
    mechanism, ball = ball_on()
    rod = Distance("rod", mechanism.ground, ball, (0, 0), (0, 0), -1)
    with pytest.raises(uqmbd.StudyError, match="length is -1"):
        mechanism.add(rod)
    quiet(mechanism)


def test_a_component_of_another_mechanism_is_not_reported():
    mechanism, _ = ball_on()
    other, theirs = ball_on()
    PointForce("push", theirs, (0, 0), (1, 0))
    quiet(mechanism)
    assert "PointForce 'push' of body 'ball'" in told(other)[0]


def test_angles_of_bodies_make_no_component_that_could_be_forgotten():
    mechanism, ball = ball_on(uqmbd.Planar(), inertia=1)
    mechanism.output("angle", ball.angle)
    quiet(mechanism)


# -- contacts that start deep -----------------------------------------------------------------------------------------
FLOOR = {"point_i": (0, 0), "point_j": (0, 0), "normal_i": (0, 1)}


@pytest.mark.parametrize(
    ("make", "height", "deep"),
    [
        (lambda g, b: PlaneContact("c", g, b, **FLOOR), 1, False),
        (lambda g, b: PlaneContact("c", g, b, **FLOOR), -0.01, False),
        (lambda g, b: PlaneContact("c", g, b, **FLOOR), -2, True),
        (lambda g, b: PlaneContact("c", g, b, **FLOOR, radius=0.05), 0.049, False),
        (lambda g, b: PlaneContact("c", g, b, **FLOOR, radius=0.05), -0.01, True),
        (lambda g, b: PlaneContact("c", g, b, **FLOOR, radius=10), 8, True),
        (lambda g, b: RoadContact("c", g, b, point_j=(0, 0), road=1), 1, False),
        (lambda g, b: RoadContact("c", g, b, point_j=(0, 0), road=4), 1, True),
        (lambda g, b: SphereContact("c", g, b, (0, 0), (0, 0), radius_i=0.5, radius_j=0.1), 0.59, False),
        (lambda g, b: SphereContact("c", g, b, (0, 0), (0, 0), radius_i=0.5, radius_j=0.1), 0.3, True),
        (lambda g, b: ClearanceJoint("c", g, b, (0, 0), (0, 0), radius=0.02, clearance=1e-3), 0.001, False),
        (lambda g, b: ClearanceJoint("c", g, b, (0, 0), (0, 0), radius=0.02, clearance=1e-3), 0.3, True),
    ],
)
def test_a_contact_that_starts_deep_is_reported(make, height, deep):
    mechanism, ball = ball_on(position=(0, height))
    mechanism.add(make(mechanism.ground, ball))
    if not deep:
        quiet(mechanism)
        return
    (said,) = told(mechanism)
    assert " 'c' starts " in said and "m deep: bodies overlap at the start" in said


def test_the_depth_at_the_means_is_reported():
    level = uqmbd.RandomVariable("level", chaospy.Uniform(1.5, 2.5))
    mechanism, ball = ball_on(position=(0, 0))
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, level), (0, 0), (0, 1)))
    assert "PlaneContact 'floor' starts 2 m deep" in told(mechanism)[0]


# -- assembly ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("degrees", [20, 90, 170])
def test_turns_and_distances_are_what_assembly_did(space, degrees):
    """A body that is fixed to the ground in another pose than it is drawn in."""
    angle = np.radians(degrees)
    flat = space == "planar"
    mechanism = uqmbd.Mechanism("machine", uqmbd.Planar() if flat else uqmbd.Spatial())
    turned = {"angle": angle} if flat else {"quaternion": (np.cos(angle / 2), 0, np.sin(angle / 2), 0)}
    rod = mechanism.body(
        "rod", mass=1, inertia=1 if flat else (1, 1, 1), position=(3, 4, 0)[: 2 + (not flat)], **turned
    )
    origin = (0,) * (2 if flat else 3)
    rotation = 0 if flat else (1, 0, 0, 0)
    mechanism.add(Fixed("weld", mechanism.ground, rod, origin, origin, rotation=rotation))
    mechanism.output("x", rod.position[0])
    (moved,) = uqmbd.check(mechanism).moved
    assert moved.distance == pytest.approx(5) and np.degrees(moved.turn) == pytest.approx(degrees)
    if degrees > 45:
        assert f"'rod' by 5 m and by {degrees} degrees from its given pose" in told(mechanism)[0]


def test_a_mechanism_that_is_drawn_roughly_is_not_reported():
    """By some degrees and centimetres: that is what assembly is for; `check` says it all the same."""
    mechanism = uqmbd.Mechanism("machine", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=1, position=(0.45, 0.05), angle=0.3)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.output("x", rod.position[0])
    quiet(mechanism)
    (moved,) = uqmbd.check(mechanism).moved
    assert 0.01 < moved.distance < 0.2
    exact = uqmbd.Mechanism("machine", uqmbd.Planar())
    rod = exact.body("rod", mass=1, inertia=1, position=(0.5, 0))
    exact.add(Revolute("pivot", exact.ground, rod, (0, 0), (-0.5, 0)))
    assert uqmbd.check(exact).moved == ()


# -- stored and shown -------------------------------------------------------------------------------------------------
SCRIPT = """
import chaospy, uqmbd
from uqmbd_contact import PlaneContact
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

mechanism = uqmbd.Mechanism("machine", uqmbd.Planar(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, inertia=1, position=(0, -3), velocity=(uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1)), 0))
wheel = mechanism.body("wheel", mass=1, inertia=1, position=(9, 0))
mechanism.add(Revolute("axle", mechanism.ground, wheel, (0, 0), (0, 0)))
mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), stiffness=10))
push = PointForce("push", ball, (0, 0), (1, 0))
mechanism.output("height", ball.position[1], units="m")
mechanism.output("way", ball.position[0], units="m")
study = uqmbd.Study("machine", mechanism, [0, 0.01], [MonteCarlo(samples=4, seed=1)])
"""


@pytest.mark.thorough
def test_warnings_are_stored_in_the_results_and_shown(tmp_path, command):
    script = tmp_path / "machine.py"
    script.write_text(SCRIPT)
    lines = command("run", script, "--out", tmp_path / "out").stderr
    tree = load(tmp_path / "out" / "results.nc")
    said = json.loads(tree.attrs["warnings"])
    assert len(said) == 2 and "PointForce 'push'" in said[0] and "PlaneContact 'floor' starts 3 m deep" in said[1]
    page = uqmbd.report.write_report(tree, tmp_path / "report.html").read_text()
    for words in ("PointForce 'push' of body", "starts 3 m deep"):
        assert lines.count(words) == 1 and words in html.unescape(page)


def test_check_says_what_assembly_moved(tmp_path, command):
    script = tmp_path / "machine.py"
    script.write_text(SCRIPT)
    shown = " ".join(command("check", script).stdout.split())
    assert "Note: mechanism 'machine': assembly moved body 'wheel' by 9 m from its given pose." in shown


def test_a_study_warns_once_and_every_study_does():
    mechanism, ball = ball_on()
    PointForce("push", ball, (0, 0), (1, uqmbd.RandomVariable("f", chaospy.Normal())))
    mass = uqmbd.RandomVariable("m", chaospy.Uniform(1, 2))
    mechanism.output("momentum", mechanism.body("other", mass=mass).velocity[1] * mass)
    for seed in (1, 2):
        study = uqmbd.Study("drop", mechanism, TIMES, [MonteCarlo(samples=4, seed=seed)])
        with pytest.warns(uqmbd.StudyWarning, match="PointForce 'push'") as caught:
            tree = study.run()
        assert len(caught) == 1 and len(json.loads(tree.attrs["warnings"])) == 1
