"""The compiled implicit integrator: order, stiff motions against closed forms and SciPy, events, independent lanes."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import uqmbd
from uqmbd.compiled import ExplicitStatus, IntegrationState, radau
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integration import explicit_method, integrate_by_dop853
from uqmbd.dynamics.linear import implicit_dynamics
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Bushing, PointForce, SpringDamper, TorsionSpringDamper

G = 9.81
ZERO = (0, 0)


def pendulum():
    """A rod of 2 m in the plane, turning about its end."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    rod = mechanism.body("rod", mass=1, inertia=1 / 3, position=(1, 0), angular_velocity=1.0)
    mechanism.add(Revolute("pin", mechanism.ground, rod, at=(0, 0)))
    return mechanism


def double_pendulum(stiffness):
    """Two rods of 1 m, horizontal at the start, on bushings of random stiffness; of zero stiffness: on pins."""
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -G)))
    rods = [mechanism.body(f"rod{k}", mass=1, inertia=0.1, position=(k + 0.5, 0)) for k in range(2)]
    k = uqmbd.RandomVariable("k", chaospy.Uniform(0.5 * stiffness, 1.5 * stiffness)) if stiffness else 0
    for name, body_i, body_j, at in (("A", mechanism.ground, rods[0], (0, 0)), ("B", *rods, (1, 0))):
        if stiffness:
            mechanism.add(Bushing(name, body_i, body_j, at=at, stiffness=(k, k, 0), damping=(k / 1e3, k / 1e3, 0)))
        else:
            mechanism.add(Revolute(name, body_i, body_j, at=at))
    mechanism.output("x", rods[1].position[0], units="m")
    return mechanism


def bushed_rate(k):
    """Return the rates of the double pendulum on bushings, in positions and angles, by hand."""

    def rate(_, y):
        (x1, y1, a1, x2, y2, a2), v = y[:6], y[6:]

        def arm(angle, speed, length):
            place = length * np.array([np.cos(angle), np.sin(angle)])
            return place, speed * np.array([-place[1], place[0]])

        def force(gap, speed):
            return -k * gap - k / 1e3 * speed

        (left1, dl1), (right1, dr1), (left2, dl2) = arm(a1, v[2], -0.5), arm(a1, v[2], 0.5), arm(a2, v[5], -0.5)
        one, two = np.array([x1, y1]), np.array([x2, y2])
        f = force(one + left1, v[:2] + dl1)
        g = force(two + left2 - one - right1, v[3:5] + dl2 - v[:2] - dr1)

        def moment(place, push):
            return place[0] * push[1] - place[1] * push[0]

        down = np.array([0, -G])
        return np.concatenate(
            [
                *(v, f - g + down, [(moment(left1, f) - moment(right1, g)) / 0.1]),
                *(g + down, [moment(left2, g) / 0.1]),
            ]
        )

    return rate


def steps_of(model, stages, size, end):
    """Integrate implicitly with a given step size, and return the last state."""
    dynamics = implicit_dynamics(model, stages)
    ensemble = Ensemble(model, np.zeros((1, 0)))
    times = np.array([0.0, end])
    method = explicit_method(1e-2, guarded=False)
    run = IntegrationState(
        dynamics, method, ensemble.start.state, ensemble.block, times, [[(end, size, False)]], np.full(1, 1e-2)
    )
    run.wanted[:] = size
    run.advance()
    assert run.status[0] == ExplicitStatus.DONE
    assert abs(run.steps[0] - end / size) <= 1
    return run.z[0]


@pytest.mark.parametrize(("stages", "order", "sizes"), [(3, 5, (0.1, 0.05, 0.025)), (5, 9, (1 / 5, 1 / 10))])
def test_order_of_convergence(stages, order, sizes, monkeypatch):
    """Errors of a pendulum after 1 s, with exact stages, for steps of given sizes."""
    monkeypatch.setattr(radau, "TOLERANCE", 1e-12)
    monkeypatch.setattr(radau, "ITERATIONS", 20)  # the stages of the first step start from zero
    model = build(pendulum())

    def rate(_, y):
        return [y[1], -G * np.cos(y[0]) / (1 + 1 / 3)]

    angle = solve_ivp(rate, (0, 1), [0.0, 1.0], "DOP853", rtol=1e-13, atol=1e-14).y[0, -1]
    expected = np.array([np.cos(angle), np.sin(angle)])
    errors = [np.abs(steps_of(model, stages, size, 1.0)[:2] - expected).max() for size in sizes]
    for coarse, fine in zip(errors[:-1], errors[1:], strict=True):
        assert order - 0.7 < np.log2(coarse / fine) < order + 1.2


@pytest.mark.parametrize("stages", [3, 5])
def test_coefficients(stages):
    """Simplifying assumptions B(2s-1), C(s) and D(s-1), stiff accuracy, and the embedded formula of order s."""
    method = radau.radau_method(stages)
    a, b, c = method.matrix, method.matrix[-1], method.nodes
    for k in range(1, 2 * stages):
        np.testing.assert_allclose(b @ c ** (k - 1), 1 / k, rtol=1e-12)
    for k in range(1, stages + 1):
        np.testing.assert_allclose(a @ c ** (k - 1), c**k / k, atol=1e-13)
    for k in range(1, stages):
        np.testing.assert_allclose((b * c ** (k - 1)) @ a, b / k * (1 - c**k), atol=1e-13)
    weights = b + method.error @ a
    first = 1 / method.eigenvalue
    for k in range(1, stages + 1):
        np.testing.assert_allclose(weights @ c ** (k - 1) + (first if k == 1 else 0), 1 / k, rtol=1e-11)
    # at a linear equation, the factor of a step vanishes for infinite rates
    z = -1e9
    factor = 1 + z * b @ np.linalg.solve(np.eye(stages) - z * a, np.ones(stages))
    assert abs(factor) < 1e-8


@pytest.mark.parametrize("stiffness", [1e4, 1e8])
def test_chain_of_springs(stiffness):
    """Two masses, one on a stiff damped spring: the exponential of a matrix, with the tolerance that was asked for."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Line())
    first = mechanism.body("first", mass=1, position=1.0)
    second = mechanism.body("second", mass=2, position=2.5)
    soft, damping = 30.0, 0.01 * stiffness
    mechanism.add(
        SpringDamper("stiff", mechanism.ground, first, 0, 0, stiffness=stiffness, damping=damping, free_length=1)
    )
    mechanism.add(SpringDamper("soft", first, second, 0, 0, stiffness=soft, free_length=1))
    times = np.linspace(0, 3, 31)
    matrix = np.zeros((4, 4))
    matrix[:2, 2:] = np.eye(2)
    matrix[2] = [-stiffness - soft, soft, -damping, 0]
    matrix[3] = [soft / 2, -soft / 2, 0, 0]
    expected = np.array([expm(matrix * t) @ [0, 0.5, 0, 0] for t in times])
    ensemble = Ensemble(build(mechanism), np.zeros((1, 0)))
    for rtol in (1e-5, 1e-8):
        found = integrate(ensemble, times, rtol, "radau")
        assert found.messages == ("",)
        assert found.counters.by_radau == 1
        assert found.counters.steps < 250
        np.testing.assert_allclose(found.states[0] - [1, 2, 0, 0], expected, atol=20 * rtol)


def test_bushings_against_scipy():
    """The stiff double pendulum, against Radau of SciPy on equations by hand; the explicit method needs ten times as much."""
    model, times, k = build(double_pendulum(1e6)), np.linspace(0, 0.5, 6), 0.8e6
    ensemble = Ensemble(model, np.array([[k]]))
    found = integrate(ensemble, times, 1e-7, "radau")
    start = [0.5, 0, 0, 1.5, 0, 0, *[0] * 6]
    expected = solve_ivp(bushed_rate(k), (0, 0.5), start, "Radau", times, rtol=1e-9, atol=1e-11).y
    np.testing.assert_allclose(found.states[0, :, [0, 1]], expected[:2], rtol=0, atol=3e-7)
    np.testing.assert_allclose(found.states[0, :, [4, 5]], expected[3:5], rtol=0, atol=3e-7)
    explicit = integrate_by_dop853(ensemble, np.arange(1), times, 1e-7, patient=True)
    np.testing.assert_allclose(explicit.states[0, :, 0], expected[0], rtol=0, atol=1e-6)
    assert found.counters.accelerations < explicit.counters.accelerations / 10


def test_automatic_choice():
    """Stiff bushings are integrated implicitly, pins explicitly, and the implicit motion agrees with IDA."""
    times = np.linspace(0, 0.5, 6)
    pinned = integrate(Ensemble(build(double_pendulum(0)), np.zeros((2, 0))), times)
    assert pinned.counters.by_dop853 == 2 and not pinned.counters.stiff
    ensemble = Ensemble(build(double_pendulum(1e7)), np.array([[1e7], [1.2e7]]))
    found = integrate(ensemble, times)
    assert found.counters.by_radau == found.counters.stiff == 2
    np.testing.assert_allclose(found.states, integrate(ensemble, times, 1e-8, "ida").states, atol=2e-4)


def test_bits_do_not_depend_on_the_company():
    """Alone, in another order, in groups that are interrupted, and with recorded steps."""
    model, times = build(double_pendulum(1e6)), np.linspace(0, 0.4, 9)
    values = np.random.default_rng(0).uniform(0.5e6, 1.5e6, (11, 1))
    every = integrate(Ensemble(model, values), times, 1e-6, "radau").states
    order = np.random.default_rng(1).permutation(11)[:9]
    assert integrate(Ensemble(model, values[order]), times, 1e-6, "radau").states.tobytes() == every[order].tobytes()
    alone = integrate(Ensemble(model, values[4:5]), times, 1e-6, "radau")
    assert alone.states.tobytes() == every[4:5].tobytes()
    recorded = integrate(Ensemble(model, values[4:5]), times, 1e-6, "radau", between=True)
    assert recorded.states.tobytes() == alone.states.tobytes()
    assert len(recorded.path.owner) == recorded.counters.steps


def test_bits_do_not_depend_on_interruptions(monkeypatch):
    model, times = build(double_pendulum(1e6)), np.linspace(0, 0.4, 9)
    ensemble = Ensemble(model, np.array([[0.9e6], [1.1e6]]))
    expected = integrate(ensemble, times, 1e-6, "radau").states
    monkeypatch.setattr("uqmbd.compiled.explicit.BUDGET", 1)
    assert integrate(ensemble, times, 1e-6, "radau").states.tobytes() == expected.tobytes()


@pytest.mark.thorough
def test_bits_do_not_depend_on_workers():
    def mean(workers):
        study = uqmbd.Study(
            "stiff", double_pendulum(1e7), np.linspace(0, 0.2, 5), [MonteCarlo(samples=24, seed=1)], integrator="radau"
        )
        return study.run(workers=workers, progress=False)["monte-carlo/samples"]["response"].to_numpy().tobytes()

    assert mean(1) == mean(2)


def test_failed_realisation():
    """A force without a value after a time fails its realisation only, with the time; others keep their bits."""
    mechanism = uqmbd.Mechanism("carts", uqmbd.Line())
    cart = mechanism.body("cart", mass=1, position=1.0)
    end = uqmbd.RandomVariable("end", chaospy.Uniform(0.1, 5))
    mechanism.add(SpringDamper("spring", mechanism.ground, cart, 0, 0, stiffness=1e6, damping=1e4, free_length=1))
    mechanism.add(PointForce("pull", cart, 0, sympy.sqrt(end - uqmbd.t)))
    model, times = build(mechanism), np.linspace(0, 1, 5)
    values = np.array([[2.0], [0.4], [3.0]])
    found = integrate(Ensemble(model, values), times, 1e-6, "radau")
    assert found.messages[0] == found.messages[2] == ""
    assert "t = 0.4 s" in found.messages[1]
    assert np.isfinite(found.states[1, :2]).all() and np.isnan(found.states[1, 2:]).all()
    alone = integrate(Ensemble(model, values[[0, 2]]), times, 1e-6, "radau")
    assert alone.states.tobytes() == found.states[[0, 2]].tobytes()


def test_impacts_on_a_stiff_suspension():
    """A ball falls onto a table; its inner mass hangs on a spring so stiff that both move as one."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    shell = mechanism.body("shell", mass=1, position=(0, 1))
    core = mechanism.body("core", mass=1e-3, position=(0, 2))
    mechanism.add(
        SpringDamper("spring", shell, core, ZERO, ZERO, stiffness=1e6, damping=1e2, free_length=1),
    )
    table = mechanism.add(PlaneImpact("table", mechanism.ground, shell, ZERO, ZERO, (0, 1), restitution=0.5))
    mechanism.output("height", shell.position[1], units="m")
    for number in (1, 2):
        mechanism.output(f"t{number}", table.event_time("impact", number), units="s")
    data = uqmbd.simulate(mechanism, np.linspace(0, 3, 4), integrator="radau", rtol=1e-8)
    fall = np.sqrt(2 / G)
    np.testing.assert_allclose(data.t1, fall, rtol=1e-6)
    np.testing.assert_allclose(data.t2, 2 * fall, rtol=2e-3)  # the core takes a thousandth of the momentum
    assert abs(float(data.height[-1])) < 1e-9  # it has come to rest


@pytest.mark.parametrize("inertia", [1.0, 1e9, 1e12])
def test_a_heavy_turntable_takes_the_same_steps(inertia):
    """Where an entry of the quaternion vanishes, the step fell to nothing with an inertia of 1e9 kg m^2."""
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Spatial(gravity=(0, 0, -G)))
    inertias = (inertia / 2, inertia / 2, inertia)
    disc = mechanism.body("disc", mass=1.0, inertia=inertias, angular_velocity=(0, 0, 2.0))
    mechanism.add(Revolute("axle", mechanism.ground, disc, at=(0, 0, 0), axis=(0, 0, 1)))
    times = np.linspace(0, 10, 21)
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-6, "radau")
    assert found.messages == ("",) and found.counters.steps < 50
    half = found.states[0, :, [3, 6]]  # cos and sin of half the angle
    np.testing.assert_allclose(half, [np.cos(times), np.sin(times)], atol=2e-6)


@pytest.mark.parametrize("heavy", [1e-6, 1e6, 1e9])
def test_a_pendulum_on_a_heavy_turntable(heavy):
    """Its hinge turns at a constant speed: y'' = (speed^2 cos y - g / l) sin y, by SciPy; or the table is light."""
    speed, length = 3.0, 0.5
    mechanism = uqmbd.Mechanism("turntable", uqmbd.Spatial(gravity=(0, 0, -G)))
    disc = mechanism.body("disc", mass=heavy, inertia=(heavy,) * 3, angular_velocity=(0, 0, speed))
    mechanism.add(Revolute("axle", mechanism.ground, disc, at=(0, 0, 0), axis=(0, 0, 1)))
    if heavy < 1:
        mechanism.add(RotationDriver("motor", mechanism.ground, disc, angle=speed * uqmbd.t, axis=(0, 0, 1)))
    place = (length * np.sin(0.8), 0, -length * np.cos(0.8))
    bob = mechanism.body("bob", mass=1.0, inertia=(0, 0, 0), position=place, velocity=(0, speed * place[0], 0),
                         angular_velocity=(0, 0, speed))  # fmt: skip
    mechanism.add(Revolute("hinge", disc, bob, at=(0, 0, 0), axis=(0, 1, 0)))
    mechanism.output("height", bob.position[2], units="m")
    times = np.linspace(0, 4, 21)
    found = uqmbd.simulate(mechanism, times, rtol=1e-8, integrator="radau", check=False)["height"].values

    def rate(_, y):
        return [y[1], (speed**2 * np.cos(y[0]) - G / length) * np.sin(y[0])]

    angle = solve_ivp(rate, (0, 4), [0.8, 0.0], "DOP853", times, rtol=1e-12, atol=1e-13).y[0]
    np.testing.assert_allclose(found, -length * np.cos(angle), atol=1e-6 if heavy < 1 else 3 / heavy + 1e-7)


@pytest.mark.parametrize("mode", ["slip", "stick"])
def test_persistent_contacts(mode):
    """A block on a slope, with a stiff spring to a second mass: it slides at a known rate, or stays."""
    angle, friction = 0.5, 0.3 if mode == "slip" else 0.9
    down = (G * np.sin(angle), -G * np.cos(angle))
    mechanism = uqmbd.Mechanism("slope", uqmbd.Translational(gravity=down))
    block = mechanism.body("block", mass=2, position=(0, 0), velocity=(1.0, 0))
    mechanism.add(PlaneImpact("slope", mechanism.ground, block, ZERO, ZERO, (0, 1), restitution=0, friction=friction))
    weight = mechanism.body("weight", mass=1e-6, position=(0, 1), velocity=(1.0, 0))
    mechanism.add(SpringDamper("rod", block, weight, ZERO, ZERO, stiffness=1e4, damping=1.0, free_length=1))
    mechanism.output("x", block.position[0], units="m")
    mechanism.output("y", block.position[1], units="m")
    data = uqmbd.simulate(mechanism, [0, 1], integrator="radau", rtol=1e-8, check=False)
    rate = G * (np.sin(angle) - friction * np.cos(angle))
    expected = 1 + rate / 2 if rate > 0 else -1 / (2 * rate)
    np.testing.assert_allclose(data.x[-1], expected, rtol=2e-5)
    assert abs(float(data.y[-1])) < 1e-9


@pytest.mark.parametrize("integrator", ["auto", "dop853"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6])
def test_undamped_oscillations_are_not_stiff(rtol, integrator):
    """The ratio of the changes of rates and states of an oscillation varies with its phase; its steps are accurate."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    place = uqmbd.RandomVariable("place", chaospy.Uniform(0.5, 1.5), units="m")
    mass = mechanism.body("mass", mass=1, position=place)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0,), (0,), stiffness=1e4))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study(
        "s", mechanism, np.linspace(0, 4, 41), [MonteCarlo(samples=16, seed=1)], integrator=integrator, rtol=rtol
    )
    node = study.run()["monte-carlo"]
    assert node.attrs["failures"] == 0
    assert json.loads(node.attrs["solver_counters"]).get("stiff", 0) == 0


def undamped_chain():
    """Three masses on springs, with frequencies from 7 to 140 rad/s that all take part."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Line())
    before = mechanism.ground
    for k, (mass, stiffness) in enumerate(((1, 1e4), (2, 100), (0.5, 3e3))):
        body = mechanism.body(f"mass{k}", mass=mass, position=k + 1.1 + 0.05 * k)
        mechanism.add(SpringDamper(f"spring{k}", before, body, 0, 0, stiffness=stiffness, free_length=1))
        before = body
    return mechanism


def tumbling_body():
    """A body with three moments of inertia, on an undamped elastic bearing off its centre of mass."""
    mechanism = uqmbd.Mechanism("body", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body("body", mass=1, inertia=(0.1, 0.2, 0.25), angular_velocity=(0.1, 8.0, 0.1))
    mechanism.add(Bushing("bearing", mechanism.ground, body, at=(0, 0, 0.2), stiffness=(1e4, 1e4, 2e4, 0, 0, 0)))
    return mechanism


def rotor_on_a_spring():
    """An undamped rotor whose counted angle is an auxiliary state."""
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    rotor = mechanism.body("rotor", mass=1, inertia=1, angular_velocity=1)
    mechanism.add(Revolute("bearing", mechanism.ground, rotor, (0, 0), (0, 0)))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, rotor, stiffness=1e4))
    return mechanism


def sampled_oscillator():
    """An undamped oscillator with a controller, whose commands are auxiliary states."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0,), (0,), stiffness=1e4))
    loop = mechanism.add(
        uqmbd.Controller("loop", [mass.position[0]], {"force": "N"}, rate=1, law=lambda time, measured: -measured[0])
    )
    mechanism.add(PointForce("pull", mass, 0, loop.command()))
    return mechanism


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize(
    "mechanism",
    [undamped_chain, tumbling_body, lambda: double_pendulum(0), rotor_on_a_spring, sampled_oscillator],
    ids=["chain", "body", "pendulum", "rotor", "controller"],
)
def test_accurate_steps_are_not_stiff(mechanism, rtol):
    """Motions whose fastest oscillations take part: accuracy limits the steps, and no step size counts as unstable."""
    ensemble = Ensemble(build(mechanism()), np.zeros((1, 0)))
    found = integrate(ensemble, np.linspace(0, 2, 21), rtol)
    assert found.counters.stiff == 0 and found.counters.by_dop853 == 1


@pytest.mark.parametrize("stiffness", [1e6, 1e8])
def test_stiffness_is_found_early(stiffness):
    """A tenth of the realisations took a thousand explicit steps: their sizes vary about the limit of stability."""
    model, times = build(double_pendulum(stiffness)), np.linspace(0, 2, 21)
    values = np.random.default_rng(0).uniform(0.5 * stiffness, 1.5 * stiffness, (64, 1))
    found, implicit = (integrate(Ensemble(model, values), times, 1e-6, name) for name in ("auto", "radau"))
    assert found.counters.by_radau == 64
    assert found.counters.steps - implicit.counters.steps < 15 * 64
    assert found.states.tobytes() == implicit.states.tobytes()
