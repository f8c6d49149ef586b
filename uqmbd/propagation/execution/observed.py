"""Realisations that are put by while a method computes: from them the error of the integration is measured."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from uqmbd.propagation.execution.realisations import Realisations
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["AGAIN", "Observed"]


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
    """

    values: list[Array] = field(default_factory=list)
    responses: list[Array] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)
    missing: Counter[int] = field(default_factory=Counter)
    counted: int = 0
    failed: int = 0

    def add(self, part: Realisations) -> None:
        """Take some of a chunk, evenly spread, until there are enough."""
        self.counters.update(part.counters)
        good = np.flatnonzero(part.status == Status.OK)
        late = np.isnan(part.response[part.status == Status.CENSORED]).any(axis=2).sum(axis=0)
        self.missing.update({k: int(late[k]) for k in np.flatnonzero(late).tolist()})
        self.counted += part.censored + len(good)
        self.failed += part.failures
        wanted = min(AGAIN - len(self.values), len(good))
        if wanted > 0:
            for k in good[np.linspace(0, len(good) - 1, wanted).round().astype(int)].tolist():
                self.values.append(part.values[k].copy())
                self.responses.append(part.response[k].copy())
