"""Impacts, at which velocities jump: no equation of coefficients holds through them."""

from __future__ import annotations

import uqmbd

__all__ = ["refuse_impacts"]


def refuse_impacts(label: str, ensemble: uqmbd.Ensemble) -> None:
    """Raise where a mechanism has impacts.

    Realisations meet at times of their own: coefficients of an expansion would have to jump all the time.

    Raises
    ------
    uqmbd.StudyError
        Which components, and what to use instead.
    """
    names = dict.fromkeys(component for component, _, directions in ensemble.model.events if directions)
    if names:
        listed = ", ".join(map(repr, names))
        raise uqmbd.StudyError(
            f"{label}: at the impacts of {listed} velocities jump, at another time in each realisation, which a "
            "Galerkin projection cannot follow. Use a compliant contact (such as PlaneContact) with "
            "elements='adaptive', or collocation, or Monte Carlo."
        )
