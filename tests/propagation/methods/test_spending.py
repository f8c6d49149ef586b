"""One definition of what a method spends, whoever wrote it: measured by the run, in parts that add up, by a fake clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.errors import StudyError
from uqmbd.extend import statistics_dataset
from uqmbd.propagation.execution import CostClock
from uqmbd.propagation.execution.cost import PARTS, Spending
from uqmbd.propagation.methods import run_method
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import LowFidelity, MonteCarlo

NAMES = [f"wall_time_{part.replace(' ', '_')}" for part in (*PARTS, "other")]


@dataclass
class Fake(CostClock):
    """A clock that stands, but for what it is told; each reading takes a second where `step` is one."""

    now: float = 0.0
    step: float = 0.0
    waited: list[float] = field(default_factory=list)

    def __call__(self) -> float:
        self.now += self.step
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.waited.append(seconds)


@dataclass(frozen=True, kw_only=True)
class Slow(uqmbd.extend.Propagator):
    """A plugin that says of itself that it took no time, and spends it in parts."""

    name: ClassVar[str] = "slow"
    parts: tuple[tuple[str, float], ...] = ()

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        found = problem.realise(problem.inputs.means[None, :])
        for part, seconds in self.parts:
            if part == "other":
                problem.runner.clock.wait(seconds)
            else:
                with problem.timed(part):
                    problem.runner.clock.wait(seconds)
        mean = found.response[0]
        statistics = statistics_dataset(problem.labels, mean=mean, std=np.zeros_like(mean))
        return problem.node(self, statistics, realisations=1, wall_time=0.0)


def study(*, more: bool = False, scale: float = 1.0) -> uqmbd.Study:
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.9, 1.1), units="m/s")
    mechanism = uqmbd.Mechanism("line", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=0, velocity=speed)
    mechanism.output("place", scale * point.position[0], units="m")
    if more:
        mechanism.output("farthest", uqmbd.maximum(point.position[0]), units="m")
        mechanism.require("in reach", point.position[0] <= 1.05)
    return uqmbd.Study("line", mechanism, [0.0, 0.5, 1.0])


def run(method: uqmbd.extend.Propagator, clock: CostClock, **options: bool) -> xr.DataTree:
    return run_method(method, study(**options).problem(method).using(clock=clock))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([*PARTS, "other"]), st.floats(0, 1e6)), max_size=6))
def test_no_plugin_can_forget_what_it_spends(parts: list[tuple[str, float]]) -> None:
    """What a plugin says of itself does not count; the parts are those that it opens, and the rest is another one."""
    found = run(Slow(parts=tuple(parts)), Fake()).attrs
    for part, name in zip((*PARTS, "other"), NAMES, strict=True):
        assert found[name] == pytest.approx(sum(s for p, s in parts if p == part), rel=1e-9, abs=1e-9)
    assert found["wall_time"] == sum(found[name] for name in NAMES)
    assert found["wall_time"] == pytest.approx(sum(s for _, s in parts), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("method", "needed"),
    [
        (MonteCarlo(samples=20), {"integration", "error_estimation"}),
        (MonteCarlo(samples=16, sampling="sobol", replicates=2, keep=4), {"integration", "error_estimation"}),
        (Collocation(order=2), {"integration", "fitting", "error_estimation"}),
        (Collocation(order=1, elements=2), {"integration", "fitting", "error_estimation"}),
        (Galerkin(order=2), {"integration", "verification", "error_estimation"}),
        (MonteCarlo(samples=50, control=Collocation(order=1)), {"integration", "fitting", "error_estimation"}),
        (MonteCarlo(samples=50, control=LowFidelity(study(scale=1.1), samples=60)), {"integration"}),
    ],
)
def test_parts_of_every_method_add_up(method: uqmbd.extend.Propagator, needed: set[str]) -> None:
    """By a clock of which each reading takes a second: the whole is all readings, and each part has some."""
    clock = Fake(step=1.0)
    controlled = isinstance(getattr(method, "control", None), LowFidelity)
    node = run(method, clock, more=not controlled)
    assert node.attrs["wall_time"] == sum(node.attrs[name] for name in NAMES)
    # the first reading is the begin
    assert node.attrs["wall_time"] == pytest.approx(clock.now - 1.0)
    for part in needed:
        assert node.attrs[f"wall_time_{part}"] > 0, part
    if "scalars" in node.children:
        inner = node["scalars"].attrs
        assert 0 < inner["wall_time"] < node.attrs["wall_time"]
        assert inner["wall_time"] == sum(inner[name] for name in NAMES)


@settings(max_examples=100, deadline=None)
@given(st.recursive(st.floats(0, 100), lambda inner: st.tuples(st.sampled_from(PARTS), st.lists(inner, max_size=3))))
def test_parts_within_parts_are_exclusive(tree: object) -> None:
    """Each second belongs to the innermost part that is open, against a sum over the tree of what was waited."""
    clock, spending, expected = Fake(), Spending(), dict.fromkeys([*PARTS, "other"], 0.0)

    def walk(node: object, within: str) -> None:
        if isinstance(node, float):
            clock.wait(node)
            expected[within] += node
            return
        name, inner = node
        with spending.part(name, clock):
            for one in inner:
                walk(one, name)

    with spending.whole(clock) as found:
        walk(tree, "other")
    for part, name in zip((*PARTS, "other"), NAMES, strict=True):
        assert found[name] == pytest.approx(expected[part], rel=1e-9, abs=1e-9)


def test_realisations_belong_to_what_they_are_for() -> None:
    for part, whole in (("fitting", {"integration": 3.0, "fitting": 2.0}), ("verification", {"verification": 5.0})):
        clock, spending = Fake(), Spending()
        with spending.part(part, clock):
            clock.wait(3.0)
            spending.realised(3.0)
            clock.wait(2.0)
        assert {name: seconds for name, seconds in spending.seconds.items() if seconds} == whole


def test_a_part_that_there_is_not_is_refused() -> None:
    with pytest.raises(StudyError, match="part of the cost is 'fiting'; expected one of integration, fitting"):
        run(Slow(parts=(("fiting", 1.0),)), Fake())
