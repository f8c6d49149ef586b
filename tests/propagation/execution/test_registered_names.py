"""A name that a plugin registers does not identify its code: stored models and chunks belong to the code."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.plugins import KINDS
from uqmbd_contact import PlaneContact
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0.0, 0.2, 5)

SOURCES = {
    "components": """
import uqmbd
class Push(uqmbd.Component):
    bodies = ("body",)
    def terms(self, p):
        yield uqmbd.VirtualWork(FACTOR, p.body.point_velocity((0, 0))[0])
""",
    "contact_laws": """
from uqmbd_contact import ContactLaw, depth, stiffness
class Soft:
    name = "mine"
    def law(self):
        return ContactLaw(FACTOR * stiffness * depth)
""",
    "integrators": """
import numpy as np
from uqmbd.extend import Counters, Trajectories
class Drift:
    name = "mine"
    def integrate(self, ensemble, times, rtol):
        state = ensemble.start.state
        states = state[:, None] + FACTOR * (times - times[0])[None, :, None] * np.ones_like(state)[:, None]
        return Trajectories(times, states, ("",) * len(state), Counters())
""",
    "designs": """
import numpy as np
class Even:
    name = "mine"
    independent = extendable = True
    def points(self, dimension, numbers, seed):
        return (np.arange(numbers.start, numbers.stop)[:, None] * 0.37 * FACTOR + 0.1 * np.ones((1, dimension))) % 1
""",
    "propagators": """
import numpy as np
import uqmbd
from uqmbd.extend import statistics_dataset
def task(model, number):
    return {"value": np.array([FACTOR * number])}
class Mine(uqmbd.extend.Propagator):
    name = "mine"
    def propagate(self, problem):
        value = sum(float(a["value"][0]) for a in problem.run(task, [(1.0,), (2.0,)]))
        shape = (len(problem.labels.outputs), len(problem.times))
        data = statistics_dataset(problem.labels, mean=np.full(shape, value), std=np.ones(shape))
        return problem.node(self, data, realisations=2, wall_time=0.0)
""",
}
"""Source of a class by kind of plugin, in which FACTOR is a number."""

WITHOUT = {"readers", "report_sections", "checks", "surrogates", "exporters", "commands"}
"""Kinds whose classes compute no numbers that an unfinished run or the cache of models stores."""


def registered_as(kind: str, factor: float, patch: pytest.MonkeyPatch) -> type:
    """Register the class of a kind, with a number in its code."""
    scope: dict[str, Any] = {"__name__": "plugin_of_others"}
    exec(compile(SOURCES[kind].replace("FACTOR", repr(factor)), "plugin_of_others.py", "exec"), scope)  # noqa: S102 - source of this test
    cls: type = [x for x in scope.values() if isinstance(x, type) and x.__module__ == "plugin_of_others"][-1]
    found = plugins.registry.registered()
    classes: dict[str, dict[str, type]] = {**found.classes, kind: {**found.classes[kind], "mine": cls}}
    registry = plugins.Registry(found.plugins, classes)
    patch.setattr(plugins.registry, "registered", lambda: registry)
    return cls


def content(kind: str, cls: type, folder: Path, *, resume: bool = False) -> tuple[bytes, int]:
    """Run a study with a class; return the bits of its results, and the number of stored files."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    begin = uqmbd.RandomVariable("begin", chaospy.Uniform(1, 2), units="m")
    ball = mechanism.body("ball", mass=1, position=(begin, 0.95), velocity=(0.3, 0))
    if kind == "contact_laws":
        given: dict[str, Any] = {"law": "mine", "stiffness": 100.0}
        mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), radius=1.0, **given))
    if kind == "components":
        mechanism.add(cls("push", ball))
    mechanism.output("x", ball.position[0] + ball.position[1], units="m")
    sampling = "mine" if kind == "designs" else "random"
    method = cls() if kind == "propagators" else MonteCarlo(samples=6, seed=1, sampling=sampling)
    study = uqmbd.Study("ball", mechanism, TIMES, [method], integrator="mine" if kind == "integrators" else "auto")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        tree = study.run(folder=folder, resume=resume)
    found = tree["mine" if kind == "propagators" else "monte-carlo"]["statistics"].to_dataset()["mean"].values.tobytes()
    return found, len(list(folder.rglob("*.npz")))


def test_every_kind_of_plugin_is_considered() -> None:
    assert set(SOURCES) | WITHOUT == set(KINDS)
    assert not set(SOURCES) & WITHOUT


@pytest.mark.thorough
@pytest.mark.parametrize("kind", SOURCES)
def test_stored_numbers_belong_to_the_code_of_a_registered_class(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "cache"))
    first = content(kind, registered_as(kind, 1.0, monkeypatch), tmp_path / "run")
    again = content(kind, registered_as(kind, 1.0, monkeypatch), tmp_path / "run", resume=True)
    assert again == first, "the same code continues the run"
    other = registered_as(kind, 1.5, monkeypatch)
    resumed, files = content(kind, other, tmp_path / "run", resume=True)
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "other cache"))
    fresh, _ = content(kind, other, tmp_path / "fresh")
    assert resumed == fresh != first[0]
    assert files > first[1]
