"""Orders of calls of programs that run FMUs; those of OMSimulator follow its source (SystemWC.cpp, ComponentFMUCS.cpp).

Each function returns rows of the time and the outputs.  Times are sums of steps, as in these programs.
"""

from __future__ import annotations

import ctypes as c

import numpy as np


def begin(fmu, values, outputs, tolerance=1e-10):
    """Set a part of the values before the initialisation mode, the others in it, and read outputs after each."""
    names = list(values)
    assert fmu.set(names[:1], [values[n] for n in names[:1]]) == 0
    flags = (c.c_bool(True), c.c_double(tolerance), c.c_double(0.0), c.c_bool(False), c.c_double(1.0))
    if fmu.version == 2:
        assert fmu.call("SetupExperiment", *flags) == 0 and fmu.call("EnterInitializationMode") == 0
    else:
        assert fmu.call("EnterInitializationMode", *flags) == 0
    for name in names[1:]:
        fmu.get(outputs)
        assert fmu.set([name], [values[name]]) == 0
    early = fmu.get(outputs)
    assert fmu.call("ExitInitializationMode") == 0, fmu.messages
    assert fmu.get(outputs).tolist() == early.tolist()


class State:
    """A saved state of an instance."""

    def __init__(self, fmu):
        self.fmu, self.pointer = fmu, c.c_void_p()
        self.ending = "FMUstate" if fmu.version == 2 else "FMUState"

    def save(self):
        assert self.fmu.call(f"Get{self.ending}", c.byref(self.pointer)) == 0

    def restore(self):
        assert self.fmu.call(f"Set{self.ending}", self.pointer) == 0

    def free(self):
        assert self.fmu.call(f"Free{self.ending}", c.byref(self.pointer)) == 0
        assert not self.pointer


def until(fmu, now, end):
    """Advance to a time; every status other than OK is a failure, as in OMSimulator."""
    size = end - now
    while now < end:
        assert fmu.step(now, size) == 0, fmu.messages[-1:]
        now += size


def fixed(fmu, stop, size, outputs, inputs):
    """Fixed steps: inputs are set at the end of a step, and each point is stored before and after."""
    time, rows = 0.0, [(0.0, *fmu.get(outputs))]
    while time < stop:
        after = min(time + size, stop)
        until(fmu, time, after)
        time = after
        rows.append((time, *fmu.get(outputs)))
        assert fmu.set(list(inputs), list(inputs.values())) == 0
        rows.append((time, *fmu.get(outputs)))
    return np.array(rows)


def extrapolated(fmu, stop, size, outputs, inputs):
    """Fixed steps that are performed twice: with other inputs after the first time, from the restored state."""
    time, rows, state = 0.0, [(0.0, *fmu.get(outputs))], State(fmu)
    while time < stop:
        after = min(time + size, stop)
        state.save()
        until(fmu, time, after)
        fmu.get(outputs)
        assert fmu.set(list(inputs), [0.5 + x for x in inputs.values()]) == 0
        state.restore()
        until(fmu, time, after)
        time = after
        rows.append((time, *fmu.get(outputs)))
    state.free()
    return np.array(rows)


def variable(fmu, stop, size, outputs, inputs):
    """Variable steps: attempts are rejected at random, and repeated from the saved state with another size."""
    rng, time, rows, state = np.random.default_rng(1), 0.0, [(0.0, *fmu.get(outputs))], State(fmu)
    while time < stop:
        after = min(time + size, stop)
        state.save()
        until(fmu, time, after)
        fmu.get(outputs)
        if rng.random() < 0.4 and size > 1e-3:
            state.restore()
            size *= rng.uniform(0.5, 1.0)
        else:
            time, size = after, min(1.3 * size, 0.05)
            rows.append((time, *fmu.get(outputs)))
        state.free()
    return np.array(rows)


def products(fmu, stop, size, outputs, inputs):
    """Times are multiples of the step, which differ from the sums that the FMU computes by rounding."""
    count = round(stop / size)
    rows = [(0.0, *fmu.get(outputs))]
    for k in range(count):
        assert fmu.step(k * size, size) == 0, fmu.messages[-1:]
        rows.append(((k + 1) * size, *fmu.get(outputs)))
    return np.array(rows)


ORDERS = {"fixed": fixed, "extrapolated": extrapolated, "variable": variable, "products": products}
