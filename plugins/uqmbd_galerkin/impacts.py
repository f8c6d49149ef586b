"""Impacts, at which velocities jump: which expansions follow them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import uqmbd

if TYPE_CHECKING:
    from uqmbd_galerkin.propagator import Galerkin

__all__ = ["refuse_impacts"]


def refuse_impacts(options: Galerkin, ensemble: uqmbd.Ensemble, *, terms: int, nodes: int) -> None:
    """Raise where a mechanism has impacts that an expansion cannot follow.

    Realisations meet at times of their own.  With as many terms as nodes the projected laws of impact hold at each
    node; with fewer the jump of one would be a jump of all.  An event that only notes a time is in nobody's way.

    Raises
    ------
    uqmbd.StudyError
        Which components, and what to use instead.
    """
    names = dict.fromkeys(component for component, _, directions in ensemble.model.events if directions)
    if not names or terms == nodes:
        return
    # what makes as many terms as nodes of these options
    remedies = []
    if options.products != "tensor":
        remedies.append("index_set='tensor'")
    if options.rule != "gauss":
        remedies.append("rule='gauss' without samples=")
    elif options.nodes is not None:
        remedies.append("without nodes=")
    if options.weights is not None:
        remedies.append("without weights=")
    listed = ", ".join(map(repr, names))
    raise uqmbd.StudyError(
        f"{options.node_name}: at the impacts of {listed} velocities jump, at another time in each realisation, which "
        f"a Galerkin projection of {terms} terms on {nodes} nodes cannot follow; one of as many terms as nodes can. "
        f"Use it {' and '.join(remedies)}, better with elements='adaptive' too; or collocation with alignment='events'."
    )
