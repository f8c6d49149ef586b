"""Results as xarray data: the schema that every propagator fills, statistics, comparison of methods, and storage."""

from __future__ import annotations

from uqmbd.results.aligned_chaos import AlignedChaos, AlignedElement
from uqmbd.results.alignment import align
from uqmbd.results.axes import InputInfo, Labels, OutputInfo, labels
from uqmbd.results.chaos import PolynomialChaos
from uqmbd.results.comparison import choose_reference, compare
from uqmbd.results.directions import (
    circular_mean,
    circular_of_components,
    circular_std,
    mean_direction,
    unwrap_samples,
)
from uqmbd.results.integration import IntegrationShare, integration_shares, worst_integration_share
from uqmbd.results.moments import Moments
from uqmbd.results.nodes import failed_methods, join_nodes, propagator_node, study_tree
from uqmbd.results.piecewise import PiecewiseChaos, chaos_from_dataset
from uqmbd.results.projection import LeastSquares, NodeRegression, least_squares, project, regress_on_nodes
from uqmbd.results.recommendation import overall, recommend
from uqmbd.results.relative_errors import relative_errors
from uqmbd.results.replicates import replicate_errors
from uqmbd.results.rotations import mean_rotation, rotation_std
from uqmbd.results.samplefile import SampleFile, sample_file
from uqmbd.results.scalars import scalar_nodes, with_scalars
from uqmbd.results.schema import DEFAULT_PROBABILITIES, STATUS_MEANINGS, sample_dataset, statistics_dataset
from uqmbd.results.spread import varies, varying
from uqmbd.results.statements import own_statements, statements
from uqmbd.results.statistics import sample_statistics, statistics_of_samples
from uqmbd.results.storage import load, save
from uqmbd.results.surrogate import surrogate
from uqmbd.results.validation import propagator_nodes, validate
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
