"""Closed loops of sampled controllers, against integrations by hand and closed forms."""

import chaospy
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import SpeedDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, Torque

DELAY, RATE, LIMIT = 0.013, 100.0, 8.0


def pd_with_integral(time, measured, state):
    """PD with an integral of its own, kept in the state."""
    angle, speed = measured.T
    return 30 * (0.5 - angle) - 5 * speed + state[:, 0], state + 0.2 * (0.5 - angle[:, None])


def arm(mass=1.0, **options):
    """A pendulum with a motor at its pivot; mass 1 kg, length 1 m."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("arm", mass=mass, inertia=mass / 12, position=(0.5, 0), angle=0.0)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    options = {"state": [0.1], "delay": DELAY, "limits": (-LIMIT, LIMIT), "rate": RATE} | options
    options = {"measured": [rod.angle, rod.angular_velocity], "function": pd_with_integral} | options
    controller = uqmbd.Controller(commanded={"torque": "N m"}, **options)
    mechanism.add(Torque("motor", rod, controller.command("torque")))
    mechanism.add(controller)
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("speed", rod.angular_velocity, units="rad/s")
    mechanism.output("torque", controller.command("torque"), units="N m")
    mechanism.output("integral", controller.state(0), units="N m")
    return mechanism


def arm_by_scipy(times, mass=1.0):
    """The same leg by leg: samples every 10 ms, commands that act 13 ms later."""
    end = times[-1]
    samples = np.arange(round(end * RATE) + 1) / RATE
    instants = np.unique(np.round(np.concatenate([samples, samples + DELAY, times]), 12))
    instants = instants[instants <= end + 1e-12]
    x, command, integral, waiting, found = np.array([0.0, 0.0]), 0.0, 0.1, [], []
    for k, now in enumerate(instants):
        before = x.copy()
        while waiting and abs(waiting[0][0] - now) < 1e-9:
            command = waiting.pop(0)[1]
        if np.abs(samples - now).min() < 1e-9:
            wanted = 30 * (0.5 - before[0]) - 5 * before[1] + integral
            integral += 0.2 * (0.5 - before[0])
            waiting.append((now + DELAY, np.clip(wanted, -LIMIT, LIMIT)))
        if np.abs(times - now).min() < 1e-9:
            found.append([*x, command, integral])
        if k + 1 < len(instants):

            def rhs(t, y, u=command):
                return [y[1], (u - mass * 9.81 * 0.5 * np.cos(y[0])) / (mass / 3)]

            x = scipy.integrate.solve_ivp(rhs, (now, instants[k + 1]), x, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return np.array(found).T


def test_an_arm_under_delayed_saturated_pd_is_that_of_scipy():
    times = np.linspace(0, 1, 21)
    mechanism = arm()
    found = uqmbd.simulate(mechanism, times, rtol=1e-10, check=False)
    exact = arm_by_scipy(times)
    assert np.abs(exact[2]).max() == LIMIT  # it saturates, and the delay is felt
    for name, value in zip(("angle", "speed", "torque", "integral"), exact, strict=True):
        np.testing.assert_allclose(found[name], value, rtol=0, atol=1e-8)


def test_output_times_between_samples_and_the_end_change_nothing():
    mechanism = arm()
    grid = np.array([0, 0.0437, 0.1, 0.2349, 0.31])
    odd = uqmbd.simulate(mechanism, grid, rtol=1e-10, check=False)
    exact = arm_by_scipy(grid)
    for name, value in zip(("angle", "speed", "torque", "integral"), exact, strict=True):
        np.testing.assert_allclose(odd[name], value, rtol=0, atol=1e-8)


def speed_loop(time, measured, state):
    """Sampled PI control of a speed; its gain is measured, as it is random."""
    speed, gain = measured.T
    error = 2.0 - speed
    return gain * error + state[:, 0], state + 0.1 * error[:, None]


def rotor(inertia, gain):
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=inertia)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    controller = mechanism.add(
        uqmbd.Controller(
            measured=[wheel.angular_velocity, gain], commanded=["torque"], rate=20, function=speed_loop, state={"i": 0}
        )
    )
    mechanism.add(Torque("motor", wheel, controller.command() - 0.3 * wheel.angular_velocity))
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    mechanism.output("torque", controller.command(), units="N m")
    return mechanism


def rotor_exact(samples, inertia, gain):
    """Speed and torque right after each sample, by the exact discrete-time model (matrix exponential)."""
    plant = scipy.linalg.expm(np.array([[-0.3 / inertia, 1 / inertia], [0, 0]]) / 20)
    speed, integral, found = 0.0, 0.0, []
    for _ in range(samples):
        error = 2.0 - speed
        torque = gain * error + integral
        integral += 0.1 * error
        found.append((speed, torque))
        speed = plant[0] @ [speed, torque]
    return np.array(found).T


INERTIA = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.4, 0.6), units="kg m^2")
GAIN = uqmbd.RandomVariable("gain", chaospy.Uniform(1.5, 2.5), units="N m s")


@pytest.mark.thorough
def test_moments_of_a_sampled_speed_loop_are_those_of_its_discrete_time_model():
    times = np.arange(41) / 20
    mechanism = rotor(INERTIA, GAIN)
    study = uqmbd.Study("rotor", mechanism, times, propagators=[Collocation(order=6), Galerkin(order=6)], rtol=1e-9)
    tree = study.run()
    x, w = np.polynomial.legendre.leggauss(12)
    exact = np.array([[rotor_exact(41, 0.5 + 0.1 * a, 2 + 0.5 * b) for b in x] for a in x])
    weights = np.outer(w, w) / 4
    mean = np.einsum("ij,ijkt->kt", weights, exact)
    std = np.sqrt(np.einsum("ij,ijkt->kt", weights, (exact - mean) ** 2))
    for label in ("collocation", "galerkin"):
        statistics = tree[f"{label}/statistics"]
        np.testing.assert_allclose(statistics["mean"], mean, rtol=0, atol=2e-7)
        np.testing.assert_allclose(statistics["std"], std, rtol=0, atol=5e-6)


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_group_is_what_its_members_are_alone(integrator):
    mechanism = rotor(INERTIA, GAIN)
    points = np.array([[2.0, 0.45], [1.6, 0.55], [2.4, 0.41]])  # gain, inertia
    assert mechanism.inputs.names == ("gain", "inertia")
    times = np.arange(21) / 20
    study = uqmbd.Study(
        "rotor", mechanism, times, propagators=[MonteCarlo(samples=3)], integrator=integrator, rtol=1e-9
    )
    group = study.problem(MonteCarlo(samples=3)).realise(points)
    assert not group.status.any(), group.messages
    for row, (gain, inertia) in enumerate(points):
        alone = uqmbd.simulate(
            mechanism, times, {"gain": gain, "inertia": inertia}, rtol=1e-9, integrator=integrator, check=False
        )
        for k, (name, value) in enumerate(zip(("speed", "torque"), rotor_exact(21, inertia, gain), strict=True)):
            np.testing.assert_allclose(group.response[row, k], value, rtol=0, atol=1e-7)
            np.testing.assert_allclose(alone[name], group.response[row, k], rtol=0, atol=1e-7)


def bouncer(time, measured):
    """Push up where the ball is low, a force of at most 30 N."""
    return np.where(measured[:, 0] < 0.3, 30.0, 0.0)


def test_a_controller_acts_across_impacts():
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -10)))
    ball = mechanism.body("ball", mass=1, position=(0, 1))
    controller = uqmbd.Controller(measured=["height"], commanded=["force"], rate=10, function=bouncer)
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.5))
    mechanism.add(PointForce("push", ball, (0, 0), (0, controller.command("force"))))
    mechanism.output("height", ball.position[1], units="m")
    mechanism.output("speed", ball.velocity[1], units="m/s")
    mechanism.output("force", controller.command("force"), units="N")
    mechanism.output("first", floor.event_time("impact", 1), units="s")
    mechanism.add(controller)
    times = np.arange(0, 1.51, 0.05)
    found = uqmbd.simulate(mechanism, times, check=False, rtol=1e-9)
    # by hand: parabolas between samples (every 0.1 s) and impacts
    height, speed, force, exact, hits = 1.0, 0.0, 0.0, [], []
    for k, now in enumerate(times):
        if k % 2 == 0:
            force = 30.0 if height < 0.3 else 0.0
        exact.append((height, speed, force))
        left = 0.05
        while left > 0:
            a = force - 10
            roots = np.roots([a / 2, speed, height])
            roots = [r.real for r in roots if abs(r.imag) < 1e-14 and 1e-12 < r.real <= left and a * r.real + speed < 0]
            step = min(roots, default=left)
            height, speed = height + speed * step + a * step**2 / 2, speed + a * step
            left -= step
            if roots:
                height, speed = 0.0, -0.5 * speed
                hits.append(now + 0.05 - left)
    exact = np.array(exact).T
    assert hits
    np.testing.assert_allclose(found["first"], hits[0], atol=1e-9)
    for name, value in zip(("height", "speed", "force"), exact, strict=True):
        np.testing.assert_allclose(found[name], value, rtol=0, atol=1e-7)


def ramp(time, measured):
    return 2.0 * time


def test_a_commanded_speed_is_followed_by_an_impulse():
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=0.5)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    controller = mechanism.add(uqmbd.Controller(measured=[wheel.angle], commanded=["speed"], rate=4, function=ramp))
    mechanism.add(SpeedDriver("drive", mechanism.ground, wheel, controller.command("speed")))
    mechanism.output("angle", wheel.angle, units="rad")
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    for integrator in ("dop853", "ida"):
        found = uqmbd.simulate(mechanism, [0, 0.25, 0.5, 0.6, 1], check=False, rtol=1e-9, integrator=integrator)
        np.testing.assert_allclose(found["speed"], [0, 0.5, 1, 1, 2], atol=1e-7)
        np.testing.assert_allclose(found["angle"], [0, 0, 0.125, 0.225, 0.75], atol=1e-7)
