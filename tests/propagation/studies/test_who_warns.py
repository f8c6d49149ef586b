"""Redundant equations are warned of once by whoever uses a mechanism first, and warnings of others stay."""

from __future__ import annotations

import concurrent.futures
import warnings
from collections.abc import Callable

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

METHODS = [MonteCarlo(samples=4, seed=1), Collocation(order=1, verify=2)]


def pendulum() -> uqmbd.Study:
    """A pendulum on two hinges about one axis, five equations of which are redundant."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=(0.1, 0.1, 0.1), position=(length, 0, 0))
    for name, place in (("front", 0.1), ("back", -0.1)):
        mechanism.add(
            Revolute(
                name, mechanism.ground, rod, (0, place, 0), (-length, place, 0), axis_i=(0, 1, 0), axis_j=(0, 1, 0)
            )
        )
    mechanism.output("height", rod.position[2], units="m")
    mechanism.require("low", rod.position[2] <= 0.1)
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 0.2, 5), METHODS)


def calibrated(study: uqmbd.Study) -> object:
    record = Record("run 1", [Series("height", study.times[1:], -4.9 * study.times[1:] ** 2, "m", noise=0.01)])
    return calibrate(study, record, seed=1, draws=100, progress=False)


def redundant(use: Callable[[], object]) -> int:
    """Count the warnings of redundant equations."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        use()
    return sum(issubclass(one.category, uqmbd.RedundantConstraintWarning) for one in told)


USES: list[tuple[str, Callable[[uqmbd.Study], object]]] = [
    ("problem", lambda study: study.problem(METHODS[0])),
    ("run", lambda study: study.run()),
    ("propagate", lambda study: study.propagate(METHODS[1])),
    ("simulate", lambda study: uqmbd.simulate(study.mechanism, study.times)),
]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "use"), [*USES, ("calibrate", calibrated)], ids=lambda one: one if isinstance(one, str) else ""
)
def test_each_use_warns_once(name: str, use: Callable[[uqmbd.Study], object]) -> None:
    assert redundant(lambda: use(pendulum())) == 1


@pytest.mark.thorough
def test_a_problem_warns_again_where_the_mechanism_has_changed() -> None:
    study = pendulum()
    assert redundant(lambda: study.problem(METHODS[0])) == 1
    assert redundant(lambda: study.problem(METHODS[1])) == 0
    study.mechanism.output("twice", 2 * study.mechanism.bodies["rod"].position[0], units="m")
    assert redundant(lambda: study.problem(METHODS[0])) == 1
    assert redundant(study.run) == 1
    assert redundant(lambda: study.problem(METHODS[0])) == 0


@pytest.mark.thorough
def test_who_lists_findings_is_not_reported_again() -> None:
    study = pendulum()
    assert redundant(lambda: uqmbd.findings(study)) == 0
    assert redundant(lambda: study.problem(METHODS[0])) == 0


@pytest.mark.thorough
def test_models_that_are_made_in_threads_leave_filters_as_they_are() -> None:
    """`catch_warnings` is of the process: made in two threads it may leave the filters of one of them for ever."""
    studies = [pendulum() for _ in range(8)]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        before = list(warnings.filters)
        with concurrent.futures.ThreadPoolExecutor(4) as threads:
            made = [threads.submit(lambda study=study: study.model) for study in studies]
            warnings.warn("of another thread", UserWarning, stacklevel=1)
            assert all(one.result() is not None for one in made)
        assert warnings.filters == before
    assert ["of another thread"] == [str(one.message) for one in told]
