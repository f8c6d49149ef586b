"""Integration of an ensemble: who integrates what, and in which stacks."""

from __future__ import annotations

import warnings

import numpy as np

from uqmbd.dynamics.assembly import violated
from uqmbd.dynamics.capabilities import INTEGRATORS, Integrator, require_for
from uqmbd.dynamics.checked import checked
from uqmbd.dynamics.contact import event_times, integrate_with_events
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Trajectories, gradient_lengths, integrate_by_dop853, integrate_by_ida
from uqmbd.errors import RedundantConstraintWarning, StudyError
from uqmbd.typing import Array

__all__ = ["INTEGRATORS", "STACK", "Integrator", "integrate"]


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
        ``ida``: the stabilised index-2 form by IDA, implicit, for stiff mechanisms too; realisations that it cannot
        lead over a singular pose are integrated by ``dop853``.  ``dop853``: the index-1 form
        by an explicit method of order 8 with projection.  ``auto``: the latter where the mechanism is small enough for
        its linear algebra to be compiled; realisations that turn out to be stiff, or fail, are integrated by IDA.

    Raises
    ------
    uqmbd.StudyError
        If the mechanism is too large for ``dop853``, or has events, which ``ida`` cannot follow.

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

    def solve(ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
        if ensemble.model.events:
            return _with_events(ensemble, times, rtol)
        return _integrate(ensemble, times, rtol, stack, method)

    return checked(solve, ensemble, times, rtol)


def _integrate(ensemble: Ensemble, times: Array, rtol: float, stack: int, method: Integrator) -> Trajectories:
    """Integrate a model without events."""
    start, layout = ensemble.start, ensemble.model.layout
    states = np.full((len(ensemble), len(times), layout.width), np.nan)
    messages = list(start.messages)
    counters, notes = Counters(), list[str]()
    by = np.full(len(ensemble), "", dtype="U6")
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
            states[members], by[members] = solved.states, "dop853"
            counters = counters + solved.counters
            for member, message in zip(members, solved.messages, strict=True):
                messages[member] = message
            notes += [note for note in solved.notes if note not in notes]
            if method == "dop853":
                continue
            again = [bool(m) and not final for m, final in zip(solved.messages, solved.final, strict=True)]
            members = members[again]
        if len(members):
            solved = integrate_by_ida(ensemble, members, times, rtol)
            states[members], by[members] = solved.states, "ida" if layout.unknowns else ""
            counters = counters + solved.counters
            for member, message in zip(members, solved.messages, strict=True):
                messages[member] = message
            members = members[np.array(solved.final, dtype=bool)]
        if len(members) and method == "ida" and layout.unknowns and _compiled(ensemble):
            # in a singular pose it stops; the explicit method passes over it, or knows that no motion leads on
            solved = integrate_by_dop853(ensemble, members, times, rtol)
            counters = counters + solved.counters
            notes += [note for note in solved.notes if note not in notes]
            for k, (message, final) in enumerate(zip(solved.messages, solved.final, strict=True)):
                if final or not message:
                    states[members[k]], messages[members[k]] = solved.states[k], message
                    by[members[k]] = "dop853"
    _stop_violations(ensemble, times, states, messages, rtol)
    if notes:
        more = f" (and {len(notes) - 1} more such changes)" if len(notes) > 1 else ""
        warnings.warn(
            f"mechanism {ensemble.model.name!r}: {notes[0]}{more}. The motion is not affected; "
            "the reactions of these joints are not unique.",
            RedundantConstraintWarning,
            stacklevel=5,
        )
    counters = counters + Counters(by_dop853=int(np.sum(by == "dop853")), by_ida=int(np.sum(by == "ida")))
    return Trajectories(times, states, tuple(messages), counters, notes=tuple(notes))


def _with_events(ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate a model with events: by the explicit method, one realisation after the other."""
    states = np.full((len(ensemble), len(times), ensemble.model.layout.width), np.nan)
    messages = list(ensemble.start.messages)
    assembled = np.flatnonzero(ensemble.start.ok)
    solved, runs = integrate_with_events(ensemble, assembled, times, rtol)
    states[assembled] = solved.states
    for member, message in zip(assembled, solved.messages, strict=True):
        messages[member] = message
    _stop_violations(ensemble, times, states, messages, rtol)
    scalars = event_times(ensemble, assembled, runs)
    counters = solved.counters + Counters(by_dop853=len(assembled))
    return Trajectories(times, states, tuple(messages), counters, scalars)


def _stop_violations(ensemble: Ensemble, times: Array, states: Array, messages: list[str], rtol: float) -> None:
    """Let realisations fail that violate equations which were left out as redundant."""
    model = ensemble.model
    if model.layout.rank == model.layout.constraints:
        return
    found = violated(model, times, states, ensemble.block, gradient_lengths(ensemble), rtol)
    for k, (first, text) in found.items():
        if not messages[k]:
            states[k, first:], messages[k] = np.nan, text


def _compiled(ensemble: Ensemble) -> bool:
    system = ensemble.model.system
    return system is not None and system.project is not None
