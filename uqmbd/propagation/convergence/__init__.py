"""Convergence studies, and convergence of samples within a study."""

from __future__ import annotations

from uqmbd.propagation.convergence.node import check_convergence_of, with_convergence
from uqmbd.propagation.convergence.option_levels import converge

__all__ = [
    "check_convergence_of",
    "converge",
    "with_convergence",
]
