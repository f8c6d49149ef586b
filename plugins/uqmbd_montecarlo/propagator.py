"""The Monte Carlo propagator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import xarray as xr

import uqmbd
from uqmbd.results import replicate_errors, sample_dataset, statistics_of_samples
from uqmbd_montecarlo.designs import replicate_sizes, uniform_samples
from uqmbd_montecarlo.gathering import Gathered, gather

__all__ = ["MonteCarlo"]

Sampling = Literal["random", "latin-hypercube", "sobol"]


@dataclass(frozen=True, kw_only=True)
class MonteCarlo(uqmbd.Propagator):
    """Sample the inputs and compute each realisation.

    Parameters
    ----------
    samples : int
        How many.
    seed : int
        Of the random numbers: the same seed gives the same bits, whatever the number of workers.
    sampling : {"random", "latin-hypercube", "sobol"}
        Independent points, Latin hypercubes, or scrambled Sobol' points.
    replicates : int
        Independent replicates into which a Latin hypercube or Sobol' design is split, for its standard errors.  Sobol'
        needs `replicates` times a power of two samples.
    max_failures : float
        Share of failed samples above which the run is an error.
    keep : int
        Samples that are kept in the results.  Where there are more, moments are gathered while they come, quantiles
        are those of the kept ones, and all samples go to ``LABEL-samples.nc`` in the folder of the run: the memory
        needed does not grow with the number of samples.
    label : str, optional
        Name of the results, by default ``monte-carlo``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Examples
    --------
    >>> MonteCarlo(samples=500, seed=1).sampling
    'random'
    """

    name: ClassVar[str] = "monte-carlo"
    samples: int = 500
    seed: int = 0
    sampling: Sampling = "random"
    replicates: int = 16
    max_failures: float = 0.5
    keep: int = 20_000

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or self.samples < 2:
            raise uqmbd.StudyError(f"MonteCarlo: samples is {self.samples!r}; expected a whole number, 2 or more.")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise uqmbd.StudyError(f"MonteCarlo: seed is {self.seed!r}; expected a whole number, 0 or more.")
        if self.sampling not in get_args(Sampling):
            known = ", ".join(map(repr, get_args(Sampling)))
            raise uqmbd.StudyError(f"MonteCarlo: sampling is {self.sampling!r}; expected one of {known}.")
        if not isinstance(self.replicates, int) or self.replicates < 2:
            raise uqmbd.StudyError(f"MonteCarlo: replicates is {self.replicates!r}; expected 2 or more.")
        if not 0 <= self.max_failures <= 1:
            raise uqmbd.StudyError(
                f"MonteCarlo: max_failures is {self.max_failures!r}; expected a share between 0 and 1."
            )
        if not isinstance(self.keep, int) or self.keep < 2:
            raise uqmbd.StudyError(f"MonteCarlo: keep is {self.keep!r}; expected a whole number, 2 or more.")
        replicate_sizes(self.sampling, self.samples, self.replicates)

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say what is in the way: a mechanism in which nothing is random."""
        return None if len(study.mechanism.inputs) else "nothing in the mechanism is random"

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Sample, compute, and summarise."""
        if not len(problem.inputs):
            raise uqmbd.StudyError(
                f"{problem.label}: nothing in mechanism {problem.mechanism!r} is random; "
                "declare a uqmbd.RandomVariable, or use uqmbd.simulate."
            )
        sizes = replicate_sizes(self.sampling, self.samples, self.replicates)
        values = problem.inputs.from_uniform(uniform_samples(self.sampling, sizes, len(problem.inputs), self.seed))
        found = gather(problem, values, sizes, self.keep)
        if found.failures > self.max_failures * self.samples or found.moments.count < 2:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {self.samples} samples failed, more than "
                f"max_failures = {self.max_failures:g} allows. "
                f"Most frequent reason: {found.reason}"
            )
        kept = found.kept
        samples = sample_dataset(kept.response, kept.values, problem.labels, status=kept.status, messages=kept.messages)
        statistics = statistics_of_samples(samples)
        if self.samples > self.keep:
            for name, value in found.moments.statistics().items():
                statistics[name] = statistics[name].copy(data=value)
            statistics["quantile"].attrs["comment"] = f"of the first {self.keep} of {self.samples} samples"
        if self.sampling != "random":
            errors = replicate_errors(found.replicates)
            for name, error in zip(("std_error_mean", "std_error_std"), errors, strict=True):
                statistics[name] = statistics[name].copy(data=error)
        return problem.node(
            self,
            statistics,
            samples,
            realisations=self.samples,
            wall_time=found.wall_time,
            counters=found.counters,
            attrs=self._about_the_kept(found),
        )

    def _about_the_kept(self, found: Gathered) -> dict[str, str | int]:
        """Say how the kept samples stand to all of them, where they are not the same."""
        if self.samples <= self.keep:
            return {}
        file = {"all_samples": found.file} if found.file else {}
        return {"failures": found.failures, "samples_kept": self.keep, **file}
