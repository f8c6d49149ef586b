"""Conformance of integrators of realisations and of projected equations."""

from __future__ import annotations

from uqmbd.testing.integrators.integrator import check_integrator

__all__ = [
    "check_integrator",
]
