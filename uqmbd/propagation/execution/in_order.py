"""Pieces of work done here, or by many workers: in order, and each kept as soon as it is finished."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any, TypeVar

from uqmbd.errors import StudyError
from uqmbd.propagation.execution.cost import Laps

__all__ = ["in_order"]

Piece = TypeVar("Piece")
Result = TypeVar("Result")

AHEAD = 64
"""Pieces that are done or held ahead of the one that is wanted next."""


def in_order(
    pieces: Sequence[Piece],
    executor: Executor | None,
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
) -> Iterator[Result]:
    """Yield the results of pieces of work, in their order.

    Parameters
    ----------
    pieces : sequence
        What is to be done.
    executor : concurrent.futures.Executor, optional
        Who does it; None: this process.
    known : callable
        Gives a result that need not be computed.
    work : callable
        Gives the function to call, and its arguments.
    keep : callable
        Is given each result with the seconds that it took; what it returns is yielded.
    """
    ready: dict[int, Result] = {}
    running: dict[Future[Result], int] = {}
    submitted, laps = 0, Laps()
    try:
        for wanted in range(len(pieces)):
            while wanted not in ready:
                # some in reserve for every worker, but never all at once: results must not pile up
                while submitted < len(pieces) and len(running) + len(ready) < AHEAD:
                    index, submitted = submitted, submitted + 1
                    if (found := known(pieces[index])) is not None:
                        ready[index] = found
                    else:
                        function, arguments = work(pieces[index])
                        if executor is None:
                            ready[index] = keep(pieces[index], function(*arguments), laps())
                        else:
                            running[executor.submit(function, *arguments)] = index
                    if executor is None:
                        break
                if wanted in ready:
                    break
                # one that failed ends the run: what is finished beside it is stored first
                for future in sorted(wait(running, return_when=FIRST_COMPLETED).done, key=_failed):
                    index = running.pop(future)
                    ready[index] = keep(pieces[index], future.result(), laps())
            yield ready.pop(wanted)
    finally:
        for future, index in running.items():
            if not future.cancel() and future.done() and not _failed(future):
                with contextlib.suppress(StudyError):  # whatever ended the run is said instead
                    keep(pieces[index], future.result(), laps())


def _failed(future: Future[Any]) -> bool:
    return future.cancelled() or future.exception() is not None
