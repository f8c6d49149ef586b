"""Functions that make charts, and Matplotlib figures, from xarray results.

The code does not use pyplot or its global state, so it can make any number of figures in any thread.
"""

from __future__ import annotations

from uqmbd.report.figures.approaches import Approach, OutputLimit, closest_approach, deviation_chart
from uqmbd.report.figures.decay import (
    LARGEST,
    coefficient_decay,
    decay_chart,
    errors_chart,
    horizon,
    stated_errors,
    verification,
)
from uqmbd.report.figures.distributions import densities_chart, histograms, inputs, inputs_chart
from uqmbd.report.figures.elements import elements_chart, elements_in_words, has_elements, split_pattern
from uqmbd.report.figures.errors_and_costs import cost_chart, error_cost
from uqmbd.report.figures.failures import (
    ENOUGH,
    FailureGroup,
    failure_inputs,
    failure_reasons,
    failure_words,
    failures_chart,
)
from uqmbd.report.figures.kernel_density import density, known_densities
from uqmbd.report.figures.orders_of_chaos import order_convergence, orders_chart, orders_of
from uqmbd.report.figures.output_plane import is_function, over_chart, over_output
from uqmbd.report.figures.over_time import (
    band_edges,
    bands,
    bands_chart,
    difference_chart,
    differences,
    std_chart,
    std_over_time,
    time_history_histogram,
)
from uqmbd.report.figures.requirements import (
    changing_with_time,
    violated_by,
    violations_chart,
    worst_violations_chart,
)
from uqmbd.report.figures.sample_convergence import convergence, design_of, settling_chart
from uqmbd.report.figures.selection import Results, Samples, automatic_times, label_of, of_output, runs_of
from uqmbd.report.figures.series import in_series, series_chart
from uqmbd.report.figures.sobol import (
    OF_GERMS,
    Indices,
    has_indices,
    indices_chart,
    indices_charts,
    indices_of,
    node_with_indices,
    sobol_indices,
)
from uqmbd.report.figures.surrogates import (
    chaos_nodes,
    chaos_of,
    drawable_nodes,
    finest,
    order_of,
    series,
    shown_methods,
    stated_error_of,
    surrogate_nodes,
    surrogate_of,
    varies_over_time,
)
from uqmbd.report.figures.timeless import (
    MOST_SCALARS,
    earliest_events,
    event_times,
    events_chart,
    events_in_words,
    has_events,
    scalar_densities,
    scalars_chart,
)

__all__ = [
    "in_series",
    "series_chart",
    "density",
    "known_densities",
    "Approach",
    "ENOUGH",
    "FailureGroup",
    "Indices",
    "LARGEST",
    "MOST_SCALARS",
    "OF_GERMS",
    "OutputLimit",
    "Results",
    "Samples",
    "automatic_times",
    "band_edges",
    "bands",
    "bands_chart",
    "changing_with_time",
    "chaos_nodes",
    "chaos_of",
    "closest_approach",
    "coefficient_decay",
    "convergence",
    "cost_chart",
    "decay_chart",
    "densities_chart",
    "design_of",
    "deviation_chart",
    "difference_chart",
    "differences",
    "earliest_events",
    "elements_chart",
    "elements_in_words",
    "error_cost",
    "errors_chart",
    "event_times",
    "events_chart",
    "events_in_words",
    "failure_inputs",
    "failure_reasons",
    "failure_words",
    "failures_chart",
    "finest",
    "has_elements",
    "has_events",
    "has_indices",
    "histograms",
    "horizon",
    "indices_chart",
    "indices_charts",
    "indices_of",
    "inputs",
    "inputs_chart",
    "is_function",
    "label_of",
    "node_with_indices",
    "of_output",
    "order_convergence",
    "order_of",
    "orders_chart",
    "orders_of",
    "over_chart",
    "over_output",
    "runs_of",
    "scalar_densities",
    "scalars_chart",
    "series",
    "settling_chart",
    "shown_methods",
    "sobol_indices",
    "split_pattern",
    "stated_error_of",
    "stated_errors",
    "std_chart",
    "std_over_time",
    "drawable_nodes",
    "surrogate_nodes",
    "surrogate_of",
    "time_history_histogram",
    "varies_over_time",
    "verification",
    "violated_by",
    "violations_chart",
    "worst_violations_chart",
]
