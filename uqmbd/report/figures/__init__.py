"""Figures of results, each a function from xarray data to a :class:`matplotlib.figure.Figure` of its own.

Nothing here touches pyplot or its global state, so figures can be made anywhere, in any number, in any thread.
"""

from __future__ import annotations

from uqmbd.report.figures.decay import coefficient_decay, verification
from uqmbd.report.figures.differences import differences, order_convergence
from uqmbd.report.figures.distributions import histograms, inputs
from uqmbd.report.figures.elements import split_pattern
from uqmbd.report.figures.error_cost import error_cost
from uqmbd.report.figures.event_times import event_times
from uqmbd.report.figures.failures import failure_inputs
from uqmbd.report.figures.over_time import bands, std_over_time, time_history_histogram
from uqmbd.report.figures.sample_convergence import convergence
from uqmbd.report.figures.selection import Results, Samples
from uqmbd.report.figures.sobol import sobol_indices
from uqmbd.report.figures.timeless import scalar_densities
from uqmbd.report.mechanism.animation import poses
from uqmbd.report.mechanism.picture import mechanism

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
