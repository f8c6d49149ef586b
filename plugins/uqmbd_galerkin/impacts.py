"""Impacts, at which velocities jump: which expansions follow them."""

from __future__ import annotations

import uqmbd

__all__ = ["refuse_impacts"]


def refuse_impacts(label: str, ensemble: uqmbd.Ensemble, *, terms: int, nodes: int) -> None:
    """Raise where a mechanism has impacts that an expansion cannot follow.

    Realisations meet at times of their own.  With as many terms as nodes the projected laws of impact hold at each
    node; with fewer the jump of one would be a jump of all.

    Raises
    ------
    uqmbd.StudyError
        Which components, and what to use instead.
    """
    names = dict.fromkeys(component for component, _, directions in ensemble.model.events if directions)
    if names and terms != nodes:
        listed = ", ".join(map(repr, names))
        raise uqmbd.StudyError(
            f"{label}: at the impacts of {listed} velocities jump, at another time in each realisation, which a "
            f"Galerkin projection of {terms} terms on {nodes} nodes cannot follow. Use elements='adaptive', which has "
            "as many terms as nodes, or index_set='tensor', or collocation with alignment='events'."
        )
