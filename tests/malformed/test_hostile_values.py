"""Public calls with one impossible argument: they are refused with a message of uqmbd, or accepted and then usable.

The calls are those of the examples in docstrings, and of a table; all other arguments are right.  Each argument is
replaced by values of `hostile.HOSTILE` in turn.  The small test holds the cases that were found; the sweep over all
public names is slow.  It tries an eighth of the values for each argument; ``UQMBD_MALFORMED_SHARE=1`` tries all.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections import Counter

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.testing.components.cases import component_cases

from .hostile import HOSTILE, hostile, used
from .public_calls import LEFT_OUT, MODULES, examples_of, targets
from .right_calls import EXAMPLES
from .test_text_is_not_run import PLUGINS, adding, kind, public_names
from .texts import SHARE, Probe, probes, variants

OWN = ("refused", "accepted")

PLAIN = {
    **{
        f"{name}(vector {k})": (name, k)
        for name, count in (
            *(("aligned", 3), ("joint_frames", 2), ("perpendiculars", 1), ("quaternion_product", 2)),
            *(("relative_quaternion", 2), ("smallest_rotation", 2)),
        )
        for k in range(count)
    },
}
RIGHT = {
    "aligned": ((1, 0, 0, 0), (0, 0, 1), (0, 0, 1)),
    "joint_frames": ((0, 0, 1), (0, 0, 1)),
    "perpendiculars": ((0, 0, 1),),
    "quaternion_product": ((1, 0, 0, 0), (1, 0, 0, 0)),
    "relative_quaternion": ((1, 0, 0, 0), (1, 0, 0, 0)),
    "smallest_rotation": ((1, 0, 0), (0, 1, 0)),
}
FITTING = {"empty list", "empty array", "flat array", "empty dict"}
"""Rotations where nothing turns have no components."""


@pytest.mark.parametrize("call", PLAIN)
def test_helpers_on_rotations_refuse_what_is_no_vector(call):
    name, place = PLAIN[call]
    for key, value in HOSTILE.items():
        given = list(RIGHT[name])
        given[place] = value
        if (key == "range" and len(RIGHT[name][place]) == 3) or key in FITTING:
            continue  # (0, 1, 2) is a vector
        with pytest.raises(uqmbd.StudyError):
            getattr(uqmbd.extend, name)(*given)


def _falling():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    mechanism.output("x", mechanism.body("b", mass=1).position[0])
    return mechanism


OPTIONS = {
    "times": {"half", "1e307", "empty list", "list", "range"},
    "rtol": {"half"},
    "max_step": {"half", "1e307", "None"},
    "breaks": {"empty list", "empty array", "empty dict", "list", "nan in list", "range", "empty text"},
}


@pytest.mark.parametrize("option", OPTIONS)
def test_options_of_a_simulation_refuse_what_is_none(option):
    for key in sorted(HOSTILE.keys() - OPTIONS[option] - {"set"}):
        with pytest.raises(uqmbd.StudyError, match=option):
            uqmbd.simulate(_falling(), **{"times": [0, 1], option: HOSTILE[key]})


@pytest.mark.parametrize(
    "masked", [np.ma.masked_array([0.0, 1.0, 2.0], mask=[0, 1, 0]), np.ma.masked], ids=["one", "all"]
)
def test_masked_numbers_are_nowhere_taken_as_what_is_below_the_mask(masked):
    mechanism = _falling()
    for make in (
        lambda: uqmbd.simulate(mechanism, masked),
        lambda: uqmbd.Study("s", mechanism, masked),
        lambda: uqmbd.Study("s", mechanism, [0, 2], report_times=masked),
        lambda: uqmbd.simulate(mechanism, [0, 2], breaks=masked),
        lambda: uqmbd.spline([0, 1, 2], masked),
        lambda: uqmbd.spline(masked, [0, 1, 2]),
        lambda: mechanism.body("c", mass=masked),
        lambda: mechanism.body("c", mass=1, position=masked),
        lambda: mechanism.output("y", masked),
        lambda: uqmbd.maximum(masked),
        lambda: uqmbd.laws.law_values(masked, sympy.Symbol("x")),
    ):
        with pytest.raises(uqmbd.StudyError):
            make()


@pytest.mark.parametrize("value", [1j, sympy.I, 2 + 3j, sympy.sqrt(-2) * sympy.Symbol("x")], ids=str)
def test_a_law_is_real(value):
    with pytest.raises(uqmbd.StudyError, match="law is"):
        uqmbd.laws.law_values(value, sympy.Symbol("x"))


@pytest.mark.parametrize(
    "value", [float("nan"), float("inf"), "5", b"5", None, [], 1.5, 1j, {}, np.ma.masked, ()], ids=repr
)
def test_a_total_is_a_whole_number(value):
    with pytest.raises(uqmbd.StudyError, match="AtMost: the total is"):
        uqmbd.extend.AtMost(value)
    assert uqmbd.extend.AtMost(np.int64(5)) + 1 == 6


GIVEN = {
    "raising": ("of the function that is given",),
    "class": (
        *("dict expected at most", "cannot convert dictionary update sequence", "unhashable type"),
        *("'int' object is not iterable", "'float' object is not iterable"),
    ),
    "function": ("len() takes exactly", "object of type 'int' has no len()", "object of type 'float' has no len()"),
}
"""Errors of the functions that are given, by the value: they are raised as they are, with the lines of these."""


def _raw(found: list[Probe]) -> list[str]:
    return [
        f"{x.call}({x.argument}=<{x.payload}>): {x.fate}: {x.message}"
        for x in found
        if x.fate not in OWN and not x.message.startswith(GIVEN.get(x.payload, ()))
    ]


def _adding(component, mechanism):
    """Return what adds a component of some values to a mechanism, and returns the mechanism."""
    add = adding(component, mechanism)

    def added(**values):
        add(**values)
        return mechanism

    return added


@pytest.mark.slow
@pytest.mark.parametrize(
    "component",
    [
        x
        for module in PLUGINS
        for x in public_names(module).values()
        if isinstance(x, type) and issubclass(x, uqmbd.Component)
    ],
    ids=lambda x: x.__name__,
)
def test_a_component_refuses_hostile_values_or_can_be_simulated(component, tmp_path):
    for space in component.spaces:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = next(component_cases(component, space, {}, np.random.default_rng(1)))
        part = case.component
        named = {**part.attached, **dict.fromkeys(part.parameters()), **part.given}

        found = list(
            variants(
                component.__name__,
                _adding(component, case.mechanism),
                (),
                named,
                tmp_path / "mark",
                {},
                hostile,
                used,
                SHARE,
            )
        )
        assert len(found) == len(named) * max(1, math.ceil(SHARE * len(HOSTILE)))
        assert not _raw(found)


@pytest.mark.slow
def test_the_sweep_calls_each_public_name_or_leaves_it_out_with_a_reason(tmp_path, monkeypatch):
    """By full names: methods of several classes may share a name."""
    monkeypatch.chdir(tmp_path)
    found = set()

    def seen(name: str) -> bool:
        found.add(name)
        return False

    for module in MODULES:
        for thing in public_names(module).values():
            if kind(thing) != "data":
                for _, text in examples_of(thing):
                    probes(text, dict(vars(sys.modules[thing.__module__])), tmp_path, seen)
    for text in EXAMPLES.values():
        probes(text, {}, tmp_path, seen)
    wanted = targets()
    assert len(wanted) > 500
    assert not [full for full, (owner, _) in wanted.items() if full not in found and owner not in LEFT_OUT]


@pytest.mark.slow
@pytest.mark.parametrize("module", [*MODULES, *EXAMPLES])
def test_public_calls_refuse_hostile_values_or_can_be_used(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wanted, calls = targets(), Counter()

    def first(name: str) -> bool:
        calls[name] += 1
        return calls[name] == 1 and name in wanted

    found: list[Probe] = []
    if module in EXAMPLES:
        found += probes(EXAMPLES[module], {}, tmp_path, first, hostile, used, SHARE)
    else:
        for thing in public_names(module).values():
            if kind(thing) != "data":
                for _, text in examples_of(thing):
                    found += probes(
                        text, dict(vars(sys.modules[thing.__module__])), tmp_path, first, hostile, used, SHARE
                    )
    print(module, Counter(x.fate for x in found))
    assert not _raw(found)
