"""What no mechanism can be is told where it was written; where it is random, by the realisation, with the reason."""

from __future__ import annotations

import math
import re
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import Ensemble, build
from uqmbd.mechanism.bodies.inertia import is_tensor_of_body
from uqmbd.results import Status
from uqmbd_contact import ClearanceJoint, PlaneContact, PlaneImpact, SphereContact
from uqmbd_drivers import DistanceDriver, PositionDriver
from uqmbd_joints import Distance, Revolute, RevoluteSpherical
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, RadialTyre, RoadFollower, RotationalFriction, SlidingFriction, SpringDamper

FLOOR = {"point_i": (0, 0), "point_j": (0, 0), "normal_i": (0, 1)}
ENDS = {"point_i": (0, 0), "point_j": (0, 0)}

RANGES = [
    (PlaneImpact, FLOOR, "restitution", [-0.1, 1.1], [0, 0.5, 1]),
    (PlaneImpact, FLOOR, "friction", [-0.1], [0, 3]),
    (PlaneImpact, FLOOR, "radius", [-0.1], [0, 3]),
    (PlaneContact, FLOOR, "friction", [-0.1], [0, 3]),
    (PlaneContact, FLOOR, "stiffness", [-1e6], [0, 1e6]),
    (PlaneContact, {**FLOOR, "law": "kelvin-voigt"}, "damping", [-1], [0, 1]),
    (PlaneContact, {**FLOOR, "law": "hunt-crossley"}, "exponent", [-1, 0], [1, 2]),
    (PlaneContact, FLOOR, "slow", [-1, 0], [1e-3]),
    (SphereContact, {**ENDS, "radius_j": 1}, "radius_i", [-1], [0, 1]),
    (ClearanceJoint, {**ENDS, "radius": 1}, "clearance", [-1e-3], [0, 1e-3]),
    (Distance, ENDS, "length", [-0.3, 0], [0.3]),
    (DistanceDriver, ENDS, "length", [-0.3, 0], [0.3, uqmbd.t - 5]),
    (RotationalFriction, {}, "friction", [-1], [0, 1]),
    (RotationalFriction, {"friction": 1}, "transition", [-1], [0, 1]),
    (SlidingFriction, {**ENDS, "axis_i": (1, 0)}, "friction", [-1], [0, 1]),
    (RadialTyre, {"point": (0, 0), "road": 0, "stiffness": 1}, "radius", [-1], [1]),
]


def body_on_ground(space=None):
    mechanism = uqmbd.Mechanism("machine", space or uqmbd.Planar(gravity=(0, -9.81)))
    inertia = (1, 1, 1) if mechanism.space.dimension == 3 else 1
    return mechanism, mechanism.body("ball", mass=1, inertia=inertia, position=(0, 1, 0)[: mechanism.space.dimension])


@pytest.mark.parametrize(
    ("kind", "rest", "key", "bad", "good"), RANGES, ids=[f"{r[0].__name__}.{r[2]}" for r in RANGES]
)
def test_a_number_outside_of_its_range_is_refused_where_it_is_given(kind, rest, key, bad, good):
    mechanism, ball = body_on_ground()
    for value in good:
        mechanism.add(kind(f"fine {value}", mechanism.ground, ball, **rest, **{key: value}))
    for value in bad:
        with pytest.raises(uqmbd.StudyError, match=re.escape(f"{kind.__name__} 'c': {key} is {value:g}; expected")):
            mechanism.add(kind("c", mechanism.ground, ball, **rest, **{key: value}))
        random = uqmbd.RandomVariable("r", chaospy.Uniform(value - 0.1, value + 0.05))
        with pytest.raises(uqmbd.StudyError, match=rf"'c': {key} is .* at the means of the random variables \(r\)"):
            mechanism.add(kind("c", mechanism.ground, ball, **rest, **{key: random}))
    assert "c" not in mechanism.components


def test_a_number_of_space_has_a_range_too():
    mechanism, ball = body_on_ground(uqmbd.Spatial())
    with pytest.raises(uqmbd.StudyError, match="RevoluteSpherical 'c': length is -1; expected more than 0"):
        mechanism.add(RevoluteSpherical("c", mechanism.ground, ball, (0, 0, 0), (0, 0, 0), (1, 0, 0), length=-1))


def test_every_coefficient_and_distance_of_the_installed_components_has_a_range():
    """A component that is added to the built-in ones must not forget its own; what may have any sign is listed."""
    signed = {
        "Screw.pitch",
        "RackAndPinion.radius",
        "SpringDamper.free_length",
        "SlidingSpringDamper.free_displacement",
        "RoadFollower.height",
        "PositionDriver.displacement",
    }
    for kind in plugins.components().values():
        if not kind.__module__.startswith("uqmbd_"):
            continue
        for key, parameter in kind.parameters().items():
            coefficient = key in ("friction", "restitution")
            distance = parameter.units == "m" and parameter.kind == "scalar"
            if (coefficient or distance) and f"{kind.__name__}.{key}" not in signed:
                assert parameter.minimum == 0, f"{kind.__name__}.{key}"


def sampled(mechanism, values):
    """Reasons why realisations cannot be, by the value of the one random variable."""
    return Ensemble(build(mechanism), np.array(values, dtype=float)[:, None]).start.messages


@pytest.mark.thorough
def test_a_random_number_outside_of_its_range_fails_with_the_reason():
    mechanism, ball = body_on_ground()
    rebound = uqmbd.RandomVariable("rebound", chaospy.Normal(0.95, 0.05))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, **FLOOR, restitution=rebound))
    mechanism.output("height", ball.position[1], units="m")
    fine, low, high = sampled(mechanism, [0.95, -0.01, 1.02])
    assert fine == ""
    assert low == "the restitution of PlaneImpact 'floor' is −0.01: expected 0 to 1; rebound = −0.01"
    assert high == "the restitution of PlaneImpact 'floor' is 1.02: expected 0 to 1; rebound = 1.02"
    study = uqmbd.Study("drop", mechanism, [0, 0.1], [MonteCarlo(samples=64, seed=1)])
    with pytest.warns(uqmbd.StudyWarning, match=r"'floor' is outside of its range \(0 to 1\) in 16 % of the realis"):
        with pytest.warns(UserWarning, match="the restitution of PlaneImpact 'floor' is 1"):
            node = study.run()["monte-carlo"]
    outside = node["samples/inputs"].values[:, 0] > 1
    assert outside.any()
    assert np.array_equal(node["samples/status"].values, np.where(outside, Status.OUTSIDE_LIMITS, Status.OK))


class Gauge(uqmbd.Component):
    """A plugin's component with ranges of its own."""

    bodies: ClassVar[tuple[str, ...]] = ("body",)
    share = uqmbd.Parameter("1", "a share of something", minimum=0.2, maximum=0.8, exclusive=True)
    forces = uqmbd.Parameter("N", "that only press", kind="vector", maximum=0, default=(0, 0))

    def terms(self, p):
        yield uqmbd.VirtualWork(p.share * sympy.Matrix(p.forces), p.body.velocity)


def test_a_plugins_component_gets_the_same_check():
    mechanism, ball = body_on_ground()
    size = uqmbd.RandomVariable("size", chaospy.Uniform(-3, -1))
    for value, words in [(0.2, "more than 0.2 and less than 0.8"), (0.8, "more than 0.2"), (2, "less than 0.8")]:
        with pytest.raises(uqmbd.StudyError, match=f"Gauge 'g': share is {value}; expected .*{words}.*a share of some"):
            mechanism.add(Gauge("g", ball, share=value))
    with pytest.raises(uqmbd.StudyError, match="forces is 1; expected 0 or less"):
        mechanism.add(Gauge("g", ball, share=0.5, forces=(-1, 1)))
    mechanism.add(Gauge("g", ball, share=0.5, forces=(-1, size + 2)))
    assert sampled(mechanism, [-2, -1.5]) == (
        "",
        "the forces[1] of Gauge 'g' is 0.5 N: expected 0 or less; size = −1.5",
    )


def test_a_range_that_means_nothing_is_reported_at_its_declaration():
    with pytest.raises(uqmbd.StudyError, match="minimum is 1, and maximum is 0"):
        uqmbd.Parameter("1", "share", minimum=1, maximum=0)
    with pytest.raises(uqmbd.StudyError, match="kind 'axis' has no range"):
        uqmbd.Parameter("1", "where to", kind="axis", minimum=0)


# -- inertia ----------------------------------------------------------------------------------------------------------
points = st.lists(st.tuples(*[st.floats(-1, 1)] * 3, st.floats(0, 1)), min_size=1, max_size=6)


@pytest.mark.thorough
@given(points, st.permutations(range(3)))
@settings(max_examples=60, deadline=None)
def test_the_inertia_of_any_masses_is_accepted(points, order):
    """Of point masses, the least that a body can be: needles and plates among them."""
    r, m = np.array([p[:3] for p in points])[:, order], np.array([p[3] for p in points])
    tensor = sum(w * (x @ x * np.eye(3) - np.outer(x, x)) for w, x in zip(m, r, strict=True))
    mechanism = uqmbd.Mechanism("cloud", uqmbd.Spatial())
    mechanism.body("cloud", mass=m.sum(), inertia=tensor)


@given(st.lists(st.floats(0, 1, allow_subnormal=False), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_a_tensor_is_accepted_where_some_distribution_of_mass_has_it(moments, seed):
    """Principal moments a, b, c belong to second moments of mass (b + c - a) / 2, ...: none of them may be negative."""
    second = (sum(moments) - 2 * np.array(moments)) / 2
    e = np.random.default_rng(seed).normal(size=(3, 3))
    turn = np.linalg.qr(e)[0]
    tensor = turn @ np.diag(moments) @ turn.T
    tensor = (tensor + tensor.T) / 2
    mechanism = uqmbd.Mechanism("solid", uqmbd.Spatial())
    if second.min() >= 0:
        mechanism.body("solid", mass=1, inertia=tensor)
    elif second.min() < -0.01 * max(moments):
        with pytest.raises(
            uqmbd.StudyError, match="body 'solid': the inertia tensor is physically impossible.*principal moments"
        ):
            mechanism.body("solid", mass=1, inertia=tensor)


def test_inertia_rounded_as_people_do_is_a_bodys():
    """A thin rod with the numbers of a data sheet."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial())
    mechanism.body("rod", mass=1, inertia=(0.00001, 0.0833, 0.0834))
    mechanism.body("point", mass=1, inertia=(0, 0, 0))
    with pytest.raises(uqmbd.StudyError, match=r"1, 1, 5 kg m\^2, and the largest exceeds .* other two \(5 > 2\)"):
        mechanism.body("ball", mass=1, inertia=(1, 1, 5))


def test_random_inertia_that_no_body_has_fails_with_the_reason():
    third = uqmbd.RandomVariable("third", chaospy.Normal(1.9, 0.1))
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    mechanism.body("top", mass=1, inertia=(1, third, 1, 0, 0.0, 0))
    fine, plate, none, negative = sampled(mechanism, [1.9, 2.0, 2.5, -1])
    assert fine == plate == ""
    assert none == (
        "the inertia of body 'top' is not possible for any body: its principal moments are 1, 1, 2.5 kg m^2; "
        "the largest may not be more than the sum of the others; third = 2.5"
    )
    assert "principal moments are -1, 1, 1 kg m^2; none may be negative" in negative
    with pytest.raises(uqmbd.StudyError, match=r"1, 1, 2.5 kg m\^2 at the means of the random variables, and"):
        mechanism.body("other", mass=1, inertia=(1, 1, third + 0.6))


def test_random_mass_and_inertia_in_the_plane_fail_with_the_reason():
    x = uqmbd.RandomVariable("x", chaospy.Normal(1, 0.5))
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    mechanism.body("disc", mass=x + 0.5, inertia=x)
    fine, light, heavy = sampled(mechanism, [1, -0.2, -1])
    assert (
        fine == ""
        and "the moment of inertia of body 'disc' is −0.2 kg\N{NARROW NO-BREAK SPACE}m²: expected 0 or more" in light
    )
    assert "the mass of body 'disc' is −0.5 kg: expected 0 or more" in heavy


def test_principal_moments_at_the_edge_are_a_bodys():
    edge = np.array([[0, a, a] for a in (1e-12, 1, 1e12)] + [[1, 2, 3.0]])
    assert is_tensor_of_body(edge).all() and not is_tensor_of_body(edge * [1, 1, 1.02]).any()
    assert math.isinf(uqmbd.Parameter("1", "no range").maximum)


# -- velocities where there can be none -------------------------------------------------------------------------------
def pin(mechanism, ball, **given):
    return Revolute("pin", mechanism.ground, ball, **{"point_i": (0, 0), "point_j": (0, 0), **given})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda m, b, v: pin(m, b, point_i=(v, 0)), "'pin': the constraint 'point' depends on point_i, which contains ball.x'"),
        (lambda m, b, v: pin(m, b, point_j=(0, 1 + 1.0 * b.angular_velocity)), "point_j, which contains ball.angular_velocity,"),
        (lambda m, b, v: Distance("d", m.ground, b, (0, 0), (0, 0), 1 + v), "the constraint 'length' depends on length, which contains ball.x'"),
        (lambda m, b, v: PositionDriver("p", m.ground, b, (0, 0), (0, 0), (1, 0), v * uqmbd.t), "displacement, which"),
        (lambda m, b, v: SpringDamper("s", m.ground, b, (0, 0), (0, 0), 9, free_length=v), "a potential energy depends on free_length"),
        (lambda m, b, v: RoadFollower("r", m.ground, b, (0, 0), 0, height=v), "the constraint 'road' depends on height, which"),
    ],
)  # fmt: skip
def test_a_velocity_in_a_constraint_is_refused_where_it_is_given(make, words):
    mechanism, ball = body_on_ground()
    with pytest.raises(uqmbd.StudyError, match=words):
        mechanism.add(make(mechanism, ball, 1.0 * ball.velocity[0]))
    assert not mechanism.components


def test_a_velocity_in_a_force_and_a_position_in_a_point_are_welcome():
    mechanism, ball = body_on_ground()
    drag = -1.0 * ball.velocity[0] * sympy.Abs(ball.velocity[0])
    mechanism.add(PointForce("drag", ball, (ball.velocity[0] / 100, 0), (drag, 0)))
    mechanism.add(
        SpringDamper("damper", mechanism.ground, ball, (0, 0), (0, 0), 0, damping=1 + 1.0 * ball.velocity[1] ** 2)
    )
    other = mechanism.body("other", mass=1, inertia=1)
    mechanism.add(Revolute("cam", mechanism.ground, other, (ball.position[0], uqmbd.t), (0, 0)))
    mechanism.output("x", ball.position[0])
    uqmbd.simulate(mechanism, [0, 0.1])


def test_a_plugins_constraint_or_potential_with_a_velocity_is_refused():
    class Wrong(uqmbd.Component):
        bodies = ("body",)
        what = uqmbd.Parameter("", "which term", kind="option")

        def terms(self, p):
            speed = p.rate_of(p.let("place", p.body.position[0] ** 2))
            yield uqmbd.Constraint(speed) if self.what == "constraint" else uqmbd.Potential(speed**2)

    for what, words in [("constraint", "the constraint .* contains a velocity"), ("energy", "a potential energy con")]:
        mechanism, ball = body_on_ground()
        mechanism.add(Wrong("w", ball, what))
        mechanism.output("x", ball.position[0])
        with pytest.raises(uqmbd.StudyError, match=f"Wrong 'w': {words}"):
            uqmbd.simulate(mechanism, [0, 0.1])


@pytest.mark.parametrize(
    "write",
    [
        lambda ball: sympy.Derivative(ball.position[1], uqmbd.t),
        lambda ball: sympy.Derivative(ball.position[1] * sympy.sin(uqmbd.t), uqmbd.t) + ball.position[0],
        lambda ball: 2 * sympy.Derivative(ball.point((1, 0))[0], uqmbd.t, 2),
        lambda ball: sympy.Derivative(ball.position[1], ball.position[0]),
    ],
)
def test_a_derivative_is_refused_and_what_to_write_instead_is_reported(write):
    """To SymPy positions do not depend on time: what it makes of their derivatives is zero."""
    mechanism, ball = body_on_ground()
    expression = write(ball)
    with pytest.raises(uqmbd.StudyError, match="output 'rate': .* contains Derivative.*Write rates as body.velocity"):
        mechanism.output("rate", expression)
    with pytest.raises(uqmbd.StudyError, match="'drag': force .* contains Derivative.*Write rates as body.velocity"):
        mechanism.add(PointForce("drag", ball, (0, 0), (expression, 0)))
    mechanism.output("rate", ball.velocity[1])
