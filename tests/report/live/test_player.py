"""The player draws what is stored: points, views and signs, held against Python and geometry."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import uqmbd
from tests.mechanisms import pendulum
from uqmbd.report import motion
from uqmbd.report.charts import json_script
from uqmbd.report.live import collect_player_data
from uqmbd.report.mechanisms import Film
from uqmbd.report.mechanisms.sheet import Sheet, sheet_for
from uqmbd.report.mechanisms.sketch import world
from uqmbd.report.mechanisms.symbols import Symbols, projected
from uqmbd_joints import Revolute

SHAPES = """
const drawn = (given) => {
const mechanism = new Mechanism(given.data);
const view = new View(given.data.bounds);
const high = view.fit(900);
const palette = { ink: "#000000", paper: "#ffffff", soft: "#777777", dark: false };
const where = [], shapes = [];
for (let r = 0; r < given.data.realisations; r++)
  for (let t = 0; t < mechanism.times.length; t++) where.push(mechanism.storedAt(r, mechanism.times[t]));
for (let t = 0; t < mechanism.times.length; t++) shapes.push(...mechanism.draw(view, mechanism.storedAt(0, mechanism.times[t]), palette));
const ghosts = mechanism.ghosts(view, mechanism.storedAt(given.data.realisations - 1, mechanism.times[0]), palette, 0.5);
const flat = (points) => points.filter((p) => p !== null);
return {
  where, size: [view.wide, view.high], unit: view.unit, high: high / view.inch, ghosts: ghosts.length,
  signs: shapes.map(({ edge, face, width, closed, dashes, points }) => [edge, face, width, closed, dashes, flat(points).map((p) => p.map((x) => Number(x.toFixed(3))))]),
  inside: shapes.flatMap(({ points }) => flat(points)).every(([x, y]) => x > -0.4 && x < view.wide + 0.4 && y > -0.4 && y < view.high + 0.4),
};
};
"""
ONE = SHAPES + "answer = drawn(given);"
ALL = SHAPES + "answer = given.map((data) => JSON.stringify(drawn({ data }).signs));"


def drawn(node, data):
    """What the page makes of poses."""
    return node(["mechanism.js", "view.js"], ONE, {"data": json.loads(json_script(collect_player_data(data)))})


def signed(symbol, space="planar"):
    """A body whose component has a symbol, with two points, a radius and two directions, as poses are stored."""
    d = 3 if space == "spatial" else 2
    points = [("point", "ground", "c"), ("point", "body", "c"), ("direction", "ground", "c"), ("direction", "ground", "c"), ("com", "body", "")]  # fmt: skip
    local = np.zeros((1, 5, d))
    local[0, 0, :2] = 0.1, 0.2
    local[0, 1, 0] = 0.4
    local[0, 2, 1] = local[0, 3, 0] = 1.0
    pose = np.zeros((1, 2, 1, 7 if d == 3 else 4))
    pose[..., d] = 1.0
    pose[0, 1, 0, 0] = 0.3
    return xr.Dataset(
        {
            "pose": (("realisation", "time", "body", "coordinate"), pose.astype(np.float32)),
            "local": (("realisation", "point", "axis"), local),
            "point_radius": (("realisation", "point"), [[0.0, 0.15, 0.0, 0.0, 0.0]]),
            **{f"point_{k}": ("point", [p[n] for p in points]) for n, k in enumerate(("kind", "body", "component"))},
            "component_symbol": ("component", [symbol]),
            "component_bodies": ("component", ["ground/body"]),
        },
        {"time": [0.0, 1.0], "body": ["body"], "component": ["c"], "axis": list("xyz"[:d])},
        {"space": space},
    )


LAID = """
const { wide, high, cases } = given;
answer = cases.map(({ data, radii }) => {
  const mechanism = new Mechanism(data);
  const view = new View(data.bounds);
  view.fit(110 * wide, 110 * high);
  const points = mechanism.storedAt(0, mechanism.times[1]);
  return mechanism.strokes.map((stroke) => strokeShape(view, stroke, points, radii));
});
"""


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_the_page_lays_strokes_where_python_does(node, space):
    """Every symbol in poses of all directions, from 0.02 to 3 times the size of the picture, with tiny circles too."""
    rng, cases, wanted = np.random.default_rng(3), [], []
    for symbol in SYMBOLS:
        for scale in (0.02, 0.4, 3.0):
            data = signed(symbol, space)
            local = rng.normal(size=data["local"].shape) * scale
            local[:, 2:4] /= scale
            data = data.assign(
                local=(data["local"].dims, local), point_radius=(("realisation", "point"), abs(local[..., 0]))
            )
            film = Film(data, 6.4, 100)
            sheet, points = sheet_for(film.bounds, 6.4, 4.6), world(data)[0, 1]
            cases.append({"data": json.loads(json_script(collect_player_data(data))), "radii": film.sketch.radii})
            wanted.append([projected(stroke, sheet, points, film.sketch.radii) for stroke in film.strokes])
    found = node(["mechanism.js", "view.js"], LAID, {"wide": 6.4, "high": 4.6, "cases": cases})
    shown = 0
    for shapes, others in zip(wanted, found, strict=True):
        for shape, other in zip(shapes, others, strict=True):
            if shape is None or other is None:
                assert shape is other
                continue
            shown += 1
            np.testing.assert_allclose(
                shape.vertices, np.array([p or (np.nan, np.nan) for p in other["points"]]), atol=1e-3, rtol=1e-5
            )
            dashes = [] if shape.style == "-" else list(shape.style[1])
            looks = (shape.edge, shape.face, shape.width, shape.closed, dashes, shape.order, shape.alpha)
            page = (other[k] for k in ("edge", "face", "width", "closed", "dashes", "order", "alpha"))
            assert looks == tuple(x or [] if k == 4 else x for k, x in enumerate(page))
    assert shown > 6 * len(SYMBOLS)


@pytest.mark.parametrize("way", [-50.0, -0.01, 0.0, 0.3, 0.6, 50.0])
def test_the_arrow_of_a_driver_is_along_its_axis_and_short(way):
    """At the driven point, however far away the place is from which it is measured."""
    sheet = Sheet(
        lambda points: np.asarray(points) / 0.5, lambda points: points[..., 0], 0.5, (0, 0, 1, 1), spatial=False
    )
    second, axis = np.array([1.0, 2.0]), np.array([0.0, 2.0])
    shaft = Symbols(2).push(0, 1, 2)[0]
    tail, head = projected(shaft, sheet, np.array([second - [30.0, way], second, axis]), [0.0, 0.0, 0.0]).vertices
    np.testing.assert_allclose(head, second / 0.5)
    along = head - tail
    assert abs(along[0]) < 1e-12 and along[1] == pytest.approx(
        np.clip(abs(way) / 0.5, 0.5, 0.8) * (-1 if way < 0 else 1)
    )


@pytest.mark.thorough
def test_points_are_where_python_has_them(node):
    """All points of all realisations and times, in the plane; all that is drawn fits into the view."""
    study = uqmbd.Study("p", pendulum(loaded=True), np.linspace(0, 1, 11), [])
    data = motion(study, samples=3, frames=7)
    found = drawn(node, data)
    # a page stores places to some 1e-4 of the size of the mechanism, a tenth of a pixel
    np.testing.assert_allclose(np.array(found["where"]).reshape(world(data).shape), world(data), atol=1e-4)
    assert found["inside"] and found["high"] == pytest.approx(found["size"][1])
    assert found["ghosts"] == data.sizes["body"]
    made = collect_player_data(data)
    assert made["start"] == Film(data, 6.4, 100).widest and made["realisations"] == 4
    assert collect_player_data(data, most=data["pose"][0].size * 2)["realisations"] == 2


@pytest.mark.thorough
def test_points_in_space_turn_with_their_bodies(node):
    """Against rotation matrices of SciPy."""
    turned = Rotation.from_rotvec([0.3, -0.5, 0.9])
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Spatial())
    stone = mechanism.body("stone", mass=1, inertia=(1, 1, 1), com=(0.3, 0.2, 0.1), rotation=turned.as_matrix(), velocity=(1, 2, 3), angular_velocity=(0, 0, 0))  # fmt: skip
    mechanism.output("x", stone.position[0])
    found = drawn(node, motion(uqmbd.Study("thrown", mechanism, [0, 2]), frames=3))
    line = np.outer([0, 1, 2], (1, 2, 3)) + turned.apply((0.3, 0.2, 0.1))
    np.testing.assert_allclose(np.array(found["where"])[:, 0], line, atol=1e-5)


SYMBOLS = ("contact", "wheel", "hinge", "ball", "universal", "weld", "slide", "cylinder", "line", "skate", "plane", "rod",
           "spring", "damper", "coil", "driver", "torque", "force", "", "of a plugin <b>", "constructor")  # fmt: skip


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_every_symbol_has_a_sign_of_its_own(node, space):
    """No two look alike, but what has no sign, and in the plane what differs in space only."""
    data = [json.loads(json_script(collect_player_data(signed(symbol, space)))) for symbol in SYMBOLS]
    looks = dict(zip(SYMBOLS, node(["mechanism.js", "view.js"], ALL, data), strict=True))
    alike = {"constructor": "of a plugin <b>"}
    if space == "planar":
        alike |= {"wheel": "contact", "cylinder": "slide"}
    assert len({looks[s] for s in SYMBOLS if s not in alike}) == len(SYMBOLS) - len(alike)
    assert all(looks[a] == looks[b] for a, b in alike.items())
    for symbol in SYMBOLS:
        assert len(json.loads(looks[symbol])) >= 4, symbol


LOOKED = """
const view = new View([[-1, -1, -1], [1, 1, 1]]);
view.fit(800);
answer = given.map(([azimuth, elevation]) => {
  view.look(azimuth, elevation);
  const origin = view.project([0, 0, 0]);
  return [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => {
    const [x, y] = view.project(axis);
    return [(x - origin[0]) * view.unit, (y - origin[1]) * view.unit, view.depth(axis)];
  });
});
"""


def test_views_in_space_are_rotations(node):
    """Whatever the angles: orthonormal, right-handed, z upwards; from the front x comes nearer, from above z does."""
    angles = [(0, 0), (-58, 24), (30, 90), (200, -45), (720, 10)]
    for (azimuth, elevation), axes in zip(angles, node(["view.js"], LOOKED, angles), strict=True):
        matrix = np.array(axes).T * [[1], [1], [-1]]
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1)
        a, e = np.deg2rad([azimuth, elevation])
        towards = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        np.testing.assert_allclose(matrix[2], towards, atol=1e-12)
        assert matrix[1, 2] >= -1e-12 and abs(matrix[0, 2]) < 1e-12


def test_speeds_let_a_motion_last_some_seconds(node):
    spans = [2e-6, 0.3, 2.0, 4.0, 1e5]
    for span, found in zip(spans, node(["speeds.js"], "answer = given.map(speedsOf);", spans), strict=True):
        assert 4 <= span / found["natural"] < 11 and found["natural"] in found["speeds"]
        assert sorted(found["speeds"]) == found["speeds"] and 5 <= len(found["speeds"]) <= 8


@pytest.mark.thorough
def test_hostile_names_stay_in_their_texts():
    name = "<!--<script><img src=x>"
    mechanism = uqmbd.Mechanism(name, uqmbd.Planar())
    body = mechanism.body("b<i>", mass=1, inertia=1)
    mechanism.add(Revolute("r&", mechanism.ground, body, (0, 0), (0, 0)))
    mechanism.output("x", body.position[0])
    text = json_script(collect_player_data(motion(uqmbd.Study("s", mechanism, [0, 1]), samples=0, frames=3)))
    assert "<" not in text and json.loads(text)["mechanism"] == name


BETWEEN = """
const read = (frame) => given.poses[frame];
answer = given.wanted.map((time) => poseAt(read, weightsAt(given.times, time), given.dimension));
"""


def test_poses_between_frames_are_those_of_the_motion(node):
    """A point that runs on a circle, and a half-angle pair whose sign jumps: 0.6 rad a frame, times of two steps."""
    times = np.cumsum(np.r_[0.0, np.tile([0.1, 0.08], 10)])

    def poses(at):
        angle = 6.0 * np.asarray(at)
        return np.stack([np.cos(angle), np.sin(angle), np.cos(angle / 2), np.sin(angle / 2)], axis=-1)

    stored = poses(times)
    stored[5:9, 2:] *= -1
    wanted = np.linspace(times[1], times[-2], 73)
    given = {"times": times.tolist(), "poses": stored.tolist(), "wanted": wanted.tolist(), "dimension": 2}
    found = np.array(node(["between.js"], BETWEEN, given))
    # turns have two signs
    turns = found[:, 2:] * np.sign((found[:, 2:] * poses(wanted)[:, 2:]).sum(axis=1))[:, None]
    np.testing.assert_allclose(np.c_[found[:, :2], turns], poses(wanted), atol=5e-3)
    exact = np.array(node(["between.js"], BETWEEN, given | {"wanted": times.tolist()}))
    np.testing.assert_array_equal(exact, stored)


def test_a_pose_beside_one_that_is_not_known_is_the_nearest(node):
    poses = [[0.0, 0.0], [1.0, 0.0], [None, None]]
    read = BETWEEN.replace("given.poses[frame]", "given.poses[frame].map((x) => x ?? NaN)")
    given = {"times": [0.0, 1.0, 2.0], "poses": poses, "wanted": [1.2, 0.2], "dimension": 2}
    assert node(["between.js"], read, given) == [[1.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize(("step", "resolved"), [(0.3, True), (1.0, True), (2.5, False), (9.9, False)])
def test_frames_resolve_a_motion_that_turns_little_between_them(node, step, resolved):
    """A crank of 1 m that turns by a step a frame, slightly slower in the end."""
    angle = step * np.arange(60) * (1 - 1e-3 * np.arange(60))
    poses = np.stack([np.cos(angle), np.sin(angle), np.cos(angle / 2), np.sin(angle / 2)], axis=-1)
    given = {"times": list(range(60)), "poses": poses.tolist()}
    lines = "answer = resolvedBy(given.times, (frame) => given.poses[frame], 2, 4.0);"
    assert node(["between.js"], lines, given) == resolved
