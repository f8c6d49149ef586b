"""Reliability propagator, margins by a surrogate of another method, and the mechanism as a limit state.

Every realisation is counted and stored with its running margins.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import sample_dataset, statistics_of_samples
from uqmbd.results import requirement_names, surrogate
from uqmbd.typing import Array
from uqmbd_reliability.analysis import LEAST, PILOT, Analysis, analyse
from uqmbd_reliability.describing import described
from uqmbd_reliability.learning import FIRST, gaussian_processes, learn
from uqmbd_reliability.path_splitting import split_paths
from uqmbd_reliability.runs import MarginRuns
from uqmbd_reliability.space import StandardSpace
from uqmbd_reliability.subset import MISSING, available, subset_probability

__all__ = ["Reliability"]


BLOCK = 2**13
"""Largest number of points in one evaluation."""


@dataclass(frozen=True, eq=False)
class Predictor:
    """Surrogate margins of the selected requirements at points of the standard normal space."""

    evaluate: Callable[[Array], Array]  # maps germs (K, d) to values (K, requirement, 1)
    space: StandardSpace
    chosen: list[int]  # indices of the requirements
    realisations: int  # number for the training
    failures: int  # number of failed ones among these

    def __call__(self, points: Array) -> Array:
        """Return margins (K, requirement) at points (K, d)."""
        parts = [points[k : k + BLOCK] for k in range(0, len(points), BLOCK)]
        found = [self.evaluate(self.space.to_germs(part))[:, self.chosen, -1] for part in parts]
        return np.concatenate([np.zeros((0, len(self.chosen))), *found])


def predictor(
    method: uqmbd.extend.Propagator, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]
) -> Predictor:
    """Return a surrogate of the margins by a method; raise StudyError if the method does not provide one."""
    margins = problem if problem.kind == "requirements" else problem.of_requirements()
    part = margins.part(f"{problem.label}: surrogate").using(observed=margins.runner.observed)
    node = method.propagate(replace(part, answers_requirements=False))
    chaos = surrogate(node, times=[len(problem.times if problem.over is None else problem.over) - 1])
    return Predictor(
        chaos.evaluate_germs,
        space,
        chosen,
        int(node.attrs["realisations"]),
        int(node.attrs["failures"]),
    )


FINEST = 0.005
"""Least coefficient of variation that may be requested."""


@dataclass(frozen=True, kw_only=True)
class Reliability(uqmbd.extend.Propagator):
    """Estimate the probabilities that requirements are violated, for violations too rare to be counted.

    The method searches the most likely violations (design points), and samples near them. The weight of each
    realisation corrects the higher sampling density. So the estimate is the probability of the mechanism, for any
    result of the search. Some samples, and chains through levels of the margin, explore other regions. Violations found
    there are sampled, too, and an interval that contradicts them is widened.

    Parameters
    ----------
    requirement : str, optional
        Name of the requirement. Default: each requirement, and the violation of any one, from the same realisations.
    method : {"auto", "form", "subset"}
        ``"auto"`` searches design points, then uses multilevel splitting, which finds violations that a search misses,
        then importance sampling. ``"form"`` omits the splitting, and so needs fewer realisations; use it if the limit
        is known to be simple. ``"subset"`` is subset simulation of OpenTURNS (``pip install "uqmbd[reliability]"``) for
        one requirement. Its estimate is independent, but far less accurate. The other methods need no other package.
    target_cov : float
        Coefficient of variation (standard error divided by probability) at which sampling stops.
    max_realisations : int
        Largest total number of realisations, including searches, `surrogate` and failed realisations.
    seed : int
        Seed of the random numbers. The same seed gives the same bits for any number of workers.
    surrogate : uqmbd.extend.Propagator, optional
        Method that provides a surrogate of the margins, such as ``Collocation(order=3)``. This method runs first. The
        search uses the surrogate, and realisations are computed at points at which the sign of a margin is uncertain.
        The probability and its interval refer to the mechanism; an inaccurate surrogate only costs more realisations.
        At least 500 of `max_realisations` must remain after the surrogate.
    label : str, optional
        Name of the results. Default: ``reliability``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Warns
    -----
    UserWarning
        In a run, if realisations fail, if `target_cov` was not reached, or if there are no requirements. Failed
        realisations are neither safe nor unsafe, so the interval contains both possibilities.

    Notes
    -----
    Statistics of the outputs are from the first standard normal realisations, and have large standard errors. Use Monte
    Carlo or a surrogate for them.

    If a requirement depends on sampled paths of random processes, ``"auto"`` is subset simulation in the space of the
    parameters and of the noise. A first run chooses the levels; at least six further runs with these levels give the
    probability and its error. There are no design points, and one requirement is analysed at a time.

    Examples
    --------
    >>> Reliability(max_realisations=1000, seed=1).method
    'auto'
    """

    name: ClassVar[str] = "reliability"
    requirements: ClassVar[bool] = True
    input_treatment: ClassVar[uqmbd.extend.InputTreatment] = uqmbd.extend.InputTreatment.SAMPLE
    searches_violations: ClassVar[bool] = True
    requirement: str | None = None
    method: Literal["auto", "form", "subset"] = "auto"
    target_cov: Annotated[float, uqmbd.extend.Bounds(FINEST, 1)] = 0.05
    max_realisations: Annotated[int, uqmbd.extend.Bounds(LEAST, 10**9)] = 3000
    seed: Annotated[int, uqmbd.extend.Bounds(0)] = 0
    surrogate: uqmbd.extend.Propagator | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method == "subset" and not available():
            raise uqmbd.StudyError(f"Reliability: {MISSING}.")
        if self.surrogate is not None and not isinstance(self.surrogate, uqmbd.extend.Propagator):
            raise uqmbd.StudyError(
                f"Reliability: surrogate is {self.surrogate!r:.80}; expected a method such as Collocation(order=3)."
            )
        if self.surrogate is not None:
            gaussian_processes()
        if self.surrogate is not None and self.method != "auto":
            raise uqmbd.StudyError(
                f"Reliability: method is {self.method!r}, but a surrogate is given. Omit method, or omit surrogate."
            )

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Return the number of realisations, and the memory of the stored running margins."""
        wanted = len(study.mechanism.requirements)
        count = self.max_realisations if wanted else PILOT
        values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
        memory, disk = 8 * count * (wanted * len(study.times) + 4), 8 * (PILOT + 20) * values
        found = uqmbd.extend.Estimate(count, memory, "running margins", at_most=True, disk=disk)
        other = None if self.surrogate is None or not wanted else self.surrogate.estimate(study)
        if other is None:
            return found
        return replace(found, memory=max(found.memory, other.memory))

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing | None:
        """Return options with a limit of realisations, and with the accuracy as half the relative 95 % interval."""
        if not study.mechanism.requirements:
            return None
        # an interval is from p exp(-1.96 cov) to p exp(1.96 cov)
        wanted = self.target_cov if accuracy is None else float(np.log1p(accuracy)) / 1.96
        target = min(max(wanted, FINEST), 1.0)
        return uqmbd.extend.Sizing(
            option="max_realisations",
            at=lambda most: replace(self, max_realisations=most, target_cov=target),
            least=LEAST,
            falls="itself",
            of="probabilities",
            also=("target_cov",),
            bound=int(np.ceil(self.max_realisations * max(self.target_cov / target, 1.0) ** 2)),
        )

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return why the method cannot compute a study: no random input, or an unknown requirement. None: it can."""
        if reason := uqmbd.extend.nothing_random(study.mechanism.inputs, study.mechanism.name):
            return reason
        if self.surrogate is not None and (found := self.surrogate.obstacle(study) or self._too_few_left(study)):
            return f"the surrogate {self.surrogate.name!r} is not possible: {found}"
        if keys := [v.name for v in study.mechanism.inputs.variables if v.is_key]:
            if reason := self._refused_paths(keys, list(study.mechanism.requirements)):
                return reason
        return self._unknown_requirement(list(study.mechanism.requirements))

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return a remark if there are no requirements."""
        return () if study.mechanism.requirements else (NOTHING,)

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Explore, search, sample, and return statistics."""
        space = StandardSpace(problem.germ_space(), tuple(problem.inputs.variables))
        names = [one.name for one in problem.requirements]
        if problem.answers_requirements and (reason := self._unknown_requirement(names)):
            raise uqmbd.StudyError(f"{problem.label}: {reason}.")
        if not problem.answers_requirements:
            return self._statistics_only(problem, space)
        chosen = list(range(len(names))) if self.requirement is None else [names.index(self.requirement)]
        runs = MarginRuns(problem, space, chosen)
        predicted = None if self.surrogate is None else predictor(self.surrogate, problem, space, chosen)
        found = self._analyse(runs, space, predicted)
        attrs = self._description(problem, runs, found, requirement_names([names[k] for k in chosen]))
        data = described(
            problem,
            [problem.requirements[k] for k in chosen],
            space,
            found,
            runs.running(found.sampled.rows),
            {"how": attrs["reliability_summary"]},
            runs.time_of,
        )
        pilot = runs.pilot
        assert pilot is not None
        return self._node(problem, pilot, attrs, runs, {"requirements": data}, predicted)

    def _analyse(self, runs: MarginRuns, space: StandardSpace, predicted: Predictor | None) -> Analysis:
        dimension = space.dimension
        if space.paths:
            generator = np.random.default_rng(self.seed)
            return split_paths(runs, space, target=self.target_cov, most=self.max_realisations, generator=generator)
        if self.method == "subset":
            return subset_probability(runs, dimension, most=self.max_realisations, seed=self.seed)
        generator, target, most = np.random.default_rng(self.seed), self.target_cov, self.max_realisations
        if predicted is not None:
            most -= predicted.realisations
            if most < LEAST:
                raise uqmbd.IntegrationError(
                    f"{self.node_name}: the surrogate used {predicted.realisations} of at most "
                    f"{self.max_realisations} realisations, but the analysis needs {LEAST} more. Increase "
                    "max_realisations."
                )
            learned = learn(runs, predicted, dimension, target=target, most=most, generator=generator)
            if learned is not None:
                return learned
        # count realisations of a useless surrogate; they precede the samples
        spent = runs.count
        found = analyse(runs, dimension, method=self.method, target=target, most=most - spent, generator=generator)
        return replace(found, sampled=replace(found.sampled, rows=found.sampled.rows + spent))

    def _refused_paths(self, keys: list[str], names: list[str]) -> str | None:
        """Return why options cannot be used with sampled paths."""
        about = f"the requirements depend on sampled paths of {', '.join(map(repr, keys))}"
        if self.method != "auto" or self.surrogate is not None:
            given = f"method={self.method!r}" if self.method != "auto" else "a surrogate"
            return f"{about}, which have no design points; {given} is not possible. Omit it, for subset simulation"
        if self.requirement is None and len(names) > 1:
            return f"{about}; subset simulation supports one requirement. Set requirement= to one of {', '.join(names)}"
        return None

    def _too_few_left(self, study: uqmbd.Study) -> str | None:
        """Return a message if a surrogate may leave too few realisations."""
        if self.surrogate is None or (planned := self.surrogate.estimate(study)) is None:
            return None
        if planned.realisations + LEAST <= self.max_realisations:
            return None
        most = "up to " if planned.at_most else ""
        return (
            f"the surrogate needs {most}{planned.realisations} realisations, and the analysis needs {LEAST} more, but "
            f"max_realisations is {self.max_realisations}. Increase it to {planned.realisations + LEAST} or more, or "
            "limit the realisations of the surrogate"
        )

    def _unknown_requirement(self, names: list[str]) -> str | None:
        if self.requirement is not None and self.requirement not in names:
            there = f"expected one of {', '.join(names)}, or None" if names else "the mechanism has no requirement"
            return f"requirement is {self.requirement!r}; {there}"
        if self.method == "subset" and self.requirement is None and len(names) > 1:
            return f"method 'subset' supports one requirement only; set requirement= to one of {', '.join(names)}"
        return None

    def _statistics_only(self, problem: uqmbd.extend.Problem, space: StandardSpace) -> xr.DataTree:
        """Return statistics of outputs only: there are no requirements, or another run computes them."""
        # for requirements of another run, use the same realisations, which are not computed again
        count = PILOT if self.surrogate is None or not problem.requirements else FIRST
        points = np.random.default_rng(self.seed).standard_normal((count, space.dimension))
        if not problem.requirements:
            warnings.warn(f"{problem.label}: {NOTHING}.", stacklevel=3)
        pilot = problem.realise(space.to_inputs(points))
        return self._node(problem, pilot, {}, None, {})

    def _node(
        self,
        problem: uqmbd.extend.Problem,
        pilot: uqmbd.extend.Realisations,
        attrs: dict[str, Any],
        runs: MarginRuns | None,
        children: dict[str, xr.Dataset],
        predicted: Predictor | None = None,
    ) -> xr.DataTree:
        fine = pilot.good
        # a realisation in which an output has no event has not failed
        lost = int(np.count_nonzero(~fine)) - pilot.censored
        if lost > 0.5 * len(fine) or np.count_nonzero(fine) < 2:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {lost} of the first {len(fine)} realisations failed; check the distributions of the "
                f"inputs. Most frequent reason: {pilot.most_frequent_reason()}"
            )
        failures = lost if runs is None else max(runs.failures, lost)
        total = len(fine) if runs is None else runs.count
        if predicted is not None:
            total, failures = total + predicted.realisations, failures + predicted.failures
            attrs = {**attrs, "surrogate_realisations": predicted.realisations}
        if failures:
            reason = pilot.most_frequent_reason() or (runs.reason if runs else "") or "an output is not finite"
            warnings.warn(
                f"{problem.label}: {failures} of {total} realisations failed. They count neither as violations nor "
                f"as successes, and widen the confidence intervals. Most frequent reason: {reason}",
                stacklevel=3,
            )
        samples = sample_dataset(
            pilot.response,
            pilot.values,
            problem.labels,
            status=pilot.status,
            messages=pilot.messages,
            kind="draws",
        )
        return problem.node(
            self,
            statistics_of_samples(samples, each=problem.runner.each),
            samples,
            realisations=total,
            wall_time=pilot.wall_time if runs is None else runs.wall_time,
            counters=pilot.counters if runs is None else dict(runs.counters),
            children=children,
            attrs={**attrs, "failures": failures, "samples_kept": len(fine), "statistics_samples": len(fine)},
        )

    def _description(
        self, problem: uqmbd.extend.Problem, runs: MarginRuns, found: Analysis, names: tuple[str, ...]
    ) -> dict[str, Any]:
        """Return a description of the computation, and warn if it differs from the request."""
        counted = len(found.sampled.points)
        points = f"{len(found.design_points)} design points" if found.design_points else "no design point"
        how = "OpenTURNS's subset simulation" if self.method == "subset" else f"{points}, {counted} importance samples"
        how = "subset simulation on sampled paths" if runs.on_paths else how
        text = [f"{how}, {runs.count} realisations in total"]
        missed = {
            name: one.cov
            for name, one in zip(names, found.estimates, strict=True)
            if one.probability > 0 and one.cov > 1.1 * self.target_cov
        }
        if missed and self.method != "subset":
            # the variance of an estimate is proportional to the inverse of the number of realisations
            needed = max(runs.count * (max(missed.values()) / self.target_cov) ** 2, 1.1 * self.max_realisations)
            about = f" to about {float(f'{needed:.2g}'):,.0f}" if needed < 1e8 else ""
            warnings.warn(
                f"{problem.label}: the analysis did not reach target_cov={self.target_cov:g} for "
                f"{', '.join(f'{name} ({cov:.2g})' for name, cov in missed.items())} with {runs.count} of at most "
                f"{self.max_realisations} realisations, so the confidence intervals are wider. Increase "
                f"max_realisations{about}, or increase target_cov.",
                stacklevel=3,
            )
        return {"reliability_summary": "; ".join([*text, *found.notes])}


NOTHING = (
    "the mechanism has no requirement, so the results contain only statistics of a few realisations. Add a "
    "requirement with mechanism.require(name, relation), or use another method"
)
