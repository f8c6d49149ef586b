"""Conformance of components: derivatives, energy, events, and propagation methods on their mechanisms."""

from __future__ import annotations

from uqmbd.testing.components.component import check_component

__all__ = [
    "check_component",
]
