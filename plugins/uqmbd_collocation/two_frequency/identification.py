"""Identification of common frequencies and harmonics, from one realisation to all others.

The same combination of frequencies must have the same index in all realisations, so each fit starts from the series of
the nearest fitted realisation. Fits start with a short window, which tolerates inaccurate frequencies, and end with the
whole window, which gives accurate frequencies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from uqmbd.typing import Array, Index, Mask
from uqmbd_collocation.two_frequency.lattice import Base, ball, bases
from uqmbd_collocation.two_frequency.lines import strongest_lines
from uqmbd_collocation.two_frequency.series import HarmonicSeries, Signals, fit_series, refine

__all__ = ["QUASI_PERIODIC", "Identified", "FrequencyCombinations", "follow", "identify"]


QUASI_PERIODIC = 0.01
"""Largest residual of a quasi-periodic motion, relative to the scale of an output."""

GOAL = 3e-6
"""Residual below which no more harmonics are added."""

NEGLIGIBLE = 0.03
"""Smallest ratio of a retained harmonic to the residual, or to `GOAL` if the residual is below `GOAL`."""

ORDERS = (1, 2, 3, 5, 7, 9, 11, 13, 15, 19, 23, 31)
"""Orders of harmonics that are tried."""

MANY = 300
"""Largest number of harmonics of a series."""

USEFUL = 0.7
"""Largest ratio of new to old residual for which a higher order is useful."""

CROWDED = 0.25
"""Largest ratio of unknowns, two amplitudes for each harmonic, to the degrees of freedom ``2 L f`` of a signal.

L is its length in s, and f is the highest frequency of the harmonics in Hz. Series of a higher order are not tried."""

ALIKE = 30.0
"""Other frequencies are tried if a residual exceeds this multiple of the largest residual of the fitted realisations,
which counts as at least `GOAL`. They are also tried for every residual above `QUASI_PERIODIC`."""

LINES = 10
"""Number of spectral lines that determine the base."""

MAIN = 0.03
"""In short windows, only lines with at least this share of the strongest line are used."""

APART = 3.0
"""Smallest distance of main lines from each other and from zero, in units of the resolution of the first window."""

PROBES = 3
"""Number of realisations, in addition to the middle one, that select the harmonics."""

ATTEMPTS = 8
"""Number of pairs of lines that are tried as the base of a realisation."""


@dataclass(frozen=True, eq=False)
class FrequencyCombinations:
    """Combinations of base frequencies that all realisations share."""

    main: Index  # (C, M) combinations of the base frequencies in the strongest lines
    lattice: Index  # (H, M) all combinations of the series


@dataclass(frozen=True, eq=False)
class Identified:
    """Realisations as harmonic series."""

    kind: FrequencyCombinations
    # series of each realisation, or only of the first few if these are not quasi-periodic
    series: tuple[HarmonicSeries, ...]

    @property
    def residuals(self) -> Array:
        """Largest residual of each realisation (K,), relative to the scale of the output."""
        return np.array([float(one.residual.max(initial=0.0)) for one in self.series])

    @property
    def bad(self) -> Mask:
        """Mask (K,) of realisations that are not quasi-periodic."""
        return np.asarray(~(self.residuals <= QUASI_PERIODIC))


def identify(signals: Sequence[Signals], places: Array) -> Identified | None:
    """Return base frequencies and harmonics of K realisations at the same times.

    `places` (K, d): inputs divided by their spread. The result has the smallest share of realisations that are not
    quasi-periodic. If no line was found, the result is None.
    """
    best: Identified | None = None
    begin = int(np.argmin(np.sum((places - places.mean(axis=0)) ** 2, axis=1)))
    for _ in range(2):
        for base in _bases(signals[begin]):
            found = _identified(signals, places, begin, base)
            if not found.bad.any():
                return found
            if best is None or (found.bad.sum(), found.residuals.max()) < (best.bad.sum(), best.residuals.max()):
                best = found
        if best is None or best.bad.all():
            break
        # frequencies that are commensurate in the middle realisation can be distinguished in another one
        begin = int(np.argmax(best.residuals))
    if best is None or not best.bad.all():
        return best
    # if the middle realisation is not quasi-periodic, stop, but try a few others for more complete error messages
    others = [k for k in range(0, len(signals), max(1, len(signals) // PROBES)) if k != begin][:PROBES]
    alone = [_with_base(signals[k], base)[1] for k in others for base in _bases(signals[k])[-1:]]
    return Identified(best.kind, (*best.series[:1], *alone))


def follow(
    signals: Sequence[Signals],
    places: Array,
    kind: FrequencyCombinations,
    known: Sequence[HarmonicSeries],
    known_places: Array,
) -> list[HarmonicSeries]:
    """Fit series with the combinations of `kind` to K realisations at scaled inputs `places` (K, d).

    Each fit starts from the nearest known series.
    `known` contains at least one series, at scaled inputs `known_places` (N, d).
    """
    done, where = list(known), [*known_places]
    found: dict[int, HarmonicSeries] = {}
    while len(found) < len(signals):
        left = [k for k in range(len(signals)) if k not in found]
        distance = np.linalg.norm(places[left][:, None] - np.array(where), axis=2)
        k = left[int(np.argmin(distance.min(axis=1)))]
        guesses = _guesses(places[k], np.array(where), np.array([one.frequencies for one in done]))
        usual = max(float(one.residual.max(initial=0.0)) for one in done)
        found[k] = _fitted(signals[k], guesses, kind, min(QUASI_PERIODIC, ALIKE * max(usual, GOAL)))
        if found[k].residual.max(initial=0.0) <= QUASI_PERIODIC:
            done.append(found[k])
            where.append(places[k])
    return [found[k] for k in range(len(signals))]


def _bases(signals: Signals) -> list[Base]:
    lines = strongest_lines(signals, LINES)
    return bases(lines, 2 * np.pi / signals.length) if len(lines.frequencies) else []


def _identified(signals: Sequence[Signals], places: Array, begin: int, base: Base) -> Identified:
    """Fit all realisations, starting from realisation `begin`, whose base is known."""
    kind, first = _with_base(signals[begin], base)
    if first.residual.max(initial=0.0) > QUASI_PERIODIC:
        return Identified(kind, (first,))
    if len(signals) > 1:
        # the most distant realisations may need other harmonics
        others = np.argsort(-np.linalg.norm(places - places[begin], axis=1), kind="stable")[:PROBES]
        short = follow([signals[k] for k in others], places[others], kind, [first], places[begin : begin + 1])
        parts = [kind.lattice]
        parts += [_harmonics(signals[k], one.frequencies, kind.lattice) for k, one in zip(others, short, strict=True)]
        kind = FrequencyCombinations(kind.main, np.unique(np.concatenate(parts), axis=0))
        first = refine(signals[begin], first.frequencies, kind.lattice)
    rest = [k for k in range(len(signals)) if k != begin]
    found = follow([signals[k] for k in rest], places[rest], kind, [first], places[begin : begin + 1])
    found.insert(begin, first)
    return Identified(kind, tuple(found))


def _with_base(signals: Signals, base: Base) -> tuple[FrequencyCombinations, HarmonicSeries]:
    """Return main lines, harmonics and series of a realisation with a known base."""
    series = fit_series(signals, base.frequencies, base.lattice)
    size = np.sqrt(np.mean(series.sizes() ** 2, axis=1))
    order = np.argsort(-size)
    main = base.lattice[order[size[order] >= MAIN * size.max()]]
    if np.linalg.matrix_rank(main) < len(base.frequencies):
        main = base.lattice[order]
    lattice = _harmonics(signals, base.frequencies, base.lattice)
    return FrequencyCombinations(main, lattice), refine(signals, base.frequencies, lattice)


def _harmonics(signals: Signals, frequencies: Array, least: Index) -> Index:
    """Return the combinations (H, M) that a realisation needs, from the lowest order with a small residual.

    `frequencies` (M,): base frequencies, rad/s; `least` (C, M): combinations that are always included.
    """
    nyquist = np.pi / signals.times[1]
    series = refine(signals, frequencies, least)
    best, useless = series, 0
    for order in ORDERS:
        lattice = np.unique(np.concatenate([_one_sign(least), ball(order, len(frequencies))]), axis=0)
        values = np.abs(lattice @ series.frequencies)
        lattice = lattice[(values < 0.8 * nyquist) & (values > 0)]
        # degrees of freedom of the window up to the highest frequency of the series
        held = 2 * signals.length * float(np.abs(lattice @ series.frequencies).max(initial=0.0)) / (2 * np.pi)
        if 2 * len(lattice) > CROWDED * held or len(lattice) > MANY:
            break
        series = refine(signals, best.frequencies, lattice)
        useful = series.residual.max(initial=0.0) < USEFUL * best.residual.max(initial=0.0)
        # ignore orders that add nothing to the combinations always included
        useless = 0 if useful else useless + (order > np.abs(least).sum(axis=1).max())
        if series.residual.max(initial=0.0) < best.residual.max(initial=0.0):
            best = series
        if best.residual.max(initial=0.0) < GOAL or useless > 1:
            break
    size = best.sizes().max(axis=1, initial=0.0)
    kept = size > NEGLIGIBLE * max(float(best.residual.max(initial=0.0)), GOAL)
    found: Index = best.lattice[kept]
    return found if len(found) and np.linalg.matrix_rank(found) == len(frequencies) else least


def _one_sign(lattice: Index) -> Index:
    """Return combinations whose first nonzero number is positive."""
    first = np.take_along_axis(lattice, (lattice != 0).argmax(axis=1)[:, None], axis=1)
    found: Index = lattice * np.sign(first)
    return found


def _guesses(place: Array, places: Array, frequencies: Array) -> list[Array]:
    """Return likely frequencies at inputs (d,): from a plane through all known points, and the nearest point."""
    nearest = frequencies[np.argmin(np.linalg.norm(places - place, axis=1))]
    found = [nearest]
    if len(places) > places.shape[1] + 1:
        plane = np.concatenate([np.ones((len(places), 1)), places], axis=1)
        slopes = np.linalg.lstsq(plane, frequencies, rcond=1e-8)[0]
        found.insert(0, np.concatenate([[1.0], place]) @ slopes)
    return found


def _fitted(signals: Signals, guesses: list[Array], kind: FrequencyCombinations, goal: float) -> HarmonicSeries:
    """Fit a series from approximate frequencies, or from pairs of lines if the residual stays above a goal."""
    best = _refined(signals, guesses[0], kind)
    others = iter(guesses[1:])
    for further in (False, True):
        for guess in _from_lines(signals, guesses[0], kind) if further else others:
            if best.residual.max(initial=0.0) <= goal:
                return best
            other = _refined(signals, guess, kind)
            best = other if other.misfit < best.misfit else best
    return best


def _refined(signals: Signals, guess: Array, kind: FrequencyCombinations) -> HarmonicSeries:
    """Fit frequencies in windows of doubling length, then all harmonics in the whole window."""
    lines = np.sort(np.abs(kind.main @ guess))
    closest = float(np.diff(np.concatenate([[0.0], lines])).min())
    length = APART * 2 * np.pi / max(closest, 1e-12 * float(lines.max()))
    now = guess
    while length < signals.length:
        now = refine(signals.until(length), now, kind.main).frequencies
        length *= 2
    return refine(signals, refine(signals, now, kind.main).frequencies, kind.lattice)


def _from_lines(signals: Signals, guess: Array, kind: FrequencyCombinations) -> list[Array]:
    """Return base frequencies whose main combinations are lines of the spectrum, nearest to the guess first."""
    lines = strongest_lines(signals, LINES).frequencies
    rows = [0]
    for k in range(1, len(kind.main)):
        if len(rows) < len(guess) and np.linalg.matrix_rank(kind.main[[*rows, k]]) > len(rows):
            rows.append(k)
    if len(rows) < len(guess) or len(lines) < len(guess):
        return []
    signs = np.sign(kind.main[rows] @ guess)
    found = [np.linalg.solve(kind.main[rows], signs * np.array(some)) for some in permutations(lines, len(guess))]
    found.sort(key=lambda frequencies: float(np.linalg.norm(frequencies / guess - 1)))
    return found[:ATTEMPTS]
