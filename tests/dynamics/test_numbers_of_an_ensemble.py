"""Numbers of an ensemble for integrators, compared with symbolic terms, finite differences and closed forms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import mechanism_terms
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

LENGTH = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
VALUES = np.array([[0.95], [1.0], [1.1]])
G, CRANK = 9.81, 0.3


def pendulum():
    made = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    rod = made.body("rod", mass=2.0, inertia=2 * LENGTH**2 / 12, position=(LENGTH / 2, 0), angle=0.0)
    made.add(Revolute("pivot", made.ground, rod, (0, 0), (-LENGTH / 2, 0)))
    made.output("tip", rod.point((LENGTH / 2, 0))[1], units="m")
    return made


def slider_crank():
    """Crank of 0.3 m at 40 degrees, a rod of random length, and a slider with a spring and a damper."""
    made = uqmbd.Mechanism("slider-crank", uqmbd.Planar(gravity=(0, -G)))
    at = np.radians(40)
    c, s = CRANK * np.cos(at), CRANK * np.sin(at)
    x = c + sympy.sqrt(LENGTH**2 - s**2)
    crank = made.body("crank", mass=1, inertia=0.02, position=(c / 2, s / 2), angle=at, angular_velocity=3)
    rod = made.body("rod", mass=2, inertia=0.2, position=((c + x) / 2, s / 2), angle=sympy.atan2(-s, x - c))
    slider = made.body("slider", mass=3, inertia=0.1, position=(x, 0))
    made.add(Revolute("a", made.ground, crank, (0, 0), (-CRANK / 2, 0)))
    made.add(Revolute("b", crank, rod, (CRANK / 2, 0), (-LENGTH / 2, 0)))
    made.add(Revolute("c", rod, slider, (LENGTH / 2, 0), (0, 0)))
    made.add(Prismatic("guide", made.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    made.add(SpringDamper("spring", made.ground, slider, (3, 0), (0, 0), stiffness=50, damping=4, free_length=1))
    made.output("x", slider.position[0], units="m")
    return made


def ensemble(mechanism):
    study = uqmbd.Study("s", mechanism, [0, 0.1], [MonteCarlo(samples=4)])
    return study.problem(study.propagators[0]).ensemble(VALUES)


def by_symbols(mechanism, state, value, names):
    """Return M, f, D and g at a state by differentiating the symbolic terms: Lagrange's equations."""
    terms = mechanism_terms(mechanism)
    q, v = (sympy.Matrix(x) for x in (terms.coordinates, terms.velocities))
    kinetic, potential = sum(terms.kinetic), sum(terms.potential)
    momentum = sympy.Matrix([kinetic]).jacobian(v).T
    mass = momentum.jacobian(v)
    force = sympy.Matrix([kinetic - potential]).jacobian(q).T - momentum.jacobian(q) * v
    for f, w in terms.work:
        force += sympy.Matrix([w]).jacobian(v).T * f
    phi = sympy.Matrix([terms.constraints[terms.equations.index(name)] for name in names])
    d = phi.jacobian(q)
    g = -(d * v).jacobian(q) * v
    known = {LENGTH: value, **dict(zip([*q, *v], state, strict=True))}
    return [np.array(x.subs(known).evalf().tolist(), dtype=float) for x in (mass, force, d, g)]


@pytest.mark.thorough
@pytest.mark.parametrize("make", [pendulum, slider_crank])
def test_equations_of_motion_are_those_of_the_symbolic_terms(make):
    mechanism = make()
    one = ensemble(mechanism)
    states = one.start.state
    mass, force, d, g = one.equations_of_motion(0.0, states)
    n, kept = states.shape[1] // 2, len(one.equations)
    assert (mass.shape, force.shape, d.shape, g.shape) == ((3, n, n), (3, n), (3, kept, n), (3, kept))
    a, multipliers = one.accelerations(0.0, states)
    assert (a.shape, multipliers.shape) == ((3, n), (3, kept))
    for k, value in enumerate(VALUES[:, 0]):
        exact = by_symbols(mechanism, states[k], value, one.equations)
        for found, expected in zip((mass[k], force[k, :, None], d[k], g[k, :, None]), exact, strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-9)
        whole = np.block([[exact[0], exact[2].T], [exact[2], np.zeros((kept, kept))]])
        solved = np.linalg.solve(whole, np.concatenate([exact[1], exact[3]]))[:, 0]
        np.testing.assert_allclose(np.concatenate([a[k], multipliers[k]]), solved, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(one.start.a[k], a[k], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(one.start.multipliers[k], multipliers[k], rtol=1e-9, atol=1e-9)


def test_a_pendulum_at_rest_has_the_numbers_of_textbooks():
    """Released from the horizontal: angular acceleration 3 g / (2 length), and a quarter of its weight at the pivot."""
    one = ensemble(pendulum())
    a, multipliers = one.accelerations(0.0, one.start.state)
    np.testing.assert_allclose(a[:, 1], -0.75 * G)  # of the centre
    np.testing.assert_allclose(2 * a[:, 3], -1.5 * G / VALUES[:, 0])  # of half the angle
    assert one.equations == ("rod: unit quaternion", "pivot: point x", "pivot: point y")
    np.testing.assert_allclose(multipliers, np.tile([0, 0, -2 * G / 4], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(one.start.q, [[x / 2, 0, 1, 0] for x in VALUES[:, 0]])


@pytest.mark.parametrize("make", [pendulum, pytest.param(slider_crank, marks=pytest.mark.thorough)])
def test_the_jacobian_has_its_pattern_and_layout(make):
    """By central differences, at unknowns and rates that are no motion."""
    one = ensemble(make())
    rng = np.random.default_rng(1)
    y = one.pack(one.start.q, one.start.s, one.start.v, one.start.multipliers)
    n, c, h = y.shape[1], 7.0, 1e-6
    assert [one.unknowns[x].stop for x in "qsvlm"][-1] == n
    y, yp = y + 0.1 * rng.normal(size=y.shape), rng.normal(size=y.shape)
    rows, pointers = one.pattern
    assert (rows.shape, pointers.shape) == ((pointers[-1],), (n + 1,))
    values = one.jacobian(0.2, y, yp, c)
    assert values.shape == (3, len(rows))
    found = np.zeros((3, n, n))
    found[:, rows, np.repeat(np.arange(n), np.diff(pointers))] = values
    differences = np.zeros((3, n, n))
    for k in range(n):
        step = h * np.eye(n)[k]
        upper, lower = (one.residual(0.2, y + x * step, yp + c * x * step) for x in (1, -1))
        differences[:, :, k] = (upper - lower) / (2 * h)
    np.testing.assert_allclose(found, differences, atol=1e-6 * np.abs(differences).max())


def test_pack_and_expand_keep_a_state():
    one = ensemble(slider_crank())
    y = one.pack(one.start.q, one.start.s, one.start.v, one.start.multipliers)
    q, s, v = one.expand(y)
    np.testing.assert_array_equal(np.concatenate([q, s, v], axis=1), one.start.state)
    assert np.abs(one.residual(0.0, y, 0 * y)[:, one.unknowns["l"]]).max() < 1e-9


def test_a_joint_input_for_tests():
    """The inputs of a mechanism are those of a problem, and need no study."""
    a, b = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)), uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
    made = uqmbd.Mechanism("stone", uqmbd.Line())
    made.body("stone", mass=1, position=a, velocity=b)
    assert (made.inputs.names, made.inputs.means.tolist()) == (("a", "b"), [1, 1])
    np.testing.assert_allclose(made.inputs.from_uniform(np.array([[0.25, 0.5]])), [[0.5, 1.0]])
