"""Pieces of work, computed in this process or by workers: results in order, each stored as soon as it is finished.

The main process does little: per piece a fraction of a millisecond, for any number of workers, and no more when many
pieces are finished.
"""

from __future__ import annotations

import contextlib
import queue
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from itertools import islice
from logging import LogRecord
from typing import Any, Generic, TypeVar

import numpy as np

from uqmbd.errors import IntegrationError, StudyError
from uqmbd.propagation.execution.cost import Laps
from uqmbd.propagation.execution.transport import (
    Reply,
    Route,
    WorkerRegistry,
    death,
    forward,
    records_before,
    route_to,
    versions,
)

__all__ = ["run_in_order"]

Piece = TypeVar("Piece")
Result = TypeVar("Result")

HELD = 1 << 27
"""Bytes of results that wait for the next one in order; beyond, no further piece is sent."""

WAITING = 16
"""Most results that wait for the next one in order, relative to the most submitted pieces."""

DEATHS = 2
"""Deaths of workers after which a piece is lost."""

LATE = 4.0
"""Ratio to the typical time of a piece after which an unoccupied worker computes it as well."""

PAUSE = 0.002
"""Seconds between attempts while no worker accepts, and between checks."""

TICK = 0.25
"""Most seconds between checks for late pieces."""


def run_in_order(
    pieces: Sequence[Piece],
    executor: Executor | None,
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
    lost: Callable[[Piece, str], Result] | None = None,
    patience: float = 1.0,
) -> Generator[Result, None, None]:
    """Yield the results of pieces of work in order; without an executor this process computes them.

    A piece whose worker dies is tried once elsewhere. If one takes much longer than others (by at least `patience`, s),
    an unoccupied worker repeats it, and the first answer counts: both have the same bits. `known` returns a result that
    need not be computed. `work` returns the function and its arguments (some may be `Packed`), and `keep` the value to
    yield from a result and its time, s. `lost` returns the result of a piece whose second worker died, or raises, by
    default an error. Raise IntegrationError if no worker has the versions of this process, or a piece is lost.
    """
    if executor is None:
        return _compute_here(pieces, known, work, keep)
    return _Dispatcher(pieces, route_to(executor), known, work, keep, lost or _raise, patience).results()


def _compute_here(
    pieces: Sequence[Piece],
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
) -> Generator[Result, None, None]:
    laps = Laps()
    for piece in pieces:
        found = known(piece)
        if found is None:
            function, arguments = work(piece)
            found = keep(piece, function(*arguments), laps())
        yield found


def _raise(piece: object, reason: str) -> Any:
    raise IntegrationError(f"A piece of work was lost: {reason}.")


@dataclass
class _Submission:
    """A submitted piece of work."""

    futures: list[Future[Reply]] = field(default_factory=list)  # several where the piece is late
    whole: bool = False  # whether packed arguments are sent entirely
    sent: float = 0.0  # time of the last submission, s
    begun: float | None = None  # time since which a worker certainly runs it, s: since a later piece was answered
    deaths: int = 0  # of workers that ran it
    alone: bool = False  # whether no other piece may run at the same time


class _Dispatcher(Generic[Piece, Result]):
    """Sends pieces to workers, and yields their results in order."""

    def __init__(
        self,
        pieces: Sequence[Piece],
        route: Route,
        known: Callable[[Piece], Result | None],
        work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
        keep: Callable[[Piece, Result, float], Result],
        lost: Callable[[Piece, str], Result],
        patience: float,
    ) -> None:
        self.pieces, self.route, self.patience = pieces, route, patience
        self.known, self.work, self.keep, self.lost = known, work, keep, lost
        self.registry, self.laps = WorkerRegistry(versions()), Laps()
        self.next = self.held = 0
        self.tick = min(TICK, patience / 4 + PAUSE)
        self.looked = self.heard = time.monotonic()
        self.submissions: dict[int, _Submission] = {}
        """By the index of the piece, in the order in which they were sent."""
        self.refused: deque[int] = deque()
        self.suspects: deque[tuple[int, int]] = deque()
        """Pieces that may have killed a worker, and how many."""
        self.ready: dict[int, tuple[Result, int]] = {}
        """Results, and their bytes, by the index of the piece."""
        self.records: dict[int, tuple[LogRecord, ...]] = {}
        """Log records of workers for results that wait, by the index of the piece."""
        self.arrived: queue.SimpleQueue[tuple[int, Future[Reply]]] = queue.SimpleQueue()

    def results(self) -> Generator[Result, None, None]:
        """Yield the results in order."""
        try:
            for wanted in range(len(self.pieces)):
                while wanted not in self.ready:
                    self._send_more(wanted)
                    if wanted not in self.ready:
                        self._take()
                result, size = self.ready.pop(wanted)
                self.held -= size
                forward(self.records.pop(wanted, ()))
                yield result
        finally:
            self._end()

    def _send_more(self, wanted: int) -> None:
        """Send further pieces: a few in reserve for every worker, never all at once, to bound the memory of results."""
        if self.suspects and not self.submissions:
            # if a dead worker does not identify its piece, suspects run alone: other pieces must not share the blame
            index, deaths = self.suspects.popleft()
            self._send(index, _Submission(whole=True, deaths=deaths, alone=True))
        elif not self.suspects and not any(submission.alone for submission in self._first()):
            self._send_refused()
            if not self.refused:
                self._send_new(wanted)
        if self.route.apart and (now := time.monotonic()) - self.looked >= self.tick:
            self.looked = now
            self._send_late(now)

    def _first(self) -> Iterator[_Submission]:
        """Yield the first submission, if there is one; a piece that runs alone is the only one."""
        return islice(self.submissions.values(), 1)

    def _send_refused(self) -> None:
        """Send refused pieces again, as many as the accepting workers can compute."""
        while self.refused and len(self.submissions) < self.registry.window - 1:
            self._send(self.refused.popleft(), _Submission(whole=self.registry.wants(0)))
        if self.refused and not self.submissions:
            self.registry.complain()
            time.sleep(PAUSE)
            self._send(self.refused.popleft(), _Submission(whole=self.registry.wants(0)))

    def _send_new(self, wanted: int) -> None:
        """Send the next pieces, unless too many are under way, or too many results wait for the one that is wanted."""
        window = self.registry.window
        while self.next < len(self.pieces) and len(self.submissions) < window:
            if self.next > wanted and (self.held >= HELD or len(self.ready) >= WAITING * window):
                return
            index, self.next = self.next, self.next + 1
            if (found := self.known(self.pieces[index])) is not None:
                self._add_result(index, found, wanted)
            else:
                self._send(index, _Submission())

    def _send(self, index: int, submission: _Submission) -> None:
        """Send a piece, for the first time or once more."""
        function, arguments = self.work(self.pieces[index])
        future = self.route.send(function, arguments, whole=submission.whole, late=submission.futures)
        submission.futures.append(future)
        submission.sent = time.monotonic()
        self.submissions.setdefault(index, submission)
        future.add_done_callback(partial(self._hear, index))

    def _hear(self, index: int, future: Future[Reply]) -> None:
        self.arrived.put((index, future))

    def _send_late(self, now: float) -> None:
        """Send late pieces to unoccupied workers as well; to one more each time the delay doubles."""
        late = self.patience + LATE * self.registry.typical
        behind, working = [], 0
        for index, submission in self.submissions.items():
            # no worker reports when it begins: a piece has begun at the latest when replies end
            begun = max(submission.sent, self.heard) if submission.begun is None else submission.begun
            if now - begun >= late * 2 ** (len(submission.futures) - 1):
                behind.append((index, submission))
            else:
                working += len(submission.futures)
        for index, submission in behind[: max(self.registry.count - working, 0)]:
            submission.whole = True
            self._send(index, submission)

    def _take(self) -> None:
        """Wait for a reply, at most for one tick, and process it."""
        try:
            index, future = self.arrived.get(timeout=self.tick)
        except queue.Empty:
            return
        self.heard = time.monotonic()
        submission = self.submissions.get(index)
        if submission is None or future not in submission.futures:
            return  # a second answer
        submission.futures.remove(future)
        error = CancelledError() if future.cancelled() else future.exception()
        if error is not None:
            self._failed(index, submission, error)
            return
        reply = future.result()
        if reply.kind == "done":
            if reply.records:
                self.records[index] = reply.records
            self._note_begun(index)
            self.registry.done(reply.worker, reply.seconds)
            self._leave(index)
            self._add_result(index, self.keep(self.pieces[index], reply.result, self.laps()))
            return
        forward(reply.records)
        if submission.futures:
            return  # another worker computes it
        if reply.kind == "missing":
            self.registry.missing(reply.worker)
            del self.submissions[index]
            whole = self.registry.wants(sum(other.whole for other in self.submissions.values()))
            self._send(index, _Submission(whole=whole, deaths=submission.deaths, alone=submission.alone))
        else:
            self.registry.refuse(reply.worker)
            self.route.refused(reply.worker)
            del self.submissions[index]
            if submission.deaths:
                self.suspects.appendleft((index, submission.deaths))
                self.registry.complain()
            else:
                self.refused.append(index)

    def _failed(self, index: int, submission: _Submission, error: BaseException) -> None:
        reason = death(error)
        if not reason:
            forward(records_before(error))
            raise error
        self.route.renew()
        self.registry.gone()
        submission.deaths += 1
        self._leave(index)
        if submission.deaths >= DEATHS:
            reason = f"the process that computed it ended unexpectedly, and so did that of a second attempt ({reason})"
            self._add_result(index, self.lost(self.pieces[index], reason))
        elif self.route.names_the_dead:
            self._send(index, _Submission(whole=True, deaths=submission.deaths))
        else:
            self.suspects.append((index, submission.deaths))

    def _note_begun(self, index: int) -> None:
        """Note that pieces sent before this one are running."""
        for other, submission in self.submissions.items():
            if other == index:
                return
            if submission.begun is None:
                submission.begun = self.heard

    def _leave(self, index: int) -> None:
        for future in self.submissions.pop(index).futures:
            future.cancel()

    def _add_result(self, index: int, result: Result, wanted: int | None = None) -> None:
        size = 0 if index == wanted else size_of(result)
        self.ready[index] = result, size
        self.held += size

    def _end(self) -> None:
        """Cancel what is under way, and keep what is finished."""
        for index, submission in self.submissions.items():
            for future in submission.futures:
                if future.cancel() or not future.done() or future.cancelled() or future.exception() is not None:
                    continue
                reply = future.result()
                if reply.kind == "done":
                    with contextlib.suppress(StudyError):  # the error that ended the run is raised instead
                        self.keep(self.pieces[index], reply.result, self.laps())
                    self.records[index] = reply.records
                    break
        for _, records in sorted(self.records.items()):
            forward(records)


def size_of(value: object) -> int:
    """Return the approximate number of bytes of a result: its arrays, and some for each object.

    >>> size_of({"a": np.zeros(1000)}) // 1000
    8
    """
    if isinstance(value, np.ndarray):
        return 100 + value.nbytes
    if isinstance(value, (str, bytes)):
        return 50 + len(value)
    if isinstance(value, Mapping):
        return 200 + sum(map(size_of, value.values()))
    if isinstance(value, (tuple, list)):
        return 50 + sum(map(size_of, value))
    if is_dataclass(value):
        return 100 + sum(size_of(getattr(value, one.name)) for one in fields(value))
    return 30
