"""Explicit integration of the projected index-1 form: the driver steps all coefficients as one problem."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import LANES, ExplicitStatus, IntegrationState
from uqmbd.dynamics.integration import explicit_method, longest_step, pace, stopped
from uqmbd.dynamics.projection.ensemble import ProjectedEquations
from uqmbd.dynamics.projection.trajectories import Watch
from uqmbd.typing import Array

__all__ = ["integrate_coefficients"]


SOLVED = 0.01
"""Ratio of the accuracy of accelerations to the tolerance of the integration."""

WATCHED = 20
"""Approximate number of calls of an observer."""


def integrate_coefficients(
    projected: ProjectedEquations, times: Array, rtol: float, watch: Watch | None = None
) -> tuple[IntegrationState, str]:
    """Integrate; return the run with coefficients (P, T, width), and the reason of a failure or an empty text."""
    start, velocities = projected.start, projected.model.layout.velocities
    longest = longest_step(projected.model.rough, times)
    intervals = pace(projected.ensemble, times, rtol, knots=True)
    size = float(np.abs(projected.ensemble.start.q).max(initial=0.0))
    run = IntegrationState(
        projected.coupled.dynamics(SOLVED * rtol),
        explicit_method(rtol, guarded=False),
        start.state,
        np.zeros((projected.terms, 0)),
        times,
        [[interval._replace(longest=min(interval.longest, longest)) for interval in intervals]],
        np.full(projected.terms, rtol * min(1.0, max(1e-3, size))),
    )
    lanes, requested = slice(0, LANES), 0
    run.told[lanes] = watch is not None
    run.status[lanes] = ExplicitStatus.JUMP
    while True:
        now, status = float(run.now[0]), ExplicitStatus(run.status[0])
        column = int(run.column[0])
        if watch is not None and column - 1 >= requested + max(1, len(times) // WATCHED):
            requested = column - 1
            if watch(run.result):
                return run, ""
        if status is ExplicitStatus.JUMP:
            change = projected.impulse(run.z, now, rtol)
            if np.any(change):
                run.z[:, velocities:] += change
                run.result[:, times[1:].searchsorted(now) + 1 : times.searchsorted(now, "right")] = run.z[:, None]
                run.fresh[lanes] = 1
        elif status is ExplicitStatus.STIFF:
            return run, f"stiff at t = {now:.6g} s"
        elif status in (ExplicitStatus.MANY, ExplicitStatus.SMALL):
            return run, stopped(now, float(run.tried[0]), many=status is ExplicitStatus.MANY)
        elif status is ExplicitStatus.DONE:
            return run, ""
        run.status[lanes] = ExplicitStatus.RUNNING
        with np.errstate(all="ignore"):
            run.advance()
