"""The result of a study: the nodes of its methods, and the comparison of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import xarray as xr

from uqmbd.results.schema import (
    as_text,
    join_nodes,
    united,
)
from uqmbd.results.tree.compared import compare_both

__all__ = ["study_tree"]


def study_tree(
    nodes: Iterable[xr.DataTree],
    *,
    study: str,
    mechanism: str,
    reference: str | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.DataTree:
    """Join the nodes of several propagators to the result of a study, and compare them.

    Parameters
    ----------
    nodes : iterable of xarray.DataTree
        From :func:`uqmbd.results.propagator_node`; their labels must differ.
    study, mechanism : str
        Names.
    reference : str, optional
        Label of the method that the others are compared with; default :func:`uqmbd.results.choose_reference`.
    attrs : mapping, optional
        Further attributes of the root, as ``rtol``, ``integrator``, ``command``.

    Returns
    -------
    xarray.DataTree

    Raises
    ------
    StudyError
        If there is no node, or two have the same label.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[1.0]], std=[[0.0]]),
    ...                        propagator="perturbation", realisations=1, wall_time=0.1)
    >>> sorted(study_tree([node], study="s", mechanism="m").children)
    ['comparison', 'mine']
    """
    found = list(nodes)
    tree = join_nodes(found, study=study, mechanism=mechanism, attrs=attrs)
    by_label = {str(node.name): node for node in found}
    tree["comparison"] = xr.DataTree(
        as_text(united(compare_both(by_label, reference, float((attrs or {}).get("rtol", 0.0)))))
    )
    return tree
