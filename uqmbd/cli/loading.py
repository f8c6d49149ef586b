"""Imports and study scripts are loaded without a search for garbage after every few hundred objects.

What is loaded stays until the end: of a short run, a tenth of the time goes into looking through it again and again
(1.4 s of 11, by `gc.callbacks`).
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["loading"]

SELDOM = 500_000
"""New objects between two searches while loading, more than imports make: what a script leaves is still found."""


@contextmanager
def loading() -> Iterator[None]:
    """Search for garbage seldom while the context lasts, and never again among what it has made.

    Examples
    --------
    >>> before = gc.get_threshold()
    >>> with loading():
    ...     print(gc.get_threshold()[0])
    500000
    >>> gc.get_threshold() == before
    True
    """
    thresholds = gc.get_threshold()
    gc.set_threshold(SELDOM, *thresholds[1:])
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(*thresholds)
