"""Ledger of a run with a budget: realisations are counted before their computation, and each is computed once."""

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
"""Maximum size of finished chunks in memory for the next size of a method, bytes, without chunks of a checkpoint."""


class BudgetSpent(BaseException):
    """The next task would exceed the budget.

    The class is not an `Exception`: a method that tolerates missing realisations must not continue without these.
    """


@dataclass
class Ledger:
    """Count the realisations of a method over all of its sizes, with limits on their number and on time.

    >>> ledger = Ledger(most=100)
    >>> ledger.begin(64)
    >>> ledger.begin(64)
    Traceback (most recent call last):
        ...
    uqmbd.propagation.execution.ledger.BudgetSpent: 64 realisations are needed, but only 36 remain
    """

    most: float = float("inf")  # maximum number of computed realisations in total
    until: float = float("inf")  # reading of the clock after which no new task begins, s
    clock: Callable[[], float] = time.monotonic  # s
    spent: int = 0  # number of computed realisations
    reused: int = 0  # number of needed realisations that were already computed
    computing: float = 0.0  # computing time of the realisations, s
    done: int = 0  # number of finished realisations, computed or reused
    _chunks: dict[str, Chunk] = field(default_factory=dict, repr=False)
    _held: int = 0
    _running: int = 0
    _last: float = 0.0

    def begin(self, count: int = 0) -> None:
        """Count realisations (0 for other tasks) before their computation; raise BudgetSpent beyond the budget."""
        if self.spent + count > self.most:
            raise BudgetSpent(f"{count} realisations are needed, but only {self.most - self.spent:g} remain")
        if self.clock() >= self.until:
            raise BudgetSpent("the time limit is reached")
        self.spent += count
        if count:
            self._last = self.clock() if not self._running else self._last
            self._running += 1

    def find(self, part: Array, key: Callable[[Array], str], *, join: bool) -> Chunk | None:
        """Return a chunk at inputs (K, input) that another size of the method computed.

        `key` maps inputs to the name of their chunk. If `join` is true, smaller chunks may be joined to a larger one,
        except chunks with realisations that IDA integrated: these share steps with other realisations.
        """
        found, size = self._chunks.get(key(part)), CHUNK
        while found is None and join and self._chunks and size < len(part):
            pieces = [self._chunks.get(key(part[k : k + size])) for k in range(0, len(part), size)]
            whole = [piece for piece in pieces if piece is not None and not piece.counters.get("by_ida")]
            found, size = _joined(whole) if len(whole) == len(pieces) else None, 2 * size
        return found

    def reuse(self, count: int) -> None:
        """Count realisations that are reused."""
        self.reused += count
        self.done += count

    def finish(self, count: int) -> None:
        """Record finished realisations."""
        self.done += count
        now = self.clock()
        self.computing, self._last, self._running = self.computing + now - self._last, now, max(self._running - 1, 0)

    def keep(self, key: str, chunk: Chunk) -> None:
        """Record a finished chunk, and store it in memory if its size does not exceed `LIMIT`."""
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
