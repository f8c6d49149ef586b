"""The Monte Carlo propagator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import sample_dataset, statistics_of_samples

__all__ = ["MonteCarlo"]


@dataclass(frozen=True, kw_only=True)
class MonteCarlo(uqmbd.Propagator):
    """Sample the inputs at random and compute each realisation.

    Parameters
    ----------
    samples : int
        How many.
    seed : int
        Of the random numbers: the same seed gives the same bits, whatever the number of workers.
    max_failures : float
        Share of failed samples above which the run is an error.
    label : str, optional
        Name of the results, by default ``monte-carlo``.

    Examples
    --------
    >>> MonteCarlo(samples=500, seed=1).samples
    500
    """

    name: ClassVar[str] = "monte-carlo"
    samples: int = 500
    seed: int = 0
    max_failures: float = 0.5

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or self.samples < 2:
            raise uqmbd.StudyError(f"MonteCarlo: samples is {self.samples!r}; expected a whole number, 2 or more.")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise uqmbd.StudyError(f"MonteCarlo: seed is {self.seed!r}; expected a whole number, 0 or more.")
        if not 0 <= self.max_failures <= 1:
            raise uqmbd.StudyError(
                f"MonteCarlo: max_failures is {self.max_failures!r}; expected a share between 0 and 1."
            )

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Tell that there is nothing to sample."""
        return None if len(study.mechanism.inputs) else _nothing_random(study.mechanism.name)

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Sample, compute, and summarise."""
        if not len(problem.inputs):
            raise uqmbd.StudyError(f"{problem.label}: {_nothing_random(problem.mechanism)}")
        uniform = np.random.default_rng(self.seed).random((self.samples, len(problem.inputs)))
        # 0 itself would map to minus infinity
        values = problem.inputs.from_uniform(np.clip(uniform, 2.0**-54, 1 - 2.0**-53))
        found = problem.realise(values)
        if found.failures > self.max_failures * self.samples or self.samples - found.failures < 2:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {self.samples} samples failed, more than max_failures = "
                f"{self.max_failures:g} allows or fewer than two are left. "
                f"Most frequent reason: {found.most_frequent_reason()}"
            )
        samples = sample_dataset(found.response, values, problem.labels, status=found.status, messages=found.messages)
        return problem.node(
            self,
            statistics_of_samples(samples),
            samples,
            realisations=self.samples,
            wall_time=found.wall_time,
            counters=found.counters,
        )


def _nothing_random(mechanism: str) -> str:
    return f"nothing in mechanism {mechanism!r} is random; declare a uqmbd.RandomVariable, or use uqmbd.simulate."
