"""Probabilities of violated requirements, including rare violations, and tolerances that reach a probability."""

from __future__ import annotations

import uqmbd
from uqmbd_reliability.allocation import Allocation, allocate
from uqmbd_reliability.propagator import Reliability

__all__ = ["Allocation", "Reliability", "allocate"]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.extend.Propagator]]:
    """Return the propagator of this package."""
    return [Reliability]


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type]:
    """Return the report sections of this package."""
    from uqmbd_reliability.reporting import ReliabilitySection

    return [ReliabilitySection]
