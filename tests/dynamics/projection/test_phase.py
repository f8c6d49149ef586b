"""The phase of a clock as the independent variable: the averaged equations by algebra, and realisations by themselves."""

from __future__ import annotations

from functools import cache

import chaospy
import mpmath
import numpy as np
import pytest
import sympy
from scipy.integrate import quad, solve_ivp

import uqmbd
from uqmbd_joints import Distance, Revolute
from uqmbd_springs import PointForce, Torque

ORDER = 2


def conical(length):
    """A bob on a rod that turns over, with a force that grows with time: one constraint, and the time matters."""
    mechanism = uqmbd.Mechanism("bob", uqmbd.Translational(gravity=(0, -10)))
    bob = mechanism.body("bob", mass=1 + length, position=(length, 0), velocity=(0, 9))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length))
    mechanism.add(PointForce("wind", bob, (0, 0), (2 * uqmbd.t, 0)))
    x, y = bob.position
    mechanism.output("rate", (x * bob.velocity[1] - y * bob.velocity[0]) / (x**2 + y**2), units="rad/s")
    return mechanism, bob


def projection(mechanism, order, nodes, terms=None):
    """Project a mechanism whose output "rate" is that of the clock."""
    study = uqmbd.Study("study", mechanism, [0, 1], [], rtol=1e-10)
    model = study.model
    space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    terms = uqmbd.extend.index_set(space.dimension, order) if terms is None else terms
    rule = uqmbd.extend.gauss_tensor(space, [nodes] * space.dimension)
    ensemble = uqmbd.extend.Ensemble(model, space.to_inputs(rule.nodes))
    row = model.outputs.names.index("rate")

    def rates(times, states):
        return ensemble.outputs(times[:, None], states[:, None])[:, row, 0]

    return uqmbd.extend.ProjectedEnsemble(ensemble, space.evaluate(rule.nodes, terms), rule.weights), rates


def parametrised_equations(length, mass):
    """SymPy's Euler-Lagrange equations with the phase as parameter: of the Lagrangian ``t' L(q, q' / t', t)``.

    As functions of positions, velocities, their derivatives by the phase, multiplier, time and time per phase.
    """
    s = sympy.Symbol("s")
    x, y, t = (sympy.Function(name)(s) for name in "xyt")
    v = [x.diff(s) / t.diff(s), y.diff(s) / t.diff(s)]
    multiplier = sympy.Function("m")(s)
    phi = x**2 + y**2 - length**2
    lagrangian = t.diff(s) * (mass * (v[0] ** 2 + v[1] ** 2) / 2 - mass * 10 * y) - multiplier * phi
    equations = sympy.calculus.euler.euler_equations(lagrangian, [x, y], [s])
    forces = [2 * t * t.diff(s), 0]
    px, py, vx, vy, wx, wy, m, time, pace, faster = symbols = sympy.symbols("px py vx vy wx wy m time pace faster")
    # q' = p v, so that q'' = p v' + p' v
    values = [
        (x.diff(s, 2), pace * wx + faster * vx),
        (y.diff(s, 2), pace * wy + faster * vy),
        (t.diff(s, 2), faster),
        (x.diff(s), pace * vx),
        (y.diff(s), pace * vy),
        (t.diff(s), pace),
        (x, px),
        (y, py),
        (t, time),
        (multiplier, m),
    ]
    # Euler's sign is dL/dq - d/dt dL/dv
    found = [sympy.simplify((-e.lhs - f).subs(values)) for e, f in zip(equations, forces, strict=True)]
    assert not any(e.has(faster) for e in found)
    speed = (phi.diff(s) / t.diff(s)).subs(values[3:])
    held = sympy.expand((speed.diff(px) * vx + speed.diff(py) * vy) * pace + speed.diff(vx) * wx + speed.diff(vy) * wy)
    return [sympy.lambdify((length, *symbols[:-1]), e, "mpmath") for e in (*found, held)]


@pytest.mark.thorough
@pytest.mark.parametrize(("nodes", "exact"), [(16, True), (3, False)])
def test_rates_in_phase_satisfy_the_averaged_equations_of_the_parametrised_lagrangian(nodes, exact):
    """SymPy derives them, with the phase as parameter; mpmath averages them over the density; no quadrature of ours.

    The comparison is sharp: too few nodes of ours are seen.
    """
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.7, 1.3))
    mechanism, _ = conical(length)
    projected, rates = projection(mechanism, ORDER, nodes)
    motion = projected.in_phase(rates, np.array([0.0, 1.0]), rtol=1e-11)
    whole = motion.at(np.array([0.3, 5.0]))[:, 1]
    found, multipliers = motion.rates(whole)
    assert len(multipliers) == ORDER + 1 and whole.shape[1] == 5
    germ_length = sympy.Symbol("l")
    equations = parametrised_equations(germ_length, 1 + germ_length)

    def basis(z):
        return [1, mpmath.sqrt(3) * z, mpmath.sqrt(5) * (3 * z**2 - 1) / 2]

    def expanded(rows, z):
        return mpmath.fdot(map(float, rows), basis(z))

    def average(function):
        return [float(mpmath.quad(lambda z, j=j: function(z) * basis(z)[j] / 2, [-1, 1])) for j in range(ORDER + 1)]

    @cache
    def at(z):
        """States, their rates, multiplier, time, time per phase, and length."""
        x, y, vx, vy, time = (expanded(whole[:, k], z) for k in range(5))
        wx, wy = (expanded(found[:, k], z) for k in (2, 3))
        pace = (x**2 + y**2) / (x * vy - y * vx)
        return 1 + 3 * z / 10, x, y, vx, vy, wx, wy, time, pace

    # coordinates and time flow with their averages
    for k, flow in ((0, lambda z: at(z)[3] * at(z)[8]), (1, lambda z: at(z)[4] * at(z)[8]), (4, lambda z: at(z)[8])):
        assert not exact or found[:, k] == pytest.approx(average(flow), abs=1e-10)
    # a constraint of half the square of ours would have twice the multiplier: its scale is free, its equations are not
    (gradient,) = {float(c) for c in _gradient_scale(mechanism)}

    def motion_of(k):
        def residual(z):
            length, x, y, vx, vy, wx, wy, time, pace = at(z)
            m = expanded(multipliers[:, 0], z) * gradient
            return equations[k](length, x, y, vx, vy, wx, wy, m, time, pace)

        return residual

    left = [np.abs(average(motion_of(k))).max() / np.abs(found[:, 2:4]).max() for k in range(3)]
    assert max(left) <= 1e-11 if exact else max(left) >= 1e-7


def _gradient_scale(mechanism):
    """By what the constraint of the mechanism is a multiple of ``x^2 + y^2 - l^2``."""
    terms = uqmbd.extend.mechanism_terms(mechanism)
    (phi,) = terms.constraints
    x, y = terms.coordinates
    return [sympy.expand(phi).coeff(x, 2), sympy.expand(phi).coeff(y, 2)]


def test_each_node_moves_by_itself_where_nothing_is_truncated():
    """A rod that a torque which depends on the time drives: every node against SciPy, in time."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1))
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -10)))
    rod = mechanism.body(
        "rod", mass=1, inertia=length**2 / 12, position=(length / 2, 0), angle=0, angular_velocity=9 + length
    )
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.add(Torque("drive", rod, sympy.sin(3 * uqmbd.t)))
    mechanism.output("rate", rod.angular_velocity, units="rad/s")
    mechanism.output("angle", rod.angle, units="rad")
    projected, rates = projection(mechanism, 3, 4)
    assert projected.collocates
    motion = projected.in_phase(rates, np.array([0.0, 5.0]), rtol=1e-10)
    phases = np.linspace(0, 40, 9)
    nodal = projected.nodal(motion.at(phases))
    times, states = nodal[..., -1], nodal[..., :-1]
    rate, angle = projected.ensemble.outputs(times, states).transpose(1, 0, 2)
    for k, (value,) in enumerate(projected.ensemble.values):

        def free(t, y, value=value):
            return [y[1], (np.sin(3 * t) - 5 * value * np.cos(y[0])) / (value**2 / 3)]

        span = (0, times[k, -1] + 0.1)
        found = solve_ivp(free, span, [0, 9 + value], method="DOP853", rtol=1e-12, atol=1e-12, dense_output=True)
        # the phase is the angle: it is what it should be, at the node's own time
        assert found.sol(times[k])[0] == pytest.approx(phases, abs=1e-7)
        assert found.sol(times[k])[1] == pytest.approx(rate[k], rel=1e-7)
        assert angle[k] == pytest.approx(phases, abs=1e-7)
    assert np.ptp(times[:, -1]) > 0.04


def test_nodes_are_brought_to_the_same_phase_of_the_clock():
    """Bobs that start at different angles: the energy of each says how fast it is wherever it is."""
    start = uqmbd.RandomVariable("start", chaospy.Uniform(-0.5, 0.5))
    mechanism = uqmbd.Mechanism("bob", uqmbd.Translational(gravity=(0, -10)))
    c, s = sympy.cos(start), sympy.sin(start)
    bob = mechanism.body("bob", mass=1, position=(c, s), velocity=(-9 * s, 9 * c))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), 1))
    x, y = bob.position
    mechanism.output("rate", x * bob.velocity[1] - y * bob.velocity[0], units="rad/s")
    projected, rates = projection(mechanism, 3, 4)
    ahead = 3.0 - projected.ensemble.values[:, 0]
    motion = projected.in_phase(rates, np.array([0.0, 5.0]), 1e-10, ahead=ahead, within=2.0)
    phases = np.array([0.0, 1.0, 2.0, 4.0, 20.0])
    nodal = projected.nodal(motion.at(phases))
    first = projected.ensemble.values[:, :1]
    angle = np.where(phases < 2, first + phases / 2 * ahead[:, None], 1.0 + phases)
    assert nodal[..., 0] == pytest.approx(np.cos(angle), abs=1e-8)
    assert nodal[..., 1] == pytest.approx(np.sin(angle), abs=1e-8)
    speed = np.hypot(nodal[..., 2], nodal[..., 3])
    assert speed**2 / 2 + 10 * nodal[..., 1] == pytest.approx(np.broadcast_to(40.5 + 10 * np.sin(first), speed.shape))
    # the time from the start to each angle, by quadrature
    for k, (begin,) in enumerate(first):
        level = 81 + 20 * np.sin(begin)
        for j in range(5):
            expected, _ = quad(
                lambda a, level=level: (level - 20 * np.sin(a)) ** -0.5, begin, angle[k, j], epsabs=1e-11, limit=200
            )
            assert nodal[k, j, -1] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_constraints_hold_at_equal_phase(rtol):
    """Projected ones to the tolerance, with fewer terms than nodes."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1))
    mechanism, _ = conical(length)
    projected, rates = projection(mechanism, 2, 5)
    motion = projected.in_phase(rates, np.array([0.0, 5.0]), rtol=rtol)
    whole = motion.at(np.linspace(0, 60, 7))
    nodal = projected.nodal(whole)
    x, y, vx, vy = np.moveaxis(nodal[..., :4], -1, 0)
    own = projected.ensemble.values[:, :1]
    for left in (x**2 + y**2 - own**2, (x * vx + y * vy) / 10):
        assert np.abs(projected.project(left)).max() <= 100 * rtol


def test_a_clock_that_stands_is_reported_with_the_node():
    """A pendulum whose shortest rod does not turn over."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1))
    mechanism = uqmbd.Mechanism("bob", uqmbd.Translational(gravity=(0, -10)))
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(sympy.sqrt(40) - 0.02, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length))
    x, y = bob.position
    mechanism.output("rate", (x * bob.velocity[1] - y * bob.velocity[0]) / (x**2 + y**2), units="rad/s")
    projected, rates = projection(mechanism, 3, 4)
    motion = projected.in_phase(rates, np.array([0.0, 5.0]), rtol=1e-6)
    longest = projected.ensemble.values.max()
    with pytest.raises(
        uqmbd.IntegrationError, match=f"stands still, or nearly still, at the node length = {longest:.6g}"
    ):
        motion.at(np.array([10.0]))


def test_a_clock_that_runs_backwards_at_the_start_is_refused():
    mechanism, _ = conical(uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1)))
    projected, rates = projection(mechanism, 2, 3)
    with pytest.raises(uqmbd.IntegrationError, match="0 turns from the start, its rate is -"):
        projected.in_phase(lambda t, z: -rates(t, z), np.array([0.0, 1.0]))


def test_moments_in_time_are_refused():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1))
    mechanism, bob = conical(length)
    mechanism.add(PointForce("push", bob, (0, 0), (uqmbd.step(uqmbd.t, 0.2, 0, 0.3, 1), 0)))
    projected, rates = projection(mechanism, 2, 3)
    with pytest.raises(uqmbd.StudyError, match="must be smooth, .* at t = 0.2 s"):
        projected.in_phase(rates, np.array([0.0, 1.0]))
