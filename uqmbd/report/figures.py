"""Figures of results, each a function from xarray data to a :class:`matplotlib.figure.Figure` of its own.

Nothing here touches pyplot or its global state, so figures can be made anywhere, in any number, in any thread.
"""

from __future__ import annotations

from uqmbd.report.agreement import differences, order_convergence
from uqmbd.report.animation import poses
from uqmbd.report.convergence import convergence
from uqmbd.report.decay import coefficient_decay, verification
from uqmbd.report.distributions import histograms, inputs
from uqmbd.report.elements import split_pattern
from uqmbd.report.error_cost import error_cost
from uqmbd.report.event_times import event_times
from uqmbd.report.failures import failure_inputs
from uqmbd.report.influence import sobol_indices
from uqmbd.report.mechanism_figure import mechanism
from uqmbd.report.over_time import bands, std_over_time, time_history_histogram
from uqmbd.report.scalars import scalar_densities
from uqmbd.report.selection import Results, Samples

__all__ = [
    "Results",
    "Samples",
    "bands",
    "coefficient_decay",
    "convergence",
    "differences",
    "error_cost",
    "event_times",
    "failure_inputs",
    "histograms",
    "inputs",
    "mechanism",
    "order_convergence",
    "poses",
    "scalar_densities",
    "sobol_indices",
    "split_pattern",
    "std_over_time",
    "time_history_histogram",
    "verification",
]
