"""A propagator that looks at the mean values alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import statistics_dataset

__all__ = ["MeanValue"]


@dataclass(frozen=True, kw_only=True)
class MeanValue(uqmbd.Propagator):
    """What a study would give if nothing were uncertain: one realisation at the means, and no spread."""

    name: ClassVar[str] = "mean-value"

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Compute one realisation.

        Raises
        ------
        uqmbd.IntegrationError
            If there is no motion at the means.
        """
        found = problem.realise(problem.inputs.means[None, :])
        if found.failures:
            raise uqmbd.IntegrationError(f"{problem.label}: no motion at the means: {found.messages[0]}")
        mean = found.response[0]
        statistics = statistics_dataset(problem.labels, mean=mean, std=np.zeros_like(mean))
        return problem.node(self, statistics, realisations=1, wall_time=found.wall_time, counters=found.counters)
