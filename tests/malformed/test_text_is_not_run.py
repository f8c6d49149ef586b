"""No text that is given as a number is executed, wherever it is given, and in whatever container.

SymPy executes texts as Python when it makes expressions of them: ``sympify``, ``Matrix``, functions, and operators with
a tuple, a set or a dict.  The oracle is a file that the texts would make.
"""

from __future__ import annotations

import ast
import inspect
import math
import os
import sys
import types
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.testing.components.cases import component_cases
from uqmbd_springs import Bushing, NonlinearSpringDamper, haversine_bump, sampled_road

from .texts import SHARE, Probe, payloads, probes, variants

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))
try:
    from uqmbd_site.names import CORE, PLUGINS, kind, public_names
    from uqmbd_site.names import owners as owners
finally:
    sys.path.remove(str(ROOT / "docs" / "_ext"))

MODULES = [module for module in (*CORE, *PLUGINS) if module not in ("uqmbd.testing", "uqmbd.typing")]
"""The kits of `uqmbd.testing` take classes and run studies with them: trying them takes long and tells nothing."""


TEXTS = min(1.0, 3 * SHARE)
"""Share of the texts and containers that the slow sweeps try for each argument."""

METHODS = (types.FunctionType, classmethod, staticmethod, property)


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Calls that take a path write below the working folder."""
    folder = tmp_path / "working"
    folder.mkdir()
    monkeypatch.chdir(folder)


def _line():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    return mechanism, mechanism.body("b", mass=1)


def _law(value):
    mechanism, body = _line()
    mechanism.add(NonlinearSpringDamper("s", mechanism.ground, body, 0, 0, law=value))


def _bushing(value):
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    body = mechanism.body("b", mass=1, inertia=1)
    mechanism.add(Bushing("s", mechanism.ground, body, (0, 0), (0, 0), stiffness=value))


CALLS = {
    "bump: height": lambda x: haversine_bump(x, 1),
    "bump: length": lambda x: haversine_bump(0.1, x),
    "bump: start": lambda x: haversine_bump(0.1, 1, start=x),
    "bump: along": lambda x: haversine_bump(0.1, 1, along=x),
    "road": lambda x: sampled_road([0, 1], x),
    "law": _law,
    "bushing": _bushing,
    "mass": lambda x: uqmbd.Mechanism("m", uqmbd.Line()).body("b", mass=x),
    "inertia": lambda x: uqmbd.Mechanism("m", uqmbd.Spatial()).body("b", mass=1, inertia=x),
    "rotation": lambda x: uqmbd.Mechanism("m", uqmbd.Spatial()).body("b", mass=1, inertia=(1, 1, 1), rotation=x),
    "angle": lambda x: uqmbd.Mechanism("m", uqmbd.Planar()).body("b", mass=1, inertia=1, angle=x),
    "output": lambda x: _line()[0].output("x", x),
    "start": lambda x: _line()[0].start(x),
    "maximum": uqmbd.maximum,
    "spline": lambda x: uqmbd.spline([0, 1], x),
    "argument of a spline": lambda x: uqmbd.spline([0, 1], [0, 1])(x),
    "nominal": uqmbd.nominal,
    "quaternions": lambda x: uqmbd.extend.quaternion_product(x, (1, 0, 0, 0)),
    "axes": lambda x: uqmbd.extend.smallest_rotation((1, 0, 0), x),
    "frames": lambda x: uqmbd.extend.joint_frames((1, 0, 0), x),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_text_in_place_of_a_number_is_refused_and_leaves_no_trace(name, tmp_path):
    mark = tmp_path / "mark"
    for key, value in payloads(mark).items():
        with pytest.raises(uqmbd.StudyError):
            CALLS[name](value)
        assert not mark.exists(), key


def test_the_texts_leave_a_trace_where_they_are_executed(tmp_path):
    mark = tmp_path / "mark"
    for key, value in payloads(mark).items():
        sympy.sympify(value if key != "set" else [*value])
        assert mark.exists(), key
        mark.unlink()


def test_the_search_finds_texts_that_are_executed(tmp_path):
    def naive(length, *, start=0):
        return sympy.sympify(length) - sympy.sympify(start)

    naive.__module__ = "uqmbd.naive"
    found = probes(">>> _ = naive(1)", {"naive": naive}, tmp_path, lambda name: name.startswith("uqmbd.naive"))
    assert len(found) == 2 * len(payloads(tmp_path))
    assert {(x.argument, x.payload) for x in found if x.fate != "executed"} <= {("0", "set"), ("start", "set")}


class _Mute(Exception):
    """Has no text."""

    def __str__(self) -> str:
        raise UnicodeError


def test_a_child_ends_with_its_variants_and_makes_no_variants_of_the_calls_in_it(tmp_path):
    def inner(value=0):
        return value

    def outer(then, value=0):
        then()
        if value != 0:
            raise _Mute
        return value

    calls = []

    def wanted(name):
        calls.append(name)
        return name.startswith("uqmbd.naive") and "outer" in name

    inner.__module__ = outer.__module__ = "uqmbd.naive"
    text = ">>> class C:\n...     def f(self):\n...         return inner(1)\n>>> _ = outer(C().f, 0)"
    for fate, values in {"_Mute": {"one": 1}, "accepted": {"zero": 0}, "died": {"end": _End()}}.items():
        found = probes(text, {"inner": inner, "outer": outer}, tmp_path, wanted, lambda _, given=values: given, _used)
        assert [(x.argument, x.fate) for x in found] == [("0", "TypeError"), ("1", fate)]
    # the parent asks about the call of the example and about the one inside of it
    assert [name.rpartition(".")[2] for name in calls] == ["outer", "inner"] * 3


class _End(int):
    """Ends the process when it is compared."""

    def __new__(cls) -> _End:
        return super().__new__(cls, 0)

    def __ne__(self, other: object) -> bool:
        os._exit(3)


def _used(made, names):
    """Do nothing with what a call returns."""


def _told(found: list[Probe]) -> list[str]:
    return [f"{x.call}({x.argument}=<{x.payload}>): {x.fate}: {x.message}" for x in found]


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES)
def test_no_argument_of_a_public_call_is_executed(module, tmp_path):
    calls: Counter[str] = Counter()

    def first(name: str) -> bool:
        calls[name] += 1
        return calls[name] == 1

    found: list[Probe] = []
    for thing in public_names(module).values():
        if kind(thing) == "data":
            continue
        known = dict(vars(sys.modules[thing.__module__]))
        own = vars(thing).items() if isinstance(thing, type) else ()
        methods = [x for key, x in own if not key.startswith("_") and isinstance(x, METHODS)]
        for owner in (thing, *methods):
            text = inspect.cleandoc(getattr(owner, "__doc__", "") or "")
            if ">>>" in text:
                found += probes(text, known, tmp_path, first, share=TEXTS)
    assert not _told([x for x in found if x.fate == "executed"])


def adding(component, mechanism):
    """Return what adds a component of some values to a mechanism."""

    def add(**values):
        return mechanism.add(component("other", **{k: x for k, x in values.items() if x is not None}))

    return add


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
def test_a_component_refuses_texts_in_place_of_its_numbers(component, tmp_path):
    for space in component.spaces:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = next(component_cases(component, space, {}, np.random.default_rng(1)))

        part = case.component
        named = {**part.attached, **dict.fromkeys(part.parameters()), **part.given}
        found = list(
            variants(
                component.__name__, adding(component, case.mechanism), (), named, tmp_path / "mark", {}, share=TEXTS
            )
        )
        assert len(found) == len(named) * math.ceil(TEXTS * len(payloads(tmp_path)))
        assert not _told([x for x in found if x.fate != "refused"])


def _loose(tree: ast.AST, *, strict: bool) -> list[int]:
    """Return lines that call SymPy's readers of texts; with `strict` not those that say ``strict=True``."""
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, (ast.Attribute, ast.Name))
        and getattr(node.func, "attr", getattr(node.func, "id", "")) in ("sympify", "parse_expr", "S", "nsimplify")
        and not (
            isinstance(node.func, ast.Attribute)
            and isinstance(node.func.value, ast.Name)
            and node.func.value.id == "se"
        )
        and not (strict and [ast.unparse(x) for x in node.keywords] == ["strict=True"])
    ]


def test_sympy_reads_values_of_users_in_one_function_only():
    """The core calls `sympy.sympify` in `as_symbolic`; plugins say ``strict=True``, of what was checked before."""
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for folder in ("uqmbd", "plugins")
        for path in (ROOT / folder).rglob("*.py")
        if path.name != "user_values.py"
        for line in _loose(ast.parse(path.read_text()), strict=folder == "plugins")
    }
    assert not found
    assert _loose(ast.parse("sympy.sympify(x)"), strict=True) == [1]
