"""What uqmbd tells of its work by the standard library's `logging`: silent unless a program listens.

Loggers are ``uqmbd.methods`` (what begins and ends, and fails), ``uqmbd.realisations`` (chunks, and what failed in
them), ``uqmbd.refinement`` (orders, sparse grids, elements) and ``uqmbd.kernels`` (compiled, or taken from the cache).
INFO is what happens a few times in a run, DEBUG what happens for each chunk of realisations and each kernel.

What they say in worker processes reaches this one with the results (uqmbd/propagation/execution/transport/said.py).

The logger ``uqmbd`` has a level of its own: chaospy, when it is imported, gives the root logger the level DEBUG and a
handler that writes to nowhere, so that all would be said, to nobody.
"""

from __future__ import annotations

import logging

__all__ = ["kernels", "methods", "realisations", "refinement"]

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
