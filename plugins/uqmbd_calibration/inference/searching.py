"""Maxima of the posterior density by the surrogate over the prior.

A long record of a rotation or an oscillation has many maxima, because phases may differ by whole turns. The beginning
of a record has few maxima. The search therefore climbs on growing time windows, from points that are spread over the
prior, and adds new starts in each window.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import stats

from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.climbing import Peaks, climb, distinct
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.posterior import Posterior

__all__ = ["Builder", "search", "spread_over_prior"]


Builder = Callable[[tuple[MachineRecords, ...]], Posterior]
"""Function that returns a posterior density by the surrogate over the prior, for cases with selected values."""

WINDOWS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Fractions of the duration of the records."""

THINNED = 200
"""Number of values of a block that a search uses."""

POOL, STARTS, KEPT = 2048, 24, 12
"""Numbers of evaluated points of the prior, of starts in a window, and of maxima that start the next window."""

APART = 0.2
"""Least distance between starts of one window, in standard deviations of the prior."""


def spread_over_prior(dimension: int, count: int, seed: int) -> Array:
    """Return points (count, dimension) of a Sobol' sequence, as standard normal variables."""
    whole = max(0, int(np.ceil(np.log2(count))))
    points = stats.qmc.Sobol(dimension, rng=np.random.default_rng(seed)).random_base2(whole)[:count]
    return np.asarray(stats.norm.ppf(np.clip(points, 1e-9, 1 - 1e-9)))


def search(build: Builder, cases: tuple[MachineRecords, ...], dimension: int, width: int, seed: int) -> Peaks:
    """Return maxima for all values, the best one first.

    `build`: function that returns the posterior density for selected values; `dimension`: number of unknown inputs;
    `width`: length of the vector of unknowns.
    """
    generator = np.random.default_rng(seed)
    pool = np.zeros((POOL, width))
    pool[:, :dimension] = np.clip(spread_over_prior(dimension, POOL, seed), -4.0, 4.0)
    pool[0] = 0.0
    peaks: Peaks | None = None
    for window in _windows(cases, dimension):
        chosen = tuple(case.part([_rows(b, window, generator) for b in case.blocks]) for case in cases)
        target = build(tuple(case for case in chosen if case.blocks))
        density = target.log_density(target.with_levels(pool))
        starts = pool[_apart(pool, density)]
        if peaks is not None:
            starts = np.concatenate([peaks.vectors, starts])
        peaks = distinct(climb(target, starts), dimension, KEPT)
    assert peaks is not None
    return peaks


def _ends(cases: tuple[MachineRecords, ...]) -> tuple[float, float]:
    times = [block.times for case in cases for block in case.blocks if not block.timeless]
    if not times:
        return 0.0, 0.0
    return min(float(t[0]) for t in times), max(float(t[-1]) for t in times)


def _windows(cases: tuple[MachineRecords, ...], dimension: int) -> list[float]:
    """Return the ends of windows, s: all windows with enough values, and infinity for the last one."""
    begin, end = _ends(cases)
    ends = [begin + part * (end - begin) for part in WINDOWS[:-1]] if end > begin else []
    counts = [sum(len(_within(block, until)) for case in cases for block in case.blocks) for until in ends]
    return [until for until, count in zip(ends, counts, strict=True) if count >= 3 * dimension + 3] + [np.inf]


def _within(block: object, until: float) -> Index:
    times = block.times  # type: ignore[attr-defined]
    values = block.values  # type: ignore[attr-defined]
    return np.arange(len(values)) if not len(times) else np.flatnonzero(times <= until)


def _rows(block: object, until: float, generator: np.random.Generator) -> Index:
    """Return the selected rows of a window: one random row in each of `THINNED` equal parts."""
    rows = _within(block, until)
    if len(rows) <= THINNED:
        return rows
    parts = np.array_split(rows, THINNED)
    return np.array([part[generator.integers(len(part))] for part in parts])


def _apart(pool: Array, density: Array) -> list[int]:
    """Return the indices of the best points whose distances are large enough."""
    kept: list[int] = []
    for k in np.argsort(-density, kind="stable").tolist():
        if not np.isfinite(density[k]):
            break
        if not kept or np.min(np.linalg.norm(pool[kept] - pool[k], axis=1)) > APART * np.sqrt(pool.shape[1]):
            kept.append(k)
        if len(kept) == STARTS:
            break
    return kept or [0]
