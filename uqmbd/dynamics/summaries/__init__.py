"""What sums a motion up, found on the motion between the output times: extremes, integrals, first times, margins."""

from __future__ import annotations

from uqmbd.dynamics.summaries.summaries import SummaryMap, running_minimum, summarised, summary_map

__all__ = ["SummaryMap", "running_minimum", "summarised", "summary_map"]
