"""Constraints between velocities in motion: random ones against SciPy, long chains of them, and poses they end in."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import build
from uqmbd_joints import Distance, Revolute, RollingWheel, Skate
from uqmbd_springs import PointForce

NUMBERS = st.lists(st.floats(-1, 1).map(lambda x: round(x, 2)), min_size=14, max_size=14)


def _terms(self, p):
    q, v = [*p.body_i.position, *p.body_j.position], [*p.body_i.velocity, *p.body_j.velocity]
    yield uqmbd.extend.VelocityConstraint(equation([getattr(p, f"n{k}") for k in range(14)], q, v, p.time), "bound")


Bound = type(
    "Bound",
    (uqmbd.Component,),
    {"spaces": (uqmbd.Translational,), "terms": _terms, "__doc__": "Two particles bound by `equation`."}
    | {f"n{k}": uqmbd.Parameter("1", "a number") for k in range(14)},
)


def equation(numbers, q, v, t):
    """``(a + B(q)) . v + c q_0 v_3 + d sin t``."""
    a, b, (c, d) = numbers[:4], numbers[4:12], numbers[12:]
    rows = [x + b[k] * q[(k + 1) % 4] + b[4 + k] * q[k] ** 2 for k, x in enumerate(a)]
    return sum(x * y for x, y in zip(rows, v, strict=True)) + c * q[0] * v[3] + d * sympy.sin(t)


def expected_motion(numbers, masses, force, times):
    """Integrate ``M a + D^T l = F``, ``D a = -(dD/dt v + db/dt)`` by SciPy, D by SymPy, from the start of least norm."""
    q, v, t = sympy.symbols("q:4"), sympy.symbols("v:4"), sympy.Symbol("t")
    psi = sympy.Matrix([equation(n, q, v, t) for n in numbers])
    d = psi.jacobian(v)
    drift = psi.jacobian(q) * sympy.Matrix(v) + psi.diff(t)
    matrix, right = sympy.lambdify([q, t], d), sympy.lambdify([q, v, t], drift)
    b = sympy.lambdify([q, t], psi.subs(dict.fromkeys(v, 0)))
    inverse = np.repeat(1 / np.array(masses), 2)

    def rates(time, z):
        rows = np.array(matrix(z[:4], time), dtype=float)
        free = inverse * force
        wanted = rows @ free + np.array(right(z[:4], z[4:], time), dtype=float)[:, 0]
        multipliers = np.linalg.solve(rows * inverse @ rows.T, wanted)
        return np.concatenate([z[4:], free - inverse * (rows.T @ multipliers)])

    start = np.array([0.3, -0.2, 0.8, 0.5])
    speed = np.linalg.lstsq(np.array(matrix(start, 0.0), dtype=float), -np.array(b(start, 0.0), dtype=float)[:, 0])[0]
    solution = solve_ivp(rates, times[[0, -1]], [*start, *speed], t_eval=times, rtol=1e-11, atol=1e-12)
    return solution.y if solution.success else None


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@given(first=NUMBERS, second=NUMBERS, both=st.booleans())
@settings(max_examples=6, deadline=None, derandomize=True)
def test_random_constraints_against_scipy(integrator, first, second, both):
    """Particles under a force and one or two random constraints, which hold no positions and no energy."""
    numbers = [first, second] if both else [first]
    # a constraint that vanishes on the way is singular: its constant part leads
    numbers = [[*(x + (2.0 if k == j else 0.0) for k, x in enumerate(n))] for j, n in enumerate(numbers)]
    masses, force, times = (1.0, 2.5), np.array([0.4, -1.0, 0.7, 0.2]), np.linspace(0, 0.6, 7)
    expected = expected_motion(numbers, masses, force, times)
    if expected is None:
        return
    mechanism = uqmbd.Mechanism("bound", uqmbd.Translational())
    one = mechanism.body("one", mass=masses[0], position=(0.3, -0.2))
    other = mechanism.body("other", mass=masses[1], position=(0.8, 0.5))
    for k, given_numbers in enumerate(numbers):
        mechanism.add(Bound(f"bound{k}", one, other, *given_numbers))
    mechanism.add(PointForce("push", one, (0, 0), tuple(force[:2])))
    mechanism.add(PointForce("pull", other, (0, 0), tuple(force[2:])))
    for k, x in enumerate([*one.position, *other.position, *one.velocity, *other.velocity]):
        mechanism.output(f"z{k}", x)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, integrator=integrator)
    found = np.array([data[f"z{k}"].values for k in range(8)])
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(found - expected) < 1e-6 * np.maximum(scale, 1)).all()


def train(cars):
    """A tractor with trailers, each on an axle that does not slip sideways: as many equations between velocities."""
    mechanism = uqmbd.Mechanism("train", uqmbd.Planar())
    before = mechanism.body("car0", mass=2, inertia=0.3, com=(0.2, 0), velocity=(1, 0), angular_velocity=0.5)
    mechanism.add(Skate("axle0", mechanism.ground, before, (0, 0), (1, 0)))
    for k in range(1, cars):
        car = mechanism.body(f"car{k}", mass=1, inertia=0.1, position=(-k, 0))
        mechanism.add(Revolute(f"hook{k}", before, car, (0, 0), (1, 0)))
        mechanism.add(Skate(f"axle{k}", mechanism.ground, car, (0, 0), (1, 0)))
        before = car
    mechanism.output("x", before.position[0], units="m")
    mechanism.output("y", before.position[1], units="m")
    mechanism.output("across", before.direction((0, 1)).dot(before.velocity), units="m/s")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("cars", [3, 20])
def test_a_tractor_with_trailers(cars, energy, close):
    """Two degrees of freedom of the velocities, however long it is; energy stays, and both integrators agree."""
    mechanism, times = train(cars), np.linspace(0, 1.5, 7)
    found = uqmbd.check(mechanism)
    assert (found.mobility, found.velocity_mobility, found.redundant) == (cars + 2, 2, ())
    if cars > 3:
        assert build(mechanism).system.fronts is not None  # a large system, by blocks
    first, second = (uqmbd.simulate(mechanism, times, rtol=1e-8, integrator=x) for x in ("dop853", "ida"))
    for name in ("x", "y", "across"):
        close(first[name], second[name], relative=1e-5, scale=1.0)
    close(first["across"], 0, scale=1.0, relative=1e-7)
    total = sum(energy(mechanism, times))
    close(total, np.full(7, total[0]), relative=1e-6)


@pytest.mark.thorough
def test_an_axle_with_two_blades():
    """Two wheels on one axle: the second blade says the same at all times, is named, and is left out."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Planar())
    cart = mechanism.body("cart", mass=1, inertia=0.1, com=(0.1, 0), velocity=(1, 0), angular_velocity=1)
    for name, y in (("left", 0.2), ("right", -0.2)):
        mechanism.add(Skate(name, mechanism.ground, cart, (0, y), (1, 0)))
    left = mechanism.components["left"]
    mechanism.output("force", left.reaction_force.norm(), units="N")
    mechanism.output("speed", cart.velocity.norm(), units="m/s")
    found = uqmbd.check(mechanism)
    assert found.redundant == ("right: blade",) or found.redundant == ("left: blade",)
    assert any(name.startswith("left.reaction_force") for name in found.not_unique)
    with pytest.warns(uqmbd.RedundantConstraintWarning, match="some reactions are not unique"):
        data = uqmbd.simulate(mechanism, np.linspace(0, 2, 5))
    # forward ``u' = a w^2``, and the energy stays: the second blade changes nothing
    whole, speed = 0.1 + 0.01, np.sqrt(1 + 0.11)
    k = 0.1 * speed / whole
    expected = speed * np.tanh(k * np.linspace(0, 2, 5) + np.arctanh(1 / speed))
    np.testing.assert_allclose(data["speed"], expected, rtol=1e-5)


@pytest.mark.thorough
def test_a_disc_that_comes_to_lie_flat_is_reported():
    """Without any turning it falls over: a singular pose, where the motion ends."""
    mechanism = uqmbd.Mechanism("disc", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    lean = 1.2
    quaternion = (np.cos(lean / 2 - np.pi / 4), 0, np.sin(lean / 2 - np.pi / 4), 0)
    position = (0.25 * np.sin(lean), 0, 0.25 * np.cos(lean))
    disc = mechanism.body("disc", mass=1, inertia=(0.02, 0.02, 0.03), position=position, quaternion=quaternion)
    mechanism.add(RollingWheel("road", mechanism.ground, disc, (0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1), 0.25))
    mechanism.output("z", disc.position[2], units="m")
    with pytest.raises(uqmbd.IntegrationError, match="stopped at t = 0.16"):
        uqmbd.simulate(mechanism, np.linspace(0, 1, 11), integrator="ida")


@pytest.mark.thorough
def test_a_rod_between_skates_conserves_its_energy_in_contact(energy):
    """A particle on a rod is dragged by a skate: constraints of positions and of velocities in two components."""
    mechanism = uqmbd.Mechanism("drag", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=0.2, com=(0.2, 0.1), velocity=(1, 0), angular_velocity=1.5)
    weight = mechanism.body("weight", mass=0.5, inertia=0.05, position=(-0.6, 0.3))
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.add(Distance("rod", body, weight, (0, 0), (0.1, 0), sympy.sqrt(0.34)))
    mechanism.output("x", body.position[0], units="m")
    times = np.linspace(0, 3, 13)
    total = sum(energy(mechanism, times))
    assert np.abs(total - total[0]).max() < 1e-5 * total[0]
