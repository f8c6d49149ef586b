"""FMUs as sampled controllers equal the same controllers in Python, and stop single realisations with a message."""

from __future__ import annotations

import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_fmi import fmu_controller
from uqmbd_fmi.compiling import find_compiler, host
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

from .pi_fmu import write_pi

pytest.importorskip("fmpy", reason="fmpy is not installed")
pytestmark = pytest.mark.skipif(
    host() is None or find_compiler() is None, reason="there is no C compiler, or no binary for this platform"
)

GAIN = uqmbd.RandomVariable("gain", chaospy.Uniform(2, 4))
INERTIA = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.4, 0.6), units="kg m^2")


@pytest.fixture(scope="module", params=[2, 3])
def pi(request, tmp_path_factory):
    """The PI controller of FMI 2.0 or 3.0."""
    return write_pi(tmp_path_factory.mktemp(f"pi{request.param}"), request.param)


def rotor(controller):
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=INERTIA)
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, (0, 0), (0, 0)))
    mechanism.add(controller)
    mechanism.add(Torque("motor", wheel, controller.command("u") - 0.3 * wheel.angular_velocity))
    mechanism.output("speed", wheel.angular_velocity, units="rad/s")
    mechanism.output("torque", controller.command("u"), units="N m")
    return mechanism


def imported(path, parameters=(("kp", GAIN),), **options):
    options = {"inputs": {"y": "speed"}, "outputs": {"u": "N m"}, "rate": 50} | options
    return fmu_controller("loop", path, parameters=dict(parameters), **options)


def in_python(delay=0.0):
    def control(time, measured, state):
        speed, gain = measured.T
        error = 2.0 - speed
        return (gain * error + state[:, 0])[:, None], state + 0.1 * error[:, None]

    return uqmbd.Controller(
        "loop", ["speed", GAIN], {"u": "N m"}, rate=50, function=control, state={"i": 0.0}, delay=delay
    )


@pytest.mark.parametrize("delay", [0.0, 0.02])
def test_an_fmu_equals_the_same_controller_in_python(pi, delay):
    times = np.linspace(0.1, 1.1, 41)
    values = {"gain": 2.3, "inertia": 0.58}
    found = uqmbd.simulate(rotor(imported(pi, delay=delay)), times, values=values)
    expected = uqmbd.simulate(rotor(in_python(delay)), times, values=values)
    for name in ("speed", "torque"):
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=1e-12)


@pytest.mark.parametrize("integrator", ["dop853", "auto", pytest.param("radau", marks=pytest.mark.thorough), "ida"])
def test_realisations_that_start_alike_have_separate_states(pi, integrator):
    """All realisations measure the same speed at the first sample, and differ afterwards."""
    times, methods = np.linspace(0, 0.5, 6), [MonteCarlo(samples=12, seed=2)]
    found, expected = (
        uqmbd.Study("rotor", rotor(one), times, methods, integrator=integrator).run()["monte-carlo/samples"]
        for one in (imported(pi), in_python())
    )
    # commands that differ by rounding change the number of iterations of implicit steps
    atol = 1e-7 if integrator == "radau" else 1e-8
    np.testing.assert_allclose(found["response"], expected["response"], rtol=0, atol=atol)


@pytest.mark.parametrize("workers", ["threads", pytest.param("processes", marks=pytest.mark.slow)])
def test_results_do_not_depend_on_workers(workers, tmp_path):
    methods = [MonteCarlo(samples=70, seed=2), Collocation(order=3)]
    study = uqmbd.Study("rotor", rotor(imported(write_pi(tmp_path))), np.linspace(0, 0.5, 6), methods)
    with ThreadPoolExecutor(2) as pool:
        one, two = study.run(), study.run(workers=2 if workers == "processes" else pool)
    assert one["monte-carlo/samples"]["response"].equals(two["monte-carlo/samples"]["response"])
    assert one["collocation/chaos"]["coefficients"].equals(two["collocation/chaos"]["coefficients"])


def test_an_error_status_stops_its_realisation_with_the_message_of_the_fmu(pi):
    limit = uqmbd.RandomVariable("limit", chaospy.Uniform(0.2, 3), units="rad/s")
    mechanism = rotor(imported(pi, {"kp": GAIN, "limit": limit}))
    study = uqmbd.Study("rotor", mechanism, np.linspace(0, 0.6, 4), [MonteCarlo(samples=20, seed=1, max_failures=1.0)])
    with pytest.warns(UserWarning, match="20 realisations failed.*limit = .*The measured speed is above its limit"):
        node = study.run()["monte-carlo/samples"].ds
    failed = node["status"].values != 0
    # speeds rise from 0 to about 1.7 rad/s, so low limits fail and high limits do not
    limits = node["inputs"].sel(input="limit").values
    assert 0 < failed.sum() < 20 and limits[failed].max() < limits[~failed].min()
    with pytest.raises(uqmbd.UqmbdError) as error:
        uqmbd.simulate(mechanism, [0, 0.6], values={"gain": 3, "inertia": 0.5, "limit": 0.2})
    told = str(error.value)
    assert "Controller 'loop' fails at t = 0.0" in told and "speed = 0.2" in told
    assert "DoStep failed with status 3 (error)" in told and "The measured speed is above its limit" in told
    with pytest.raises(uqmbd.UqmbdError, match="EnterInitializationMode.*The gain kp is negative"):
        uqmbd.simulate(mechanism, [0, 0.6], values={"gain": -1, "inertia": 0.5, "limit": 0.2})


def test_a_failed_history_stores_no_samples(pi):
    """Stored, 4000 samples of three values would need at least 96 kB."""
    control, state = imported(pi, {"kp": 3.0, "limit": 1.0}).function, np.zeros((1, 2))
    measured, sizes = np.array([[2.0, 3.0, 1.0]]), []
    tracemalloc.start()
    for k in range(5000):
        if k in (1000, 4999):
            sizes.append(tracemalloc.get_traced_memory()[0])
        _, state, reasons = control(k / 50, measured, state)
        assert 0 in reasons
    tracemalloc.stop()
    assert sizes[1] - sizes[0] < 48_000


def test_samples_after_a_failure_fail(pi):
    """The FMU fails at its sample number 2; later samples fail with or without the instance that failed."""
    control, measured = imported(pi, {"kp": 3.0, "limit": 1.0}).function, np.array([[0.5, 3.0, 1.0], [0.4, 3.0, 1.0]])
    state, reasons = np.zeros((2, 2)), {}
    for k in range(12):
        measured[0, 0] = 2.0 if k == 2 else 0.5
        before, (commands, state, reasons) = state, control(k / 50, measured, state)
        assert np.isfinite(commands[1]).all() and 1 not in reasons
        assert np.isnan(commands[0]).all() == (k >= 2) == (0 in reasons)
    assert "failed before" in reasons[0]
    # another value at the last sample makes a new history, which repeats the samples of the one before
    measured[:, 0] = 0.3
    commands, _, reasons = control(11 / 50, measured, before)
    assert np.isnan(commands[0]).all() and "failed before" in reasons[0] and np.isfinite(commands[1]).all()


def test_a_sample_is_repeated_without_the_failure_that_followed(pi):
    """The measured speed is above its limit at sample number 2, and below it when that sample is repeated."""
    control, state = imported(pi, {"kp": 3.0, "limit": 1.0}).function, np.zeros((1, 2))
    for k in range(2):
        _, state, _ = control(k / 50, np.array([[0.5, 3.0, 1.0]]), state)
    assert 0 in control(2 / 50, np.array([[2.0, 3.0, 1.0]]), state)[2]
    commands, _, reasons = control(2 / 50, np.array([[0.5, 3.0, 1.0]]), state)
    # the integral of two errors of 1.5 rad/s, and the gain
    np.testing.assert_allclose(commands, 3.0 * 1.5 + 0.1 * 2 * 1.5, rtol=0, atol=1e-12)
    assert reasons == {}


def test_a_method_that_expands_states_is_refused(pi):
    with pytest.raises(uqmbd.UqmbdError, match="such as Monte Carlo and collocation, not Galerkin"):
        uqmbd.Study("rotor", rotor(imported(pi)), [0, 0.1, 0.2], [Galerkin(order=1)]).run()


REFUSED = {
    "input": ({"inputs": {"speed": "speed"}}, "'speed' is not a variable of the FMU. The inputs of the FMU are: 'y'"),
    "output": ({"outputs": ["y"]}, "'y' is of the causality 'input', not 'output'"),
    "parameter": ({"parameters": {"gain": 1}}, "The parameters of the FMU are: 'kp', 'ki', 'r', 'limit'"),
    "file": ({"path": "none.fmu"}, "none.fmu does not exist"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_names_are_refused_with_the_variables_of_the_fmu(pi, case):
    options, text = REFUSED[case]
    options = {"path": pi} | options
    with pytest.raises(uqmbd.StudyError, match=text):
        imported(**options)


CHANGED = {
    "model exchange": (
        [("CoSimulation", "ModelExchange"), (' canHandleVariableCommunicationStepSize="true"', "")],
        "not for co-simulation",
    ),
    "one instance": (
        [("canHandleVariable", 'canBeInstantiatedOnlyOncePerProcess="true" canHandleVariable')],
        "only once per process",
    ),
    "no XML": ([("<ModelVariables>", "<")], "FMPy cannot read the model description"),
}


@pytest.mark.parametrize("case", CHANGED)
def test_fmus_that_cannot_be_used_are_refused_beforehand(case, tmp_path):
    changes, text = CHANGED[case]
    with pytest.raises(uqmbd.StudyError, match=text):
        imported(write_pi(tmp_path, 2, changes))


def test_a_rate_of_whole_internal_steps_is_required(tmp_path):
    """FMI 3.0 states the internal step of an FMU; in FMI 2.0, the attribute does not exist."""
    path = write_pi(tmp_path, 3, [("canHandleVariable", 'fixedInternalStepSize="0.01" canHandleVariable')])
    values = {"gain": 2.3, "inertia": 0.58}
    found, expected = (uqmbd.simulate(rotor(one), [0, 0.5], values=values) for one in (imported(path), in_python()))
    np.testing.assert_allclose(found["speed"], expected["speed"], rtol=0, atol=1e-12)
    with pytest.raises(
        uqmbd.StudyError, match="has steps of 0.01 s; expected a rate of 100 Hz divided by a whole .* 40 Hz"
    ):
        imported(path, rate=40)
