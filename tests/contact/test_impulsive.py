"""Impacts of rigid bodies, and contacts that last, against closed forms (reference case A6 among them)."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_contact import PlaneImpact, RoadImpact, SphereImpact, distance
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Prismatic

ZERO = (0, 0)


def point(*, position=(0, 1), velocity=None, gravity=(0, -9.81), name="ball"):
    mechanism = uqmbd.Mechanism(name, uqmbd.Translational(gravity=gravity))
    return mechanism, mechanism.body("ball", mass=2, position=position, velocity=velocity)


@pytest.mark.thorough
def test_bouncing_ball():
    """h0 = 1 m, e = 0.8: times of the impacts, the Zeno limit, and heights of the apexes e^(2n)."""
    mechanism, ball = point()
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1), restitution=0.8))
    mechanism.output("height", ball.position[1], units="m")
    for k in range(1, 6):
        mechanism.output(f"t{k}", floor.event_time("impact", k), units="s")
    mechanism.output("rest", floor.event_time("rest"), units="s")
    impacts = np.array(
        [0.4515236409857309, 1.1739614665629003, 1.751911727024636, 2.2142719353940246, 2.5841601020895357]
    )
    apexes = (impacts[1:] + impacts[:-1]) / 2
    data = uqmbd.simulate(mechanism, [0, *apexes, 5])
    np.testing.assert_allclose([data[f"t{k}"] for k in range(1, 6)], impacts, rtol=1e-13)
    np.testing.assert_allclose(data.height[1:-1], 0.8 ** (2 * np.arange(1, 5)), rtol=1e-11)
    np.testing.assert_allclose(data.rest, 4.063712768871579, rtol=2e-6)
    assert abs(float(data.height[-1])) < 1e-12


@pytest.mark.parametrize("integrator", ["auto", "dop853", "radau"])  # IDA cannot follow events, and says so
def test_state_at_an_impact_is_that_after_it(integrator):
    mechanism, ball = point(velocity=(0, -5), position=(0, 1), gravity=ZERO)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1), restitution=0.5))
    mechanism.output("v", ball.velocity[1])
    data = uqmbd.simulate(mechanism, [0, 0.1, 0.2, 0.3], integrator=integrator)
    np.testing.assert_allclose(data.v, [-5, -5, 2.5, 2.5], rtol=1e-12)


def rolling(space, place=None):
    """A sphere that slides, then rolls: v0 = 5 m/s, mu = 0.2, r = 0.1 m."""
    flat, radius, mass = space is uqmbd.Planar, 0.1, 3
    inertia = 0.4 * mass * radius**2
    mechanism = uqmbd.Mechanism("bowling", space(gravity=(0, -9.81) if flat else (0, 0, -9.81)))
    ball = mechanism.body(
        "ball",
        mass=mass,
        inertia=inertia if flat else (inertia,) * 3,
        position=(0, radius) if flat else (0, 0, radius),
        velocity=(5, 0) if flat else (4, 3, 0),
        angular_velocity=0 if flat else (0, 0, 7),
    )
    zero, up = ((0, 0), (0, 1)) if flat else ((0, 0, 0), (0, 0, 1))
    law = {"restitution": 0.5, "friction": 0.2}
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, zero, zero, up, radius=radius, **law))
    along = (1, 0) if flat else (0.8, 0.6, 0)
    for name, vector in (("x", ball.position), ("v", ball.velocity), ("a", ball.acceleration)):
        mechanism.output(name, sum(c * x for c, x in zip(along, vector, strict=True)))
    mechanism.output("load", floor.reaction_force[-1], units="N")
    mechanism.output("drag", sum(c * x for c, x in zip(along, floor.reaction_force, strict=True)), units="N")
    mechanism.output("stick", floor.event_time("stick"), units="s")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_a_sliding_sphere_begins_to_roll(space):
    """Time, speed and place at which sliding ends (A6); accelerations and reactions before and after."""
    data = uqmbd.simulate(rolling(space), [0, 0.3, 0.7281199941750399, 1], rtol=1e-8)
    np.testing.assert_allclose(data.stick, 0.7281199941750399, rtol=1e-6)
    np.testing.assert_allclose(data.x[2], 3.1205142607501712, rtol=1e-7)
    np.testing.assert_allclose(data.v[2:], 3.5714285714285716, rtol=1e-6)
    np.testing.assert_allclose(data.a, [-0.2 * 9.81, -0.2 * 9.81, data.a[2], 0], atol=1e-6)
    np.testing.assert_allclose(data["load"], 3 * 9.81, rtol=1e-9)
    np.testing.assert_allclose(data.drag[:2], -0.2 * 3 * 9.81, rtol=1e-7)
    np.testing.assert_allclose(data.drag[3], 0, atol=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [0.7, 0.3])
def test_a_block_on_an_incline_sticks_or_slides(friction):
    """Thrown up an incline of 30 degrees it stops, and stays or slides back."""
    a, g = np.pi / 6, 10
    mechanism, block = point(position=ZERO, velocity=(3 * np.cos(a), 3 * np.sin(a)), gravity=(0, -g))
    up = (-np.sin(a), np.cos(a))
    plane = mechanism.add(PlaneImpact("plane", mechanism.ground, block, ZERO, ZERO, up, friction=friction))
    mechanism.output("way", block.position[0] * np.cos(a) + block.position[1] * np.sin(a))
    mechanism.output("normal", -np.sin(a) * plane.reaction_force[0] + np.cos(a) * plane.reaction_force[1], units="N")
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times)
    slower, back = g * (np.sin(a) + friction * np.cos(a)), max(0.0, g * (np.sin(a) - friction * np.cos(a)))
    turn = 3 / slower
    way = np.where(times < turn, 3 * times - slower * times**2 / 2, 4.5 / slower - back * (times - turn) ** 2 / 2)
    np.testing.assert_allclose(data.way, way, atol=1e-12)
    np.testing.assert_allclose(data.normal, 2 * g * np.cos(a), rtol=1e-12)


@pytest.mark.thorough
def test_friction_of_a_ball_in_space_turns_its_slide_downhill():
    """A point that slides across an incline, against SciPy's solution of its equations in the plane."""
    import scipy.integrate

    g, mu, tilt = 9.81, 0.3, 0.4
    mechanism = uqmbd.Mechanism("slide", uqmbd.Spatial(gravity=(0, -g * np.sin(tilt), -g * np.cos(tilt))))
    block = mechanism.body("block", mass=1, inertia=(1, 1, 1), velocity=(2, 0, 0), angular_velocity=(0, 0, 0))
    zero = (0, 0, 0)
    # frictionless contact of a point at the centre does not turn the body
    mechanism.add(PlaneImpact("plane", mechanism.ground, block, zero, zero, (0, 0, 1), friction=mu))
    mechanism.output("x", block.position[0])
    mechanism.output("y", block.position[1])
    data = uqmbd.simulate(mechanism, [0, 0.5, 1], rtol=1e-8)

    def rate(_, z):
        drag = mu * g * np.cos(tilt) * z[2:] / np.linalg.norm(z[2:])
        return [*z[2:], -drag[0], -g * np.sin(tilt) - drag[1]]

    there = scipy.integrate.solve_ivp(rate, (0, 1), [0, 0, 2, 0], rtol=1e-10, atol=1e-12, t_eval=[0.5, 1]).y
    np.testing.assert_allclose([data.x[1:], data.y[1:]], there[:2], atol=1e-7)


def platform(amplitude, frequency):
    mechanism = uqmbd.Mechanism("platform", uqmbd.Translational(gravity=(0, -9.81)))
    plate = mechanism.body("plate", mass=5)
    ball = mechanism.body("ball", mass=1, velocity=(0, 0))
    mechanism.add(Prismatic("guide", mechanism.ground, plate, ZERO, ZERO, (0, 1), (0, 1)))
    motion = amplitude * (1 - sympy.cos(frequency * uqmbd.t))
    mechanism.add(PositionDriver("drive", mechanism.ground, plate, ZERO, ZERO, (0, 1), motion))
    contact = mechanism.add(PlaneImpact("contact", plate, ball, ZERO, ZERO, (0, 1), restitution=0.3))
    mechanism.output("gap", ball.position[1] - plate.position[1])
    mechanism.output("height", ball.position[1])
    mechanism.output("force", contact.reaction_force[1], units="N")
    return mechanism, contact


@pytest.mark.thorough
def test_a_ball_on_a_vibrating_platform():
    """It stays where the platform falls more slowly than it; else it lifts off where it does not, and flies."""
    times = np.linspace(0, 0.5, 51)
    mechanism, _ = platform(0.01, 20)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    assert np.abs(data.gap).max() < 1e-10
    np.testing.assert_allclose(data.force, 9.81 + 0.01 * 400 * np.cos(20 * times), rtol=1e-6)
    mechanism, contact = platform(0.05, 20)
    mechanism.output("lift-off", contact.event_time("lift-off"), units="s")
    leaves = np.arccos(-9.81 / (0.05 * 400)) / 20
    late = leaves + 0.04
    data = uqmbd.simulate(mechanism, [0, leaves / 2, late], rtol=1e-8)
    np.testing.assert_allclose(data["lift-off"], leaves, rtol=1e-7)
    speed, height = 0.05 * 20 * np.sin(20 * leaves), 0.05 * (1 - np.cos(20 * leaves))
    np.testing.assert_allclose(data.height[2], height + speed * 0.04 - 9.81 * 0.04**2 / 2, rtol=1e-6)
    assert data.force[2] == 0


@pytest.mark.thorough
def test_a_ball_in_a_corner_rests_on_both_walls():
    mechanism, ball = point(position=(0.5, 1), gravity=(-3, -10))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1), restitution=0.5))
    wall = mechanism.add(PlaneImpact("wall", mechanism.ground, ball, ZERO, ZERO, (1, 0), restitution=0.6))
    for name, x in (("x", ball.position[0]), ("y", ball.position[1]), ("a", ball.acceleration[1])):
        mechanism.output(name, x)
    mechanism.output("wall", wall.reaction_force[0], units="N")
    mechanism.output("floor", floor.reaction_force[1], units="N")
    data = uqmbd.simulate(mechanism, [0, 6]).isel(time=1)
    np.testing.assert_allclose([data.x, data.y, data.a], 0, atol=1e-10)
    np.testing.assert_allclose([data.wall, data.floor], [6, 20], rtol=1e-10)


def row(positions, velocities, restitution=1):
    mechanism = uqmbd.Mechanism("row", uqmbd.Translational())
    balls = [
        mechanism.body(f"ball{k}", mass=1, position=(x, 0), velocity=(v, 0))
        for k, (x, v) in enumerate(zip(positions, velocities, strict=True))
    ]
    for k, pair in enumerate(zip(balls[:-1], balls[1:], strict=True)):
        mechanism.add(SphereImpact(f"touch{k}", *pair, ZERO, ZERO, 0.1, 0.1, restitution=restitution))
    for ball in balls:
        mechanism.output(ball.name, ball.velocity[0])
    return mechanism


def test_a_row_of_balls_that_touch_hands_on_a_blow():
    """Newton's cradle: one comes, one goes."""
    mechanism = row([-0.3, 0.2, 0.4, 0.6], [2, 0, 0, 0])
    data = uqmbd.simulate(mechanism, [0, 0.1, 0.5])
    np.testing.assert_allclose([data[f"ball{k}"][2] for k in range(4)], [0, 0, 0, 2], atol=1e-12)


def test_a_ball_between_two():
    """Both neighbours come at once, with no preference: it stays, they return."""
    data = uqmbd.simulate(row([-0.5, 0, 0.5], [1, 0, -1], 0.5), [0, 1])
    np.testing.assert_allclose([data[f"ball{k}"][1] for k in range(3)], [-0.5, 0, 0.5], atol=1e-12)


def test_billiard():
    """An oblique elastic impact of two unequal balls in space: momentum and energy stay, as by the closed form."""
    mechanism = uqmbd.Mechanism("billiard", uqmbd.Spatial())
    masses, velocities = (1, 3), np.array([[4, 1, 0], [-1, 0.5, 0.2]])
    balls = [
        mechanism.body(
            f"ball{k}",
            mass=m,
            inertia=(1, 1, 1),
            position=(0.5 * k, 0.05 * k, 0),
            velocity=v,
            angular_velocity=(0, 0, 0),
        )
        for k, (m, v) in enumerate(zip(masses, velocities.tolist(), strict=True))
    ]
    zero = (0, 0, 0)
    touch = mechanism.add(SphereImpact("touch", *balls, zero, zero, 0.1, 0.2))
    for k, ball in enumerate(balls):
        for axis in range(3):
            mechanism.output(f"v{k}{axis}", ball.velocity[axis])
    mechanism.output("when", touch.event_time("impact"), units="s")
    data = uqmbd.simulate(mechanism, [0, 0.3], rtol=1e-9)
    after = np.array([[data[f"v{k}{axis}"][1] for axis in range(3)] for k in range(2)])
    offset, relative = np.array([0.5, 0.05, 0]), velocities[1] - velocities[0]
    a, b, c = relative @ relative, 2 * offset @ relative, offset @ offset - 0.09
    when = (-b - np.sqrt(b * b - 4 * a * c)) / (2 * a)
    n = (offset + when * relative) / 0.3
    impulse = -2 * (relative @ n) / (1 + 1 / 3)
    np.testing.assert_allclose(data.when, when, rtol=1e-12)
    np.testing.assert_allclose(after, velocities + np.outer([-impulse, impulse / 3], n), atol=1e-10)
    np.testing.assert_allclose(masses @ after, masses @ velocities, atol=1e-12)
    energy = [np.array(masses) @ (v**2).sum(axis=1) for v in (velocities, after)]
    np.testing.assert_allclose(energy[1], energy[0], rtol=1e-12)


@pytest.mark.parametrize(("friction", "sticks"), [(0.1, False), (0.5, True)])
def test_oblique_impact_with_friction(friction, sticks):
    """A disc that slides throughout, or rolls off: tangential impulse mu (1 + e) m v_n, or that which stops the rim."""
    radius, e = 0.1, 0.5
    mechanism = uqmbd.Mechanism("spin", uqmbd.Planar())
    ball = mechanism.body("ball", mass=1, inertia=0.005, position=(0, 0.2), velocity=(1, -2), angular_velocity=0)
    law = {"restitution": e, "friction": friction}
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1), radius, **law))
    for name, x in (("vx", ball.velocity[0]), ("vy", ball.velocity[1]), ("w", ball.angular_velocity)):
        mechanism.output(name, x)
    data = uqmbd.simulate(mechanism, [0, 0.2]).isel(time=1)
    impulse = 1 / (1 + radius**2 / 0.005) if sticks else friction * (1 + e) * 2
    np.testing.assert_allclose([data.vx, data.vy, data.w], [1 - impulse, 1, -radius * impulse / 0.005], rtol=1e-10)


def test_a_point_slides_on_a_road():
    """A frictionless bead on y = x^2: its energy stays, and the load is that of the curvature."""
    g = 9.81
    mechanism, bead = point(position=(0.5, 0.25), velocity=ZERO, gravity=(0, -g))
    road = mechanism.add(RoadImpact("road", mechanism.ground, bead, ZERO, distance**2))
    for name, x in (("x", bead.position[0]), ("y", bead.position[1]), ("vx", bead.velocity[0])):
        mechanism.output(name, x)
    mechanism.output("vy", bead.velocity[1])
    mechanism.output("load", road.reaction_force[1], units="N")
    data = uqmbd.simulate(mechanism, np.linspace(0, 1, 11), rtol=1e-9)
    np.testing.assert_allclose(data.y, data.x**2, atol=1e-9)
    np.testing.assert_allclose(data.vx**2 / 2 + data.vy**2 / 2 + g * data.y, g * 0.25, rtol=1e-7)
    steep = 1 + 4 * data.x**2
    normal = 2 * (g / steep**0.5 + (data.vx**2 + data.vy**2) * 2 / steep**1.5)
    np.testing.assert_allclose(data["load"], normal / steep**0.5, rtol=1e-6)


def test_a_start_that_overlaps_is_reported():
    mechanism, ball = point(position=(0, -0.1))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1)))
    mechanism.output("y", ball.position[1])
    with pytest.raises(uqmbd.AssemblyError, match="'floor': the bodies overlap by 0.1 m at the start"):
        uqmbd.simulate(mechanism, [0, 1])


@pytest.mark.thorough
def test_an_event_that_never_comes_is_reported():
    mechanism, ball = point(gravity=ZERO)
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1)))
    mechanism.output("when", floor.event_time("impact"), units="s")
    with pytest.warns(UserWarning, match="the event 'floor: impact 1' does not occur by the last output time"):
        assert np.isnan(uqmbd.simulate(mechanism, [0, 1])["when"])
    with pytest.raises(uqmbd.StudyError, match="events are counted from 1"):
        floor.event_time("impact", 0)


def test_marks_change_nothing_and_are_timed():
    """An event without a jump: the apex, where the velocity falls through zero."""

    class Apex(uqmbd.Component):
        bodies = ("body",)

        def terms(self, p):
            yield uqmbd.Event(p.body.velocity[1], label="apex")

    mechanism, ball = point(velocity=(0, 3))
    apex = mechanism.add(Apex("apex", ball))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, ZERO, ZERO, (0, 1), restitution=0.5))
    for k in (1, 2):
        mechanism.output(f"apex{k}", apex.event_time("apex", k), units="s")
    mechanism.output("hit", floor.event_time("impact"), units="s")
    data = uqmbd.simulate(mechanism, [0, 2])
    speed = np.sqrt(9 + 2 * 9.81)
    hit = (3 + speed) / 9.81
    np.testing.assert_allclose(
        [data.apex1, data.hit, data.apex2], [3 / 9.81, hit, hit + 0.5 * speed / 9.81], rtol=1e-10
    )


@pytest.mark.parametrize("ratio", [1.0, 1e5, 1e12])
def test_bodies_that_do_not_touch_each_other_rest_however_unlike_their_masses(ratio):
    """Two boxes slide on the ground beside each other, each until friction has stopped it."""
    mechanism = uqmbd.Mechanism("boxes", uqmbd.Translational(gravity=(0, -9.81)))
    for k, mass in enumerate((1 / np.sqrt(ratio), np.sqrt(ratio))):
        box = mechanism.body(f"box{k}", mass=mass, position=(5 * k, 0), velocity=(1, 0))
        ground = mechanism.ground
        mechanism.add(PlaneImpact(f"floor{k}", ground, box, (0, 0), (0, 0), (0, 1), restitution=0, friction=0.1))
        mechanism.output(f"x{k}", box.position[0] - 5 * k, units="m")
        mechanism.output(f"y{k}", box.position[1], units="m")
    times = np.linspace(0, 1, 5)
    found = uqmbd.simulate(mechanism, times)
    for k in range(2):
        np.testing.assert_allclose(found[f"x{k}"].values, times - 0.5 * 0.981 * times**2, atol=1e-9)
        np.testing.assert_allclose(found[f"y{k}"].values, 0, atol=1e-9)


@pytest.mark.parametrize("share", [0.9999, 1.0, 1.0001])
def test_a_block_on_an_incline_at_the_angle_of_friction(share):
    """It slides up, stops, and then stays, or slides down hardly."""
    tilt, speed, gravity = 0.3, 2.0, 9.81
    mu = share * np.tan(tilt)
    along = np.array([np.cos(tilt), np.sin(tilt)])
    mechanism = uqmbd.Mechanism("incline", uqmbd.Translational(gravity=(0, -gravity)))
    block = mechanism.body("block", mass=2, velocity=tuple(speed * along))
    normal = (-np.sin(tilt), np.cos(tilt))
    mechanism.add(PlaneImpact("plane", mechanism.ground, block, (0, 0), (0, 0), normal, restitution=0, friction=mu))
    mechanism.output("s", block.position[0] * along[0] + block.position[1] * along[1], units="m")
    times = np.linspace(0, 2, 21)
    up = gravity * (np.sin(tilt) + mu * np.cos(tilt))
    down = max(0.0, gravity * (np.sin(tilt) - mu * np.cos(tilt)))
    stop = speed / up
    expected = np.where(
        times < stop, speed * times - up * times**2 / 2, speed * stop / 2 - down * (times - stop) ** 2 / 2
    )
    np.testing.assert_allclose(uqmbd.simulate(mechanism, times)["s"].values, expected, atol=1e-8)


class Ruler(uqmbd.Component):
    """Notes whenever a body passes a line, many times in a step."""

    bodies = ("body",)

    def terms(self, p):
        """Yield the event."""
        yield uqmbd.Event(sympy.sin(2 * sympy.pi * p.body.position[0] / 0.05), label="line")


def test_all_events_of_one_kind_in_a_step_are_noted():
    mechanism = uqmbd.Mechanism("ruler", uqmbd.Translational())
    body = mechanism.body("body", mass=1, position=(0.01, 0), velocity=(1, 0))
    ruler = mechanism.add(Ruler("ruler", body))
    for k in range(1, 20):
        mechanism.output(f"line{k}", ruler.event_time("line", k), units="s")
    found = uqmbd.simulate(mechanism, np.linspace(0, 1, 3), check=False)
    np.testing.assert_allclose(
        [float(found[f"line{k}"]) for k in range(1, 20)], 0.015 + 0.05 * np.arange(19), atol=1e-9
    )
