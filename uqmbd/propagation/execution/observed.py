"""Realisations that are put by while a method computes: from them the error of the integration is measured."""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from uqmbd.logs import realisations
from uqmbd.propagation.execution.realisations import Realisations
from uqmbd.status import Status
from uqmbd.typing import Array, Index

__all__ = ["AGAIN", "Observed", "evenly", "late_outputs", "log_realisations"]


AGAIN = 3
"""Realisations that are integrated again."""


@dataclass
class Observed:
    """A few of the successful realisations that a method has computed, and who has integrated all of them.

    Attributes
    ----------
    values, responses : list of array
        Inputs (input,), and responses (output, time).
    counters : Counter
        Of the solvers, summed.
    missing : Counter of int
        In how many realisations each output does not happen, by its number; those that always happen are not in it.
    counted : int
        The successful realisations, with those.
    failed : int
        The others.
    extent : tuple of array, array and int, or None
        Smallest and largest values (output, time) of the successful realisations that workers do not reduce, and their
        number; None: there is none.
    """

    values: list[Array] = field(default_factory=list)
    responses: list[Array] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)
    missing: Counter[int] = field(default_factory=Counter)
    counted: int = 0
    failed: int = 0
    extent: tuple[Array, Array, int] | None = None

    def add(self, part: Realisations) -> None:
        """Count those of a chunk, and take some of it, evenly spread, until there are enough."""
        self.count(part, late_outputs(part))
        chosen = evenly(part.status, AGAIN - len(self.values))
        self.take(part.values[chosen], part.response[chosen])
        good = part.response[part.status == Status.OK]
        if len(good):
            low, high, count = good.min(axis=0), good.max(axis=0), len(good)
            if self.extent is not None:
                before = self.extent
                low, high, count = np.minimum(low, before[0]), np.maximum(high, before[1]), count + before[2]
            self.extent = low, high, count

    def count(self, part: Realisations, late: Index) -> None:
        """Count those of a chunk, and in how many of them each output does not happen."""
        self.counters.update(part.counters)
        self.missing.update({k: int(late[k]) for k in np.flatnonzero(late).tolist()})
        self.counted += int(np.count_nonzero(part.status == Status.OK)) + part.censored
        self.failed += part.failures

    def take(self, values: Array, responses: Array) -> None:
        """Take some, until there are enough."""
        for value, response in zip(values, responses, strict=True):
            if len(self.values) < AGAIN:
                self.values.append(value.copy())
                self.responses.append(response.copy())


def evenly(status: Index, wanted: int = AGAIN) -> Index:
    """Return the indices of some realisations that succeeded, evenly spread."""
    good = np.flatnonzero(status == Status.OK)
    count = max(0, min(wanted, len(good)))
    found: Index = good[np.linspace(0, len(good) - 1, count).round().astype(int)]
    return found


def late_outputs(part: Realisations) -> Index:
    """Return in how many realisations each output does not happen."""
    found: Index = np.isnan(part.response[part.status == Status.CENSORED]).any(axis=2).sum(axis=0)
    return found


def log_realisations(label: str, kind: str, part: Realisations) -> None:
    """Log a chunk of realisations, and what failed in it, for who listens to ``uqmbd.realisations``."""
    if not realisations.isEnabledFor(logging.INFO):
        return
    realisations.debug("%s: %d realisations of %s in %.3g s", label, len(part.status), kind, part.wall_time)
    failed = np.flatnonzero((part.status != Status.OK) & (part.status != Status.CENSORED))
    if len(failed):
        first = part.messages[int(failed[0])]
        realisations.info(
            "%s: %d of %d realisations failed; the first: %s", label, len(failed), len(part.status), first
        )
    for row in failed.tolist() if realisations.isEnabledFor(logging.DEBUG) else ():
        realisations.debug("%s: inputs %s failed: %s", label, part.values[row].tolist(), part.messages[row])
