"""Convergence study within a study: check of the request, and the node with the results."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.plugins import method_with_option
from uqmbd.progress import Progress
from uqmbd.propagation.convergence.option_levels import check_convergence, converge
from uqmbd.propagation.execution import FOLDER
from uqmbd.propagation.methods import Studied
from uqmbd.results.storage import WITHIN

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["check_convergence_of", "with_convergence"]


def check_convergence_of(study: Studied, given: object) -> Mapping[str, Any] | None:
    """Return the arguments of `Study.converge` from the option of a study after a check.

    Raise StudyError if the option is not a mapping, lacks propagators, or has an unknown reference or unsuitable
    levels.
    """
    if given is None:
        return None
    where = f"study {study.name!r}"
    method = method_with_option("order", "Method")
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise StudyError(
            f"{where}: convergence is {given!r}; expected the arguments of study.converge, e.g. {{'propagators': "
            f"[{method}], 'order': [1, 2, 3], 'reference': 'LABEL'}}."
        )
    levels = {name: value for name, value in given.items() if name not in ("propagators", "reference")}
    if "propagators" not in given:
        raise StudyError(f"{where}: convergence has no key 'propagators'; add it, e.g. 'propagators': [{method}].")
    check_convergence(study, given["propagators"], levels)
    reference, known = given.get("reference"), [p.node_name for p in study.propagators]
    if isinstance(reference, str) and reference not in known:
        raise StudyError(
            f"{where}: the reference of convergence is {reference!r}; expected a propagator of this study: "
            f"{', '.join(known) or 'none'}."
        )
    return MappingProxyType(dict(given))


def with_convergence(
    study: Studied,
    tree: xr.DataTree,
    executor: Executor | None,
    progress: Progress | bool | None = None,
    folder: Path | None = None,
    *,
    left_out: str = "",
) -> xr.DataTree:
    """Add the node ``convergence`` to the results of a study that requests it.

    If `left_out` states a reason, the convergence study is omitted. Every error becomes a warning and the attribute
    ``problem`` of the node; the other results remain.
    """
    import xarray as xr

    arguments = dict(study.convergence or {})
    reference = arguments.pop("reference", None)
    found = None
    # computed results must remain if methods of plugins raise errors
    with Isolated(*ERRORS_AND_EXITS) as work:
        if left_out:
            raise StudyError(f"{left_out}; run the study without a budget to compute the curves.")
        if isinstance(reference, str):
            if reference not in tree.children:
                raise StudyError(f"the reference {reference!r} has no results.")
            reference = tree[reference]
        found = converge(
            study,
            arguments.pop("propagators"),
            reference=reference,
            workers=executor or 1,
            progress=progress,
            folder=folder / FOLDER / WITHIN if folder else None,
            **arguments,
        )
    if found is None:
        warnings.warn(
            f"study {study.name!r}: the curves of error against cost could not be computed: {work.reason}",
            UserWarning,
            stacklevel=3,
        )
        found = xr.Dataset(attrs={"problem": work.reason})
    tree["convergence"] = xr.DataTree(found)
    return tree
