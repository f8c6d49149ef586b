"""Monte Carlo propagator."""

from __future__ import annotations

import warnings
from collections import Counter
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import (
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
from uqmbd_montecarlo.gathering import (
    Gathered,
    allowed_pairs,
    gather,
    paired_samples,
    replicate_sizes,
    uniform_samples,
    violations_dataset,
)
from uqmbd_montecarlo.lowfidelity import (
    LowFidelity,
    PairedControl,
    check_samples,
    further_realisations,
    mismatch,
)
from uqmbd_montecarlo.pickfreeze import obstacle_of
from uqmbd_montecarlo.sensitivity import SobolRun, group_count, rows_at_once, run_sobol
from uqmbd_montecarlo.sizing import sized
from uqmbd_montecarlo.surrogate import ChaosControl, ControlSurrogate, no_surrogate, surrogate_of

__all__ = ["MonteCarlo"]

UNKNOWN = ("std_error_mean", "std_error_std", "quantile_interval")
"""Statistics that require several replicates of a design."""


@dataclass(frozen=True, kw_only=True)
class MonteCarlo(uqmbd.extend.Propagator):
    """Sample the inputs, and compute the statistics of the realisations.

    Parameters
    ----------
    samples : int
        Number of samples. The default suits all designs; Sobol' points need `replicates` times a power of two.
    seed : int
        Seed of the random numbers. The same seed gives the same bits for any number of workers.
    sampling : str
        Name of a sampling design: ``"random"``, independent points; ``"latin-hypercube"``; ``"sobol"`` or ``"halton"``,
        scrambled points; or a design of a plugin.
    replicates : int
        Number of independent replicates of a design with dependent points. The standard errors are computed over the
        replicates.
    max_failures : float
        Share of failed samples above which the run is an error. Smaller shares give a warning.
    keep : int
        Largest number of samples in the results. If there are more, the statistics still include all samples, and the
        memory does not grow with their number. With a folder, all samples are stored in ``LABEL-samples.zarr``, and the
        quantiles are computed from this store. Without a folder, the quantiles are estimated from a histogram that is
        filled during the run, and ``quantile_error`` bounds their error.
    control : uqmbd.extend.Propagator, uqmbd.results.PolynomialChaos, LowFidelity or uqmbd.Study, optional
        Control variate, which reduces the errors of mean and standard deviation. The control is one of:

        - a method that computes a polynomial chaos, such as ``Collocation(order=3)``; it runs first, on other
          realisations;
        - an existing chaos;
        - a low-cost study (`LowFidelity`; a study alone means ``LowFidelity(study)``). This study runs at the samples,
        and at the number of further points that minimises the cost.

        A control requires random sampling and at least 50 samples. The estimates stay unbiased for any control, because
        the factors are cross-fitted in ten parts of the samples. If samples fail, the statistics refer to the inputs
        whose realisations succeed. Skewness, kurtosis and quantiles are computed from the samples alone, without the
        control.
    sobol_indices : bool
        Estimate first and total Sobol' indices by the pick-freeze method, with 95 % jackknife intervals. The jackknife
        omits one block of independent rows of the design at a time. The inputs must be independent. The samples form
        N = `samples` / 2 pairs, and each input needs N further realisations. The total is N (d + 2) realisations for d
        inputs. At most `keep` realisations are in memory at once.

        With sampled paths, ``variance_share`` contains the shares of parameters alone, paths alone, and both.

        For designs with dependent points (Sobol', Halton, Latin hypercube), the two samples of a pair are the halves of
        a point in 2 d dimensions. The jackknife then omits one replicate at a time. All other statistics are
        computed from the samples; for random sampling, this option does not change them. An output that some
        realisations do not have, such as the time of an event, has statistics but no indices (NaN, with the reason).
        Under the condition that the event occurs, the inputs are not independent.
    label : str, optional
        Name of the results. Default: ``monte-carlo``.

    Warns
    -----
    UserWarning
        In a run, if realisations fail, with their number and the most frequent reason; if a control has no benefit.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Examples
    --------
    >>> MonteCarlo(sampling="sobol", seed=1).samples
    512
    """

    name: ClassVar[str] = "monte-carlo"
    input_treatment: ClassVar[uqmbd.extend.InputTreatment] = uqmbd.extend.InputTreatment.SAMPLE
    requirements: ClassVar[bool] = True
    samples: Annotated[int, uqmbd.extend.Bounds(2, 10**9)] = 512
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
                "MonteCarlo: control requires independent samples, on which its error estimates are based; sampling "
                f"is {self.sampling!r}, expected 'random'."
            )

    def _check_pairs(self, independent: bool) -> None:
        if not self.sobol_indices:
            return
        if independent and (self.samples % 2 or self.samples < 4):
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; sobol_indices forms pairs of samples and needs an even "
                "number of 4 or more."
            )
        below = allowed_pairs(self.sampling, self.samples, self.replicates)
        if below != self.samples:
            base = max(uqmbd.extend.sampling_design(self.sampling).base, 1)
            above = below * base if base > 1 else below + 2 * self.replicates
            power = f" that is a power of {'two' if base == 2 else base}" if base > 1 else ""
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; sobol_indices forms pairs of samples in {self.replicates} "
                f"replicates of the design {self.sampling!r}. This needs {2 * self.replicates} times a whole "
                f"number{power}. Use {below}{'' if below > self.samples else f' or {above}'}."
            )

    def _check_control(self) -> None:
        if self.control is None:
            return
        if not isinstance(self.control, (uqmbd.extend.Propagator, PolynomialChaos, LowFidelity)):
            raise uqmbd.StudyError(
                f"MonteCarlo: control is {self.control!r}; expected a propagator that computes a polynomial chaos, "
                "e.g. Collocation(order=3), a uqmbd.results.PolynomialChaos, or a cheaper study, e.g. "
                "LowFidelity(study)."
            )
        if self.samples < LEAST_SAMPLES:
            raise uqmbd.StudyError(
                f"MonteCarlo: samples is {self.samples}; a control needs at least {LEAST_SAMPLES}, because its "
                f"coefficients are fitted to {FOLDS} subsets of the samples."
            )
        if isinstance(self.control, LowFidelity):
            check_samples(self.control, self.samples)

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Return the number of realisations, and the memory of the stored samples."""
        values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
        inputs = len(study.mechanism.inputs)
        kept, total = min(self.samples, self.keep), self.samples
        # include the sorted copies for quantiles
        memory = 8 * kept * (3 * values + inputs)
        if self.sobol_indices:
            groups = group_count(study.mechanism.inputs)
            total += self.samples // 2 * groups
            memory += 8 * rows_at_once(self.samples // 2, groups, self.keep) * (groups + 2) * (values + inputs)
        disk = 8 * (kept if self.samples <= kept else kept + self.samples) * (values + inputs)
        found = uqmbd.extend.Estimate(total, memory, f"{kept} stored samples", disk=disk)
        if isinstance(self.control, LowFidelity):
            # control realisations do not belong to this study, and the samples determine their optimum number
            besides = f"{self.control.samples or self.samples}{'' if self.control.samples else ' or more'}"
            return replace(found, detail=f"{found.detail}; in addition {besides} realisations of {self.control!r}")
        control = self.control.estimate(study) if isinstance(self.control, uqmbd.extend.Propagator) else None
        if control is None:
            return found
        most = max(found.memory, control.memory)
        return replace(found, realisations=total + control.realisations, memory=most, at_most=control.at_most)

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing:
        """Return the options and the choice of the numbers of samples and replicates."""
        return sized(partial(replace, self), self.sampling, self.replicates, pairs=self.sobol_indices)

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return why the method cannot compute a study: no random input, or an impossible option. None: it can."""
        inputs = study.mechanism.inputs
        nothing = uqmbd.extend.nothing_random(inputs, study.mechanism.name)
        if reason := nothing or no_surrogate(self.control, inputs):
            return reason
        if isinstance(self.control, uqmbd.extend.Propagator) and (found := self.control.obstacle(study)):
            return f"the control {self.control.name!r} is not possible: {found}"
        if isinstance(self.control, LowFidelity):
            mechanism, times = study.mechanism, study.times
            if not (names := (*mechanism.outputs, *mechanism.scalars)):
                return "a control study requires outputs, but this study has only requirements"
            units = {variable.name: variable.units for variable in inputs.variables}
            if found := mismatch(self.control.study, units, names, times):
                return found
        return obstacle_of(inputs) if self.sobol_indices else None

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Sample, compute, and return statistics."""
        problem.require_random()
        if reason := no_surrogate(self.control, problem.inputs):
            raise uqmbd.StudyError(f"{problem.label}: {reason}.")
        if self.sobol_indices and (obstacle := obstacle_of(problem.inputs)):
            raise uqmbd.StudyError(f"{problem.label}: sobol_indices cannot be estimated: {obstacle}.")
        if self.samples <= self.keep or problem.folder is not None:
            return self._propagated(problem, None)
        independent = uqmbd.extend.sampling_design(self.sampling).independent
        with closing(Passing(problem.labels, self.sobol_indices, independent)) as passing:
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
            # a chaos of outputs over time contains no scalar outputs
            surrogate = surrogate_of(self.control, problem)
            sums = ControlledSums(ChaosControl(surrogate.chaos, uniform), self.samples)
        watching = [one.add for one in (sums, passing) if one is not None]
        with nullcontext() if paired is None else closing(paired):
            found = gather(problem, values, sizes, self.keep, together(watching) if watching else None)
        few = min(found.count, int(np.count_nonzero(found.kept.good))) < 2
        if few or found.failures > self.max_failures * self.samples:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {self.samples} samples failed, more than the share "
                f"max_failures = {self.max_failures:g} allows. Most frequent reason: {found.reason}"
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
        everything: AllSamples | None = passing
        if found.store is not None:
            everything = Stored(found.store, problem.labels, uqmbd.extend.sampling_design(self.sampling).independent)
        statistics = self._statistics(problem, samples, found, everything, sizes)
        attrs: dict[str, Any] = {}
        if sums is not None and surrogate is not None:
            statistics = sums.apply(statistics)
            attrs = of_surrogate(statistics, surrogate)
        if sums is not None and paired is not None:
            left = sums.left()
            if count := further_realisations(paired.control, self.samples, left):
                # the first child of this seed is for the samples, and the second for Sobol' indices
                seed = np.random.SeedSequence(self.seed, spawn_key=(2,))
                statistics = sums.apply(statistics, paired.further(count, seed))
            attrs = of_study(statistics, paired, problem, self.samples, left, found.wall_time)
        if found.failures:
            warnings.warn(
                f"{problem.label}: {found.failures} of {self.samples} realisations failed; the statistics are based "
                f"on the successful ones. Most frequent reason: {found.reason or 'an output is not finite'}",
                stacklevel=2,
            )
        sobol = None
        if pairs is not None:
            again = everything.responses if everything else lambda first, last: kept.response[first:last]
            replicates = len(sizes) if len(sizes) > 1 else 0
            sobol = run_sobol(problem, values, (pairs[0], pairs[1]), again, self.keep, self.max_failures, replicates)
            for name, why in sobol.without.items():
                warnings.warn(
                    f"{problem.label}: output {name!r} has no Sobol' indices: {why}. Use later output times, or a "
                    "quantity that exists in every realisation, such as uqmbd.maximum.",
                    uqmbd.StudyWarning,
                    stacklevel=2,
                )
        if sobol is not None and sobol.failures:
            warnings.warn(
                f"{problem.label}: {sobol.failures} of {sobol.realisations} additional realisations for Sobol' "
                f"indices failed; {sobol.dropped} rows of the pick-freeze design are omitted. Most frequent reason: "
                f"{sobol.reason or 'an output is not finite'}",
                stacklevel=2,
            )
        if sobol is not None:
            statistics = statistics.merge(sobol.variables, compat="equals", join="exact")
        return self._node(problem, statistics, samples, found, surrogate, paired, sobol, attrs)

    def _statistics(
        self,
        problem: uqmbd.extend.Problem,
        samples: xr.Dataset,
        found: Gathered,
        everything: AllSamples | None,
        sizes: list[int],
    ) -> xr.Dataset:
        independent = uqmbd.extend.sampling_design(self.sampling).independent
        if everything is None:
            replicates = None if independent else sizes
            each = problem.runner.each
            statistics = statistics_of_samples(samples, independent=independent, replicates=replicates, each=each)
        else:
            known: dict[str, Any] = found.moments.statistics(independent=independent) | everything.statistics()
            if not independent:
                known["quantile_interval"] = np.full((2, *known["quantile"].shape), np.nan)
            statistics = statistics_dataset(problem.labels, **known)
        if not independent:
            with problem.timed("error estimation"):
                errors = replicate_errors(found.replicates)
            for name, error in zip(("std_error_mean", "std_error_std"), errors, strict=True):
                statistics[name] = statistics[name].copy(data=error)
            reasons = dict.fromkeys(UNKNOWN, "too few replicates have successful samples")
            if everything is not None:
                reasons["quantile_interval"] = (
                    "there are more samples than keep, so quantiles of single replicates are not counted"
                )
            for name, why in reasons.items():
                # a sample fails as a whole, but a single output may have no error
                unknown = statistics[name].isnull().any([dim for dim in statistics[name].dims if dim != "output"])
                lacking = unknown["output"].values[unknown.values].tolist()
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
            # control realisations do not belong to this mechanism
            wall_time += paired.alone
            counters.update(paired.counters)
        if sobol is not None:
            attrs |= {"sobol_rows": sobol.rows, "sobol_rows_dropped": sobol.dropped, "sobol_summary": sobol.words}
            realisations += sobol.realisations
            failures += sobol.failures
            wall_time += sobol.wall_time
            counters.update(sobol.counters)
        if self.samples > self.keep or failures > found.failures:
            # count failures of all samples, not only of the stored ones
            attrs |= {"failures": failures, "samples_kept": min(self.keep, self.samples)}
        if len(found.replicates) < 2 and self.sampling != "random":
            attrs["independent_samples"] = "true"  # for readers without the plugin of the design
        if found.store is not None:
            attrs |= {"all_samples": found.store.folder.name, "all_samples_count": len(found.store)}
        children = {}
        if found.violations:
            children["requirements"] = violations_dataset(found, problem)
        return problem.node(
            self,
            statistics,
            samples,
            realisations=realisations,
            wall_time=wall_time,
            counters=dict(counters),
            children=children,
            attrs=attrs | {"sample_size": self.samples},
        )
