"""Controllers with integrators of plugins, on workers, after an interruption, and with functions of all kinds."""

import sys
import textwrap
import threading
from dataclasses import replace
from pathlib import Path

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.propagation.studies.script import load_study
from uqmbd.testing import check_integrator
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, Torque

PACKAGE = Path(__file__).parents[2] / "thirdparty" / "uqmbd-runge-kutta-plugin"


@pytest.fixture
def runge_kutta(monkeypatch):
    """As if its plugin were installed."""
    monkeypatch.syspath_prepend(str(PACKAGE))
    from uqmbd_runge_kutta import RungeKutta

    class Projecting(RungeKutta):
        name = "projecting"
        capabilities = replace(RungeKutta.capabilities, projected=True)

        def integrate_projected(self, projected, times, rtol):
            return projected.integrate(times, rtol, "dop853")

    found = plugins.registry.registered()
    classes = {"runge-kutta": RungeKutta, "projecting": Projecting}
    registry = plugins.Registry(found.plugins, {**found.classes, "integrators": classes})
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)


def lift(time, measured):
    return np.where(measured[:, 0] < 0.4, 12.0, 0.0)


def ball():
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -10)))
    body = mechanism.body("ball", mass=1, position=(0, height))
    controller = mechanism.add(uqmbd.Controller(measured=["height"], commanded=["lift"], rate=9, function=lift))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), restitution=0.9))
    mechanism.add(PointForce("lift", body, (0, 0), (0, controller.command())))
    mechanism.output("height", body.position[1], units="m")
    mechanism.output("lift", controller.command(), units="N")
    for number in (1, 2):
        mechanism.output(f"impact_{number}", floor.event_time("impact", number), units="s")
    return mechanism


@pytest.mark.thorough
def test_an_integrator_of_a_plugin_follows_samples_and_impacts(runge_kutta):
    """Called from sample to sample; events are counted over them."""
    times = np.linspace(0, 1.6, 33)
    nodes = {
        name: uqmbd.Study("ball", ball(), times, integrator=name, rtol=1e-8).propagate(MonteCarlo(samples=4, seed=1))
        for name in ("runge-kutta", "auto")
    }
    mine, core = (nodes[name] for name in ("runge-kutta", "auto"))
    assert mine.attrs["failures"] == 0 and mine.attrs["integrated_by"] == "runge-kutta"
    np.testing.assert_allclose(mine["samples/response"], core["samples/response"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(mine["scalars/samples/response"], core["scalars/samples/response"], rtol=0, atol=1e-7)
    assert float(core["samples/response"].sel(output="lift").max()) == 12.0


def wheel(function, **options):
    inertia = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.9, 1.1), units="kg m^2")
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    body = mechanism.body("wheel", mass=1, inertia=inertia)
    mechanism.add(Revolute("bearing", mechanism.ground, body, (0, 0), (0, 0)))
    measured = {"measured": ["speed"], "commanded": ["torque"], "rate": 20}
    controller = mechanism.add(uqmbd.Controller(function=function, **measured, **options))
    mechanism.add(Torque("motor", body, controller.command()))
    mechanism.output("speed", body.angular_velocity, units="rad/s")
    return mechanism


def proportional(time, measured):
    return 3 * (1 - measured[:, 0])


def test_a_projection_by_a_plugin_is_sampled_once(runge_kutta):
    times = np.linspace(0, 0.5, 6)
    found = {
        name: uqmbd.Study("wheel", wheel(proportional), times, integrator=name).propagate(Galerkin(order=2))
        for name in ("projecting", "auto")
    }
    mine, core = (found[name]["statistics"]["mean"] for name in ("projecting", "auto"))
    np.testing.assert_allclose(mine, core, rtol=0, atol=1e-9)
    # inertia I: the speed w becomes w + (1 - w) 3 T / I at each sample
    nodes, weights = np.polynomial.legendre.leggauss(8)
    exact = (1 - (1 - 0.15 / (1 + 0.1 * nodes)) ** 10) @ weights / 2
    assert float(core[0, -1]) == pytest.approx(exact, abs=1e-6)


SCRIPT = """
    import chaospy
    import numpy as np
    import uqmbd
    from uqmbd_joints import Revolute
    from uqmbd_collocation import Collocation
    from uqmbd_montecarlo import MonteCarlo
    from uqmbd_springs import Torque

    GAINS = np.array([3.0])

    def helper(speed):
        return GAINS[0] * (1 - speed)

    def control(time, measured, state):
        return helper(measured[:, 0]) + state[:, 0], state + 0.1 * (1 - measured[:, :1])

    inertia = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.9, 1.1), units="kg m^2")
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    body = mechanism.body("wheel", mass=1, inertia=inertia)
    mechanism.add(Revolute("bearing", mechanism.ground, body, (0, 0), (0, 0)))
    controller = uqmbd.Controller(
        measured=["speed"], commanded=["torque"], rate=20, function={function}, state=[0], delay=0.01
    )
    mechanism.add(controller)
    mechanism.add(Torque("motor", body, controller.command()))
    mechanism.output("speed", body.angular_velocity, units="rad/s")
    study = uqmbd.Study("wheel", mechanism, np.linspace(0, 0.5, 6), propagators=[MonteCarlo(samples=130, seed=1)])
"""


BY_NAME, BY_VALUE = "control", "lambda t, y, s: control(t, y, s)"


@pytest.mark.parametrize(
    ("function", "name"),
    [
        pytest.param(BY_NAME, "loop_study", marks=pytest.mark.thorough),
        pytest.param(BY_VALUE, "loop_study", marks=pytest.mark.slow),
        # named like an installed module
        pytest.param(BY_NAME, "numpy", marks=pytest.mark.slow),
    ],
)
def test_any_number_of_workers_gives_the_same_bits(function, name, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    script = tmp_path / f"{name}.py"
    script.write_text(textwrap.dedent(SCRIPT).replace("{function}", function), encoding="utf-8")
    study = load_study(script)
    alone, many = (study.run(workers=n)["monte-carlo/samples/response"].values for n in (1, 2))
    assert np.array_equal(alone, many)
    assert np.isfinite(alone).all()


def test_functions_of_all_kinds_can_be_used():
    times = [0, 0.2]
    expected = uqmbd.simulate(wheel(proportional), times)["speed"]
    gain = 3

    class Loop:
        def __call__(self, time, measured):
            return gain * (1 - measured[:, 0])

    for function in (lambda t, y: gain * (1 - y[:, 0]), Loop()):
        found = uqmbd.Study("wheel", wheel(function), times).propagate(Collocation(order=1))
        assert float(found["statistics"]["mean"][0, -1]) == pytest.approx(float(expected[-1]), rel=1e-2)


def test_a_function_that_cannot_be_sent_is_reported():
    lock = threading.Lock()

    def locked(time, measured):
        with lock:
            return 1 - measured[:, 0]

    assert uqmbd.simulate(wheel(locked), [0, 0.2])["speed"][-1] > 0  # it need not be
    with pytest.raises(uqmbd.StudyError, match="Controller 'controller': its function cannot be sent .*cannot pickle"):
        uqmbd.Study("wheel", wheel(locked), [0, 0.2]).propagate(Collocation(order=1), workers=2)


def test_another_function_is_another_model():
    """What an interrupted run has computed with another function is not taken."""
    digests = {
        uqmbd.Study("wheel", wheel(function), [0, 0.2]).problem(Collocation(order=1)).model.digest
        for function in (proportional, lift, lambda t, y: y, lambda t, y: 2 * y)
    }
    assert len(digests) == 4
    again = uqmbd.Study("wheel", wheel(proportional), [0, 0.2]).problem(Collocation(order=1)).model.digest
    assert again in digests


@pytest.mark.slow
def test_who_only_claims_to_sample_is_found_out(runge_kutta):
    cls = plugins.registry.registered().classes["integrators"]["runge-kutta"]
    capable = replace(cls.capabilities, sampled_control=True)
    claims = type("Claims", (cls,), {"name": "claims", "capabilities": capable})
    with pytest.raises(AssertionError, match="sampled_control: driven body: with .* the speed is 0 at t = 2 s"):
        check_integrator(claims)


def soft(time, measured):
    return 3 * (1 - measured[:, 0])


@pytest.mark.slow
def test_methods_agree_on_a_controlled_ball_that_bounces(monkeypatch):
    """Galerkin at its nodes, collocation on elements, and a chaos that follows the impacts."""
    monkeypatch.setitem(globals(), "lift", soft)
    mechanism = ball()
    mechanism.scalars.clear()
    study = uqmbd.Study("ball", mechanism, np.linspace(0, 0.9, 10))
    on_elements = {"order": 3, "elements": 4}
    chaos, galerkin, aligned = (
        study.propagate(method)["statistics"]
        for method in (
            Collocation(**on_elements, index_set="tensor"),
            Galerkin(**on_elements),
            Collocation(order=4, alignment="events"),
        )
    )
    for name in ("mean", "std"):
        np.testing.assert_allclose(galerkin[name], chaos[name], rtol=0, atol=1e-5)
        np.testing.assert_allclose(
            aligned[name].sel(output="height"), chaos[name].sel(output="height"), rtol=0, atol=2e-4
        )
