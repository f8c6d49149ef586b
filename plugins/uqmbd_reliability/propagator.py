"""The reliability propagator.

Margins by a surrogate that another method makes.

The mechanism as a limit state: every realisation is counted and kept with its running margins.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Protocol

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import sample_dataset, statistics_of_samples
from uqmbd.results import requirement_names, surrogate
from uqmbd.typing import Array, Index, Mask
from uqmbd_reliability.analysis import LEAST, PILOT, Analysis, analyse
from uqmbd_reliability.describing import described
from uqmbd_reliability.learning import FIRST, gaussian_processes, learn
from uqmbd_reliability.space import StandardSpace
from uqmbd_reliability.subset import MISSING, available, subset_probability

__all__ = ["Reliability"]


class MarginSource(Protocol):
    """Margins of realisations, with outputs and alone."""

    @property
    def values(self) -> Array: ...
    @property
    def running(self) -> Array: ...
    @property
    def failed(self) -> Mask: ...
    @property
    def messages(self) -> tuple[str, ...]: ...


NEAR = 1e-3
"""Part of the fall of a running margin within which it is at its smallest value."""


class MarginRuns:
    """Margins of chosen requirements, computed on request."""

    def __init__(self, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]) -> None:
        self._problem, self._space, self._chosen = problem, space, chosen
        self._running: list[Array] = []
        self._points: list[Array] = []
        self.counters: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.wall_time = 0.0
        self.failures = self.count = 0
        self.pilot: uqmbd.extend.Realisations | None = None

    def __call__(self, points: Array) -> tuple[Array, Mask]:
        """Return margins (K, requirement) at points (K, d), and which realisations failed.

        The outputs of the first points that are asked for are kept.
        """
        inputs = self._space.to_inputs(points)
        if self.pilot is None:
            self.pilot = self._problem.realise(inputs)
            self.counters.update(self.pilot.counters)
            self.wall_time += self.pilot.wall_time
            # computed beside the outputs, and not again
            found: MarginSource = self.pilot.margins or self._problem.margins(inputs)
        else:
            found = more = self._problem.margins(inputs)
            self.counters.update(more.counters)
            self.wall_time += more.wall_time
        self.count += len(points)
        self.failures += int(np.count_nonzero(found.failed))
        self.reasons.update(message for message in found.messages if message)
        self._running.append(found.running[:, self._chosen])
        self._points.append(points)
        return found.values[:, self._chosen], found.failed

    def running(self, rows: Index) -> Array:
        """Return the running margins (K, requirement, T) of some realisations, by their places."""
        return np.asarray(np.concatenate(self._running)[rows])

    def time_of(self, point: Array, requirement: int, times: Array) -> float:
        """Return when the margin is smallest in the computed realisation nearest to a point (d,); NaN if unknown."""
        running = np.concatenate(self._running)[:, requirement]
        known = np.flatnonzero(np.isfinite(running[:, -1]))
        if not len(known) or running.shape[1] != len(times):
            return float("nan")
        nearest = known[np.argmin(np.linalg.norm(np.concatenate(self._points)[known] - point, axis=1))]
        margin = running[nearest]
        # a margin without a time is the same at all times; periodic motions come as near again and again
        fall = margin[0] - margin[-1]
        return float(times[np.argmax(margin <= margin[-1] + NEAR * fall)]) if fall > 0 else float("nan")

    @property
    def reason(self) -> str:
        """The most frequent reason of failure, or empty."""
        return self.reasons.most_common(1)[0][0] if self.reasons else ""


BLOCK = 2**13
"""Points that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class Predictor:
    """Surrogate margins of chosen requirements at points of the standard normal space."""

    evaluate: Callable[[Array], Array]  # from germs (K, d) to values (K, requirement, 1)
    space: StandardSpace
    chosen: list[int]  # indices of the requirements
    realisations: int  # for the training
    failures: int  # of these realisations

    def __call__(self, points: Array) -> Array:
        """Return margins (K, requirement) at points (K, d)."""
        parts = [points[k : k + BLOCK] for k in range(0, len(points), BLOCK)]
        found = [self.evaluate(self.space.to_germs(part))[:, self.chosen, -1] for part in parts]
        return np.concatenate([np.zeros((0, len(self.chosen))), *found])


def predictor(
    method: uqmbd.extend.Propagator, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]
) -> Predictor:
    """Train a surrogate of the margins by a method; raise StudyError if the method gives none."""
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
    """Find how probably requirements are violated, where violations are too rare to be counted.

    It looks for the most likely violations (design points), and samples around them: each realisation is weighted by
    how much more probable it was made, so the probability is that of the mechanism, whatever the search has found.
    Some samples, and chains that go down from level to level, look elsewhere; what they find is sampled, too, and an
    interval that they contradict is widened.

    Parameters
    ----------
    requirement : str, optional
        Name of the requirement.  Default: all, and that any is violated, from the same realisations.
    method : {"auto", "form", "subset"}
        ``"auto"``: design points, and splitting into levels, which sees violations that no search finds, then
        importance sampling.  ``"form"``: without splitting: fewer realisations, where the limit is known to be
        simple. ``"subset"``: subset simulation of OpenTURNS (``pip install "uqmbd[reliability]"``), of one
        requirement: a second opinion, far less certain; the other methods need nothing more than uqmbd.
    target_cov : float
        Coefficient of variation (standard error over probability) at which it ends.
    max_realisations : int
        Realisations at most, all together: those of searches, of `surrogate`, and those that fail are counted, too.
    seed : int
        Of the random numbers: the same seed gives the same bits, whatever the number of workers.
    surrogate : uqmbd.extend.Propagator, optional
        A method that gives a surrogate of the margins, as ``Collocation(order=3)``, which is run first: the search goes
        over it, and real realisations are computed where the sign of a margin is in doubt.  The probability and its
        interval are those of the real mechanism; a poor surrogate costs realisations.  At least 500 of
        `max_realisations` have to be left when it has taken its own.
    label : str, optional
        Name of the results, by default ``reliability``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Warns
    -----
    UserWarning
        In a run, if realisations fail (they are neither safe nor unsafe: the interval holds both), if `target_cov`
        was not reached, or if there are no requirements.

    Notes
    -----
    Statistics of the outputs are those of the first standard normal realisations, with the standard errors of so few;
    take Monte Carlo or a surrogate for them.

    Examples
    --------
    >>> Reliability(max_realisations=1000, seed=1).method
    'auto'
    """

    name: ClassVar[str] = "reliability"
    requirements: ClassVar[bool] = True
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
                f"Reliability: method is {self.method!r}, and a surrogate is given; with one, leave the method out."
            )

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Count realisations, and the stored running margins."""
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
        """Bound the realisations, and end where half a 95 % interval is the accuracy times the probability."""
        if not study.mechanism.requirements:
            return None
        # an interval reaches from p exp(-1.96 cov) to p exp(1.96 cov)
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
        """Return the obstacle: nothing random, or an unknown requirement."""
        if reason := uqmbd.extend.nothing_random(study.mechanism.inputs, study.mechanism.name):
            return reason
        if self.surrogate is not None and (found := self.surrogate.obstacle(study) or self._too_expensive(study)):
            return f"its surrogate {self.surrogate.name!r}: {found}"
        return self._unknown(list(study.mechanism.requirements))

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return a remark if there are no requirements."""
        return () if study.mechanism.requirements else (NOTHING,)

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Explore, search, sample, and summarise."""
        space = StandardSpace(problem.germ_space())
        names = [one.name for one in problem.requirements]
        if problem.answers_requirements and (reason := self._unknown(names)):
            raise uqmbd.StudyError(f"{problem.label}: {reason}.")
        if not problem.answers_requirements:
            return self._without(problem, space)
        chosen = list(range(len(names))) if self.requirement is None else [names.index(self.requirement)]
        runs = MarginRuns(problem, space, chosen)
        predicted = None if self.surrogate is None else predictor(self.surrogate, problem, space, chosen)
        found = self._analyse(runs, space.dimension, predicted)
        attrs = self._told(problem, runs, found, requirement_names([names[k] for k in chosen]))
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

    def _analyse(self, runs: MarginRuns, dimension: int, predicted: Predictor | None) -> Analysis:
        if self.method == "subset":
            return subset_probability(runs, dimension, most=self.max_realisations, seed=self.seed)
        generator, target, most = np.random.default_rng(self.seed), self.target_cov, self.max_realisations
        if predicted is not None:
            most -= predicted.realisations
            if most < LEAST:
                raise uqmbd.IntegrationError(
                    f"{self.node_name}: the surrogate used {predicted.realisations} of at most {self.max_realisations} "
                    f"realisations, and the analysis needs {LEAST} more; increase max_realisations."
                )
            learned = learn(runs, predicted, dimension, target=target, most=most, generator=generator)
            if learned is not None:
                return learned
        # what a surrogate of no use has taken is spent, and lies before the places of the samples
        spent = runs.count
        found = analyse(runs, dimension, method=self.method, target=target, most=most - spent, generator=generator)
        return replace(found, sampled=replace(found.sampled, rows=found.sampled.rows + spent))

    def _too_expensive(self, study: uqmbd.Study) -> str | None:
        """Return a message that a surrogate may leave too little of the realisations."""
        if self.surrogate is None or (planned := self.surrogate.estimate(study)) is None:
            return None
        if planned.realisations + LEAST <= self.max_realisations:
            return None
        most = "up to " if planned.at_most else ""
        return (
            f"it takes {most}{planned.realisations} realisations, and {LEAST} more are needed, but max_realisations is "
            f"{self.max_realisations}; make it {planned.realisations + LEAST} or more, or bound those of the surrogate"
        )

    def _unknown(self, names: list[str]) -> str | None:
        if self.requirement is not None and self.requirement not in names:
            there = f"there are {', '.join(names)}" if names else "there is none"
            return f"requirement is {self.requirement!r}; {there}: give the name of one, or leave it out"
        if self.method == "subset" and self.requirement is None and len(names) > 1:
            return f"method 'subset' is for one requirement; give as requirement one of {', '.join(names)}"
        return None

    def _without(self, problem: uqmbd.extend.Problem, space: StandardSpace) -> xr.DataTree:
        """Give the statistics alone: there are no requirements, or they are answered in another run."""
        # in the latter case they are those of that run, and not computed again
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
        # where an output does not happen a realisation has not failed
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
                f"{problem.label}: {failures} of {total} realisations failed; they are neither safe nor unsafe, and "
                f"widen the intervals. Most frequent reason: {reason}",
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

    def _told(
        self, problem: uqmbd.extend.Problem, runs: MarginRuns, found: Analysis, names: tuple[str, ...]
    ) -> dict[str, Any]:
        """Return a description of the computation, and warn if it differs from the request."""
        counted = len(found.sampled.points)
        points = f"{len(found.design_points)} design points" if found.design_points else "no design point"
        how = "OpenTURNS's subset simulation" if self.method == "subset" else f"{points}, {counted} samples that count"
        text = [f"{how}, {runs.count} realisations in all"]
        missed = [
            f"{name} ({one.cov:.2g})"
            for name, one in zip(names, found.estimates, strict=True)
            if one.probability > 0 and one.cov > 1.1 * self.target_cov
        ]
        if missed and self.method != "subset":
            warnings.warn(
                f"{problem.label}: target_cov={self.target_cov:g} was not reached for {', '.join(missed)} with "
                f"{runs.count} realisations; the intervals are wider. Increase max_realisations.",
                stacklevel=3,
            )
        return {"reliability_summary": "; ".join([*text, *found.notes])}


NOTHING = (
    "the mechanism has no requirement, so there is nothing to find but statistics of few realisations; state one by "
    "mechanism.require(name, relation), or use another method"
)
