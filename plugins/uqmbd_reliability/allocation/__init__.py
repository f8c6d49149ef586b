"""Allocation of tolerances that reach a probability at the least cost."""

from __future__ import annotations

from uqmbd_reliability.allocation.allocation_search import allocate
from uqmbd_reliability.allocation.result import Allocation

__all__ = ["Allocation", "allocate"]
