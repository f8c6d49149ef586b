"""The cost of a method over that of the best one, for each mechanism, question and accuracy."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .recommendations import ACCURACIES, Recommendation, before_run
from .runs import Row

__all__ = ["Best", "Regret", "before_runs", "best_methods", "costs_of", "moments", "regrets"]

KNOWN = 1 / 3
"""Largest error of the reference over the accuracy at which a question is judged."""

Task = tuple[str, str, float]
"""Mechanism, question, accuracy."""


@dataclass(frozen=True)
class Best:
    """The method that reaches an accuracy with the fewest realisations."""

    mechanism: str
    kind: str
    question: str
    accuracy: float
    method: str
    size: str
    error: float
    realisations: int
    seconds: float


@dataclass(frozen=True)
class Regret:
    """Realisations of the recommended method over those of the best one; NaN: no method reaches the accuracy.

    `reached` is whether the recommended method states the accuracy: a run that misses it reports that.
    """

    mechanism: str
    kind: str
    accuracy: float
    rules: str
    method: str
    best: str
    regret: float
    error: float
    reached: bool


def costs_of(rows: Iterable[Row]) -> dict[Task, dict[str, Best]]:
    """Return, for each task, the least costly size of each method whose error is at most the accuracy at every seed."""
    sizes: dict[tuple[str, str, str, str], list[Row]] = defaultdict(list)
    for row in rows:
        if row.question and not row.failure:
            sizes[row.mechanism, row.question, row.method, row.size].append(row)
    found: dict[Task, dict[str, Best]] = defaultdict(dict)
    for (mechanism, question, method, size), own in sizes.items():
        error = max(row.error for row in own)
        cost, seconds = (float(np.mean([getattr(row, name) for row in own])) for name in ("realisations", "seconds"))
        for accuracy in ACCURACIES:
            if error <= accuracy and max(row.truth_error for row in own) <= KNOWN * accuracy:
                known = found[mechanism, question, accuracy].get(method)
                if known is None or cost < known.realisations:
                    best = Best(mechanism, own[0].kind, question, accuracy, method, size, error, round(cost), seconds)
                    found[mechanism, question, accuracy][method] = best
    return found


def best_methods(rows: Iterable[Row]) -> list[Best]:
    """Return the best method of each task that some method solves."""
    return [min(own.values(), key=lambda one: one.realisations) for own in costs_of(rows).values()]


def moments(costs: Mapping[Task, Mapping[str, Best]], mechanism: str, accuracy: float) -> Mapping[str, Best]:
    """Return the methods that reach an accuracy of both moments, with the larger cost of the two."""
    both = [costs.get((mechanism, question, accuracy), {}) for question in ("mean", "std")]
    return {name: max((one[name] for one in both), key=lambda b: b.realisations) for name in both[0] if name in both[1]}


def regrets(rows: Sequence[Row], recommended: Iterable[Recommendation]) -> list[Regret]:
    """Return the regret of each recommendation, by realisations of the recommended method.

    The best method is the one with the fewest realisations of all rows, and of all methods of the run itself.
    """
    costs, found = costs_of(rows), []
    for one in recommended:
        reached = moments(costs, one.mechanism, one.accuracy)
        best = min(reached.values(), key=lambda b: b.realisations, default=None)
        title = f"{best.method}, {best.size}" if best else ""
        least = best.realisations if best else 0
        if one.least and (not least or one.least < least):
            least, title = one.least, "a method of the run"
        ratio = one.realisations / least if least and one.method else np.nan
        about = one.mechanism, one.kind, one.accuracy, one.rules, one.method
        found.append(Regret(*about, title, ratio, one.error, one.stated <= one.accuracy))
    return found


def before_runs(rows: Sequence[Row], kinds: Mapping[str, str]) -> list[Regret]:
    """Return the regret of a choice before any run, from the kind of a mechanism and its number of inputs alone.

    `reached` is whether the true error is at most the accuracy; the error is that at all seeds.
    """
    costs, found = costs_of(rows), []
    sizes: dict[tuple[str, str, str], list[Row]] = defaultdict(list)
    for row in rows:
        if row.question in ("mean", "std") and not row.failure:
            sizes[row.mechanism, row.method, row.size].append(row)
    for mechanism, kind in kinds.items():
        for accuracy in ACCURACIES:
            solved = moments(costs, mechanism, accuracy).values()
            own = next(
                (sizes[mechanism, *one] for one in before_run(mechanism, accuracy) if (mechanism, *one) in sizes), []
            )
            best = min(solved, key=lambda b: b.realisations, default=None)
            if best is None or not own:
                continue
            error, cost = max(row.error for row in own), float(np.mean([row.realisations for row in own]))
            about = mechanism, kind, accuracy, "before", own[0].method
            title = f"{best.method}, {best.size}"
            found.append(Regret(*about, title, cost / best.realisations, error, error <= accuracy))
    return found
