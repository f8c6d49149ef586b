"""Clearances against closed forms and brute force; contact is zero; random lengths; methods with polynomials."""

import chaospy
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd.errors import MethodFailedWarning
from uqmbd.propagation import obstacle_of
from uqmbd.results import output
from uqmbd.shapes import Box, Capsule, Cylinder, Mesh, Sphere
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_geometry import clearance, clearance_over_time
from uqmbd_geometry.checks import ClearanceTimes
from uqmbd_geometry.distances import contains, distance, solid_of
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import CommonPaths

from .solids import box, torus

pytestmark = pytest.mark.usefixtures("fcl")

HERE = (np.eye(3), np.zeros(3))


def between(first, second, pose, other=HERE):
    one, two = (solid_of(shape, [float(x) for x in shape.expressions]) for shape in (first, second))
    return distance(one, two, pose, other)


def test_spheres_and_capsules_have_closed_forms():
    turned = Rotation.from_euler("xyz", (0.3, 0.4, 0.5)).as_matrix()
    assert between(Sphere(0.2), Sphere(0.3), (turned, np.array([3.0, 4, 0]))) == pytest.approx(4.5, abs=1e-14)
    across = (Rotation.from_euler("x", np.pi / 2).as_matrix(), np.array([0, 0, 2.0]))
    # crossed axes at a distance of 2
    assert between(Capsule(0.1, 3.0), Capsule(0.2, 1.0), (across[0], np.array([2.0, 0, 0]))) == pytest.approx(
        1.7, abs=1e-14
    )
    assert between(Box((1, 1, 1)), Sphere(0.1), (np.eye(3), np.array([1.5, 1.5, 1.5]))) == pytest.approx(
        np.sqrt(3) - 0.1, abs=1e-14
    )
    assert between(Cylinder(0.5, 2.0), Sphere(0.1), (np.eye(3), np.array([1.5, 0, 2.0]))) == pytest.approx(
        np.sqrt(2) - 0.1, abs=1e-12
    )
    # parallel cylinders, and one on top of the other
    assert between(Cylinder(0.3, 1.0), Cylinder(0.2, 1.0), (np.eye(3), np.array([2.0, 0, 0.3]))) == pytest.approx(
        1.5, abs=1e-11
    )
    assert between(Cylinder(0.3, 1.0), Cylinder(0.2, 1.0), (np.eye(3), np.array([0.1, 0, 3.0]))) == pytest.approx(
        2.0, abs=1e-11
    )


def test_touching_solids_have_the_distance_zero():
    assert between(Sphere(0.5), Sphere(0.5), (np.eye(3), np.array([0.9, 0, 0]))) == 0
    assert between(Box((1, 1, 1)), Cylinder(0.5, 1), (np.eye(3), np.array([0.9, 0, 0]))) == 0
    assert between(Box((1, 1, 1)), Box((1, 1, 1)), (np.eye(3), np.array([0.9, 0.2, 0]))) == 0


SHAPES = {
    "box": Box((0.3, 0.5, 0.7)),
    "sphere": Sphere(0.3),
    "capsule": Capsule(0.2, 0.6),
    "cylinder": Cylinder(0.25, 0.6),
}
PAIRS = [(a, b) for k, a in enumerate(SHAPES) for b in list(SHAPES)[k:]]


def parameters(name, u):
    """A point of the solid from three numbers, each from 0 to 1 or any angle; all points are reached."""
    if name == "box":
        return (u - 0.5) * [0.3, 0.5, 0.7]
    if name == "sphere":
        return np.zeros(3)
    if name == "capsule":
        return np.array([0, 0, 0.6 * (u[2] - 0.5)])
    return np.array([0.25 * u[0] * np.cos(u[1] * 6.5), 0.25 * u[0] * np.sin(u[1] * 6.5), 0.6 * (u[2] - 0.5)])


@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_convex_solids_against_minimisation_over_their_points(a, b):
    """The distance is the minimum over pairs of points, found by a general minimiser from many starts."""
    rng = np.random.default_rng(len(a) * 10 + len(b))
    radii = sum({"sphere": 0.3, "capsule": 0.2}.get(name, 0.0) for name in (a, b))
    for _ in range(2):
        turn = Rotation.random(random_state=rng).as_matrix()
        direction = rng.normal(size=3)
        place = 1.6 * direction / np.linalg.norm(direction)

        def square(x, turn=turn, place=place):
            gap = turn @ parameters(a, x[:3]) + place - parameters(b, x[3:])
            return float(gap @ gap)

        found = []
        for start in rng.random((30, 6)):
            done = minimize(square, start, bounds=[(0, 1)] * 6, method="L-BFGS-B", options={"ftol": 0, "gtol": 1e-13})
            found.append(done.fun)
        brute = np.sqrt(min(found)) - radii
        mine = between(SHAPES[a], SHAPES[b], (turn, place))
        assert mine == pytest.approx(brute, abs=1e-9)


@pytest.mark.thorough
def test_meshes_against_all_pairs_of_points_and_faces():
    """A torus of a thousand triangles and a box: the minimum over the box of the distance from every triangle."""
    vertices, faces = torus(1.0, 0.3, 12)
    rng = np.random.default_rng(3)
    for _ in range(3):
        turn, place = Rotation.random(random_state=rng).as_matrix(), np.array([0.0, 0, 2.2]) + 0.1 * rng.normal(size=3)
        mine = between(Mesh(vertices, faces), Box((0.5, 0.4, 0.3)), (turn, place))
        world = vertices @ turn.T + place
        best = np.inf
        for triangle in world[faces]:
            point = triangle.mean(axis=0)
            for _ in range(2000):  # alternating projections onto the box and the triangle
                onto = np.clip(point, [-0.25, -0.2, -0.15], [0.25, 0.2, 0.15])
                after = nearest_on_triangle(onto, triangle)
                if np.linalg.norm(after - point) < 1e-13:
                    break
                point = after
            best = min(best, np.linalg.norm(point - np.clip(point, [-0.25, -0.2, -0.15], [0.25, 0.2, 0.15])))
            if best < mine - 1e-9:
                break
        assert mine == pytest.approx(best, abs=1e-9)


def nearest_on_triangle(point, triangle):
    a, b, c = triangle
    basis = np.column_stack([b - a, c - a])
    u, v = np.linalg.lstsq(basis, point - a, rcond=None)[0]
    if u >= 0 and v >= 0 and u + v <= 1:
        return a + basis @ [u, v]
    ends = [(a, b), (b, c), (c, a)]
    near = [p + np.clip((point - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1) * (q - p) for p, q in ends]
    return min(near, key=lambda x: float(np.linalg.norm(x - point)))


def test_an_enclosed_body_is_found():
    inner, outer = (
        solid_of(shape, [float(x) for x in shape.expressions]) for shape in (Sphere(0.1), Mesh(*box((2, 2, 2))))
    )
    assert contains(inner, outer, HERE, HERE) and contains(outer, inner, HERE, HERE)
    assert not contains(inner, outer, (np.eye(3), np.array([3.0, 0, 0])), HERE)


def flight(space, shape, other, **motion):
    mechanism = uqmbd.Mechanism("flight", space)
    ball = mechanism.body("ball", shape=shape, **motion)
    mechanism.output("gap", clearance(ball, other), units="m")
    return mechanism


def test_the_smallest_distance_of_a_flight_is_between_output_times():
    """A ball passes a sphere at a distance of 0.3 m; the two output times are far away."""
    mechanism = flight(uqmbd.Translational(), Sphere(0.1), Sphere(0.1, position=(1, 0.5, 0)), mass=1, velocity=(1, 0))
    assert float(uqmbd.simulate(mechanism, [0, 2])["gap"]) == pytest.approx(0.3, abs=1e-12)
    through = flight(uqmbd.Translational(), Sphere(0.1), Sphere(0.1, position=(1, 0.1, 0)), mass=1, velocity=(1, 0))
    assert float(uqmbd.simulate(through, [0, 2])["gap"]) == 0.0


def test_a_turning_rod_passes_a_corner():
    """A rod of the length 2 turns about its middle: its end passes the plane x = 1.2 at a distance of 0.2 - radius."""
    rod = Capsule(0.05, 2.0, rotation=Rotation.from_euler("y", np.pi / 2).as_matrix())
    mechanism = flight(
        uqmbd.Planar(), rod, Box((0.4, 4, 4), position=(1.4, 0, 0)), mass=1, inertia=1, angle=0.8, angular_velocity=-1.0
    )
    assert float(uqmbd.simulate(mechanism, [0, 2])["gap"]) == pytest.approx(0.15, abs=1e-8)
    spatial = flight(
        uqmbd.Spatial(), rod, Box((0.4, 4, 4), position=(1.4, 0, 0)), mass=1, inertia=(1, 1, 1),
        quaternion=(np.cos(0.4), 0, 0, np.sin(0.4)), angular_velocity=(0, 0, -1.0),
    )  # fmt: skip
    assert float(uqmbd.simulate(spatial, [0, 2])["gap"]) == pytest.approx(0.15, abs=1e-8)


def thrown(methods):
    radius = uqmbd.RandomVariable("radius", chaospy.Uniform(0.1, 0.5), units="m")
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.4, 0.8), units="m")
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(-1, height), velocity=(1, 0), shape=Sphere(radius))
    mechanism.output("gap", clearance(ball, Sphere(0.2)), units="m")
    mechanism.require("free", clearance(ball, Sphere(0.2)) >= 0.05)
    return uqmbd.Study("thrown", mechanism, [0, 2], methods)


@pytest.mark.thorough
def test_the_probability_of_a_requirement_on_clearance():
    """Of every realisation, the clearance is max(height - radius - 0.2, 0)."""
    tree = thrown([MonteCarlo(samples=60, seed=1)]).run()
    node = tree["monte-carlo"]
    samples = node["scalars/samples"]
    inputs = samples["inputs"].sel(input=["height", "radius"]).values
    expected = np.maximum(inputs[:, 0] - inputs[:, 1] - 0.2, 0.0)
    mine = samples["response"].sel(output="gap").values
    assert mine == pytest.approx(expected, abs=1e-10)
    assert np.count_nonzero(mine == 0) > 5


@pytest.mark.parametrize(
    "method", [Collocation(order=2), Galerkin(order=2), CommonPaths(order=2)], ids=lambda one: one.name
)
@pytest.mark.parametrize("kind", ["output", "requirement", "series"])
def test_methods_with_surrogates_refuse_clearances(method, kind):
    """The message names the quantity, the method and the methods that compute it; other methods of a study run."""
    radius = uqmbd.RandomVariable("radius", chaospy.Uniform(0.1, 0.3), units="m")
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(-1, 1), velocity=(1, 0), shape=Sphere(radius))
    mechanism.output("x", ball.position[0], units="m")
    if kind == "output":
        mechanism.output("gap", clearance(ball, Sphere(0.2)), units="m")
    elif kind == "requirement":
        mechanism.require("gap", clearance(ball, Sphere(0.2)) >= 0.05)
    else:
        mechanism.output("gap", clearance_over_time(ball, Sphere(0.2), [0, 1]), units="m")
    study = uqmbd.Study("thrown", mechanism, [0, 2], [MonteCarlo(samples=4, seed=1), method])
    text = rf"gap.* contains clearance\(ball, .*not a smooth function.*{method.name}.*'monte-carlo'.*remove 'gap"
    with pytest.raises(uqmbd.StudyError, match=text):
        study.propagate(method)
    assert "not a smooth function" in obstacle_of(method, study)
    with pytest.warns(MethodFailedWarning, match="not a smooth function"):
        tree = study.run()
    assert "monte-carlo" in tree.children and method.name not in tree.children


def test_clearance_over_time_has_closed_forms():
    """A ball passes a sphere, and a small ball flies through a hollow box: inside and on its surface, the gap is 0."""
    mechanism = uqmbd.Mechanism("flight", uqmbd.Translational())
    radius = uqmbd.RandomVariable("radius", chaospy.Uniform(0.1, 0.2), units="m")
    ball = mechanism.body("ball", mass=1, position=(-1, 0), velocity=(1, 0), shape=Sphere(radius))
    times = np.linspace(0, 2, 9)
    other, hollow = Sphere(0.1, position=(0, 0.5, 0)), Mesh(*box((1, 1, 1)))
    mechanism.output("past", clearance_over_time(ball, other, times), units="m")
    mechanism.output("through", clearance_over_time(ball, hollow, times), units="m")
    tree = uqmbd.Study("flight", mechanism, [0, 2], [MonteCarlo(samples=5, seed=1)]).run()
    samples = tree["monte-carlo/scalars/samples"].to_dataset()
    x, radii = times - 1, samples["inputs"].values[:, 0]
    past = np.hypot(x, 0.5)[None, :] - 0.1 - radii[:, None]
    through = np.maximum(abs(x) - 0.5 - radii[:, None], 0)
    for name, expected in (("past", past), ("through", through)):
        names = [f"{name} at {t:.6g} s" for t in times]
        np.testing.assert_allclose(samples["response"].sel(output=names).values, expected, atol=1e-10)
    series = output(tree["monte-carlo"], "past")
    assert series.sizes["instant"] == 9 and series["mean"].values == pytest.approx(past.mean(axis=0), abs=1e-10)


def test_the_smallest_distance_over_time_is_the_clearance():
    """With enough times, the minimum over the series is the clearance; the series never is below it."""
    rod = Capsule(0.05, 2.0, rotation=Rotation.from_euler("y", np.pi / 2).as_matrix())
    mechanism = uqmbd.Mechanism("turning", uqmbd.Planar())
    body = mechanism.body("rod", mass=1, inertia=1, angle=0.8, angular_velocity=-1.0, shape=rod)
    wall, times = Box((0.4, 4, 4), position=(1.4, 0, 0)), np.linspace(0, 2, 101)
    mechanism.output("gap", clearance(body, wall), units="m")
    mechanism.output("gaps", clearance_over_time(body, wall, times), units="m")
    found = uqmbd.simulate(mechanism, [0, 2])
    values = np.array([float(found[f"gaps at {t:.6g} s"]) for t in times])
    np.testing.assert_allclose(values, 1.2 - 0.05 - abs(np.cos(0.8 - times)), atol=1e-9)
    assert 0 <= values.min() - float(found["gap"]) < 1e-3


@pytest.mark.parametrize("times", [[], [1, 0], [0, np.nan], "soon", [0, 0]])
def test_wrong_times_have_a_message(times):
    mechanism = uqmbd.Mechanism("m", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, shape=Sphere(0.1))
    with pytest.raises(uqmbd.StudyError, match=r"clearance_over_time: times is .* expected"):
        clearance_over_time(ball, Sphere(0.1), times)


def test_times_after_the_motion_have_no_value():
    """The reason states the time, and the check of the study states it before a run."""
    mechanism = uqmbd.Mechanism("m", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, velocity=(1, 0), shape=Sphere(0.1))
    mechanism.output("gap", clearance_over_time(ball, Sphere(0.1, position=(0, 1, 0)), [0, 3]), units="m")
    with pytest.raises(uqmbd.AssemblyError, match="the motion does not include the time 3 s"):
        uqmbd.simulate(mechanism, [0, 2])
    (finding,) = ClearanceTimes().find(uqmbd.Study("m", mechanism, [0, 2]))
    assert "is requested at 3 s, but the study simulates 0 to 2 s" in finding.message
    assert not list(ClearanceTimes().find(uqmbd.Study("m", mechanism, [0, 3])))


def test_bodies_without_a_shape_are_refused():
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    body = mechanism.body("bare", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match="body_a is 'bare', which has no shape"):
        clearance(body, Sphere(1))
    with pytest.raises(uqmbd.StudyError, match="body_a is a shape that is fixed to the ground"):
        clearance(Sphere(1), Sphere(1))
