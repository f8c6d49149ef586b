"""The Monte Carlo propagator."""

from __future__ import annotations

import warnings
from collections import Counter
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import (
    Violations,
    replicate_errors,
    sample_dataset,
    statistics_dataset,
    statistics_of_samples,
    with_reasons,
)
from uqmbd.results import PolynomialChaos
from uqmbd_montecarlo.all_samples import AllSamples, Passing, Stored, together
from uqmbd_montecarlo.control import FOLDS, LEAST_SAMPLES
from uqmbd_montecarlo.controlledsums import ControlledSums
from uqmbd_montecarlo.gain import of_study, of_surrogate
from uqmbd_montecarlo.gathering import Gathered, gather
from uqmbd_montecarlo.lowfidelity import (
    LowFidelity,
    PairedControl,
    check_samples,
    further_realisations,
    mismatch,
)
from uqmbd_montecarlo.pickfreeze import obstacle_of
from uqmbd_montecarlo.replicates import (
    allowed_pairs,
    allowed_samples,
    paired_samples,
    replicate_sizes,
    uniform_samples,
)
from uqmbd_montecarlo.sensitivity import SobolRun, rows_at_once, run_sobol
from uqmbd_montecarlo.surrogate import ChaosControl, ControlSurrogate, surrogate_of

__all__ = ["MonteCarlo"]

FIRST = 64
"""Samples, or four in each replicate, with which a search for their number begins."""


@dataclass(frozen=True, kw_only=True)
class MonteCarlo(uqmbd.extend.Propagator):
    """Sample the inputs and compute each realisation.

    Parameters
    ----------
    samples : int
        How many.
    seed : int
        Of the random numbers: the same seed gives the same bits, whatever the number of workers.
    sampling : str
        Name of a sampling design: ``"random"``, independent points; ``"latin-hypercube"``; ``"sobol"`` or ``"halton"``,
        scrambled points; or one of a plugin.
    replicates : int
        Independent replicates into which a design is split whose points are not independent, for its standard errors.
        Sobol' needs `replicates` times a power of two samples.
    max_failures : float
        Share of failed samples above which the run is an error; fewer are a warning.
    keep : int
        Samples that are kept in the results.  Where there are more, statistics are those of all nevertheless, and the
        memory needed does not grow with the number of samples.  All samples go to ``LABEL-samples.zarr`` in the folder
        of the run, from which quantiles are found; in a run without a folder they are counted while the samples come,
        and ``quantile_error`` bounds how far they may be off.
    control : uqmbd.extend.Propagator, uqmbd.results.PolynomialChaos, LowFidelity or uqmbd.Study, optional
        A surrogate as control variate, which makes mean and standard deviation more certain: a method that gives a
        polynomial chaos, as ``Collocation(order=3)``, which is run first, on realisations of its own; or a chaos that
        is there already; or a cheaper study (`LowFidelity`; a study alone is ``LowFidelity(study)``), which is computed
        at the samples, and as often besides as pays.  For random sampling and 50 samples at least.  The estimates stay
        unbiased however poor the control is, for its factors are cross-fitted in ten parts of the samples.  Where
        samples fail, the statistics are those of the inputs that do not.  The other statistics (skewness, kurtosis,
        quantiles) are those of the samples.
    sobol_indices : bool
        Estimate Sobol' indices of first order and total ones, with 95 % jackknife intervals, by pick-freeze: the
        samples are taken as N = `samples` / 2 pairs, and N realisations more are computed for each input. These are N
        (d + 2) in all for d inputs, of which at most `keep` are in memory at once. For inputs that do not depend on
        each other. If points depend on each other (Sobol', Halton, Latin hypercube), the pairs are the halves of the
        coordinates of points in 2 d dimensions. Intervals then come from its replicates. The other statistics are those
        of the samples, of random sampling the same as without this option. An output that does not happen in some
        realisations has statistics, and no indices (NaN, with the reason): given that it happens inputs are not
        independent.
    label : str, optional
        Name of the results, by default ``monte-carlo``.

    Warns
    -----
    UserWarning
        In a run, if realisations fail: how many, and the most frequent reason; if a control does not pay.

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
    requirements: ClassVar[bool] = True
    samples: Annotated[int, uqmbd.extend.Bounds(2, 10**9)] = 500
    seed: Annotated[int, uqmbd.extend.Bounds(0)] = 0
    sampling: str = "random"
    replicates: Annotated[int, uqmbd.extend.Bounds(2, 10**9)] = 16
    max_failures: Annotated[float, uqmbd.extend.Bounds(0, 1)] = 0.5
    keep: Annotated[int, uqmbd.extend.Bounds(2, 10**9)] = 20_000
    control: uqmbd.extend.Propagator | PolynomialChaos | LowFidelity | uqmbd.Study | None = None
    sobol_indices: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        independent = uqmbd.extend.sampling_design(self.sampling, "MonteCarlo: sampling").independent
        replicate_sizes(self.sampling, self.samples, self.replicates)
        if isinstance(self.control, uqmbd.Study):
            object.__setattr__(self, "control", LowFidelity(self.control))
        self._check_control()
        self._check_pairs(independent)
        if self.control is not None and not independent:
            raise uqmbd.StudyError(
                "MonteCarlo: control needs independent samples, for its errors come from them one by one; "
                f"sampling is {self.sampling!r}, expected 'random'."
            )

    def _check_pairs(self, independent: bool) -> None:
        if not self.sobol_indices:
            return
        if independent and (self.samples % 2 or self.samples < 4):
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; sobol_indices needs an even number, 4 or more: it takes them "
                "as pairs."
            )
        below = allowed_pairs(self.sampling, self.samples, self.replicates)
        if below != self.samples:
            base = max(uqmbd.extend.sampling_design(self.sampling).base, 1)
            above = below * base if base > 1 else below + 2 * self.replicates
            power = f" and a power of {'two' if base == 2 else base}" if base > 1 else ""
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; sobol_indices takes them as pairs, and {self.replicates} "
                f"replicates of the design {self.sampling!r} need a number that is {2 * self.replicates} times a whole "
                f"number{power}. Take {below}{'' if below > self.samples else f' or {above}'}."
            )

    def _check_control(self) -> None:
        if self.control is None:
            return
        if not isinstance(self.control, (uqmbd.extend.Propagator, PolynomialChaos, LowFidelity)):
            raise uqmbd.StudyError(
                f"MonteCarlo: control is {self.control!r}; expected a propagator that gives a polynomial chaos, e.g. "
                "Collocation(order=3), a uqmbd.results.PolynomialChaos, or a cheaper study, e.g. LowFidelity(study)."
            )
        if self.samples < LEAST_SAMPLES:
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; a control needs {LEAST_SAMPLES} at least, for its factors are "
                f"fitted to {FOLDS} parts of them."
            )
        if isinstance(self.control, LowFidelity):
            check_samples(self.control, self.samples)

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Count realisations, and the memory of the stored samples."""
        values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
        inputs = len(study.mechanism.inputs)
        kept, total = min(self.samples, self.keep), self.samples
        # the samples, and what is sorted for their quantiles
        memory = 8 * kept * (3 * values + inputs)
        if self.sobol_indices:
            total += self.samples // 2 * inputs
            memory += 8 * rows_at_once(self.samples // 2, inputs, self.keep) * (inputs + 2) * (values + inputs)
        disk = 8 * (kept if self.samples <= kept else kept + self.samples) * (values + inputs)
        found = uqmbd.extend.Estimate(total, memory, f"{kept} stored samples", disk=disk)
        if isinstance(self.control, LowFidelity):
            # its realisations are none of this study, and how many pay is known from the samples
            besides = f"{self.control.samples or self.samples}{'' if self.control.samples else ' or more'}"
            return replace(found, detail=f"{found.detail}; besides {besides} realisations of {self.control!r}")
        control = self.control.estimate(study) if isinstance(self.control, uqmbd.extend.Propagator) else None
        if control is None:
            return found
        most = max(found.memory, control.memory)
        return replace(found, realisations=total + control.realisations, memory=most, at_most=control.at_most)

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing:
        """Return the choice of the number of samples."""

        def allowed(samples: int) -> int:
            if self.sobol_indices:
                return allowed_pairs(self.sampling, samples, self.replicates)
            return allowed_samples(self.sampling, samples, self.replicates)

        independent = uqmbd.extend.sampling_design(self.sampling, "MonteCarlo: sampling").independent
        return uqmbd.extend.Sizing(
            option="samples",
            at=lambda samples: replace(self, samples=samples),
            least=allowed(FIRST if independent else max(FIRST, 4 * self.replicates)),
            allowed=allowed,
            extends=independent,
        )

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return the obstacle: nothing random in the mechanism, or an impossible option."""
        inputs = study.mechanism.inputs
        if reason := uqmbd.extend.nothing_random(inputs, study.mechanism.name):
            return reason
        if isinstance(self.control, uqmbd.extend.Propagator) and (found := self.control.obstacle(study)):
            return f"its control {self.control.name!r}: {found}"
        if isinstance(self.control, LowFidelity):
            mechanism, times = study.mechanism, study.times
            if not (names := (*mechanism.outputs, *mechanism.scalars)):
                return "a study controls outputs, and there are none besides requirements"
            units = {variable.name: variable.units for variable in inputs.variables}
            if found := mismatch(self.control.study, units, names, times):
                return found
        return obstacle_of(inputs) if self.sobol_indices else None

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Sample, compute, and summarise."""
        self._check_problem(problem)
        if self.samples <= self.keep or problem.folder is not None:
            return self._propagated(problem, None)
        with closing(Passing(problem.labels, again=self.sobol_indices)) as passing:
            return self._propagated(problem, passing)

    def _propagated(self, problem: uqmbd.extend.Problem, passing: Passing | None) -> xr.DataTree:
        sizes, pairs = replicate_sizes(self.sampling, self.samples, self.replicates), None
        if self.sobol_indices:
            about = (self.sampling, self.samples, self.replicates, len(problem.inputs), self.seed)
            uniform, *pairs = paired_samples(*about)
        else:
            uniform = uniform_samples(self.sampling, sizes, len(problem.inputs), self.seed)
        values = problem.inputs.from_uniform(uniform)
        surrogate = paired = sums = None
        if isinstance(self.control, LowFidelity):
            paired = PairedControl(self.control, self, problem, values)
            sums = ControlledSums(paired, self.samples)
        elif isinstance(self.control, uqmbd.extend.Propagator) or (
            isinstance(self.control, PolynomialChaos) and not problem.timeless
        ):
            # a chaos of outputs over time says nothing of those without
            surrogate = surrogate_of(self.control, problem)
            sums = ControlledSums(ChaosControl(surrogate.chaos, uniform), self.samples)
        watching = [one.add for one in (sums, passing) if one is not None]
        with nullcontext() if paired is None else closing(paired):
            found = gather(problem, values, sizes, self.keep, together(watching) if watching else None)
        few = min(found.count, int(np.count_nonzero(found.kept.good))) < 2
        if few or found.failures > self.max_failures * self.samples:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {self.samples} samples failed, more than "
                f"max_failures = {self.max_failures:g} allows. "
                f"Most frequent reason: {found.reason}"
            )
        kept = found.kept
        samples = sample_dataset(
            kept.response,
            kept.values,
            problem.labels,
            status=kept.status,
            messages=kept.messages,
            copy=False,
            kind="draws",
        )
        everything = passing if found.store is None else Stored(found.store, problem.labels)
        statistics = self._statistics(problem, samples, found, everything)
        attrs: dict[str, Any] = {}
        if sums is not None and surrogate is not None:
            statistics = sums.apply(statistics)
            attrs = of_surrogate(statistics, surrogate)
        if sums is not None and paired is not None:
            left = sums.left()
            if count := further_realisations(paired.control, self.samples, left):
                # the samples are of the first child of this seed, and Sobol' indices of the second
                seed = np.random.SeedSequence(self.seed, spawn_key=(2,))
                statistics = sums.apply(statistics, paired.further(count, seed))
            attrs = of_study(statistics, paired, problem, self.samples, left, found.wall_time)
        if found.failures:
            warnings.warn(
                f"{problem.label}: {found.failures} of {self.samples} realisations failed; the statistics are those of "
                f"the others. Most frequent reason: {found.reason or 'an output is not finite'}",
                stacklevel=2,
            )
        sobol = None
        if pairs is not None:
            again = everything.responses if everything else lambda first, last: kept.response[first:last]
            replicates = len(sizes) if len(sizes) > 1 else 0
            sobol = run_sobol(problem, values, (pairs[0], pairs[1]), again, self.keep, self.max_failures, replicates)
            for name, why in sobol.without.items():
                warnings.warn(
                    f"{problem.label}: output {name!r} has no Sobol' indices: {why}. Take later times, or a quantity "
                    "that each realisation has, as uqmbd.maximum.",
                    uqmbd.StudyWarning,
                    stacklevel=2,
                )
        if sobol is not None and sobol.failures:
            warnings.warn(
                f"{problem.label}: {sobol.failures} of {sobol.realisations} further realisations for Sobol' "
                f"indices failed; {sobol.dropped} rows are omitted. Most frequent reason: "
                f"{sobol.reason or 'an output is not finite'}",
                stacklevel=2,
            )
        if sobol is not None:
            statistics = statistics.merge(sobol.variables, compat="equals", join="exact")
        return self._node(problem, statistics, samples, found, surrogate, paired, sobol, attrs)

    def _check_problem(self, problem: uqmbd.extend.Problem) -> None:
        problem.require_random()
        if not self.sobol_indices:
            return
        if obstacle := obstacle_of(problem.inputs):
            raise uqmbd.StudyError(f"{problem.label}: sobol_indices cannot be estimated: {obstacle}.")

    def _statistics(
        self, problem: uqmbd.extend.Problem, samples: xr.Dataset, found: Gathered, everything: AllSamples | None
    ) -> xr.Dataset:
        independent = uqmbd.extend.sampling_design(self.sampling).independent
        if everything is None:
            statistics = statistics_of_samples(samples, independent=independent, each=problem.runner.each)
        else:
            known: dict[str, Any] = found.moments.statistics(independent=independent) | everything.statistics()
            statistics = statistics_dataset(problem.labels, **known)
        if not independent:
            with problem.timed("error estimation"):
                errors = replicate_errors(found.replicates)
            for name, error in zip(("std_error_mean", "std_error_std"), errors, strict=True):
                statistics[name] = statistics[name].copy(data=error)
                # samples fail as a whole, but an output may be without an error alone
                outputs = zip(problem.labels.outputs, error, strict=True)
                lacking = [output.name for output, own in outputs if np.isnan(own).any()]
                why = "too few replicates have successful samples"
                statistics[name] = with_reasons(statistics[name], dict.fromkeys(lacking, why))
        return statistics

    def _node(
        self,
        problem: uqmbd.extend.Problem,
        statistics: xr.Dataset,
        samples: xr.Dataset,
        found: Gathered,
        surrogate: ControlSurrogate | None,
        paired: PairedControl | None,
        sobol: SobolRun | None,
        attrs: dict[str, Any],
    ) -> xr.DataTree:
        realisations, failures, wall_time = self.samples, found.failures, found.wall_time
        counters = Counter(found.counters)
        if surrogate is not None:
            realisations += surrogate.realisations
            failures += surrogate.failures
            wall_time += surrogate.wall_time
            counters.update(surrogate.counters)
        if paired is not None:
            # its realisations are none of this mechanism
            wall_time += paired.alone
            counters.update(paired.counters)
        if sobol is not None:
            attrs |= {"sobol_rows": sobol.rows, "sobol_rows_dropped": sobol.dropped, "sobol_summary": sobol.words}
            realisations += sobol.realisations
            failures += sobol.failures
            wall_time += sobol.wall_time
            counters.update(sobol.counters)
        if self.samples > self.keep or failures > found.failures:
            # failures are not only those of the kept samples
            attrs |= {"failures": failures, "samples_kept": min(self.keep, self.samples)}
        if len(found.replicates) < 2 and self.sampling != "random":
            attrs["independent_samples"] = "true"  # readers need not have the plugin of the design
        if found.store is not None:
            attrs |= {"all_samples": found.store.folder.name, "all_samples_count": len(found.store)}
        children = {}
        if found.violations:
            times = problem.times if problem.over is None else problem.over
            children["requirements"] = Violations.dataset(problem.requirements, found.violations, times)
        return problem.node(
            self,
            statistics,
            samples,
            realisations=realisations,
            wall_time=wall_time,
            counters=dict(counters),
            children=children,
            attrs=attrs,
        )
