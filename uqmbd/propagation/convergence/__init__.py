"""Studies of convergence, and convergence of samples within a study."""

from __future__ import annotations

from uqmbd.propagation.convergence.converge import converge
from uqmbd.propagation.convergence.node import check_convergence_of, with_convergence

__all__ = [
    "check_convergence_of",
    "converge",
    "with_convergence",
]
