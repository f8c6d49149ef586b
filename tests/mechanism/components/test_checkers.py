"""mypy and pyright know the arguments of all components, and what results are: they pass right calls, and refuse each
mistake at its line.

The calls are generated from the declarations, so that a new component is checked, too.
"""

from __future__ import annotations

import atexit
import functools
import importlib.util
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.mechanism.components.world_pose import KEYWORDS, replaced
from uqmbd.new import new_plugin

ROOT = Path(__file__).parents[3]
PACKAGES = {path.name for path in (ROOT / "plugins").iterdir()}

BEGIN = '''
from typing import assert_type

import chaospy
import numpy as np
import sympy
import uqmbd
import uqmbd.results
import xarray as xr
from uqmbd.typing import Array
from uqmbd_calibration import Record, Series
{imports}

length = uqmbd.RandomVariable("length", chaospy.Uniform(1, 2), units="m")
mechanism = uqmbd.Mechanism("any", uqmbd.Spatial())
body = mechanism.body("body", mass=1, inertia=(1, 1, 1))
other = mechanism.body("other", mass=length, inertia=(1, 1, 1), position=(length, 0, 2 * length))


class Untyped(uqmbd.Component):
    """Declared without annotations."""

    bodies = ("body",)
    strength = uqmbd.Parameter("N", "strength")
    reach = uqmbd.Parameter("m", "reach", default=1)


part = Untyped("part", body, 3)
tree = uqmbd.Study("any", mechanism, [0, 1]).run()
chaos = uqmbd.results.surrogate(tree["collocation"], "x")
'''

NUMBERS = (
    "2",
    "0.5",
    "length",
    "2 * length",
    "sympy.Rational(1, 3)",
    "np.float64(2)",
    "np.int64(3)",
    "body.velocity[0]",
)
VECTORS = (
    "(1, 0, 0)",
    "[length, 0, 1.5]",
    "np.zeros(3)",
    "sympy.Matrix([1, 2, 3])",
    "body.position",
    "(length, -length)",
)

ALSO_RIGHT = """
Untyped("part", body, strength=3, reach=length)
(length * 2).diff(length)
(2 * length).diff(length)
mechanism.add(part).reaction_force[0] * 2
mechanism.require("limit", 2 * length <= body.position[0])
sum(x**2 for x in body.point((1, 0, 0)) - other.position)
mechanism.body("third", mass=np.float64(2), inertia=np.eye(3), rotation=sympy.eye(3), com=[0, 0, length])
Record("run", [Series("angle", [0, 0.1], (1.0, 0.9), "rad")], known={"speed": 10}).series[0].values.max()
Record("run", (Series("angle", np.zeros(0), np.ones(3), "rad", noise=0.1),), machine="rig").known["speed"] + 1
assert_type(tree, xr.DataTree)
assert_type(uqmbd.results.open("results.nc"), xr.DataTree)
assert_type(uqmbd.simulate(mechanism, [0, 1]), xr.Dataset)
assert_type(uqmbd.results.output(tree, "x"), xr.Dataset)
assert_type(uqmbd.results.output(tree["collocation"], "x"), xr.Dataset | xr.DataArray)
assert_type(uqmbd.results.output(tree["collocation"], "x")["std"], xr.DataArray)
assert_type(uqmbd.results.output(tree["collocation/statistics"].dataset["std"].sel(time=1), "x"), xr.DataArray)
assert_type(uqmbd.results.by_output(tree["collocation"], "std"), xr.Dataset)
assert_type(uqmbd.results.Accessor(tree).output("x"), xr.Dataset | xr.DataArray)
assert_type(chaos.evaluate(length=[1, 1.5]), xr.DataArray)
assert_type(chaos.evaluate(np.zeros((2, 1))), Array)
assert_type(chaos.to_xarray(), xr.Dataset)
uqmbd.to_frame(tree["collocation"], "x").plot()
uqmbd.samples_to_frame(tree["monte-carlo"], times=1).plot()
uqmbd.to_arviz(tree["collocation"]).children
tree["collocation"].uqmbd.surrogate().evaluate(length=1.2)
"""

ALSO_WRONG = """
mechanism.body("third", mas=1, inertia=(1, 1, 1))
mechanism.body("third", mass="heavy", inertia=(1, 1, 1))
mechanism.add(body)
uqmbd.RandomVariable("length", chaospy.Uniform(1, 2), unit="m")
Record("run", Series("angle", [0, 0.1], [1.0, 0.9], "rad"))
Record("run", [Series("angle", [0, 0.1], units="rad")])
Series("angle", body, [1.0, 0.9], "rad")
uqmbd.results.output("results.nc", "x")
uqmbd.results.output(tree, 3)
uqmbd.results.surrogate(tree["collocation"].dataset)
uqmbd.to_frame(tree.to_dataset())
chaos.evaluat(length=1)
"""


@functools.cache
def example():
    """Write a package of somebody else's, for as long as the tests run; return the folder of its sources."""
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    new_plugin("magnet", "component", Path(folder))
    return Path(folder, "magnet", "src")


def components():
    """All that are registered by packages of this repository, and that of a package of somebody else's."""
    registered = [plugins.component(name) for name in sorted(plugins.components())]
    found = [x for x in registered if x.__module__.partition(".")[0] in PACKAGES]
    specification = importlib.util.spec_from_file_location("magnet.component", example() / "magnet" / "component.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return [*found, module.Magnet]


def values(parameter, number):
    """What may be given, in Python."""
    if parameter.kind == "option" and parameter.choices:
        words = [repr(x) for x in parameter.words]
        return words[number % len(words)]
    if parameter.kind in ("scalar", "option"):
        return NUMBERS[number % len(NUMBERS)]
    return VECTORS[number % len(VECTORS)]


def mistakes(parameter):
    """What may not."""
    if parameter.kind == "option" and parameter.choices:
        # names that packages register are known when the study runs
        return [*([] if parameter.registered else ["'no such word'"]), "3", "body"]
    return ["'text'", "body", "part", *(["(1, 0, 0)"] if parameter.kind == "scalar" else [])]


def needed(component, words):
    """Arguments that must be given where some are given in the world: names, by values."""
    gone = {x for word in words for x in replaced(component, word)}
    found = {x: ("body", "other", "mechanism.ground")[k % 3] for k, x in enumerate(component.bodies)}
    found = {x: value for x, value in found.items() if x not in component.grounded}
    for k, (key, parameter) in enumerate(component.parameters().items()):
        if parameter.required and key not in gone and parameter.kind != "turning_axis":
            found[key] = values(parameter, k)
    return found | dict.fromkeys(words, VECTORS[len(words)])


def call(component, given):
    return f"{component.__name__}('name', {', '.join(f'{key}={value}' for key, value in given.items())})"


def poses(component):
    """Sets of keywords in the world."""
    known = [word for word in KEYWORDS if replaced(component, word)]
    return [words for n in range(len(known) + 1) for words in itertools.combinations(known, n)]


def right(component):
    bodies = [x for x in component.bodies if x not in component.grounded]
    parameters = component.parameters()
    for shift in range(len(NUMBERS)):
        every = [values(x, k + shift) for k, x in enumerate(parameters.values())]
        yield f"{component.__name__}('name', {', '.join(['body'] * len(bodies) + every)})"
        by_name = dict.fromkeys(bodies, "body") | dict(zip(parameters, every, strict=True))
        yield call(component, by_name | dict.fromkeys(component.grounded, "other"))
    for words in poses(component):
        yield call(component, needed(component, words))


def wrong(component):
    usual = needed(component, ())
    yield call(component, usual | {"no_such_argument": "1"})
    yield call(component, usual).replace("('name', ", "(")
    yield call(component, usual).replace("('name', ", "(3, ")
    for body in component.bodies:
        for mistake in ("'body'", "part", "mechanism", "(0, 0)"):
            yield call(component, usual | {body: mistake})
    for key, parameter in component.parameters().items():
        for mistake in mistakes(parameter):
            yield call(component, usual | {key: mistake})
    for words in poses(component):
        given = needed(component, words)
        for missing in given:
            if missing not in words or any(
                component.parameters()[x].kind != "turning_axis" for x in replaced(component, missing)
            ):
                yield call(component, {key: value for key, value in given.items() if key != missing})
        for word in words:
            yield call(component, given | {word: "'text'"})
            for twice in replaced(component, word):
                if component.parameters()[twice].kind != "turning_axis":
                    yield call(component, given | {twice: "(1, 0, 0)"})
    for word in set(KEYWORDS) - {word for words in poses(component) for word in words} - component.parameters().keys():
        yield call(component, usual | {word: "(1, 0, 0)"})


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """A script with right calls and one with wrong ones; the numbers of the lines of these."""
    found = components()
    imports = "\n".join(f"from {x.__module__.partition('.')[0]} import {x.__name__}" for x in found)
    begin = BEGIN.format(imports=imports)
    folder = tmp_path_factory.mktemp("checked")
    lines = [*ALSO_RIGHT.strip().splitlines(), *(line for x in found for line in right(x))]
    (folder / "right.py").write_text(begin + "\n".join([*lines, ""]))
    lines = [*ALSO_WRONG.strip().splitlines(), *(line for x in found for line in dict.fromkeys(wrong(x)))]
    (folder / "wrong.py").write_text(begin + "\n".join([*lines, ""]))
    first = len(begin.splitlines()) + 1
    return folder, dict(enumerate(lines, first))


def run(words, folder):
    path = [str(x) for x in (ROOT, ROOT / "plugins", example())]
    environment = {**os.environ, "MYPYPATH": os.pathsep.join(path)}
    return subprocess.run(
        [sys.executable, "-m", *words], capture_output=True, text=True, check=False, cwd=folder, env=environment
    )


def by_mypy(folder):
    """Errors as a plain mypy tells them: file, line, message."""
    options = ["--config-file=", "--ignore-missing-imports", "--check-untyped-defs", "--no-error-summary"]
    cache = ROOT / ".mypy_cache" / "scripts"  # that of `.ci/run`, with the same options
    done = run(["mypy", *options, f"--cache-dir={cache}", "--output=json", "right.py", "wrong.py"], folder)
    assert done.returncode in (0, 1) and not done.stderr, done.stdout + done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    # the sources of uqmbd, which the path makes part of what is checked, are checked elsewhere, and strictly
    return [(x["file"], x["line"], x["message"]) for x in found if x["severity"] == "error" and "/" not in x["file"]]


def by_pyright(folder):
    """Errors as a plain pyright tells them; it is told where the packages are, which here are not installed."""
    pytest.importorskip("pyright")
    settings = {"extraPaths": [str(x) for x in (ROOT, ROOT / "plugins", example())]}
    (folder / "pyrightconfig.json").write_text(json.dumps(settings))
    done = run(["pyright", "--outputjson", "--pythonpath", sys.executable], folder)
    found = json.loads(done.stdout)["generalDiagnostics"]
    return [
        (Path(x["file"]).name, x["range"]["start"]["line"] + 1, x["message"]) for x in found if x["severity"] == "error"
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("check", [by_mypy, pytest.param(by_pyright, marks=pytest.mark.slow)])
def test_right_calls_pass_and_each_mistake_is_found_at_its_line(check, scripts):
    folder, lines = scripts
    found = check(folder)
    sources = (folder / "right.py").read_text().splitlines()
    assert [(sources[line - 1], message) for file, line, message in found if file == "right.py"] == []
    refused = {line for file, line, _ in found if file == "wrong.py"}
    assert [text for line, text in lines.items() if line not in refused] == []
    assert refused <= set(lines)
    assert len(lines) > 20 * len(components())


def test_there_are_mistakes_of_every_kind():
    """What the other test counts on: calls that run are right, and the wrong ones are refused when they run."""
    mechanism = uqmbd.Mechanism("any", uqmbd.Spatial())
    body, other = (mechanism.body(name, mass=1, inertia=(1, 1, 1)) for name in ("body", "other"))
    revolute = plugins.component("Revolute")
    assert (
        call(revolute, needed(revolute, ("at",))) == "Revolute('name', body_i=body, body_j=other, at=[length, 0, 1.5])"
    )
    mechanism.add(revolute("hinge", body, other, at=(0, 0, 0), axis=(0, 0, 1)))
    calls = list(wrong(revolute))
    assert "Revolute('name', body_i=body, body_j=other)" in calls
    assert any("no_such_argument" in text for text in calls) and any("body_i='body'" in text for text in calls)


def test_every_package_says_that_it_has_types():
    folders = [ROOT / "uqmbd", *(ROOT / "plugins").glob("uqmbd_*"), *(ROOT / "tests" / "thirdparty").glob("*/uqmbd_*")]
    assert len(folders) > 10
    assert [str(x) for x in folders if (x / "__init__.py").exists() and not (x / "py.typed").exists()] == []
