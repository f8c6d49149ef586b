"""Shapes of bodies: closed surfaces with the volume of the solid, random lengths, refusals, drawings."""

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report.mechanisms import Sketch, drawn_pose, world
from uqmbd.report.mechanisms.solids import MOST_FACES
from uqmbd.shapes import Box, Capsule, Cylinder, Mesh, Sphere

N = 32
POLYGON = N / (2 * np.pi) * np.sin(2 * np.pi / N)
"""Area of an inscribed polygon, relative to the circle."""


def volume(shape, position=(0, 0, 0)):
    vertices, faces = shape.surface([float(x) for x in shape.expressions])
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all(), "the surface is open"
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_surfaces_are_closed_and_have_the_volume_of_the_solid():
    assert volume(Box((1, 2, 3))) == pytest.approx(6)
    assert volume(Cylinder(0.5, 2)) == pytest.approx(POLYGON * np.pi * 0.25 * 2)
    assert volume(Sphere(0.5)) == pytest.approx(4 / 3 * np.pi / 8, rel=0.02)
    assert volume(Capsule(0.5, 2)) == pytest.approx(4 / 3 * np.pi / 8 + np.pi / 2, rel=0.02)
    assert volume(Sphere(0.5)) < 4 / 3 * np.pi / 8  # inscribed


def test_position_and_rotation_place_a_shape_and_its_bounds():
    turn = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # z of the shape is x of the body
    shape = Cylinder(0.1, 2.0, position=(1, 0, 0), rotation=turn)
    vertices, _ = shape.surface([float(x) for x in shape.expressions])
    assert vertices.min(axis=0) == pytest.approx([0, -0.1, -0.1]) and vertices.max(axis=0) == pytest.approx(
        [2, 0.1, 0.1]
    )
    low, high = shape.bounds
    assert [float(x) for x in high] == [0.1, 0.1, 1.0] and [float(x) for x in low] == [-0.1, -0.1, -1.0]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Box((1, 2)), "Box: size is .*expected three lengths"),
        (lambda: Box(1), "Box: size is 1; expected three"),
        (lambda: Sphere(0), "Sphere: radius is 0; expected positive"),
        (lambda: Sphere("1"), "radius"),
        (lambda: Cylinder(1, -1), "Cylinder: length is -1; expected positive"),
        (lambda: Sphere(1, position=(0, 0)), "Sphere: position"),
        (lambda: Sphere(1, rotation=np.ones((3, 3))), "expected a constant 3 x 3 rotation"),
        (lambda: Sphere(1, rotation=-np.eye(3)), "rotation is a reflection"),
        (lambda: Mesh([[0, 0]], [[0, 0, 0]]), "Mesh: vertices have the shape"),
        (lambda: Mesh([[0, 0, 0]], [[0, 0, 1]]), "Mesh: faces have the shape"),
        (lambda: uqmbd.Mechanism("m", uqmbd.Planar()).body("b", mass=1, inertia=1, shape="box"), "body 'b': shape is"),
    ],
)
def test_impossible_shapes_are_refused(make, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        make()


def crate(space, shape, **more):
    mechanism = uqmbd.Mechanism("crate", space)
    mechanism.body("crate", mass=1, shape=shape, **more)
    return mechanism


def test_random_lengths_are_inputs_and_are_drawn_at_their_values():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(1, 3), units="m")
    mechanism = crate(uqmbd.Spatial(), Box((length, 1, 1)), inertia=(1, 1, 1))
    assert mechanism.inputs.names == ("length",)
    for value in (1.0, 2.5):
        data = drawn_pose(mechanism, {"length": value}).to_dataset()
        places = Sketch(data).solids.places(world(data)[0, 0])
        assert np.ptp(places, axis=0) == pytest.approx([value, 1, 1], rel=1e-6)


def test_a_turned_shape_is_drawn_where_its_body_is():
    mechanism = crate(
        uqmbd.Planar(), Cylinder(0.1, 2.0, rotation=[[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), inertia=1, position=(3, 4),
        angle=np.pi / 2,
    )  # fmt: skip
    data = drawn_pose(mechanism).to_dataset()
    places = Sketch(data).solids.places(world(data)[0, 0])
    assert places.shape[1] == 2
    assert places.min(axis=0) == pytest.approx([2.9, 3.0], abs=1e-6)
    assert places.max(axis=0) == pytest.approx([3.1, 5.0], abs=1e-6)
    assert set(Sketch(data).solids.owners) == {"crate"}


def test_meshes_are_simplified_to_the_budget():
    vertices, faces = Sphere(1.0).surface([0, 0, 0, 1])
    for _ in range(2):  # split every triangle into four
        middles = [(vertices[faces[:, k]] + vertices[faces[:, (k + 1) % 3]]) / 2 for k in range(3)]
        count, n = len(vertices), len(faces)
        vertices = np.concatenate([vertices, *middles])
        ab, bc, ca = (count + k * n + np.arange(n) for k in range(3))
        a, b, c = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    assert len(faces) > MOST_FACES
    data = drawn_pose(crate(uqmbd.Spatial(), Mesh(vertices, faces), inertia=(1, 1, 1))).to_dataset()
    assert 0.2 * MOST_FACES < data.sizes["face"] <= MOST_FACES
    places = Sketch(data).solids.places(world(data)[0, 0])
    assert np.linalg.norm(places, axis=1) == pytest.approx(1.0, abs=0.05)


def test_mechanisms_without_shapes_store_and_send_nothing_more():
    from uqmbd.report.live import collect_player_data

    plain = collect_player_data(drawn_pose(crate(uqmbd.Planar(), None, inertia=1)))
    shaped = collect_player_data(drawn_pose(crate(uqmbd.Planar(), Box((1, 1, 1)), inertia=1)))
    assert "solids" not in plain and "solids" in shaped
    assert not [name for name in drawn_pose(crate(uqmbd.Planar(), None, inertia=1)) if str(name).startswith("solid")]
