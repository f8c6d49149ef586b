"""Plugins that do anything wrong anywhere: each is named, and costs nothing but itself."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import os
import signal
import subprocess
import sys
import textwrap
import time
import types

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import extend, plugins, report, results


class Odd(BaseException):
    """No exception of Python's own."""


class Mute(Exception):
    """An error whose text cannot be made."""

    def __str__(self):
        raise RuntimeError("not even this")


ERRORS = {
    kind.__name__: kind
    for kind in (
        RuntimeError, SystemExit, KeyboardInterrupt, GeneratorExit, StopIteration, MemoryError, RecursionError, Odd, Mute
    )
}  # fmt: skip

HOOKS = {
    "uqmbd_components": "components",
    "uqmbd_propagators": "propagators",
    "uqmbd_integrators": "integrators",
    "uqmbd_report_sections": "report_sections",
}

PAIRS = list(itertools.product(ERRORS, HOOKS))


def fail(name):
    raise ERRORS[name]("as it was told")


def raising(name):
    return lambda: fail(name)


class Nasty(type):
    """A metaclass: looking at its classes raises."""

    def __getattribute__(cls, name):
        if name in ("name", "render", "__name__", "__mro__", "__abstractmethods__", "__repr__"):
            fail(type.__getattribute__(cls, "error"))
        return type.__getattribute__(cls, name)

    def __repr__(cls):
        fail(type.__getattribute__(cls, "error"))


class NastyList(list):
    """A list that raises when it is read."""

    def __init__(self, error):
        super().__init__([int])
        self.error = error

    def __iter__(self):
        fail(self.error)


def nasty(error, hook):
    base = {"uqmbd_components": uqmbd.Component, "uqmbd_propagators": object}.get(hook, object)
    if base is uqmbd.Component:
        return Nasty("Bad", (), {"error": error})
    return Nasty("Bad", (base,), {"error": error, "name": "bad"})


class Hidden:
    """What it is cannot be asked."""

    def __init__(self, error):
        self.__dict__["error"] = error

    @property
    def __class__(self):
        fail(self.error)

    def __repr__(self):
        fail(self.error)


class Compared(str):
    """A name that raises when it is compared."""

    __hash__ = str.__hash__

    def __eq__(self, other):
        raise RuntimeError("compared")


WRONG = {
    "nothing": lambda: None,
    "text": lambda: "Magnet",
    "number": lambda: 3,
    "mapping": lambda: {"Magnet": int},
    "generator": lambda: (cls for cls in [int]),
    "class": lambda: int,
    "nothing in a list": lambda: [None],
    "object in a list": lambda: [object()],
    "class of another kind": lambda: [types.SimpleNamespace],
    "list in a list": lambda: [[int]],
    "name of another kind": lambda: [
        type("Bad", (uqmbd.extend.Propagator,), {"name": Compared("bad"), "propagate": print})
    ],
    "name that is a number": lambda: [type("Bad", (uqmbd.extend.Propagator,), {"name": 3, "propagate": print})],
}


@dataclasses.dataclass
class Point:
    """An entry point."""

    name: str
    loaded: object
    value: str = "somewhere"
    dist: object = None

    def load(self):
        return self.loaded() if isinstance(self.loaded, types.FunctionType) else self.loaded


def plugin(**hooks):
    """Return a module with these hooks."""
    module = types.ModuleType("made")
    for name, function in hooks.items():
        setattr(module, name, uqmbd.hookimpl(function))
    return module


class Magnet(uqmbd.Component):
    bodies = ("body",)

    def terms(self, p):
        return ()


class Section:
    title = "Friction"

    def render(self, tree):
        return "<p>so much friction</p>"


class Integrator:
    name = "magic"

    def integrate(self, ensemble, times, rtol):
        return uqmbd.extend.Trajectories(times, np.zeros((len(ensemble), len(times), 4)), ("",) * len(ensemble))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Guess(uqmbd.extend.Propagator):
    name = "guess"

    def propagate(self, problem):
        return problem.node(self, None, realisations=0, wall_time=0.0)


GOOD = {
    "uqmbd_components": Magnet,
    "uqmbd_propagators": Guess,
    "uqmbd_integrators": Integrator,
    "uqmbd_report_sections": Section,
}


def giving(cls):
    return lambda: [cls]


def good():
    return plugin(**{hook: giving(cls) for hook, cls in GOOD.items()})


def check(make):
    """Load a good plugin between two bad ones, and return what is said of these."""
    points = [Point("a", make()), Point("b", good()), Point("c", make())]
    registry = plugins.load(points)
    infos = {info.name: info for info in registry.plugins}
    for hook in GOOD:
        expected = [getattr(GOOD[hook], "name", GOOD[hook].__name__) if hook in BY_NAME else GOOD[hook].__name__]
        assert list(registry.classes[HOOKS[hook]]) == expected, hook
    assert infos["b"].status == "loaded"
    assert infos["a"].errors == infos["c"].errors and infos["a"].errors
    assert infos["a"].status == "failed" and infos["a"].title.startswith("plugin 'a'")
    assert all(isinstance(error, str) for error in infos["a"].errors)
    return infos["a"].errors


BY_NAME = ("uqmbd_propagators", "uqmbd_integrators")


@pytest.mark.parametrize("error", ERRORS)
def test_import_that_raises(error):
    (said,) = check(lambda: raising(error))
    assert said.startswith(f"it cannot be loaded: {error}")


@pytest.mark.parametrize(("error", "hook"), PAIRS)
def test_hook_that_raises(error, hook):
    (said,) = check(lambda: plugin(**{hook: raising(error)}))
    assert said.startswith(f"its hook {hook} raised {error}")


@pytest.mark.parametrize(("error", "hook"), PAIRS)
@pytest.mark.parametrize("how", ["list", "class", "object", "object in a list"])
def test_object_that_raises_when_it_is_looked_at(error, hook, how):
    made = {
        "list": lambda: NastyList(error),
        "class": lambda: [nasty(error, hook)],
        "object": lambda: Hidden(error),
        "object in a list": lambda: [Hidden(error)],
    }[how]
    (said,) = check(lambda: plugin(**{hook: made}))
    assert f"its hook {hook} r" in said


@pytest.mark.parametrize("error", ERRORS)
def test_module_that_raises_when_it_is_looked_at(error):
    class Module:
        @property
        def uqmbd_components(self):
            fail(error)

    (said,) = check(Module)
    assert said


@pytest.mark.parametrize(("wrong", "hook"), list(itertools.product(WRONG, HOOKS)))
def test_hook_that_returns_the_wrong_kind_of_object(wrong, hook):
    if wrong.startswith("name of") and hook == "uqmbd_components":
        pytest.skip("components are known by the name of their class")
    registry = plugins.load([Point("a", plugin(**{hook: WRONG[wrong]})), Point("b", good())])
    bad, fine = registry.plugins
    assert fine.status == "loaded" and bad.status == "failed"
    (said,) = bad.errors
    assert said.startswith(f"its hook {hook} returned ")


KINDS = [*(("import", e) for e in ERRORS), *(("raise", e) for e in ERRORS), *(("return", w) for w in WRONG)]


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.sampled_from(list(HOOKS))), max_size=6), st.integers(0, 6))
@settings(max_examples=60, deadline=None)
def test_any_crowd_of_bad_plugins_leaves_the_good_one_alone(bad, place):
    points = []
    for k, ((kind, what), hook) in enumerate(bad):
        made = {
            "import": raising(what),
            "raise": plugin(**{hook: raising(what)}) if kind == "raise" else None,
            "return": plugin(**{hook: WRONG[what]}) if kind == "return" else None,
        }[kind]
        points.append(Point(f"bad{k}", made))
    points.insert(min(place, len(points)), Point("good", good()))
    registry = plugins.load(points)
    for info in registry.plugins:
        assert (info.status == "loaded") == (info.name == "good") == (not info.errors), info
    assert list(registry.classes["components"]) == ["Magnet"]


def test_ctrl_c_of_the_user_ends_the_program():
    """The signal arrives while a plugin is imported: it is no matter of the plugin."""
    # what runs in the background may ignore the signal
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def press():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1)

    try:
        with pytest.raises(KeyboardInterrupt):
            plugins.load([Point("slow", lambda: press())])
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


class Bad:
    """A section of a report that misbehaves as it is told."""

    def __init__(self, part, what):
        self.part, self.what = part, what

    @property
    def title(self):
        if self.part == "title":
            return self.what()
        return "Bad one"

    def render(self, tree):
        tree.attrs["study"] = "stolen"
        tree["comparison"].attrs.clear()
        del tree["mine"]
        return self.what() if self.part == "render" else "<p>fine</p>"


@pytest.fixture(scope="module")
def tree():
    axes = extend.labels([("x", "m")], [], [0.0, 1.0])
    statistics = extend.statistics_dataset(axes, mean=np.ones((1, 2)), std=np.ones((1, 2)))
    node = results.propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)
    return results.study_tree([node], study="crank", mechanism="crank")


SECTIONS = [
    *(
        pytest.param(p, functools.partial(fail, e), e, id=f"{p} raises {e}")
        for p in ("title", "render")
        for e in ERRORS
    ),
    *(
        pytest.param(part, lambda value=value: value, type(value).__name__, id=f"{part} is {value!r}")
        for part in ("title", "render")
        for value in (None, 3, b"text", ["text"], {})
    ),
]


@pytest.mark.thorough
def test_every_bad_section_is_named_and_costs_nothing_else(tree, tmp_path):
    """All in one report, which costs more than they do."""
    bad = [Bad(*case.values[:2]) for case in SECTIONS]
    before = tree.copy(deep=True)
    with pytest.warns(uqmbd.extend.PluginWarning) as told:
        page = report.write_report(tree, tmp_path / "r.html", sections=[*bad, Section()]).read_text(encoding="utf-8")
    assert tree.identical(before)
    assert "so much friction" in page and "stolen" not in page and "<title>crank" in page
    assert page.count("could not be written:") == len(bad) == len(told)
    for case, warning in zip(SECTIONS, told, strict=True):
        words = "out of memory" if case.values[2] == "MemoryError" else case.values[2]
        assert f"{__name__}.Bad" in str(warning.message) and words in str(warning.message)


PLUGIN = """
import uqmbd

class Unmade:
    title = "Unmade"
    def __init__(self):
        raise KeyboardInterrupt("no colours left")
    def render(self, tree):
        return ""

@uqmbd.hookimpl
def uqmbd_report_sections():
    return [Unmade]

@uqmbd.hookimpl
def uqmbd_components():
    raise SystemExit("bye")
"""


@pytest.mark.thorough
def test_installed_plugin_is_reported_by_its_name_on_the_command_line(tmp_path, tree):
    site = tmp_path / "site"
    for name, source in (("plugin_bad", PLUGIN), ("plugin_left", "raise KeyboardInterrupt")):
        info = site / f"{name}-1.0.dist-info"
        info.mkdir(parents=True)
        (site / f"{name}.py").write_text(textwrap.dedent(source))
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name.replace('_', '-')}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[uqmbd]\n{name} = {name}\n")
    results.save(tree, tmp_path / "results.nc")
    path = os.pathsep.join([str(site), *filter(None, sys.path)])
    environment = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-m", "uqmbd.cli"]

    def run(*words):
        return subprocess.run([*command, *words], capture_output=True, text=True, check=False, env=environment)

    listed = run("plugins")
    assert listed.returncode == 0, listed.stderr
    assert "plugin_left: it cannot be loaded: KeyboardInterrupt" in listed.stdout
    assert "plugin_bad: its hook uqmbd_components raised SystemExit: bye" in listed.stdout
    written = run("report", str(tmp_path))
    assert written.returncode == 0, written.stderr
    expected = "report section 'Unmade' of plugin 'plugin_bad' of plugin-bad 1.0 is omitted: KeyboardInterrupt"
    assert expected in written.stderr and "Traceback" not in written.stderr
    assert (tmp_path / "report.html").exists()
