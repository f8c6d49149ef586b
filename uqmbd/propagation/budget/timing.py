"""Measure the computing time of a few realisations on this machine."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.propagation.budget.sized import TOGETHER
from uqmbd.propagation.methods import Propagator, Studied, run_method
from uqmbd.propagation.problem import Problem

__all__ = ["Timing", "first_problem", "timing_of"]

GROWTH, MOST = 8, 512
"""Growth factor, and maximum, of the number of timed realisations."""

FIRST = 4.0
"""Ratio of the time limit of the second measurement to `limit`: the first one mostly measures the cost of a chunk."""

MOST_PER_NODE = 30.0
"""Maximum cost of a node, in realisations, of a method that solves for all nodes together."""


@dataclass(frozen=True)
class Timing:
    """Measured computing time of realisations."""

    each: float  # time of a realisation in one process, s
    count: int  # number of realisations that were timed together

    def seconds(self, propagator: Propagator, study: Studied, limit: float = 0.5) -> float:
        """Return the predicted time of a method, s; NaN if unknown.

        For the prediction, a method that solves for all nodes together runs at its smallest size. If this run is
        expected to take more than `limit` seconds, it is omitted, and the result is NaN.
        """
        estimate = propagator.estimate(study)
        if estimate is None:
            return np.nan
        if not estimate.together:
            return self.each * estimate.realisations
        sizing = propagator.sizing(study, None)
        if sizing is None or (least := sizing.at(sizing.least)).estimate(study) is None:
            return np.nan
        cost = least.estimate(study).realisations
        if MOST_PER_NODE * cost * self.each > limit:
            return np.nan
        for _ in range(2):  # the first run compiles
            begin = time.perf_counter()
            run_method(least, study.problem(least), check=False)
            took = time.perf_counter() - begin
        return float(took * (estimate.realisations / cost) ** TOGETHER)


def timing_of(
    study: Any, propagator: Propagator, limit: float = 0.3, clock: Callable[[], float] | None = None
) -> Timing | None:
    """Time realisations of a study: first one at the means, for compilation, then increasing numbers.

    Return None if no realisation can be computed. `propagator` is the method of the timed realisations. `limit` is the
    approximate time limit, s; a single realisation may exceed it.
    """
    found, clock = None, clock or time.perf_counter
    with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = first_problem(study, propagator)
        problem.realise(problem.inputs.means[None, :])
        points = np.random.default_rng(0).random((MOST, len(problem.inputs)))
        values, count, spent, before = problem.inputs.from_uniform(points), 1, 0.0, 0.0
        while count <= MOST:
            begin = clock()
            problem.realise(values[:count])
            took = clock() - begin
            spent += took
            found = Timing(took / count, count)
            # a realisation takes less time together with others than alone, and two sizes show the difference
            if count == 1:
                expected, most = GROWTH * took, FIRST * limit
            else:
                expected, most = took + GROWTH * max(took - before, 0.0), limit
            if spent + expected > most:
                break
            count, before = count * GROWTH, took
    return found


def first_problem(study: Any, propagator: Propagator) -> Problem:
    """Return the problem of the first realisations of a method."""
    problem: Problem = study.problem(propagator)
    if problem.model.outputs.names:
        return problem
    return problem.of_requirements() if problem.model.scalars is None else problem.without_time()
