"""Galerkin with the phase of a clock as the independent variable: closed forms, realisations, and what is refused."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd.results import AlignedChaos, surrogate
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin, aligned
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import PointForce, Torque


def pendulum(angle=1.2, spread=0.05, speed=0.0):
    """A rod on a pin; its length and its angle at the start are random."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    start = uqmbd.RandomVariable("start", chaospy.Normal(angle, spread), units="rad")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    at = (length / 2 * sympy.sin(start), -length / 2 * sympy.cos(start))
    rod = mechanism.body(
        "rod", mass=1, inertia=length**2 / 12, position=at, angle=start - sympy.pi / 2, angular_velocity=speed
    )
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("theta", rod.angle + sympy.pi / 2, units="rad")
    return mechanism


def swing(values, times):
    """Angle (K, T) of pendulums that start at rest, by elliptic functions, of lengths and angles (K, 2)."""
    length, start = values.T[..., None]
    m = np.sin(start / 2) ** 2
    sn = ellipj(ellipk(m) - np.sqrt(1.5 * 9.81 / length) * times, m)[0]
    return 2 * np.arcsin(np.sqrt(m) * sn)


def crank(speed=25.0, torque=0.0, damping=0.0):
    """A slider-crank that turns over; its crank has random length and mass."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(0.15, 0.003), units="m")
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2))
    x, y = (length * f(sympy.pi / 4) for f in (sympy.cos, sympy.sin))
    turned = -sympy.asin(y / 0.35)
    end = x + 0.35 * sympy.cos(turned)
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    wheel = mechanism.body(
        "crank", mass=0.36 * mass, inertia=0.01 * mass, position=(x / 2, y / 2), angle=sympy.pi / 4,
        angular_velocity=speed,
    )  # fmt: skip
    rod = mechanism.body("rod", mass=0.15, inertia=0.15 * 0.35**2 / 12, position=((x + end) / 2, y / 2), angle=turned)
    slider = mechanism.body("slider", mass=0.1, inertia=1e-4, position=(end, 0))
    mechanism.add(Revolute("A", mechanism.ground, wheel, (0, 0), (-length / 2, 0)))
    mechanism.add(Revolute("B", wheel, rod, (length / 2, 0), (-0.175, 0)))
    mechanism.add(Revolute("C", rod, slider, (0.175, 0), (0, 0)))
    mechanism.add(Prismatic("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    if torque:
        mechanism.add(Torque("drive", wheel, torque - damping * wheel.angular_velocity))
    mechanism.output("slider_x", slider.position[0], units="m")
    mechanism.output("pin", mechanism.components["A"].reaction_force[0], units="N")
    return mechanism


def run(mechanism, end, method, rtol=1e-8, count=None, **options):
    times = np.linspace(0, end, count or int(40 * end) + 1)
    return uqmbd.Study("study", mechanism, times, [method], rtol=rtol, **options).propagate(method)


def inputs_of(mechanism, count, seed=1):
    space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    return space.to_inputs(space.from_uniform(np.random.default_rng(seed).uniform(size=(count, space.dimension))))


def error(node, mechanism, count=60, exact=swing):
    """Root mean square error (T,) of the first output, over its largest standard deviation."""
    values = inputs_of(mechanism, count)
    chaos = surrogate(node)
    expected = exact(values, np.asarray(chaos.labels.times))
    found = chaos.evaluate(values)[:, 0]
    return np.sqrt(np.mean((found - expected) ** 2, axis=0)) / expected.std(axis=0).max()


@pytest.mark.thorough
def test_a_pendulum_converges_to_elliptic_functions():
    """Its error falls with the order, over seven periods, where the plain expansion has failed."""
    mechanism = pendulum()
    errors = [
        error(run(mechanism, 12, Galerkin(order=p, alignment="phase", verify=2)), mechanism).max() for p in (1, 2, 3)
    ]
    assert errors[1] < 0.15 * errors[0] and errors[2] < 0.15 * errors[1] < 1e-3
    with pytest.warns(uqmbd.SurrogateWarning, match="stated error of the surrogate exceeds 10%"):
        plain = run(mechanism, 12, Galerkin(order=3))
    assert error(plain, mechanism).max() > 100 * errors[2]


@pytest.mark.slow
def test_a_pendulum_holds_to_80_seconds():
    mechanism = pendulum()
    found = error(run(mechanism, 80, Galerkin(order=3, alignment="phase")), mechanism)
    assert np.isfinite(found).all() and found.max() < 5e-4


@pytest.mark.thorough
def test_phases_that_differ_at_the_start_are_right():
    """Pendulums that start with random angle and a speed, at different phases of their oscillation: against SciPy."""
    mechanism = pendulum(angle=0.6, spread=0.2, speed=2.0)

    def exact(values, times):
        found = []
        for length, start in values:

            def free(t, y, length=length):
                return [y[1], -1.5 * 9.81 / length * np.sin(y[0])]

            found.append(
                solve_ivp(free, (0, times[-1]), [start, 2.0], method="DOP853", rtol=1e-11, atol=1e-11, t_eval=times).y[
                    0
                ]
            )
        return np.array(found)

    node = run(mechanism, 8, Galerkin(order=6, alignment="phase", verify=2))
    assert node.attrs["clock_kind"] == "oscillation"
    assert error(node, mechanism, 30, exact).max() < 1e-3


@pytest.mark.thorough
def test_a_mechanism_with_constraints_agrees_with_collocation_in_phase():
    """With as many terms as nodes both follow the same realisations; reactions, too; and energy is kept."""
    mechanism = crank()
    options = {"order": 2, "index_set": "tensor", "alignment": "phase", "verify": 4}
    node = run(mechanism, 3, Galerkin(**options), rtol=1e-9)
    other = run(mechanism, 3, Collocation(**options), rtol=1e-9)
    assert node.attrs["clock"] == other.attrs["clock"] == "crank" and node.attrs["turns"] > 10
    values = inputs_of(mechanism, 30)
    found, expected = (surrogate(x).evaluate(values) for x in (node, other))
    # expansions at other phases, the one since the start and the other of the crank, differ by their truncation only
    spread = expected.std(axis=0).max(axis=1)
    assert (np.abs(found - expected).max(axis=(0, 2)) < 0.01 * spread).all()
    energy = node["diagnostics"]["energy"].values
    assert np.ptp(energy) < 1e-6 * abs(energy).max()
    assert node["diagnostics"]["constraint_rms"].values.max() < 1e-7


@pytest.mark.thorough
def test_fewer_terms_than_nodes_follow_the_realisations():
    mechanism = crank()
    node = run(mechanism, 3, Galerkin(order=3, alignment="phase", verify=4))
    assert node.attrs["terms"] == 10 and node.attrs["nodes"] == 16
    study = uqmbd.Study(
        "study",
        mechanism,
        node["statistics"]["time"].values,
        [Galerkin()],
        rtol=1e-10,
    )
    values = inputs_of(mechanism, 20)
    expected = study.problem(study.propagators[0]).realise(values).response
    off = surrogate(node).evaluate(values) - expected
    assert (np.sqrt((off**2).mean(axis=0)).max(axis=1) < 2e-3 * expected.std(axis=0).max(axis=1)).all()


@pytest.mark.thorough
def test_a_clock_that_starts_at_rest_is_started_in_time():
    """A crank that a damped torque sets in motion: the time per angle is infinite at the start."""
    mechanism = crank(speed=0, torque=0.6, damping=0.02)
    node = run(mechanism, 4, Galerkin(order=3, alignment="phase", verify=4))
    study = uqmbd.Study("study", mechanism, node["statistics"]["time"].values, [Galerkin()], rtol=1e-10)
    values = inputs_of(mechanism, 20)
    expected = study.problem(study.propagators[0]).realise(values).response
    off = surrogate(node).evaluate(values) - expected
    assert (np.sqrt((off**2).mean(axis=0)).max(axis=1) < 1e-3 * expected.std(axis=0).max(axis=1)).all()


@pytest.mark.thorough
def test_results_are_those_of_an_aligned_chaos():
    node = run(pendulum(), 4, Galerkin(order=2, alignment="phase", clock="theta", verify=4), count=81)
    assert json.loads(node.attrs["options"])["alignment"] == "phase" and node.attrs["clock"] == "theta"
    chaos = AlignedChaos.from_dataset(node["aligned"].to_dataset())
    values = inputs_of(pendulum(), 5)
    assert np.array_equal(chaos.evaluate(values), surrogate(node).evaluate(values))
    assert np.isfinite(node["statistics"]["mean"]).all() and np.isfinite(node["statistics"]["std"]).all()
    assert len(chaos.verification_germs) == 4


def double_pendulum(angle):
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.9, 1.1))
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    x, y = float(np.sin(angle)), -float(np.cos(angle))
    bodies = [
        mechanism.body(name, mass=m, inertia=m / 12, position=(k * x, k * y), angle=angle - np.pi / 2)
        for name, m, k in (("upper", mass, 0.5), ("lower", 1, 1.5))
    ]
    mechanism.add(Revolute("pin", mechanism.ground, bodies[0], (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("knee", *bodies, (0.5, 0), (-0.5, 0)))
    mechanism.output("x", bodies[1].point((0.5, 0))[0], units="m")
    return mechanism


@pytest.mark.thorough
def test_where_there_is_no_clock_the_reason_is_given():
    with pytest.raises(uqmbd.StudyError, match="alignment='phase' needs a clock"):
        run(double_pendulum(2 * np.pi / 3), 10, Galerkin(order=2, alignment="phase"), rtol=1e-6)


@pytest.mark.thorough
def test_a_clock_that_stands_in_some_realisations_is_refused_with_the_reason():
    """A pendulum that turns over where its rod is short, and swings where it is long."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.8, 1.2), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body(
        "rod", mass=1, inertia=length**2 / 12, position=(0, -length / 2), angle=-sympy.pi / 2, angular_velocity=7.7
    )
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    with pytest.raises(uqmbd.StudyError, match="in all realisations, .* stops or reverses in . of 16, first at len"):
        run(mechanism, 8, Galerkin(order=2, alignment="phase", clock="angle"), rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"clock": "theta"}, "clock='theta' requires alignment='phase'"),
        ({"alignment": "phase", "elements": 2}, "elements=2 contradicts alignment='phase'"),
        ({"alignment": "phase", "stop_at": 0.1}, "stop_at=0.1 contradicts alignment=.phase."),
        ({"alignment": "phase", "linear_solver": "dense"}, "linear_solver='dense' contradicts alignment=.phase."),
        ({"alignment": "phase", "integrator": "ida"}, "integrator='ida' contradicts alignment=.phase."),
        ({"alignment": "events"}, "alignment"),
    ],
)
def test_options_without_effect_are_refused(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Galerkin(**options)


def test_a_study_with_an_implicit_integrator_is_refused():
    with pytest.raises(uqmbd.StudyError, match="the integrator of the study is 'ida'"):
        run(pendulum(), 1, Galerkin(alignment="phase"), integrator="ida")


def test_an_unknown_clock_is_refused():
    with pytest.raises(uqmbd.StudyError, match="clock is 'nobody'; expected"):
        run(pendulum(), 1, Galerkin(order=1, alignment="phase", clock="nobody"))


@pytest.mark.thorough
def test_a_clock_whose_rate_is_not_known_is_refused():
    mechanism = pendulum()
    mechanism.output("pull", mechanism.components["pin"].reaction_force[1], units="N")
    with pytest.raises(
        uqmbd.StudyError,
        match="whose rate is a function of the state, but the .* of the oscillation of 'pull' contains",
    ):
        run(mechanism, 4, Galerkin(order=1, alignment="phase", clock="pull"), rtol=1e-6)


@pytest.mark.parametrize("what", ["impact", "controller"])
def test_what_happens_at_moments_in_time_is_refused_before_anything_is_computed(what):
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    ball = mechanism.body("ball", mass=1, position=(0, length))
    mechanism.output("y", ball.position[1], units="m")
    if what == "impact":
        mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
    else:
        push = uqmbd.Controller("push", measured=["y"], commanded=["force"], rate=10, function=lambda time, seen: -seen)
        mechanism.add(push)
        mechanism.add(PointForce("force", ball, (0, 0), (push.command(), 0)))
    method = Galerkin(order=1, index_set="tensor", alignment="phase")
    study = uqmbd.Study("study", mechanism, [0, 1], [method])
    followed = "the impacts of 'floor'" if what == "impact" else "controllers"
    message = f"with a phase as the independent variable, uqmbd cannot follow {followed}"
    assert message in method.obstacle(study)
    with pytest.raises(uqmbd.StudyError, match=message):
        study.propagate(method)


@pytest.mark.thorough
@pytest.mark.parametrize("verify", [3, 12])
def test_the_estimate_counts_the_realisations_for_the_clock(verify):
    """As many as the results say, where they are integrated once; the estimate in time has none."""
    method = Galerkin(order=2, alignment="phase", verify=verify)
    study = uqmbd.Study("p", pendulum(angle=0.5), times=np.linspace(0, 2, 11), rtol=1e-7, propagators=[method])
    node = study.propagate(method)
    assert node.attrs["realisations"] == method.estimate(study).realisations == 9 + verify + max(verify, 8)
    assert Galerkin(order=2, verify=verify).estimate(study).realisations == 9 + verify


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.SurrogateWarning")
def test_samples_that_end_early_end_the_results(monkeypatch):
    """Without further phases some samples do not reach the last time; a whole run ends with them, and is valid."""
    monkeypatch.setattr(aligned, "EXTENSIONS", 0)
    times = np.linspace(0, 2, 41)
    study = uqmbd.Study(
        "study", pendulum(spread=0.2), times, [Galerkin(order=1, alignment="phase", verify=2)], rtol=1e-6
    )
    with pytest.warns(UserWarning, match="do not reach the last output time"):
        tree = study.run()
    uqmbd.results.validate(tree)
    node = tree["galerkin"]
    end = node.attrs["ends_at"]
    assert 1 < end < 2 and np.array_equal(node["statistics"]["time"], times)
    statistics = node["statistics"].to_dataset()
    for name in ("mean", "std", "quantile", "sobol_total", "verification_error"):
        before, after = statistics[name].sel(time=slice(0, end)), statistics[name].sel(time=slice(end + 1e-9, None))
        assert np.isfinite(before).all() and np.isnan(after).all(), name
    assert surrogate(node).labels.times[-1] == end
