"""Wheels and spheres that roll, and skates, against closed forms: motions, reactions, and what they conserve."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_joints import PointOnPlane, Revolute, RollingSphere, RollingWheel, Skate
from uqmbd_springs import SpringDamper

from .sleighs import sleigh

G = 9.81
ORIGIN = (0, 0, 0)
UP = (0, 0, 1)


# -- Chaplygin's sleigh ------------------------------------------------------------------------------------------------
@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_sleigh_in_closed_form(integrator, close, energy):
    """``u = U tanh k t``, ``w = (a k / c) sech k t`` with ``c = m a^2 + J``: Neimark and Fufaev, chapter 2.

    With ``u' = a w^2`` and ``c w' = -m a u w`` the energy ``m u^2 + c w^2`` is constant; started with all of it in the
    turning, the sleigh ends straight, its blade behind, after a turn by ``pi / 2 sqrt(c / m) / a``.
    """
    mass, inertia, arm, turning = 2.0, 0.15, 0.3, 3.0
    whole = inertia + mass * arm**2
    final = turning * np.sqrt(whole / mass)
    k = mass * arm * final / whole
    mechanism, times = sleigh(0, turning, inertia, mass, arm), np.linspace(0, 6 / k, 31)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    close(data["speed"], final * np.tanh(k * times), relative=1e-7)
    close(data["turning"], turning / np.cosh(k * times), relative=1e-7)
    close(data["across"], 0, scale=final, relative=1e-9)
    angle = np.sqrt(whole / mass) / arm * 2 * np.arctan(np.tanh(k * times / 2))
    close(data["angle"], angle, relative=1e-7)
    assert abs(angle[-1] / (np.pi / 2 * np.sqrt(whole / mass) / arm) - 1) < 0.01
    kinetic = energy(mechanism, times)[0]
    close(kinetic, np.full(31, whole * turning**2 / 2), relative=1e-5)


def test_a_sleigh_that_is_pushed_backwards_turns_round(close):
    """The blade ahead of the centre of mass is unstable: from ``-U tanh k (t - T)`` it comes to glide the other way."""
    mass, inertia, arm, final, begin = 1.0, 0.2, 0.5, 1.5, 2.5
    whole = inertia + mass * arm**2
    k = mass * arm * final / whole
    peak = final * np.sqrt(mass / whole)
    mechanism = sleigh(final * np.tanh(-k * begin), peak / np.cosh(k * begin), inertia, mass, arm)
    times = np.linspace(0, 2 * begin, 21)
    data = uqmbd.simulate(mechanism, times, rtol=1e-10)
    close(data["speed"], final * np.tanh(k * (times - begin)), relative=1e-6)
    close(data["turning"], peak / np.cosh(k * (times - begin)), relative=1e-6)


def test_a_skate_on_an_incline_does_not_slide_down_in_the_mean(close):
    """A blade at the centre of mass with spin w: ``x = g s (sin w t)^2 / 2 w^2``, no drift down (Neimark and Fufaev)."""
    turning, slope = 2.0, 3.0
    mechanism = uqmbd.Mechanism("blade", uqmbd.Planar(gravity=(slope, 0)))
    body = mechanism.body("blade", mass=1.3, inertia=0.2, velocity=(0, 0), angular_velocity=turning)
    skate = mechanism.add(Skate("edge", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("force", body.direction((0, 1)).dot(skate.reaction_force), units="N")
    times = np.linspace(0, 5, 26)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    angle = turning * times
    close(data["x"], slope / (2 * turning**2) * np.sin(angle) ** 2, relative=1e-7)
    close(data["y"], slope / (2 * turning**2) * (angle - np.sin(2 * angle) / 2), relative=1e-7)
    # across: m u w = R - m g sin, with u = g sin(w t) / w
    close(data["force"], 1.3 * 2 * slope * np.sin(angle), relative=1e-7)


@pytest.mark.thorough
def test_a_skate_in_space_is_that_in_the_plane(close):
    """The sleigh on three points of an inclined plane moves as the one seen from above, and presses on what holds it."""
    tilt = (np.cos(0.2), np.sin(0.2), 0, 0)
    axes = np.array([[1, 0, 0], [0, np.cos(0.4), np.sin(0.4)], [0, -np.sin(0.4), np.cos(0.4)]])
    mass, inertia, arm = 2.0, 0.15, 0.3
    mechanism = uqmbd.Mechanism("sleigh", uqmbd.Spatial(gravity=-G * axes[2]))
    body = mechanism.body(
        "sleigh", mass=mass, inertia=(1, 1, inertia), com=(arm, 0, 0), quaternion=tilt,
        velocity=0.8 * axes[0], angular_velocity=(0, 0, 2.0),
    )  # fmt: skip
    mechanism.add(Skate("blade", mechanism.ground, body, ORIGIN, (1, 0, 0), normal_i=axes[2]))
    for k, point in enumerate([(0, 0, 0), (1, 0.5, 0), (1, -0.5, 0)]):
        mechanism.add(PointOnPlane(f"runner{k}", mechanism.ground, body, ORIGIN, point, axes[2]))
    mechanism.output("x", sum(a * x for a, x in zip(axes[0], body.position, strict=True)), units="m")
    mechanism.output("y", sum(a * x for a, x in zip(axes[1], body.position, strict=True)), units="m")
    times = np.linspace(0, 3, 13)
    flat = sleigh(0.8, 2.0, inertia, mass, arm)
    plane = flat.bodies["sleigh"]
    flat.output("x", plane.position[0], units="m")
    flat.output("y", plane.position[1], units="m")
    expected = uqmbd.simulate(flat, times, rtol=1e-9)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    for name in "xy":
        close(data[name], expected[name], relative=1e-6)


# -- wheels and spheres ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_wheel_rolls_down_a_slope(integrator, close, energy):
    """``x'' = g sin / (1 + J / m R^2)``; the friction that this takes is ``m g sin J / (J + m R^2)``."""
    mass, inertia, radius, slope = 3.0, 0.4, 0.5, 0.3
    along, normal = np.array([np.cos(slope), -np.sin(slope)]), np.array([np.sin(slope), np.cos(slope)])
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=mass, inertia=inertia, position=radius * normal)
    road = mechanism.add(RollingWheel("road", mechanism.ground, wheel, (0, 0), (0, 0), normal, radius=radius))
    mechanism.output("s", along[0] * wheel.position[0] + along[1] * wheel.position[1], units="m")
    mechanism.output("angle", wheel.angle, units="rad")
    mechanism.output("friction", along[0] * road.reaction_force[0] + along[1] * road.reaction_force[1], units="N")
    mechanism.output("load", normal[0] * road.reaction_force[0] + normal[1] * road.reaction_force[1], units="N")
    mechanism.output("moment", road.reaction_moment, units="N m")
    times = np.linspace(0, 3, 16)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    s = G * np.sin(slope) / (1 + inertia / (mass * radius**2)) * times**2 / 2
    close(data["s"], s, relative=1e-7)
    close(data["angle"], -s / radius, relative=1e-7)
    close(data["friction"], np.full(16, -mass * G * np.sin(slope) * inertia / (inertia + mass * radius**2)), 1e-7)
    close(data["load"], np.full(16, mass * G * np.cos(slope)), relative=1e-7)
    close(data["moment"], 0, scale=1.0, relative=1e-9)
    kinetic, potential = energy(mechanism, times)
    close(kinetic + potential, np.full(16, potential[0]), relative=1e-5, scale=kinetic.max())


def test_a_sphere_rolls_down_an_incline(close):
    """A full sphere: ``5/7 g sin`` down and nothing across, so that its path is a parabola; its spin persists."""
    mass, radius, slope, spin = 2.0, 0.2, 0.4, 5.0
    across, down = np.array([0.0, 1.0, 0.0]), np.array([np.cos(slope), 0.0, -np.sin(slope)])
    normal = np.cross(down, across)
    mechanism = uqmbd.Mechanism("sphere", uqmbd.Spatial(gravity=(0, 0, -G)))
    speed = 0.7
    turning = np.cross(normal, speed * across) / radius + spin * normal
    ball = mechanism.body(
        "ball", mass=mass, inertia=(0.4 * mass * radius**2,) * 3, position=radius * normal,
        velocity=speed * across, angular_velocity=turning,
    )  # fmt: skip
    plane = mechanism.add(RollingSphere("plane", mechanism.ground, ball, ORIGIN, ORIGIN, normal, radius))
    for name, axis in (("down", down), ("across", across)):
        mechanism.output(name, sum(a * x for a, x in zip(axis, ball.position, strict=True)), units="m")
    mechanism.output("spin", sum(a * x for a, x in zip(normal, ball.angular_velocity, strict=True)), units="rad/s")
    mechanism.output("friction", sum(a * x for a, x in zip(down, plane.reaction_force, strict=True)), units="N")
    times = np.linspace(0, 2, 11)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["down"], 5 / 7 * G * np.sin(slope) * times**2 / 2, relative=1e-7)
    close(data["across"], speed * times, relative=1e-7)
    close(data["spin"], np.full(11, spin), relative=1e-6)
    close(data["friction"], np.full(11, -2 / 7 * mass * G * np.sin(slope)), relative=1e-7)


@pytest.mark.thorough
def test_a_sphere_on_a_turntable_goes_in_circles(close):
    """It circles at ``2/7`` of the speed of the table (Pars, A Treatise on Analytical Dynamics): a plane that moves."""
    radius, table = 0.1, 3.0
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Spatial(gravity=(0, 0, -G)))
    disc = mechanism.body("table", mass=1, inertia=(1e9,) * 3, angular_velocity=(0, 0, table))
    mechanism.add(Revolute("bearing", mechanism.ground, disc, at=ORIGIN, axis=UP))
    start, velocity = np.array([0.5, 0.0, radius]), np.array([0.2, 0.3, 0.0])
    # what rolls on the table: v - w_table x r = w x R n
    slip = velocity - np.cross([0, 0, table], [*start[:2], 0])
    turning = np.cross([0, 0, 1], slip) / radius
    ball = mechanism.body(
        "ball", mass=2, inertia=(0.4 * 2 * radius**2,) * 3, position=start, velocity=velocity, angular_velocity=turning
    )
    mechanism.add(RollingSphere("rolling", disc, ball, ORIGIN, ORIGIN, UP, radius))
    mechanism.output("x", ball.position[0], units="m")
    mechanism.output("y", ball.position[1], units="m")
    times = np.linspace(0, 8, 41)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    rate = 2 / 7 * table
    place, v = complex(*start[:2]), complex(*velocity[:2])
    path = place + v / (1j * rate) * (np.exp(1j * rate * times) - 1)
    close(data["x"], path.real, relative=1e-6)
    close(data["y"], path.imag, relative=1e-6)


def disc(lean, precession, spin, mass=1.5, radius=0.25, ring=False, **start):
    """A thin disc that leans by an angle from the vertical; body axis z is its own, x points up in its plane."""
    axial = mass * radius**2 * (1 if ring else 0.5)
    moments = (axial / 2, axial / 2, axial)
    # the axis of the disc points to (-cos lean, 0, sin lean)... of the rim: up is (sin lean, 0, cos lean)
    up = np.array([np.sin(lean), 0, np.cos(lean)])
    axis = np.array([-np.cos(lean), 0, np.sin(lean)])
    rotation = np.column_stack([up, np.cross(axis, up), axis])
    turning = precession * np.array([0, 0, 1]) + spin * axis
    velocity = np.cross(turning, radius * up)
    mechanism = uqmbd.Mechanism("disc", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body(
        "disc", mass=mass, inertia=moments, position=radius * up, rotation=rotation,
        velocity=velocity, angular_velocity=rotation.T @ turning,
    )  # fmt: skip
    road = mechanism.add(
        RollingWheel("road", mechanism.ground, body, ORIGIN, ORIGIN, normal_i=UP, axis_j=UP, radius=radius)
    )
    mechanism.output("height", body.position[2], units="m")
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("sine", body.direction(UP)[2])
    mechanism.output("turning", body.direction(UP).dot(body.angular_velocity), units="rad/s")
    mechanism.output("load", road.reaction_force[2], units="N")
    mechanism.output("sideways", (road.reaction_force[0] ** 2 + road.reaction_force[1] ** 2) ** 0.5, units="N")
    return mechanism


def steady_turning(lean, precession, mass=1.5, radius=0.25):
    """Turning about its axis of a thin disc that circles steadily, from the moment about its centre.

    ``(C + m R^2) W p cos a - A W^2 sin a cos a + m g R sin a = 0`` with lean a, precession W and turning p about the
    axis (Neimark and Fufaev, chapter 3; O'Reilly, Nonlinear Dynamics 10 (1996) 287).
    """
    axial, across = mass * radius**2 / 2, mass * radius**2 / 4
    sine, cosine = np.sin(lean), np.cos(lean)
    pull = across * precession**2 * sine * cosine - mass * G * radius * sine
    return pull / ((axial + mass * radius**2) * precession * cosine)


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@pytest.mark.parametrize(("lean", "precession"), [(0.3, 2.0), (0.9, 5.0), (-0.5, 3.0), (1.2, "euler")])
def test_a_disc_that_circles_steadily(integrator, lean, precession, close):
    """Lean, path and forces; and Euler's disc whose centre rests: ``W^2 = 4 g / (R cos a)`` (Moffatt, Nature 2000)."""
    mass, radius = 1.5, 0.25
    if precession == "euler":
        precession = np.sqrt(4 * G / (radius * np.cos(lean)))
        assert abs(steady_turning(lean, precession)) < 1e-12
    p = steady_turning(lean, precession)
    mechanism = disc(lean, precession, p - precession * np.sin(lean))
    times = np.linspace(0, 2, 11)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    close(data["sine"], np.full(11, np.sin(lean)), relative=1e-6)
    close(data["height"], np.full(11, radius * np.cos(lean)), relative=1e-6)
    close(data["turning"], np.full(11, p), relative=1e-6, scale=abs(precession))
    arm = radius * p / precession
    path = radius * np.sin(lean) - arm + arm * np.exp(1j * precession * times)
    close(data["x"], path.real, relative=1e-6, scale=radius)
    close(data["y"], path.imag, relative=1e-6, scale=radius)
    close(data["load"], np.full(11, mass * G), relative=1e-6)
    close(data["sideways"], np.full(11, mass * precession**2 * abs(arm)), relative=1e-6, scale=mass * G)


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("fast", [False, True])
def test_a_rolling_disc_falls_below_its_critical_speed(ring, fast, close):
    """Small leans: ``(A + m R^2) a'' = (m g R - C (C + m R^2) p^2 / A) a`` (Routh): ``v^2 = g R / 3``, of a ring / 4."""
    mass, radius, lean = 1.5, 0.25, 1e-5
    axial = mass * radius**2 * (1 if ring else 0.5)
    critical = np.sqrt(G / radius / (4 if ring else 3))
    p = critical * (1.5 if fast else 0.7)
    growth = (mass * G * radius - axial * (axial + mass * radius**2) * p**2 / (axial / 2)) / (
        axial / 2 + mass * radius**2
    )
    assert (growth < 0) == fast
    # the heading turns so that the lean has one harmonic: A W = -C p a
    precession = -2 * p * lean
    mechanism = disc(lean, precession, p - precession * np.sin(lean), ring=ring)
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times, rtol=1e-11)
    expected = lean * np.real(np.cosh(np.sqrt(complex(growth)) * times))
    close(data["sine"], expected, relative=2e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("fast", [False, True])
def test_modes_about_a_disc_that_rolls_straight(fast):
    """Linearised about the steady motion: the same growth, or frequency, and otherwise modes at zero."""
    mass, radius = 1.5, 0.25
    axial = mass * radius**2 / 2
    p = np.sqrt(G / radius / 3) * (1.5 if fast else 0.7)
    pull = mass * G * radius - axial * (axial + mass * radius**2) * p**2 / (axial / 2)
    growth = np.sqrt(abs(pull / (axial / 2 + mass * radius**2)))
    modes = uqmbd.eigenfrequencies(disc(0, 0, p), at="steady")
    found = np.abs(modes["eigenvalue_imaginary" if fast else "eigenvalue_real"].values)
    other = np.abs(modes["eigenvalue_real" if fast else "eigenvalue_imaginary"].values)
    assert found.max() == pytest.approx(growth, rel=1e-6) and other.max() < 1e-6
    assert np.sum(found > 1e-6) == (1 if fast else 2)


@pytest.mark.thorough
def test_a_wobbling_disc_keeps_its_energy(energy):
    mechanism = disc(0.6, 4.0, -3.0)
    times = np.linspace(0, 3, 31)
    total = sum(energy(mechanism, times))
    assert np.abs(total - total[0]).max() < 1e-5 * abs(total[0])


@pytest.mark.slow
def test_a_wheel_of_a_slipping_contact_tends_to_one_that_rolls(close):
    """Compliant contact with Coulomb friction that holds within a creep speed: the difference falls with that speed."""
    from uqmbd_contact import PlaneContact

    def wheel(slow):
        mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(2.0, -G)))
        body = mechanism.body("wheel", mass=1, inertia=0.1, position=(0, 0.4))
        if slow is None:
            mechanism.add(RollingWheel("road", mechanism.ground, body, (0, 0), (0, 0), (0, 1), radius=0.4))
        else:
            mechanism.add(
                PlaneContact(
                    "road", mechanism.ground, body, (0, 0), (0, 0), (0, 1), 0.4,
                    law="linear", stiffness=1e7, friction=0.8, slow=slow,
                )
            )  # fmt: skip
        mechanism.output("x", body.position[0], units="m")
        return float(uqmbd.simulate(mechanism, [0, 1.0], rtol=1e-8)["x"][-1])

    rolls = wheel(None)
    assert rolls == pytest.approx(2.0 / (1 + 0.1 / 0.16) / 2, rel=1e-8)
    slips = [wheel(slow) - rolls for slow in (0.04, 0.02, 0.01)]
    assert slips[0] > slips[1] > slips[2] > 0
    close(np.diff(np.log(slips)), np.log([0.5, 0.5]), relative=0.2)


@pytest.mark.thorough
def test_order_of_convergence(close):
    """The classical method of order 4 on the rates of an ensemble: halving the step divides the error by 16."""
    from uqmbd.dynamics import Ensemble, build

    model = build(disc(0.6, 4.0, -3.0))
    ensemble = Ensemble(model, np.zeros((1, 0)))

    def last(steps):
        z, h = ensemble.start.state, 0.5 / steps
        for k in range(steps):
            t = k * h
            a = ensemble.rates(t, z)
            b = ensemble.rates(t + h / 2, z + h / 2 * a)
            c = ensemble.rates(t + h / 2, z + h / 2 * b)
            z = z + h / 6 * (a + 2 * b + 2 * c + ensemble.rates(t + h, z + h * c))
        return z[0]

    found = [last(n) for n in (80, 160, 320, 640)]
    changes = [np.abs(y - x).max() for x, y in zip(found, found[1:], strict=False)]
    close(np.log2([changes[0] / changes[1], changes[1] / changes[2]]), [4, 4], relative=0.1)
    data = uqmbd.simulate(disc(0.6, 4.0, -3.0), [0, 0.5], rtol=1e-11)
    close(found[-1][:3], [float(data[name][-1]) for name in ("x", "y", "height")], relative=1e-6)


# -- impacts -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_a_rolling_wheel_hits_a_wall(restitution, close):
    """It rolls before and after: ``x' = -e x'``, and the turning goes with it; the road takes its impulse."""
    from uqmbd_contact import PlaneImpact

    radius, speed = 0.3, 2.0
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=2, inertia=0.05, position=(0, radius), velocity=(speed, 0))
    mechanism.add(RollingWheel("road", mechanism.ground, wheel, (0, 0), (0, 0), (0, 1), radius=radius))
    mechanism.add(
        PlaneImpact("wall", mechanism.ground, wheel, (1.3, 0), (0, 0), (-1, 0), radius=radius, restitution=restitution)
    )
    mechanism.output("x", wheel.position[0], units="m")
    mechanism.output("turning", wheel.angular_velocity[0], units="rad/s")
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    before = times < 0.5
    apart = np.abs(times - 0.5) > 0.01
    close(data["x"], np.where(before, speed * times, 1 - restitution * speed * (times - 0.5)), relative=1e-7)
    rolling = -np.where(before, speed, -restitution * speed) / radius
    close(data["turning"][apart], rolling[apart], relative=1e-7)


def test_a_rolling_sphere_hits_a_wall_aslant(close):
    """A smooth wall: along it all stays, across it ``v' = -e v``; the sphere rolls on, and its spin is what it was."""
    from uqmbd_contact import PlaneImpact

    radius, velocity, e = 0.2, np.array([1.0, 0.6, 0.0]), 0.7
    mechanism = uqmbd.Mechanism("sphere", uqmbd.Spatial(gravity=(0, 0, -G)))
    ball = mechanism.body(
        "ball", mass=1, inertia=(0.016,) * 3, position=(0, 0, radius), velocity=velocity,
        angular_velocity=np.cross(UP, velocity) / radius + [0, 0, 4],
    )  # fmt: skip
    mechanism.add(RollingSphere("floor", mechanism.ground, ball, ORIGIN, ORIGIN, UP, radius))
    wall = PlaneImpact("wall", mechanism.ground, ball, (0.7, 0, 0), ORIGIN, (-1, 0, 0), radius=radius, restitution=e)
    mechanism.add(wall)
    for k, axis in enumerate("xyz"):
        mechanism.output(axis, ball.position[k], units="m")
        mechanism.output(f"turning_{axis}", ball.angular_velocity[k], units="rad/s")
    times = np.linspace(0.05, 0.95, 10)
    data = uqmbd.simulate(mechanism, np.concatenate([[0], times]), rtol=1e-9).isel(time=slice(1, None))
    before = times < 0.5
    close(data["x"], np.where(before, times, 0.5 - e * (times - 0.5)), relative=1e-7)
    close(data["y"], 0.6 * times, relative=1e-7)
    close(data["turning_x"], np.full(10, -0.6 / radius), relative=1e-7)
    close(data["turning_y"], np.where(before, 1, -e) / radius, relative=1e-7)
    close(data["turning_z"], np.full(10, 4.0), relative=1e-7)


# -- at rest -----------------------------------------------------------------------------------------------------------
@pytest.mark.thorough
def test_equilibrium_and_frequency_of_a_rolling_wheel():
    """On a slope and a spring: ``k x = m g sin``, and ``w^2 = k / (m + J / R^2)``, in the plane and in space."""
    mass, inertia, radius, stiffness, slope = 2.0, 0.09, 0.3, 80.0, 3.0
    flat = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(slope, -G)))
    wheel = flat.body("wheel", mass=mass, inertia=inertia, position=(0.5, radius))
    flat.add(RollingWheel("road", flat.ground, wheel, (0, 0), (0, 0), (0, 1), radius=radius))
    flat.add(SpringDamper("spring", flat.ground, wheel, (-0.5, radius), (0, 0), stiffness, free_length=1))
    whole = uqmbd.Mechanism("wheel", uqmbd.Spatial(gravity=(slope, 0, -G)))
    ball = whole.body("wheel", mass=mass, inertia=(inertia,) * 3, position=(0.5, 0, radius))
    whole.add(RollingSphere("road", whole.ground, ball, ORIGIN, ORIGIN, UP, radius))
    whole.add(PointOnPlane("straight", whole.ground, ball, ORIGIN, ORIGIN, (0, 1, 0)))
    whole.add(SpringDamper("spring", whole.ground, ball, (-0.5, 0, radius), ORIGIN, stiffness, free_length=1))
    expected = np.sqrt(stiffness / (mass + inertia / radius**2)) / (2 * np.pi)
    for mechanism, body, bodies in ((flat, wheel, 1), (whole, ball, 2)):
        modes = uqmbd.eigenfrequencies(mechanism)
        assert modes.sizes["mode"] == bodies  # in space it may spin about the normal, too
        assert float(modes["frequency"].max()) == pytest.approx(expected, rel=1e-8)
        mechanism.output("x", body.position[0], units="m")
        mechanism.output("sine", body.direction((1, 0, 0)[: 3 if bodies == 2 else 2])[-1])
        mechanism.output("friction", mechanism.components["road"].reaction_force[0], units="N")
        sag, found = mass * slope / stiffness, uqmbd.static_equilibrium(mechanism)
        assert float(found["x"]) == pytest.approx(0.5 + sag, abs=1e-9)
        assert float(found["sine"]) == pytest.approx(-np.sin(sag / radius), rel=1e-6)
        assert float(found["friction"]) == pytest.approx(0, abs=1e-8)


def skate_on_a_spring(position):
    mechanism = uqmbd.Mechanism("skate", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=0.1, position=position)
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0.3, 0.2), 10))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1], units="m")
    return mechanism


@pytest.mark.thorough
def test_an_equilibrium_that_depends_on_the_way_is_refused():
    """A blade that turns as it glides reaches another place by another way; along its own axis there is one way only."""
    with pytest.raises(
        uqmbd.AssemblyError, match="depends on the motion before it, because 'blade: blade' constrain velocities only"
    ):
        uqmbd.static_equilibrium(skate_on_a_spring((0.8, -0.4)))
    mechanism = uqmbd.Mechanism("skate", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=0.1, position=(0.8, -0.4))
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), 10))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1], units="m")
    found = uqmbd.static_equilibrium(mechanism)
    assert float(found["x"]) == pytest.approx(0, abs=1e-9) and float(found["y"]) == pytest.approx(-0.4, abs=1e-9)
