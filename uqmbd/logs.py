"""Log messages of uqmbd by the standard library's `logging`: silent unless a program listens.

Loggers are ``uqmbd.methods`` (beginnings, ends and failures), ``uqmbd.realisations`` (chunks and their failures),
``uqmbd.refinement`` (orders, sparse grids, elements) and ``uqmbd.kernels`` (compiled, or taken from the cache). Further
ones are ``uqmbd.derivation`` (derivation of equations, by parts of a mechanism) and ``uqmbd.results`` (files that were
read without a digest). INFO is what happens a few times in a run, DEBUG what happens for each chunk of realisations,
kernel and part.

Workers return their log records with the results (uqmbd/propagation/execution/transport/log_records.py).

The logger ``uqmbd`` has a level of its own: on import, chaospy sets the root logger to the level DEBUG and adds a
handler that discards everything. Without its own level, uqmbd would format all messages in vain.
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
if ROOT.level == logging.NOTSET:  # a program may have said before what it listens to
    ROOT.setLevel(logging.WARNING)

methods = logging.getLogger("uqmbd.methods")
"""Methods that begin, end and fail."""

realisations = logging.getLogger("uqmbd.realisations")
"""Realisations that are computed, and those that fail."""

refinement = logging.getLogger("uqmbd.refinement")
"""Steps of a refinement."""

kernels = logging.getLogger("uqmbd.kernels")
"""Kernels that are compiled, or taken from the cache."""

results = logging.getLogger("uqmbd.results")
"""Files of results that are read and cannot be verified."""

derivation = logging.getLogger("uqmbd.derivation")
"""Steps of derivations, and how many parts of a mechanism a step has done: ``"%s: %d of %d"``."""


def logged(label: str, parts: Sequence[T]) -> Iterator[T]:
    """Yield parts, and log after each how many are done.

    `label`: what is done with them; `parts`: of a mechanism.

    >>> list(logged("terms of components", ["crank", "rod"]))
    ['crank', 'rod']
    """
    for done, part in enumerate(parts, 1):
        yield part
        derivation.debug("%s: %d of %d", label, done, len(parts))


def tell(text: str) -> None:
    """Say what cannot wait for results: to who listens to the loggers, and on the standard error.

    In a process of workers the loggers reach the one that started the run with the results only.
    """
    realisations.warning(text)
    print(f"Note: {text}", file=sys.stderr, flush=True)
