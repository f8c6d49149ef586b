"""Surrogate of all outputs, and the node of its results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import AlignedChaos, ComposedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos
from uqmbd.typing import Array

__all__ = ["Expanded"]


@dataclass(frozen=True, eq=False)
class Expanded:
    """Surrogate of all outputs, and its cost."""

    chaos: PolynomialChaos | PiecewiseChaos | AlignedChaos | QuasiPeriodicChaos | ComposedChaos
    """Surrogate, with its verification realisations."""
    realisations: int  # total number
    counters: Counter[str]  # counters of the solver
    nodes: xr.Dataset  # points of the realisations
    attrs: Mapping[str, Any]  # attributes of the node
    children: Mapping[str, xr.Dataset] = field(default_factory=dict)  # additional datasets of the node
    leave_one_out: Array | None = None  # (O, T), leave-one-out errors of a regression

    def node(self, propagator: uqmbd.extend.Propagator, problem: uqmbd.extend.Problem, wall_time: float) -> xr.DataTree:
        """Return the node of the method, with `wall_time` in s; its times end at the earliest end of its samples."""
        if (reached := self.chaos.reached()) is not self.chaos:
            last = float(np.asarray(reached.labels.times)[-1])
            return replace(self, chaos=reached, attrs={**self.attrs, "ends_at": last}).node(
                propagator, problem, wall_time
            )
        statistics = self.chaos.statistics()
        if statistics.sizes["time"] < len(problem.times):
            about = statistics["time"].attrs
            statistics = statistics.reindex(time=problem.times)
            statistics["time"].attrs.update(about)
        if self.leave_one_out is not None:
            note = {"long_name": "leave-one-out error of the regression, divided by the variance of the samples"}
            statistics = statistics.assign(leave_one_out=(problem.labels.dims, self.leave_one_out, note))
        return problem.node(
            propagator,
            statistics,
            realisations=self.realisations,
            wall_time=wall_time,
            counters=dict(self.counters),
            children={**self.chaos.to_datasets(), "nodes": self.nodes, **self.children},
            attrs=self.attrs,
        )
