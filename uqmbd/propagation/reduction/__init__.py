"""Reduction of realisations by workers, and storage by chunks."""

from __future__ import annotations

from uqmbd.propagation.reduction.reduced import Reduced, Reduction
from uqmbd.propagation.reduction.reductions import Reductions, store_name

__all__ = ["Reduced", "Reduction", "Reductions", "store_name"]
