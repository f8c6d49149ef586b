"""A propagator that looks at the mean values alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import xarray as xr

import uqmbd

__all__ = ["MeanValue"]


@dataclass(frozen=True, kw_only=True)
class MeanValue(uqmbd.Propagator):
    """What a study would give if nothing were uncertain: one realisation at the means, and no spread."""

    name: ClassVar[str] = "mean-value"

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Compute one realisation."""
        raise NotImplementedError
