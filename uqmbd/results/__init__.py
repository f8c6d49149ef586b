"""Results as xarray data: the schema that every propagator fills, statistics, comparison of methods, and storage."""

from __future__ import annotations

from uqmbd.results.chaos.aligned import AlignedChaos, AlignedElement
from uqmbd.results.chaos.chaos import PolynomialChaos
from uqmbd.results.chaos.fit import LeastSquares, NodeRegression, least_squares, project, regress_on_nodes
from uqmbd.results.chaos.of_dataset import surrogate
from uqmbd.results.chaos.piecewise import PiecewiseChaos, chaos_from_dataset
from uqmbd.results.comparison.alignment import align
from uqmbd.results.comparison.compare import choose_reference, compare
from uqmbd.results.comparison.integration_share import IntegrationShare, integration_shares, worst_integration_share
from uqmbd.results.comparison.recommendation import overall, recommend
from uqmbd.results.comparison.relative_errors import relative_errors
from uqmbd.results.comparison.statements import own_statements, statements
from uqmbd.results.schema.axes import InputInfo, Labels, OutputInfo, labels
from uqmbd.results.schema.datasets import DEFAULT_PROBABILITIES, STATUS_MEANINGS, sample_dataset, statistics_dataset
from uqmbd.results.schema.nodes import failed_methods, join_nodes, propagator_node, study_tree
from uqmbd.results.schema.validation import propagator_nodes, validate
from uqmbd.results.statistics.circular import (
    circular_mean,
    circular_of_components,
    circular_std,
    mean_direction,
    unwrap_samples,
)
from uqmbd.results.statistics.moments import Moments
from uqmbd.results.statistics.replicates import replicate_errors
from uqmbd.results.statistics.rotations import mean_rotation, rotation_std
from uqmbd.results.statistics.samples import sample_statistics, statistics_of_samples
from uqmbd.results.statistics.spread import varies, varying
from uqmbd.results.storage.sample_file import SampleFile, sample_file
from uqmbd.results.storage.storage import load, save
from uqmbd.results.tree import scalar_nodes, with_scalars
from uqmbd.status import Status

__all__ = [
    "AlignedChaos",
    "AlignedElement",
    "DEFAULT_PROBABILITIES",
    "STATUS_MEANINGS",
    "Status",
    "InputInfo",
    "IntegrationShare",
    "Labels",
    "LeastSquares",
    "Moments",
    "NodeRegression",
    "OutputInfo",
    "PiecewiseChaos",
    "PolynomialChaos",
    "SampleFile",
    "align",
    "chaos_from_dataset",
    "choose_reference",
    "circular_mean",
    "circular_of_components",
    "circular_std",
    "compare",
    "failed_methods",
    "integration_shares",
    "join_nodes",
    "labels",
    "least_squares",
    "load",
    "mean_direction",
    "mean_rotation",
    "overall",
    "own_statements",
    "project",
    "propagator_node",
    "propagator_nodes",
    "recommend",
    "regress_on_nodes",
    "relative_errors",
    "replicate_errors",
    "rotation_std",
    "sample_dataset",
    "sample_file",
    "sample_statistics",
    "save",
    "scalar_nodes",
    "statements",
    "statistics_dataset",
    "statistics_of_samples",
    "study_tree",
    "surrogate",
    "unwrap_samples",
    "validate",
    "varies",
    "varying",
    "with_scalars",
    "worst_integration_share",
]
