"""What a controller does makes its digest: another one where it does something else, the same in every process."""

import functools
import os
import pickle
import subprocess
import sys
import textwrap

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics.control.shipped import Shipped
from uqmbd.propagation.studies.script import load_study
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2), units="kg")
MODULE = """
    import abc
    import functools
    import math
    import numpy as np

    TABLE = np.array([{number}, 2.0])

    def helper(x):
        return {factor} * x * TABLE[0] + math.sin(0)

    def deep(gain):
        def inner(time, measured):
            return gain * helper(measured[:, 0]) if "y" in {{"x", "y", "z"}} else 0
        return inner

    def plain(time, measured, gain={default}):
        return gain * helper(measured[:, 0])

    class Loop(abc.ABC):
        __slots__ = ("tags", "gain")

        def __init__(self, gain):
            self.tags, self.gain = {{"a", "b", "c"}}, gain

        def __call__(self, time, measured):
            return self.gain * helper(measured[:, 0])

        def method(self, time, measured):
            return helper(measured[:, 0]) + self.gain

    KINDS = {{
        "function": plain,
        "closure": deep({gain}),
        "partial": functools.partial(plain, gain={gain}),
        "partial of a partial": functools.partial(functools.partial(plain), gain={gain}),
        "object": Loop({gain}),
        "method": Loop({gain}).method,
        "lambda": lambda time, measured: {gain} * plain(time, measured),
    }}
"""
SAME = {"number": 1.0, "factor": 2.0, "default": 3.0, "gain": 4.0}
PRINT = """
import importlib, runpy, sys
sys.path.insert(0, sys.argv[1])
from uqmbd.dynamics.control.shipped import Shipped
if sys.argv[2] == "import":
    KINDS = importlib.import_module("loop_code").KINDS
else:
    KINDS = runpy.run_path(sys.argv[1] + "/loop_code.py", run_name="__main__")["KINDS"]
print(*(Shipped(f, "c").digest() for f in KINDS.values()), sep=chr(10))
"""


def digests(folder, how="import", seed="0", **numbers):
    """Digests in a process of its own, by kind of function."""
    text = textwrap.dedent(MODULE).format(**{**SAME, **numbers})
    (folder / "loop_code.py").write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", PRINT, str(folder), how]
    found = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return found.stdout.split()


@pytest.mark.slow
@pytest.mark.parametrize("how", ["import", pytest.param("as a script", marks=pytest.mark.slow)])
def test_digests_are_the_same_in_every_process_and_change_with_the_code(how, tmp_path):
    first = digests(tmp_path, how)
    assert len(first) == 7
    assert digests(tmp_path, how, seed="7") == first
    for change in ({"number": 1.5}, {"factor": 2.5}):
        assert not set(digests(tmp_path, how, **change)) & set(first), change


GAINS = {"low": np.array([1.0, 2.0]), "high": np.array([1.0, 2.5])}


def proportional(time, measured, gain):
    return gain * measured[:, 0]


class Proportional:
    def __init__(self, gain):
        self.gain = gain

    def __call__(self, time, measured):
        return np.max(self.gain) * measured[:, 0]

    def commands(self, time, measured):
        return self(time, measured)


@pytest.mark.parametrize(
    "made",
    [
        lambda gain: functools.partial(proportional, gain=gain),
        lambda gain: functools.partial(functools.partial(proportional), gain=gain),
        lambda gain: lambda time, measured: np.max(gain) * measured[:, 0],
        Proportional,
        lambda gain: Proportional(gain).commands,
        lambda gain: functools.partial(Proportional(gain).commands),
    ],
)
def test_what_a_function_holds_is_part_of_its_digest(made):
    low, same, high = (Shipped(made(gain), "c").digest() for gain in (GAINS["low"], GAINS["low"].copy(), GAINS["high"]))
    assert low == same != high


def test_code_behind_a_partial_is_part_of_its_digest():
    """The code and the helpers of the function within, not the name alone."""

    def of(text):
        space = {"__name__": "__main__"}
        exec(textwrap.dedent(text), space)  # as in a notebook: there is no source
        return Shipped(functools.partial(space["f"], gain=1), "c").digest()

    one = "def f(time, measured, gain):\n    return gain * measured[:, 0]"
    assert of(one) == of(one)
    assert of(one) != of(one.replace("gain *", "gain +"))
    helped = "def h(x):\n    return 2 * x\ndef f(time, measured, gain):\n    return h(measured[:, 0])"
    assert of(helped) != of(helped.replace("2 * x", "3 * x"))


SCRIPT = """
    import functools
    import numpy as np
    import uqmbd

    def control(time, measured, gain):
        return gain * measured[:, 0]

    class Loop:
        def control(self, time, measured):
            return control(time, measured, 2.0)

    function = {function}
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    mechanism.body("cart", mass=1)
    mechanism.output("x", mechanism.bodies["cart"].position, units="m")
    study = uqmbd.Study("cart", mechanism, [0, 1])
"""


@pytest.mark.thorough
@pytest.mark.parametrize("function", ["functools.partial(control, gain=2.0)", "functools.partial(Loop().control)"])
def test_a_partial_of_a_script_can_be_called_in_another_process(function, tmp_path, monkeypatch):
    """Its module cannot be imported there."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    script = tmp_path / "a_script_of_a_user.py"
    script.write_text(textwrap.dedent(SCRIPT).replace("{function}", function), encoding="utf-8")
    load_study(script)
    module = next(m for m in list(sys.modules.values()) if str(getattr(m, "__file__", "")) == str(script))
    packed = tmp_path / "packed"
    packed.write_bytes(pickle.dumps(Shipped(module.function, "c")))
    call = f"import pickle, numpy as n; print(pickle.load(open({str(packed)!r}, 'rb')).function(0, n.ones((1, 1))))"
    found = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, cwd=tmp_path)
    assert found.stdout.strip() == "[2.]", found.stderr


def cart(function, **options):
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    body = mechanism.body("cart", mass=MASS)
    options = {"measured": ["x"], "commanded": ["push"], "rate": 20, "function": function} | options
    controller = mechanism.add(uqmbd.Controller(**options))
    mechanism.add(PointForce("push", body, 0, controller.command()))
    mechanism.output("x", body.position, units="m")
    return mechanism


def push(time, measured):
    return 10.0 - measured[:, 0]


@pytest.mark.thorough
def test_limits_and_states_are_part_of_the_model_to_the_last_digit():
    """Also the table of a spline, which the text of an expression leaves out."""
    limits = [
        (0, 1),
        (0, 1 + 1e-15),
        (0, uqmbd.spline([0, 1, 3], [1, 2, 4])(MASS)),
        (0, uqmbd.spline([0, 1, 3], [1, 2, 5])(MASS)),
    ]
    method = Collocation(order=1)

    def digest(**options):
        return uqmbd.Study("cart", cart(push, **options), [0, 1]).problem(method).model.digest

    assert len({digest(limits=pair) for pair in limits}) == len(limits)
    assert digest(limits=limits[3]) == digest(limits=limits[3])
    assert len({digest(initial=value) for value in (0.1, 0.1 + 1e-16)}) == 2


@pytest.mark.thorough
def test_a_study_with_another_function_in_a_partial_is_not_resumed(tmp_path):
    times, method = [0, 0.5, 1], MonteCarlo(samples=4, seed=1)

    def run(function, folder=None):
        study = uqmbd.Study("cart", cart(function), times, [method])
        tree = study.run(folder=folder, resume=True) if folder else study.run()
        return tree["monte-carlo/statistics"]["mean"].values

    stored = run(weak, tmp_path)
    assert np.array_equal(run(weak, tmp_path), stored)
    with pytest.warns(uqmbd.StudyWarning, match="belong to another study"):
        found = run(strong, tmp_path)
    assert np.array_equal(found, run(strong)) and not np.allclose(run(strong), stored)


def of_target(time, measured, target):
    return 8 * (target - measured[:, 0])


def of_target_too(time, measured, target):
    return 80 * (target - measured[:, 0])


weak, strong = (functools.partial(f, target=1.0) for f in (of_target, of_target_too))
