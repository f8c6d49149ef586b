"""Eigenfrequencies and damping against closed forms and hand-written eigenproblems."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.spatial.transform

import uqmbd
from uqmbd.dynamics import Ensemble, build, linearise, static_equilibria
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Prismatic, Revolute, Spherical, Universal
from uqmbd_springs import Bushing, PointForce, SpringDamper, TorsionSpringDamper

G = 9.81
TURN = 2 * np.pi


def frequencies(mechanism, **more):
    return uqmbd.eigenfrequencies(mechanism, **more)["frequency"].values


@pytest.mark.parametrize(
    ("space", "more", "rigid"),
    [
        (uqmbd.Translational(), {}, 0),
        (uqmbd.Planar(), {"inertia": 0.1}, 1),
        (uqmbd.Spatial(), {"inertia": (0.1, 0.2, 0.3)}, 3),
    ],
    ids=lambda x: type(x).__name__ if isinstance(x, uqmbd.mechanism.geometry.space.Space) else "",
)
def test_a_mass_on_a_spring(space, more, rigid):
    """Spring of zero free length at the centre of mass: sqrt(k/m) in every direction; turns are rigid-body modes."""
    mechanism = uqmbd.Mechanism("oscillator", space)
    zero = (0,) * space.dimension
    mass = mechanism.body("mass", mass=2, position=(0.3, *zero[1:]), **more)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, zero, zero, stiffness=50))
    found = uqmbd.eigenfrequencies(mechanism)
    expected = [0.0] * rigid + [5 / TURN] * space.dimension
    np.testing.assert_allclose(found["frequency"], expected, rtol=1e-12)
    np.testing.assert_allclose(found["damping_ratio"], 0, atol=1e-12)
    assert found["frequency"].attrs["units"] == "Hz"


@pytest.mark.thorough
def test_a_pendulum_in_the_plane_and_in_space():
    """sqrt(m g l / J_O), and with a spring about its pivot (an auxiliary state) sqrt((m g l + c) / J_O)."""
    mass, arm, inertia = 1.3, 0.4, 0.05
    planar = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    rod = planar.body("rod", mass=mass, inertia=inertia, position=(arm, 0))
    planar.add(Revolute("pivot", planar.ground, rod, (0, 0), (-arm, 0)))
    about = inertia + mass * arm**2
    natural = np.sqrt(mass * G * arm / about) / TURN
    np.testing.assert_allclose(frequencies(planar), [natural], rtol=1e-10)
    # drawn horizontal, nothing pulls it back: as there, no stiffness
    np.testing.assert_allclose(frequencies(planar, at="start"), [0], atol=1e-12)
    planar.add(TorsionSpringDamper("spring", planar.ground, rod, stiffness=2, free_angle=-np.pi / 2))
    np.testing.assert_allclose(frequencies(planar), [np.sqrt((mass * G * arm + 2) / about) / TURN], rtol=1e-10)

    spatial = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, 0, -G)))
    rod = spatial.body("rod", mass=mass, inertia=(0.07, inertia, 0.09), position=(arm, 0, 0))
    axes = (0, -1, 0), (0, -1, 0)
    spatial.add(Revolute("pivot", spatial.ground, rod, (0, 0, 0), (-arm, 0, 0), *axes))
    np.testing.assert_allclose(frequencies(spatial), [natural], rtol=1e-10)
    spatial.add(TorsionSpringDamper("spring", spatial.ground, rod, 2, 0, -np.pi / 2, *axes))
    np.testing.assert_allclose(frequencies(spatial), [np.sqrt((mass * G * arm + 2) / about) / TURN], rtol=1e-10)


def test_a_rod_on_a_ball_joint_has_no_modes_of_its_quaternion():
    """Two pendulum modes, one free spin; the multiplier's stiffness (D^T lambda)_q makes the difference."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial(gravity=(0, 0, -G)))
    rod = mechanism.body("rod", mass=1.5, inertia=(0.1, 0.2, 0.15), position=(0, 0, -0.5), com=(0, 0, 0))
    mechanism.add(Spherical("pivot", mechanism.ground, rod, (0, 0, 0), (0, 0, 0.5)))
    expected = [0, *np.sort([np.sqrt(1.5 * G * 0.5 / (j + 1.5 * 0.25)) / TURN for j in (0.1, 0.2)])]
    np.testing.assert_allclose(frequencies(mechanism), expected, rtol=1e-10)


@pytest.mark.parametrize("kind", ["translational", "planar"])
def test_a_double_pendulum(kind):
    """Equal masses and lengths: omega^2 = (2 -+ sqrt 2) g / l."""
    length = 0.7
    if kind == "translational":
        mechanism = uqmbd.Mechanism("double", uqmbd.Translational(gravity=(0, -G)))
        one, two = (mechanism.body(n, mass=1, position=p) for n, p in (("one", (0.1, -0.6)), ("two", (0.3, -1.3))))
        mechanism.add(Distance("upper", mechanism.ground, one, (0, 0), (0, 0), length=length))
        mechanism.add(Distance("lower", one, two, (0, 0), (0, 0), length=length))
    else:
        mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -G)))
        one = mechanism.body("one", mass=1, inertia=0, position=(length, 0))
        two = mechanism.body("two", mass=1, inertia=0, position=(2 * length, 0))
        mechanism.add(Revolute("A", mechanism.ground, one, (0, 0), (-length, 0)))
        mechanism.add(Revolute("B", one, two, (0, 0), (-length, 0)))
    expected = np.sqrt((2 + np.array([-1, 1]) * np.sqrt(2)) * G / length) / TURN
    np.testing.assert_allclose(frequencies(mechanism), expected, rtol=1e-9)


def test_a_body_on_a_bushing():
    """Diagonal stiffness at the centre of mass: sqrt(k/m) and, the strain being the rotation vector, sqrt(c/J)."""
    stiffness, inertia = (1e5, 2e5, 4e5, 800.0, 900.0, 1000.0), (1.5, 2.0, 3.0)
    mechanism = uqmbd.Mechanism("mount", uqmbd.Spatial())
    c, s = 0.8**2 - 0.6**2, 2 * 0.8 * 0.6
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    world = rotation @ np.diag(inertia) @ rotation.T
    body = mechanism.body("engine", mass=10, inertia=world)
    mechanism.add(Bushing("mount", mechanism.ground, body, (0, 0, 0), (0, 0, 0), stiffness))
    other = mechanism.body("other", mass=10, inertia=inertia, position=(1, 0, 0))
    mechanism.add(Bushing("other mount", mechanism.ground, other, (1, 0, 0), (0, 0, 0), stiffness, 2.0))
    found = uqmbd.eigenfrequencies(mechanism)
    straight = np.sqrt(np.array(stiffness) / np.array([10, 10, 10, *inertia])) / TURN
    turns = np.sqrt(scipy.linalg.eigh(np.diag(stiffness[3:]), world, eigvals_only=True)) / TURN
    np.testing.assert_allclose(found["frequency"], np.sort([*straight, *straight[:3], *turns]), rtol=1e-9)
    # a damper c on a mass m: c / (2 m omega)
    damped = found["damping_ratio"].values[found["damping_ratio"].values > 1e-6]
    ratios = 2 / (2 * np.array([10, 10, 10, *inertia]) * straight * TURN)
    np.testing.assert_allclose(np.sort(damped), np.sort(ratios), rtol=1e-6)


def test_damped_and_overdamped_oscillators():
    """Roots of m x^2 + c x + k: a pair, a damping ratio; two real ones, two modes; none (k = 0), one at zero."""
    for stiffness, damping in [(50, 3), (50, 60), (0, 4), (50, 0)]:
        mechanism = uqmbd.Mechanism("oscillator", uqmbd.Planar())
        mass = mechanism.body("mass", mass=2, inertia=1, position=(0.3, 0))
        mechanism.add(Prismatic("guide", mechanism.ground, mass, (0, 0), (0, 0), (1, 0), (1, 0)))
        spring = SpringDamper("spring", mechanism.ground, mass, (-1, 0), (0, 0), stiffness, damping, free_length=1.3)
        mechanism.add(spring)
        found = uqmbd.eigenfrequencies(mechanism)
        roots = np.roots([2, damping, stiffness]).astype(complex)
        roots = np.array(sorted(roots[roots.imag >= 0], key=abs))
        if not damping:
            roots.real = 0
        np.testing.assert_allclose(found["frequency"], np.abs(roots) / TURN, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found["eigenvalue_real"], roots.real, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found["eigenvalue_imaginary"], roots.imag, rtol=1e-9, atol=1e-12)
        size = np.where(np.abs(roots) < 1e-12, 1, np.abs(roots))
        np.testing.assert_allclose(found["damping_ratio"], -roots.real / size, rtol=1e-9, atol=1e-12)


def test_an_unstable_pose_has_a_growing_mode():
    """The inverted pendulum: real eigenvalues of both signs."""
    mechanism = uqmbd.Mechanism("upright", uqmbd.Planar(gravity=(0, -G)))
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0, 0.5))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (0, -0.5)))
    found = uqmbd.eigenfrequencies(mechanism)
    rate = np.sqrt(G * 0.5 / 0.35)
    np.testing.assert_allclose(np.sort(found["eigenvalue_real"]), [-rate, rate], rtol=1e-10)
    assert sorted(found["damping_ratio"].values) == [-1, 1]


def crank_and_slider(stiffness=100.0, at=(0.0, 0.0, 0.0), turn=None):
    """A slider-crank in the plane of a moved frame, in space."""
    turn = np.eye(3) if turn is None else turn
    r, length, angle = 0.15, 0.35, 0.6
    beta = -np.arcsin(r * np.sin(angle) / length)

    def world(x, y):
        return tuple(np.array(at) + turn @ (x, y, 0))

    def about(a):
        return turn @ [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]

    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Spatial(gravity=tuple(turn @ (0, -G, 0))))
    ground, axis, normal = mechanism.ground, tuple(turn @ (1, 0, 0)), tuple(turn @ (0, 0, 1))
    x = r * np.cos(angle) + length * np.cos(beta)
    middle = world(r * np.cos(angle) + length / 2 * np.cos(beta), r * np.sin(angle) + length / 2 * np.sin(beta))
    start = world(r / 2 * np.cos(angle), r / 2 * np.sin(angle))
    crank = mechanism.body("crank", 2, (0.1, 0.1, 0.01), position=start, rotation=about(angle))
    rod = mechanism.body("rod", 1, (0.1, 0.1, 0.02), position=middle, rotation=about(beta))
    slider = mechanism.body("slider", 0.5, (0.1, 0.1, 0.1), position=world(x, 0), rotation=turn)
    z = (0, 0, 1)
    mechanism.add(Revolute("A", ground, crank, world(0, 0), (-r / 2, 0, 0), normal, z))
    mechanism.add(Spherical("B", crank, rod, (r / 2, 0, 0), (-length / 2, 0, 0)))
    mechanism.add(Universal("C", rod, slider, (length / 2, 0, 0), (0, 0, 0), z, (0, 1, 0)))
    mechanism.add(Prismatic("D", ground, slider, world(0, 0), (0, 0, 0), axis, (1, 0, 0)))
    spring = SpringDamper("spring", ground, slider, world(1, 0), (0, 0, 0), stiffness, damping=3, free_length=0.6)
    mechanism.add(spring)
    return mechanism


def reduced_slider_crank(k, damping=3.0, r=0.15, length=0.35):
    """Eigenvalue of the slider-crank with its one coordinate, the crank angle; derivatives by complex steps."""
    h = 1e-30

    def poses(a):
        b = -np.arcsin(r * np.sin(a) / length)
        return np.array(
            [
                r / 2 * np.cos(a), r / 2 * np.sin(a), a,
                r * np.cos(a) + length / 2 * np.cos(b), r * np.sin(a) + length / 2 * np.sin(b), b,
                r * np.cos(a) + length * np.cos(b), 0 * a, 0 * a,
            ]
        )  # fmt: skip

    masses = np.array([2, 2, 0.01, 1, 1, 0.02, 0.5, 0.5, 0.1])
    forces = np.array([0, -2 * G, 0, 0, -G, 0, 0, 0, 0])

    def force(a):
        step = 1e-5
        slope = (poses(a + step) - poses(a - step)) / (2 * step) if np.iscomplexobj(a) else poses(a + 1j * h).imag / h
        return forces @ slope + k * (1 - poses(a)[6] - 0.6) * slope[6]

    angle = scipy.optimize.brentq(force, -1.6, 1.2, xtol=1e-15)
    slope = poses(angle + 1j * h).imag / h
    stiffness = -(force(angle + 1e-5) - force(angle - 1e-5)) / 2e-5
    roots = np.roots([masses @ slope**2, damping * slope[6] ** 2, stiffness])
    return roots[roots.imag > 0][0]


@pytest.mark.thorough
def test_a_slider_crank_held_by_a_spring_wherever_it_stands():
    """Against its reduction to the crank angle; moved and turned in space it is the same."""
    expected = reduced_slider_crank(100.0)
    turn = scipy.spatial.transform.Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    for mechanism in (crank_and_slider(), crank_and_slider(at=(5.0, -3.0, 2.0), turn=turn)):
        found = uqmbd.eigenfrequencies(mechanism)
        assert found.sizes["mode"] == 1
        assert found["frequency"].values[0] == pytest.approx(abs(expected) / TURN, rel=1e-7)
        assert found["damping_ratio"].values[0] == pytest.approx(-expected.real / abs(expected), rel=1e-6)


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def sprung_body(at=(0, 0, 0), turn=None):
    """A heavy plate on five stretched springs; anchors, points, stiffnesses and free lengths."""
    turn = np.eye(3) if turn is None else turn
    anchors = np.array([[1, 1, 2], [-1, 1, 2.2], [-1, -1, 2], [1.2, -1, 2], [0, 0.3, -2.0]])
    points = np.array([[0.5, 0.4, 0.1], [-0.5, 0.4, 0.1], [-0.5, -0.4, 0.1], [0.5, -0.4, 0.1], [0.1, 0, -0.1]])
    k, free = np.array([300.0, 500, 400, 350, 200]), np.array([1.5, 1.6, 1.7, 1.4, 1.0])
    mechanism = uqmbd.Mechanism("plate", uqmbd.Spatial(gravity=tuple(turn @ (0, 0, -G))))
    plate = mechanism.body("plate", 12, (0.9, 1.4, 2.1), position=tuple(at), rotation=turn)
    for number, (a, p, stiffness, length) in enumerate(zip(anchors, points, k, free, strict=True)):
        where = tuple(np.array(at) + turn @ a)
        mechanism.add(SpringDamper(f"s{number}", mechanism.ground, plate, where, tuple(p), stiffness, 0, length))
    for i, x in enumerate([*plate.position, *plate.quaternion]):
        mechanism.output(f"q{i}", x)
    return mechanism, anchors, points, k, free


@pytest.mark.thorough
def test_a_body_on_springs_against_a_hand_written_eigenproblem():
    """6 x 6: the springs' axial stiffness, their tension across, and the arms that turn under their forces."""
    mechanism, anchors, points, k, free = sprung_body()
    pose = uqmbd.static_equilibrium(mechanism)
    position = np.array([float(pose[f"q{i}"]) for i in range(3)])
    e = np.array([float(pose[f"q{i}"]) for i in range(3, 7)])
    rotation = scipy.spatial.transform.Rotation.from_quat(e[[1, 2, 3, 0]]).as_matrix()
    stiffness, load = np.zeros((6, 6)), np.array([0, 0, -12 * G, 0, 0, 0])
    for a, p, c, l0 in zip(anchors, points, k, free, strict=True):
        arm = rotation @ p
        d = position + arm - a
        length = np.linalg.norm(d)
        u, tension = d / length, c * (length - l0)
        across = c * np.outer(u, u) + tension / length * (np.eye(3) - np.outer(u, u))
        motion = np.hstack([np.eye(3), -hat(arm)])
        stiffness += motion.T @ across @ motion
        # the moment arm x force changes as the arm turns
        stiffness[3:, 3:] -= hat(-tension * u) @ hat(arm)
        load = load + np.concatenate([-tension * u, np.cross(arm, -tension * u)])
    np.testing.assert_allclose(load, 0, atol=1e-7)
    inertia = rotation @ np.diag([0.9, 1.4, 2.1]) @ rotation.T
    mass = scipy.linalg.block_diag(12 * np.eye(3), inertia)
    squares = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass, eigvals_only=True)
    np.testing.assert_allclose(frequencies(mechanism), np.sqrt(squares) / TURN, rtol=1e-8)
    turn = scipy.spatial.transform.Rotation.from_rotvec([1.3, 0.4, -2.0]).as_matrix()
    moved, *_ = sprung_body(at=(10.0, -4.0, 7.0), turn=turn)
    np.testing.assert_allclose(frequencies(moved), np.sqrt(squares) / TURN, rtol=1e-8)


@pytest.mark.thorough
def test_frequencies_agree_with_the_motion():
    """After a small tap in equilibrium the slider moves as the eigenvalue says."""
    mechanism = crank_and_slider()
    slider = mechanism.bodies["slider"]
    mechanism.output("x", slider.position[0], units="m")
    mechanism.add(PointForce("tap", slider, (0, 0, 0), (uqmbd.step(uqmbd.t, 0, 0, 0.02, 0.02), 0, 0)))
    found, at_rest = uqmbd.eigenfrequencies(mechanism), float(uqmbd.static_equilibrium(mechanism)["x"])
    decay, omega = -found["eigenvalue_real"].values[0], found["eigenvalue_imaginary"].values[0]
    times = np.linspace(0, 6 * np.pi / omega, 601)
    x = uqmbd.simulate(mechanism, times, rtol=1e-10, start="equilibrium")["x"].values - at_rest
    assert x[0] == pytest.approx(0, abs=1e-12)
    late = times > 0.02
    oscillation = np.exp(-decay * times) * np.stack([np.cos(omega * times), np.sin(omega * times)])
    basis = np.stack([*oscillation, np.ones_like(times)])[:, late].T
    weights, *_ = np.linalg.lstsq(basis, x[late], rcond=None)
    assert np.abs(basis @ weights - x[late]).max() < 2e-3 * np.abs(x).max()


class Creep(uqmbd.Component):
    """A spring in series with a dashpot (Maxwell): its inner length creeps."""

    bodies = ("body",)
    stiffness = uqmbd.Parameter("N/m", "spring")
    viscosity = uqmbd.Parameter("N s/m", "dashpot")

    def terms(self, p):
        y, inner = p.body.position[1], p.state("inner")
        pull = p.stiffness * (y - inner)
        yield uqmbd.Auxiliary(inner, pull / p.viscosity, y)
        yield uqmbd.VirtualWork(-pull, p.body.velocity[1])


def test_a_state_with_dynamics_of_its_own():
    """Mass on a spring beside a Maxwell element: roots of a cubic."""
    m, k, c, d = 2.0, 50.0, 80.0, 30.0
    mechanism = uqmbd.Mechanism("creep", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("mass", mass=m)
    mechanism.add(Creep("creep", body, stiffness=c, viscosity=d))
    mechanism.add(SpringDamper("side", mechanism.ground, body, (0, 0), (0, 0), stiffness=k))
    found = uqmbd.eigenfrequencies(mechanism)
    # m y'' + k y + c (y - s) = 0, s' = c (y - s) / d; sideways sqrt(k/m)
    roots = np.roots([m, m * c / d, k + c, k * c / d])
    expected = np.array([*roots[roots.imag >= 0], 1j * np.sqrt(k / m)])
    expected = expected[np.argsort(np.abs(expected))]
    np.testing.assert_allclose(found["eigenvalue_real"], expected.real, atol=1e-9)
    np.testing.assert_allclose(found["eigenvalue_imaginary"], expected.imag, atol=1e-9)


def test_many_realisations_at_once():
    """sqrt(k/m) of each; one that is overdamped has a mode more than the others."""
    k = uqmbd.RandomVariable("k", chaospy.Uniform(1, 100))
    c = uqmbd.RandomVariable("c", chaospy.Uniform(0, 100))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Planar())
    mass = mechanism.body("mass", mass=1, inertia=1, position=(1, 0))
    mechanism.add(Prismatic("guide", mechanism.ground, mass, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), k, c, free_length=1))
    values = np.array([[0.0, 4.0], [1.0, 9.0], [20.0, 16.0]])
    ensemble = Ensemble(build(mechanism), values)
    rest = static_equilibria(ensemble)
    modes, _ = linearise(ensemble, rest.q, rest.s)
    np.testing.assert_allclose(modes.frequency[:2, 0] * TURN, [2, 3], rtol=1e-9)
    assert np.isnan(modes.frequency[:2, 1]).all()
    np.testing.assert_allclose(np.sort(modes.eigenvalues[2].real), np.sort(np.roots([1, 20, 16])), rtol=1e-9)
    by_name = uqmbd.eigenfrequencies(mechanism, {"k": 25.0, "c": 1.0})
    np.testing.assert_allclose(by_name["damping_ratio"], [1 / (2 * 5)], rtol=1e-9)


def test_what_cannot_move_has_no_modes():
    """A driven arm: no mode; and a wrong word is told."""
    mechanism = uqmbd.Mechanism("driven", uqmbd.Planar())
    arm = mechanism.body("arm", mass=1, inertia=0.1)
    mechanism.add(Revolute("pivot", mechanism.ground, arm, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, arm, angle=3 * uqmbd.t))
    assert uqmbd.eigenfrequencies(mechanism).sizes["mode"] == 0
    with pytest.raises(uqmbd.StudyError, match="at='rest'; expected 'equilibrium', 'start' or 'steady'"):
        uqmbd.eigenfrequencies(mechanism, at="rest")
