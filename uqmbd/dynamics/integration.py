"""Integration of an ensemble: who integrates what, and in which stacks."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.dop853 import integrate_by_dop853
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.ida import integrate_by_ida
from uqmbd.dynamics.trajectories import Counters, Trajectories
from uqmbd.errors import StudyError

__all__ = ["INTEGRATORS", "STACK", "Integrator", "integrate"]

Array = NDArray[np.float64]

Integrator = Literal["auto", "ida", "dop853"]
INTEGRATORS: tuple[Integrator, ...] = ("auto", "ida", "dop853")

STACK = 64
"""Realisations of a stack."""


def integrate(
    ensemble: Ensemble, times: Array, rtol: float = 1e-6, stack: int = STACK, method: Integrator = "auto"
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
    stack : int
        Most realisations that are integrated together.
    method : {"auto", "ida", "dop853"}
        ``ida``: the stabilised index-2 form by IDA, implicit, for stiff mechanisms too.  ``dop853``: the index-1 form
        by an explicit method of order 8 with projection.  ``auto``: the latter where the mechanism is small enough for
        its linear algebra to be compiled; realisations that turn out to be stiff, or fail, are integrated by IDA.

    Raises
    ------
    uqmbd.StudyError
        If the mechanism is too large for ``dop853``.

    Returns
    -------
    Trajectories
        A realisation that fails does not disturb the others.
    """
    start, layout = ensemble.start, ensemble.model.layout
    states = np.full((len(ensemble), len(times), layout.width), np.nan)
    messages = list(start.messages)
    counters = Counters()
    assembled = np.flatnonzero(start.ok)
    explicit = method != "ida" and _compiled(ensemble)
    if method == "dop853" and not explicit:
        raise StudyError(
            f"mechanism {ensemble.model.name!r} has too many equations for the integrator 'dop853', whose linear "
            "algebra is compiled; use 'auto' or 'ida'."
        )
    for k in range(0, len(assembled), stack):
        members = assembled[k : k + stack]
        if explicit and layout.unknowns:
            solved = integrate_by_dop853(ensemble, members, times, rtol)
            states[members] = solved.states
            counters = counters + solved.counters
            for member, message in zip(members, solved.messages, strict=True):
                messages[member] = message
            if method == "dop853":
                continue
            members = members[[bool(message) for message in solved.messages]]
        if len(members):
            solved = integrate_by_ida(ensemble, members, times, rtol)
            states[members] = solved.states
            counters = counters + solved.counters
            for member, message in zip(members, solved.messages, strict=True):
                messages[member] = message
    return Trajectories(times, states, tuple(messages), counters)


def _compiled(ensemble: Ensemble) -> bool:
    system = ensemble.model.system
    return system is not None and system.project is not None
