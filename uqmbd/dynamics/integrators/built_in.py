"""Integrators of the core: one explicit, two implicit, and an automatic choice between them."""

from __future__ import annotations

import time as clock
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from uqmbd.dynamics.contact import integrate_with_events, motion_in_segments
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration import (
    COSTLY,
    RADAU_STAGES,
    SegmentedMotion,
    Solved,
    Trajectories,
    allowed_attempts,
    integrate_by_dop853,
    integrate_by_ida,
    integrate_by_radau,
    is_implicit,
)
from uqmbd.dynamics.integrators.protocol import Capabilities
from uqmbd.dynamics.integrators.sampled import trajectories_in_samples
from uqmbd.dynamics.integrators.stacks import MANY, STACK, IntegratedRealisations, checked, in_stacks
from uqmbd.dynamics.projection import (
    LINEAR_SOLVERS,
    LinearSolver,
    ProjectedEquations,
    ProjectedTrajectories,
    Watch,
    implicit,
    integrate_coefficients,
)
from uqmbd.errors import StudyError
from uqmbd.plugins import hookimpl
from uqmbd.typing import Array, Index

__all__ = ["Auto", "BuiltInIntegrators", "Dop853", "Ida", "Radau"]


EXPLICIT = Capabilities(
    events=True,
    projected=True,
    segments=True,
    bounded_steps=True,
    stoppable=True,
    delegates=True,
    sampled_control=True,
    releases_gil=True,
    dense_output=True,
)


@dataclass(frozen=True)
class Dop853:
    """Explicit method of order 8 with projection, for the index-1 form; from event to event if there are events."""

    name = "dop853"
    capabilities = EXPLICIT

    stack: int = MANY  # most realisations that are integrated together

    def integrate(self, ensemble: Ensemble, times: Array, rtol: float, *, recording: bool = False) -> Trajectories:
        """Integrate every realisation; raise `uqmbd.StudyError` if it is too large for compiled linear algebra."""
        if ensemble.model.events:
            return integrate_with_events(ensemble, times, rtol, recording=recording)
        _require_compiled(ensemble.model, _compiled(ensemble.model))
        return in_stacks(self._solve, ensemble, times, rtol, self.stack, recording=recording)

    def _solve(
        self, ensemble: Ensemble, members: Index, times: Array, rtol: float, recording: bool
    ) -> IntegratedRealisations:
        return IntegratedRealisations.of(
            integrate_by_dop853(ensemble, members, times, rtol, recording=recording), self.name
        )

    def integrate_segments(self, ensemble: Ensemble, times: Array, rtol: float) -> SegmentedMotion:
        """Follow the only realisation from event to event."""
        return motion_in_segments(ensemble, times, rtol)

    def integrate_projected(
        self, projected: ProjectedEquations, times: Array, rtol: float, watch: Watch | None = None
    ) -> ProjectedTrajectories:
        """Integrate the projected index-1 form."""
        _require_compiled(projected.model, not projected.model.layout.unknowns or projected.coupled.compiled)
        if _impacts(projected.model):
            return _from_event_to_event(projected, times, rtol)
        if not projected.model.layout.unknowns:
            return _still(projected, times)
        begin = clock.perf_counter()
        _, before = projected.start, projected.coupled.counters  # with controllers there are several intervals
        run, message = integrate_coefficients(projected, times, rtol, watch)
        counters = {
            "accelerations": run.evaluations,
            "steps": int(run.steps[0]),
            **{name: count - before[name] for name, count in projected.coupled.counters.items()},
            "seconds": clock.perf_counter() - begin,
        }
        return ProjectedTrajectories(times, run.result, message, self.name, counters)


@dataclass(frozen=True)
class Ida:
    """Implicit method IDA for the stabilised index-2 form, also for stiff mechanisms.

    `Dop853` integrates the realisations that IDA cannot integrate through a singular pose.
    """

    name = "ida"
    capabilities = Capabilities(
        projected=True,
        bounded_steps=True,
        stoppable=True,
        delegates=True,
        dense_output=True,
        linear_solvers=LINEAR_SOLVERS,
    )

    stack: int = STACK  # most realisations that are integrated together

    def integrate(self, ensemble: Ensemble, times: Array, rtol: float, *, recording: bool = False) -> Trajectories:
        """Integrate every realisation."""
        return in_stacks(self._solve, ensemble, times, rtol, self.stack, recording=recording)

    def _solve(
        self, ensemble: Ensemble, members: Index, times: Array, rtol: float, recording: bool
    ) -> IntegratedRealisations:
        solved = integrate_by_ida(ensemble, members, times, rtol, recording=recording)
        found, final = IntegratedRealisations.of(solved, self.name), np.flatnonzero(solved.final)
        if not len(final) or not _compiled(ensemble.model):
            return found
        # IDA stops at a singular pose; the explicit method passes over it, or finds that the motion ends
        other = integrate_by_dop853(ensemble, members[final], times, rtol, recording=recording)
        taken = [k for k, message in enumerate(other.messages) if other.final[k] or not message]
        return found.replaced(final, other, Dop853.name, np.array(taken, dtype=np.int64))

    def integrate_projected(
        self,
        projected: ProjectedEquations,
        times: Array,
        rtol: float,
        linear_solver: LinearSolver = "auto",
        watch: Watch | None = None,
    ) -> ProjectedTrajectories:
        """Integrate the projected stabilised index-2 form."""
        if not projected.model.layout.unknowns:
            return _still(projected, times)
        found = implicit(projected, times, rtol, linear_solver, watch)
        return ProjectedTrajectories(times, found.coefficients, found.message, self.name, found.counters)


@dataclass(frozen=True)
class Radau:
    """Compiled implicit method of order 9 for the index-1 form of stiff mechanisms; from event to event with events."""

    name = "radau"
    capabilities = Capabilities(
        events=True,
        segments=True,
        bounded_steps=True,
        sampled_control=True,
        releases_gil=True,
        dense_output=True,
    )

    stack: int = MANY  # most realisations that are integrated together

    def integrate(self, ensemble: Ensemble, times: Array, rtol: float, *, recording: bool = False) -> Trajectories:
        """Integrate every realisation; raise `uqmbd.StudyError` if the compiled linear algebra is too large."""
        _require_implicit(ensemble.model)
        if ensemble.model.events:
            return integrate_with_events(ensemble, times, rtol, recording=recording, stages=RADAU_STAGES)
        return in_stacks(self._solve, ensemble, times, rtol, self.stack, recording=recording)

    def _solve(
        self, ensemble: Ensemble, members: Index, times: Array, rtol: float, recording: bool
    ) -> IntegratedRealisations:
        return IntegratedRealisations.of(
            integrate_by_radau(ensemble, members, times, rtol, recording=recording), self.name
        )

    def integrate_segments(self, ensemble: Ensemble, times: Array, rtol: float) -> SegmentedMotion:
        """Follow the only realisation from event to event."""
        _require_implicit(ensemble.model)
        return motion_in_segments(ensemble, times, rtol, stages=RADAU_STAGES)


@dataclass(frozen=True)
class Auto:
    """Integrate by `Dop853`, stiff realisations by `Radau`, and large mechanisms and failed realisations by `Ida`.

    The costs of the methods are compared by counts, separately for each realisation.
    """

    name = "auto"
    capabilities = replace(EXPLICIT, linear_solvers=LINEAR_SOLVERS)

    # largest number of realisations integrated together; `Ida` integrates smaller stacks with shared steps
    stack: int = MANY

    def integrate(self, ensemble: Ensemble, times: Array, rtol: float, *, recording: bool = False) -> Trajectories:
        """Integrate every realisation."""
        if ensemble.model.events:
            return integrate_with_events(ensemble, times, rtol, recording=recording)
        if not _compiled(ensemble.model):
            other = partial(Ida(min(self.stack, STACK)).integrate, recording=recording)
            sampled = bool(ensemble.model.controls)
            return trajectories_in_samples(other, ensemble, times, rtol) if sampled else other(ensemble, times, rtol)
        return in_stacks(self._solve, ensemble, times, rtol, self.stack, recording=recording)

    def _solve(
        self, ensemble: Ensemble, members: Index, times: Array, rtol: float, recording: bool
    ) -> IntegratedRealisations:
        implicit = is_implicit(ensemble.model)
        if not (implicit or _sundials_is_installed()):
            # the explicit method also integrates stiff realisations, with more steps
            return IntegratedRealisations.of(
                integrate_by_dop853(ensemble, members, times, rtol, patient=True, recording=recording), Dop853.name
            )
        solved = integrate_by_dop853(ensemble, members, times, rtol, comparing=True, recording=recording)
        found, explicit_cost = IntegratedRealisations.of(solved, Dop853.name), np.array(solved.explicit_cost)
        # failed realisations that another integrator might integrate
        left = np.array([k for k, why in enumerate(solved.messages) if why and not solved.final[k]], dtype=np.int64)
        if not len(left):
            return found
        sundials = not implicit or _sundials_is_installed()
        if ensemble.model.controls:
            return self._from_sample_to_sample(found, left, ensemble.select(members[left]), times, rtol, recording)
        costly = np.zeros(0, dtype=np.int64)
        if implicit:
            stiff = left[explicit_cost[left] > 0]
            found, stiff, costly = _by_radau(found, stiff, ensemble, members, times, rtol, explicit_cost, recording)
            left = np.sort(np.concatenate([left[explicit_cost[left] == 0], stiff]))
        for some in _stacks(left[explicit_cost[left] == 0]) if sundials else ():
            other = integrate_by_ida(ensemble, members[some], times, rtol, recording=recording)
            found = found.replaced(some, other, Ida.name, np.arange(len(some)))
        for some in _stacks(left[explicit_cost[left] > 0]) if sundials else ():
            most = float(explicit_cost[some].sum())
            other = integrate_by_ida(ensemble, members[some], times, rtol, most, recording=recording)
            found = found.replaced(some, other, Ida.name, np.arange(len(some)))
        # the cheaper method at the start may become more expensive later, or fail
        slow = [k for k in left.tolist() if explicit_cost[k] and found.solved.messages[k]]
        again = np.array(sorted([*slow, *costly.tolist()]), dtype=np.int64)
        if len(again):
            other = integrate_by_dop853(ensemble, members[again], times, rtol, patient=True, recording=recording)
            done = np.array([k for k, message in enumerate(other.messages) if not message], dtype=np.int64)
            found = found.replaced(again, other, Dop853.name, done)
        return found

    def _from_sample_to_sample(
        self, found: IntegratedRealisations, left: Index, ensemble: Ensemble, times: Array, rtol: float, recording: bool
    ) -> IntegratedRealisations:
        """Choose the method again after each sample, for realisations that failed in a single integration."""
        if not len(left):
            return found
        other = trajectories_in_samples(partial(self.integrate, recording=recording), ensemble, times, rtol)
        counted = other.counters
        name = Ida.name if counted.by_ida else Radau.name if counted.by_radau else Dop853.name
        counters = replace(counted, by_ida=0, by_radau=0, by_dop853=0, stiff=len(left))
        solved = Solved(other.states, other.messages, counters, notes=other.notes, path=other.path)
        return found.replaced(left, solved, name, np.arange(len(left)))

    def integrate_segments(self, ensemble: Ensemble, times: Array, rtol: float) -> SegmentedMotion:
        """Follow the only realisation from event to event."""
        return motion_in_segments(ensemble, times, rtol)

    def integrate_projected(
        self,
        projected: ProjectedEquations,
        times: Array,
        rtol: float,
        linear_solver: LinearSolver = "auto",
        watch: Watch | None = None,
    ) -> ProjectedTrajectories:
        """Integrate the coefficients by the explicit method, or by IDA if they are stiff or the method fails."""
        if _impacts(projected.model):
            return _from_event_to_event(projected, times, rtol)
        if not projected.model.layout.unknowns:
            return _still(projected, times)
        if not projected.coupled.compiled:
            return Ida().integrate_projected(projected, times, rtol, linear_solver, watch)
        first = Dop853().integrate_projected(projected, times, rtol, watch)
        if not first.message or not _sundials_is_installed():
            return first
        second = Ida().integrate_projected(projected, times, rtol, linear_solver, watch)
        spent = first.counters["seconds"] + second.counters["seconds"]
        further = second.message and _reached(first) > _reached(second)
        both = first.counters | {"stiff": 1} | second.counters | {"seconds": spent}
        return replace(first if further else second, counters=both)


class BuiltInIntegrators:
    """Integrators of the core, in the form of a plugin."""

    @hookimpl
    def uqmbd_integrators(self) -> list[type]:
        """Return the integrators of the core."""
        return [Auto, Ida, Dop853, Radau]


def _compiled(model: Model) -> bool:
    """Return whether the linear algebra of the explicit method is compiled."""
    return model.system is not None and model.system.programs is not None


def _require_compiled(model: Model, compiled: bool) -> None:
    if not compiled:
        raise StudyError(
            f"mechanism {model.name!r} has too many equations for the integrator 'dop853', whose linear algebra is "
            "compiled; use 'auto' or 'ida'."
        )


def _require_implicit(model: Model) -> None:
    if model.layout.unknowns and not is_implicit(model):
        raise StudyError(
            f"mechanism {model.name!r} has too many equations for the integrator 'radau', whose linear algebra is "
            "compiled; use 'auto' or 'ida'."
        )


def _by_radau(
    found: IntegratedRealisations,
    stiff: Index,
    ensemble: Ensemble,
    members: Index,
    times: Array,
    rtol: float,
    explicit_cost: Array,
    recording: bool,
) -> tuple[IntegratedRealisations, Index, Index]:
    """Integrate stiff rows implicitly; stop a row if it costs more than explicit steps.

    Return the results, rows that failed, and rows whose explicit steps cost less.
    """
    if not len(stiff):
        return found, stiff, stiff
    allowed = allowed_attempts(ensemble.model, explicit_cost[stiff])
    other = integrate_by_radau(ensemble, members[stiff], times, rtol, allowed=allowed, recording=recording)
    done = np.array([not why or other.final[k] for k, why in enumerate(other.messages)], dtype=bool)
    costly = np.array([why == COSTLY for why in other.messages], dtype=bool) & ~done
    return found.replaced(stiff, other, Radau.name, np.flatnonzero(done)), stiff[~done & ~costly], stiff[costly]


def _stacks(members: Index) -> list[Index]:
    """Divide realisations into stacks for IDA."""
    return [members[first : first + STACK] for first in range(0, len(members), STACK)]


def _impacts(model: Model) -> bool:
    """Return whether events change the motion; other events only record times."""
    return any(directions for *_, directions in model.events)


def _from_event_to_event(projected: ProjectedEquations, times: Array, rtol: float) -> ProjectedTrajectories:
    """Integrate node by node: with as many terms as nodes, the projected equations equal the nodal equations.

    ``Psi^T W r = 0`` with a square and invertible ``Psi^T W`` is equivalent to ``r = 0`` at every node. The same
    applies to the projected laws of impact. Coefficients follow from the nodal states.
    """
    if not projected.collocates:
        raise StudyError(
            f"mechanism {projected.model.name!r} has impacts, which occur at different times at the nodes. A "
            f"projection can represent impacts only with as many terms as nodes, but it has {projected.terms} terms "
            f"on {len(projected.weights)} nodes."
        )
    found = checked(integrate_with_events, projected.ensemble, times, rtol)
    message = next((m for m in found.messages if m), "")
    counters: dict[str, Any] = asdict(found.counters)
    return ProjectedTrajectories(times, projected.project(found.states), message, Dop853.name, counters)


def _still(projected: ProjectedEquations, times: Array) -> ProjectedTrajectories:
    """Return the constant motion of immovable bodies."""
    coefficients = np.repeat(projected.start.state[:, None], len(times), axis=1)
    return ProjectedTrajectories(times, coefficients, "", "none", {})


def _reached(found: ProjectedTrajectories) -> int:
    """Return the number of computed times."""
    return int(np.isfinite(found.coefficients).all(axis=(0, 2)).sum())


def _sundials_is_installed() -> bool:
    """Return whether scikit-sundae can be imported; it has no wheel for Linux on aarch64."""
    try:
        return find_spec("sksundae") is not None
    except ValueError:
        return False
