"""Results as xarray data: the schema of all propagators, statistics, assessment, and storage."""

from __future__ import annotations

from typing import Any

from uqmbd.results import assessment, chaos, requirements, schema, statistics, storage, tree
from uqmbd.results.accessor import Accessor
from uqmbd.results.assessment import (
    StatedAccuracy,
    align,
    assess,
    choose_reference,
    compare,
    recommend,
    relative_errors,
    stated_accuracy,
)
from uqmbd.results.chaos import (
    AlignedChaos,
    ComposedChaos,
    PiecewiseChaos,
    PolynomialChaos,
    QuasiPeriodicChaos,
    surrogate,
)
from uqmbd.results.requirements import (
    Answer,
    answers,
    clopper_pearson,
    compare_requirements,
    requirement_names,
    requirements_of,
    unmet,
)
from uqmbd.results.schema import STATUS_MEANINGS, failed_methods, methods, propagator_node, validate
from uqmbd.results.schema import propagator_nodes as propagator_nodes  # earlier name of `methods`
from uqmbd.results.selection import by_output, output
from uqmbd.results.statistics import (
    circular_mean,
    circular_std,
    mean_direction,
    mean_rotation,
    rotation_std,
    sample_statistics,
    unwrap_samples,
    varies,
    varying,
)
from uqmbd.results.storage import SampleStore, load, open, save
from uqmbd.results.tree import scalar_nodes, study_tree
from uqmbd.status import Status

__all__ = [
    "STATUS_MEANINGS",
    "Accessor",
    "AlignedChaos",
    "Answer",
    "ComposedChaos",
    "PiecewiseChaos",
    "PolynomialChaos",
    "QuasiPeriodicChaos",
    "SampleStore",
    "StatedAccuracy",
    "Status",
    "align",
    "answers",
    "assess",
    "by_output",
    "choose_reference",
    "circular_mean",
    "circular_std",
    "clopper_pearson",
    "compare",
    "compare_requirements",
    "failed_methods",
    "load",
    "mean_direction",
    "mean_rotation",
    "methods",
    "open",
    "output",
    "propagator_node",
    "recommend",
    "relative_errors",
    "requirement_names",
    "requirements_of",
    "rotation_std",
    "sample_statistics",
    "save",
    "scalar_nodes",
    "stated_accuracy",
    "study_tree",
    "surrogate",
    "unmet",
    "unwrap_samples",
    "validate",
    "varies",
    "varying",
]

_MOVED = frozenset(
    """
    AlignedElement CircularMoments CountedQuantiles DEFAULT_PROBABILITIES InputInfo Labels Landmarks Moments
    OutputInfo QuasiPeriodicElement Violations labels least_squares project quantiles_of_chunks regress_on_nodes
    replicate_errors requirements_dataset sample_dataset statistics_dataset statistics_of_samples stored_as
    with_reasons
    """.split()
)
"""Names that were moved to `uqmbd.extend`."""


def __getattr__(name: str) -> Any:
    """Return an object that was public here, with a deprecation warning, until version 0.2."""
    import warnings

    import uqmbd

    if name in _MOVED:
        now = "Markers" if name == "Landmarks" else name
        found, text = getattr(uqmbd.extend, now), f"is uqmbd.extend.{now} now"
    else:
        folders = (assessment, chaos, requirements, schema, statistics, storage, tree)
        owners = [folder for folder in folders if name in folder.__all__]
        if not owners:
            hint = "; it was removed, use uqmbd.results.assess(tree)" if name in ("overall", "statements") else ""
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
        found, text = getattr(owners[0], name), "is not public any more"
    warnings.warn(f"uqmbd.results.{name} {text}; the name is removed here in version 0.2.", DeprecationWarning, 2)
    return found
