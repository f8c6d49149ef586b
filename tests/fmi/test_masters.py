"""Values do not depend on how a program divides the time into steps, repeats steps, or reads values in between."""

from __future__ import annotations

import ctypes as c

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_fmi import export_fmu

from .library import Fmu
from .masters import ORDERS, State, begin
from .surrogates import KINDS, node
from .test_mechanism_fmu import arm, compiled, exported, hitting_rod, lawful, rotor, sliding, tabled

ROTOR = {"inertia": 0.45, "torque": 1.5}
LAW = {"inertia": 0.45, "gain": 3.9, "limit": 3.5}


def pushed():
    """A body that sticks, slips and lifts off."""
    return sliding(uqmbd.Translational, (0.0, 0.0), 0.0, (12 * sympy.sin(3 * uqmbd.t), 22 * sympy.sin(1.3 * uqmbd.t)))


UNITS = {
    "rotor": (rotor, ("torque",), ROTOR, 1.0),
    "arm": (arm, ("shoulder", "elbow"), {"tip_mass": 0.6, "shoulder": 9.0, "elbow": -4.0}, 0.6),
    "impacts": (hitting_rod, (), {"restitution": 0.55}, 1.2),
    "friction": (pushed, (), {"friction": 0.15}, 4.0),
    "law": (lambda: lawful(0.013), (), LAW, 1.0),
    "direct law": (lawful, (), LAW, 1.0),
    "table": (lambda: tabled(lambda body: uqmbd.t), (), {"gain": 1.7}, 2.5),
}


@compiled
@pytest.mark.parametrize("fmi", [pytest.param(2, marks=pytest.mark.thorough), pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("unit", UNITS)
def test_values_do_not_depend_on_the_order_of_calls(unit, fmi, tmp_path):
    """Steps of 0.1 s add up to less than 1 s, and a step of 1e-16 s follows; steps of 1/30 s end between samples."""
    make, held, values, stop = UNITS[unit]
    mechanism = make()
    fmu = exported(mechanism, tmp_path, fmi, times=np.linspace(0, stop, 51), inputs=held, rtol=1e-9)
    outputs = [name for name in fmu.references if name not in values and name != "time"]
    inputs = {name: values[name] for name in held}
    for order in ORDERS:
        for size in (0.1, 1 / 30, 0.007, stop / 7):
            if order == "products" and abs(stop / size - round(stop / size)) > 1e-9:
                continue
            assert fmu.reset() == 0
            begin(fmu, values, outputs)
            found = ORDERS[order](fmu, stop, size, outputs, inputs)
            if fmi == 3:
                rounding = 2 * np.spacing(stop) if order == "products" else 0.0
                assert abs(fmu.get(["time"])[0] - found[-1, 0]) <= rounding
            times = np.unique(found[:, 0])
            times = times[np.append(True, np.diff(times) > 1e-12)]  # `simulate` has no times that differ by rounding
            expected = uqmbd.simulate(mechanism, times, values=values, rtol=1e-9)
            places = np.abs(times - found[:, :1]).argmin(axis=1)
            for k, name in enumerate(outputs, start=1):
                scale = max(1.0, float(np.abs(expected[name]).max()))
                difference = np.abs(found[:, k] - expected[name].values[places]).max()
                assert difference <= 1e-8 * scale, (order, size, name)


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["plain", "events"])
def test_surrogates_do_not_depend_on_the_order_of_calls(kind, tmp_path):
    """Surrogates have no memory: values at a time are those of one step to this time."""
    fmu = Fmu(export_fmu(node(KINDS[kind]()), tmp_path / "one.fmu").path, tmp_path / "unpacked")
    outputs = [name for name in fmu.references if "." not in name and name not in ("a", "b", "time")]
    values = {name: 1.0 for name in fmu.references if name in ("a", "b")}
    for order in ORDERS.values():
        assert fmu.reset() == 0
        begin(fmu, values, outputs)
        found = order(fmu, 1.0, 0.1, outputs, {})
        alone = [fmu.along([0.0, max(time, 1e-300)], values, outputs)[:, -1] for time in found[:, 0]]
        np.testing.assert_allclose(found[:, 1:], alone, rtol=0, atol=1e-13)


@compiled
@pytest.mark.thorough
def test_reads_and_steps_of_no_length_change_nothing(tmp_path):
    """Also inputs that are set again, in initialisation mode or at the end of a step, and a run before a reset."""
    fmu = exported(rotor(), tmp_path, times=(0.0, 1.0), inputs=("torque",))
    outputs, torques, found = ["speed", "angle"], np.sin(np.arange(20)), []
    for often in (False, True, False):
        assert fmu.reset() == 0
        assert fmu.set(["inertia", "torque"], [0.45, 0.3 if often else torques[0]]) == 0
        assert fmu.begin() == 0
        rows = []
        for k, torque in enumerate(torques):
            time = 0.05 * k
            assert fmu.set(["torque"], [torque]) == 0
            for _ in range(3 if often else 0):
                assert fmu.step(time, 0.0) == 0 and fmu.set(["torque"], [torque]) == 0
                fmu.get(outputs)
            assert fmu.step(time, 0.05) == 0
            rows.append(fmu.get(outputs).tolist())
        found.append(rows)
    assert found[0] == found[1] == found[2]


@compiled
@pytest.mark.thorough
def test_a_failed_step_is_repeated_from_a_saved_state(tmp_path):
    """The last successful time is the begin of the step that failed; a shorter step from there succeeds."""
    fmu = exported(hitting_rod(), tmp_path, times=(0.0, 1.0))
    assert fmu.begin() == 0 and fmu.step(0.0, 0.1) == 0
    before, state, time = fmu.get(["angle"]), State(fmu), c.c_double()
    state.save()
    assert fmu.step(0.2, 0.1) == 3 and fmu.step(0.1, -0.1) == 3
    assert fmu.call("GetRealStatus", 2, c.byref(time)) == 0 and time.value == 0.1
    assert fmu.call("Terminate") == 0 and fmu.step(0.1, 0.1) == 3
    state.restore()
    assert fmu.get(["angle"]).tolist() == before.tolist() and fmu.step(0.1, 0.05) == 0
    assert fmu.call("GetRealStatus", 2, c.byref(time)) == 0 and time.value == pytest.approx(0.15)
    state.free()
