"""Log messages of uqmbd by the standard library's `logging`: silent unless a program listens.

Loggers are ``uqmbd.methods`` (beginnings, ends and failures), ``uqmbd.realisations`` (chunks and their failures),
``uqmbd.refinement`` (orders, sparse grids, elements) and ``uqmbd.kernels`` (compiled, or taken from the cache). Further
loggers are ``uqmbd.derivation`` (derivation of equations, by parts of a mechanism) and ``uqmbd.results`` (files that
were read without a digest). A run logs a few messages of the level INFO, and a message of the level DEBUG for each
chunk of realisations, kernel and part.

Workers return their log records with the results (uqmbd/propagation/execution/transport/log_records.py).

The logger ``uqmbd`` has a separate level. The import of chaospy sets the root logger to the level DEBUG and adds a
handler that discards all messages. Without a separate level, uqmbd would format messages that nobody reads.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Sequence
from typing import TypeVar

__all__ = ["derivation", "kernels", "logged", "methods", "realisations", "refinement", "results", "tell"]

T = TypeVar("T")

ROOT = logging.getLogger("uqmbd")
ROOT.addHandler(logging.NullHandler())
if ROOT.level == logging.NOTSET:  # keep a level that a program has set
    ROOT.setLevel(logging.WARNING)

methods = logging.getLogger("uqmbd.methods")
"""Beginnings, ends and failures of methods."""

realisations = logging.getLogger("uqmbd.realisations")
"""Computed realisations and failed realisations."""

refinement = logging.getLogger("uqmbd.refinement")
"""Steps of a refinement."""

kernels = logging.getLogger("uqmbd.kernels")
"""Kernels that are compiled or read from the cache."""

results = logging.getLogger("uqmbd.results")
"""Files of results that are read without verification."""

derivation = logging.getLogger("uqmbd.derivation")
"""Steps of derivations, and number of finished parts of a mechanism in a step: ``"%s: %d of %d"``."""


def logged(label: str, parts: Sequence[T]) -> Iterator[T]:
    """Yield parts of a mechanism, and log the number of finished parts after each part.

    `label` describes the operation.

    >>> list(logged("terms of components", ["crank", "rod"]))
    ['crank', 'rod']
    """
    for done, part in enumerate(parts, 1):
        yield part
        derivation.debug("%s: %d of %d", label, done, len(parts))


def tell(text: str) -> None:
    """Report a text before the results are available, to the logger of realisations and to the standard error.

    Log messages of a worker process reach the process that started the run only with the results.
    """
    realisations.warning(text)
    print(f"Note: {text}", file=sys.stderr, flush=True)
