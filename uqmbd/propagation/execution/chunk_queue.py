"""Chunks computed one after the other, or by many workers: in order, and each kept as soon as it is finished."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.propagation.execution.chunks import Chunk, compute_chunk
from uqmbd.propagation.execution.cost import Laps
from uqmbd.propagation.execution.tasks import failed
from uqmbd.typing import Array

__all__ = ["computed_chunks"]


AHEAD = 64
"""Chunks that are computed or held ahead of the one that is wanted next."""


def computed_chunks(
    parts: Sequence[Array],
    executor: Executor | None,
    found: Callable[[Array], Chunk | None],
    task: Callable[[Array], tuple[Any, ...]],
    keep: Callable[[Array, Chunk, float], Chunk],
) -> Iterator[Chunk]:
    """Yield the chunks of inputs, in order.

    Parameters
    ----------
    parts : sequence of array, shape (K, input)
        Inputs of each chunk.
    executor : concurrent.futures.Executor, optional
        Who computes; None: this process.
    found : callable
        Gives a chunk that need not be computed.
    task : callable
        Gives the arguments of `compute_chunk`.
    keep : callable
        Is given each chunk that was computed, with its seconds; what it returns is yielded.
    """
    ready: dict[int, Chunk] = {}
    running: dict[Future[Chunk], int] = {}
    submitted, laps = 0, Laps()
    try:
        for wanted in range(len(parts)):
            while wanted not in ready:
                # some in reserve for every worker, but never all at once: results must not pile up
                while submitted < len(parts) and len(running) + len(ready) < AHEAD:
                    index, submitted = submitted, submitted + 1
                    known = found(parts[index])
                    if known is not None:
                        ready[index] = known
                    elif executor is None:
                        ready[index] = keep(parts[index], compute_chunk(*task(parts[index])), laps())
                    else:
                        running[executor.submit(compute_chunk, *task(parts[index]))] = index
                    if executor is None:
                        break
                if wanted in ready:
                    break
                # one that failed ends the run: what is finished beside it is stored first
                for future in sorted(wait(running, return_when=FIRST_COMPLETED).done, key=failed):
                    index = running.pop(future)
                    ready[index] = keep(parts[index], future.result(), laps())
            yield ready.pop(wanted)
    finally:
        for future, index in running.items():
            if not future.cancel() and future.done() and not failed(future):
                with contextlib.suppress(StudyError):  # whatever ended the run is said instead
                    keep(parts[index], future.result(), laps())
