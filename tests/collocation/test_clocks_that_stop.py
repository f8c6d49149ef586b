"""Clocks that turn backwards, swing or stand in some realisations, or run into a failure behind the last time."""

from __future__ import annotations

import html
import warnings

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.cli.tables import show_summary
from uqmbd.report import write_report
from uqmbd.results import load, save, study_tree, surrogate
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque

pytestmark = pytest.mark.thorough

INERTIA = 0.5


def disc(torque, times, load=lambda body: 0.0, other=None):
    """A disc that a random torque spins up from rest against a load; another body turns steadily beside it."""
    random = uqmbd.RandomVariable("torque", torque, units="N m")
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar())
    body = mechanism.body("disc", mass=1, inertia=INERTIA, position=(0, 0), angle=0.3)
    mechanism.add(Revolute("axle", mechanism.ground, body, point_i=(0, 0), point_j=(0, 0)))
    mechanism.add(Torque("drive", body, torque=random + load(body)))
    if other is not None:
        wheel = mechanism.body("wheel", mass=1, inertia=1, position=(0, 0), angular_velocity=other)
        mechanism.add(Revolute("hub", mechanism.ground, wheel, point_i=(0, 0), point_j=(0, 0)))
    mechanism.output("height", body.point((0.2, 0))[1], units="m")
    return uqmbd.Study("disc", mechanism, times=times, rtol=1e-9, propagators=[])


def oscillator(times, stiffness, force=None, start=None, **options):
    """A mass of 1 kg on a spring."""
    random = uqmbd.RandomVariable("k", stiffness, units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    begin = {"position": 0.1} if start is None else start()
    mass = mechanism.body("mass", mass=1, **begin)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=random, free_length=0))
    if force is not None:
        mechanism.add(PointForce("force", mass, 0, force))
    mechanism.output("x", mass.position[0], units="m")
    return uqmbd.Study("oscillator", mechanism, times=times, rtol=1e-9, propagators=[], **options)


def pendulum(low, high, end, count):
    """A point mass on a rod of 1 m that starts below at a random speed."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(low, high), units="rad/s")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body(
        "rod",
        mass=1,
        inertia=0,
        position=(0, -1),
        angle=-sympy.pi / 2,
        velocity=(1.0 * speed, 0),
        angular_velocity=speed,
    )
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-1, 0)))
    mechanism.output("height", rod.position[1], units="m")
    return uqmbd.Study("pendulum", mechanism, times=np.linspace(0, end, count), propagators=[])


def heights(speeds, times):
    """Of the pendulum, by SciPy, shape (K, 1, T)."""

    def rates(_, y):
        return [y[1], -9.81 * np.sin(y[0])]

    found = [solve_ivp(rates, times[[0, -1]], [0, s], "DOP853", times, rtol=1e-10, atol=1e-10).y[0] for s in speeds]
    return -np.cos(np.array(found))[:, None]


def relative(chaos, inputs, exact):
    """Root mean square error (O, T) over the largest standard deviation of exact values (K, O, T)."""
    wrong = chaos.evaluate(inputs) - exact
    assert np.isfinite(wrong).all()
    return np.sqrt((wrong**2).mean(axis=0)) / exact.std(axis=0).max(axis=-1, keepdims=True)


def test_torque_of_either_sign():
    """Some realisations turn forwards and others backwards: each side follows its own phase, by closed form."""
    study = disc(chaospy.Uniform(-1.0, 1.2), np.linspace(0, 10, 101))
    with pytest.warns(UserWarning) as told:
        node = study.propagate(Collocation(order=14, alignment="phase", max_elements=12))
    assert any("the angle 'disc', stops or reverses with a probability of about" in str(w.message) for w in told)
    torque = np.concatenate([np.random.default_rng(0).uniform(*x, 300) for x in ((-1.0, -0.3), (0.3, 1.2))])
    exact = 0.2 * np.sin(0.3 + torque[:, None] / INERTIA * study.times**2 / 2)[:, None]
    assert relative(surrogate(node), torque[:, None], exact).max() < 0.02
    elements = surrogate(node).elements
    standing = sum(e.box.probability for e in elements if e.landmarks == "time")
    assert 0 < standing == pytest.approx(node.attrs["standing"])
    # a turn takes a torque of 2 pi / 100 N m, of a range of 2.2 N m
    assert standing < 4 * 2 * np.pi / 100 / 2.2
    assert np.isfinite(node["statistics"]["mean"]).all()


def test_pendulum_that_swings_or_turns_follows_its_rod():
    """A height oscillates in all realisations, but the rod turns in some: its angle tells the motions apart."""
    study = pendulum(5.0, 8.0, 6, 121)
    with pytest.warns(UserWarning, match="realisations have different sequences of phases"):
        node = study.propagate(Collocation(order=5, alignment="phase", max_elements=8))
    assert node.attrs["clock"] == "rod" and node.attrs["clock_kind"] == "angle, oscillation"
    # the speed that just reaches the top is 2 sqrt(g l)
    top = 2 * np.sqrt(9.81)
    random = np.random.default_rng(1)
    for low, high in ((5.0, top - 0.5), (top + 0.6, 8.0)):
        speeds = random.uniform(low, high, 40)
        assert relative(surrogate(node), speeds[:, None], heights(speeds, study.times)).max() < 0.05


def test_pendulum_that_always_swings_follows_its_oscillation():
    study = pendulum(2.0, 3.0, 30, 301)
    node = study.propagate(Collocation(order=4, alignment="phase"))
    assert (node.attrs["clock"], node.attrs["clock_kind"], node.attrs["standing"]) == ("rod", "oscillation", 0.0)
    speeds = np.random.default_rng(1).uniform(2, 3, 20)
    assert relative(surrogate(node), speeds[:, None], heights(speeds, study.times)).max() < 1e-3


def test_crank_that_stalls_is_counted_and_gets_elements_of_its_own():
    """A weight, and a friction by which it does not swing: below some torque the disc never gets over the top."""
    study = disc(
        chaospy.Uniform(0.4, 1.6),
        np.linspace(0, 12, 121),
        lambda body: -0.8 * sympy.cos(body.angle) - 1.0 * body.angular_velocity,
        other=3.0,
    )
    with pytest.warns(UserWarning) as told:
        node = study.propagate(Collocation(order=3, alignment="phase", clock="disc", max_elements=8))
    (text,) = [str(w.message) for w in told if "stops or reverses" in str(w.message)]
    assert "with a probability of about" in text and "at equal times" in text
    assert text.endswith("try clock='wheel'.")

    def rates(_, y, torque):
        return [y[1], (torque - 0.8 * np.cos(y[0]) - 1.0 * y[1]) / INERTIA]

    torque = np.random.default_rng(3).uniform(0.4, 1.6, 200)
    turned = [solve_ivp(rates, (0, 12), [0.3, 0.0], "DOP853", args=(x,), rtol=1e-8).y[0, -1] - 0.3 for x in torque]
    stalled = np.mean(np.array(turned) < 2 * np.pi)
    assert 0.05 < stalled and abs(node.attrs["standing"] - stalled) < 0.1


def test_better_clock_is_named_only_if_it_runs_in_all():
    study = disc(chaospy.Uniform(-1.0, 1.2), np.linspace(0, 10, 101))
    with pytest.warns(UserWarning) as told:
        study.propagate(Collocation(order=3, alignment="phase", clock="disc", max_elements=4))
    assert not any("try clock=" in str(w.message) for w in told)


@pytest.mark.parametrize("law", [sympy.sqrt(21 - uqmbd.t), sympy.log(20.9 - uqmbd.t)])
def test_law_that_ends_behind_the_last_time(law):
    """Nodes are followed as far as they need, where they fail farther on."""
    study = oscillator(np.linspace(0, 20, 201), chaospy.Uniform(99, 101), 1e-9 * law, integrator="dop853")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        node = study.propagate(Collocation(order=3, alignment="phase"))
    assert node.attrs["failures"] == 0 and 1.005 < node.attrs["longer"] < 1.05
    k = np.random.default_rng(0).uniform(99, 101, 100)
    exact = 0.1 * np.cos(np.sqrt(k)[:, None] * study.times)[:, None]
    assert relative(surrogate(node), k[:, None], exact).max() < 1e-4


def test_law_that_ends_before_the_phase_is_reached():
    """What cannot be followed is told, with when and why."""
    study = oscillator(
        np.linspace(0, 20, 201), chaospy.Uniform(80, 120), sympy.sqrt(20.2 - uqmbd.t), integrator="dop853"
    )
    with pytest.raises(uqmbd.IntegrationError) as told:
        study.propagate(Collocation(order=3, alignment="phase"))
    text = str(told.value)
    assert (
        "beyond the last output time" in text and "until the clock, the oscillation of 'x', reaches the phase" in text
    )


def test_start_phase_over_a_whole_turn():
    """Phases that differ by a whole turn at the start are told apart from neighbour to neighbour: closed form."""

    def start():
        phase = uqmbd.RandomVariable("phase", chaospy.Uniform(0, 2 * np.pi), units="rad")
        return {"position": 0.1 * sympy.cos(phase), "velocity": -sympy.sin(phase)}

    study = oscillator(np.linspace(0, 20, 201), chaospy.Uniform(90, 110), start=start)
    node = study.propagate(Collocation(order=7, alignment="phase"))
    random = np.random.default_rng(0)
    inputs = np.stack([random.uniform(90, 110, 300), random.uniform(0, 2 * np.pi, 300)], axis=1)
    rate = np.sqrt(inputs[:, :1])
    begin = inputs[:, 1:]
    exact = 0.1 * np.cos(begin) * np.cos(rate * study.times) - np.sin(begin) / rate * np.sin(rate * study.times)
    assert node["nodes"]["input"].values.tolist() == ["k", "phase"]
    assert relative(surrogate(node), inputs, exact[:, None]).max() < 0.01


def test_double_pendulum_at_120_degrees_is_refused():
    """Neither arm turns or swings steadily there: nothing is aligned in silence."""
    lean = uqmbd.RandomVariable("lean", chaospy.Uniform(115, 125), units="deg")
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    angle = lean * sympy.pi / 180 - sympy.pi / 2
    elbow = (sympy.cos(angle), sympy.sin(angle))
    upper = mechanism.body("upper", mass=1, inertia=0.01, position=elbow, angle=angle)
    lower = mechanism.body("lower", mass=1, inertia=0.01, position=(2 * elbow[0], 2 * elbow[1]), angle=angle)
    mechanism.add(Revolute("shoulder", mechanism.ground, upper, point_i=(0, 0), point_j=(-1, 0)))
    mechanism.add(Revolute("elbow", upper, lower, point_i=(0, 0), point_j=(-1, 0)))
    mechanism.output("height", lower.position[1], units="m")
    study = uqmbd.Study("double", mechanism, times=np.linspace(0, 20, 201), propagators=[])
    with pytest.raises(uqmbd.StudyError) as told:
        study.propagate(Collocation(order=4, alignment="phase"))
    text = str(told.value)
    assert "needs a clock, but there is none" in text and "'upper'" in text and "use alignment=None" in text


def test_report_and_table_of_a_run_say_which_clock_was_taken(tmp_path, capsys):
    """By name and kind, how far it runs, how much longer realisations were followed, and where it stands."""
    study = disc(
        chaospy.Uniform(0.4, 1.6),
        np.linspace(0, 12, 121),
        lambda body: -0.8 * sympy.cos(body.angle) - 1.0 * body.angular_velocity,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        node = study.propagate(Collocation(order=3, alignment="phase", clock="disc", max_elements=4))
    assert node.attrs["standing"] > 0
    least, most = node.attrs["clock_turns"]
    # without the friction the largest torque turns it so often
    assert 1 < least < most < 1.6 / INERTIA * 12**2 / 2 / (2 * np.pi)
    tree = study_tree([node], study="disc", mechanism="disc")
    show_summary(tree, files={})
    assert "disc (angle" in capsys.readouterr().out
    save(tree, tmp_path / "results.nc")
    write_report(load(tmp_path / "results.nc"), tmp_path / "report.html")
    text = html.unescape((tmp_path / "report.html").read_text())
    assert "realisations are compared at equal phases of the angle 'disc'" in text
    assert f"with {least:.3g} to {most:.3g} turns until the last output time" in text
    assert f"integrated for {node.attrs['longer']:.3g} times the duration" in text
    assert f"in about {node.attrs['standing']:.1%} of the realisations the clock stops" in text


@pytest.mark.parametrize("clock", [None, "disc", "height"])
def test_check_says_which_clock_there_is(clock):
    """At the means of the inputs: the wheel turns at 3 rad/s, the disc by a torque of 1 N m from rest."""
    study = disc(chaospy.Uniform(0.9, 1.1), np.linspace(0, 8, 81), other=3.0)
    (text,) = Collocation(order=2, alignment="phase", clock=clock).remarks(study)
    # by default the steadier
    turns = {None: 24 / (2 * np.pi), "disc": 64 / (2 * np.pi)}
    if clock == "height":
        # the start at rest counts as an extreme: from 0.3 rad to the top are two quarters instead of one
        assert text.startswith("the clock is the oscillation of 'height' at the means of the inputs, 10.5 turns")
        return
    assert text.startswith(f"the clock is the angle {clock or 'wheel'!r} at the means of the inputs, ")
    assert f", {turns[clock]:.3g} turns until the last output time" in text
    assert Collocation(order=2).remarks(study) == ()


def test_check_says_that_there_is_no_clock():
    study = disc(
        chaospy.Uniform(0.4, 0.5),
        np.linspace(0, 12, 121),
        lambda body: -0.8 * sympy.cos(body.angle) - 1.0 * body.angular_velocity,
    )
    (text,) = Collocation(order=2, alignment="phase", clock="height").remarks(study)
    assert text.startswith("no clock at the means of the inputs: ") and "'height' does not" in text


def test_verification_realisations_in_the_tails_count_by_their_weights():
    """Torques below 0.06 N m make no turn: 4e-4 of the probability, at which several verification points lie."""
    study = disc(chaospy.Normal(1.0, 0.28), np.linspace(0, 10, 51))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        node = study.propagate(Collocation(order=3, alignment="phase", max_elements=1, verify=64))
    nodes = node["nodes"].to_dataset()
    seen = nodes["inputs"].values[nodes["purpose"].values == "verification", 0]
    assert (seen < 2 * np.pi / 100).sum() > 2
    assert 0 < node.attrs["mixed"] < 3e-3
    assert any("realisations have different sequences of" in str(one.message) for one in told)
