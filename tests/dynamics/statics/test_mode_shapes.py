"""Shapes of modes as outputs, against closed forms, hand-written eigenproblems, and other coordinates."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.linalg
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance, Revolute, Spherical
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability
from uqmbd_springs import Bushing, SpringDamper

G = 9.81


def row(stiffness, masses, damping=None):
    """Masses on a line, a spring before each, and one behind the last if there is one more."""
    mechanism = uqmbd.Mechanism("row", uqmbd.Line())
    bodies = [mechanism.body(f"m{k}", mass=m, position=k + 1) for k, m in enumerate(masses)]
    ends = [mechanism.ground, *bodies, mechanism.ground]
    for k, rate in enumerate(stiffness):
        there = len(masses) + 1 if k == len(masses) else 0
        loss = 0 if damping is None else damping[k]
        mechanism.add(SpringDamper(f"k{k}", ends[k], ends[k + 1], 0, there, rate, loss, free_length=1))
    return mechanism, [b.position[0] for b in bodies]


def matrices(rates, n):
    """Tridiagonal matrix of springs or dampers in a row."""
    every = np.zeros(n + 1)
    every[: len(rates)] = rates
    return np.diag(every[:-1] + every[1:]) - np.diag(every[1:-1], 1) - np.diag(every[1:-1], -1)


def values(mechanism):
    found = uqmbd.simulate(mechanism, [0, 0.1])
    return np.array([float(found[name]) for name in mechanism.scalars])


@pytest.mark.parametrize("n", [2, 5])
def test_a_chain_held_at_both_ends_moves_as_a_sine(n):
    """Equal masses and springs: mass j moves by sin(j k pi / (n + 1)) in mode k."""
    mechanism, x = row([40.0] * (n + 1), [0.7] * n)
    expected = []
    for k in range(1, n + 1):
        shape = np.sin(np.arange(1, n + 1) * k * np.pi / (n + 1))
        for j in range(1, n):
            mechanism.output(f"{k} {j}", uqmbd.mode_shape(k, x[j], over=x[0]), units="1")
            expected.append(shape[j] / shape[0])
    np.testing.assert_allclose(values(mechanism), expected, rtol=1e-9, atol=1e-9)


def test_random_chains_have_the_vectors_of_their_matrices():
    """Against scipy.linalg.eigh of mass and stiffness, and scipy.linalg.eig where damping is not proportional."""
    random = np.random.default_rng(4)
    for damped in (False, True):
        n = int(random.integers(3, 6))
        k, m, c = random.uniform(10, 90, n + 1), random.uniform(0.3, 2, n), random.uniform(0, 1.5, n + 1)
        mechanism, x = row(k, m, c if damped else None)
        stiff, loss = matrices(k, n), matrices(c, n)
        if damped:
            whole = np.block([[np.zeros((n, n)), np.eye(n)], [-stiff / m[:, None], -loss / m[:, None]]])
            roots, vectors = scipy.linalg.eig(whole)
            order = [i for i in np.argsort(np.abs(roots)) if roots[i].imag > 0]
            shapes = vectors[:n, order]
        else:
            shapes = scipy.linalg.eigh(stiff, np.diag(m))[1].astype(complex)
        expected = []
        for mode in range(1, shapes.shape[1] + 1):
            for part in ("real", "imaginary"):
                shape = uqmbd.mode_shape(mode, x[1] - x[2], over=x[0] + 2 * x[1], part=part)
                mechanism.output(f"{mode} {part}", shape, units="1")
                v = shapes[:, mode - 1]
                ratio = (v[1] - v[2]) / (v[0] + 2 * v[1])
                expected.append(getattr(ratio, part[:4]))
        np.testing.assert_allclose(values(mechanism), expected, rtol=1e-8, atol=1e-8)


def test_proportional_damping_leaves_the_shape_alone():
    masses, stiffness = [1.0, 1.0], [9.0, 9.0]
    golden = (1 + np.sqrt(5)) / 2
    for damping in (None, [0.9, 0.9]):
        mechanism, x = row(stiffness, masses, damping)
        for part in ("real", "imaginary"):
            mechanism.output(part, uqmbd.mode_shape(1, x[1], over=x[0], part=part), units="1")
        np.testing.assert_allclose(values(mechanism), [golden, 0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["translational", "planar", "spatial"])
def test_a_double_pendulum_in_any_coordinates(kind):
    """Equal masses and lengths: the angles move as 1 to +-sqrt 2, the places of the masses as 1 to 1 +- sqrt 2."""
    length = 0.7
    if kind == "translational":
        mechanism = uqmbd.Mechanism("double", uqmbd.Translational(gravity=(0, -G)))
        one, two = (mechanism.body(n, mass=1, position=p) for n, p in (("one", (0.1, -0.6)), ("two", (0.3, -1.3))))
        mechanism.add(Distance("upper", mechanism.ground, one, (0, 0), (0, 0), length=length))
        mechanism.add(Distance("lower", one, two, (0, 0), (0, 0), length=length))
    elif kind == "planar":
        mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -G)))
        one = mechanism.body("one", mass=1, inertia=0, position=(length, 0))
        two = mechanism.body("two", mass=1, inertia=0, position=(2 * length, 0))
        upper = mechanism.add(Revolute("A", mechanism.ground, one, (0, 0), (-length, 0)))
        lower = mechanism.add(Revolute("B", one, two, (0, 0), (-length, 0)))
        for n, sign in ((1, 1), (2, -1)):
            angles = uqmbd.mode_shape(n, upper.angle + lower.angle, over=upper.angle)
            mechanism.output(f"angles {n}", angles * sign / np.sqrt(2), units="1")
    else:
        mechanism = uqmbd.Mechanism("double", uqmbd.Spatial(gravity=(0, 0, -G)))
        one = mechanism.body("one", mass=1, inertia=(0.01, 0, 0.01), position=(0, 0, -length))
        two = mechanism.body("two", mass=1, inertia=(0.01, 0, 0.01), position=(0, 0, -2 * length))
        axes = (0, 1, 0), (0, 1, 0)
        mechanism.add(Revolute("A", mechanism.ground, one, (0, 0, 0), (0, 0, length), *axes))
        mechanism.add(Revolute("B", one, two, (0, 0, 0), (0, 0, length), *axes))
    for n, sign in ((1, 1), (2, -1)):
        ratio = uqmbd.mode_shape(n, two.position[0], over=one.position[0])
        mechanism.output(f"places {n}", ratio / (1 + sign * np.sqrt(2)), units="1")
    np.testing.assert_allclose(values(mechanism), 1, rtol=1e-8)


@pytest.mark.thorough
def test_about_a_steady_motion_the_ratio_is_that_in_the_turning_frame():
    """A ball on springs on a turntable: y over x is -2i W w / (ky / m - W^2 - w^2), the size of which stays."""
    m, kx, ky, speed = 0.5, 60.0, 45.0, 4.0
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Planar())
    table = mechanism.body("table", mass=1, inertia=1)
    ball = mechanism.body("ball", mass=m, inertia=0.1)
    mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=speed * uqmbd.t + 0.3))
    mechanism.add(Bushing("springs", table, ball, (0, 0), (0, 0), stiffness=(kx, ky, 500.0)))
    along, across = (ball.position.dot(table.direction(e)) for e in ((1, 0), (0, 1)))
    a, b = kx / m - speed**2, ky / m - speed**2
    middle = (a + b + 4 * speed**2) / 2
    expected = []
    for n, sign in ((1, -1), (2, 1)):
        square = middle + sign * np.sqrt(middle**2 - a * b)
        mechanism.output(f"imaginary {n}", uqmbd.mode_shape(n, across, along, "steady", "imaginary"), units="1")
        mechanism.output(f"real {n}", uqmbd.mode_shape(n, across, along, "steady"), units="1")
        expected += [-2 * speed * np.sqrt(square) / (b - square), 0.0]
    np.testing.assert_allclose(values(mechanism), expected, rtol=1e-7, atol=1e-7)
    mechanism.output("in the world", uqmbd.mode_shape(1, ball.position[1], ball.position[0], "steady"), units="1")
    with pytest.raises(uqmbd.AssemblyError, match="it changes during the steady motion"):
        values(mechanism)


def test_equal_frequencies_have_no_shape_unless_all_their_modes_agree():
    """A pendulum that swings in every direction: its x over y is anything; its height over another is what it is."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, 0)))
    ball, other = (mechanism.body(n, mass=1, position=p) for n, p in (("ball", (0, 0)), ("other", (2, 0))))
    mechanism.add(SpringDamper("spring", mechanism.ground, ball, (0, 0), (0, 0), stiffness=8))
    mechanism.add(SpringDamper("more", mechanism.ground, other, (2, 0), (0, 0), stiffness=20))
    shape = uqmbd.mode_shape(1, 3 * ball.position[0], over=ball.position[0])
    mechanism.output("three", shape, units="1")
    np.testing.assert_allclose(values(mechanism), 3)
    mechanism.output("any", uqmbd.mode_shape(1, ball.position[1], over=ball.position[0]), units="1")
    with pytest.raises(uqmbd.AssemblyError, match=r"mode_shape\(1, ball.y, over=ball.x\): 2 of its modes have this"):
        values(mechanism)


def rod_on_a_ball_joint():
    mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial(gravity=(0, 0, -G)))
    rod = mechanism.body("rod", mass=1.5, inertia=(0.1, 0.2, 0.15), position=(0, 0, -0.5))
    mechanism.add(Spherical("pivot", mechanism.ground, rod, (0, 0, 0), (0, 0, 0.5)))
    return mechanism, rod


def test_what_no_shape_can_be_of_is_refused():
    _, rod = rod_on_a_ball_joint()
    x, y, _ = rod.position
    for arguments, message in [
        ((1, x, rod.velocity[0]), "mode_shape: over is rod.x', and it contains rod.x'; expected an expression in posi"),
        ((1, uqmbd.t, x), "mode_shape: quantity is .*, and it does not depend on the pose"),
        ((1, uqmbd.eigenfrequency(1), x), "mode_shape: the argument is .*already contains a scalar output"),
        ((1, x, sympy.floor(y)), r"over is floor\(rod.y\), and it contains floor\(rod.y\)"),
        ((0, x, y), "the number of the mode is 0"),
        ((1, x, y, "rest"), "at is the text 'rest'; expected 'equilibrium', 'start' or 'steady'"),
        ((1, x, y, "start", "phase"), "part is the text 'phase'; expected 'real' or 'imaginary'"),
    ]:
        with pytest.raises(uqmbd.StudyError, match=message):
            uqmbd.mode_shape(*arguments)


def test_a_realisation_without_the_ratio_says_why():
    for number, quantity, over, message in [
        (1, lambda x, y, z: x, lambda x, y, z: z, "the reference does not move in this mode"),
        (1, lambda x, y, z: x + 1.0 * sympy.sqrt(z), lambda x, y, z: x + y, "no derivative by the coordinates"),
        (3, lambda x, y, z: x, lambda x, y, z: y, "the mechanism has no mode 3: 2 of its modes oscillate"),
    ]:
        mechanism, rod = rod_on_a_ball_joint()
        shape = uqmbd.mode_shape(number, quantity(*rod.position), over=over(*rod.position))
        mechanism.output("ratio", shape, units="1")
        with pytest.raises(uqmbd.AssemblyError, match=message):
            values(mechanism)


@pytest.mark.thorough
def test_a_frame_of_two_storeys_over_its_range_by_every_method():
    """The upper storey moves (k1 + k2 - lambda) / k2 times as far as the lower one; moments by a Gauss rule."""
    k1, k2 = (uqmbd.RandomVariable(n, chaospy.Uniform(0.8, 1.2), units="N/m") for n in ("k1", "k2"))
    mechanism, x = row([k1, k2], [1.0, 1.0])
    mechanism.output("ratio", uqmbd.mode_shape(1, x[1], over=x[0]), units="1")
    mechanism.require("soft", uqmbd.mode_shape(1, x[1], over=x[0]) <= 1.7)

    def closed(a, b):
        return (a + b - (a + 2 * b - np.sqrt(a**2 + 4 * b**2)) / 2) / b

    nodes, weights = np.polynomial.legendre.leggauss(30)
    a, b = np.meshgrid(1 + 0.2 * nodes, 1 + 0.2 * nodes)
    weight = np.outer(weights, weights) / 4
    mean = np.sum(weight * closed(a, b))
    std = np.sqrt(np.sum(weight * (closed(a, b) - mean) ** 2))
    methods = [Collocation(order=5), Galerkin(order=5), MonteCarlo(samples=300, seed=3)]
    tree = uqmbd.Study("frame", mechanism, None, [*methods, Reliability(seed=1, target_cov=0.2)]).run()
    for label in ("collocation", "galerkin"):
        found = tree[f"{label}/scalars/statistics"].sel(output="ratio")
        np.testing.assert_allclose(found["mean"], mean, rtol=1e-6)
        np.testing.assert_allclose(found["std"], std, rtol=1e-4)
    samples = tree["monte-carlo/scalars/samples"]
    np.testing.assert_allclose(samples["response"].sel(output="ratio"), closed(*samples["inputs"].values.T), rtol=1e-9)
    fine = 1 + 0.2 * (np.arange(1000) + 0.5) / 500 - 0.2
    exact = float(np.mean(closed(*np.meshgrid(fine, fine)) > 1.7))
    found = tree["reliability/requirements"]["violation_probability"]
    assert abs(float(found.values.ravel()[0]) - exact) < 0.1 * exact


@pytest.mark.thorough
def test_realisations_in_which_modes_are_equal_fail_alone():
    """Two pendulums, one of random length: where the lengths are equal the shapes are any mix."""
    length = uqmbd.RandomVariable("length", chaospy.DiscreteUniform(1, 3), units="m")
    mechanism = uqmbd.Mechanism("pendulums", uqmbd.Translational(gravity=(0, -G)))
    one = mechanism.body("one", mass=1, position=(0, -2))
    two = mechanism.body("two", mass=1, position=(5, -length))
    mechanism.add(Distance("a", mechanism.ground, one, (0, 0), (0, 0), length=2))
    mechanism.add(Distance("b", mechanism.ground, two, (5, 0), (0, 0), length=length))
    mechanism.output("both", uqmbd.mode_shape(1, two.position[0], over=two.position[0] + one.position[0]), units="1")
    with pytest.warns(UserWarning, match="10 of 30 realisations failed.*2 of its modes have this frequency"):
        tree = uqmbd.Study("pendulums", mechanism, None, [MonteCarlo(samples=30, seed=1)]).run()
    samples = tree["monte-carlo/scalars/samples"]
    drawn = samples["inputs"].values[:, 0]
    expected = np.where(drawn == 2, np.nan, np.where(drawn > 2, 1.0, 0.0))
    np.testing.assert_allclose(samples["response"].values[:, 0], expected, atol=1e-8)
