"""Eigenvalues about steady motions, against closed forms, equations written by hand, and simulated small motions."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver, RotationDriver, SpeedDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance, PointOnLine, Prismatic, Revolute, Spherical
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Bushing, PointForce, RotationalFriction, SpringDamper, TorsionSpringDamper

G = 9.81
UP, ACROSS, ORIGIN = (0, 0, 1), (0, 1, 0), (0, 0, 0)


def turned(angle, axis=ACROSS):
    return (sympy.cos(angle / 2), *(sympy.sin(angle / 2) * x for x in axis))


def shaft_and_arms(angles, length=1.0, inertia=1.0, gravity=-G):
    """Arms of a point mass each, hinged on the axis of a shaft; drawn at angles from hanging."""
    mechanism = uqmbd.Mechanism("governor", uqmbd.Spatial(gravity=(0, 0, gravity)))
    shaft = mechanism.body("shaft", mass=1, inertia=(inertia,) * 3, quaternion=(1, 0, 0, 0))
    bearing = mechanism.add(Revolute("bearing", mechanism.ground, shaft, ORIGIN, ORIGIN, axis_i=UP, axis_j=UP))
    hinges = []
    for k, angle in enumerate(angles):
        arm = mechanism.body(f"arm{k}", mass=1, inertia=(0, 0, 0), com=(0, 0, -length), quaternion=turned(angle))
        hinges.append(mechanism.add(Revolute(f"hinge{k}", shaft, arm, ORIGIN, ORIGIN, axis_i=ACROSS, axis_j=ACROSS)))
        mechanism.add(RotationalFriction(f"rub{k}", shaft, arm, friction=0, damping=0, axis_i=ACROSS))
    return mechanism, shaft, bearing, hinges


def driven(mechanism, shaft, speed):
    mechanism.add(RotationDriver("motor", mechanism.ground, shaft, angle=speed * uqmbd.t, axis_i=UP, axis_j=UP))


def imaginary(mechanism, **options):
    """Imaginary parts of the eigenvalues that oscillate, rad/s, ascending."""
    found = uqmbd.eigenfrequencies(mechanism, at="steady", **options)
    return np.sort(found["eigenvalue_imaginary"].values[found["eigenvalue_imaginary"].values > 0])


@pytest.mark.parametrize("drawn", [0.3, 1.0, 1.5])
def test_pendulum_on_a_turning_shaft(drawn):
    """omega^2 = Omega^2 - (g / l)^2 / Omega^2 about the angle with cos = g / (l Omega^2): 4.599 rad/s at 5 rad/s."""
    mechanism, shaft, _, _ = shaft_and_arms([drawn])
    driven(mechanism, shaft, 5.0)
    assert imaginary(mechanism) == pytest.approx([np.sqrt(25 - (G / 5) ** 2)], rel=1e-8)
    assert imaginary(mechanism)[0] == pytest.approx(4.599, abs=5e-4)


@pytest.mark.parametrize("speed", [0.0, 2.0, 3.0])
def test_pendulum_that_hangs_while_its_shaft_turns(speed):
    """omega^2 = g / l - Omega^2; at rest that of the static equilibrium."""
    mechanism, shaft, _, _ = shaft_and_arms([0.0])
    driven(mechanism, shaft, speed)
    assert imaginary(mechanism) == pytest.approx([np.sqrt(G - speed**2)], rel=1e-8)


def test_pendulum_whose_shaft_lies():
    """A hinge parallel to the axis that turns it, without gravity, a distance r away: omega^2 = Omega^2 r / l."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    blade = mechanism.body("blade", mass=1, inertia=0, com=(0.5, 0), position=(0.3, 0), angle=0.4)
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(SpeedDriver("motor", mechanism.ground, table, speed=7.0))
    mechanism.add(Revolute("flap", table, blade, (0.3, 0), (0, 0)))
    mechanism.output("angle", uqmbd.at_steady(blade.angle - table.angle))
    assert imaginary(mechanism) == pytest.approx([7 * np.sqrt(0.3 / 0.5)], rel=1e-8)
    assert float(uqmbd.simulate(mechanism, [0, 1])["angle"]) == pytest.approx(0, abs=1e-8)


def test_a_pendulum_that_is_held_falls_over():
    """Hanging above its critical speed: one growing and one decaying mode, of sqrt(Omega^2 - g / l)."""
    mechanism, shaft, _, _ = shaft_and_arms([0.0])
    driven(mechanism, shaft, 5.0)
    found = uqmbd.eigenfrequencies(mechanism, at="steady")
    rate = np.sqrt(25 - G)
    np.testing.assert_allclose(np.sort(found["eigenvalue_real"]), [-rate, rate], rtol=1e-8)
    np.testing.assert_allclose(np.sort(found["damping_ratio"]), [-1, 1])


@pytest.mark.thorough
def test_damping_and_a_spring_on_a_turning_hinge():
    """theta'' + c theta' + k theta = Omega^2 sin theta cos theta - g sin theta, of a unit mass, linearised by hand."""
    c, k, speed = 0.8, 3.0, 6.0
    mechanism, shaft, _, _ = shaft_and_arms([0.9])
    driven(mechanism, shaft, speed)
    spring = TorsionSpringDamper(
        "spring", shaft, mechanism.bodies["arm0"], stiffness=k, damping=c, axis_i=ACROSS, axis_j=ACROSS
    )
    mechanism.add(spring)
    x = sympy.Symbol("x")
    moment = speed**2 * sympy.sin(x) * sympy.cos(x) - G * sympy.sin(x) - k * x
    angle = float(sympy.nsolve(moment, x, 1.0))
    stiffness = -float(moment.diff(x).subs(x, angle))
    found = uqmbd.eigenfrequencies(mechanism, at="steady")
    assert found["frequency"].values == pytest.approx([np.sqrt(stiffness) / (2 * np.pi)], rel=1e-7)
    assert found["damping_ratio"].values == pytest.approx([c / (2 * np.sqrt(stiffness))], rel=1e-7)


@pytest.mark.thorough
def test_governor_on_a_driven_and_on_a_free_shaft():
    """Two arms: alike on a driven shaft; on a free one the angular momentum is kept when they move together."""
    speed, inertia = 5.0, 0.7
    apart = np.sqrt(speed**2 - (G / speed) ** 2)
    mechanism, shaft, _, _ = shaft_and_arms([0.9, -1.2], inertia=inertia)
    driven(mechanism, shaft, speed)
    assert imaginary(mechanism) == pytest.approx([apart, apart], rel=1e-7)
    mechanism, shaft, bearing, _ = shaft_and_arms([0.9, -1.2], inertia=inertia)
    mechanism.start(bearing.speed, speed)
    x = sympy.Symbol("x")
    about = inertia + 2 * sympy.sin(x) ** 2
    angle = np.arccos(G / speed**2)
    momentum = float(about.subs(x, angle)) * speed
    energy = momentum**2 / (2 * about) - 2 * G * sympy.cos(x)
    together = np.sqrt(float(energy.diff(x, 2).subs(x, angle)) / 2)
    assert imaginary(mechanism) == pytest.approx(sorted([apart, together]), rel=1e-7)
    found = uqmbd.eigenfrequencies(mechanism, at="steady")["frequency"].values
    assert np.sum(found == 0) == 1  # the shaft turns on


def top(spin, precession, angle, m=1.0, arm=0.5, i1=0.6, i3=0.2):
    """A top on a point, in space; i1 and i3 about the point; with angular velocities as given."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial(gravity=(0, 0, -G)))
    own = (-precession * np.sin(angle), 0, precession * np.cos(angle) + spin)
    body = mechanism.body(
        "top", mass=m, inertia=(i1 - m * arm**2, i1 - m * arm**2, i3), com=(0, 0, arm), quaternion=turned(angle),
        angular_velocity=own, velocity=(0, 0, 0),
    )  # fmt: skip
    mechanism.add(Spherical("point", mechanism.ground, body, ORIGIN, ORIGIN))
    return mechanism, body


def steady_top(precession, angle, m=1.0, arm=0.5, i1=0.6, i3=0.2):
    """Spin of a steady precession: i3 omega3 Omega = m g arm + i1 Omega^2 cos; omega3 is spin + Omega cos."""
    total = (m * G * arm + i1 * precession**2 * np.cos(angle)) / (i3 * precession)
    return total - precession * np.cos(angle), total


@pytest.mark.thorough
def test_nutation_of_a_top_in_steady_precession():
    """The second derivative of the effective potential (Goldstein, Classical Mechanics, section 5.7)."""
    precession, angle, m, arm, i1, i3 = 1.7, 0.8, 1.0, 0.5, 0.6, 0.2
    spin, total = steady_top(precession, angle)
    mechanism, body = top(spin, precession, angle)
    x = sympy.Symbol("x")
    own, upright = i3 * total, i1 * precession * np.sin(angle) ** 2 + i3 * total * np.cos(angle)
    energy = (upright - own * sympy.cos(x)) ** 2 / (2 * i1 * sympy.sin(x) ** 2) + m * G * arm * sympy.cos(x)
    assert float(energy.diff(x).subs(x, angle)) == pytest.approx(0, abs=1e-9)
    nutation = np.sqrt(float(energy.diff(x, 2).subs(x, angle)) / i1)
    assert imaginary(mechanism) == pytest.approx([nutation], rel=1e-6)


@pytest.mark.slow
def test_a_top_that_nutates_is_not_taken_for_steady():
    spin, _ = steady_top(1.7, 0.8)
    mechanism, body = top(1.2 * spin, 1.7, 0.8)
    with pytest.raises(uqmbd.AssemblyError, match="no steady motion was found from the start pose: "):
        uqmbd.eigenfrequencies(mechanism, at="steady")


@pytest.mark.parametrize("attitude", [(1, 0, 0, 0), (0.6, 0.1, -0.3, 0.7), (0.2, 0.9, 0.4, -0.1)])
def test_a_free_symmetric_body_wobbles(attitude):
    """Euler: seen from the world a spinning body nutates at i3 / i1 of its spin, whichever way it points."""
    attitude = tuple(np.array(attitude) / np.linalg.norm(attitude))
    mechanism = uqmbd.Mechanism("body", uqmbd.Spatial())
    mechanism.body("body", mass=1, inertia=(2, 2, 3), quaternion=attitude, angular_velocity=(0, 0, 4))
    assert imaginary(mechanism) == pytest.approx([4 * 3 / 2], rel=1e-9)


def rotor(stiffness, inertia, spin):
    """A rotor in bearings at both ends of its axle, 0.4 m from its centre; stiffness of each in x and y."""
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Spatial())
    disc = mechanism.body("disc", mass=3, inertia=inertia, quaternion=(1, 0, 0, 0), angular_velocity=(0, 0, spin))
    for name, z in (("upper", 0.4), ("lower", -0.4)):
        bearing = (*stiffness, 500, 0, 0, 0)
        mechanism.add(Bushing(name, mechanism.ground, disc, (0, 0, z), (0, 0, z), stiffness=bearing))
    return mechanism


def test_whirl_of_a_rotor_in_bearings():
    """Forward and backward whirl, seen from the bearings: i1 w^2 -+ i3 Omega w - 2 k a^2 = 0."""
    k, i1, i3, spin = 1000.0, 0.2, 0.3, 60.0
    conical = 2 * k * 0.4**2
    split = np.sqrt((i3 * spin) ** 2 + 4 * i1 * conical)
    expected = [np.sqrt(2 * k / 3)] * 2 + [
        np.sqrt(1000 / 3),
        (split - i3 * spin) / (2 * i1),
        (split + i3 * spin) / (2 * i1),
    ]
    found = imaginary(rotor((k, k), (i1, i1, i3), spin))
    np.testing.assert_allclose(found, np.sort(expected), rtol=1e-8)


def whirl(mass, gyroscopic, stiffness):
    n = len(mass)
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, x) for x in (stiffness, gyroscopic)]])
    values = np.linalg.eigvals(matrix)
    return np.sort(values.imag[values.imag > 1e-9])


@pytest.mark.thorough
def test_an_even_rotor_in_uneven_bearings():
    """Seen from the bearings the coefficients are constant: equations of the tilts by hand."""
    kx, ky, i1, i3, spin, a2 = 1500.0, 700.0, 0.2, 0.3, 50.0, 2 * 0.4**2
    tilts = whirl(i1 * np.eye(2), i3 * spin * np.array([[0, 1], [-1, 0]]), np.diag([ky * a2, kx * a2]))
    expected = [np.sqrt(2 * kx / 3), np.sqrt(2 * ky / 3), np.sqrt(1000 / 3), *tilts]
    np.testing.assert_allclose(imaginary(rotor((kx, ky), (i1, i1, i3), spin)), np.sort(expected), rtol=1e-8)


@pytest.mark.thorough
def test_an_uneven_rotor_in_even_bearings():
    """Seen from the rotor they are: equations of the tilts in its axes by hand, and Coriolis' of its centre."""
    k, spin = 1000.0, 20.0
    ix, iy, iz = 0.2, 0.25, 0.3
    turn = np.array([[0, -1], [1, 0]])
    inertia = np.diag([ix, iy])
    # body axes, angular velocity (a' - spin b, b' + spin a, spin): Euler's equations, linearised
    gyroscopic = spin * np.array([[0, iz - ix - iy], [ix + iy - iz, 0]])
    stiffness = spin**2 * np.diag([iz - iy, iz - ix]) + 2 * k * 0.4**2 * np.eye(2)
    centre = whirl(np.eye(2), 2 * spin * turn, (2 * k / 3 - spin**2) * np.eye(2))
    expected = [*whirl(inertia, gyroscopic, stiffness), *centre, np.sqrt(1000 / 3)]
    np.testing.assert_allclose(imaginary(rotor((k, k), (ix, iy, iz), spin)), np.sort(expected), rtol=1e-8)


def test_an_uneven_rotor_in_uneven_bearings_has_no_eigenvalues():
    with pytest.raises(uqmbd.AssemblyError, match="the coefficients of small motions .* change with time"):
        uqmbd.eigenfrequencies(rotor((1500, 700), (0.2, 0.25, 0.3), 20.0), at="steady")


@pytest.mark.thorough
def test_a_stiffness_that_turns_slowly_is_seen_beside_a_fast_spin():
    """A rotor on an uneven carrier that turns slowly, in uneven bearings: constant nowhere, though hardly changing."""
    mechanism = uqmbd.Mechanism("slow", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    fast = mechanism.body("fast", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=1, inertia=1)
    for name, body, speed in (("slow", table, 0.01), ("quick", fast, 1000.0)):
        mechanism.add(Revolute(f"{name}_axle", mechanism.ground, body, (0, 0), (0, 0)))
        mechanism.add(SpeedDriver(f"{name}_motor", mechanism.ground, body, speed=speed))
    for name, carrier in (("ground", mechanism.ground), ("table", table)):
        mechanism.add(Bushing(f"{name}_springs", carrier, ball, (0, 0), (0, 0), stiffness=(60, 40, 0)))
    with pytest.raises(uqmbd.AssemblyError, match="change with time"):
        uqmbd.eigenfrequencies(mechanism, at="steady")


@pytest.mark.thorough
def test_a_mass_on_springs_on_a_turntable():
    """Coriolis' and centrifugal forces: (l^2 + kx/m - W^2)(l^2 + ky/m - W^2) + 4 W^2 l^2 = 0."""
    m, kx, ky, kt, speed = 0.5, 60.0, 45.0, 2.0, 4.0
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=m, inertia=0.1)
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=speed * uqmbd.t + 0.3))
    mechanism.add(Bushing("springs", table, ball, (0, 0), (0, 0), stiffness=(kx, ky, kt)))
    split = whirl(np.eye(2), 2 * speed * np.array([[0, -1], [1, 0]]), np.diag([kx / m - speed**2, ky / m - speed**2]))
    np.testing.assert_allclose(imaginary(mechanism), np.sort([*split, np.sqrt(kt / 0.1)]), rtol=1e-8)


@pytest.mark.thorough
def test_a_ball_in_a_groove_moves_out():
    """k (r - l) = m W^2 r, and omega^2 = k / m - W^2; the reaction of the groove is none, that of the spring m W^2 r."""
    mechanism = uqmbd.Mechanism("groove", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=2, inertia=0.1, position=(1, 0))
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=3 * uqmbd.t))
    mechanism.add(PointOnLine("groove", table, ball, (0, 0), (0, 0), axis_i=(1, 0)))
    mechanism.add(TorsionSpringDamper("stay", table, ball, stiffness=5.0))
    spring = mechanism.add(SpringDamper("spring", table, ball, (0, 0), (0, 0), stiffness=50, free_length=1))
    mechanism.output("radius", uqmbd.at_steady(ball.position.norm()), units="m")
    mechanism.output("pull", uqmbd.at_steady(spring.reaction_force.norm()), units="N")
    mechanism.output("speed", uqmbd.at_steady(ball.velocity.norm()), units="m/s")
    mechanism.output("frequency", uqmbd.eigenfrequency(1, at="steady"), units="Hz")
    found = uqmbd.simulate(mechanism, [0, 1])
    radius = 50 / (50 - 2 * 9)
    assert float(found["radius"]) == pytest.approx(radius, rel=1e-8)
    assert float(found["pull"]) == pytest.approx(18 * radius, rel=1e-8)
    assert float(found["speed"]) == pytest.approx(3 * radius, rel=1e-8)
    assert float(found["frequency"]) == pytest.approx(np.sqrt(50 / 2 - 9) / (2 * np.pi), rel=1e-8)


@pytest.mark.thorough
def test_what_goes_round_has_no_value_in_steady_motion():
    mechanism, shaft, _, _ = shaft_and_arms([0.9])
    driven(mechanism, shaft, 5.0)
    mechanism.output("x", uqmbd.at_steady(mechanism.bodies["arm0"].point((0, 0, -1))[0]), units="m")
    with pytest.raises(uqmbd.UqmbdError, match=r"at_steady\(.*\) changes during the steady motion"):
        uqmbd.simulate(mechanism, [0, 1])


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("angle", "axis", "message"),
    [
        (2 * uqmbd.t**2, UP, "no steady motion was found from the start pose: "),
        (5 * uqmbd.t, (1, 0, 0.1), "no steady motion was found from the start pose: "),
        # in balance all the way round, but the stiffness that gravity gives changes
        (5 * uqmbd.t, (1, 0, 0), "the coefficients of small motions .* change with time"),
    ],
    ids=["accelerates", "gravity turns", "stiffness turns"],
)
def test_what_is_not_steady_is_reported(angle, axis, message):
    mechanism = uqmbd.Mechanism("unsteady", uqmbd.Spatial(gravity=(0, 0, -G)))
    shaft = mechanism.body("shaft", mass=1, inertia=(1, 1, 1), quaternion=(1, 0, 0, 0))
    arm = mechanism.body("arm", mass=1, inertia=(0.1, 0.1, 0.1), com=(0, 0, -1), quaternion=(1, 0, 0, 0))
    mechanism.add(Revolute("bearing", mechanism.ground, shaft, ORIGIN, ORIGIN, axis_i=axis, axis_j=axis))
    mechanism.add(RotationDriver("motor", mechanism.ground, shaft, angle=angle, axis_i=axis, axis_j=axis))
    mechanism.add(Revolute("hinge", shaft, arm, ORIGIN, ORIGIN, axis_i=ACROSS, axis_j=ACROSS))
    with pytest.raises(uqmbd.AssemblyError, match=message):
        uqmbd.eigenfrequencies(mechanism, at="steady")


@pytest.mark.thorough
def test_small_motions_that_are_simulated():
    """A pendulum on a shaft let go near its steady angle: the period of its swing, by the flow itself."""
    mechanism, shaft, _, (hinge,) = shaft_and_arms([1.0])
    driven(mechanism, shaft, 4.2)
    mechanism.output("angle", hinge.angle)
    frequency = imaginary(mechanism)[0]
    mechanism.start(hinge.angle, np.arccos(G / 4.2**2) + 1e-4)
    mechanism.start(hinge.speed, 0)
    times = np.linspace(0, 12, 2401)
    angle = uqmbd.simulate(mechanism, times, rtol=1e-11, check=False)["angle"].values - np.arccos(G / 4.2**2)
    rises = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    crossings = times[rises] - angle[rises] * (times[1] - times[0]) / (angle[rises + 1] - angle[rises])
    measured = 2 * np.pi * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    assert measured == pytest.approx(frequency, rel=2e-6)


def uncertain():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.8, 1.2), units="m")
    mechanism, shaft, _, (hinge,) = shaft_and_arms([1.0], length=length)
    driven(mechanism, shaft, 5.0)
    mechanism.output("frequency", uqmbd.eigenfrequency(1, at="steady"), units="Hz")
    mechanism.output("damping", uqmbd.damping_ratio(1, at="steady") + 2)
    mechanism.output("angle", uqmbd.at_steady(hinge.angle), units="rad")
    return mechanism


@pytest.mark.slow
def test_steady_motions_in_all_propagators():
    """Means and deviations of frequency and angle against quadrature of the closed forms."""
    methods = [Collocation(order=6), Galerkin(order=6), MonteCarlo(samples=30, seed=1)]
    tree = uqmbd.Study("steady", uncertain(), propagators=methods).run()
    nodes, weights = np.polynomial.legendre.leggauss(30)
    length = 1 + 0.2 * nodes
    exact = {
        "frequency": np.sqrt(25 - (G / length) ** 2 / 25) / (2 * np.pi),
        "angle": np.arccos(G / (25 * length)),
    }
    for name, values in exact.items():
        mean = weights @ values / 2
        std = np.sqrt(weights @ (values - mean) ** 2 / 2)
        for label in ("collocation", "galerkin"):
            found = tree[f"{label}/scalars/statistics"].sel(output=name)
            assert float(found["mean"]) == pytest.approx(mean, rel=1e-6)
            assert float(found["std"]) == pytest.approx(std, rel=1e-4)
    samples = tree["monte-carlo/scalars/samples"]
    drawn = samples["inputs"].values[:, 0]
    found = samples["response"].sel(output="frequency").values
    np.testing.assert_allclose(found, np.sqrt(25 - (G / drawn) ** 2 / 25) / (2 * np.pi), rtol=1e-8)


@pytest.mark.thorough
def test_governor_with_a_collar():
    """Lagrange's equation of Watt's governor: arms and links of one length, a collar that slides on the shaft."""
    m, heavy, length, speed = 1.0, 2.0, 0.4, 11.0
    mechanism, shaft, _, _ = shaft_and_arms([0.8, -0.8], length=length)
    driven(mechanism, shaft, speed)
    collar = mechanism.body(
        "collar", mass=heavy, inertia=(1, 1, 1), position=(0, 0, -2 * length * np.cos(0.8)), quaternion=(1, 0, 0, 0)
    )
    mechanism.add(Prismatic("slide", shaft, collar, ORIGIN, ORIGIN, axis_i=UP, axis_j=UP))
    for k in (0, 1):
        arm = mechanism.bodies[f"arm{k}"]
        mechanism.add(Distance(f"link{k}", arm, collar, (0, 0, -length), ORIGIN, length=length))
    mechanism.output("lift", uqmbd.at_steady(collar.position[2]), units="m")
    mechanism.output("frequency", uqmbd.eigenfrequency(1, at="steady"), units="Hz")
    found = uqmbd.simulate(mechanism, [0, 1])
    x = sympy.Symbol("x")
    energy = -2 * (m + heavy) * G * length * sympy.cos(x) - m * length**2 * speed**2 * sympy.sin(x) ** 2
    angle = np.arccos((m + heavy) * G / (m * length * speed**2))
    inertia = 2 * m * length**2 + 4 * heavy * length**2 * np.sin(angle) ** 2
    expected = np.sqrt(float(energy.diff(x, 2).subs(x, angle)) / inertia) / (2 * np.pi)
    assert float(found["lift"]) == pytest.approx(-2 * length * np.cos(angle), rel=1e-7)
    assert float(found["frequency"]) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("space", [uqmbd.Line(gravity=-G), uqmbd.Translational(gravity=(0, -G)), uqmbd.Planar()])
def test_where_nothing_turns_the_steady_motion_is_rest(space):
    mechanism = uqmbd.Mechanism("rest", space)
    d = space.dimension
    place = (0,) * (d - 1)
    turning = {"inertia": 0.1} if space.turns else {}
    mass = mechanism.body("mass", mass=2, position=(*place, -1.0), **turning)
    spring = SpringDamper(
        "spring", mechanism.ground, mass, (0,) * d, (0,) * d, stiffness=80, damping=3, free_length=0.5
    )
    mechanism.add(spring)
    rest, steady = (uqmbd.eigenfrequencies(mechanism, at=at) for at in ("equilibrium", "steady"))
    for name in ("frequency", "damping_ratio"):
        np.testing.assert_allclose(steady[name], rest[name], rtol=1e-7, atol=1e-7)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "angle",
    [5 * sympy.sin(uqmbd.t), 5 * uqmbd.t + uqmbd.t**3, 5 * uqmbd.t + sympy.sin(uqmbd.t), sympy.sin(uqmbd.t)],
    ids=str,
)
def test_a_driver_whose_acceleration_is_none_at_the_start_only_is_named(angle):
    mechanism, shaft, _, _ = shaft_and_arms([0.6])
    mechanism.add(RotationDriver("motor", mechanism.ground, shaft, angle=angle, axis_i=UP, axis_j=UP))
    with pytest.raises(uqmbd.AssemblyError, match=r"the speed of driver 'motor' is not constant: it is \d rad/s at"):
        uqmbd.eigenfrequencies(mechanism, at="steady")


RUN_UP = uqmbd.step(uqmbd.t, 0.5, 0, 1, 5)


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [5 * sympy.cos(uqmbd.t), 5 + uqmbd.t, 5 + uqmbd.t**2, RUN_UP], ids=str)
def test_a_speed_that_changes_later_is_named(speed):
    mechanism, shaft, _, _ = shaft_and_arms([0.6])
    mechanism.add(SpeedDriver("motor", mechanism.ground, shaft, speed=speed, axis_j=UP))
    with pytest.raises(uqmbd.AssemblyError, match=r"the speed of driver 'motor' is not constant: it is \d rad/s at"):
        uqmbd.eigenfrequencies(mechanism, at="steady")


@pytest.mark.thorough
def test_a_speed_that_has_become_constant_is_steady():
    mechanism, shaft, _, _ = shaft_and_arms([0.6])
    mechanism.add(SpeedDriver("motor", mechanism.ground, shaft, speed=RUN_UP, axis_j=UP))
    assert imaginary(mechanism, time=2.0) == pytest.approx([np.sqrt(25 - (G / 5) ** 2)], rel=1e-8)


@pytest.mark.thorough
def test_two_uneven_drivers_that_lead_along_a_circle_are_steady():
    """A pendulum whose hinge goes round at r = 0.2 m: omega^2 = Omega^2 r / l, as on a turntable."""
    mechanism = uqmbd.Mechanism("circle", uqmbd.Planar())
    hub = mechanism.body("hub", mass=1, inertia=1, position=(0.2, 0))
    blade = mechanism.body("blade", mass=1, inertia=0, com=(0.5, 0), position=(0.2, 0), angle=0.2)
    along = {"east": ((1, 0), sympy.cos(3 * uqmbd.t)), "north": ((0, 1), sympy.sin(3 * uqmbd.t))}
    for name, (axis, part) in along.items():
        mechanism.add(PositionDriver(name, mechanism.ground, hub, (0, 0), (0, 0), axis_i=axis, displacement=0.2 * part))
    mechanism.add(RotationDriver("turn", mechanism.ground, hub, angle=3 * uqmbd.t))
    mechanism.add(Revolute("flap", hub, blade, (0, 0), (0, 0)))
    assert imaginary(mechanism) == pytest.approx([3 * np.sqrt(0.2 / 0.5)], rel=1e-7)


@pytest.mark.thorough
def test_a_load_that_begins_later_is_reported():
    """Balance at the start, and a force from 6 s on."""
    mechanism = uqmbd.Mechanism("load", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=2, inertia=0.1)
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(SpeedDriver("motor", mechanism.ground, table, speed=3))
    mechanism.add(Bushing("springs", table, ball, (0, 0), (0, 0), stiffness=(60, 60, 5)))
    mechanism.add(PointForce("push", ball, (0, 0), force=(uqmbd.step(uqmbd.t, 6, 0, 7, 4), 0)))
    with pytest.raises(uqmbd.AssemblyError, match="a load changes with time: body 'ball' is not in balance"):
        uqmbd.eigenfrequencies(mechanism, at="steady")


@pytest.mark.thorough
def test_an_unstable_steady_motion_without_a_frequency_says_that_it_is_unstable():
    mechanism, shaft, _, _ = shaft_and_arms([0.0])
    driven(mechanism, shaft, 5.0)
    mechanism.output("frequency", uqmbd.eigenfrequency(1, at="steady"), units="Hz")
    with pytest.raises(uqmbd.UqmbdError, match="0 of its modes oscillate.*1 of its modes grow .* it is unstable there"):
        uqmbd.simulate(mechanism, [0, 1])
