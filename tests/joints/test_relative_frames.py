"""Every joint, driver and torsion spring between frames at random angles, many of them close to zero and to half a turn.

What is stated is consistent with the given poses: assembly must not move a body, and no digit of an angle may be lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import chaospy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import uqmbd
import uqmbd_drivers
import uqmbd_joints
from uqmbd.dynamics.assembly import positions
from uqmbd.dynamics.model_building import kinematic_model
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import NonlinearTorsionSpringDamper, TorsionSpringDamper, length

CONSTRAINING = {
    kind.__name__: kind
    for kind in (*uqmbd_joints.uqmbd_components(), *uqmbd_drivers.uqmbd_components())
    if uqmbd.Spatial in kind.spaces
}

TWO_WAYS = [x for x in CONSTRAINING if {"at", "axis"} & set(CONSTRAINING[x].drawn_by) and x not in ("Dot1", "Skate")]


def unit(random):
    vector = random.standard_normal(3)
    return vector / np.linalg.norm(vector)


def across(random, axis):
    """A random unit vector perpendicular to another one."""
    vector = np.cross(axis, unit(random))
    return vector / np.linalg.norm(vector)


@dataclass(frozen=True)
class Pair:
    """Two frames as drawn, a place and an axis in the world that are common to both, and vectors across it."""

    positions: tuple[Any, Any]
    frames: tuple[Rotation, Rotation]
    place: Any
    axis: Any
    across: Any

    def point(self, k, world):
        return tuple(map(float, self.frames[k].inv().apply(world - self.positions[k])))

    def direction(self, k, world):
        return tuple(map(float, self.frames[k].inv().apply(world)))


def random_pair(random, number):
    """One in three at any angle; the others within 1e-9 to 1e-3 of zero or half a turn, about any axis."""
    first, axis = Rotation.random(random_state=random), unit(random)
    small = 10 ** random.uniform(-9, -3) * random.choice([-1, 1])
    angle = [random.uniform(-3, 3), small, np.pi - small][number % 3]
    about = [across(random, axis), axis, unit(random)][number // 3 % 3]  # the axis is kept: nearly, or turned over
    second = Rotation.from_rotvec(about * angle) * first
    places = random.uniform(-1, 1, (3, 3))
    return Pair((places[0], places[1]), (first, second), places[2], axis, across(random, axis))


def stated(name: str, pair: Pair, way: str, random: Any) -> dict[str, Any]:
    """Arguments of a component that hold in the given poses, in the frames of the bodies or in the world."""
    p, axis = pair, pair.axis
    points = {"point_i": p.point(0, p.place), "point_j": p.point(1, p.place)}
    axes = {"axis_i": p.direction(0, axis), "axis_j": p.direction(1, axis)}
    world_point, world_axis = {"at": tuple(p.place)}, {"axis": tuple(axis)}
    at = points if way == "bodies" else world_point
    along = axes if way == "bodies" else world_axis
    first = {"axis_i": axes["axis_i"]} if way == "bodies" else world_axis
    slid = random.uniform(0.2, 1)
    apart = {"point_i": p.point(0, p.place), "point_j": p.point(1, p.place + slid * axis)}
    on_plane = {"point_i": p.point(0, p.place), "point_j": p.point(1, p.place + slid * p.across)}
    lean = random.uniform(-1, 1)
    wheel = p.across * np.cos(lean) + axis * np.sin(lean)
    height = 0.3 * np.linalg.norm(np.cross(axis, wheel))
    match name:
        case "Revolute":
            return {**at, **along}
        case "Spherical":
            return at
        case "Fixed":
            turn = (p.frames[0].inv() * p.frames[1]).as_quat(scalar_first=True)
            return {**at, "rotation": tuple(map(float, turn))} if random.random() < 0.5 else at
        case "Universal":
            return {**at, "axis_i": axes["axis_i"], "axis_j": p.direction(1, p.across)}
        case "Cylindrical" | "Prismatic":
            return {**(apart if way == "bodies" else world_point), **along}
        case "Screw":
            return {**(apart if way == "bodies" else world_point), **along, "pitch": 0.3}
        case "Parallel1":
            return along
        case "Parallel2" | "PointOnLine":
            return {**(apart if way == "bodies" else world_point), **first}
        case "Dot2" | "PointOnPlane":
            return {**(on_plane if way == "bodies" else world_point), **first}
        case "Dot1":
            return {"axis_i": axes["axis_i"], "axis_j": p.direction(1, p.across)}
        case "Distance" | "DistanceDriver":
            return {**apart, "length": slid}
        case "RevoluteSpherical":
            return {**on_plane, **first, "length": slid}
        case "RackAndPinion":
            return {**(on_plane if way == "bodies" else world_point), **axes, "radius": 0.2}
        case "Gear":
            return {**along, "ratio": 2.0}
        case "RollingWheel":
            centre = p.place + slid * p.across + height * axis
            ends = {"point_i": p.point(0, p.place), "point_j": p.point(1, centre)}
            return {**ends, "normal_i": axes["axis_i"], "axis_j": p.direction(1, wheel), "radius": 0.3}
        case "RollingSphere":
            return {**apart, "normal_i": axes["axis_i"], "radius": slid}
        case "Skate":
            return {"point_j": points["point_j"], "axis_j": p.direction(1, p.across), "normal_i": axes["axis_i"]}
        case "PositionDriver":
            return {**(apart if way == "bodies" else world_point), **first, "displacement": slid * (way == "bodies")}
        case "LinearSpeedDriver":
            return {**(apart if way == "bodies" else world_point), **first, "speed": 0.5}
        case "SpeedDriver":
            return {"speed": 0.5, **({"axis_j": axes["axis_j"]} if way == "bodies" else world_axis)}
    raise KeyError(f"state {name}: every joint and driver in space is to be tried here")


def drawn(mechanism, name, pair):
    """Two bodies in the given poses."""
    return [
        mechanism.body(
            f"{name}{end}",
            mass=1,
            inertia=(1, 1, 1),
            position=tuple(pair.positions[k]),
            quaternion=tuple(pair.frames[k].as_quat(scalar_first=True)),
        )
        for k, end in enumerate("ij")
    ]


def moved(mechanism):
    """Largest change of a coordinate in assembly, and the largest residual of an equation as drawn."""
    model = kinematic_model(mechanism)
    parameters = model.parameters(mechanism.inputs.means[None, :])
    before = parameters[:, model.drawn]
    after, messages = positions(model, before, 0.0, parameters, model.layout.independent_holonomic)
    assert messages == [""]
    arguments = np.concatenate([before, np.zeros((1, model.layout.states + before.shape[1] + 2))], axis=1)
    residual = model.evaluate("position", arguments, parameters)["phi"]
    return float(np.abs(after - before).max()), float(np.abs(residual).max(initial=0.0))


def require_drawn_poses(name, way, seed, count):
    random = np.random.default_rng(seed)
    mechanism = uqmbd.Mechanism("pairs", uqmbd.Spatial())
    for k in range(count):
        pair = random_pair(random, k)
        i, j = drawn(mechanism, f"b{k}", pair)
        if name == "RotationDriver":  # from the zero of a hinge on the same axis
            arguments = stated("Parallel1", pair, way, random)
            hinge = mechanism.add(Revolute(f"h{k}", i, j, **stated("Revolute", pair, way, random)))
            arguments["angle"] = hinge.joint_angle().near
        else:
            arguments = stated(name, pair, way, random)
        mechanism.add(CONSTRAINING[name](f"c{k}", i, j, **arguments))
    move, residual = moved(mechanism)
    assert move <= 1e-14 and residual <= 1e-14, (move, residual)


@pytest.mark.parametrize("name", ["Revolute", "Prismatic"])
def test_drawn_poses_of_hinges_and_slides_are_kept(name):
    require_drawn_poses(name, "bodies", seed=1, count=9)


@pytest.mark.thorough
@pytest.mark.parametrize("name", CONSTRAINING)
def test_consistent_drawn_poses_are_kept(name):
    require_drawn_poses(name, "bodies", seed=2, count=18)


@pytest.mark.thorough
@pytest.mark.parametrize("name", TWO_WAYS)
def test_consistent_drawn_poses_are_kept_of_what_is_given_in_the_world(name):
    require_drawn_poses(name, "world", seed=3, count=18)


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSTRAINING)
def test_many_consistent_drawn_poses_are_kept(name):
    for seed in range(10, 15):
        require_drawn_poses(name, "bodies", seed, count=45)
        if name in TWO_WAYS:
            require_drawn_poses(name, "world", seed, count=45)


@pytest.mark.slow
def test_torsion_springs_count_the_angle_of_a_hinge():
    """The moment of a spring of 1 N m/rad, linear and by a law, is minus the angle of a hinge on the same axis."""
    random = np.random.default_rng(4)
    mechanism = uqmbd.Mechanism("springs", uqmbd.Spatial())
    number = 18
    for k in range(number):
        pair = random_pair(random, k)
        i, j = drawn(mechanism, f"b{k}", pair)
        hinge = mechanism.add(Revolute(f"h{k}", i, j, **stated("Revolute", pair, "bodies", random)))
        axes = stated("Parallel1", pair, "bodies", random)
        springs = (
            TorsionSpringDamper(f"s{k}", i, j, stiffness=1, **axes),
            NonlinearTorsionSpringDamper(f"n{k}", i, j, law=length, **axes),
        )
        mechanism.output(f"angle{k}", hinge.angle, units="rad")
        for spring in map(mechanism.add, springs):
            moment = spring.reaction_moment.dot(i.direction(hinge.values["axis_i"]))
            mechanism.output(f"{spring.name} moment", moment, units="N m")
    found = uqmbd.simulate(mechanism, [0, 1e-6], check=False).isel(time=0)
    for k in range(number):
        for name in "sn":
            assert float(found[f"{name}{k} moment"]) == pytest.approx(-float(found[f"angle{k}"]), abs=1e-14)


@pytest.mark.thorough
@pytest.mark.parametrize("joint", [Revolute, Prismatic, CONSTRAINING["Cylindrical"], CONSTRAINING["Parallel1"]])
def test_a_body_is_turned_to_the_stated_axes(joint):
    """The body is drawn off by a thousandth: assembly turns its axis to the stated one, however near to half a turn."""
    random = np.random.default_rng(5)
    mechanism = uqmbd.Mechanism("turned", uqmbd.Spatial())
    wanted = {}
    for k, small in enumerate(10.0 ** np.arange(-9, -2)):
        axis_j = unit(random)
        axis_i = Rotation.from_rotvec((np.pi - small) * across(random, axis_j)).apply(axis_j)
        turn = Rotation.from_rotvec(1e-3 * unit(random)) * Rotation.align_vectors([axis_i], [axis_j])[0]
        body = mechanism.body(f"b{k}", mass=1, inertia=(1, 1, 1), quaternion=tuple(turn.as_quat(scalar_first=True)))
        points = {} if joint is CONSTRAINING["Parallel1"] else {"point_i": (0, 0, 0), "point_j": (0, 0, 0)}
        mechanism.add(joint(f"j{k}", mechanism.ground, body, **points, axis_i=tuple(axis_i), axis_j=tuple(axis_j)))
        for x, value in zip("xyz", body.direction(tuple(axis_j)), strict=True):
            mechanism.output(f"b{k}{x}", value, units="1")
        wanted[k] = axis_i
    found = uqmbd.simulate(mechanism, [0, 1e-6], check=False).isel(time=0)
    for k, axis in wanted.items():
        np.testing.assert_allclose([float(found[f"b{k}{x}"]) for x in "xyz"], axis, rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("joint", [Revolute, Prismatic, CONSTRAINING["Cylindrical"], CONSTRAINING["Parallel1"]])
def test_random_axes_are_parallel_in_each_realisation(joint):
    """Axes that are parallel at the means: drawn at any angle, or within 1e-9 to 1e-3 of zero and of half a turn."""
    random = np.random.default_rng(6)
    tilts = [uqmbd.RandomVariable(name, chaospy.Normal(0, 0.01)) for name in "ab"]
    mechanism = uqmbd.Mechanism("random", uqmbd.Spatial())
    axes = []
    for k in range(6):
        pair = random_pair(random, k)
        turn = pair.frames[1]
        body = mechanism.body(f"b{k}", mass=1, inertia=(1, 1, 1), quaternion=tuple(turn.as_quat(scalar_first=True)))
        shifts = random.uniform(-1, 1, (3, 2))
        axis_i = [
            float(x) + float(s[0]) * tilts[0] + float(s[1]) * tilts[1] for x, s in zip(pair.axis, shifts, strict=True)
        ]
        axis_j = pair.direction(1, pair.axis)
        points = {} if joint is CONSTRAINING["Parallel1"] else {"point_i": (0, 0, 0), "point_j": (0, 0, 0)}
        mechanism.add(joint(f"j{k}", mechanism.ground, body, **points, axis_i=tuple(axis_i), axis_j=axis_j))
        axes.append((pair.axis, shifts, axis_j))
    model = kinematic_model(mechanism)
    rows = random.standard_normal((16, 2)) * 0.01
    parameters = model.parameters(rows)
    found, messages = positions(model, parameters[:, model.drawn], 0.0, parameters, model.layout.independent_holonomic)
    assert not any(messages)
    for k, (axis, shifts, axis_j) in enumerate(axes):
        wanted = axis + rows @ shifts.T
        wanted /= np.linalg.norm(wanted, axis=1)[:, None]
        turned = Rotation.from_quat(found[:, 7 * k + 3 : 7 * k + 7], scalar_first=True).apply(axis_j)
        np.testing.assert_allclose(turned, wanted, rtol=0, atol=1e-11)
