"""Data of the viewer: ellipsoids, distances of joint points, moves by the assembly, errors with their line."""

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.viewer.messages import as_json
from uqmbd.viewer.session import Session, failure, loaded
from uqmbd_joints import Revolute, Spherical


def rotation(axis, angle):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def opening(mechanism, study=None):
    return list(Session(mechanism, study).opening())


@pytest.mark.parametrize("turned", [np.eye(3), rotation((1, 2, 3), 0.7)])
def test_ellipsoid_of_an_ellipsoid_has_its_semi_axes(turned):
    """The inertia of a solid ellipsoid, m/5 (b^2 + c^2), gives back its semi-axes, in any orientation of its axes."""
    mass, axes = 3.0, np.array([0.2, 0.5, 1.1])
    moments = mass / 5 * (np.sum(axes**2) - axes**2)
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    mechanism.body("b", mass=mass, inertia=(turned @ np.diag(moments) @ turned.T).tolist(), com=(0.1, 0, 0))
    (found,) = opening(mechanism)[0]["ellipsoids"]
    matrix = np.array(found["axes"])
    assert np.allclose(matrix @ matrix.T, turned @ np.diag(axes**2) @ turned.T, rtol=1e-9)
    assert found["com"] == [0.1, 0, 0]


def test_disc_in_the_plane_and_no_ellipsoid_without_mass_or_of_an_impossible_inertia():
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    mechanism.body("disc", mass=2, inertia=0.5 * 2 * 0.3**2)
    mechanism.body("massless", mass=0, inertia=0)
    first, second = opening(mechanism)[0]["ellipsoids"]
    assert np.allclose(first["axes"], 0.3 * np.eye(2)) and second is None
    point = uqmbd.Mechanism("p", uqmbd.Translational())
    point.body("p", mass=1)
    assert opening(point)[0]["ellipsoids"][0]["axes"] is None


def chain(wrong):
    """A pendulum of two rods; the joint point of the second is `wrong` metres away from where it is drawn."""
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    first = mechanism.body("first", mass=1, inertia=0.1, position=(0.5, 0))
    second = mechanism.body("second", mass=1, inertia=0.1, position=(1.5, 0))
    mechanism.add(Revolute("A", mechanism.ground, first, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("B", first, second, (0.5, 0), (-0.5, wrong)))
    return mechanism


def test_a_joint_point_that_is_one_metre_off_is_listed_with_its_distance():
    scene = opening(chain(1.0))[0]
    assert [(gap["component"], gap["closed"]) for gap in scene["gaps"]] == [("B", True)]
    assert scene["gaps"][0]["distance"] == pytest.approx(1.0, abs=1e-12)
    assert "second" in {one["body"] for one in scene["moved"]}
    right = opening(chain(0.0))[0]
    assert right["gaps"] == [] and right["moved"] == []


def test_a_loop_that_cannot_close_shows_its_drawn_pose_and_the_reason():
    mechanism = chain(0.0)
    far = mechanism.bodies["second"]
    mechanism.add(Revolute("C", mechanism.ground, far, (5, 0), (0.5, 0)))
    scene, facts = opening(mechanism)
    assert "C" in scene["note"] and facts["problem"]
    assert [(gap["component"], gap["distance"], gap["closed"]) for gap in scene["gaps"]] == [("C", 3.0, False)]


def test_poses_and_motions_at_chosen_values():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.4, 0.6), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=(0.1, 0.1, 0.1), position=(length, 0, 0))
    mechanism.add(Spherical("S", mechanism.ground, rod, (0, 0, 0), (-length, 0, 0)))
    mechanism.body("loose", mass=1, inertia=(1, 1, 1))
    mechanism.output("z", rod.position[2], units="m")
    session = Session(mechanism, uqmbd.Study("s", mechanism, [0, 0.3]))
    scene, facts = session.opening()
    assert scene["inputs"][0]["low"] == pytest.approx(0.4002) and scene["inputs"][0]["high"] == pytest.approx(0.5998)
    assert [body["free"] for body in scene["bodies"]] == [False, True]
    assert facts["mobility"] == 3 + 6
    pose = session.answer({"do": "pose", "values": {"length": 0.55}, "number": 4})
    assert pose["values"] == {"length": 0.55} and pose["number"] == 4
    motion = session.answer({"do": "motion", "values": {"length": 0.55}, "number": 5})
    assert motion["kind"] == "motion" and motion["stopped"] == ""
    assert motion["player"]["times"]["shape"] == [90]
    refused = session.answer({"do": "pose", "values": {"width": 1.0}, "number": 6})
    assert refused["kind"] == "refused" and "width" in refused["message"]
    assert session.answer({"do": "format"})["kind"] == "refused"
    as_json(scene), as_json(facts), as_json(motion)


def test_redundant_equations_are_listed():
    mechanism = uqmbd.Mechanism("double hinge", uqmbd.Spatial())
    door = mechanism.body("door", mass=1, inertia=(1, 1, 1), position=(1, 0, 0))
    for name, height in (("lower", 0.0), ("upper", 2.0)):
        mechanism.add(
            Revolute(name, mechanism.ground, door, (0, 0, height), (-1, 0, height), axis_i=(0, 0, 1), axis_j=(0, 0, 1))
        )
    facts = opening(mechanism)[1]
    assert len(facts["redundant"]) == 5 and facts["mobility"] == 1


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("x = 1\ny = (\n", 2, "SyntaxError"),
        ("def f():\n    return 1 / 0\n\nf()\n", 2, "ZeroDivisionError"),
        ("import uqmbd\n", None, "0 module-level mechanisms"),
        ("raise SystemExit(3)\n", 1, "SystemExit"),
    ],
)
def test_errors_name_their_line(tmp_path, text, line, words):
    file = tmp_path / "broken_study.py"
    file.write_text(text)
    with pytest.raises(uqmbd.StudyError) as caught:
        loaded(file)
    found = failure(caught.value, file)
    assert found["line"] == line and words in found["message"]


def test_a_script_with_a_mechanism_alone_is_shown(tmp_path):
    file = tmp_path / "alone_mechanism.py"
    file.write_text(
        "import uqmbd\nm = uqmbd.Mechanism('m', uqmbd.Planar())\nm.body('b', mass=1, inertia=1)\nother = m\n"
    )
    scene, _ = loaded(file).opening()
    assert scene["study"] is None and scene["times"] is None and scene["mechanism"] == "m"
