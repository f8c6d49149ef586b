"""Results as xarray data: the schema that every propagator fills, statistics, comparison of methods, and storage."""

from __future__ import annotations

from uqmbd.results.axes import InputInfo, Labels, OutputInfo, labels
from uqmbd.results.comparison import choose_reference, compare
from uqmbd.results.moments import Moments
from uqmbd.results.nodes import propagator_node, study_tree
from uqmbd.results.replicates import replicate_errors
from uqmbd.results.samplefile import SampleFile, sample_file
from uqmbd.results.schema import DEFAULT_PROBABILITIES, STATUS_MEANINGS, sample_dataset, statistics_dataset
from uqmbd.results.statistics import sample_statistics, statistics_of_samples
from uqmbd.results.storage import load, save
from uqmbd.results.validation import propagator_nodes, validate

__all__ = [
    "DEFAULT_PROBABILITIES",
    "STATUS_MEANINGS",
    "InputInfo",
    "Labels",
    "Moments",
    "OutputInfo",
    "SampleFile",
    "choose_reference",
    "compare",
    "labels",
    "load",
    "propagator_node",
    "propagator_nodes",
    "replicate_errors",
    "sample_dataset",
    "sample_file",
    "sample_statistics",
    "save",
    "statistics_dataset",
    "statistics_of_samples",
    "study_tree",
    "validate",
]
