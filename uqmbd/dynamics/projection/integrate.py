"""Integration of a projected ensemble: explicit where it can, by IDA where it must."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from uqmbd.dynamics.capabilities import INTEGRATORS, require, require_for
from uqmbd.dynamics.integrate import integrate
from uqmbd.dynamics.integration import position_jumps
from uqmbd.dynamics.projection.constraint_check import projected_off
from uqmbd.dynamics.projection.dop853 import lock_step
from uqmbd.dynamics.projection.ensemble import ProjectedEnsemble
from uqmbd.dynamics.projection.ida import LINEAR_SOLVERS, LinearSolver, implicit
from uqmbd.errors import StudyError
from uqmbd.plugins import integrator as integrator_of_plugin
from uqmbd.typing import Array

__all__ = ["ProjectedTrajectories", "Watch", "integrate_projected"]


Watch = Callable[[Array], bool]
"""Is given the coefficients (P, T, width) so far, NaN from the present time on; true: stop."""


@dataclass(frozen=True)
class ProjectedTrajectories:
    """Coefficients of states at the output times.

    Attributes
    ----------
    times : array, shape (T,)
        s.
    coefficients : array, shape (P, T, 2 coordinate + state)
        Of coordinates, auxiliary states and velocities; NaN from the time on at which it stopped.
    message : str
        Why it stopped, or empty.
    integrator : str
        ``dop853``, ``ida``, or ``none`` where nothing moves.
    counters : dict
        What it cost.
    """

    times: Array
    coefficients: Array
    message: str
    integrator: str
    counters: dict[str, Any]


def integrate_projected(
    projected: ProjectedEnsemble,
    times: Array,
    rtol: float = 1e-6,
    integrator: str = "auto",
    linear_solver: str = "auto",
    watch: Watch | None = None,
) -> ProjectedTrajectories:
    """Integrate the coefficients of a projected ensemble.

    Parameters
    ----------
    projected : ProjectedEnsemble
        What to integrate.
    times : array, shape (T,)
        Output times, strictly increasing; the first is the start.
    rtol : float
        Relative tolerance.
    integrator : str
        As for one realisation: ``dop853``, explicit on the projected index-1 form, or ``ida`` on the projected
        stabilised index-2 form; ``auto``: the first, and the second where that is stiff or fails; or one of a plugin
        that declares ``projected = True``.
    linear_solver : {"auto", "dense", "sparse", "krylov-nodal", "krylov-mean"}
        Of IDA; ``auto`` chooses by the number of unknowns, and leaves the mean preconditioner where it breaks down.
    watch : callable, optional
        Asked now and then with the coefficients so far; a true answer ends the run.

    Raises
    ------
    uqmbd.StudyError
        If a name is unknown, the integrator cannot do what it takes, or the mechanism is too large.
    """
    if linear_solver not in LINEAR_SOLVERS:
        raise StudyError(
            f"there is no solver {linear_solver!r} for a projection; there are: {', '.join(LINEAR_SOLVERS)}."
        )
    where = f"mechanism {projected.model.name!r}"
    require(integrator, "projected", where)
    jumping = any(directions for *_, directions in projected.model.events)
    if jumping:
        require_for(projected.model, integrator, where)
    of_plugin = integrator not in INTEGRATORS
    explicit = integrator != "ida" and (not projected.model.layout.unknowns or projected.coupled.compiled)
    if integrator == "dop853" and not explicit:
        raise StudyError(
            f"mechanism {projected.model.name!r} has too many equations for the integrator 'dop853', whose linear "
            "algebra is compiled; use 'auto' or 'ida'."
        )
    if jumps := position_jumps(projected.ensemble, times, rtol):
        node, text = next(iter(jumps.items()))
        state = np.full((projected.terms, len(times), projected.model.layout.width), np.nan)
        state[:, 0] = projected.start.state
        return ProjectedTrajectories(times, state, f"at node {node} {text}", "none", {})
    # other events only note when they happen
    if jumping and not of_plugin:
        return _with_events(projected, times, rtol)
    if of_plugin:
        found = _by_plugin(projected, times, rtol, integrator)
    else:
        found = _solved(projected, times, rtol, integrator, linear_solver, watch, explicit=explicit)
    first, text = projected_off(projected, times, found.coefficients, rtol)
    if found.message or not text:
        return found
    coefficients = found.coefficients.copy()
    coefficients[:, max(1, first) :] = np.nan
    return replace(found, coefficients=coefficients, message=text)


def _solved(
    projected: ProjectedEnsemble,
    times: Array,
    rtol: float,
    integrator: str,
    linear_solver: str,
    watch: Watch | None,
    *,
    explicit: bool,
) -> ProjectedTrajectories:
    """Integrate without events."""
    counters: dict[str, Any] = {}
    message = ""
    if not projected.model.layout.unknowns:  # nothing can move
        still = np.repeat(projected.start.state[:, None], len(times), axis=1)
        return ProjectedTrajectories(times, still, "", "none", {})
    if explicit:
        begin = clock.perf_counter()
        run, equations = lock_step(projected, times, rtol, watch)
        counters = {
            "accelerations": equations.evaluations,
            "steps": run.steps,
            "systems": projected.coupled.systems,
            "iterations": projected.coupled.iterations,
            "direct": projected.coupled.direct,
            "krylov": projected.coupled.krylov,
            "seconds": clock.perf_counter() - begin,
        }
        message = run.failed.get(0, "")
        if not message or integrator == "dop853":
            return ProjectedTrajectories(times, run.result, message, "dop853", counters)
        counters["stiff"] = 1
    solver: LinearSolver = linear_solver  # type: ignore[assignment]
    found = implicit(projected, times, rtol, solver, watch)
    spent = counters.get("seconds", 0.0) + found.counters["seconds"]
    both = counters | found.counters | {"seconds": spent}
    if found.message and explicit and _reached(run.result) > _reached(found.coefficients):
        return ProjectedTrajectories(times, run.result, message, "dop853", both)
    return ProjectedTrajectories(times, found.coefficients, found.message, "ida", both)


def _by_plugin(projected: ProjectedEnsemble, times: Array, rtol: float, name: str) -> ProjectedTrajectories:
    """Let the integrator of a plugin integrate."""
    found = integrator_of_plugin(name)().integrate_projected(projected, times, rtol)
    shape = (projected.terms, len(times), projected.model.layout.width)
    if not isinstance(found, ProjectedTrajectories) or np.shape(found.coefficients) != shape:
        what = f"a {type(found).__name__}"
        if isinstance(found, ProjectedTrajectories):
            what = f"coefficients of shape {np.shape(found.coefficients)}"
        raise StudyError(
            f"the integrator {name!r}: its method integrate_projected returned {what}; expected "
            f"uqmbd.ProjectedTrajectories with coefficients of shape {shape}."
        )
    return replace(found, integrator=name)


def _with_events(projected: ProjectedEnsemble, times: Array, rtol: float) -> ProjectedTrajectories:
    """Integrate from event to event, where as many terms as nodes make the projected equations those of the nodes.

    ``Psi^T W r = 0`` with a square and invertible ``Psi^T W`` is ``r = 0`` at every node, and so are the projected laws
    of impact; coefficients are those of the nodal states.
    """
    if not projected.collocates:
        raise StudyError(
            f"mechanism {projected.model.name!r} has impacts, which happen at another time at each node; a projection "
            f"follows them only with as many terms as nodes, and has {projected.terms} terms on "
            f"{len(projected.weights)} nodes."
        )
    found = integrate(projected.ensemble, times, rtol)
    message = next((m for m in found.messages if m), "")
    return ProjectedTrajectories(times, projected.project(found.states), message, "dop853", asdict(found.counters))


def _reached(coefficients: Array) -> int:
    """Count the times that were computed."""
    return int(np.isfinite(coefficients).all(axis=(0, 2)).sum())
