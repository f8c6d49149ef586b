"""Integration of an ensemble by any integrator, held against the constraints."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.integrators.between import with_motion_between
from uqmbd.dynamics.integrators.capabilities import require_for
from uqmbd.dynamics.integrators.checked import checked
from uqmbd.dynamics.integrators.protocol import capabilities_of
from uqmbd.dynamics.integrators.registry import built_in_names, integrator_class
from uqmbd.dynamics.integrators.sampled import trajectories_in_samples
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["integrate"]


def integrate(
    ensemble: Ensemble, times: Array, rtol: float = 1e-6, method: str = "auto", *, between: bool = False
) -> Trajectories:
    """Assemble and integrate every realisation of an ensemble.

    Parameters
    ----------
    ensemble : Ensemble
        K realisations.
    times : array, shape (T,)
        Output times, strictly increasing; the first is the start.
    rtol : float
        Relative tolerance.
    method : str
        Name of an integrator, of the core or of a plugin.
    between : bool
        Whether the motion between the output times is returned, too (`Trajectories.path`).

    Raises
    ------
    uqmbd.StudyError
        If the integrator cannot do what the mechanism takes, as follow events, or returns what is none.

    Warns
    -----
    uqmbd.RedundantConstraintWarning
        If the independent equations became dependent on the way, and others were chosen.

    Returns
    -------
    Trajectories
        A realisation that fails does not disturb the others.
    """
    require_for(ensemble.model, method, f"mechanism {ensemble.model.name!r}")
    cls = integrator_class(method)
    integrator = cls()
    recorded = between and capabilities_of(cls).dense_output
    options = {"recording": True} if recorded else {}

    def solve(ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
        return _valid(integrator.integrate(ensemble, times, rtol, **options), method, ensemble, times)

    model = ensemble.model
    if between and not recorded:
        solve = partial(with_motion_between, solve)
    if not model.controls or capabilities_of(cls).sampled_control:
        found = checked(solve, ensemble, times, rtol)
    else:
        found = checked(partial(trajectories_in_samples, solve), ensemble, times, rtol)
    return replace(found, rtol=rtol) if between else found


def _valid(found: object, name: str, ensemble: Ensemble, times: Array) -> Trajectories:
    """Return what an integrator gives, if it is of the right kind."""
    shape = (len(ensemble), len(times), ensemble.model.layout.width)
    if not isinstance(found, Trajectories) or np.shape(found.states) != shape or len(found.messages) != shape[0]:
        what = f"a {type(found).__name__}"
        if isinstance(found, Trajectories):
            what = f"states of shape {np.shape(found.states)} and {len(found.messages)} messages"
        raise StudyError(
            f"the integrator {name!r}: its method integrate returned {what}; expected uqmbd.extend.Trajectories "
            f"with states of shape {shape} and {shape[0]} messages."
        )
    # others may have changed the states behind it
    return found if name in built_in_names() else replace(found, off=None)
