"""Linear algebra on one thread."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["one_thread"]


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep linear algebra to one thread, so that its bits do not depend on the number of processors."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield
