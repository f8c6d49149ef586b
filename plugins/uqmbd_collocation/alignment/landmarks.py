"""Landmarks: events, and equal phases of a clock, at which realisations are compared instead of at equal times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

import uqmbd
from uqmbd.results import AlignedElement
from uqmbd.typing import Array

__all__ = ["PER_TURN", "TURN", "Landmarked", "marks_behind", "phase_landmarks", "time_landmarks"]


TURN = 2 * np.pi

PER_TURN = 4
"""Landmarks of a turn."""

NEWTON = 6
"""Steps in which the time of a phase is found."""


@dataclass(frozen=True, eq=False)
class Landmarked:
    """Realisations from landmark to landmark.

    Attributes
    ----------
    edges : array, shape (K, S + 1)
        Times of the landmarks, s; NaN where a realisation does not reach one.
    response : array, shape (K, S, O, N)
        Outputs at `uqmbd.results.AlignedElement.points` of each segment.
    """

    edges: Array
    response: Array


def phase_landmarks(found: uqmbd.Dense, phases: uqmbd.Phases, marks: Array, outputs: int, points: int) -> Landmarked:
    """Cut realisations where their phases pass given values.

    Parameters
    ----------
    found : uqmbd.Dense
        Realisations, which are fine.
    phases : uqmbd.Phases
        Of these.
    marks : array, shape (S,)
        Increasing phases of the landmarks behind the first, which is the start, rad.
    outputs : int
        So many of the rows are outputs of the study.
    points : int
        Points of a segment.
    """
    where = AlignedElement.points(points)
    edges = np.empty((len(phases.values), len(marks) + 1))
    response = np.empty((len(edges), len(marks), outputs, points))
    for k, phase in enumerate(phases.values):
        edges[k] = np.concatenate([found.times[:1], _times_of(found.times, phase, marks)])
        moments = edges[k, :-1, None] + where * np.diff(edges[k])[:, None]
        values = found.spline(k)(moments.ravel(), extrapolate=False)[:, :outputs]
        response[k] = values.reshape(len(marks), points, outputs).transpose(0, 2, 1)
    return Landmarked(edges, response)


def time_landmarks(found: uqmbd.Dense, edges: Array, outputs: int, points: int) -> Landmarked:
    """Cut realisations, which are fine, at the same times (S + 1,), s; see `phase_landmarks`."""
    moments = edges[:-1, None] + AlignedElement.points(points) * np.diff(edges)[:, None]
    response = np.empty((len(found.values), len(edges) - 1, outputs, points))
    for k in range(len(response)):
        values = found.spline(k)(moments.ravel())[:, :outputs]
        response[k] = values.reshape(len(edges) - 1, points, outputs).transpose(0, 2, 1)
    return Landmarked(np.tile(edges, (len(response), 1)), response)


def _times_of(times: Array, phase: Array, marks: Array) -> Array:
    """Find the times (S,) at which a phase (T,) passes given values; NaN where it does not reach one."""
    highest = np.maximum.accumulate(phase)
    spline = make_interp_spline(times, phase, uqmbd.Dense.degree)
    rate = spline.derivative()
    right = np.clip(np.searchsorted(highest, marks), 1, len(times) - 1)
    low, high = times[right - 1], times[right]
    # the first guess is linear; Newton's steps stay between the neighbours
    rise = phase[right] - phase[right - 1]
    at = low + (high - low) * np.clip((marks - phase[right - 1]) / np.where(rise == 0, np.inf, rise), 0, 1)
    for _ in range(NEWTON):
        slope = rate(at)
        at = np.clip(at - (spline(at) - marks) / np.where(slope <= 0, np.inf, slope), low, high)
    return np.where(marks <= highest[-1], at, np.nan)


def marks_behind(starts: Array, last: float) -> Array:
    """Return phases of landmarks (S,), rad: multiples of a part of a turn, behind all starts (K,) and up to the last.

    Parameters
    ----------
    starts : array, shape (K,)
        Phases at the first time, rad.
    last : float
        Phase that is reached, rad.
    """
    step = TURN / PER_TURN
    first = np.floor(starts.max() / step + 0.5) + 1
    return np.asarray(np.arange(first, np.ceil(last / step) + 1) * step)
