"""Static equilibrium: closed forms, the least energy by another route, states that follow the pose, and failures."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from scipy.optimize import brentq, minimize_scalar

import uqmbd
from uqmbd.dynamics import Ensemble, build, static_equilibria
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute, Spherical
from uqmbd_springs import Bushing, PointForce, SpringDamper, Torque, TorsionSpringDamper

G = 9.81
SPACES = {
    "translational": (uqmbd.Translational(gravity=(0, -G)), {}),
    "planar": (uqmbd.Planar(gravity=(0, -G)), {"inertia": 0.1}),
    "spatial": (uqmbd.Spatial(gravity=(0, -G, 0)), {"inertia": (0.1, 0.2, 0.3)}),
}


def pendulum(angle, mass=1.0, arm=0.5, inertia=0.1):
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    place = (arm * sympy.cos(angle), arm * sympy.sin(angle))
    rod = mechanism.body("rod", mass=mass, inertia=inertia, position=place, angle=angle)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-arm, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    return mechanism, rod


@pytest.mark.parametrize("kind", SPACES)
@pytest.mark.parametrize("height", [-1.5, -0.1, 40.0])
def test_a_mass_hangs_where_the_spring_carries_it(kind, height):
    """y = -(l0 + m g / k), from below, from a pose under compression, and (through the anchor) from high above."""
    space, more = SPACES[kind]
    mechanism = uqmbd.Mechanism("scale", space)
    zero = (0,) * (space.dimension - 1)
    body = mechanism.body("mass", mass=2, position=(0.01, height, *zero[1:]), **more)
    spring = SpringDamper("spring", mechanism.ground, body, (0, 0, *zero[1:]), (0, 0, *zero[1:]), 100, free_length=1)
    mechanism.add(spring)
    mechanism.output("x", body.position[0])
    mechanism.output("y", body.position[1])
    mechanism.output("pull", spring.reaction_force[1])
    mechanism.output("speed", body.velocity[1])
    mechanism.output("acceleration", body.acceleration[1])
    found = uqmbd.static_equilibrium(mechanism)
    assert found.y == pytest.approx(-1 - 2 * G / 100, abs=1e-9)
    assert found.x == pytest.approx(0, abs=1e-9)
    assert found.pull == pytest.approx(2 * G, abs=1e-7)
    assert float(found.speed) == 0 and abs(float(found.acceleration)) < 1e-8
    assert found.attrs["stable"] == 1


@pytest.mark.parametrize("angle", [0.0, 1.2, np.pi / 2 - 1e-3, np.pi + 0.3, 5 * np.pi])
def test_a_pendulum_comes_to_hang_on_the_turn_on_which_it_was_drawn(angle):
    """Also from horizontal, where its stiffness vanishes, and from near the unstable equilibrium."""
    mechanism, _ = pendulum(angle)
    lowest = -np.pi / 2 + 2 * np.pi * np.round((angle + np.pi / 2) / (2 * np.pi))
    assert uqmbd.static_equilibrium(mechanism)["angle"] == pytest.approx(lowest, abs=1e-9)


def test_a_pose_in_exact_but_unstable_balance_stays():
    """Upright: the forces balance, and the result says that it is unstable."""
    mechanism = uqmbd.Mechanism("upright", uqmbd.Planar(gravity=(0, -G)))
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0, 0.5))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (0, -0.5)))
    mechanism.output("angle", rod.angle, units="rad")
    found = uqmbd.static_equilibrium(mechanism)
    assert abs(float(found["angle"])) < 1e-12 and found.attrs["stable"] == 0


def test_a_balanced_pose_is_left_alone():
    """Do no harm: less than 1e-12."""
    mechanism, _ = pendulum(-np.pi / 2)
    assert uqmbd.static_equilibrium(mechanism)["angle"] == pytest.approx(-np.pi / 2, abs=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("free", [0.4, 15.0, -21.0])
@pytest.mark.parametrize("spatial", [False, True])
def test_a_torsion_spring_counts_the_turns_on_the_way(free, spatial):
    """k (angle - free) + m g a cos(angle) = 0, with an angle of more than two turns."""
    k, arm = 2.0, 0.5
    axes = {}
    if spatial:
        mechanism = uqmbd.Mechanism("wound", uqmbd.Spatial(gravity=(0, 0, -G)))
        rod = mechanism.body("rod", mass=1, inertia=(0.1, 0.1, 0.1), position=(arm, 0, 0))
        axes = {"axis_i": (0, -1, 0), "axis_j": (0, -1, 0)}
        mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0, 0), (-arm, 0, 0), **axes))
    else:
        mechanism, rod = pendulum(0.0, arm=arm)
    spring = TorsionSpringDamper("spring", mechanism.ground, rod, stiffness=k, damping=0.3, free_angle=free, **axes)
    mechanism.add(spring)
    moment = -spring.reaction_moment[1] if spatial else spring.reaction_moment
    mechanism.output("moment", moment, units="N m")
    mechanism.output("height", rod.position[-1])
    ensemble = Ensemble(build(mechanism), mechanism.inputs.means[None, :])
    found = static_equilibria(ensemble)
    angle = float(found.s[0, -1])
    assert k * (angle - free) + G * arm * np.cos(angle) == pytest.approx(0, abs=1e-8)
    result = uqmbd.static_equilibrium(mechanism)
    assert result["moment"] == pytest.approx(k * (free - angle), abs=1e-8)
    assert result["height"] == pytest.approx(arm * np.sin(angle), abs=1e-9)


def slider_crank(k, free, at=(0.0, 0.0), turn=0.0):
    """A slider-crank that is drawn at 0.6 rad, held by a spring at the slider; moved rigidly in the plane."""
    r, length, angle = 0.15, 0.35, 0.6
    beta = -np.arcsin(r * np.sin(angle) / length)
    cos, sin = np.cos(turn), np.sin(turn)

    def world(x, y):
        return at[0] + cos * x - sin * y, at[1] + sin * x + cos * y

    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(G * sin, -G * cos)))
    crank = mechanism.body(
        "crank", 2, 0.01, position=world(r / 2 * np.cos(angle), r / 2 * np.sin(angle)), angle=angle + turn
    )
    middle = world(r * np.cos(angle) + length / 2 * np.cos(beta), r * np.sin(angle) + length / 2 * np.sin(beta))
    rod = mechanism.body("rod", 1, 0.02, position=middle, angle=beta + turn)
    slider = mechanism.body(
        "slider", 0.5, 0.01, position=world(r * np.cos(angle) + length * np.cos(beta), 0), angle=turn
    )
    ground = mechanism.ground
    mechanism.add(Revolute("A", ground, crank, world(0, 0), (-r / 2, 0)))
    mechanism.add(Revolute("B", crank, rod, (r / 2, 0), (-length / 2, 0)))
    mechanism.add(Revolute("C", rod, slider, (length / 2, 0), (0, 0)))
    mechanism.add(Prismatic("D", ground, slider, world(0, 0), (0, 0), (cos, sin), (1, 0)))
    mechanism.add(SpringDamper("spring", ground, slider, world(1, 0), (0, 0), k, damping=3, free_length=free))
    mechanism.output("angle", crank.angle, units="rad")
    x, y = slider.position
    mechanism.output("x", cos * (x - at[0]) + sin * (y - at[1]), units="m")
    return mechanism


def slider_energy(angle, k, free, r=0.15, length=0.35):
    """Potential energy of the slider-crank over its crank angle."""
    x = r * np.cos(angle) + np.sqrt(length**2 - (r * np.sin(angle)) ** 2)
    return G * (2 * 0.5 * r + 1 * 0.5 * r) * np.sin(angle) + k / 2 * (1 - x - free) ** 2


@pytest.mark.thorough
def test_a_slider_crank_rests_where_its_energy_is_least():
    """Random stiffness, many realisations at once, against a minimisation of the energy over the crank angle."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(50, 150), units="N/m")
    free = uqmbd.RandomVariable("free", chaospy.Uniform(0.55, 0.65), units="m")
    mechanism = slider_crank(stiffness, free)
    values = np.array([[f, k] for f in (0.55, 0.6, 0.65) for k in (50.0, 100.0, 150.0)])
    ensemble = Ensemble(build(mechanism), values)
    found = static_equilibria(ensemble)
    assert not any(found.messages) and found.stable.all()
    angles = 2 * np.arctan2(found.q[:, 3], found.q[:, 2])
    for angle, (f, k) in zip(angles, values, strict=True):
        lowest = minimize_scalar(
            slider_energy, bracket=(angle - 0.3, angle, angle + 0.3), args=(k, f), options={"xtol": 1e-12}
        )
        assert angle == pytest.approx(lowest.x, abs=1e-7)
    # alone and together are the same
    alone = static_equilibria(Ensemble(ensemble.model, values[4:5]))
    np.testing.assert_allclose(alone.q[0], found.q[4], rtol=0, atol=1e-13)


@pytest.mark.thorough
def test_equilibrium_does_not_depend_on_where_the_mechanism_stands():
    """Moved by metres and turned by 1.1 rad, gravity with it."""
    here = uqmbd.static_equilibrium(slider_crank(100, 0.6))
    there = uqmbd.static_equilibrium(slider_crank(100, 0.6, at=(3.0, -2.0), turn=1.1))
    assert there["x"] == pytest.approx(float(here["x"]), abs=1e-9)
    assert there["angle"] == pytest.approx(float(here["angle"]) + 1.1, abs=1e-8)


def test_a_force_without_potential_holds_a_pendulum_aside():
    """Horizontal force F at the centre of mass: tan(angle from below) = F / (m g)."""
    mechanism, rod = pendulum(-1.0)
    mechanism.add(PointForce("push", rod, (0, 0), (4.0, 0.0)))
    assert uqmbd.static_equilibrium(mechanism)["angle"] == pytest.approx(np.arctan2(-G, 4), abs=1e-9)


def test_a_bushing_gives_way_as_its_stiffness_says():
    """Displacement F / k and, for a small moment, rotation M / k; 2 sin cos of the half angle is the strain."""
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial())
    body = mechanism.body("engine", mass=10, inertia=(1, 1, 1))
    mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0, 0, 0), (1e5, 2e5, 4e5, 800, 900, 1000)))
    mechanism.add(PointForce("load", body, (0, 0, 0), (50, -60, 80)))
    mechanism.add(Torque("moment", body, (0, 0, 20.0)))
    for k in range(3):
        mechanism.output(f"r{k}", body.position[k])
    mechanism.output("turn", 2 * body.quaternion[3] * body.quaternion[0])
    found = uqmbd.static_equilibrium(mechanism)
    np.testing.assert_allclose([found[f"r{k}"] for k in range(3)], [5e-4, -3e-4, 2e-4], atol=1e-12)
    # energy k sin^2(turn) / 2: the moment is k sin(turn) cos(turn)
    turn = brentq(lambda a: 1000 * np.sin(a) * np.cos(a) - 20, 0, 0.1, xtol=1e-14)
    assert found["turn"] == pytest.approx(np.sin(turn), abs=1e-10)


@pytest.mark.thorough
def test_what_is_free_to_move_stays_where_it_is():
    """A wheel on springs can turn freely: it hangs, and keeps its angle."""
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=2, inertia=0.1, position=(0.02, 0), angle=0.7)
    mechanism.add(SpringDamper("spring", mechanism.ground, wheel, (0, 1), (0, 0), 300, free_length=0.5))
    mechanism.output("angle", wheel.angle, units="rad")
    mechanism.output("y", wheel.position[1])
    found = uqmbd.static_equilibrium(mechanism)
    assert found["angle"] == pytest.approx(0.7, abs=1e-12)
    assert found["y"] == pytest.approx(0.5 - 2 * G / 300, abs=1e-9)
    mechanism.add(Torque("drive", wheel, 0.01))
    with pytest.raises(uqmbd.AssemblyError, match="body 'wheel' is the farthest from balance, by .* 0.01 N m"):
        uqmbd.static_equilibrium(mechanism)


@pytest.mark.thorough
def test_a_body_that_nothing_holds_is_named_and_does_not_disturb_others():
    """Without stiffness one realisation falls for ever."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(0, 100), units="N/m")
    mechanism = uqmbd.Mechanism("hung", uqmbd.Translational(gravity=(0, -G)))
    held, stone = mechanism.body("held", mass=1), mechanism.body("stone", mass=2)
    mechanism.add(SpringDamper("post", mechanism.ground, held, (0, 0), (0, 0), 100))
    mechanism.add(SpringDamper("spring", mechanism.ground, stone, (0, 0), (0, 0), stiffness))
    mechanism.output("y", stone.position[1])
    found = static_equilibria(Ensemble(build(mechanism), np.array([[50.0], [0.0], [100.0]])))
    assert [bool(m) for m in found.messages] == [False, True, False]
    assert "body 'stone' is the farthest from balance, by 19.6 N" in found.messages[1]
    np.testing.assert_allclose(found.q[[0, 2], 3], [-2 * G / 50, -2 * G / 100], atol=1e-12)


@pytest.mark.thorough
def test_a_ball_joint_lets_a_rod_hang():
    """Three free turns, one of them without any stiffness."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial(gravity=(0, 0, -G)))
    rod = mechanism.body("rod", mass=1, inertia=(0.1, 0.02, 0.1), com=(0, 0.5, 0), quaternion=(0.9, 0.1, 0.3, 0.3))
    mechanism.add(Spherical("pivot", mechanism.ground, rod, (0, 0, 0), (0, 0, 0)))
    for k, x in enumerate(rod.point((0, 0.5, 0))):
        mechanism.output(f"r{k}", x)
    found = uqmbd.static_equilibrium(mechanism)
    np.testing.assert_allclose([found[f"r{k}"] for k in range(3)], [0, 0, -0.5], atol=1e-9)


def test_drivers_hold_still_at_the_initial_time():
    """A crank that a driver turns, with a bob on a spring: the driver's angle is that at the time asked for."""
    mechanism = uqmbd.Mechanism("driven", uqmbd.Planar(gravity=(0, -G)))
    arm = mechanism.body("arm", mass=1, inertia=0.1)
    bob = mechanism.body("bob", mass=0.5, inertia=0.1, position=(1, -1))
    mechanism.add(Revolute("pivot", mechanism.ground, arm, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, arm, angle=3 * uqmbd.t))
    mechanism.add(SpringDamper("spring", arm, bob, (1, 0), (0, 0), 50))
    mechanism.output("x", bob.position[0])
    mechanism.output("y", bob.position[1])
    mechanism.output("speed", bob.velocity[0])
    for time in (0.0, 0.25):
        found = uqmbd.static_equilibrium(mechanism, time=time)
        assert found["x"] == pytest.approx(np.cos(3 * time), abs=1e-9)
        assert found["y"] == pytest.approx(np.sin(3 * time) - 0.5 * G / 50, abs=1e-9)


class Pinion(uqmbd.Component):
    """A rack: displacement = radius times the turned angle, which is a state that starts at zero."""

    radius = uqmbd.Parameter("m", "radius")

    def terms(self, p):
        turned = p.state("turned")
        yield uqmbd.Auxiliary(turned, p.body_i.angular_velocity[0], 0)
        yield uqmbd.Constraint(p.body_j.position[0] - p.radius * turned)


@pytest.mark.thorough
def test_a_state_that_starts_anywhere_is_carried_along():
    """A pinion that lifts nothing but pulls a spring, with an angle that only its state knows: x = r angle, 3 turns."""
    mechanism = uqmbd.Mechanism("rack", uqmbd.Planar())
    pinion = mechanism.body("pinion", mass=1, inertia=0.1)
    rack = mechanism.body("rack", mass=1, inertia=0.1)
    mechanism.add(Revolute("axle", mechanism.ground, pinion, (0, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, rack, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(Pinion("teeth", pinion, rack, radius=0.05))
    mechanism.add(SpringDamper("spring", mechanism.ground, rack, (2, 0), (0, 0), 100, free_length=1))
    mechanism.output("x", rack.position[0])
    mechanism.output("angle", pinion.angle, units="rad")
    found = uqmbd.static_equilibrium(mechanism)
    assert found["x"] == pytest.approx(1, abs=1e-9)
    assert found["angle"] == pytest.approx(20, abs=2e-6)


class Creep(uqmbd.Component):
    """A spring in series with a dashpot and a spring: its inner length relaxes."""

    bodies = ("body",)
    stiffness = uqmbd.Parameter("N/m", "spring")
    inner = uqmbd.Parameter("N/m", "inner spring")
    rate = uqmbd.Parameter("m/(N s)", "of the dashpot", default=0.5)

    def terms(self, p):
        y, inner = p.body.position[1], p.state("inner")
        pull = p.stiffness * (y - inner)
        yield uqmbd.Auxiliary(inner, p.rate * (pull - p.inner * inner), 0)
        yield uqmbd.VirtualWork(-pull, p.body.velocity[1])


def test_a_state_that_relaxes_takes_its_own_equilibrium():
    """Two springs in series: y = -m g (1/k + 1/k_inner)."""
    mechanism = uqmbd.Mechanism("creep", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("mass", mass=2)
    mechanism.add(Creep("creep", body, stiffness=200, inner=50))
    mechanism.add(SpringDamper("side", mechanism.ground, body, (0, 0), (0, 0), stiffness=1e-3))
    mechanism.output("y", body.position[1])
    expected = -2 * G / (1 / (1 / 200 + 1 / 50) + 1e-3)
    assert uqmbd.static_equilibrium(mechanism)["y"] == pytest.approx(expected, abs=1e-9)


def test_values_and_mistakes():
    """Values by name; what cannot be used is told."""
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 3), units="kg")
    mechanism = uqmbd.Mechanism("scale", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("pan", mass=mass)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), 100))
    mechanism.output("y", body.position[1], units="m")
    assert uqmbd.static_equilibrium(mechanism)["y"] == pytest.approx(-2 * G / 100)
    found = uqmbd.static_equilibrium(mechanism, {"mass": 3.0})
    assert found["y"] == pytest.approx(-3 * G / 100) and found["y"].attrs["units"] == "m"
    with pytest.raises(uqmbd.StudyError, match="values contains 'weight'; expected names of random variables"):
        uqmbd.static_equilibrium(mechanism, {"weight": 3.0})
    with pytest.raises(uqmbd.StudyError, match="time is 'now'; expected a number in s"):
        uqmbd.static_equilibrium(mechanism, time="now")
    with pytest.raises(uqmbd.StudyError, match="expected a uqmbd.Mechanism"):
        uqmbd.static_equilibrium(body)
