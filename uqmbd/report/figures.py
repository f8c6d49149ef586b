"""Figures of results, each a function from xarray data to a :class:`matplotlib.figure.Figure` of its own.

Nothing here touches pyplot or its global state, so figures can be made anywhere, in any number, in any thread.
"""

from __future__ import annotations

from uqmbd.report.convergence import convergence
from uqmbd.report.distributions import histograms, inputs
from uqmbd.report.failures import failure_inputs
from uqmbd.report.over_time import bands, std_over_time, time_history_histogram
from uqmbd.report.selection import Results, Samples

__all__ = [
    "Results",
    "Samples",
    "bands",
    "convergence",
    "failure_inputs",
    "histograms",
    "inputs",
    "std_over_time",
    "time_history_histogram",
]
