"""The plugin manager: what plugins offer is found, and a broken one harms nobody but itself."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import subprocess
import sys
import textwrap

import pytest

import uqmbd
from uqmbd import plugins


class FakeComponent(uqmbd.Component):
    """Base of the components in these tests: the manager looks at nothing but the type."""


class FakePropagator(uqmbd.extend.Propagator):
    """Base of the propagators in these tests."""

    def propagate(self, problem):
        raise NotImplementedError


@pytest.fixture
def bases(monkeypatch):
    # Where a plugin's code finds them.
    monkeypatch.setitem(sys.modules, "fake_bases", sys.modules[__name__])


@pytest.fixture
def install(tmp_path, monkeypatch, bases):
    """Install a plugin by hand, as pip would: a module and a `.dist-info` with its entry point; return the folder."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))

    def write(module, source, name=None, distribution=None, version="1.0"):
        (folder / f"{module}.py").write_text(textwrap.dedent(source))
        information = folder / f"{(distribution or module).replace('-', '_')}-{version}.dist-info"
        information.mkdir()
        (information / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {distribution or module}\nVersion: {version}\n"
        )
        (information / "entry_points.txt").write_text(f"[uqmbd]\n{name or module} = {module}\n")
        return folder

    yield write
    for path in folder.glob("*.py"):
        sys.modules.pop(path.stem, None)


@pytest.fixture
def loaded(tmp_path):
    """Load the plugins that `install` wrote, and no others."""

    def load(disabled=()):
        found = importlib.metadata.distributions(path=[str(tmp_path / "site")])
        entry_points = [point for one in found for point in one.entry_points if point.group == plugins.registry.GROUP]
        registry = plugins.load(entry_points, disabled)
        return registry, {info.name: info for info in registry.plugins}

    return load


GOOD = """
import fake_bases, uqmbd

class {component}(fake_bases.FakeComponent):
    pass

class Guess(fake_bases.FakePropagator):
    name = "{propagator}"

@uqmbd.hookimpl
def uqmbd_components():
    return [{component}]

@uqmbd.hookimpl
def uqmbd_propagators():
    return (Guess,)
"""


def good(component="Magnet", propagator="guess"):
    return GOOD.format(component=component, propagator=propagator)


def test_classes_are_registered_by_name(install, loaded):
    install("plugin_good", good(), distribution="good-plugin", version="2.1")
    registry, infos = loaded()
    assert list(registry.classes["components"]) == ["Magnet"]
    assert list(registry.classes["propagators"]) == ["guess"]
    info = infos["plugin_good"]
    assert (info.distribution, info.version, info.status) == ("good-plugin", "2.1", "loaded")
    assert info.hooks == ("uqmbd_components", "uqmbd_propagators")
    assert info.components == ("Magnet",) and info.propagators == ("guess",) and info.errors == ()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("raise RuntimeError('no licence found')", "it cannot be loaded: RuntimeError: no licence found"),
        ("import sys; sys.exit('bye')", "it cannot be loaded: SystemExit: bye"),
        ("import no_such_module_at_all", "it cannot be loaded: ModuleNotFoundError: No module named"),
        ("x = (", "it cannot be loaded: SyntaxError"),
        ("x = 1", "does not implement a hook; decorate its functions"),
        ("import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(a, b): return []", "it is not a valid plugin: "),
        (
            "import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_component(): return []",
            "the hook uqmbd_component, which does not exist",
        ),
        ("import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return 1 / 0", "raised ZeroDivisionError"),
        ("import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return 'Magnet'", "a sequence of classes is expected"),
        ("import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return [3]", "returned 3, which is not a class"),
        ("import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return [int]", "not a subclass of uqmbd.Component"),
        (
            "import uqmbd, fake_bases\n@uqmbd.hookimpl\ndef uqmbd_propagators(): return [fake_bases.FakePropagator]",
            "whose class attribute `name` is not a string",
        ),
    ],
)
def test_broken_plugin_is_reported_and_harms_nobody(install, loaded, source, reason):
    install("plugin_broken", source, distribution="broken-plugin", version="0.3")
    install("plugin_good", good())
    registry, infos = loaded()
    assert infos["plugin_broken"].status == "failed"
    (error,) = infos["plugin_broken"].errors
    assert reason in error
    assert infos["plugin_good"].status == "loaded" and "Magnet" in registry.classes["components"]


def test_a_hook_of_several_that_is_not_decorated_is_reported(install, loaded):
    install("plugin_half", good().replace("@uqmbd.hookimpl\ndef uqmbd_propagators", "def uqmbd_propagators"))
    registry, infos = loaded()
    assert infos["plugin_half"].status == "incomplete" and list(registry.classes["components"]) == ["Magnet"]
    (error,) = infos["plugin_half"].errors
    assert "its function uqmbd_propagators is not decorated with uqmbd.hookimpl" in error


def test_the_reason_says_where_it_comes_from(install, loaded):
    install("plugin_broken", "\n\nraise RuntimeError('no licence found')\n")
    _, infos = loaded()
    assert "plugin_broken.py, line 3" in infos["plugin_broken"].errors[0]


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("name = 'leap'", "which has no method integrate(ensemble, times, rtol)"),
        ("name = 'ida'\n    def integrate(self, e, t, r): pass", "whose name 'ida' is that of an integrator of uqmbd"),
        (
            "name = 'leap'\n    events = 'yes'\n    def integrate(self, e, t, r): pass",
            "class attribute `events` is 'yes'",
        ),
        (
            "name = 'leap'\n    projected = True\n    def integrate(self, e, t, r): pass",
            "no method integrate_projected(",
        ),
    ],
)
def test_integrators_that_cannot_be_used(install, loaded, body, problem):
    install(
        "plugin_leap",
        f"import uqmbd\nclass Leap:\n    {body}\n@uqmbd.hookimpl\ndef uqmbd_integrators():\n    return [Leap]\n",
    )
    registry, infos = loaded()
    assert registry.classes["integrators"] == {} and infos["plugin_leap"].status == "failed"
    assert problem in infos["plugin_leap"].errors[0]


def test_integrators_declare_what_they_can(install, loaded):
    source = "import uqmbd\nclass Leap:\n    name = 'leap'\n    events = True\n    def integrate(self, e, t, r): pass\n"
    install("plugin_leap", source + "@uqmbd.hookimpl\ndef uqmbd_integrators():\n    return [Leap]\n")
    registry, infos = loaded()
    assert list(registry.classes["integrators"]) == ["leap"] and infos["plugin_leap"].errors == ()


def test_name_that_is_taken_stays_with_the_first(install, loaded):
    install("plugin_b", good(propagator="other"))
    install("plugin_a", good())
    registry, infos = loaded()
    assert infos["plugin_a"].status == "loaded" and infos["plugin_b"].status == "incomplete"
    assert registry.classes["components"]["Magnet"].__module__ == "plugin_a"
    assert infos["plugin_b"].propagators == ("other",) and infos["plugin_b"].components == ()
    expected = "the component name 'Magnet' is already taken by the plugin 'plugin_a' of plugin_a 1.0"
    assert infos["plugin_b"].errors == (expected,)


def test_entry_points_of_two_packages_may_be_called_alike(install, loaded):
    install("plugin_a", good(), name="extra")
    install("plugin_b", good("Brake", "other"), name="extra")
    registry, _ = loaded()
    assert sorted(registry.classes["components"]) == ["Brake", "Magnet"]
    assert [info.status for info in registry.plugins] == ["loaded", "loaded"]


@pytest.mark.parametrize("name", ["plugin_good", "plugin-good", "Good.Plugin", "good-plugin"])
def test_disabled_plugin_is_not_loaded(install, loaded, name):
    install("plugin_good", good(), distribution="good-plugin")
    registry, infos = loaded([name])
    assert infos["plugin_good"].status == "disabled"
    assert registry.classes["components"] == {} and "plugin_good" not in sys.modules


def test_damaged_metadata_is_no_obstacle(install, loaded):
    folder = install("plugin_good", good())
    (folder / "plugin_good-1.0.dist-info" / "METADATA").unlink()
    registry, _ = loaded()
    assert [info.status for info in registry.plugins] == ["loaded"]


def test_problems_become_warnings_once(install, monkeypatch):
    install("plugin_broken", "raise RuntimeError('no licence found')", distribution="broken-plugin", version="0.3")
    monkeypatch.setattr(plugins.registry, "registered", functools.cache(plugins.registry.registered.__wrapped__))
    found = list(importlib.metadata.distribution("broken-plugin").entry_points)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found)
    with pytest.warns(
        uqmbd.extend.PluginWarning, match="plugin 'plugin_broken' of broken-plugin 0.3: .*no licence found"
    ):
        plugins.components()
    plugins.components()  # a second warning would be an error here


def test_unknown_name_lists_what_is_installed(install, loaded, monkeypatch):
    install("plugin_good", good())
    install("plugin_broken", "raise RuntimeError('no licence found')")
    registry, _ = loaded()
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)
    with pytest.raises(uqmbd.StudyError) as caught:
        plugins.propagator("gess")
    text = str(caught.value)
    assert "The propagator 'gess' is not installed. Installed: guess." in text
    assert "Could not be loaded completely: plugin 'plugin_broken'" in text
    assert plugins.propagator("guess") is registry.classes["propagators"]["guess"]
    with pytest.raises(uqmbd.StudyError, match="The integrator 'magic' is not installed. Installed: none."):
        plugins.integrator("magic")


def test_result_cannot_be_changed_from_outside(install, loaded, monkeypatch):
    install("plugin_good", good())
    registry, _ = loaded()
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)
    plugins.components().clear()
    assert list(plugins.components()) == ["Magnet"]


def run_python(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**os.environ, **environment}
    ).stdout


def test_importing_uqmbd_imports_no_plugin():
    code = "import sys, uqmbd, uqmbd.plugins; print([name for name in sys.modules if name.startswith('uqmbd_')])"
    assert run_python(code).strip() == "[]"


@pytest.mark.thorough
def test_built_in_plugins_are_found_by_their_entry_points():
    code = """
import uqmbd.plugins
print(*(f"{info.name}={info.status}" for info in uqmbd.plugins.installed() if info.distribution == "uqmbd"))
"""
    names = [
        "calibration",
        "collocation",
        "contact",
        "drivers",
        "flexible",
        "fmi",
        "galerkin",
        "geometry",
        "joints",
        "models",
        "monte-carlo",
        "processes",
        "reliability",
        "springs",
    ]
    assert run_python(code).split() == [f"{name}=loaded" for name in names]
    found = run_python(code, UQMBD_DISABLE_PLUGINS="springs, joints").split()
    assert found == [f"{name}={'disabled' if name in ('joints', 'springs') else 'loaded'}" for name in names]
