"""Error against cost as a part of a study: what is asked for, and the node that a run stores of it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.progress import Progress
from uqmbd.propagation.convergence.option_levels import check_convergence, converge
from uqmbd.propagation.execution import FOLDER
from uqmbd.propagation.methods import Studied
from uqmbd.results.storage import WITHIN

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["check_convergence_of", "with_convergence"]


def check_convergence_of(study: Studied, given: object) -> Mapping[str, Any] | None:
    """Return the arguments of `Study.converge` that a study was given.

    Raise StudyError if they are no mapping, have no propagators, an unknown reference, or levels that do not fit the
    methods.
    """
    if given is None:
        return None
    where = f"study {study.name!r}"
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise StudyError(
            f"{where}: convergence is {given!r}; expected the arguments of study.converge, as in "
            "{'propagators': [Collocation], 'order': [1, 2, 3], 'reference': 'monte-carlo'}."
        )
    levels = {name: value for name, value in given.items() if name not in ("propagators", "reference")}
    if "propagators" not in given:
        raise StudyError(
            f"{where}: convergence has no 'propagators'; give it some, as in 'propagators': [Collocation]."
        )
    check_convergence(study, given["propagators"], levels)
    reference, known = given.get("reference"), [p.node_name for p in study.propagators]
    if isinstance(reference, str) and reference not in known:
        raise StudyError(
            f"{where}: the reference of convergence is {reference!r}, which is no propagator of this study; there are: "
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
    """Add the node ``convergence`` to the results of a study that asks for it.

    Where `left_out` says why, they are not computed.
    Whatever goes wrong here is a warning and the attribute ``problem`` of the node: the other results stand.
    """
    import xarray as xr

    arguments = dict(study.convergence or {})
    reference = arguments.pop("reference", None)
    found = None
    # what is computed must stand, whatever methods of plugins raise
    with Isolated(*ERRORS_AND_EXITS) as work:
        if left_out:
            raise StudyError(f"{left_out}; run the study without it for them.")
        if isinstance(reference, str):
            if reference not in tree.children:
                raise StudyError(f"the reference {reference!r} gave no results.")
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
            f"study {study.name!r}: there are no curves of error against cost: {work.reason}", UserWarning, stacklevel=3
        )
        found = xr.Dataset(attrs={"problem": work.reason})
    tree["convergence"] = xr.DataTree(found)
    return tree
