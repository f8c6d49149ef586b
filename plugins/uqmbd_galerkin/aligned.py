"""Galerkin projection aligned at equal phases: the phase of a clock is the independent variable; time is expanded."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import AlignedElement
from uqmbd.results import AlignedChaos
from uqmbd.typing import Array, Index
from uqmbd_galerkin.clock_rates import TURN, ClockRates, find_clock
from uqmbd_galerkin.ending import padded
from uqmbd_galerkin.phase_segments import PER_TURN, in_segments, points_of

__all__ = ["galerkin_in_phase"]


EXTENSIONS = 6
"""Largest number of extensions by further phases until all samples of the statistics reach the last time."""

LATE = 1e-12
"""Largest distance of the last marker from the last output time, relative to the range of times."""

LONGEST = 8.0
"""Largest ratio of integration time to output time."""

IN_TIME = 4
"""Number of segments of the initial interval that is integrated over time, until the clock runs."""


@dataclass(eq=False)
class _AlignedTrajectory:
    """Coefficients (P, S, N, width + 1) of states and time at the points of consecutive segments, up to a phase."""

    motion: uqmbd.extend.PhaseMotion
    parts: list[Array]
    phase: float = 0.0  # last phase so far, rad

    def follow(self, turns: float) -> None:
        """Integrate for a number of turns."""
        count = max(1, int(np.ceil(turns * PER_TURN)))
        edges = np.asarray(self.phase + np.arange(count + 1) * (TURN / PER_TURN), dtype=np.float64)
        points = points_of(edges)
        # the first point of a segment equals the last point of the previous one
        phases, inverse = np.unique(points.ravel(), return_inverse=True)
        found = self.motion.at(phases)[:, inverse]
        self.parts.append(found.reshape(len(found), *points.shape, -1))
        self.phase = float(edges[-1])

    @property
    def coefficients(self) -> Array:
        return np.concatenate(self.parts, axis=1)

    @property
    def last(self) -> Array:
        """Coefficients (P,) of the time at the end, s."""
        found: Array = self.parts[-1][:, -1, -1, -1]
        return found


def galerkin_in_phase(
    propagator: uqmbd.extend.Propagator,
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    terms: Index,
    rule: uqmbd.extend.Quadrature,
    projected: uqmbd.extend.ProjectedEnsemble,
    verification: uqmbd.extend.Verification,
    pilots: Array,
    wanted: str | None,
    begin: float,
) -> xr.DataTree:
    """Find a clock from realisations at `pilots` (K, input), integrate over its phase, and return the node.

    The outputs of `projected` include the quantities that the clock needs; `terms` has shape (P, d). The stated error
    is computed from the `verification` realisations. `wanted`: name of a clock; `begin`: start time of the computation,
    s.
    """
    times, label = problem.times, problem.label
    rates, piloted = find_clock(problem, projected.ensemble, pilots, wanted)
    problem.progress.start(label, len(rule))
    path = _start_over_phase(problem, projected, rates)
    box = uqmbd.extend.GermBox.whole(space)
    end, length = float(times[-1]), float(times[-1] - times[0])
    try:
        with problem.timed("integration"):
            _follow_nodes(path, projected, end)
        for extension in range(EXTENSIONS + 1):
            late = _late_times(path, box, terms, problem, verification)
            if not (late > LATE * length).any() or extension == EXTENSIONS or path.last[0] > end + LONGEST * length:
                break
            pace = (path.last[0] - path.parts[-1][0, 0, 0, -1]) / (path.parts[-1].shape[1] / PER_TURN)
            with problem.timed("integration"):
                path.follow(1.05 * float(late.max()) / pace)
    except uqmbd.IntegrationError as stopped:
        raise uqmbd.StudyError(
            f"{label}: alignment='phase' with the clock {rates.clock.name!r}: {str(stopped).rstrip('.')}. The "
            "integration continues until all nodes reach the phase of the fastest node. Use "
            "Collocation(alignment='phase', elements=...), choose another clock, truncate the distributions, or "
            "study a shorter time."
        ) from None
    if (late > LATE * length).any():
        warnings.warn(
            f"{label}: {100 * np.mean(late > LATE * length):.3g} % of the samples do not reach the last output time "
            "within the integrated range of phases, so statistics are NaN at late times. Raise the order, or truncate "
            "the distributions.",
            stacklevel=3,
        )
    outputs = len(problem.labels.outputs)
    coefficients = path.coefficients
    edges, response, error = in_segments(projected, coefficients, outputs)
    element = AlignedElement.through(
        box, ("",) * response.shape[1], projected.project(edges), projected.project(response), "phase"
    )
    chaos = AlignedChaos(
        (element,),
        terms,
        problem.labels,
        **verification.known,
    ).reached()
    last = float(np.asarray(chaos.labels.times)[-1])
    problem.progress.advance(label, len(rule))
    problem.progress.finish(label)
    return problem.node(
        propagator,
        padded(chaos.statistics(), times),
        realisations=len(rule) + verification.asked + piloted,
        wall_time=problem.clock() - begin,
        counters=path.motion.counters,
        children={
            "aligned": chaos.to_dataset(),
            "diagnostics": _diagnostics(projected, coefficients, rates),
        },
        attrs={
            "failures": verification.failures,
            "failed_share": verification.failed_share([verification], [1.0], len(rule) + piloted, 0),
            "terms": len(terms),
            "nodes": len(rule),
            "unknowns": projected.unknowns + len(terms),
            "quadrature": rule.name,
            "integrated_by": "dop853",
            "start_corrections": projected.start.corrections,
            "verification": len(verification),
            "clock": rates.clock.name,
            "clock_kind": "angle" if rates.clock.turn else "oscillation",
            "longer": float((edges[:, -1].max() - times[0]) / length),
            "interpolation_error": error,
            "segments": response.shape[1],
            "turns": path.phase / TURN,
            **({"ends_at": last} if last < end else {}),
        },
    )


def _start_over_phase(
    problem: uqmbd.extend.Problem, projected: uqmbd.extend.ProjectedEnsemble, rates: ClockRates
) -> _AlignedTrajectory:
    """Return the start of the integration over phase; integrate over time until the clock runs if it starts at rest."""
    times, rtol = problem.times, problem.rtol
    if rates.until <= times[0]:
        return _AlignedTrajectory(_in_phase(problem, projected, rates, times, projected.start.state), [])
    points = points_of(np.linspace(times[0], rates.until, IN_TIME + 1))
    own, inverse = np.unique(points.ravel(), return_inverse=True)
    found = projected.integrate(own, rtol, "dop853")
    if found.message:
        raise uqmbd.IntegrationError(f"{problem.label}: {found.message}")
    whole = np.zeros((*found.coefficients.shape[:2], found.coefficients.shape[2] + 1))
    whole[..., :-1] = found.coefficients
    whole[0, :, -1] = own
    later = np.array([rates.until, max(times[-1], 2 * rates.until - times[0])])
    motion = _in_phase(problem, projected, rates, later, found.coefficients[:, -1])
    return _AlignedTrajectory(motion, [whole[:, inverse].reshape(len(whole), *points.shape, -1)])


def _in_phase(
    problem: uqmbd.extend.Problem,
    projected: uqmbd.extend.ProjectedEnsemble,
    rates: ClockRates,
    times: Array,
    state: Array,
) -> uqmbd.extend.PhaseMotion:
    """Return the motion with all nodes at the same initial phase of the clock."""
    nodal = projected.nodal(state)
    ahead = rates.ahead(np.full(len(nodal), times[0]), nodal, TURN / PER_TURN)
    return projected.in_phase(rates, times, problem.rtol, state, *ahead)


def _follow_nodes(path: _AlignedTrajectory, projected: uqmbd.extend.ProjectedEnsemble, end: float) -> None:
    """Integrate until all nodes have reached a time."""
    path.follow(1.0)
    while True:
        times = projected.nodal(path.last)
        if times.min() >= end:
            return
        before = projected.nodal(path.parts[-1][:, 0, 0, -1])
        pace = ((times - before) / (path.parts[-1].shape[1] / PER_TURN)).min()
        # the loop continues if the clock slows down
        path.follow(min(float((end - times.min()) / pace), path.phase / TURN))


def _late_times(
    path: _AlignedTrajectory,
    box: uqmbd.extend.GermBox,
    terms: Index,
    problem: uqmbd.extend.Problem,
    verification: uqmbd.extend.Verification,
) -> Array:
    """Return the durations (S,) in s from last marker to last time, of all samples and verification realisations."""
    edges = np.stack([path.parts[0][:, 0, 0, -1], path.last], axis=1)
    outputs = problem.labels.shape[0]
    element = AlignedElement(box, ("",), edges, np.zeros((len(terms), 1, outputs, 1)), "phase")
    return AlignedChaos((element,), terms, problem.labels, **verification.known).late()


def _diagnostics(projected: uqmbd.extend.ProjectedEnsemble, coefficients: Array, rates: ClockRates) -> xr.Dataset:
    """Return the invariants of the projected motion over the markers."""
    nodal = projected.nodal(coefficients[:, :, 0])
    times, states = nodal[..., -1], nodal[..., :-1]
    energy = projected.weights @ projected.ensemble.energies(times, states).sum(axis=1)
    drift = projected.constraints(times, states)
    phase = np.arange(len(energy)) * (TURN / PER_TURN)
    if rates.until > times[0, 0]:
        phase = np.concatenate([np.full(IN_TIME, np.nan), phase[:-IN_TIME]])
    what = "landmark"
    return xr.Dataset(
        {
            "energy": (what, energy, {"units": "J", "long_name": "expectation of kinetic and potential energy"}),
            "constraint_rms": (what, drift, {"long_name": "root of the expectation of the squared constraints"}),
            "mean_time": (what, projected.weights @ times, {"units": "s", "long_name": "expectation of the time"}),
        },
        coords={"phase": (what, phase, {"units": "rad", "long_name": "since the clock runs"})},
    )
