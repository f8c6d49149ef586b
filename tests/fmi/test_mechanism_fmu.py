"""FMUs of mechanisms equal `simulate`, also far from the means, with inputs that change, and report what is impossible."""

from __future__ import annotations

import ctypes as c
import shutil
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.cli import main
from uqmbd.extend import GermSpace, motion_refusal, motion_source
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver, SpeedDriver
from uqmbd_fmi import export_fmu, read_distributions
from uqmbd_fmi.compiling import find_compiler, host, zig
from uqmbd_fmi.exporter import FmuExporter
from uqmbd_joints import Distance, Revolute
from uqmbd_springs import PointForce, Torque

from .coupling import slave
from .library import Fmu
from .pi_fmu import write_pi

compiled = pytest.mark.skipif(
    host() is None or find_compiler() is None, reason="there is no C compiler, or no binary for this platform"
)

STUDIES = Path(__file__).parents[2] / "studies"


def exported(mechanism, folder, fmi=2, **options):
    """Export a mechanism and load the FMU."""
    done = export_fmu(mechanism, folder / f"one{fmi}.fmu", fmi=fmi, **options)
    assert done.warnings == "" and done.size < 500_000
    return Fmu(done.path, folder / f"unpacked{fmi}")


def rotor(torque=None, delay=None):
    """A wheel with a random inertia, driven by a torque: of a random variable, or of a controller."""
    inertia = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.4, 0.6), units="kg m^2")
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=inertia)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    if torque is None:
        torque = uqmbd.RandomVariable("torque", chaospy.Normal(0, 1), units="N m")
    else:
        mechanism.add(torque)
        torque = torque.command("torque")
    mechanism.add(Torque("motor", wheel, torque - 0.3 * wheel.angular_velocity))
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    mechanism.output("angle", wheel.angle, units="rad")
    return mechanism


def arm():
    """A robot arm of two links in space, with random masses and two torques."""
    mass = uqmbd.RandomVariable("tip_mass", chaospy.Uniform(0.5, 1.5), units="kg")
    drives = [uqmbd.RandomVariable(name, chaospy.Normal(0, 5), units="N m") for name in ("shoulder", "elbow")]
    mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    upper = mechanism.body("upper", mass=2, inertia=(0.02, 0.06, 0.06), position=(0.3, 0, 0))
    fore = mechanism.body("fore", mass=mass, inertia=(0.01, 0.03 * mass, 0.03 * mass), position=(0.85, 0, 0))
    mechanism.add(Revolute("A", mechanism.ground, upper, (0, 0, 0), (-0.3, 0, 0), (0, 1, 0), (0, 1, 0)))
    mechanism.add(Revolute("B", upper, fore, (0.3, 0, 0), (-0.25, 0, 0), (0, 0, 1), (0, 0, 1)))
    mechanism.add(Torque("shoulder drive", upper, (0, drives[0], 0)))
    mechanism.add(Torque("elbow drive", fore, (0, 0, drives[1])))
    mechanism.output("x", fore.point((0.25, 0, 0))[0], units="m")
    mechanism.output("z", fore.point((0.25, 0, 0))[2], units="m")
    mechanism.output("az", fore.acceleration[2], units="m/s^2")
    return mechanism


def compare(fmu, mechanism, times, values, tolerance=1e-8):
    """Compare all outputs with `simulate` at the same values, relative to the largest value of each."""
    expected = uqmbd.simulate(mechanism, times, values=values, rtol=1e-9)
    names = [name for name in fmu.references if name not in values and name != "time"]
    assert names
    for name, found in zip(names, fmu.along(times, values, names), strict=True):
        scale = max(1.0, float(np.abs(expected[name]).max()))
        np.testing.assert_allclose(found, expected[name].values, rtol=0, atol=tolerance * scale, err_msg=name)


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    "name", ["slider_crank", "four_bar", "agile_eye", "pendulum", "slider_crank_driven", "bouncing_ball"]
)
def test_mechanisms_of_studies_move_as_in_simulate(name, fmi, tmp_path):
    """At two points far from the means: quantiles between 2 % and 98 %."""
    study = uqmbd.load_study(STUDIES / f"{name}.py")
    fmu = exported(study.mechanism, tmp_path, fmi, times=study.times, rtol=1e-9)
    space = GermSpace.of(study.mechanism.inputs)
    uniform = np.random.default_rng(3).choice([0.02, 0.98], (2, space.dimension))
    for point in space.to_inputs(space.from_uniform(uniform)):
        compare(fmu, study.mechanism, study.times, dict(zip(space.inputs, point.tolist(), strict=True)))


@compiled
@pytest.mark.thorough
def test_a_robot_arm_moves_as_in_simulate_and_saves_its_state(tmp_path):
    mechanism, times = arm(), np.linspace(0, 0.6, 31)
    fmu = exported(mechanism, tmp_path, times=times, rtol=1e-9, inputs=("shoulder", "elbow"))
    compare(fmu, mechanism, times, {"tip_mass": 0.6, "shoulder": 9.0, "elbow": -4.0})
    state, size = c.c_void_p(), c.c_size_t()
    assert fmu.call("GetFMUstate", c.byref(state)) == 0
    assert fmu.call("SerializedFMUstateSize", state, c.byref(size)) == 0
    stored = (c.c_ubyte * size.value)()
    assert fmu.call("SerializeFMUstate", state, stored, size) == 0
    assert fmu.step(0.6, 0.1) <= 1
    first = fmu.get(["x", "z", "az"])
    assert fmu.reset() == 0
    again = c.c_void_p()
    assert fmu.call("DeSerializeFMUstate", stored, size, c.byref(again)) == 0
    assert fmu.call("SetFMUstate", again) == 0
    assert fmu.step(0.6, 0.1) <= 1
    assert fmu.get(["x", "z", "az"]).tolist() == first.tolist()


@compiled
@pytest.mark.thorough
def test_a_loop_closed_outside_equals_the_sampled_controller(tmp_path):
    """PI control with 50 samples a second: uqmbd's own controller, and steps of the FMU with the same control."""

    def control(time, measured, state):
        error = 2.0 - measured
        return 3.0 * error + state, state + 0.1 * error

    controller = uqmbd.Controller(
        measured=["speed"], commanded={"torque": "N m"}, rate=50, function=control, state={"integral": 0.0}
    )
    times = np.arange(51) / 50
    expected = uqmbd.simulate(rotor(controller), times, values={"inertia": 0.55}, rtol=1e-11)
    fmu = exported(rotor(), tmp_path, times=times, rtol=1e-11, inputs=("torque",))
    assert fmu.set(["inertia"], [0.55]) == 0 and fmu.begin() == 0
    state, found = np.zeros((1, 1)), [fmu.get(["speed", "angle"])]
    for before, after in zip(times[:-1], times[1:], strict=True):
        command, state = control(before, fmu.get(["speed"])[None], state)
        assert fmu.set(["torque"], command[0]) == 0
        assert fmu.step(before, after - before) == 0
        found.append(fmu.get(["speed", "angle"]))
    for k, name in enumerate(("speed", "angle")):
        np.testing.assert_allclose(np.array(found)[:, k], expected[name].values, rtol=0, atol=1e-10)


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("fmi", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_coupled_units_reproduce_the_sampled_controller(fmi, tmp_path):
    """FMPy couples the mechanism and a PI controller, whose source is in the tests; uqmbd has the same controller."""
    pytest.importorskip("fmpy", reason="fmpy is not installed")

    def control(time, measured, state):
        error = 2.0 - measured
        return 3.0 * error + state, state + 0.1 * error

    times = np.arange(51) / 50
    loop = uqmbd.Controller("loop", ["speed"], {"torque": "N m"}, rate=50, function=control, state={"i": 0.0})
    mechanism = rotor(loop)
    expected = uqmbd.simulate(mechanism, times, values={"inertia": 0.55}, rtol=1e-11)
    done = export_fmu(mechanism, tmp_path / "rotor.fmu", fmi=fmi, times=times, rtol=1e-11)
    assert done.warnings == ""
    plant = slave(done.path, tmp_path / "plant", {"inertia": 0.55})
    pi = slave(write_pi(tmp_path, fmi), tmp_path / "pi", {})
    found = [plant.get(["speed", "angle"])]
    for now, after in zip(times[:-1], times[1:], strict=True):
        pi.set(["y"], [found[-1][0]])
        pi.step(now, after - now)
        plant.set(["loop.torque"], pi.get(["u"]))
        plant.step(now, after - now)
        found.append(plant.get(["speed", "angle"]))
    for k, name in enumerate(("speed", "angle")):
        np.testing.assert_allclose(np.array(found)[:, k], expected[name].values, rtol=0, atol=1e-10)


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_robot_arm_of_the_studies_follows_its_controller(fmi, tmp_path):
    """Samples at 100 Hz, torques 4 ms later within their limits: the program that steps the FMU calls the controller."""
    study = uqmbd.load_study(STUDIES / "robot.py")
    mechanism, (loop,) = study.mechanism, study.mechanism.controllers.values()
    fmu = exported(mechanism, tmp_path, fmi, times=study.times, rtol=1e-9)
    commands = [f"{loop.name}.{name}" for name in loop.commands]
    outputs = [name for name in fmu.references if name in mechanism.outputs]
    measured = [name for name in fmu.references if name.startswith(f"{loop.name}.") and name not in commands]
    assert len(measured) == len(loop.measured) and not any(isinstance(x, str) for x in loop.measured)
    space = GermSpace.of(mechanism.inputs)
    for share in (0.05, 0.95):
        (point,) = space.to_inputs(space.from_uniform(np.full((1, space.dimension), share)))
        values = dict(zip(space.inputs, point.tolist(), strict=True))
        samples = np.arange(round((study.times[-1] - study.times[0]) * loop.rate) + 1) / loop.rate
        expected = uqmbd.simulate(mechanism, samples, values=values, rtol=1e-9)
        assert fmu.reset() == 0 and fmu.set(list(values), list(values.values())) == 0 and fmu.begin() <= 1
        found = [fmu.get(outputs)]
        for begin, end in zip(samples[:-1], samples[1:], strict=True):
            (torques,) = loop.function(begin, fmu.get(measured)[None])
            assert fmu.step(begin, loop.delay) <= 1
            limits = [list(map(float, loop.limits[name])) for name in loop.commands]
            assert fmu.set(commands, np.clip(torques, *np.transpose(limits))) == 0
            assert fmu.step(begin + loop.delay, end - begin - loop.delay) <= 1
            found.append(fmu.get(outputs))
        for k, name in enumerate(outputs):
            scale = max(1.0, float(np.abs(expected[name]).max()))
            np.testing.assert_allclose(np.array(found)[:, k], expected[name], rtol=0, atol=1e-8 * scale, err_msg=name)


@compiled
def test_impossible_parameters_and_calls_end_in_an_error_with_a_message(tmp_path):
    fmu = exported(rotor(), tmp_path)
    assert fmu.set(["inertia"], [float("nan")]) == 3 and "not finite" in fmu.messages[-1][1]
    assert fmu.step(0, 0.1) == 3 and "is instantiated; it must be in step mode" in fmu.messages[-1][1]
    assert fmu.set(["inertia"], [-0.1]) == 0
    assert fmu.begin() == 3
    assert "moment of inertia of body 'wheel' is -0.1" in fmu.messages[-1][1]
    assert fmu.step(0, 0.1) == 3 and "is failed" in fmu.messages[-1][1]
    with pytest.raises(RuntimeError, match="was not assembled"):
        fmu.get(["speed"])
    assert fmu.reset() == 0 and fmu.begin() == 0 and fmu.get(["speed"]) == 0.0
    assert fmu.set(["inertia"], [0.5]) == 3 and "is fixed" in fmu.messages[-1][1]
    assert fmu.step(0.5, 0.1) == 3 and "but the time of the instance is 0 s" in fmu.messages[-1][1]
    assert fmu.step(0.0, -0.1) == 3 and fmu.step(0.0, float("inf")) == 3 and fmu.step(0.0, 0.1) == 0


@compiled
@pytest.mark.thorough
def test_a_loop_that_cannot_close_names_its_equation(tmp_path):
    reach = uqmbd.RandomVariable("reach", chaospy.Normal(0.5, 0.01), units="m")
    mechanism = uqmbd.Mechanism("triangle", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0.5, 0))
    mechanism.add(Revolute("A", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.add(Distance("strut", mechanism.ground, rod, (0.8, 0.3), (0.5, 0), reach))
    mechanism.output("x", rod.position[0], units="m")
    fmu = exported(mechanism, tmp_path)
    assert fmu.begin() == 0 and fmu.reset() == 0
    assert fmu.set(["reach"], [3.0]) == 0 and fmu.begin() == 3
    assert "cannot be assembled" in fmu.messages[-1][1] and "equation strut" in fmu.messages[-1][1]


def bouncing(friction=0, force=False, restitution=0.8, start=1.0, speed=0.0, floor=0.0):
    """A ball above a floor."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=(0, start), velocity=(0, speed))
    floor = PlaneImpact(
        "floor", mechanism.ground, ball, (0, floor), (0, 0), (0, 1), restitution=restitution, friction=friction
    )
    mechanism.add(floor)
    mechanism.output("height", ball.position[1], units="m")
    if force:
        mechanism.output("force", floor.reaction_force[1], units="N")
    return mechanism


def hitting_rod():
    """A rod on a pin that falls onto a stop, with a random restitution, and rebounds."""
    restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.5, 0.9))
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=2, inertia=0.3, position=(0.5, 0))
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.add(PlaneImpact("stop", mechanism.ground, rod, (0, -0.6), (0.5, 0), (0, 1), restitution=restitution))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("speed", rod.angular_velocity, units="rad/s")
    return mechanism


@compiled
@pytest.mark.thorough
def test_impacts_of_a_rod_on_a_pin_are_those_of_simulate(tmp_path):
    """The impulse also acts on the pin; steps end between and after impacts."""
    mechanism, times = hitting_rod(), np.linspace(0, 1.2, 38)
    fmu = exported(mechanism, tmp_path, times=times, rtol=1e-9)
    compare(fmu, mechanism, times, {"restitution": 0.55})
    compare(fmu, mechanism, times, {"restitution": 0.88})


@compiled
def test_a_ball_bounces_to_the_closed_form(tmp_path):
    """Restitution 1 from 1 m: impacts at (1 + 2 k) sqrt(2 / g), one of them inside of each long step."""
    fmu = exported(bouncing(restitution=1), tmp_path, times=(0.0, 4.0), rtol=1e-10)
    assert fmu.begin() == 0
    first = np.sqrt(2 / 9.81)
    for k in range(4):
        assert fmu.step(k, 1.0) == 0
        phase = (k + 1 + first) % (2 * first) - first
        np.testing.assert_allclose(fmu.get(["height"]), 1 - 9.81 * phase**2 / 2, atol=1e-9)


@pytest.fixture(scope="module")
def dropped(tmp_path_factory):
    """A ball of restitution 0.5, with parameters of its start, above a floor whose height is an input."""
    start, floor = (uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1), units="m") for name in ("start", "floor"))
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(-5, 5), units="m/s")
    mechanism = bouncing(restitution=0.5, start=2 + start, speed=speed, floor=floor)
    return exported(mechanism, tmp_path_factory.mktemp("ball"), times=(0.0, 1.3), rtol=1e-10, inputs=("floor",))


@compiled
@pytest.mark.parametrize("early", [0.0, 1e-12, 1e-10])
def test_impacts_at_communication_points_are_bounces(dropped, early):
    """From 1 m, in units of sqrt(2 / g): impacts at 1, 2, 2.5 and 2.75, and flights of 1, 1/2, 1/4.

    The points before the impacts have gaps of less than 1e-9 m.
    """
    begins, lengths = np.array([-1, 1, 2, 2.5, 2.75]), np.array([2, 1, 0.5, 0.25, 0.125])
    points = np.append(np.arange(12) / 4 * (1 - early), 2.8)
    flight = np.searchsorted(begins, points, side="right") - 1
    since = points - begins[flight]
    found = dropped.along(points * np.sqrt(2 / 9.81), {"start": -1.0}, ["height"])[0]
    np.testing.assert_allclose(found, since * (lengths[flight] - since), rtol=0, atol=1e-8)


@compiled
def test_an_impact_at_the_start_is_a_bounce(dropped):
    """A ball on the floor with 4 m/s downwards rebounds with 2 m/s."""
    found = dropped.along([0.0, 0.25], {"start": -1.0, "speed": -4.0, "floor": 1.0}, ["height"])[0]
    np.testing.assert_allclose(found, [1.0, 1.0 + 2 * 0.25 - 9.81 * 0.25**2 / 2], rtol=0, atol=1e-9)


@compiled
def test_a_floor_that_jumps_into_a_falling_ball_is_no_impact(dropped):
    """The ball is at 1 - 9.81 * 0.4**2 / 2 = 0.2152 m when the floor jumps to 0.5 m."""
    dropped.along([0.0, 0.4], {"start": -1.0}, ["height"])
    assert dropped.set(["floor"], [0.5]) == 0 and dropped.step(0.4, 0.1) == 3
    assert "floor: the bodies overlap by 0.285 m at t = 0.4 s" in dropped.messages[-1][1]


@compiled
def test_bounces_end_in_rest_on_the_floor(tmp_path):
    """Bounces with restitution 0.5 from 1 m end at sqrt(2 / g) (1 + 0.5) / (1 - 0.5) = 1.3546 s."""
    fmu = exported(bouncing(restitution=0.5), tmp_path, times=(0.0, 2.0))
    found = fmu.along([0.0, 1.3, 1.5, 2.0], {}, ["height"])[0]
    assert found[1] > 1e-4 and abs(found[2]) < 1e-12 and abs(found[3]) < 1e-12
    for start, status in ((0.0, 0), (-0.1, 3)):
        folder = tmp_path / str(start)
        folder.mkdir()
        other = exported(bouncing(start=start), folder)
        assert other.begin() == status
    assert "floor: the bodies overlap by 0.1 m at t = 0 s" in other.messages[-1][1]


def sliding(space, velocity, height, force=None):
    """A body that may slide on a floor with random friction, in planar or spatial coordinates."""
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.1, 0.5))
    up = (0,) * (len(velocity) - 1) + (1,)
    mechanism = uqmbd.Mechanism("slider", space(gravity=tuple(-9.81 * x for x in up)))
    shape = {"inertia": (0.02, 0.02, 0.035)} if space is uqmbd.Spatial else {}
    turning = {"angular_velocity": (1.0, 2.0, 40.0)} if space is uqmbd.Spatial else {}
    below = tuple(-0.25 * x for x in up)
    body = mechanism.body(
        "body", mass=2, position=tuple((0.25 + height) * x for x in up), velocity=velocity, **shape, **turning
    )
    if space is uqmbd.Translational:
        below = (0,) * len(up)
    ground = tuple(0.25 * x for x in up) if space is uqmbd.Translational else (0,) * len(up)
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, ground, below, up, restitution=0.5, friction=friction))
    if force is not None:
        mechanism.add(PointForce("push", body, (0,) * len(up), force))
    for k, letter in enumerate("xyz"[: len(up)]):
        mechanism.output(letter, body.position[k], units="m")
    return mechanism


@compiled
def test_a_sliding_body_stops_after_its_stopping_distance(tmp_path):
    """Coulomb friction stops 3 m/s after v^2 / (2 mu g) = 9 / (2 * 0.3 * 9.81) m, and the body stays there."""
    fmu = exported(sliding(uqmbd.Translational, (3.0, 0.0), 0.0), tmp_path, times=(0.0, 2.0), rtol=1e-9)
    found = fmu.along([0.0, 0.5, 1.0, 1.5, 2.0], {"friction": 0.3}, ["x"])[0]
    distance = 9 / (2 * 0.3 * 9.81)
    np.testing.assert_allclose(found, [0, 1.5 - 0.3 * 9.81 / 8, 3 - 0.3 * 9.81 / 2, distance, distance], atol=1e-9)


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["bounce", "pushed", "spinning"])
def test_friction_of_impacts_and_lasting_contacts_is_that_of_simulate(kind, tmp_path):
    """Impacts with friction, slip that stops, stick that ends, lift-off, and slip whose direction turns in space."""
    pushes = (12 * sympy.sin(3 * uqmbd.t), 22 * sympy.sin(1.3 * uqmbd.t))
    mechanism, end = {
        "bounce": lambda: (sliding(uqmbd.Translational, (3.0, 0.0), 0.5), 3.0),
        "pushed": lambda: (sliding(uqmbd.Translational, (0.0, 0.0), 0.0, pushes), 4.0),
        "spinning": lambda: (sliding(uqmbd.Spatial, (1.0, 0.5, 0.0), 0.0), 0.5),
    }[kind]()
    times = np.linspace(0, end, 61)
    fmu = exported(mechanism, tmp_path, times=times, rtol=1e-9)
    compare(fmu, mechanism, times, {"friction": 0.15})
    compare(fmu, mechanism, times, {"friction": 0.4})


def two_contacts():
    """A body on one floor that slides into a wall."""
    mechanism = sliding(uqmbd.Translational, (3.0, 0.0), 0.0)
    body = mechanism.bodies["body"]
    mechanism.add(PlaneImpact("wall", mechanism.ground, body, (1, 0), (0, 0), (-1, 0), restitution=0.5))
    return mechanism


@compiled
@pytest.mark.thorough
def test_a_body_that_slides_into_a_wall_rebounds_and_stops(tmp_path):
    """Of 3 m/s, v^2 = 9 - 2 mu g at 1 m and a quarter of it after the impact, which stops within v^2 / (8 mu g)."""
    fmu = exported(two_contacts(), tmp_path, times=(0.0, 3.0), rtol=1e-9)
    for friction in (0.15, 0.2):
        slowing = friction * 9.81
        square = 9 - 2 * slowing
        meets, stops = (3 - np.sqrt(square)) / slowing, np.sqrt(square) / 2 / slowing
        expected = [0, 1, 1 - 3 * square / 4 / (8 * slowing), 1 - square / (8 * slowing)]
        found = fmu.along([0.0, meets, meets + stops / 2, 3.0], {"friction": friction}, ["x"])[0]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def tabled(argument, start=0.0):
    """An oscillator with a force through 41 random samples, over time or position."""
    gain = uqmbd.RandomVariable("gain", chaospy.Uniform(1, 2), units="N")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=1, velocity=1)
    samples = np.random.default_rng(1).normal(size=41)
    force = uqmbd.spline(np.linspace(0, 2, 41), samples)(argument(body) + start)
    mechanism.add(PointForce("force", body, (0,), (gain * force - 9 * body.position[0],)))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
def test_tables_over_time_and_motion_are_those_of_simulate(tmp_path):
    """Steps end at knots over time; knots over a motion limit the accuracy of any integration of high order."""
    times = np.linspace(0, 2.5, 26)
    for k, (argument, tolerance) in enumerate(((lambda body: uqmbd.t, 1e-8), (lambda body: body.position[0], 1e-6))):
        folder = tmp_path / str(k)
        folder.mkdir()
        mechanism = tabled(argument)
        compare(exported(mechanism, folder, times=times, rtol=1e-9), mechanism, times, {"gain": 1.7}, tolerance)


def controlled(state=False, initial=0, speed=False):
    """A rotor with a controller: an output of its state, a random initial value, or a commanded speed."""

    def control(time, measured, state):
        return -measured, state

    one = uqmbd.Controller(
        "loop", ["speed"], {"torque": "N m"}, rate=50, function=control, state={"i": 0.0}, initial=initial
    )
    mechanism = rotor(one)
    if state:
        mechanism.output("integral", one.state("i"), units="N m")
    if speed:
        other = mechanism.body("other", mass=1, inertia=1)
        mechanism.add(Revolute("pin", mechanism.ground, other, (0, 0), (0, 0)))
        mechanism.add(SpeedDriver("drive", mechanism.ground, other, 1.0 * one.command("torque")))
    return mechanism


def swung(law):
    """A bob on an arm whose angle is prescribed."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Planar(gravity=(0, -9.81)))
    arm = mechanism.body("arm", mass=1, inertia=0.1, position=(0.5, 0))
    bob = mechanism.body("bob", mass=1, inertia=0.01, position=(1.25, 0))
    mechanism.add(Revolute("A", mechanism.ground, arm, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("B", arm, bob, (0.5, 0), (-0.25, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, arm, law))
    mechanism.output("arm", arm.angle, units="rad")
    mechanism.output("speed", arm.angular_velocity, units="rad/s")
    mechanism.output("bob", bob.angle, units="rad")
    return mechanism


MOTION = {"angle": "rad", "rate": "rad/s", "acceleration": "rad/s^2", "since": "s"}


def swung_by_inputs():
    """The arm follows a polynomial whose coefficients are inputs."""
    angle, rate, acceleration, since = (
        uqmbd.RandomVariable(name, chaospy.Normal(0, 1), units=units) for name, units in MOTION.items()
    )
    return swung(angle + rate * (uqmbd.t - since) + acceleration * (uqmbd.t - since) ** 2 / 2)


@compiled
@pytest.mark.thorough
def test_prescribed_motions_are_inputs(tmp_path):
    """The arm follows the input exactly; its polynomials make the bob's error fall with the square of the step."""
    fmu = exported(swung_by_inputs(), tmp_path, times=(0.0, 1.0), rtol=1e-10, inputs=tuple(MOTION))
    exact, errors = swung(0.5 * sympy.sin(3 * uqmbd.t)), []

    def put(time):
        sine, cosine = 0.5 * np.sin(3 * time), 0.5 * np.cos(3 * time)
        assert fmu.set(list(MOTION), [sine, 3 * cosine, -9 * sine, time]) == 0

    for steps in (50, 100):
        times = np.linspace(0, 1, steps + 1)
        assert fmu.reset() == 0
        put(0.0)
        assert fmu.begin() == 0
        found = [fmu.get(["arm", "speed", "bob"])]
        for begin, end in zip(times[:-1], times[1:], strict=True):
            assert fmu.step(begin, end - begin) == 0
            put(end)
            found.append(fmu.get(["arm", "speed", "bob"]))
        expected = uqmbd.simulate(exact, times, rtol=1e-10)
        np.testing.assert_allclose(np.array(found)[:, 0], expected["arm"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.array(found)[:, 1], expected["speed"], rtol=0, atol=1e-12)
        errors.append(np.abs(np.array(found)[:, 2] - expected["bob"].values).max())
    assert errors[1] < 1e-3 and errors[0] / errors[1] > 3.5
    assert fmu.set(["angle"], [float("inf")]) == 3
    assert fmu.set(["angle"], [5.0]) == 0 and fmu.step(1.0, 0.01) == 3
    assert "constraints cannot follow the inputs at t = 1 s" in fmu.messages[-1][1]


def lawful(delay=0.0):
    """A rotor with a PI controller whose gain and limits are random, with a law that is compiled."""
    limit = uqmbd.RandomVariable("limit", chaospy.Uniform(3, 8), units="N m")
    gain = uqmbd.RandomVariable("gain", chaospy.Uniform(2, 4))

    def law(time, measured, state):
        (speed,), (integral,) = measured, state
        return [gain * (2 - speed) + integral + 0.1 * sympy.sin(time)], [integral + 0.1 * (2 - speed)]

    limits = {"torque": (-limit, limit)}
    return rotor(
        uqmbd.Controller(
            "loop", ["speed"], {"torque": "N m"}, rate=50, law=law, state={"i": 0.0}, delay=delay, limits=limits
        )
    )


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.05])
def test_laws_of_controllers_are_sampled_in_the_unit(delay, tmp_path):
    """Communication points and samples differ; the delay is less or more than a sampling period."""
    mechanism, times = lawful(delay), np.linspace(0, 1, 38)
    fmu = exported(mechanism, tmp_path, times=times, rtol=1e-10)
    assert "loop.torque" not in fmu.references
    compare(fmu, mechanism, times, {"inertia": 0.45, "gain": 3.9, "limit": 3.5}, 1e-10)
    assert fmu.reset() == 0 and fmu.set(["limit"], [-1.0]) == 0 and fmu.begin() == 3
    assert "Controller loop: a command or state is not finite" in fmu.messages[-1][1]


def driven(law):
    mechanism = uqmbd.Mechanism("driven", uqmbd.Planar())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.1), units="rad/s")
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, wheel, law(speed)))
    mechanism.output("angle", wheel.angle, units="rad")
    return mechanism


def thrown():
    """A stone with a random speed at the start, and a random wind."""
    speed, wind = (uqmbd.RandomVariable(name, chaospy.Normal(0, 1), units="m/s") for name in ("speed", "wind"))
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    stone = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.add(PointForce("drag", stone, (0,), (0.1 * (wind - stone.velocity[0]),)))
    mechanism.output("height", stone.position[0], units="m")
    return mechanism


def test_inputs_of_a_mechanism_are_checked_beforehand():
    """`uqmbd check` lists the possible inputs, and `uqmbd export --inputs` names the impossible ones."""
    study = uqmbd.Study("throw", thrown(), [0, 1], [])
    told = FmuExporter().remark("mechanism", study)
    assert told == "possible inputs: --inputs wind; parameters only, because they affect the initial state only: speed"
    assert FmuExporter(inputs=("wind",)).refusal("mechanism", study) == ""
    several = uqmbd.Study("slide", two_contacts(), [0, 1], [])
    told = FmuExporter().remark("mechanism", several)
    assert "may end at an event with several closed contacts, of floor, wall" in told
    assert "compiler 'c+' was not found" in FmuExporter(compiler="c+").refusal("surrogate", study)
    assert "'speed' changes the start" in FmuExporter(inputs=("speed",)).refusal("mechanism", study)
    assert "add --what mechanism" in FmuExporter(inputs=("wind",)).refusal("surrogate", study)


def jumping(speed):
    return sympy.Piecewise((speed * uqmbd.t, uqmbd.t < 0.5), (0.5 * speed, True))


REFUSED = {
    "random table": (
        lambda: tabled(lambda body: uqmbd.t, uqmbd.RandomVariable("start", chaospy.Uniform(0, 1), units="s")),
        {},
        "a table over time whose argument depends on random variables",
    ),
    "force of an impact": (lambda: bouncing(force=True), {}, "an output contains an acceleration or a reaction"),
    "state of a controller": (
        lambda: controlled(state=True),
        {},
        "'integral' contains a state of the controller 'loop'",
    ),
    "random command": (
        lambda: controlled(initial=uqmbd.RandomVariable("first", chaospy.Uniform(0, 1))),
        {},
        "initial value of the command 'torque' depends on random variables",
    ),
    "commanded speed": (lambda: controlled(speed=True), {}, "commands the speed of a driver"),
    "unknown input": (
        rotor,
        {"held": ("force",)},
        "the inputs 'force' do not exist; expected names of random variables: ",
    ),
    "input of the start": (thrown, {"held": ("speed",)}, "the input 'speed' changes the start of the motion only"),
    "speed that jumps": (lambda: driven(jumping), {}, "'drive' prescribes jumps at 0.5 s"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_has_no_form_in_c_is_refused_by_name(case):
    make, options, text = REFUSED[case]
    with pytest.raises(uqmbd.StudyError, match=text):
        motion_source(make(), **options)


@pytest.mark.thorough
def test_tables_with_many_knots_are_refused_beforehand():
    """Their knots are on the stack of the integration."""
    mechanism = uqmbd.Mechanism("shaken", uqmbd.Line())
    body = mechanism.body("body", mass=1)
    force = uqmbd.spline(np.linspace(0, 1, 11_000), np.random.default_rng(1).normal(size=11_000))
    mechanism.add(PointForce("force", body, (0,), (force(uqmbd.t),)))
    mechanism.output("x", body.position[0], units="m")
    assert "knots between 0 s and 1 s" in motion_refusal(mechanism)


def test_the_refusal_is_known_beforehand():
    assert (
        "an output contains an acceleration" in motion_refusal(bouncing(force=True)) and motion_refusal(rotor()) == ""
    )


def test_the_joint_distribution_travels_with_the_mechanism(tmp_path):
    done = export_fmu(rotor(), tmp_path / "one.fmu", compiler="none", inputs=("torque",))
    space = read_distributions(done.parameters)
    assert space.inputs == rotor().inputs.names and done.platforms == ()


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_finds_nothing_and_simulates_the_same(fmi, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    times = np.linspace(0, 1, 11)
    done = export_fmu(rotor(), tmp_path / "one.fmu", fmi=fmi, times=times, rtol=1e-9, inputs=("torque",))
    assert validate_fmu(str(done.path)) == []
    values = {"inertia": 0.42, "torque": 1.5}
    found = fmpy.simulate_fmu(str(done.path), start_values=values, stop_time=1.0, output_interval=0.1)
    expected = uqmbd.simulate(rotor(), times, values=values, rtol=1e-9)
    np.testing.assert_allclose(found["speed"], expected["speed"].values, rtol=0, atol=1e-8)


def seen():
    """A rotor whose outputs depend directly on no input, one input, all of them by an acceleration, or a command."""
    one = uqmbd.Controller("loop", ["speed"], {"torque": "N m"}, rate=50, function=lambda time, measured: -measured)
    mechanism = rotor(one)
    wheel, level = mechanism.bodies["wheel"], uqmbd.RandomVariable("level", chaospy.Normal(0, 1), units="N m")
    mechanism.add(Torque("load", wheel, level))
    mechanism.output("twice", 2 * level, units="N m")
    mechanism.output("command", one.command("torque"), units="N m")
    mechanism.output("acceleration", wheel.angular_acceleration, units="rad/s^2")
    return mechanism


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_description_states_what_inputs_change_directly(fmi, tmp_path):
    """Programs need it to couple units without algebraic loops: outputs without an input in it do not change."""
    for number, (make, held, commands) in enumerate(
        ((seen, ("level",), ("loop.torque",)), (swung_by_inputs, tuple(MOTION), ()))
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        fmu = exported(make(), folder, fmi, inputs=held)
        root = ElementTree.parse(folder / f"unpacked{fmi}" / "modelDescription.xml").getroot()
        names = {str(k + (fmi == 2)): name for name, k in fmu.references.items()}
        structure = root.find("ModelStructure")
        for initial, place in ((True, "InitialUnknown"), (False, "Output")):
            listed = structure.find(f"{place}s") if fmi == 2 else structure.findall(place)
            stated = {
                names[one.attrib["index" if fmi == 2 else "valueReference"]]: {
                    names[k] for k in one.attrib["dependencies"].split()
                }
                for one in listed
            }
            assert fmu.reset() == 0 and fmu.set(list(held), [0.3] * len(held)) == 0
            if not initial:
                assert fmu.begin() == 0 and fmu.step(0.0, 0.1) == 0
            elif fmi == 2:
                assert fmu.call("EnterInitializationMode") == 0
            else:
                flags = (c.c_bool(False), c.c_double(0), c.c_double(0), c.c_bool(False), c.c_double(0))
                assert fmu.call("EnterInitializationMode", *flags) == 0
            before = dict(zip(stated, fmu.get(list(stated)), strict=True))
            for name in (*held, *commands):
                assert fmu.set([name], [0.31]) == 0
                after = dict(zip(stated, fmu.get(list(stated)), strict=True))
                changed = {x for x in stated if after[x] != before[x]}
                expected = {x for x in stated if name in stated[x]}
                # at the start, some coefficients of the motion have the factor zero
                assert changed == expected or (make is swung_by_inputs and changed < expected)
                before = after
    assert stated["bob"] >= set(MOTION)


MAKERS = {
    "agile eye": lambda: uqmbd.load_study(STUDIES / "agile_eye.py").mechanism,
    "two contacts": two_contacts,
    "law": lawful,
    "friction": lambda: sliding(uqmbd.Spatial, (1.0, 0.5, 0.0), 0.0),
    "table": lambda: tabled(lambda body: uqmbd.t),
}


@pytest.mark.slow
@pytest.mark.parametrize("make", MAKERS.values(), ids=list(MAKERS))
@pytest.mark.parametrize("compiler", ["gcc", "clang", "zig"])
def test_compilers_have_no_warnings(compiler, make, tmp_path):
    """zig compiles a second binary, for Windows; with both, the FMU stays below half a megabyte."""
    if zig() is None if compiler == "zig" else shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    done = export_fmu(make(), tmp_path / "one.fmu", compiler=compiler, windows=compiler == "zig")
    assert done.warnings == "" and done.size < 500_000
    assert ("x86_64-windows" in done.platforms) == (compiler == "zig")


def test_the_distributions_of_random_variables_that_are_inputs_are_exported(tmp_path):
    mechanism = rotor()
    names = list(mechanism.inputs.names)
    done = export_fmu(mechanism, tmp_path / "one.fmu", compiler="none", inputs=names)
    for path in (done.path, done.parameters):
        assert list(read_distributions(path).inputs) == names


def test_the_command_writes_sources_only_and_lists_omitted_outputs(tmp_path, capsys):
    """The text "none" is a compiler, and not the default."""
    script, target = tmp_path / "study.py", tmp_path / "one.fmu"
    script.write_text(
        "import chaospy, uqmbd\n"
        "from uqmbd_montecarlo import MonteCarlo\n"
        'speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")\n'
        'mechanism = uqmbd.Mechanism("stone", uqmbd.Line())\n'
        'stone = mechanism.body("stone", mass=1, velocity=speed)\n'
        'mechanism.output("height", stone.position[0], units="m")\n'
        'mechanism.output("highest", uqmbd.maximum(stone.position[0]), units="m")\n'
        'study = uqmbd.Study("throw", mechanism, [0, 1, 2], [MonteCarlo(samples=4)])\n'
    )
    with pytest.raises(SystemExit, match="^0$"):
        main(["export", str(script), "--to", str(target), "--what", "mechanism", "--compiler", "none"])
    printed = capsys.readouterr().out
    assert "binaries   none" in printed and "omitted    highest" in printed
    with zipfile.ZipFile(target) as archive:
        assert not any(name.startswith("binaries") for name in archive.namelist())
