"""Figures of results, each a function from xarray data to a :class:`matplotlib.figure.Figure` of its own.

Nothing here touches pyplot or its global state, so figures can be made anywhere, in any number, in any thread.
"""

from __future__ import annotations

from uqmbd.report.figures.curves import Band, Curve, checked
from uqmbd.report.figures.decay import (
    LARGEST,
    LIMIT,
    StatedErrors,
    coefficient_decay,
    coefficient_parts,
    horizon,
    stated_errors,
    verification,
)
from uqmbd.report.figures.density import Curve as DensityCurve
from uqmbd.report.figures.density import Densities, densities
from uqmbd.report.figures.differences import differences, order_convergence, orders_of, sampling_errors
from uqmbd.report.figures.distributions import FAILED_INPUTS, histograms, input_densities, inputs, output_densities
from uqmbd.report.figures.elements import (
    SplitElements,
    elements_in_words,
    has_elements,
    split_elements,
    split_pattern,
)
from uqmbd.report.figures.error_cost import MARKS, error_cost, errors_of, own_error
from uqmbd.report.figures.event_times import earliest_events, event_times, events_in_words, has_events
from uqmbd.report.figures.failures import (
    ENOUGH,
    Reason,
    failed_inputs,
    failure_inputs,
    failure_reasons,
    failure_words,
)
from uqmbd.report.figures.over_output import Paths, bands_over, is_function, over_output, paths_over
from uqmbd.report.figures.over_time import band_edges, bands, std_over_time, time_history_histogram
from uqmbd.report.figures.requirements import MOST_REQUIREMENTS, changing_with_time, violated_by
from uqmbd.report.figures.sample_convergence import ESTIMATED, Settling, convergence, design_of, settling
from uqmbd.report.figures.selection import Results, Samples, automatic_times, label_of, of_output, runs_of, thinned
from uqmbd.report.figures.sobol import (
    OF_GERMS,
    Indices,
    has_indices,
    indices_of,
    node_with_indices,
    shown_inputs,
    sobol_indices,
)
from uqmbd.report.figures.surrogates import (
    chaos_nodes,
    chaos_of,
    finest,
    order_of,
    series,
    shown_methods,
    stated_error_of,
    surrogate_nodes,
    surrogate_of,
    varies_over_time,
)
from uqmbd.report.figures.timeless import MOST_SCALARS, scalar_densities, scalar_panels

__all__ = [
    "paths_over",
    "own_error",
    "failed_inputs",
    "errors_of",
    "bands_over",
    "Paths",
    "MARKS",
    "Band",
    "Curve",
    "Densities",
    "DensityCurve",
    "ENOUGH",
    "ESTIMATED",
    "FAILED_INPUTS",
    "Indices",
    "LARGEST",
    "LIMIT",
    "MOST_REQUIREMENTS",
    "MOST_SCALARS",
    "OF_GERMS",
    "Reason",
    "Results",
    "Samples",
    "Settling",
    "SplitElements",
    "StatedErrors",
    "automatic_times",
    "band_edges",
    "bands",
    "changing_with_time",
    "checked",
    "chaos_nodes",
    "chaos_of",
    "coefficient_decay",
    "coefficient_parts",
    "convergence",
    "densities",
    "design_of",
    "differences",
    "earliest_events",
    "elements_in_words",
    "error_cost",
    "event_times",
    "events_in_words",
    "failure_inputs",
    "failure_reasons",
    "failure_words",
    "finest",
    "has_elements",
    "has_events",
    "has_indices",
    "histograms",
    "horizon",
    "indices_of",
    "input_densities",
    "inputs",
    "is_function",
    "label_of",
    "node_with_indices",
    "of_output",
    "order_convergence",
    "order_of",
    "orders_of",
    "output_densities",
    "over_output",
    "runs_of",
    "sampling_errors",
    "scalar_densities",
    "scalar_panels",
    "series",
    "settling",
    "shown_inputs",
    "shown_methods",
    "sobol_indices",
    "split_elements",
    "split_pattern",
    "stated_error_of",
    "stated_errors",
    "std_over_time",
    "surrogate_nodes",
    "surrogate_of",
    "thinned",
    "time_history_histogram",
    "varies_over_time",
    "verification",
    "violated_by",
]
