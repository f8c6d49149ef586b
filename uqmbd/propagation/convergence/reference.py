"""References for errors: a result, a separate run of a method, or an exact solution."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.progress import Progress
from uqmbd.propagation.methods import Propagator, Studied, run_method

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["reference_node"]


def reference_node(
    study: Studied, reference: object, executor: Executor | None, progress: Progress | bool | None, folder: Path | None
) -> xr.DataTree | None:
    """Return the node of the reference, and compute it if necessary; None if the reference is one of the levels."""
    import xarray as xr

    if isinstance(reference, Propagator):
        study.with_propagators([reference])
        return run_method(reference, study.problem(reference, executor, progress, folder), check=False)
    if isinstance(reference, xr.Dataset):
        return _known(study, reference)
    if reference is None or (isinstance(reference, xr.DataTree) and "statistics" in reference.children):
        return reference
    what = f"a tree of {', '.join(reference.children)}" if isinstance(reference, xr.DataTree) else repr(reference)
    raise StudyError(
        f"converge: the reference is {what}; expected the node of one method, e.g. tree['LABEL'], a "
        "propagator, or a dataset with 'mean' and 'std'."
    )


def _known(study: Studied, exact: xr.Dataset) -> xr.DataTree:
    """Make a node of exact means and standard deviations (output, time)."""
    from uqmbd.results import propagator_node
    from uqmbd.results.schema import labels, statistics_dataset

    model = study.model.outputs
    axes = labels(list(zip(model.names, model.units, strict=True)), [], study.times)
    found: dict[str, Any] = {}
    for name in ("mean", "std"):
        if name not in exact or set(exact[name].dims) != {"output", "time"}:
            raise StudyError(
                f"converge: the reference has no variable {name!r} with the dimensions (output, time); add it."
            )
        values = exact[name].transpose("output", "time")
        if "output" in values.coords:
            given = [str(v) for v in values["output"].values]
            if sorted(given) != sorted(model.names):
                raise StudyError(f"converge: the reference has the outputs {given}; expected {list(model.names)}.")
            values = values.isel(output=[given.index(n) for n in model.names])
        if values.shape != axes.shape or not bool(np.isfinite(values.values).all()):
            raise StudyError(
                f"converge: {name!r} of the reference has the shape {values.shape}; expected finite values of the "
                f"shape {axes.shape}."
            )
        found[name] = values.values
    label = str(exact.attrs.get("label", "exact"))
    return propagator_node(label, statistics_dataset(axes, **found), propagator=label, realisations=0, wall_time=0.0)
