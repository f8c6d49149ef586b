"""Conformance of propagators: moments, failures, executors and resumed runs."""

from __future__ import annotations

from uqmbd.testing.propagators.moments import check_schema, stated_errors
from uqmbd.testing.propagators.propagator import check_propagator
from uqmbd.testing.propagators.subject import described, quiet

__all__ = [
    "check_propagator",
    "check_schema",
    "described",
    "quiet",
    "stated_errors",
]
