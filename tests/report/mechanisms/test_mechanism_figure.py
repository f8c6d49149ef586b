"""The picture of a mechanism: what is where, at which scale, and that names do not cover each other."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import uqmbd
from uqmbd import report
from uqmbd.mechanism.skeleton import collect_skeleton
from uqmbd.report.mechanisms.body_poses import drawn_pose
from uqmbd.report.mechanisms.canvas import canvas_for
from uqmbd.report.mechanisms.sketch import Sketch, world
from uqmbd_contact import PlaneContact, PlaneImpact, SphereContact
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import (
    Cylindrical,
    Distance,
    Fixed,
    Parallel1,
    Prismatic,
    Revolute,
    RollingWheel,
    Skate,
    Spherical,
    Universal,
)
from uqmbd_springs import PointForce, RadialTyre, SpringDamper, Torque, TorsionSpringDamper, distance


def crank(name="crank $x_1$"):
    """A slider-crank whose crank length is random, drawn a little apart."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(0.2, 0.01), units="m")
    made = uqmbd.Mechanism(name, uqmbd.Planar(gravity=(0, -9.81)))
    ground = made.ground
    arm = made.body("arm", mass=1, inertia=0.1, position=(0, length / 2), angle=np.pi / 2)
    rod = made.body("rod", mass=1, inertia=0.1, position=(0.2, 0.1), angle=-0.4)
    slider = made.body("slider", mass=1, inertia=0.1, position=(0.41, 0))
    made.add(Revolute("bearing", ground, arm, (0, 0), (-length / 2, 0)))
    made.add(Revolute("pin", arm, rod, (length / 2, 0), (-0.25, 0)))
    made.add(Revolute("piston pin", rod, slider, (0.25, 0), (0, 0)))
    made.add(Prismatic("guide", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    made.add(Torque("drive", arm, 1))
    made.add(TorsionSpringDamper("friction", ground, arm, 0, 0.1))
    made.add(SpringDamper("spring", ground, slider, (0.9, 0), (0.05, 0), 10))
    made.output("tip", rod.point((0.1, 0.05))[0], units="m")
    return made


def spatial():
    """Many kinds of joints in space."""
    made = uqmbd.Mechanism("space", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    ground, (x, y, z) = made.ground, np.eye(3).tolist()
    a = made.body("a", mass=1, inertia=(1, 1, 1), position=(0, 0, 0.2))
    b = made.body("b", mass=1, inertia=(1, 1, 1), position=(0.8, 0.1, 0.2))
    c = made.body("c", mass=1, inertia=(1, 1, 1), position=(1.6, -0.3, 0))
    d = made.body("d", mass=1, inertia=(1, 1, 1), position=(1.4, 0.6, 0.2))
    made.add(Prismatic("rail", ground, a, (0, 0, 0), (0, 0, -0.2), x, x))
    made.add(Spherical("ball", a, b, (0.3, 0.1, 0), (-0.5, 0, 0)))
    made.add(Universal("cardan", b, d, (0.3, 0.5, 0), (-0.3, 0, 0), y, z))
    made.add(Cylindrical("sleeve", ground, c, (1.6, -0.6, 0), (0, 0, 0), y, y))
    made.add(Parallel1("parallel", b, c, z, z))
    made.add(PointForce("wind", d, (0, 0.1, 0), (-3, 1, 0)))
    return made


class Magnet(uqmbd.Component):
    """A third party's force, of which the figure knows nothing but its points."""

    point_i = uqmbd.Parameter("m", "pole, frame of body i", kind="point")
    point_j = uqmbd.Parameter("m", "pole, frame of body j", kind="point")

    def terms(self, p):
        d = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Potential(d.dot(d))


def boxes(figure):
    """Names in a figure and the room that they take, pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    return {text.get_text(): text.get_window_extent(renderer) for text in figure.texts}


@pytest.mark.thorough
@pytest.mark.parametrize("make", [crank, spatial])
def test_names_are_there_and_cover_neither_each_other_nor_the_edge(make):
    """By the extents that Matplotlib measures, not those that the placing estimates."""
    made = make()
    found = boxes(report.mechanism(made))
    assert {made.name, *made.bodies, *made.components} == set(found)
    for (one, a), (other, b) in itertools.combinations(found.items(), 2):
        assert not a.overlaps(b), (one, other)
    width, height = report.mechanism(made).get_size_inches() * 100
    assert all(b.x0 >= -1 and b.y0 >= -1 and b.x1 <= width + 1 and b.y1 <= height + 1 for b in found.values())


def test_points_are_where_geometry_says():
    """The assembled crank: pin above the bearing, slider where Pythagoras puts it; for other lengths, too."""
    made = crank()
    for length in (0.2, 0.23):
        data = drawn_pose(made, {"length": length}).to_dataset()
        points = world(data)[0, 0]
        at = {
            (str(c), str(b)): points[k]
            for k, (c, b) in enumerate(zip(data["point_component"].values, data["point_body"].values, strict=True))
            if data["point_kind"].values[k] == "point"
        }
        np.testing.assert_allclose(at["bearing", "arm"], (0, 0), atol=1e-7)
        # closed by the smallest change: the parts of each joint meet
        np.testing.assert_allclose(at["pin", "arm"], at["pin", "rod"], atol=1e-7)
        np.testing.assert_allclose(np.hypot(*at["pin", "arm"]), length, atol=1e-7)
        np.testing.assert_allclose(np.hypot(*(at["piston pin", "rod"] - at["pin", "arm"])), 0.5, atol=1e-7)
        assert abs(at["guide", "slider"][1]) < 1e-7


def test_scale_is_equal_and_in_metres():
    """A metre is as long upwards as across; in space unit vectors project with squares that add up to two."""
    figure = report.mechanism(crank())
    figure.canvas.draw()
    (axes,) = figure.axes
    box = axes.get_window_extent()
    across = box.width / np.ptp(axes.get_xlim())
    assert across == pytest.approx(box.height / np.ptp(axes.get_ylim()), rel=1e-6)
    assert axes.get_xlabel() == "x [m]" and axes.get_ylabel() == "y [m]"
    made = canvas_for(np.array([[0.0, 0, 0], [3, 1, 0.2]]))
    ends = made.sheet.project(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    assert np.sum((ends[1:] - ends[0]) ** 2) == pytest.approx(2 / made.sheet.unit**2, rel=1e-6)
    # what is projected lies where mplot3d draws it
    made.axes.plot([0, 3], [0, 1], [0, 0.2], color=(1, 0, 0), lw=2, solid_capstyle="butt")
    canvas = FigureCanvasAgg(made.figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(int)
    rows, columns = np.nonzero((pixels[..., 0] > 200) & (pixels[..., 1:].max(axis=-1) < 80))
    drawn = np.array([[columns.min(), rows[columns.argmin()]], [columns.max(), rows[columns.argmax()]]])
    expected = made.sheet.project(np.array([[0.0, 0, 0], [3, 1, 0.2]])) * made.figure.dpi
    np.testing.assert_allclose(drawn, expected, atol=2.5)


@pytest.mark.thorough
def test_symbols_follow_from_what_components_say():
    """Joints by what their constraints hold together, forces by their parameters; a stranger by its points."""
    made = crank()
    arm, rod = made.bodies["arm"], made.bodies["rod"]
    made.add(Magnet("magnet", arm, rod, (0, 0.1), (0, 0.1)))
    made.add(Distance("rope", made.ground, rod, (0.2, -0.3), (0, 0), 0.4))
    symbols = dict(
        zip(*(drawn_pose(made)[k].values.astype(str).tolist() for k in ("component", "component_symbol")), strict=True)
    )
    assert symbols == {
        "bearing": "hinge", "pin": "hinge", "piston pin": "hinge", "guide": "slide", "drive": "torque",
        "friction": "coil", "spring": "spring", "magnet": "spring", "rope": "rod",
    }  # fmt: skip
    symbols = drawn_pose(spatial())["component_symbol"].values.tolist()
    assert symbols == ["slide", "ball", "universal", "cylinder", "", "force"]
    driven = uqmbd.Mechanism("driven", uqmbd.Planar())
    one, two = (driven.body(n, mass=1, inertia=1) for n in ("one", "two"))
    driven.add(Fixed("weld", driven.ground, one, (0, 0), (0, 0)))
    driven.add(Revolute("hinge", one, two, (0, 0), (0, 0)))
    driven.add(RotationDriver("turn", one, two, uqmbd.t))
    assert drawn_pose(driven)["component_symbol"].values.tolist() == ["weld", "hinge", "driver"]
    driven = uqmbd.Mechanism("driven", uqmbd.Translational())
    driven.add(PositionDriver("push", driven.ground, driven.body("mass", mass=1), (0, 0), (0, 0), (1, 0), uqmbd.t))
    assert drawn_pose(driven)["component_symbol"].values.tolist() == ["driver"]
    assert len(report.mechanism(driven).axes) == 1


@pytest.mark.thorough
def test_observed_points_are_read_back_from_outputs():
    """``body.point(local)[k]`` gives `local` again, in every space; what is no point of one body gives nothing."""
    rng = np.random.default_rng(1)
    for space, dimension in ((uqmbd.Planar(), 2), (uqmbd.Spatial(), 3)):
        for k in range(dimension):
            made = uqmbd.Mechanism("m", space)
            body = made.body("body", mass=0, inertia=0 if dimension == 2 else (0, 0, 0))
            local = rng.normal(size=dimension)
            made.output("point", body.point(local)[k])
            made.output("no point", body.point(local)[k] ** 2)
            made.output("speed", body.point_velocity(local)[k])
            (mark,) = (m for m in collect_skeleton(made) if m.kind == "observed")
            np.testing.assert_allclose([float(x) for x in mark.local], local, rtol=1e-9)


def test_a_mechanism_that_cannot_be_assembled_is_shown_as_drawn():
    made = uqmbd.Mechanism("gap", uqmbd.Planar())
    bar = made.body("bar", mass=1, inertia=1, position=(0.5, 0))
    made.add(Revolute("left", made.ground, bar, (0, 0), (-0.5, 0)))
    made.add(Revolute("right", made.ground, bar, (3, 0), (0.5, 0)))
    with pytest.raises(uqmbd.AssemblyError):
        uqmbd.check(made)
    title = next(t.get_text() for t in report.mechanism(made).texts if t.get_text().startswith("gap"))
    assert "cannot be assembled" in title
    data = drawn_pose(made).to_dataset()
    np.testing.assert_allclose(data["pose"].squeeze()[:2], (0.5, 0))
    assert "right" in data.attrs["note"] or "left" in data.attrs["note"]


def test_mistakes():
    with pytest.raises(uqmbd.StudyError, match="no bodies to draw"):
        report.mechanism(uqmbd.Mechanism("empty", uqmbd.Planar()))
    with pytest.raises(uqmbd.StudyError, match="values contains 'lenght'; expected names of random variables"):
        report.mechanism(crank(), {"lenght": 1})


def test_a_single_body_without_anything_is_drawn():
    for space, more in ((uqmbd.Translational(), {}), (uqmbd.Spatial(), {"inertia": (0, 0, 0)})):
        made = uqmbd.Mechanism("one", space)
        made.body("dust", mass=0, **more)
        figure = report.mechanism(made)
        figure.canvas.draw()
        assert "dust" in [text.get_text() for text in figure.texts]


def test_one_motion_of_a_guide_is_shown_along_its_whole_way():
    """The guide's reach covers where the slider has been."""
    data = drawn_pose(crank()).to_dataset()
    sketch, points = Sketch(data), world(data)[0]
    moved = np.repeat(points, 3, axis=0)
    slide = next(p for p in sketch.parts if p.name == "guide")
    moved[:, slide.points[1], 0] = (0.1, 0.5, 0.3)
    assert sketch.reaches(moved)["guide"] == pytest.approx((0.0, 0.5))


def test_contacts_are_planes_and_circles():
    """Of a disc on an incline: a line perpendicular to the normal that reaches the disc, and a circle of its radius."""
    normal = np.array([np.sin(0.3), np.cos(0.3)])
    along = np.array([normal[1], -normal[0]])
    made = uqmbd.Mechanism("incline", uqmbd.Planar())
    centre = -0.8 * along + 0.2 * normal
    disc = made.body("disc", mass=1, inertia=1, position=tuple(centre))
    other = made.body("other", mass=1, inertia=1, position=(1, 1))
    made.add(PlaneImpact("slope", made.ground, disc, (0, 0), (0, 0), tuple(normal), radius=0.2))
    made.add(SphereContact("knock", disc, other, (0, 0), (0.1, 0), radius_i=0.2, radius_j=0.3, stiffness=1e3))
    made.add(SpringDamper("dashpot", disc, other, (0, 0), (0, 0), 0, 2))
    data = drawn_pose(made).to_dataset()
    assert data["component_symbol"].values.tolist() == ["contact", "contact", "damper"]
    assert data["point_radius"].values[0].tolist()[:5] == [0, 0.2, 0, 0.2, 0.3]
    sketch, points = Sketch(data), world(data)[0, 0]
    canvas = canvas_for(sketch.extent(points))
    drawn = canvas.sheet
    shapes = sketch.draw(drawn, points)
    line = next(s.vertices for s in shapes if s.width == 1.2 and len(s.vertices) == 2 and s.order == 0.9)
    zero = drawn.project(np.zeros(2))
    np.testing.assert_allclose((line - zero) @ normal, 0, atol=1e-6)
    reach = np.sort((line - zero) @ along) * drawn.unit
    assert reach[0] < -0.8 and reach[1] > 0
    circle = next(s.vertices for s in shapes if s.face is None and s.closed)
    away = np.hypot(*(circle - drawn.project(centre)).T) * drawn.unit
    np.testing.assert_allclose(away, 0.2, rtol=1e-6)
    # the largest circle is inside the axes
    assert canvas.axes.get_xlim()[1] > 1.4 and canvas.axes.get_ylim()[1] > 1.3


def test_planes_in_space_are_patches():
    made = uqmbd.Mechanism("space", uqmbd.Spatial())
    ball = made.body("ball", mass=1, inertia=(1, 1, 1), position=(0.3, 0.2, 1))
    made.add(PlaneContact("floor", made.ground, ball, (0, 0, 0), (0, 0, 0), (0, 0, 2), radius=0.1, stiffness=1))
    data = drawn_pose(made).to_dataset()
    sketch, points = Sketch(data), world(data)[0, 0]
    reaches = sketch.reaches(points[None])
    assert sorted(high - low for low, high in reaches.values()) == pytest.approx([0.2, 0.3])
    assert len(report.mechanism(made).axes) == 1


def test_a_wheel_is_a_circle_of_its_body():
    """The tyre's point is that of body j, as its description says."""
    made = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = made.body("wheel", mass=1, inertia=1, position=(0, 0.3))
    made.add(RadialTyre("tyre", made.ground, wheel, (0, 0), 0 * distance, 0.3, 1e5))
    mark = next(m for m in collect_skeleton(made) if m.component == "tyre")
    assert (mark.body, mark.radius) == ("wheel", 0.3)


def test_a_joint_that_is_open_is_a_red_line():
    """From one of its points to the other, and no spring; a joint that is closed has none."""
    made = uqmbd.Mechanism("gap", uqmbd.Planar())
    bar = made.body("bar", mass=1, inertia=1, position=(0.5, 0))
    made.add(Revolute("left", made.ground, bar, (0, 0), (-0.5, 0)))
    made.add(Revolute("right", made.ground, bar, (3, 0), (0.5, 0)))
    data = drawn_pose(made).to_dataset()
    assert data["component_symbol"].values.tolist() == ["hinge", "hinge"]
    sketch, points = Sketch(data), world(data)[0, 0]
    drawn = canvas_for(points[sketch.placed]).sheet
    (line,) = (s.vertices for s in sketch.draw(drawn, points) if s.edge == "limit")
    np.testing.assert_allclose(line, drawn.project(np.array([[3, 0], [1, 0]])), atol=1e-9)


def test_a_rolling_wheel_in_space_is_a_disc_about_its_axis():
    """Its rim is what the page shows of a circle in the x-z plane, above the patch that it rolls on."""
    made = uqmbd.Mechanism("disc", uqmbd.Spatial())
    turned = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    disc = made.body("disc", mass=1, inertia=(0.1, 0.1, 0.2), position=(0.5, 0.2, 0.3), quaternion=turned)
    made.add(RollingWheel("road", made.ground, disc, (0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1), 0.3))
    data = drawn_pose(made).to_dataset()
    assert data["component_symbol"].values.tolist() == ["wheel"]
    sketch, points = Sketch(data), world(data)[0, 0]
    drawn = canvas_for(sketch.extent(points)).sheet
    shapes = sketch.draw(drawn, points)
    rim = next(s.vertices for s in shapes if s.face is None and s.closed and len(s.vertices) > 20)
    zero, x, z = drawn.project(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1.0]]))
    centre = drawn.project(np.array([0.5, 0.2, 0.3]))
    inside = np.linalg.solve(np.column_stack([x - zero, z - zero]), (rim - centre).T)
    np.testing.assert_allclose(np.hypot(*inside), 0.3, rtol=1e-6)
    low, high = sketch.reaches(points[None])["road/0"]
    assert high - low > 0  # the patch reaches from its point to the wheel


def test_a_skate_is_a_blade_along_its_axis():
    made = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    body = made.body("body", mass=1, inertia=1, position=(1, 2), angle=np.pi / 2)
    made.add(Skate("blade", made.ground, body, (0.5, 0), (1, 0)))
    data = drawn_pose(made).to_dataset()
    sketch, points = Sketch(data), world(data)[0, 0]
    drawn = canvas_for(points[sketch.placed]).sheet
    (blade,) = (s.vertices for s in sketch.draw(drawn, points) if s.width == 3.2)
    np.testing.assert_allclose(blade.mean(axis=0), drawn.project(np.array([1, 2.5])), atol=1e-9)
    along = blade[1] - blade[0]
    assert abs(along[0]) < 1e-9 < abs(along[1])
