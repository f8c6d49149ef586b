"""The proof that the projected residual is that of Variational Work: energies averaged by algebra give the same."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_joints import Prismatic
from uqmbd_springs import SpringDamper, TorsionSpringDamper

from .exact import moment
from .symbolic import VariationalWork


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "options", "order"),
    [
        ("pendulum", {"loaded": True}, 1),
        ("pendulum", {"loaded": True}, 2),
        ("slider_crank", {"torque": 0.1}, 1),
        ("slider_crank", {"torque": 0.1}, 2),
        ("spatial_pendulum", {}, 1),
        ("sleigh", {}, 1),
        ("sleigh", {}, 2),
        ("rolling_wheel", {}, 1),
        ("rolling_wheel", {}, 2),
        pytest.param("spatial_pendulum", {}, 2, marks=pytest.mark.slow),
    ],
)
def test_averaged_energies_and_work_give_the_projected_residual(mechanisms, project, name, options, order):
    """At random coefficients, rates and times; the quadrature is exact for the polynomials that occur."""
    mechanism = mechanisms[name](**options)
    # an integrand of degree 4 p of the states, and 3 of length and mass
    projected = project(mechanism, order, nodes=2 * order + 3)
    work = VariationalWork(mechanism, uqmbd.extend.index_set(2, order))
    generator = np.random.default_rng(order)
    for time in (0.0, 0.7, -2.0):
        y, rates = generator.normal(size=(2, projected.terms, projected.model.layout.unknowns))
        expected = work.projected_residual(projected, time, y, rates)
        found = projected.residual(time, y, rates)
        scale = np.abs(expected).max(axis=0)
        assert (scale > 0.01).all()  # every equation is looked at
        assert (np.abs(found - expected) <= 1e-10 * scale).all()


def test_too_few_nodes_are_seen(mechanisms, project):
    """The comparison is sharp: with order + 1 nodes the quadrature is not exact."""
    mechanism = mechanisms["pendulum"]()
    projected = project(mechanism, 1)
    work = VariationalWork(mechanism, uqmbd.extend.index_set(2, 1))
    y, rates = np.random.default_rng(0).normal(size=(2, 3, projected.model.layout.unknowns))
    expected = work.projected_residual(projected, 0.0, y, rates)
    assert np.abs(projected.residual(0.0, y, rates) - expected).max() > 1e-3 * np.abs(expected).max()


def test_moments_are_those_of_the_distributions():
    """Against chaospy's raw moments, and orthogonality of the polynomials by Gauss quadrature of NumPy."""
    for power in range(9):
        assert float(moment("hermite", power, ())) == pytest.approx(float(chaospy.Normal().mom(power)), abs=1e-12)
        assert float(moment("legendre", power, ())) == pytest.approx(
            float(chaospy.Uniform(-1, 1).mom(power)), abs=1e-12
        )
    x, w = np.polynomial.hermite_e.hermegauss(12)
    value = np.polynomial.hermite_e.hermeval
    expected = np.sum(w / w.sum() * x**2 * value(x, [0, 0, 1]) * value(x, [0, 0, 0, 0, 1]))
    assert float(moment("hermite", 2, (2, 4))) == pytest.approx(expected)
    x, w = np.polynomial.legendre.leggauss(12)
    value = np.polynomial.legendre.legval
    expected = np.sum(w / 2 * x * value(x, [0, 0, 1]) * value(x, [0, 0, 0, 1]))
    assert float(moment("legendre", 1, (2, 3))) == pytest.approx(expected)


@pytest.mark.thorough
def test_average_is_the_integral_over_the_density():
    """SymPy integrates the Lagrangian of a body with a random mass over the uniform density, without our moments."""
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.5, 1.5))
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -10)))
    rod = mechanism.body("rod", mass=mass, inertia=2 * mass, com=(0.5, 0))
    terms = uqmbd.extend.mechanism_terms(mechanism)
    work = VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))
    x = sympy.Symbol("x")
    expansions = {
        s: sympy.Symbol(f"{letter}{k}_0") + sympy.Symbol(f"{letter}{k}_1") * x
        for letter, symbols in (("q", rod.q), ("v", rod.v))
        for k, s in enumerate(symbols)
    }
    lagrangian = sympy.Add(*terms.kinetic, *(-e for e in terms.potential))
    inserted = sympy.expand(sympy.nsimplify(lagrangian.xreplace(expansions | {mass: 1 + x / 2}), rational=True))
    expected = sympy.integrate(inserted / 2, (x, -1, 1))
    assert sympy.expand(work.expression(work.averaged_lagrangian) - expected) == 0


def test_equations_are_those_of_euler_and_lagrange_by_sympy(mechanisms):
    """SymPy takes the Euler-Lagrange equations of the averaged Lagrangian with constraints as functions of time."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.1))
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Translational(gravity=(0, -10)))
    bob = mechanism.body("bob", mass=1 + length, position=(0, -length))
    from uqmbd_joints import Distance

    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length))
    work = VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))
    augmented = work.expression(work.averaged_lagrangian) - work.expression(work.averaged_constraints)
    t = sympy.Symbol("t")
    names = [(k, j) for j in range(2) for k in range(2)]
    q = {(k, j): sympy.Function(f"Q{k}_{j}")(t) for k, j in names}
    augmented = augmented.subs({sympy.Symbol(f"v{k}_{j}"): q[k, j].diff(t) for k, j in names})
    augmented = augmented.subs({sympy.Symbol(f"q{k}_{j}"): q[k, j] for k, j in names})
    equations = sympy.calculus.euler.euler_equations(augmented, list(q.values()), [t])
    generator = np.random.default_rng(3)
    y, v, a = generator.normal(size=(3, 2, 2))
    multipliers = generator.normal(size=(2, 1))
    _, found, _, _ = work.residual(0.0, y, v, multipliers, np.zeros((2, 1)), v, a)
    values = {sympy.Symbol(f"l0_{j}"): multipliers[j, 0] for j in range(2)}
    for (k, j), equation in zip(names, equations, strict=True):
        e = equation.lhs
        for key, function in q.items():
            e = e.subs(function.diff(t, 2), a[key[::-1]])
        for key, function in q.items():
            e = e.subs(function.diff(t), v[key[::-1]])
        e = e.subs({function: y[key[::-1]] for key, function in q.items()} | values)
        assert float(-e) == pytest.approx(found[j, k], rel=1e-12)  # Euler's sign is dL/dq - d/dt dL/dv


def test_what_is_no_polynomial_is_refused():
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.1))
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    body = mechanism.body("body", mass=1, position=(2, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), 10, free_length=length))
    work = VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))
    with pytest.raises(uqmbd.StudyError, match="is no polynomial"):
        work.averaged_lagrangian  # noqa: B018 - built once


@pytest.mark.parametrize(
    "distribution", [chaospy.LogNormal(0, 0.1), chaospy.Beta(2, 3, 0.5, 1)], ids=["lognormal", "beta"]
)
def test_distributions_without_known_moments_are_refused(distribution):
    mechanism = uqmbd.Mechanism("body", uqmbd.Translational())
    mechanism.body("body", mass=uqmbd.RandomVariable("mass", distribution))
    with pytest.raises(uqmbd.StudyError, match="moments of independent normal and uniform inputs"):
        VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))


def test_auxiliary_states_are_refused():
    mechanism = uqmbd.Mechanism("torsion", uqmbd.Planar())
    k = uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, wheel, stiffness=k))
    with pytest.raises(uqmbd.StudyError, match="differential equation of its own"):
        VariationalWork(mechanism, uqmbd.extend.index_set(1, 1))


def test_terms_of_a_mechanism_are_in_the_symbols_of_its_bodies():
    k = uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))
    mechanism = uqmbd.Mechanism("slide", uqmbd.Planar(gravity=(0, -10)))
    block = mechanism.body("block", mass=3, inertia=1)
    mechanism.add(Prismatic("guide", mechanism.ground, block, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, block, stiffness=k, damping=2))
    terms = uqmbd.extend.mechanism_terms(mechanism)
    x, y, e0, e1 = block.q
    assert terms.coordinates == block.q and terms.velocities == block.v
    assert sympy.simplify(terms.potential[0] - 30 * y) == 0
    assert sympy.simplify(terms.constraints[0] - (e0**2 + e1**2 - 1)) == 0
    assert terms.equations[0] == "block: unit quaternion" and terms.equations[1].startswith("guide: ")
    (state,) = terms.states
    assert any(e.has(state) and e.has(k) for e in terms.potential)
    assert len(terms.rates) == len(terms.initial) == 1 and terms.work
