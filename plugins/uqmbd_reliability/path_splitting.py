"""Subset simulation in the space of the parameters and of the noise of sampled paths.

A state is a point of the standard normal parameters and, for each random process, a weighted sum of sampled paths. A
step replaces a path ``w`` by ``sqrt(1 - s^2) w + s w'`` with a new path ``w'``, and a point in the same way: it
preserves the distribution for any number of noise variables (Papaioannou et al. 2015).

The first run chooses the levels of the margin and the lengths of the steps (Au and Beck 2001). Further runs use them
unchanged. Their estimates are independent and without bias (Cerou and Guyader 2007). Their spread is therefore an error
estimate that needs no assumption on the chains.

S.-K. Au, J. L. Beck, Probabilistic Engineering Mechanics 16 (2001) 263-277; I. Papaioannou et al., Probabilistic
Engineering Mechanics 41 (2015) 89-103; F. Cerou, A. Guyader, Stochastic Analysis and Applications 25 (2007) 417-443.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_reliability.analysis import LEVEL, MOST_LEVELS, Analysis
from uqmbd_reliability.estimating import ProbabilityEstimate, failing
from uqmbd_reliability.importance import Sampled
from uqmbd_reliability.ledger import LimitStateLedger
from uqmbd_reliability.runs import MarginRuns
from uqmbd_reliability.space import StandardSpace

__all__ = ["split_paths"]

LARGEST, SMALLEST = 1000, 40
"""Largest and smallest number of states of a level."""

SHARE = 20
"""The first run has this part of the realisations in its first level.

Its estimate is not used.  A larger first run leaves fewer realisations for the runs whose mean is the result.  For a
probability of 1.8e-4 and 6,000 realisations, the standard deviation of the result is 8.2e-5 with 12.  It is 5.5e-5 with
20, and 6.4e-5 with 30.
"""

RUNS = 6
"""Least number of further runs."""


@dataclass(frozen=True, eq=False)
class States:
    """States of K chains with their margins; NaN margins of failed realisations."""

    points: Array  # (K, d)
    keys: Array  # (K, process, M)
    weights: Array  # (K, process, M)
    margins: Array  # (K,)
    rows: Index  # (K,): numbers of the realisations

    def select(self, chosen: Index) -> States:
        """Return some states."""
        return States(**{name: value[chosen] for name, value in vars(self).items()})

    @classmethod
    def joined(cls, parts: list[States]) -> States:
        """Return all states of several parts; missing terms have no weight."""
        most = max(part.keys.shape[2] for part in parts)

        def filled(terms: Array) -> Array:
            return np.pad(terms, ((0, 0), (0, 0), (0, most - terms.shape[2])))

        return cls(
            np.concatenate([part.points for part in parts]),
            np.concatenate([filled(part.keys) for part in parts]),
            np.concatenate([filled(part.weights) for part in parts]),
            np.concatenate([part.margins for part in parts]),
            np.concatenate([part.rows for part in parts]),
        )


class PathChains:
    """Chains of states; their realisations are counted."""

    def __init__(self, runs: MarginRuns, space: StandardSpace, generator: np.random.Generator) -> None:
        self.runs, self.space, self.generator = runs, space, generator

    def drawn(self, count: int) -> States:
        """Return independent states."""
        points = self.generator.standard_normal((count, self.space.dimension))
        keys = self.generator.uniform(size=(count, len(self.space.paths), 1))
        return self._evaluated(points, keys, np.ones(keys.shape))

    def moved(self, states: States, length: float, limit: float) -> tuple[States, float]:
        """Return the states after a step below a limit of the margin, and the share of accepted steps."""
        count, stays = len(states.points), np.sqrt(1 - length**2)
        points = stays * states.points + length * self.generator.standard_normal(states.points.shape)
        new = self.generator.uniform(size=(*states.keys.shape[:2], 1))
        tried = self._evaluated(
            points,
            np.concatenate([states.keys, new], axis=2),
            np.concatenate([stays * states.weights, np.full(new.shape, length)], axis=2),
        )
        accepted = tried.margins <= limit if limit > 0 else tried.margins < limit
        both = States.joined([states, tried])
        return both.select(np.where(accepted, count, 0) + np.arange(count)), float(accepted.mean())

    def _evaluated(self, points: Array, keys: Array, weights: Array) -> States:
        first = self.runs.count
        margins, failed = self.runs(points, (keys, weights))
        found = np.where(failed, np.nan, margins[:, 0])
        return States(points, keys, weights, found, first + np.arange(len(points)))

    def level(self, states: States, limit: float, length: float, *, adapt: bool, count: int) -> tuple[States, float]:
        """Return the states of the next level from the states below its limit, and the length of the last step."""
        rounds = max(-(-count // len(states.points)) - 1, 0)
        parts, now = [states], states
        for _ in range(rounds):
            now, share = self.moved(now, length, limit)
            parts.append(now)
            if adapt:
                length = float(np.clip(length * np.exp(share - 0.44), 0.05, 0.98))
        return States.joined(parts), length


def below(margins: Array, limit: float) -> Array:
    """Return which margins are in a level: violations for the limit zero."""
    return np.asarray(margins < limit if limit == 0 else margins <= limit)


def split_paths(
    runs: MarginRuns, space: StandardSpace, *, target: float, most: int, generator: np.random.Generator
) -> Analysis:
    """Estimate the probability that a single margin is below zero, with at most `most` realisations.

    `target` is the coefficient of variation at which sampling stops. Raise IntegrationError if `most` realisations are
    not enough.
    """
    chains = PathChains(runs, space, generator)
    count = int(np.clip(most // SHARE, SMALLEST, LARGEST))
    states = chains.drawn(count)
    drawn, lost = count, int(np.isnan(states.margins).sum())
    if 2 * lost > drawn:
        raise uqmbd.IntegrationError(
            f"{lost} of the first {drawn} realisations failed; check the distributions of the inputs. The most "
            f"frequent reason: {runs.reason}"
        )
    limits, lengths, length = list[float](), list[float](), 0.6
    too_few = uqmbd.IntegrationError(
        f"subset simulation on sampled paths needs more than the allowed {most} realisations; increase "
        "max_realisations."
    )
    while True:
        known = states.select(np.flatnonzero(~np.isnan(states.margins)))
        if not len(known.points) or len(limits) > MOST_LEVELS:
            raise too_few
        limit = _next_limit(known.margins, limits[-1] if limits else np.inf)
        limits.append(limit)
        if limit == 0.0:
            break
        inside = known.select(np.flatnonzero(known.margins <= limit))
        if runs.count + count > most:
            raise too_few
        states, length = chains.level(inside, limit, length, adapt=True, count=count)
        lengths.append(length)
    cost = runs.count
    left = most - cost
    count = min(count, int(count * left / (RUNS * 1.15 * cost)))
    if count < SMALLEST // 2:
        raise too_few
    probabilities, ends = list[float](), list[States]()
    while len(probabilities) < RUNS or _cov(probabilities) > target:
        if runs.count + 1.15 * count * (1 + len(lengths)) > most:
            break
        probability, states = 1.0, chains.drawn(count)
        drawn, lost = drawn + count, lost + int(np.isnan(states.margins).sum())
        for number, limit in enumerate(limits):
            within = below(states.margins, limit)
            probability *= float(within.mean())
            states = states.select(np.flatnonzero(within))
            if not len(states.points):
                break
            if number < len(lengths):
                states, _ = chains.level(states, limit, lengths[number], adapt=False, count=count)
        probabilities.append(probability)
        ends.append(states)
    if not np.mean(probabilities) > 0:  # no run reached a violation, although the first one did
        raise too_few
    return _analysis(chains, probabilities, ends, limits, (lost, drawn), runs, most)


def _next_limit(margins: Array, before: float) -> float:
    """Return the limit of the next level from the margins (K,) of the states in a level, whose limit is `before`.

    The limit is a quantile, or the largest margin below `before` where margins are equal or infinite.
    """
    limit = float(np.sort(margins)[max(int(LEVEL * len(margins)), min(2, len(margins))) - 1])
    if not limit < before:
        lower = margins[margins < before]
        if not len(lower):
            shown = "infinite" if np.isinf(before) else f"{before:.6g}"
            raise uqmbd.IntegrationError(
                f"subset simulation on sampled paths needs margins that decrease towards a violation, but all "
                f"{len(margins)} margins of a level are {shown}; use MonteCarlo, which counts violations."
            )
        limit = float(lower.max())
    return max(limit, 0.0)


def _cov(probabilities: list[float]) -> float:
    mean = float(np.mean(probabilities))
    if not mean > 0:
        return np.inf
    return float(np.std(probabilities, ddof=1) / mean / np.sqrt(len(probabilities)))


def _analysis(
    chains: PathChains,
    probabilities: list[float],
    ends: list[States],
    limits: list[float],
    lost: tuple[int, int],
    runs: MarginRuns,
    most: int,
) -> Analysis:
    """Return the result of several runs: the mean of their probabilities, with Student's interval of its logarithm.

    `lost`: failed realisations among the independent states, and the number of these states.
    """
    number = len(probabilities)
    mean, cov = float(np.mean(probabilities)), _cov(probabilities)
    share, most_lost = failing(np.zeros(0), lost[1], lost[0])
    known = max(1.0 - share, 1e-12)
    probability = min(mean / known, 1.0)
    factor = float(np.exp(min(stdtrit(number - 1, 0.975) * cov, 50.0)))
    one = ProbabilityEstimate(
        probability, cov * probability, probability / factor, min(probability * factor + most_lost, 1.0)
    )
    violations = States.joined(ends)
    weights = np.concatenate(
        [np.full(len(end.points), x / max(len(end.points), 1)) for x, end in zip(probabilities, ends, strict=True)]
    )
    total = max(len(weights), 1)
    sampled = Sampled(violations.points, weights * total / number / known, violations.margins[:, None], violations.rows)
    ledger = LimitStateLedger(runs, chains.space.dimension, most)
    notes = (f"mean of {number} independent runs of {len(limits)} levels",)
    return Analysis((one,), (), sampled, ledger, notes, dependent=True)
