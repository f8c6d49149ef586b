"""Auxiliary states of a component in the laws of other components, and in start conditions."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.model_building import build
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 2, 9)


class Lag(uqmbd.Component):
    """Filtered speed ``s``: ``tau s' = speed - s``."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    tau = uqmbd.Parameter("s", "time constant", example=0.2)
    first = uqmbd.Parameter("m/s", "initial value", example=0.2)

    def terms(self, p):
        s = p.state("filtered", "m/s")
        yield uqmbd.Auxiliary(s, (p.body.velocity[0] - s) / p.tau, p.first)


class Heat(uqmbd.Component):
    """A state that the position and a parameter drive: ``s' = 3 x - rate s + source``."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    source = uqmbd.Parameter("K/s", "source", example=1.0)
    rate = uqmbd.Parameter("1/s", "rate", example=2.0)

    def terms(self, p):
        s = p.state("heat", "K")
        yield uqmbd.Auxiliary(s, 3 * p.body.position[0] - p.rate * s + p.source, 0.5)


class Push(uqmbd.Component):
    """A force of the law that it is given."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    force = uqmbd.Parameter("N", "force", example=1.0)

    def terms(self, p):
        yield uqmbd.VirtualWork(p.force, p.body.velocity[0])


def two_masses():
    """Two masses on springs; the stiffness of the second follows the filtered speed of the first."""
    mechanism = uqmbd.Mechanism("two", uqmbd.Line())
    a = mechanism.body("a", mass=2, position=1.0, velocity=0.3)
    b = mechanism.body("b", mass=3, position=2.0)
    lag = mechanism.add(Lag("lag", a, tau=0.2, first=0.1))
    mechanism.add(SpringDamper("one", mechanism.ground, a, 0, 0, stiffness=20))
    stiffness = 30 + 50 * lag.state("filtered")
    mechanism.add(SpringDamper("two", mechanism.ground, b, 0, 0, stiffness=stiffness, damping=2))
    mechanism.output("x", b.position[0])
    mechanism.output("s", lag.state("filtered"))
    return mechanism, a, b, lag


@pytest.mark.parametrize("integrator", ["dop853", "ida", "radau"])
def test_a_motion_is_that_of_the_coupled_equations(integrator):
    def rates(_, y):
        xa, xb, va, vb, s = y
        return [va, vb, -10 * xa, (-(30 + 50 * s) * xb - 2 * vb) / 3, (va - s) / 0.2]

    exact = solve_ivp(rates, (0, 2), [1, 2, 0.3, 0, 0.1], t_eval=TIMES, rtol=1e-11, atol=1e-12).y
    mechanism, *_ = two_masses()
    found = uqmbd.simulate(mechanism, TIMES, rtol=1e-8, integrator=integrator, check=False)
    np.testing.assert_allclose(found["x"], exact[1], atol=5e-6)
    np.testing.assert_allclose(found["s"], exact[4], atol=5e-6)


def cascade(inputs=False):
    """Two states, the second driven by the first, whose force acts on a mass on a spring."""
    source = uqmbd.RandomVariable("source", chaospy.Uniform(0.5, 1.5)) if inputs else 1.0
    mechanism = uqmbd.Mechanism("cascade", uqmbd.Line())
    mass = mechanism.body("mass", mass=2)
    first = mechanism.add(Heat("first", mass, source=source, rate=2.0))
    second = mechanism.add(Heat("second", mass, source=first.state("heat") * 0.7, rate=1 + 0.1 * first.state("heat")))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=50, damping=0.4))
    mechanism.add(Push("push", mass, force=4 * second.state("heat")))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("s", second.state("heat"), units="K")
    return mechanism


@pytest.mark.parametrize("fuse", [True, False])
def test_the_jacobian_is_the_derivative_of_the_residual(fuse):
    """By central differences, at random states, of all unknowns and their rates."""
    model = build(cascade(inputs=True), fuse=fuse)
    rng = np.random.default_rng(3)
    ensemble = Ensemble(model, np.array([[0.7]]))
    n = model.layout.unknowns
    y, rates = rng.normal(size=(2, 1, n))
    dense, pattern = np.zeros((n, n)), ensemble.pattern
    column = np.repeat(np.arange(n), np.diff(pattern[1]))
    dense[pattern[0], column] = ensemble.jacobian(0.0, y, rates, 1.7)[0]
    for k in range(n):
        step = np.eye(n)[k] * 1e-6
        ahead = ensemble.residual(0.0, y + step, rates + 1.7 * step)
        behind = ensemble.residual(0.0, y - step, rates - 1.7 * step)
        np.testing.assert_allclose(dense[:, k], (ahead - behind)[0] / 2e-6, atol=1e-6)


def test_equilibrium_and_frequencies_are_those_of_the_linear_equations():
    mechanism = uqmbd.Mechanism("linear", uqmbd.Line())
    mass = mechanism.body("mass", mass=2)
    heat = mechanism.add(Heat("heat", mass, source=1.0, rate=2.0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=50, damping=0.4))
    mechanism.add(Push("push", mass, force=4 * heat.state("heat")))
    mechanism.output("x", mass.position[0])
    mechanism.output("s", heat.state("heat"))
    mechanism.output("frequency", uqmbd.eigenfrequency(1))
    rest = uqmbd.static_equilibrium(mechanism)
    expected = np.linalg.solve([[50, -4], [3, -2]], [0, -1])
    np.testing.assert_allclose([float(rest["x"]), float(rest["s"])], expected, rtol=1e-6)
    values = np.linalg.eigvals([[0, 1, 0], [-25, -0.2, 2], [3, 0, -2]])
    oscillating = abs(values[np.abs(values.imag) > 1e-6][0]) / (2 * np.pi)
    assert float(uqmbd.simulate(mechanism, [0, 0.1], check=False)["frequency"]) == pytest.approx(oscillating, rel=1e-6)


def test_a_reaction_contains_the_state_of_another_component():
    """The force of a spring whose stiffness is a state."""
    mechanism, _, b, lag = two_masses()
    spring = mechanism.components["two"]
    mechanism.output("force", spring.reaction_force[0])
    found = uqmbd.simulate(mechanism, TIMES, rtol=1e-8, check=False)
    velocity = uqmbd.simulate(with_velocity(), TIMES, rtol=1e-8, check=False)["v"]
    expected = -(30 + 50 * found["s"]) * found["x"] - 2 * velocity
    np.testing.assert_allclose(np.abs(found["force"]), np.abs(expected), atol=1e-4)


def with_velocity():
    mechanism, _, b, _ = two_masses()
    mechanism.output("v", b.velocity[0])
    return mechanism


@pytest.mark.thorough
def test_methods_propagate_through_the_coupling():
    """Mean and standard deviation are those of solve_ivp at Gauss nodes of the source."""
    from uqmbd_collocation import Collocation
    from uqmbd_galerkin import Galerkin

    def rates(_, y, source):
        x, v, s, u = y
        return [v, (-50 * x - 0.4 * v + 4 * u) / 2, 3 * x - 2 * s + source, 3 * x - (1 + 0.1 * s) * u + 0.7 * s]

    nodes, weights = np.polynomial.legendre.leggauss(12)
    start = [0, 0, 0.5, 0.5]
    runs = [
        solve_ivp(rates, (0, 2), start, args=(1 + 0.5 * z,), t_eval=TIMES, rtol=1e-11, atol=1e-12).y[[0, 3]]
        for z in nodes
    ]
    mean = np.tensordot(weights / 2, runs, 1)
    std = np.sqrt(np.tensordot(weights / 2, (np.array(runs) - mean) ** 2, 1))
    study = uqmbd.Study("c", cascade(inputs=True), TIMES, [Collocation(order=4), Galerkin(order=4)], rtol=1e-8)
    tree = study.run()
    for label in ("collocation", "galerkin"):
        found = tree[label]["statistics"].dataset
        np.testing.assert_allclose(found["mean"], mean, atol=1e-6)
        np.testing.assert_allclose(found["std"], std, atol=1e-6)


def test_a_start_condition_contains_the_initial_value():
    """Also of a parameter that becomes random afterwards: positions follow it."""
    mechanism, _, b, lag = two_masses()
    mechanism.start(b.position[0], 5 * lag.state("filtered") + 1)
    assert float(uqmbd.simulate(mechanism, TIMES, check=False)["x"][0]) == pytest.approx(1.5)
    (first,) = mechanism.randomise("lag.first", relative=0.1)
    found = uqmbd.simulate(mechanism, TIMES, {first.name: 0.3}, check=False)
    assert float(found["x"][0]) == pytest.approx(2.5)


def test_a_start_condition_of_an_initial_value_alone_is_refused():
    mechanism, *_, lag = two_masses()
    with pytest.raises(uqmbd.StudyError, match="neither a position nor a velocity"):
        mechanism.start(lag.state("filtered"), 1)


class Wrong(uqmbd.Component):
    """Puts the law where only positions may be."""

    bodies, spaces = ("body",), (uqmbd.Line,)
    law = uqmbd.Parameter("", "law", example=1.0)
    where = uqmbd.Parameter("", "place", kind="option", default="constraint")

    def terms(self, p):
        x, v = p.body.position[0], p.body.velocity[0]
        if p.where == "constraint":
            yield uqmbd.Constraint(x - p.law)
        elif p.where == "speed":
            yield uqmbd.extend.VelocityConstraint(v - p.law)
        elif p.where == "mass":
            yield uqmbd.Kinetic((2 + p.law) * v**2 / 2)
        elif p.where == "event":
            yield uqmbd.Event(x - p.law, label="passed")
        elif p.where == "initial":
            s = p.state("own")
            yield uqmbd.Auxiliary(s, -s, p.law)
        else:
            length = p.let("length", x * p.law)
            yield uqmbd.VirtualWork(p.rate_of(length), v)


@pytest.mark.parametrize("where", ["constraint", "speed", "mass", "event", "initial", "rate"])
def test_places_where_its_rate_would_be_needed_are_refused(where):
    """The message says where it may be instead."""
    mechanism, a, _, lag = two_masses()
    mechanism.add(Wrong("wrong", a, law=lag.state("filtered") + 2, where=where))
    with pytest.raises(uqmbd.StudyError, match="auxiliary state of another component.*as a force"):
        uqmbd.simulate(mechanism, TIMES, check=False)


def test_a_state_of_another_mechanism_is_refused():
    _, *_, lag = two_masses()
    other, a, *_ = two_masses()
    with pytest.raises(uqmbd.StudyError, match="lag"):
        other.add(Lag("law", a, tau=0.2, first=lag.state("filtered")))
