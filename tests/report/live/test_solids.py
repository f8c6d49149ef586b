"""Surfaces of shapes on the page: the script draws the faces that Python draws, at the same places."""

import numpy as np
import pytest

import uqmbd
from uqmbd.javascript import surface_library
from uqmbd.report.live import collect_player_data
from uqmbd.report.mechanisms import Sketch, drawn_pose, world
from uqmbd.report.mechanisms.sheet import sheet_for
from uqmbd.shapes import Box, Cylinder

DRAW = """
const mechanism = new Mechanism(given.data);
const view = new View(given.data.bounds);
view.fit(given.width, given.height);
const palette = { dark: false };
answer = { shapes: mechanism.draw(view, mechanism.storedAt(0, 0), palette).filter((one) => one.width === 0.4), inch: view.inch };
"""


def two_bodies(space):
    mechanism = uqmbd.Mechanism("m", space)
    inertia = (1, 1, 1) if space.dimension == 3 else 1
    zero = (0,) * (space.dimension - 1)
    mechanism.body("one", mass=1, inertia=inertia, shape=[Box((1, 0.5, 0.3)), Cylinder(0.2, 1.0, position=(0, 0, 0.5))])
    mechanism.body("two", mass=1, inertia=inertia, position=(1.5, *zero), shape=Box((0.3, 0.3, 0.3)))
    return drawn_pose(mechanism).to_dataset()


def test_the_page_draws_the_faces_that_python_draws_in_the_plane(node):
    data = two_bodies(uqmbd.Planar())
    sketch, points = Sketch(data), world(data)[0, 0]
    player = collect_player_data(data)
    found = node(["mechanism.js", "view.js"], DRAW, {"data": player, "width": 640, "height": 480})
    inch = found["inch"]
    sheet = sheet_for(np.array(player["bounds"]), 640 / inch, 480 / inch)
    mine = list(sketch.solids.draw(sheet, points, [sketch.colour(body) for body in sketch.solids.owners]))
    assert len(mine) == len(found["shapes"]) > 10

    def key(face, place):
        return face, tuple(np.round(np.sort(np.asarray(place).ravel()), 2))

    theirs = sorted(key(one["face"], one["points"]) for one in found["shapes"])
    for (face, place), (other, there) in zip(sorted(key(s.face, s.vertices) for s in mine), theirs, strict=True):
        assert place == pytest.approx(there, abs=0.02)
        assert [abs(int(face[k : k + 2], 16) - int(other[k : k + 2], 16)) <= 40 for k in (1, 3, 5)] == [True] * 3


CAMERA = """
globalThis.THREE = new Function(`${given.three}; return THREE;`)();
const mechanism = new Mechanism(given.data);
const view = new View(given.data.bounds);
view.look(given.azimuth, given.elevation);
view.enlarge(1.3);
view.fit(640, 480);
view.pan(40, -25);
view.fit(640, 480);
const points = mechanism.storedAt(0, 0);
const surfaces = new Surfaces(mechanism.solids);
surfaces.place(view, points);
surfaces.look(view);
surfaces.camera.updateMatrixWorld();
const places = mechanism.solids.places(points);
answer = Array.from(mechanism.solids.corners, (_, v) => {
  const [x, y, z] = new THREE.Vector3(...surfaces.places.array.slice(3 * v, 3 * v + 3)).project(surfaces.camera).toArray();
  const place = [0, 1, 2].map((k) => places[3 * v + k]);
  return { camera: [((x + 1) / 2) * view.wide, ((y + 1) / 2) * view.high], depth: z, page: view.project(place), behind: view.depth(place) };
});
"""


@pytest.mark.parametrize(("azimuth", "elevation"), [(-58, 24), (10, 0), (130, -70), (0, 90)])
def test_the_camera_looks_as_the_symbols_are_projected(node, azimuth, elevation):
    """The drawing of surfaces and that of symbols agree, and what is farther away is behind."""
    player = collect_player_data(two_bodies(uqmbd.Spatial()))
    given = {"data": player, "three": surface_library(), "azimuth": azimuth, "elevation": elevation}
    found = node(["mechanism.js", "view.js", "surfaces.js"], CAMERA, given)
    assert len(found) > 20
    for one in found:
        assert one["camera"] == pytest.approx(one["page"], abs=1e-4)
        assert -1 <= one["depth"] <= 1
    order = np.argsort([one["depth"] for one in found], kind="stable")
    assert (np.diff(np.array([one["behind"] for one in found])[order]) > -1e-5).all()


GLTF = """
const mechanism = new Mechanism(given.data);
answer = mechanism.gltf(mechanism.storedAt(0, 0));
"""


def test_the_exported_file_has_the_solids_of_the_pose(node, tmp_path):
    """Read by trimesh: one closed mesh for each body, at its place, with the second axis upwards."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: exported shapes are not verified")
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    mechanism.body("one", mass=1, inertia=(1, 1, 1), shape=Box((1, 0.5, 0.3)))
    mechanism.body("two <b>", mass=1, inertia=(1, 1, 1), position=(2, 3, 4), shape=Box((0.3, 0.3, 0.6)))
    file = tmp_path / "pose.gltf"
    file.write_text(node(["mechanism.js"], GLTF, {"data": collect_player_data(drawn_pose(mechanism))}))
    scene = trimesh.load_scene(file)
    assert set(scene.geometry) == {"one", "two <b>"}
    whole = scene.to_mesh()
    whole.merge_vertices()
    assert whole.is_watertight and whole.volume == pytest.approx(0.15 + 0.054, rel=1e-5)
    # the third axis of the mechanism is the second one of the file, and the second axis the opposite of the third one
    assert scene.bounds[1] == pytest.approx([2.15, 4.3, 0.25], abs=1e-5)
    assert scene.bounds[0] == pytest.approx([-0.5, -0.15, -3.15], abs=1e-5)
