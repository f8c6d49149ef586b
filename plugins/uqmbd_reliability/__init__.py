"""How likely a mechanism does not meet its requirements."""

from __future__ import annotations

from uqmbd_reliability.allocation import Allocation, allocate

__all__ = ["Allocation", "allocate"]
