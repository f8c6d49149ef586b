"""Pieces of work done here, or by many workers: in order, and each kept as soon as it is finished.

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
    route_to,
    said_before,
    versions,
)

__all__ = ["run_in_order"]

Piece = TypeVar("Piece")
Result = TypeVar("Result")

HELD = 1 << 27
"""Bytes of results that wait for the one that is wanted next; beyond, no further piece is sent."""

WAITING = 16
"""Results that wait for the one that is wanted next, at most, over the pieces that are under way at most."""

DEATHS = 2
"""Deaths of workers after which a piece is lost."""

LATE = 4.0
"""Over the time that pieces take: after so much longer one is given to another worker, too, who has nothing to do."""

PAUSE = 0.002
"""Seconds between attempts while nobody accepts, and between looks."""

TICK = 0.25
"""Seconds between looks whether a piece is late, at most."""


def run_in_order(
    pieces: Sequence[Piece],
    executor: Executor | None,
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
    lost: Callable[[Piece, str], Result] | None = None,
    patience: float = 1.0,
) -> Generator[Result, None, None]:
    """Yield the results of pieces of work, in their order; without an executor they are computed in this process.

    A piece whose worker dies is tried once elsewhere. If one takes much longer than others (by at least `patience`, s),
    an unoccupied worker repeats it, and the first answer counts: both have the same bits. `known` returns a result that
    need not be computed. `work` returns the function and its arguments (some may be `Packed`), and `keep` the value to
    yield from a result and its time, s. `lost` returns the result of a piece whose second worker died, or raises, by
    default an error. Raise IntegrationError if no worker has the versions of this process, or a piece is lost.
    """
    if executor is None:
        return _here(pieces, known, work, keep)
    return _There(pieces, route_to(executor), known, work, keep, lost or _raise, patience).results()


def _here(
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
class _Flight:
    """A submitted piece of work."""

    futures: list[Future[Reply]] = field(default_factory=list)  # several where the piece is late
    whole: bool = False  # whether packed arguments are sent entirely
    sent: float = 0.0  # time of the last submission, s
    begun: float | None = None  # time since which a worker certainly runs it, s: since a later piece was answered
    deaths: int = 0  # of workers that ran it
    alone: bool = False  # whether no other piece may run at the same time


class _There(Generic[Piece, Result]):
    """Pieces of work at workers."""

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
        self.seen, self.laps = WorkerRegistry(versions()), Laps()
        self.next = self.held = 0
        self.tick = min(TICK, patience / 4 + PAUSE)
        self.looked = self.heard = time.monotonic()
        self.flights: dict[int, _Flight] = {}
        """By the index of the piece, in the order in which they were sent."""
        self.refused: deque[int] = deque()
        self.suspects: deque[tuple[int, int]] = deque()
        """Pieces that may have killed a worker, and how many."""
        self.ready: dict[int, tuple[Result, int]] = {}
        """Results, and their bytes, by the index of the piece."""
        self.said: dict[int, tuple[LogRecord, ...]] = {}
        """By loggers of workers, of results that wait, by the index of the piece."""
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
                forward(self.said.pop(wanted, ()))
                yield result
        finally:
            self._end()

    def _send_more(self, wanted: int) -> None:
        """Send what may be sent: some in reserve for every worker, never all at once, for results must not pile up."""
        if self.suspects and not self.flights:
            # if a dead worker does not identify its piece, suspects run alone: other pieces must not share the blame
            index, deaths = self.suspects.popleft()
            self._send(index, _Flight(whole=True, deaths=deaths, alone=True))
        elif not self.suspects and not any(flight.alone for flight in self._first()):
            self._send_refused()
            if not self.refused:
                self._send_new(wanted)
        if self.route.apart and (now := time.monotonic()) - self.looked >= self.tick:
            self.looked = now
            self._send_again(now)

    def _first(self) -> Iterator[_Flight]:
        """Yield what was sent first, if anything is under way: what goes alone is the only one."""
        return islice(self.flights.values(), 1)

    def _send_refused(self) -> None:
        """Send what was refused, as much as those can do who accept."""
        while self.refused and len(self.flights) < self.seen.window - 1:
            self._send(self.refused.popleft(), _Flight(whole=self.seen.wants(0)))
        if self.refused and not self.flights:
            self.seen.complain()
            time.sleep(PAUSE)
            self._send(self.refused.popleft(), _Flight(whole=self.seen.wants(0)))

    def _send_new(self, wanted: int) -> None:
        """Send the next pieces, unless too many are under way, or too many results wait for the one that is wanted."""
        window = self.seen.window
        while self.next < len(self.pieces) and len(self.flights) < window:
            if self.next > wanted and (self.held >= HELD or len(self.ready) >= WAITING * window):
                return
            index, self.next = self.next, self.next + 1
            if (found := self.known(self.pieces[index])) is not None:
                self._put(index, found, wanted)
            else:
                self._send(index, _Flight())

    def _send(self, index: int, flight: _Flight) -> None:
        """Send a piece, for the first time or once more."""
        function, arguments = self.work(self.pieces[index])
        future = self.route.send(function, arguments, whole=flight.whole, late=flight.futures)
        flight.futures.append(future)
        flight.sent = time.monotonic()
        self.flights.setdefault(index, flight)
        future.add_done_callback(partial(self._hear, index))

    def _hear(self, index: int, future: Future[Reply]) -> None:
        self.arrived.put((index, future))

    def _send_again(self, now: float) -> None:
        """Give pieces that are late to those who have nothing to do; to one more whenever twice the time has passed."""
        late = self.patience + LATE * self.seen.typical
        behind, working = [], 0
        for index, flight in self.flights.items():
            # nobody says when a worker begins: what is sent begins at the latest when nobody answers any more
            begun = max(flight.sent, self.heard) if flight.begun is None else flight.begun
            if now - begun >= late * 2 ** (len(flight.futures) - 1):
                behind.append((index, flight))
            else:
                working += len(flight.futures)
        for index, flight in behind[: max(self.seen.count - working, 0)]:
            flight.whole = True
            self._send(index, flight)

    def _take(self) -> None:
        """Wait for an answer, for a moment at most, and see what it says."""
        try:
            index, future = self.arrived.get(timeout=self.tick)
        except queue.Empty:
            return
        self.heard = time.monotonic()
        flight = self.flights.get(index)
        if flight is None or future not in flight.futures:
            return  # a second answer
        flight.futures.remove(future)
        error = CancelledError() if future.cancelled() else future.exception()
        if error is not None:
            self._failed(index, flight, error)
            return
        said = future.result()
        if said.kind == "done":
            if said.said:
                self.said[index] = said.said
            self._begun_before(index)
            self.seen.done(said.worker, said.seconds)
            self._leave(index)
            self._put(index, self.keep(self.pieces[index], said.result, self.laps()))
            return
        forward(said.said)
        if flight.futures:
            return  # somebody else does it
        if said.kind == "missing":
            self.seen.missing(said.worker)
            del self.flights[index]
            whole = self.seen.wants(sum(other.whole for other in self.flights.values()))
            self._send(index, _Flight(whole=whole, deaths=flight.deaths, alone=flight.alone))
        else:
            self.seen.refuse(said.worker)
            self.route.refused(said.worker)
            del self.flights[index]
            if flight.deaths:
                self.suspects.appendleft((index, flight.deaths))
                self.seen.complain()
            else:
                self.refused.append(index)

    def _failed(self, index: int, flight: _Flight, error: BaseException) -> None:
        reason = death(error)
        if not reason:
            forward(said_before(error))
            raise error
        self.route.renew()
        self.seen.gone()
        flight.deaths += 1
        self._leave(index)
        if flight.deaths >= DEATHS:
            said = f"the process that computed it ended unexpectedly, and so did that of a second attempt ({reason})"
            self._put(index, self.lost(self.pieces[index], said))
        elif self.route.names_the_dead:
            self._send(index, _Flight(whole=True, deaths=flight.deaths))
        else:
            self.suspects.append((index, flight.deaths))

    def _begun_before(self, index: int) -> None:
        """Note that what was sent before this piece is being worked at."""
        for other, flight in self.flights.items():
            if other == index:
                return
            if flight.begun is None:
                flight.begun = self.heard

    def _leave(self, index: int) -> None:
        for future in self.flights.pop(index).futures:
            future.cancel()

    def _put(self, index: int, result: Result, wanted: int | None = None) -> None:
        size = 0 if index == wanted else size_of(result)
        self.ready[index] = result, size
        self.held += size

    def _end(self) -> None:
        """Cancel what is under way, and keep what is finished."""
        for index, flight in self.flights.items():
            for future in flight.futures:
                if future.cancel() or not future.done() or future.cancelled() or future.exception() is not None:
                    continue
                said = future.result()
                if said.kind == "done":
                    with contextlib.suppress(StudyError):  # the error that ended the run is raised instead
                        self.keep(self.pieces[index], said.result, self.laps())
                    self.said[index] = said.said
                    break
        for _, records in sorted(self.said.items()):
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
