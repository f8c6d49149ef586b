"""Screws, gears, racks, drivers of speed and loads of one body against closed forms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from scipy.special import erf, fresnel

import uqmbd
from uqmbd_drivers import LinearSpeedDriver, SpeedDriver
from uqmbd_joints import Gear, PointOnLine, Prismatic, RackAndPinion, Revolute, Screw
from uqmbd_springs import FollowerForce, Gravity, PointForce, Torque, TorsionSpringDamper

G = 9.81
ORIGIN = (0, 0, 0)
AXIS = np.array([1.0, 2.0, 2.0]) / 3
Z = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}


def along(axis, vector):
    return sum(a * x for a, x in zip(axis, vector, strict=True))


# -- screw --------------------------------------------------------------------------------------------------------------
@pytest.mark.thorough
@pytest.mark.parametrize("pitch", [0.05, -0.3])
def test_a_nut_on_a_thread(pitch, close, energy):
    """(J + m h^2) w' = M - m g h with h = pitch / 2 pi, over many turns; T = (J + m h^2) w^2 / 2; and what it carries."""
    mass, inertia, moment, h = 2.0, 0.01, 0.1, pitch / (2 * np.pi)
    mechanism = uqmbd.Mechanism("screw", uqmbd.Spatial(gravity=-G * AXIS))
    nut = mechanism.body("nut", mass=mass, inertia=(inertia,) * 3, position=(1, 0, 0), quaternion=(0.5, 0.5, -0.5, 0.5))
    screw = mechanism.add(Screw("thread", mechanism.ground, nut, at=(1, 0, 0), axis=AXIS, pitch=pitch))
    mechanism.add(Torque("motor", nut, moment * AXIS))
    mechanism.output("s", along(AXIS, nut.position) - AXIS[0], units="m")
    mechanism.output("w", along(AXIS, nut.angular_velocity), units="rad/s")
    mechanism.output("thrust", along(AXIS, screw.reaction_force), units="N")
    mechanism.output("moment", along(AXIS, screw.reaction_moment), units="N m")
    times = np.linspace(0, 6, 25)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    whole = inertia + mass * h**2
    rate = (moment - mass * G * h) / whole
    assert abs(rate) * times[-1] ** 2 / 2 > 10 * 2 * np.pi
    close(data["w"], rate * times, relative=1e-7)
    close(data["s"], h * rate * times**2 / 2, relative=1e-7)
    close(data["thrust"], np.full(25, mass * (G + h * rate)), relative=1e-6)
    close(data["moment"], np.full(25, inertia * rate - moment), relative=1e-5, scale=moment)
    close(energy(mechanism, times)[0], whole * (rate * times) ** 2 / 2, relative=1e-5)


@pytest.mark.thorough
def test_a_screw_between_two_free_bodies(close):
    """Without loads: relative spin w0 and slide h w0 persist, and those of the first body are what momentum demands."""
    pitch, spin = 0.2, 3.0
    h = pitch / (2 * np.pi)
    mechanism = uqmbd.Mechanism("bolt and nut", uqmbd.Spatial())
    bolt = mechanism.body("bolt", mass=3, inertia=(0.02,) * 3, velocity=ORIGIN, angular_velocity=ORIGIN)
    nut = mechanism.body("nut", mass=1, inertia=(0.01,) * 3, velocity=(0, 0, h * spin), angular_velocity=(0, 0, spin))
    mechanism.add(Screw("thread", bolt, nut, ORIGIN, ORIGIN, **Z, pitch=pitch))
    mechanism.output("w1", bolt.angular_velocity[2], units="rad/s")
    mechanism.output("w2", nut.angular_velocity[2], units="rad/s")
    mechanism.output("s", nut.position[2] - bolt.position[2], units="m")
    times = np.linspace(0, 8, 17)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["w1"], 0, scale=spin, relative=1e-7)
    close(data["w2"], np.full(17, spin), relative=1e-7)
    close(data["s"], h * spin * times, relative=1e-7)


# -- gears --------------------------------------------------------------------------------------------------------------
@pytest.mark.thorough
@pytest.mark.parametrize("mesh", ["external", "internal"])
@pytest.mark.parametrize("space", ["planar", "spatial", "bevel"])
def test_a_gear_pair(space, mesh, close):
    """(J1 + J2 / n^2) w1' = M, w2 = -+ w1 / n, and the moment on the second is J2 w2'; over many turns."""
    ratio, first, second, moment = 2.5, 0.3, 0.8, 1.7
    flat = space == "planar"
    mechanism = uqmbd.Mechanism("gears", uqmbd.Planar() if flat else uqmbd.Spatial())
    axis = (1, 0, 0) if space == "bevel" else (0, 0, 1)
    wheels = []
    for k, (inertia, turned) in enumerate(((first, (0, 0, 1)), (second, axis))):
        place = (k, 0) if flat else (k, 0, 0)
        wheel = mechanism.body(f"wheel {k}", mass=1, inertia=inertia if flat else (inertia,) * 3, position=place)
        axes = {} if flat else {"axis": turned}
        wheels.append(wheel)
        mechanism.add(Revolute(f"bearing {k}", mechanism.ground, wheel, at=place, **axes))
    axes = {} if flat else {"axis_i": (0, 0, 1), "axis_j": axis}
    gear = mechanism.add(Gear("mesh", *wheels, ratio, mesh=mesh, **axes))
    mechanism.add(Torque("motor", wheels[0], moment if flat else (0, 0, moment)))
    spins = [
        w.angular_velocity if flat else along(a, w.angular_velocity)
        for w, a in zip(wheels, ((0, 0, 1), axis), strict=True)
    ]
    for k, spin in enumerate(spins):
        mechanism.output(f"w{k}", spin, units="rad/s")
    mechanism.output("moment", gear.reaction_moment if flat else along(axis, gear.reaction_moment), units="N m")
    times = np.linspace(0, 6, 13)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    rate = moment / (first + second / ratio**2)
    sense = -1 if mesh == "external" else 1
    assert rate * times[-1] ** 2 / 2 > 8 * 2 * np.pi
    close(data["w0"], rate * times, relative=1e-7)
    close(data["w1"], sense * rate * times / ratio, relative=1e-7)
    close(data["moment"], np.full(13, sense * second * rate / ratio), relative=1e-6)


def planetary(space):
    """Sun (20 teeth), two or three planets of 30 on a carrier, ring of 80 that turns as well."""
    flat = space == "planar"
    mechanism = uqmbd.Mechanism("planetary", uqmbd.Planar() if flat else uqmbd.Spatial())
    ground, arm = mechanism.ground, 0.25

    def body(name, inertia, mass=1.0, place=(0, 0)):
        made = inertia if flat else (inertia,) * 3
        return mechanism.body(name, mass=mass, inertia=made, position=place if flat else (*place, 0))

    def hinge(name, i, j, place):
        where = {"at": place} if flat else {"at": (*place, 0), "axis": (0, 0, 1)}
        mechanism.add(Revolute(name, i, j, **where))

    sun, ring, carrier = body("sun", 0.02), body("ring", 0.5), body("carrier", 0.1)
    planet = body("planet", 0.03, mass=0.7, place=(arm, 0))
    for part in (sun, ring, carrier):
        hinge(f"bearing of {part.name}", ground, part, (0, 0))
    hinge("pin", carrier, planet, (arm, 0))
    axis = {} if flat else {"axis": (0, 0, 1)}
    mechanism.add(Gear("inner", sun, planet, 30 / 20, carrier=carrier, **axis))
    mechanism.add(Gear("outer", ring, planet, 30 / 80, mesh="internal", carrier=carrier, **axis))
    parts = {"sun": sun, "ring": ring, "carrier": carrier, "planet": planet}
    for name, part in parts.items():
        mechanism.output(name, part.angular_velocity if flat else part.angular_velocity[2], units="rad/s")
    return mechanism, parts, flat


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_planetary_gear_obeys_willis(space, close):
    """(w_sun - w_carrier) / (w_ring - w_carrier) = - 80 / 20 with sun and carrier driven; the planet likewise."""
    mechanism, parts, flat = planetary(space)
    for name, speed in (("sun", 12 + 3 * sympy.sin(2 * uqmbd.t)), ("carrier", -5)):
        axis = {} if flat else {"axis": (0, 0, 1)}
        mechanism.add(SpeedDriver(f"drive of {name}", mechanism.ground, parts[name], speed, **axis))
    times = np.linspace(0, 5, 21)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    sun, carrier = 12 + 3 * np.sin(2 * times), np.full(21, -5.0)
    close(data["sun"], sun, relative=1e-6)
    close(data["ring"], carrier - 20 / 80 * (sun - carrier), relative=1e-6)
    close(data["planet"], carrier - 20 / 30 * (sun - carrier), relative=1e-6)


@pytest.mark.thorough
def test_a_planetary_gear_shares_a_torque(close):
    """With the ring held by the ground: the sun feels all inertias, each by the square of its speed ratio."""
    mechanism, parts, _ = planetary("planar")
    mechanism.add(SpeedDriver("brake", mechanism.ground, parts["ring"], 0))
    mechanism.add(Torque("motor", parts["sun"], 0.4))
    times = np.linspace(0, 6, 13)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    carrier = 1 / (1 + 80 / 20)
    planet = carrier * (1 - 80 / 30)
    whole = 0.02 + (0.1 + 0.7 * 0.25**2) * carrier**2 + 0.03 * planet**2
    close(data["sun"], 0.4 / whole * times, relative=1e-7)
    close(data["carrier"], carrier * 0.4 / whole * times, relative=1e-7)
    close(data["planet"], planet * 0.4 / whole * times, relative=1e-7)


def test_geared_shafts_swing_at_the_frequency_of_the_reduced_inertia():
    """A spring on the first of two wheels: sqrt(c / (J1 + J2 / n^2)); the counted angles are no modes of their own."""
    mechanism = uqmbd.Mechanism("gears", uqmbd.Planar())
    wheels = [mechanism.body(f"wheel {k}", mass=1, inertia=x, position=(k, 0)) for k, x in enumerate((0.3, 0.8))]
    for k, wheel in enumerate(wheels):
        mechanism.add(Revolute(f"bearing {k}", mechanism.ground, wheel, at=(k, 0)))
    mechanism.add(Gear("mesh", *wheels, 2.5))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, wheels[0], stiffness=7))
    expected = np.sqrt(7 / (0.3 + 0.8 / 2.5**2)) / (2 * np.pi)
    np.testing.assert_allclose(uqmbd.eigenfrequencies(mechanism)["frequency"], [expected], rtol=1e-9)


def test_a_gear_that_nothing_carries_says_so():
    mechanism = uqmbd.Mechanism("planetary", uqmbd.Planar())
    planet = mechanism.body("planet", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match=r"Gear 'mesh': body_i and the carrier are both the ground.*carrier="):
        mechanism.add(Gear("mesh", mechanism.ground, planet, 2))


# -- rack and pinion ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_wheel_rolls_down(space, close):
    """a = g sin / (1 + J / (m r^2)); the ground holds it back with m (g sin - a), and it turns a / r."""
    mass, inertia, radius, slope = 2.0, 0.05, 0.2, 0.4
    flat = space == "planar"
    down = (np.cos(slope), -np.sin(slope)) + (() if flat else (0.0,))
    zero = (0.0,) * len(down)
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar((0, -G)) if flat else uqmbd.Spatial((0, -G, 0)))
    made = inertia if flat else (0.03, 0.03, inertia)
    wheel = mechanism.body("wheel", mass=mass, inertia=made, position=(0.3, -0.2) + zero[2:])
    if flat:
        mechanism.add(PointOnLine("path", mechanism.ground, wheel, at=wheel.pose.q[:2], axis=down))
        axis, spin = {}, wheel.angular_velocity
    else:
        # a hinge on a carriage that slides, both without mass to speak of
        axle = mechanism.body("axle", mass=1e-9, inertia=(1e-9,) * 3, position=(0.3, -0.2, 0))
        mechanism.add(Prismatic("path", mechanism.ground, axle, at=(0.3, -0.2, 0), axis=down))
        mechanism.add(Revolute("bearing", axle, wheel, at=(0.3, -0.2, 0), axis=(0, 0, 1)))
        axis, spin = {"axis_j": (0, 0, 1)}, wheel.angular_velocity[2]
    # downhill it turns clockwise
    rolling = mechanism.add(RackAndPinion("rolling", mechanism.ground, wheel, zero, zero, down, radius=-radius, **axis))
    mechanism.output("s", along(down, wheel.position), units="m")
    mechanism.output("w", spin, units="rad/s")
    mechanism.output("hold", along(down, rolling.reaction_force), units="N")
    times = np.linspace(0, 3, 13)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    rate = G * np.sin(slope) / (1 + inertia / (mass * radius**2))
    assert rate * times[-1] ** 2 / 2 / radius > 2 * 2 * np.pi
    close(data["s"] - data["s"][0], rate * times**2 / 2, relative=1e-6)
    close(data["w"], -rate * times / radius, relative=1e-6)
    close(data["hold"], np.full(13, mass * (rate - G * np.sin(slope))), relative=1e-6)


@pytest.mark.thorough
def test_a_rack_turns_a_pinion(close):
    """A force on the rack: (m + J / r^2) a = F; the pinion, whose axis stays, turns by -a / r per radius."""
    mechanism = uqmbd.Mechanism("steering", uqmbd.Planar())
    rack = mechanism.body("rack", mass=1.5, inertia=1, position=(0.2, 0.4), angle=0.7)
    pinion = mechanism.body("pinion", mass=1, inertia=0.02, position=(0, 0.5), angle=-2)
    way = (np.cos(0.3), np.sin(0.3))
    mechanism.add(Prismatic("guide", mechanism.ground, rack, at=(0, 0), axis=way))
    mechanism.add(Revolute("bearing", mechanism.ground, pinion, at=(0, 0.5)))
    local = (np.cos(0.3 - 0.7), np.sin(0.3 - 0.7))
    mechanism.add(RackAndPinion("mesh", rack, pinion, (0.1, 0.1), (0, 0), local, radius=0.1))
    mechanism.add(PointForce("pull", rack, (0, 0), [2 * x for x in way]))
    mechanism.output("s", along(way, rack.position), units="m")
    mechanism.output("angle", pinion.angle, units="rad")
    times = np.linspace(0, 4, 9)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    rate = 2 / (1.5 + 0.02 / 0.1**2)
    close(data["s"] - data["s"][0], rate * times**2 / 2, relative=1e-7)
    close(data["angle"], -2 - rate * times**2 / 2 / 0.1, relative=1e-7)


# -- drivers of speed ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_rod_driven_at_a_speed(space, close):
    """Speed 3 + 2 sin 5t, started as drawn: torque = m l^2/3 theta'' + m g l/2 cos theta."""
    flat, start = space == "planar", 0.8
    speed = 3 + 2 * sympy.sin(5 * uqmbd.t)
    place = (0.5 * np.cos(start), 0.5 * np.sin(start))
    if flat:
        mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -G)))
        rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=place, angle=start)
        mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
        driver = mechanism.add(SpeedDriver("motor", mechanism.ground, rod, speed))
        moment, rate = driver.reaction_moment, rod.angular_velocity
    else:
        mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial(gravity=(0, -G, 0)))
        turned = (np.cos(start / 2), 0, 0, np.sin(start / 2))
        rod = mechanism.body("rod", mass=1, inertia=(1e-3, 1 / 12, 1 / 12), position=(*place, 0), quaternion=turned)
        mechanism.add(Revolute("pivot", mechanism.ground, rod, ORIGIN, (-0.5, 0, 0), **Z))
        driver = mechanism.add(SpeedDriver("motor", mechanism.ground, rod, speed, axis_j=(0, 0, 1)))
        moment, rate = driver.reaction_moment[2], rod.angular_velocity[2]
    mechanism.output("torque", moment, units="N m")
    mechanism.output("rate", rate, units="rad/s")
    mechanism.output("x", 2 * rod.position[0], units="m")
    times = np.linspace(0, 8, 41)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    angle = start + 3 * times + 0.4 * (1 - np.cos(5 * times))
    close(data["x"], np.cos(angle), relative=1e-6)
    close(data["rate"], 3 + 2 * np.sin(5 * times), relative=1e-6)
    close(data["torque"], 10 / 3 * np.cos(5 * times) + G / 2 * np.cos(angle), relative=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [20, -20])
def test_a_speed_is_kept_for_a_long_time(speed, close):
    """2000 rad, more than 300 turns, in the plane and between two moving bodies."""
    mechanism = uqmbd.Mechanism("wheels", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=2, angle=2.5)
    other = mechanism.body("other", mass=1, inertia=2, angle=-1)
    mechanism.add(Revolute("pivot", mechanism.ground, wheel, at=(0, 0)))
    mechanism.add(Revolute("pin", wheel, other, at=(0, 0)))
    mechanism.add(SpeedDriver("motor", mechanism.ground, wheel, speed))
    mechanism.add(SpeedDriver("counter", wheel, other, -speed))
    mechanism.output("angle", wheel.angle, units="rad")
    mechanism.output("other", other.angle, units="rad")
    times = np.array([0, 1, 50, 99, 100])
    data = uqmbd.simulate(mechanism, times, rtol=1e-7)
    close(data["angle"], 2.5 + speed * times, relative=1e-8)
    close(data["other"], np.full(5, -1.0), relative=1e-5)


def test_a_speed_without_an_elementary_integral(close):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=2)
    mechanism.add(SpeedDriver("motor", mechanism.ground, wheel, 4 * sympy.exp(-(uqmbd.t**2))))
    mechanism.output("angle", wheel.angle, units="rad")
    times = np.linspace(0, 3, 13)
    close(uqmbd.simulate(mechanism, times, rtol=1e-9)["angle"], 2 * np.sqrt(np.pi) * erf(times), relative=1e-7)


@pytest.mark.parametrize("space", [uqmbd.Translational, uqmbd.Planar, uqmbd.Spatial])
def test_a_slide_driven_at_a_speed(space, close):
    """Straight up at 0.5 + cos 2t from where it is drawn: the driver carries m (g + a)."""
    d = space().dimension
    up, zero = (0, 1, 0)[:d], (0, 0, 0)[:d]
    mechanism = uqmbd.Mechanism("lift", space(gravity=tuple(-G * x for x in up)))
    more = {} if space is uqmbd.Translational else {"inertia": 1 if d == 2 else (1, 1, 1)}
    body = mechanism.body("cabin", mass=3, position=(0, 0.7, 0)[:d], **more)
    kind = PointOnLine if space is uqmbd.Translational else Prismatic
    mechanism.add(kind("shaft", mechanism.ground, body, at=zero, axis=up))
    driver = LinearSpeedDriver("rope", mechanism.ground, body, zero, zero, up, 0.5 + sympy.cos(2 * uqmbd.t))
    mechanism.add(driver)
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("v", body.velocity[1], units="m/s")
    mechanism.output("pull", driver.reaction_force[1], units="N")
    times = np.linspace(0, 10, 41)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    close(data["y"], 0.7 + 0.5 * times + np.sin(2 * times) / 2, relative=1e-6)
    close(data["v"], 0.5 + np.cos(2 * times), relative=1e-6)
    close(data["pull"], 3 * (G - 2 * np.sin(2 * times)), relative=1e-6)


# -- loads of one body --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_thrust_turns_with_its_body(space, close):
    """At a constant spin w: v = F/(m w) (sin wt, 1 - cos wt)."""
    flat, spin = space == "planar", 3.0
    mechanism = uqmbd.Mechanism("rocket", uqmbd.Planar() if flat else uqmbd.Spatial())
    more = {"inertia": 1, "angular_velocity": spin} if flat else {"inertia": (1,) * 3, "angular_velocity": (0, 0, spin)}
    body = mechanism.body("rocket", mass=2, **more)
    mechanism.add(FollowerForce("thrust", body, (0, 0) if flat else ORIGIN, (5, 0) if flat else (5, 0, 0)))
    for k in range(2):
        mechanism.output(f"v{k}", body.velocity[k], units="m/s")
    times = np.linspace(0, 4, 17)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["v0"], 5 / 6 * np.sin(3 * times), relative=1e-6)
    close(data["v1"], 5 / 6 * (1 - np.cos(3 * times)), relative=1e-6)


def test_a_thrust_beside_the_centre_of_mass(close):
    """The angle grows as M t^2 / 2J: the velocity is a Fresnel integral (Cornu's spiral)."""
    mechanism = uqmbd.Mechanism("rocket", uqmbd.Planar())
    body = mechanism.body("rocket", mass=2, inertia=0.5)
    mechanism.add(FollowerForce("thrust", body, (-1, -0.3), (5, 0)))
    mechanism.output("angle", body.angle, units="rad")
    for k in range(2):
        mechanism.output(f"v{k}", body.velocity[k], units="m/s")
    times = np.linspace(0, 5, 21)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    rate = 0.3 * 5 / 0.5
    scale = np.sqrt(np.pi / rate)
    sine, cosine = fresnel(times / scale)
    close(data["angle"], rate * times**2 / 2, relative=1e-7)
    close(data["v0"], 2.5 * scale * cosine, relative=1e-6)
    close(data["v1"], 2.5 * scale * sine, relative=1e-6)


@pytest.mark.parametrize("space", [uqmbd.Translational, uqmbd.Planar, uqmbd.Spatial])
def test_gravity_of_one_body(space, close):
    """Two bodies in one field, of which one is relieved of it and the other pulled aside."""
    d = space().dimension
    field = (0.5, -G, 1.0)[:d]
    mechanism = uqmbd.Mechanism("field", space(gravity=field))
    more = {} if space is uqmbd.Translational else {"inertia": 1 if d == 2 else (1, 1, 1)}
    still, fast = (mechanism.body(name, mass=3, **more) for name in ("still", "fast"))
    mechanism.add(Gravity("relief", still, [-x for x in field]))
    mechanism.add(Gravity("pull", fast, (2, 0, 0)[:d]))
    for body in (still, fast):
        for k in range(d):
            mechanism.output(f"{body.name}{k}", body.position[k], units="m")
    times = np.linspace(0, 2, 5)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    for k in range(d):
        close(data[f"still{k}"], 0, scale=1, relative=1e-9)
        close(data[f"fast{k}"], (field[k] + 2 * (k == 0)) * times**2 / 2, scale=G, relative=1e-8)


@pytest.mark.thorough
def test_gravity_of_a_body_acts_at_its_centre_of_mass(observe, series, close):
    """A spatial pendulum with an offset centre of mass and a random mass falls as in a field of the space."""
    runs = []
    mass = 2 * uqmbd.RandomVariable("mass", chaospy.Uniform(0.9, 1.1))
    for own in (True, False):
        mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=ORIGIN if own else (1, 2, -G)))
        body = mechanism.body("rod", mass=mass, inertia=(0.1, 0.2, 0.2), com=(0.5, 0.2, 0.1))
        mechanism.add(Revolute("pivot", mechanism.ground, body, at=ORIGIN, axis=(0, 1, 0)))
        if own:
            mechanism.add(Gravity("weight", body, (1, 2, -G)))
        observe(mechanism, q=body.quaternion, w=body.angular_velocity)
        runs.append(uqmbd.simulate(mechanism, np.linspace(0, 2, 11), rtol=1e-9, values={"mass": 1.05}))
    for name in ("q", "w"):
        close(series(runs[0], name), series(runs[1], name), relative=1e-7)
    assert np.ptp(series(runs[0], "w")[:, 1]) > 3
