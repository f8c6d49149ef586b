"""Compute statistics of samples: moments, quantiles, angles, rotations, and errors from replicates."""

from __future__ import annotations

from uqmbd.results.statistics.circular import (
    circular_mean,
    circular_of_blocks,
    circular_of_components,
    circular_std,
    unwrap_samples,
)
from uqmbd.results.statistics.circular_moments import CircularMoments
from uqmbd.results.statistics.counted_quantiles import CountedQuantiles
from uqmbd.results.statistics.directions import mean_direction, mean_rotation, rotation_std
from uqmbd.results.statistics.moments import (
    Moments,
    divisor,
    independent_errors,
    integration_error,
    over_time,
    relative,
    rtol_of,
    settled,
    usual_errors,
    varies,
    varying,
)
from uqmbd.results.statistics.quantiles import ConsecutiveSamples, quantiles_of_chunks
from uqmbd.results.statistics.replicates import replicate_errors, studentised
from uqmbd.results.statistics.samples import (
    replicate_statistics,
    running_statistics,
    sample_statistics,
    statistics_of_samples,
)

__all__ = [
    "ConsecutiveSamples",
    "CircularMoments",
    "CountedQuantiles",
    "Moments",
    "circular_mean",
    "circular_of_blocks",
    "circular_of_components",
    "circular_std",
    "divisor",
    "independent_errors",
    "integration_error",
    "mean_direction",
    "mean_rotation",
    "over_time",
    "quantiles_of_chunks",
    "relative",
    "replicate_errors",
    "replicate_statistics",
    "rotation_std",
    "rtol_of",
    "running_statistics",
    "sample_statistics",
    "settled",
    "statistics_of_samples",
    "studentised",
    "unwrap_samples",
    "usual_errors",
    "varies",
    "varying",
]
