"""Describe methods that integrate coupled systems instead of single realisations."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from uqmbd.wording import format_integer

__all__ = ["coupled_systems"]


def coupled_systems(nodes: Mapping[str, xr.DataTree]) -> str:
    """Return a text on the realisations of methods with coupled systems; empty without such a method.

    These methods state the number of ``unknowns`` of their systems; `nodes`: propagator nodes by label.

    >>> one, two, other = (xr.DataTree(xr.Dataset(attrs=dict(unknowns=k, realisations=9))) for k in (64, 96, 0))
    >>> coupled_systems({"a": one, "other": other})[:60], coupled_systems({"other": other})
    ('a integrates a system of 64 unknowns instead of single reali', '')
    >>> coupled_systems({"a": one, "b": two}).partition(".")[0]
    'a, b integrate systems of 64, 96 unknowns instead of single realisations'
    """
    unknowns = {label: int(node.attrs.get("unknowns", 0)) for label, node in nodes.items()}
    found = {k: v for k, v in unknowns.items() if v and int(nodes[k].attrs.get("realisations", 0))}
    if not found:
        return ""
    many = (
        ("integrate systems", "these methods", "these systems")
        if len(found) > 1
        else ("integrates a system", "this method", "this system")
    )
    return (
        f"{', '.join(found)} {many[0]} of {', '.join(map(format_integer, found.values()))} unknowns instead of single "
        f"realisations. The number of realisations of {many[1]} counts the nodes of {many[2]}, and verification "
        "realisations."
    )
