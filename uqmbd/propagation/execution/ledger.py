"""What a run with a budget has spent: realisations are counted before they are computed, and none is computed twice."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from uqmbd.dynamics import MarginValues, ScalarValues
from uqmbd.propagation.execution.chunks import CHUNK, Chunk
from uqmbd.typing import Array

__all__ = ["LIMIT", "BudgetSpent", "Ledger"]

LIMIT = 200_000_000
"""Bytes of finished chunks that are held in memory for the next size of a method, beside those of a checkpoint."""


class BudgetSpent(BaseException):
    """The next piece of work would exceed the budget.

    No `Exception`: a method that goes on without some realisations must not go on without these.
    """


@dataclass
class Ledger:
    """Count of what a method computes at its several sizes, with limits on realisations and time.

    >>> ledger = Ledger(most=100)
    >>> ledger.begin(64)
    >>> ledger.begin(64)
    Traceback (most recent call last):
        ...
    uqmbd.propagation.execution.ledger.BudgetSpent: 64 realisations are needed, and 36 are left
    """

    most: float = float("inf")  # realisations that may be computed in total
    until: float = float("inf")  # reading of the clock after which no work begins
    clock: Callable[[], float] = time.monotonic  # s
    spent: int = 0  # realisations that were computed
    reused: int = 0  # realisations that were needed and known
    computing: float = 0.0  # seconds of the computed realisations
    done: int = 0  # finished realisations, computed or known
    _chunks: dict[str, Chunk] = field(default_factory=dict, repr=False)
    _held: int = 0
    _running: int = 0
    _last: float = 0.0

    def begin(self, count: int = 0) -> None:
        """Count realisations that are about to be computed (0: other work); raise BudgetSpent beyond the budget."""
        if self.spent + count > self.most:
            raise BudgetSpent(f"{count} realisations are needed, and {self.most - self.spent:g} are left")
        if self.clock() >= self.until:
            raise BudgetSpent("the time is over")
        self.spent += count
        if count:
            self._last = self.clock() if not self._running else self._last
            self._running += 1

    def find(self, part: Array, key: Callable[[Array], str], *, join: bool) -> Chunk | None:
        """Return a chunk at inputs (K, input) that was computed for another size of the method.

        `key` maps inputs to the name of their chunk. With `join`, where a realisation does not depend on the others in
        its chunk, smaller chunks make up a larger one.
        """
        found, size = self._chunks.get(key(part)), CHUNK
        while found is None and join and self._chunks and size < len(part):
            pieces = [self._chunks.get(key(part[k : k + size])) for k in range(0, len(part), size)]
            whole = [piece for piece in pieces if piece is not None]
            found, size = _joined(whole) if len(whole) == len(pieces) else None, 2 * size
        return found

    def reuse(self, count: int) -> None:
        """Count realisations that are there already."""
        self.reused += count
        self.done += count

    def finish(self, count: int) -> None:
        """Note realisations that were computed."""
        self.done += count
        now = self.clock()
        self.computing, self._last, self._running = self.computing + now - self._last, now, max(self._running - 1, 0)

    def keep(self, key: str, chunk: Chunk) -> None:
        """Note a chunk that was computed; hold it, if there is room."""
        self.finish(len(chunk.status))
        size = chunk.response.nbytes + (0 if chunk.margins is None else chunk.margins.running.nbytes)
        if self._held + size <= LIMIT and key not in self._chunks:
            self._chunks[key] = chunk
            self._held += size


def _joined(chunks: list[Chunk]) -> Chunk:
    """Join chunks of successive realisations."""
    counters: Counter[str] = Counter()
    for chunk in chunks:
        counters.update(chunk.counters)
    scalars = [chunk.scalars for chunk in chunks if chunk.scalars is not None]
    margins = [chunk.margins for chunk in chunks if chunk.margins is not None]
    return Chunk(
        np.concatenate([chunk.response for chunk in chunks]),
        np.concatenate([chunk.status for chunk in chunks]),
        tuple(message for chunk in chunks for message in chunk.messages),
        dict(counters),
        ScalarValues.joined(scalars) if scalars else None,
        MarginValues.joined(margins) if margins else None,
        sum(chunk.seconds for chunk in chunks),
    )
