"""The node of a method at work: its statistics, as far as they exist, with its options as provenance."""

from __future__ import annotations

import json
import warnings
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from uqmbd.dynamics import Model
from uqmbd.errors import StudyWarning
from uqmbd.propagation.annotations import Method
from uqmbd.propagation.execution import Kind, solver_counters
from uqmbd.propagation.inputs import Existence
from uqmbd.propagation.observed_model import not_unique_attribute, step_attributes
from uqmbd.randomness import JointInput
from uqmbd.results import propagator_node
from uqmbd.results.schema import InputInfo, Labels, OutputInfo, labels
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["labels_of", "method_node"]


def labels_of(
    model: Model, inputs: JointInput, times: Array, kind: Kind, chosen: tuple[str, ...] | None = None
) -> Labels:
    """Name outputs of a kind, or some of them, inputs and times."""
    if kind == "requirements":
        outputs = [OutputInfo(requirement.name) for requirement in model.margins.requirements]
    else:
        seen = model.scalars if kind == "scalars" else model.outputs
        turns = [0.0] * len(seen.names) if kind == "scalars" else seen.turns.tolist()
        outputs = [OutputInfo(*about) for about in zip(seen.names, seen.units, turns, strict=True)]
    if chosen is not None:
        outputs = [output for output in outputs if output.name in chosen]
    return labels(outputs, [InputInfo(v.name, v.units, v.description) for v in inputs.variables], times)


def method_node(
    label: str,
    model: Model,
    existence: Existence,
    propagator: Method,
    statistics: xr.Dataset,
    samples: xr.Dataset | None,
    *,
    attrs: Any,
    **about: Any,
) -> xr.DataTree:
    """Make the node of a method; see `Problem.node` and, for `about`, `uqmbd.results.propagator_node`.

    Moments that do not exist are NaN, with a warning; the attributes hold steps and ambiguities of the model.
    """
    options = {f.name: getattr(propagator, f.name) for f in fields(propagator) if f.name != "label"}
    statistics, sentences = existence.applied(statistics)
    for sentence in sentences:
        warnings.warn(f"{label}: {sentence}.", StudyWarning, stacklevel=4)
    about["solver_counters"] = solver_counters(about.get("solver_counters") or {})
    told = {"warnings": json.dumps(sentences)} if sentences else {}
    return propagator_node(
        label,
        statistics,
        samples,
        propagator=propagator.name,
        seed=options.get("seed"),
        options=options,
        attrs={
            "start": model.start_at,
            **step_attributes(model.max_step, model.added_breaks),
            **not_unique_attribute(model),
            **told,
            **(attrs or {}),
        },
        **about,
    )
