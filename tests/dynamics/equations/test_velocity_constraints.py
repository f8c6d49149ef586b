"""Constraints between velocities: what they may be, what they count, and motions that are known without us."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import build
from uqmbd_joints import PointOnPlane, Revolute, Skate


def component(terms, bodies=("body",), spaces=(uqmbd.Planar,)):
    """Make a component type of its terms."""
    return type("Bound", (uqmbd.Component,), {"bodies": bodies, "spaces": spaces, "terms": lambda self, p: terms(p)})


def bound(terms, space=None, **body):
    """Make a mechanism of one body that is bound by some terms."""
    mechanism = uqmbd.Mechanism("trial", space or uqmbd.Planar())
    one = mechanism.body("body", mass=2.0, inertia=0.3, **body)
    mechanism.add(component(terms)("bound", one))
    return mechanism, one


@pytest.mark.parametrize(
    ("equation", "message"),
    [
        (lambda p: p.body.position[0], "contains no velocity; an equation of positions is a Constraint"),
        (lambda p: p.body.velocity.dot(p.body.velocity) - 1, "not linear in the velocities"),
        (lambda p: sympy.sin(p.body.velocity[0]), "not linear in the velocities"),
        (lambda p: p.body.velocity[0] * p.body.angular_velocity[0], "not linear in the velocities"),
        (lambda p: p.rate_of(p.body.velocity[0]) + p.body.velocity[1], "contains the rate of a velocity"),
        (lambda p: sympy.floor(p.body.position[0]) * p.body.velocity[0], "derivative of floor cannot be computed"),
    ],
)
def test_what_is_no_equation_between_velocities_is_refused(equation, message):
    mechanism, _ = bound(lambda p: [uqmbd.extend.VelocityConstraint(equation(p), "blade")])
    with pytest.raises(uqmbd.StudyError, match=message) as error:
        uqmbd.check(mechanism)
    assert "_v" not in str(error.value), "names that nobody but the program knows"
    assert "cannot be computed" in message or "'blade'" in str(error.value)


def test_what_is_linear_after_expansion_is_taken():
    def equation(p):
        u, w = p.body.velocity
        return (u + w) ** 2 - (u - w) ** 2 - 4 * u * w + u

    mechanism, _ = bound(lambda p: [uqmbd.extend.VelocityConstraint(equation(p))])
    assert uqmbd.check(mechanism).velocity_mobility == 2


def test_a_velocity_in_a_constraint_of_positions_points_to_the_term():
    mechanism, _ = bound(lambda p: [uqmbd.Constraint(p.body.velocity[0])])
    with pytest.raises(uqmbd.StudyError, match="is linear in velocities as a VelocityConstraint"):
        uqmbd.check(mechanism)
    mechanism = uqmbd.Mechanism("trial", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match=r"uqmbd\.extend\.VelocityConstraint"):
        mechanism.add(PointOnPlane("plane", mechanism.ground, body, (0, 1.0 * body.velocity[0]), (0, 0), (0, 1)))


@pytest.mark.parametrize("integrator", ["dop853", "ida", "radau"])
def test_sleigh_against_scipy(integrator, close):
    """Chaplygin: ``u' = a w^2``, ``(J + m a^2) w' = -m a u w``, force across ``m (u w + a w')``; the path by SciPy."""
    m, inertia, a, u0, w0 = 2.0, 0.15, 0.3, 0.4, 2.0
    mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    body = mechanism.body("body", mass=m, inertia=inertia, com=(a, 0), velocity=(u0, 0), angular_velocity=w0)
    blade = mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.output("x", body.position[0])
    mechanism.output("y", body.position[1])
    mechanism.output("angle", body.angle)
    mechanism.output("force", body.direction((0, 1)).dot(blade.reaction_force))
    mechanism.output("moment", blade.reaction_moment)
    times = np.linspace(0, 4, 21)

    def rates(_, z):
        _, _, angle, u, w = z
        return [u * np.cos(angle), u * np.sin(angle), w, a * w**2, -m * a * u * w / (inertia + m * a**2)]

    x, y, angle, u, w = solve_ivp(rates, (0, 4), [0, 0, 0, u0, w0], t_eval=times, rtol=1e-12, atol=1e-12).y
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    for name, expected in (("x", x), ("y", y), ("angle", angle)):
        close(data[name], expected, relative=1e-7)
    w_rate = -m * a * u * w / (inertia + m * a**2)
    close(data["force"], m * (u * w + a * w_rate), relative=1e-6)
    close(data["moment"], 0, scale=1.0, relative=1e-9)


def test_counts_of_both_levels():
    mechanism = uqmbd.Mechanism("car", uqmbd.Planar())
    car = mechanism.body("car", mass=1, inertia=1)
    fork = mechanism.body("fork", mass=1, inertia=1, position=(2, 0))
    mechanism.add(Skate("rear", mechanism.ground, car, (0, 0), (1, 0)))
    mechanism.add(Revolute("steering", car, fork, (2, 0), (0, 0)))
    mechanism.add(Skate("front", mechanism.ground, fork, (0, 0), (1, 0)))
    found = uqmbd.check(mechanism)
    assert (found.mobility, found.velocity_mobility, found.velocity_equations) == (4, 2, 2)
    assert found.redundant == ()
    layout = build(mechanism).layout
    assert [build(mechanism).equations[k] for k in layout.nonholonomic] == ["rear: blade", "front: blade"]


def test_equations_of_both_kinds_that_depend_on_each_other():
    """The derivative of an equation of positions is redundant, and it is the one between velocities that is dropped."""

    def terms(p):
        yield uqmbd.extend.VelocityConstraint(p.body.velocity[1], "speed")
        yield uqmbd.Constraint(p.body.position[1] - 0.3, "place")

    mechanism, body = bound(terms, position=(0, 0.3), velocity=(1, 0))
    mechanism.output("y", body.position[1])
    found = uqmbd.check(mechanism)
    assert found.redundant == ("bound: speed",) and found.mobility == found.velocity_mobility == 2
    with pytest.warns(uqmbd.RedundantConstraintWarning, match="bound: speed"):
        data = uqmbd.simulate(mechanism, [0, 1])
    assert np.allclose(data["y"], 0.3, atol=1e-12)


@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
def test_a_dropped_equation_between_velocities_that_contradicts_is_seen():
    """Redundant where it starts, but not later: the first wants ``x' = 0``, the second something else as y grows."""

    def terms(p):
        yield uqmbd.extend.VelocityConstraint(p.body.velocity[0], "first")
        yield uqmbd.extend.VelocityConstraint(
            p.body.velocity[0] + p.body.position[1] ** 2 * p.body.velocity[1], "second"
        )

    mechanism, body = bound(terms, velocity=(0, 1))
    mechanism.output("x", body.position[0])
    with pytest.raises(uqmbd.UqmbdError, match="bound: (first|second)"):
        uqmbd.simulate(mechanism, [0, 0.5, 1])


def test_stated_velocities_that_contradict_are_reported():
    def terms(p):
        yield uqmbd.extend.VelocityConstraint(p.body.velocity[0], "speed")

    mechanism, body = bound(terms, velocity=(1, 0))
    mechanism.output("x", body.position[0])
    with pytest.raises(uqmbd.AssemblyError, match="velocity of body body contradicts the constraint 'bound: speed'"):
        uqmbd.simulate(mechanism, [0, 1])


@pytest.mark.parametrize("integrator", ["dop853", "ida", "radau"])
def test_a_prescribed_speed(integrator, close):
    """``x' = sin t`` and then ``x' = 2`` from t = 1 on: an impulse where it jumps, and the force ``m cos t`` before."""
    speed = sympy.Piecewise((sympy.sin(uqmbd.t), uqmbd.t < 1), (2, True))

    class Driven(uqmbd.Component):
        bodies = ("body",)
        spaces = (uqmbd.Translational,)
        speed = uqmbd.Parameter("m/s", "speed along x")

        def terms(self, p):
            yield uqmbd.extend.VelocityConstraint(p.body.velocity[0] - p.speed, "speed")

    mechanism = uqmbd.Mechanism("driven", uqmbd.Translational(gravity=(0, -10)))
    body = mechanism.body("body", mass=2.0)
    drive = mechanism.add(Driven("drive", body, speed))
    mechanism.output("x", body.position[0])
    mechanism.output("u", body.velocity[0])
    mechanism.output("force", drive.reaction_force[0])
    times = np.linspace(0, 2, 21)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    close(data["x"], np.where(times <= 1, 1 - np.cos(times), 1 - np.cos(1) + 2 * (times - 1)), relative=1e-7)
    apart = np.abs(times - 1) > 0.01
    close(data["u"][apart], np.where(times < 1, np.sin(times), 2)[apart], relative=1e-7)
    close(data["force"][apart], np.where(times < 1, 2 * np.cos(times), 0)[apart], relative=1e-6)


def test_terms_of_the_mechanism():
    mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    terms = uqmbd.extend.mechanism_terms(mechanism)
    assert terms.equations == ("body: unit quaternion",) and terms.velocity_equations == ("blade: blade",)
    (e0, e1), (x, y) = body.q[2:], body.v[:2]
    expected = (e0**2 - e1**2) * y - 2 * e0 * e1 * x
    assert sympy.expand(terms.velocity_constraints[0] - expected) == 0
