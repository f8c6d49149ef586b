"""Define and validate the layout of results: axes, datasets, and nodes of the tree."""

from __future__ import annotations

from uqmbd.results.schema.axes import (
    InputInfo,
    Labels,
    OutputInfo,
    fixed_width,
    labels,
    output_index,
    output_infos,
    time_index,
)
from uqmbd.results.schema.datasets import (
    CHILDREN,
    DEFAULT_PROBABILITIES,
    KIND,
    SCHEMA_VERSION,
    STATUS_MEANINGS,
    check_kind,
    check_shape,
    check_version,
    sample_dataset,
    statistics_dataset,
)
from uqmbd.results.schema.nodes import (
    comparable,
    failed_methods,
    join_nodes,
    methods,
    node_parts,
    propagator_node,
    propagator_nodes,
)
from uqmbd.results.schema.stated import SPREAD_FLOOR, StatedError, reference_spread
from uqmbd.results.schema.units import CF, as_text, product_of_units, united, units_of, with_units
from uqmbd.results.schema.validation import validate
from uqmbd.results.schema.values import (
    EVERY,
    check_probabilities,
    check_values,
    real_numbers,
    reasons_of,
    reasons_where_missing,
    with_default_reasons,
    with_reasons,
)

__all__ = [
    "CF",
    "CHILDREN",
    "DEFAULT_PROBABILITIES",
    "EVERY",
    "KIND",
    "SCHEMA_VERSION",
    "SPREAD_FLOOR",
    "STATUS_MEANINGS",
    "StatedError",
    "InputInfo",
    "Labels",
    "OutputInfo",
    "as_text",
    "check_probabilities",
    "check_kind",
    "check_shape",
    "check_values",
    "check_version",
    "comparable",
    "failed_methods",
    "fixed_width",
    "join_nodes",
    "labels",
    "methods",
    "node_parts",
    "output_index",
    "output_infos",
    "product_of_units",
    "propagator_node",
    "propagator_nodes",
    "real_numbers",
    "reasons_of",
    "reasons_where_missing",
    "reference_spread",
    "sample_dataset",
    "statistics_dataset",
    "time_index",
    "united",
    "units_of",
    "validate",
    "with_default_reasons",
    "with_reasons",
    "with_units",
]
