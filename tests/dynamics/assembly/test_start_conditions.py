"""Start conditions: poses and velocities that a user states between bodies, against poses that are known."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Fixed, Prismatic, Revolute, Spherical
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper, TorsionSpringDamper


def pendulum(angle=-np.pi / 2):
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(np.cos(angle) / 2, np.sin(angle) / 2), angle=angle)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    return mechanism, rod


def double_pendulum(**second):
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    a = mechanism.body("a", mass=1, inertia=1 / 12, position=(0.5, 0))
    b = mechanism.body("b", mass=1, inertia=1 / 12, position=(1.5, 0), **second)
    mechanism.add(Revolute("A", mechanism.ground, a, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("B", a, b, (0.5, 0), (-0.5, 0)))
    return mechanism, a, b


def first(mechanism, **options):
    """Outputs at the start."""
    found = uqmbd.simulate(mechanism, [0, 1e-3], check=False, **options)
    return {name: float(found[name][0]) for name in mechanism.outputs}


def test_turns_are_counted_by_what_counts_them():
    mechanism, a, b = double_pendulum()
    spring = mechanism.add(TorsionSpringDamper("spring", a, b, stiffness=2.0))
    wound = 7 * np.pi + 0.2  # three turns and a half
    mechanism.start(a.angle, 0.7)
    mechanism.start(sympy.Eq(b.angle - a.angle, wound))
    mechanism.output("a", a.angle)
    mechanism.output("b", b.angle)
    mechanism.output("moment", spring.reaction_moment)
    found = first(mechanism)
    assert found["a"] == pytest.approx(0.7, abs=1e-12)
    assert found["b"] == pytest.approx(0.7 + wound, abs=1e-11)
    assert found["moment"] == pytest.approx(-2 * wound, abs=1e-10)


def test_motions_of_joints_in_space():
    """A joint's angle over several turns, its displacement, and speeds: against what they mean for points."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    a = mechanism.body("a", mass=1, inertia=(1, 1, 1), quaternion=(1, 0, 0, 0))
    b = mechanism.body("b", mass=1, inertia=(1, 1, 1), position=(1, 0, 0), quaternion=(1, 0, 0, 0))
    hinge = mechanism.add(Revolute("hinge", mechanism.ground, a, at=(0, 0, 0), axis=(0, 0, 1)))
    slide = mechanism.add(Prismatic("slide", a, b, (0, 0, 0), (0, 0, 0), axis_i=(1, 0, 0), axis_j=(1, 0, 0)))
    coil = TorsionSpringDamper("coil", mechanism.ground, a, stiffness=3, axis_i=(0, 0, 1), axis_j=(0, 0, 1))
    mechanism.add(coil)
    turned = -7 * np.pi + 0.4
    mechanism.start(hinge.angle, turned)
    mechanism.start(slide.displacement, 1.7)
    mechanism.start(hinge.speed, 2.0)
    mechanism.start(slide.speed, -0.5)
    mechanism.output("angle", hinge.angle)
    mechanism.output("moment", coil.reaction_moment[2])
    for name, e in zip(("x", "y", "vx", "vy"), (*b.position[:2], *b.velocity[:2]), strict=True):
        mechanism.output(name, e)
    c, s = np.cos(turned), np.sin(turned)
    expected = [turned, -3 * turned, 1.7 * c, 1.7 * s, -0.5 * c - 3.4 * s, -0.5 * s + 3.4 * c]
    np.testing.assert_allclose(list(first(mechanism).values()), expected, atol=1e-9)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.floats(-8, 8), st.floats(-8, 8), st.floats(-3, 3), st.floats(-3, 3))
def test_two_angles_and_two_speeds_are_those_of_a_drawn_pose(angle, relative, speed, relative_speed):
    """The same numbers as random inputs of one compiled mechanism, against the poses that these angles draw."""
    found = TWO.simulate(angle, relative, speed, relative_speed)
    other = angle + relative
    x = np.cos(angle) + np.cos(other)
    rate = -np.sin(angle) * speed - np.sin(other) * (speed + relative_speed)
    np.testing.assert_allclose(found, [angle, other, x, rate], atol=1e-9)


class Two:
    """A double pendulum whose start is a random input."""

    def __init__(self):
        names = ("angle", "relative", "speed", "relative_speed")
        self.inputs = {name: uqmbd.RandomVariable(name, chaospy.Uniform(-8, 8)) for name in names}
        self.mechanism, a, b = double_pendulum()
        self.mechanism.start(a.angle, self.inputs["angle"])
        self.mechanism.start(b.angle - a.angle, self.inputs["relative"])
        self.mechanism.start(a.angular_velocity, self.inputs["speed"])
        self.mechanism.start(b.angular_velocity, a.angular_velocity + self.inputs["relative_speed"])
        for name, e in {"a": a.angle, "b": b.angle, "x": b.point((0.5, 0))[0]}.items():
            self.mechanism.output(name, e)
        self.mechanism.output("rate", b.point_velocity((0.5, 0))[0])

    def simulate(self, *values):
        return list(first(self.mechanism, values=dict(zip(self.inputs, values, strict=True))).values())


TWO = Two()


def four_bar():
    """Ground 4, crank 1, coupler 3, rocker 3, drawn open, the joint of coupler and rocker above."""
    mechanism = uqmbd.Mechanism("four_bar", uqmbd.Planar())
    up = np.sqrt(9 - 1.5**2)
    crank = mechanism.body("crank", mass=1, inertia=1, position=(0, 0))
    coupler = mechanism.body("coupler", mass=1, inertia=1, position=(1, 0), angle=np.arctan2(up, 1.5))
    rocker = mechanism.body("rocker", mass=1, inertia=1, position=(4, 0), angle=np.pi - np.arctan2(up, 1.5))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, coupler, (1, 0), (0, 0)))
    mechanism.add(Revolute("C", coupler, rocker, (3, 0), (3, 0)))
    mechanism.add(Revolute("D", mechanism.ground, rocker, (4, 0), (0, 0)))
    return mechanism, crank, coupler, rocker


@pytest.mark.parametrize("angle", [1.0, -2.5, 9.0])
def test_a_loop_keeps_its_branch_on_the_way(angle):
    mechanism, crank, coupler, _ = four_bar()
    mechanism.start(crank.angle, angle)
    mechanism.output("crank", crank.angle)
    mechanism.output("x", coupler.point((3, 0))[0])
    mechanism.output("y", coupler.point((3, 0))[1])
    found = first(mechanism)
    pin = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([4, 0]) - pin
    half = np.linalg.norm(across) / 2
    normal = np.array([-across[1], across[0]]) / (2 * half)
    joint = pin + across / 2 + np.sqrt(9 - half**2) * normal  # above the line from pin to pivot: as drawn
    np.testing.assert_allclose([found["crank"], found["x"], found["y"]], [angle, *joint], atol=1e-10)


def test_the_angle_of_a_driven_output_link_finds_the_crank():
    mechanism, crank, _, rocker = four_bar()
    mechanism.start(rocker.angle, 2.3)
    mechanism.output("rocker", rocker.angle)
    mechanism.output("gap", (rocker.point((3, 0)) - crank.point((1, 0))).norm())
    found = first(mechanism)
    assert found["rocker"] == pytest.approx(2.3, abs=1e-11)
    assert found["gap"] == pytest.approx(3, abs=1e-11)


def test_what_is_left_open_moves_as_little_as_possible():
    mechanism = uqmbd.Mechanism("two", uqmbd.Translational())
    a, b = mechanism.body("a", mass=1, position=(0, 1)), mechanism.body("b", mass=1, position=(1, 5))
    mechanism.add(SpringDamper("spring", a, b, (0, 0), (0, 0), stiffness=1, free_length=1))
    mechanism.start(b.position[0] - a.position[0], 3)
    for name, e in zip(("ax", "ay", "bx", "by"), (*a.position, *b.position), strict=True):
        mechanism.output(name, e)
    np.testing.assert_allclose(list(first(mechanism).values()), [-1, 1, 2, 5], atol=1e-12)


def test_points_and_speeds_in_space():
    mechanism = uqmbd.Mechanism("spatial", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=(1, 1, 1), position=(1, 0, 0), quaternion=(1, 0, 0, 0))
    mechanism.add(Spherical("ball", mechanism.ground, rod, (0, 0, 0), (-1, 0, 0)))
    tip = (1.0, 0, 0)
    mechanism.start(rod.point(tip)[2], -1.2)
    mechanism.start(rod.point(tip)[1], 0.5)
    mechanism.start(rod.point_velocity(tip)[1], 0.3)
    mechanism.start(rod.angular_velocity.dot(rod.direction((1, 0, 0))), 4.0)
    for name, e in zip("xyz", rod.point(tip), strict=True):
        mechanism.output(name, e)
    mechanism.output("spin", rod.angular_velocity.dot(rod.direction((1, 0, 0))))
    mechanism.output("rate", rod.point_velocity(tip)[1])
    expected = [np.sqrt(4 - 1.2**2 - 0.5**2), 0.5, -1.2, 4.0, 0.3]
    np.testing.assert_allclose(list(first(mechanism).values()), expected, atol=1e-10)


def motion(amplitude, times, omega):
    """Angle of a pendulum released at rest, from below, by Jacobi's elliptic functions."""
    k = np.sin(amplitude / 2)
    sn, _, dn, _ = ellipj(ellipk(k**2) - omega * times, k**2)
    return 2 * np.arcsin(k * sn)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_random_start_angle_in_all_propagators(integrator):
    """Mean and deviation of a pendulum's angle whose start is random, against quadrature of the closed form."""
    mechanism, rod = pendulum()
    amplitude = uqmbd.RandomVariable("amplitude", chaospy.Uniform(0.5, 0.9), units="rad")
    mechanism.start(rod.angle, amplitude - sympy.pi / 2)
    times = np.linspace(0, 1.5, 16)
    methods = [Collocation(order=6), Galerkin(order=6), MonteCarlo(samples=200, seed=2)]
    study = uqmbd.Study("swing", mechanism, times=times, propagators=methods, integrator=integrator, rtol=1e-9)
    tree = study.run()
    omega = np.sqrt(9.81 * 0.5 / (1 / 12 + 0.25))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angles = np.array([motion(0.7 + 0.2 * x, times, omega) for x in nodes]) - np.pi / 2
    mean = weights @ angles / 2
    std = np.sqrt(weights @ (angles - mean) ** 2 / 2)
    for label in ("collocation", "galerkin"):
        found = tree[f"{label}/statistics"].sel(output="angle")
        np.testing.assert_allclose(found["mean"], mean, atol=2e-6)
        np.testing.assert_allclose(found["std"], std, atol=5e-6)
    samples = tree["monte-carlo/samples"]
    drawn = samples["inputs"].sel(input="amplitude").values
    expected = np.array([motion(x, times, omega) for x in drawn]) - np.pi / 2
    np.testing.assert_allclose(samples["response"].sel(output="angle"), expected, atol=1e-6)


def test_velocities_may_stay_with_a_start_in_equilibrium():
    mechanism, rod = pendulum()
    mechanism.start(rod.angular_velocity, 2.5)
    mechanism.output("speed", rod.angular_velocity)
    found = first(mechanism, start="equilibrium")
    assert found["speed"] == pytest.approx(2.5)
    assert found["angle"] == pytest.approx(-np.pi / 2)


def test_positions_may_not():
    mechanism, rod = pendulum()
    mechanism.start(rod.angle, 0.0)
    with pytest.raises(uqmbd.StudyError, match=r"rod.angle = 0.0 and start='equilibrium' both define"):
        uqmbd.simulate(mechanism, [0, 1], start="equilibrium")


def test_out_of_reach_is_named_with_what_is_left():
    mechanism, rod = pendulum(0.1)
    mechanism.start(rod.point((0.5, 0))[1], 1.5)
    with pytest.raises(
        uqmbd.AssemblyError, match="condition .* = 1.5 is not met: its left side minus its right side is -"
    ):
        uqmbd.check(mechanism)


def test_a_pose_from_which_two_ways_lead_is_not_chosen_for_the_user():
    """From below a pendulum reaches a height to the left and to the right."""
    mechanism, rod = pendulum()
    mechanism.start(rod.point((0.5, 0))[1], -0.5)
    with pytest.raises(
        uqmbd.AssemblyError, match=r"No motion that the joints and drivers allow changes this quantity in that pose"
    ):
        uqmbd.check(mechanism)


def test_what_a_driver_holds_elsewhere_is_refused():
    mechanism, rod = pendulum()
    mechanism.add(RotationDriver("drive", mechanism.ground, rod, angle=2 * uqmbd.t - 1))
    mechanism.start(rod.angle, 0.3)
    with pytest.raises(uqmbd.AssemblyError, match=r"condition rod.angle = 0.3 is not met: .*is -1.3.*driver 'drive'"):
        uqmbd.check(mechanism)


def test_a_speed_against_a_driver_is_refused():
    mechanism, rod = pendulum()
    mechanism.add(RotationDriver("drive", mechanism.ground, rod, angle=2 * uqmbd.t - 1.5))
    mechanism.start(rod.angular_velocity, 3)
    with pytest.raises(
        uqmbd.AssemblyError, match=r"start condition rod.angular_velocity = 3 contradicts .*'drive: ang"
    ):
        uqmbd.check(mechanism)


@pytest.mark.parametrize("speed", [False, True])
def test_what_holds_already_is_refused(speed):
    mechanism, rod = pendulum()
    mechanism.add(RotationDriver("drive", mechanism.ground, rod, angle=2 * uqmbd.t - 1.5))
    mechanism.start(rod.angular_velocity if speed else rod.angle, 2 if speed else -1.5)
    with pytest.raises(uqmbd.StudyError, match=r"start condition rod.*= .* is redundant"):
        uqmbd.check(mechanism)


def test_conditions_that_say_the_same_or_the_opposite_are_refused():
    mechanism, a, b = double_pendulum()
    mechanism.start(a.angle, 0.3)
    mechanism.start(b.angle, 0.5)
    mechanism.start(2 * b.angle - 2 * a.angle, 0.4)
    with pytest.raises(uqmbd.StudyError, match=r"2\*a.angle \+ 2\*b.angle = 0.4 is redundant"):
        uqmbd.check(mechanism)
    mechanism, a, b = double_pendulum()
    mechanism.start(a.angle, 0.3)
    mechanism.start(a.point((0.5, 0))[1], 0.9)
    with pytest.raises(uqmbd.AssemblyError, match="is not met.*or contradicts the start condition"):
        uqmbd.check(mechanism)


def test_a_realisation_that_cannot_start_has_failed_and_says_why():
    mechanism, rod = pendulum(0.0)
    height = uqmbd.RandomVariable("height", chaospy.Uniform(-0.8, 1.2), units="m")
    mechanism.start(rod.point((0.5, 0))[1], height)
    study = uqmbd.Study("s", mechanism, times=[0, 0.1], propagators=[MonteCarlo(samples=40, seed=1)])
    with pytest.warns(
        UserWarning, match="start condition .* = height is not met: its left side minus its right side is -0"
    ):
        node = study.propagate(study.propagators[0])
    status, drawn = node["samples/status"].values, node["samples/inputs"].values[:, 0]
    np.testing.assert_array_equal(status != 0, drawn > 1)


def test_held_bodies_stay():
    mechanism = uqmbd.Mechanism("rails", uqmbd.Planar())
    a = mechanism.body("a", mass=1, inertia=1, position=(0, 0), hold=True)
    b = mechanism.body("b", mass=1, inertia=1, position=(1, 0))
    mechanism.add(Prismatic("slide", mechanism.ground, a, (0, 0), (0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(Prismatic("slide_b", mechanism.ground, b, (0, 0), (0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.start(b.position[0] - a.position[0], 3)
    mechanism.output("a", a.position[0])
    mechanism.output("b", b.position[0])
    np.testing.assert_allclose(list(first(mechanism).values()), [0, 3], atol=1e-12)


def test_a_condition_that_draws_nothing_else_changes_nothing():
    """Conditions that the given pose meets leave the motion as it was, to rounding."""
    found = []
    for stated in (False, True):
        mechanism, a, b = double_pendulum()
        if stated:
            mechanism.start(a.angle, 0)
            mechanism.start(b.angle - a.angle, 0)
        mechanism.output("y", b.point((0.5, 0))[1])
        found.append(uqmbd.simulate(mechanism, np.linspace(0, 1, 5), rtol=1e-9)["y"].values)
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)


def test_fixed_parts_have_nothing_to_choose():
    mechanism = uqmbd.Mechanism("wall", uqmbd.Planar())
    part = mechanism.body("part", mass=1, inertia=1)
    mechanism.add(Fixed("weld", mechanism.ground, part, (0, 0), (0, 0)))
    mechanism.start(part.angle, 0.1)
    with pytest.raises(uqmbd.AssemblyError, match="is not met"):
        uqmbd.check(mechanism)


def wound(space, angle, stated=None, drawn=0.0):
    """A body that a driver turns, on a torsion spring."""
    mechanism = uqmbd.Mechanism("wound", space)
    flat = space.dimension == 2
    up = {} if flat else {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    pose = {"angle": drawn} if flat else {"quaternion": (1, 0, 0, 0)}
    origin = (0,) * space.dimension
    body = mechanism.body("body", mass=1, inertia=1 if flat else (1, 1, 1), **pose)
    hinge = mechanism.add(Revolute("hinge", mechanism.ground, body, origin, origin, **up))
    mechanism.add(RotationDriver("drive", mechanism.ground, body, angle=angle, **up))
    spring = mechanism.add(TorsionSpringDamper("spring", mechanism.ground, body, stiffness=1, **up))
    if stated is not None:
        mechanism.start(hinge.angle, stated)
    mechanism.output("angle", hinge.angle, units="rad")
    mechanism.output("moment", spring.reaction_moment if flat else spring.reaction_moment[2], units="N m")
    return mechanism


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*assembly moved")
@pytest.mark.parametrize("space", [uqmbd.Planar(), uqmbd.Spatial()], ids=["plane", "space"])
def test_turns_that_a_driver_hides_are_reported_and_may_be_stated(space):
    with pytest.warns(
        uqmbd.StudyWarning, match=r"driver 'drive' starts at 7 rad, more than half a turn from .*, 0 rad"
    ):
        found = uqmbd.simulate(wound(space, 7 + uqmbd.t), [0, 1e-3], check=False)
    assert float(found["angle"][0]) == pytest.approx(7 - 2 * np.pi)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*half a turn")
        for value in (7, 4 * np.pi, -20.5):
            found = first(wound(space, value + uqmbd.t, value))
            assert found["angle"] == pytest.approx(value, abs=1e-9)
            assert found["moment"] == pytest.approx(-value, abs=1e-9)
        if space.dimension == 2:
            assert first(wound(space, 7 + uqmbd.t, drawn=6.5))["angle"] == pytest.approx(7)
        assert first(wound(space, 3 + uqmbd.t))["angle"] == pytest.approx(3)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*assembly moved")
def test_a_random_angle_of_a_driver_beyond_half_a_turn():
    """Uniform from 2.5 to 4: mean 3.25 and deviation 1.5 / sqrt(12), by all methods, where the turns are stated."""
    angle = uqmbd.RandomVariable("angle", chaospy.Uniform(2.5, 4), units="rad")
    methods = [Collocation(order=3), Galerkin(order=3), MonteCarlo(samples=64, seed=1, sampling="sobol")]
    with pytest.warns(uqmbd.StudyWarning, match=r"driver 'drive' starts at 3.*in 57 % of the realisations"):
        uqmbd.simulate(wound(uqmbd.Planar(), angle + uqmbd.t), [0, 1e-3], check=False)
    tree = uqmbd.Study("s", wound(uqmbd.Planar(), angle + uqmbd.t, angle), times=[0, 0.1], propagators=methods).run()
    for label in ("collocation", "galerkin"):
        found = tree[f"{label}/statistics"].sel(output="angle")
        np.testing.assert_allclose(found["mean"], [3.25, 3.35], atol=1e-5)
        np.testing.assert_allclose(found["std"], 1.5 / np.sqrt(12), atol=1e-5)
    samples = tree["monte-carlo/samples"]
    np.testing.assert_allclose(samples["response"].sel(output="angle")[:, 0], samples["inputs"][:, 0], atol=1e-9)
