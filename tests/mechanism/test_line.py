"""Masses on a line: against matrix exponentials, closed forms, the plane with guides, and what does not fit there."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.linalg
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import ClearanceJoint, PlaneContact, PlaneImpact, SphereContact, SphereImpact
from uqmbd_drivers import DistanceDriver, LinearSpeedDriver, PositionDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance, Fixed, PointOnPlane, Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import NonlinearSpringDamper, PointForce, RadialTyre, SlidingFriction, SpringDamper, length

STIFFNESS, MASS = 40.0, (1.0, 2.0)


def line(name="line", gravity=None):
    return uqmbd.Mechanism(name, uqmbd.Line(gravity))


numbers = st.floats(0.2, 3)
places = st.lists(st.floats(-2, 2), min_size=3, max_size=3).filter(
    lambda x: min(abs(a - b) for k, a in enumerate([*x, 0]) for b in [*x, 0][:k]) > 0.05
)


@pytest.mark.thorough
@settings(max_examples=8, deadline=None)
@given(masses=st.tuples(numbers, numbers, numbers), rates=st.tuples(*[st.floats(5, 50)] * 4), drawn=places,
       free=st.tuples(*[st.floats(0, 2)] * 4), damping=st.floats(0, 1), gravity=st.floats(-10, 10))  # fmt: skip
def test_chains_in_any_order_are_linear_systems(masses, rates, drawn, free, damping, gravity):
    """Oracle: the matrix exponential, with each free length on the side on which the spring is drawn."""
    mechanism = line("chain", gravity)
    bodies = [mechanism.body(f"b{k}", mass=m, position=x) for k, (m, x) in enumerate(zip(masses, drawn, strict=True))]
    pairs = [(None, 0), (0, 1), (1, 2), (2, None)]
    stiff, damped, force = np.zeros((3, 3)), np.zeros((3, 3)), np.array(masses) * gravity
    for name, (i, j), k, free_length in zip("abcd", pairs, rates, free, strict=True):
        ends = [mechanism.ground if x is None else bodies[x] for x in (i, j)]
        mechanism.add(SpringDamper(name, *ends, 0, 0, stiffness=k, damping=damping, free_length=free_length))
        row = np.zeros(3)
        if i is not None:
            row[i] = -1
        if j is not None:
            row[j] = 1
        side = np.sign(row @ drawn)
        stiff += k * np.outer(row, row)
        damped += damping * np.outer(row, row)
        force += k * side * free_length * row
    for k, body in enumerate(bodies):
        mechanism.output(f"x{k}", body.position, units="m")
    inverse = np.diag(1 / np.array(masses))
    matrix = np.zeros((7, 7))
    matrix[:3, 3:6] = np.eye(3)
    matrix[3:6, :3], matrix[3:6, 3:6], matrix[3:6, 6] = -inverse @ stiff, -inverse @ damped, inverse @ force
    times = [0, 0.7, 1.9]
    start = np.array([*drawn, 0, 0, 0, 1])
    exact = np.array([(scipy.linalg.expm(matrix * t) @ start)[:3] for t in times])
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    np.testing.assert_allclose(np.array([data[f"x{k}"] for k in range(3)]).T, exact, atol=2e-6)
    rest = uqmbd.static_equilibrium(mechanism)
    np.testing.assert_allclose([rest[f"x{k}"] for k in range(3)], np.linalg.solve(stiff, force), atol=1e-7)


def two_masses(stiffness, integrator="auto"):
    """Two masses that are joined by a spring, pulled apart by 0.1 m."""
    mechanism = line("pair")
    a = mechanism.body("a", mass=MASS[0], position=0)
    b = mechanism.body("b", mass=MASS[1], position=(1.1,))
    mechanism.add(SpringDamper("spring", a, b, 0, (0,), stiffness=stiffness, free_length=1))
    mechanism.output("elongation", b.position[0] - a.position[0] - 1, units="m")
    mechanism.output("frequency", uqmbd.eigenfrequency(1, at="start"), units="Hz")
    return uqmbd.Study("pair", mechanism, np.linspace(0, 1, 6), integrator=integrator)


@pytest.mark.parametrize(
    ("method", "tolerance"),
    [
        pytest.param(MonteCarlo(samples=2048, seed=2, sampling="sobol"), 3e-3, marks=pytest.mark.thorough),
        (Collocation(order=5), 1e-5),
        pytest.param(Galerkin(order=5), 1e-5, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize("integrator", ["dop853", pytest.param("ida", marks=pytest.mark.thorough)])
def test_two_mass_oscillator(method, tolerance, integrator):
    """The closed form ``0.1 cos(sqrt(k / m) t)`` with the reduced mass, integrated over the stiffness by quadrature."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(38, 42), units="N/m")
    study = two_masses(stiffness, integrator)
    node = study.propagate(method)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    reduced = MASS[0] * MASS[1] / sum(MASS)
    omega = np.sqrt((40 + 2 * nodes) / reduced)
    values = 0.1 * np.cos(omega[:, None] * study.times)
    mean = weights @ values / 2
    std = np.sqrt(weights @ (values - mean) ** 2 / 2)
    found = node["statistics"]
    np.testing.assert_allclose(found["mean"].sel(output="elongation"), mean, atol=0.1 * tolerance)
    np.testing.assert_allclose(found["std"].sel(output="elongation"), std, atol=0.1 * tolerance)
    frequency = node["scalars/statistics"]["mean"].sel(output="frequency")
    np.testing.assert_allclose(frequency, weights @ omega / 4 / np.pi, rtol=tolerance)


@pytest.mark.thorough
@pytest.mark.parametrize("radius", [0, 0.05])
def test_cradle(radius):
    """Equal masses, perfectly elastic: the velocity is handed through, and the last one alone leaves."""
    mechanism = line("cradle")
    gap = 0.1
    balls = [
        mechanism.body(f"ball{k}", mass=0.3, position=k * (gap + 2 * radius), velocity=2 if k == 0 else 0)
        for k in range(4)
    ]
    for k in range(3):
        hit = mechanism.add(SphereImpact(f"hit{k}", balls[k + 1], balls[k], 0, 0, radius, radius))
        mechanism.output(f"t{k}", hit.event_time("impact"), units="s")
    for k, ball in enumerate(balls):
        mechanism.output(f"v{k}", ball.velocity, units="m/s")
    data = uqmbd.simulate(mechanism, [0, 0.2])
    np.testing.assert_allclose([data[f"v{k}"][-1] for k in range(4)], [0, 0, 0, 2], atol=1e-12)
    np.testing.assert_allclose([data[f"t{k}"] for k in range(3)], [0.05, 0.1, 0.15], rtol=1e-10)


@pytest.mark.thorough
@settings(max_examples=10, deadline=None)
@given(m=st.tuples(numbers, numbers), v=st.floats(0.5, 3), e=st.floats(0, 1), turned=st.booleans())
def test_two_masses_collide(m, v, e, turned):
    """Momentum and Newton's law of restitution, whichever body is ahead."""
    mechanism = line()
    s = -1 if turned else 1
    a = mechanism.body("a", mass=m[0], position=0, velocity=s * v)
    b = mechanism.body("b", mass=m[1], position=s, velocity=0)
    mechanism.add(SphereImpact("hit", a, b, 0, 0, 0.1, 0.2, restitution=e))
    mechanism.output("va", a.velocity, units="m/s")
    mechanism.output("vb", b.velocity, units="m/s")
    data = uqmbd.simulate(mechanism, [0, 1.5 / v])
    common = m[0] * s * v / sum(m)
    np.testing.assert_allclose(data.va[-1], common - e * m[1] * s * v / sum(m), atol=1e-10)
    np.testing.assert_allclose(data.vb[-1], common + e * m[0] * s * v / sum(m), atol=1e-10)


def test_mass_against_a_stop():
    """A ball dropped from 1 m, e = 0.8: the closed form of its impacts; a stop from above is the same with -1."""
    for up in (1, -1):
        mechanism = line("ball", -9.81 * up)
        ball = mechanism.body("ball", mass=2, position=up)
        floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, normal_i=up, restitution=0.8))
        for k in (1, 2, 3):
            mechanism.output(f"t{k}", floor.event_time("impact", k), units="s")
        data = uqmbd.simulate(mechanism, [0, 2])
        first = np.sqrt(2 / 9.81)
        exact = [first, first * 2.6, first * (2.6 + 1.28)]
        np.testing.assert_allclose([data[f"t{k}"] for k in (1, 2, 3)], exact, rtol=1e-11)


def test_compliant_stop_and_spheres():
    """A linear stop turns the velocity round after half a period; two spheres exchange theirs."""
    mechanism = line()
    mass = mechanism.body("mass", mass=2, position=0.5, velocity=-1)
    mechanism.add(PlaneContact("stop", mechanism.ground, mass, 0, 0, 1, law="linear", stiffness=5e4))
    a = mechanism.body("a", mass=1, position=10, velocity=3)
    b = mechanism.body("b", mass=1, position=11, velocity=0)
    mechanism.add(SphereContact("touch", a, b, 0, 0, 0.2, 0.3, law="hertz", stiffness=1e6))
    for body in (mass, a, b):
        mechanism.output(body.name, body.velocity, units="m/s")
    data = uqmbd.simulate(mechanism, [0, 1], rtol=1e-9)
    np.testing.assert_allclose([data[x][-1] for x in ("mass", "a", "b")], [1, 0, 3], atol=1e-6)


def test_backlash():
    """Between stops 0.1 m apart on either side a mass goes to and fro; a linear law gives its velocity back."""
    mechanism = line()
    mass = mechanism.body("mass", mass=1, position=0, velocity=1)
    mechanism.add(ClearanceJoint("play", mechanism.ground, mass, 0, 0, 0.01, 0.1, law="linear", stiffness=1e6))
    mechanism.output("x", mass.position, units="m")
    inside = np.pi / 1e3  # half a period of the contact
    data = uqmbd.simulate(mechanism, [0, 0.2 + inside, 0.4 + 2 * inside], rtol=1e-9)
    np.testing.assert_allclose(data.x, 0, atol=1e-6)


def quarter_car(space, road):
    """In the plane with guides, or on a line."""
    flat = space is not uqmbd.Line
    mechanism = uqmbd.Mechanism("car", space(gravity=(0, -9.81) if flat else -9.81))
    zero = (0, 0) if flat else 0
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(2e4, 1e3), units="N/m")
    wheel = mechanism.body("wheel", mass=40, position=(0, 0.3) if flat else 0.3)
    body = mechanism.body("body", mass=300, position=(0, 0.8) if flat else 0.8)
    for moving in (wheel, body) if flat else ():
        mechanism.add(PointOnPlane(f"{moving.name}_guide", mechanism.ground, moving, zero, zero, axis_i=(1, 0)))
    mechanism.add(
        SpringDamper("suspension", wheel, body, zero, zero, stiffness=stiffness, damping=1200, free_length=0.65)
    )
    tyre = mechanism.add(
        RadialTyre("tyre", mechanism.ground, wheel, zero, road=road, radius=0.32, stiffness=18e4, damping=100)
    )
    mechanism.output("body_height", body.position[-1], units="m")
    mechanism.output("body_acceleration", body.acceleration[-1], units="m/s^2")
    mechanism.output("tyre_force", tyre.reaction_force[-1], units="N")
    mechanism.output("heave", uqmbd.eigenfrequency(1), units="Hz")
    mechanism.output("hop_damping", uqmbd.damping_ratio(2))
    return uqmbd.Study("car", mechanism, np.linspace(0, 0.6, 7), start="equilibrium", rtol=1e-9)


@pytest.mark.thorough
def test_quarter_car_is_that_of_the_plane_with_guides():
    road = uqmbd.step(uqmbd.t, 0.1, 0, 0.2, 0.03)
    flat, straight = (
        quarter_car(space, road).propagate(Collocation(order=2)) for space in (uqmbd.Translational, uqmbd.Line)
    )
    for part in ("statistics", "scalars/statistics"):
        for name in ("mean", "std"):
            np.testing.assert_allclose(straight[part][name], flat[part][name], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("side", [1, -1])
def test_a_spring_whose_ends_pass_each_other_stays_linear(side):
    """``x'' = -k (x - s L)``: the mass swings through the anchor, where the length of a spring in the plane has a kink."""
    mechanism = line()
    mass = mechanism.body("mass", mass=1, position=side, velocity=0)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=STIFFNESS, free_length=0.2))
    cubic = NonlinearSpringDamper("law", mechanism.ground, mass, 0, 0, law=STIFFNESS * (length - 0.2))
    mechanism.add(cubic)
    mechanism.output("x", mass.position, units="m")
    times = np.linspace(0, 1, 8)
    exact = side * (0.2 + 0.8 * np.cos(np.sqrt(2 * STIFFNESS) * times))
    assert (side * exact < -0.1).any()
    np.testing.assert_allclose(uqmbd.simulate(mechanism, times, rtol=1e-9)["x"], exact, atol=1e-6)


def test_joints_and_drivers():
    """A driven cart, a rod to a second one, a third one fixed to it, and one at a prescribed distance on the left."""
    mechanism, t = line(), uqmbd.t
    cart, second, third, left, fast = (
        mechanism.body(name, mass=m, position=x)
        for name, m, x in (("cart", 1, 0), ("second", 2, -0.5), ("third", 3, 0), ("left", 1, -2), ("fast", 1, 4))
    )
    push = mechanism.add(PositionDriver("push", mechanism.ground, cart, 0, 0, 1, displacement=t**2))
    rod = mechanism.add(Distance("rod", cart, second, 0, 0, length=0.5))
    mechanism.add(Fixed("weld", second, third, 0.25, -0.25))
    mechanism.add(DistanceDriver("reach", cart, left, 0, 0, length=2 + t))
    mechanism.add(LinearSpeedDriver("speed", mechanism.ground, fast, 0, 0, axis_i=-1, speed=3))
    mechanism.add(SlidingFriction("slide", mechanism.ground, third, 0, 0, 1, friction=0, damping=2))
    for body in (cart, second, third, left, fast):
        mechanism.output(body.name, body.position, units="m")
    mechanism.output("pull", rod.reaction_force, units="N")
    mechanism.output("push", push.reaction_force[0], units="N")
    data = uqmbd.simulate(mechanism, [0, 1], rtol=1e-9)
    np.testing.assert_allclose(
        [data[x][-1] for x in ("cart", "second", "third", "left", "fast")], [1, 0.5, 1, -2, 1], atol=1e-7
    )
    # 5 kg and a damper of 2 N s/m at 2 m/s and 2 m/s^2, of which 1 kg on the left needs its own 2 N
    np.testing.assert_allclose([data.pull[-1], data.push[-1]], [14, 18], rtol=1e-6)


def test_force_of_the_motion_and_numbers_of_any_form():
    """Plain numbers, tuples and columns are the same: a damped mass in closed form."""
    found = []
    for form in (lambda x: x, lambda x: (x,), lambda x: sympy.Matrix([x]), lambda x: np.array([x], dtype=object)):
        mechanism = uqmbd.Mechanism("m", uqmbd.Line(gravity=form(-2)))
        body = mechanism.body("b", mass=2, position=form(0.5), velocity=form(1), com=form(0.1))
        force = -4 * body.velocity if form(1) == 1 else form(-4 * body.velocity[0])
        mechanism.add(PointForce("drag", body, form(0), force))
        mechanism.output("x", body.point(form(0.25)), units="m")
        mechanism.output("v", body.velocity[0], units="m/s")
        found.append(uqmbd.simulate(mechanism, [0, 1], rtol=1e-9))
    np.testing.assert_allclose(found[0]["v"][-1], -1 + 2 * np.exp(-2), rtol=1e-7)
    np.testing.assert_allclose(found[0]["x"][-1], 0.75 - 1 + (1 - np.exp(-2)), rtol=1e-6)
    for other in found[1:]:
        np.testing.assert_array_equal(other["x"], found[0]["x"])


def fails(make, *words):
    mechanism = line()
    body = mechanism.body("cart", mass=1)
    with pytest.raises((uqmbd.StudyError, AttributeError)) as caught:
        make(mechanism, body)
    for word in words:
        assert word in str(caught.value)


def test_what_makes_no_sense_is_refused():
    fails(lambda m, b: m.add(Revolute("r", m.ground, b, 0, 0)), "Revolute 'r'", "does not support Line space", "Planar")
    fails(lambda m, b: m.add(Prismatic("p", m.ground, b, 0, 0, 1, 1)), "does not support Line space")
    fails(
        lambda m, b: m.add(PlaneImpact("f", m.ground, b, 0, 0, 1, friction=0.3)),
        "PlaneImpact 'f'", "friction is 0.3", "no effect in Line space", "1 dimension;", "omit it",
    )  # fmt: skip
    fails(lambda m, b: m.add(PlaneContact("f", m.ground, b, 0, 0, 1, slow=0.3)), "slow is 0.3", "no effect")
    fails(
        lambda m, b: m.add(SpringDamper("s", m.ground, b, 0, 0, 1, free_length=1)),
        "SpringDamper 's'",
        "Separate them by position=",
    )
    fails(
        lambda m, b: m.add(NonlinearSpringDamper("s", m.ground, b, 0, 0, law=length**2)), "Separate them by position="
    )
    fails(lambda m, b: m.add(SphereImpact("s", m.ground, b, 0, 0, 1, 1)), "Separate them by position=")
    fails(lambda m, b: m.add(Distance("s", m.ground, b, 0, 0, 1)), "Separate them by position=")
    fails(lambda m, b: m.body("b", mass=1, angle=1), "Line space do not rotate")
    fails(lambda m, b: m.body("b", mass=1, inertia=1), "Line space are point masses")
    fails(lambda m, b: m.body("b", mass=1, position=(1, 2)), "position has 2 numbers, expected 1")
    fails(lambda m, b: m.add(Fixed("j", m.ground, b, 0, 0)).reaction_moment, "no moments on a line", "reaction_force")
    mechanism = line()
    body = mechanism.body("cart", mass=1)
    mechanism.add(PlaneImpact("f", mechanism.ground, body, 0, 0, 1, friction=0))
    mechanism.add(NonlinearSpringDamper("s", mechanism.ground, body, 0, 0, law=length**3 + length))
    mechanism.add(SpringDamper("at_rest", mechanism.ground, body, 0, 0.0, stiffness=1, free_length=0.0))
    with pytest.raises(uqmbd.StudyError, match=r"uqmbd\.Line\(gravity=-9\.81\)"):
        uqmbd.Mechanism("m", uqmbd.Line)
    with pytest.raises(uqmbd.StudyError, match=r"gravity.*e\.g\. -9\.81"):
        uqmbd.Line(gravity=(0, -9.81))


@pytest.mark.thorough
def test_pictures_are_upright_under_gravity():
    for gravity, axis in ((-9.81, "y"), (0, "x"), (None, "x")):
        mechanism = line("m", gravity)
        body = mechanism.body("cart", mass=1, position=2)
        mechanism.add(SpringDamper("s", mechanism.ground, body, 0, 0.5, stiffness=3))
        other = {"x": "y", "y": "x"}[axis]
        mechanism.output("x", body.position, units="m")
        study = uqmbd.Study("m", mechanism, [0, 0.1])
        poses = uqmbd.report.motion(study, frames=2)["pose"].sel(body="cart").isel(realisation=0, time=0)
        assert float(poses.sel(coordinate=axis)) == 2
        assert float(poses.sel(coordinate=other)) == 0
        assert uqmbd.report.mechanism(mechanism) is not None
