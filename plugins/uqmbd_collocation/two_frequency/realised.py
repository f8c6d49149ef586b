"""Realisations as quasi-periodic series: a problem whose outputs are frequencies and amplitudes.

Every rule, fit and refinement works on it as on the problem itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import Labels, OutputInfo
from uqmbd.results import Status
from uqmbd.typing import Array, Index, Mask
from uqmbd_collocation.runs import DerivedSource
from uqmbd_collocation.two_frequency.identification import (
    QUASI_PERIODIC,
    FrequencyCombinations,
    Identified,
    follow,
    identify,
)
from uqmbd_collocation.two_frequency.series import HarmonicSeries, Signals, fit_series

__all__ = ["SeriesProblem", "HarmonicSums"]


LONGEST = 8.0
"""Longest time that realisations are followed, over that of the output times."""

SEEN = 1.5
"""Periods of each frequency that realisations show, at least."""

PERIODS = 30.0
"""Periods of the slowest frequency in which all harmonics can be separated: with fewer of them, and a residual,
realisations are integrated for longer."""

FEW = 10.0
"""Periods of the fastest main line after which other motions are refused."""

ACCURATE = 1e-4
"""Residual that is good enough in any case, over the scale of an output."""

UNSEEN = 1e-13
"""Share of the energy of a motion above the frequencies that fewer values can represent."""

LEFT_OUT = 1e-5
"""Root mean square of all harmonics together that are left out of an output, over its scale."""

ROUNDING = 1e4
"""Least scale of an output, over its largest value and the tolerance of the integration, whose errors add up."""


NOTHING = "alignment='two-frequency' needs motions that oscillate, and nothing does. Leave alignment out."


@dataclass(frozen=True, eq=False)
class HarmonicSums:
    """Coefficients of frequencies, constants, drifts and harmonics, from those of the columns of a `SeriesProblem`."""

    frequencies: Array  # (P, M)
    constants: Array
    drifts: Array  # (P, O), as `constants`
    waves: NDArray[np.complex128]  # (P, O, H) a - i b for a cos + b sin


@dataclass
class SeriesProblem(DerivedSource):
    """Problem with outputs: base frequencies, then constant, drift, cosines and sines of each output of the study."""

    problem: uqmbd.extend.Problem
    kind: FrequencyCombinations | None = None  # that of all realisations; set by `find`
    scales: Array = field(default_factory=lambda: np.zeros(0))
    """(O,) root mean squares of the motion, with which residuals are compared."""
    kept: Mask = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    """(O, H) harmonics of the kind that an output has."""
    longer: float = 1.0  # factor of the output times to which realisations are integrated
    spent: int = 0  # realisations so far
    failures: int = 0  # realisations that failed
    residual: float = 0.0  # largest so far, over the scale of the output
    counters: Counter[str] = field(default_factory=Counter)
    _count: int = 0
    _spread: Array = field(default_factory=lambda: np.zeros(0))
    _known: dict[bytes, HarmonicSeries] = field(default_factory=dict)
    _lost: dict[bytes, tuple[int, str]] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Time from the first output time to the last, s."""
        return float(self.problem.times[-1] - self.problem.times[0])

    @property
    def labels(self) -> Labels:
        """The frequencies in front of the outputs; columns are numbered in place of times."""
        inner = self.problem.labels
        columns = np.arange(float(2 + 2 * len(self.lattice)))
        return replace(inner, outputs=(OutputInfo("frequencies", "rad/s"), *inner.outputs), times=columns)

    @property
    def lattice(self) -> Index:
        """Multiples (H, M) of the base frequencies in the harmonics that outputs have."""
        found: Index = self._kind.lattice[self.kept.any(axis=0)]
        return found

    @property
    def _kind(self) -> FrequencyCombinations:
        if self.kind is None:
            raise uqmbd.StudyError(f"{self.label}: no frequencies were looked for.")
        return self.kind

    def find(self, values: Array) -> None:
        """Find the frequencies and harmonics of realisations at inputs (K, d).

        Raise StudyError if some are no sums of harmonics of two frequencies, IntegrationError if all fail.
        """
        spread = values.std(axis=0)
        self._spread = np.where(spread > 0, spread, 1.0)
        best: tuple[Identified | None, NDArray[np.intp], float, int] | None = None
        while True:
            found, told, good = self._followed(values)
            self.scales = self._scales(found.values[good])
            signals = [self._signals(found, k) for k in good]
            identified = identify(signals, values[good] / self._spread)
            if best is None or (identified and best[0] and identified.residuals.max() < best[0].residuals.max()):
                best = identified, good, self.longer, len(found.times)
            if identified is None or self._enough(identified) or 2 * self.longer > LONGEST:
                break
            self.longer *= 2
        identified, good, self.longer, self._count = best
        if identified is None:
            raise uqmbd.StudyError(f"{self.label}: {NOTHING}")
        self._refuse(identified.series)
        self.kind, self.kept = identified.kind, _needed(identified.series)
        self._keep(values[good], identified.series)
        self._lose(values, told)

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Compute realisations and their series: response (K, 1 + O, 2 + 2 H).

        Raise StudyError if some are no sums of the harmonics.
        """
        keys = _keys(values)
        missing = list(dict.fromkeys(k for k in keys if k not in self._known and k not in self._lost))
        if missing:
            rows = values[[keys.index(key) for key in missing]]
            found, told, good = self._followed(rows, known=bool(self._count))
            signals = [self._signals(found, k) for k in good]
            places = np.array([np.frombuffer(key) for key in self._known]) / self._spread
            series = follow(signals, rows[good] / self._spread, self._kind, list(self._known.values()), places)
            self._refuse(series)
            self._keep(rows[good], series)
            self._lose(rows, told)
        used = self.kept.any(axis=0)
        base, half, waves = self.lattice.shape[1], len(self.lattice), np.tile(self.kept[:, used], 2)
        response = np.full((len(values), 1 + len(self.scales), 2 + 2 * half), np.nan)
        for k, key in enumerate(keys):
            if key in self._known:
                one = self._known[key]
                response[k, 0] = 0.0
                response[k, 0, :base] = one.frequencies
                amplitudes = (one.amplitudes * self.scales).T
                response[k, 1:, 0] = amplitudes[:, 0]
                # what a drift adds until the end has the size of other columns
                response[k, 1:, 1] = amplitudes[:, 1] * self.length
                response[k, 1:, 2:] = np.where(waves, amplitudes[:, 2:][:, np.tile(used, 2)], 0.0)
        status = np.array([self._lost.get(key, (int(Status.OK), ""))[0] for key in keys])
        messages = tuple(self._lost.get(key, (0, ""))[1] for key in keys)
        return uqmbd.extend.Realisations(values, response, status, messages, {}, 0.0)

    def split(self, coefficients: Array) -> HarmonicSums:
        """Return the sums of harmonics of coefficients (P, 1 + O, 2 + 2 H) of the columns."""
        base, half = self.lattice.shape[1], len(self.lattice)
        outputs = coefficients[:, 1:]
        return HarmonicSums(
            coefficients[:, 0, :base],
            outputs[:, :, 0],
            outputs[:, :, 1] / self.length,
            outputs[:, :, 2 : 2 + half] - 1j * outputs[:, :, 2 + half :],
        )

    def _followed(
        self, values: Array, known: bool = False
    ) -> tuple[uqmbd.extend.Dense, uqmbd.extend.Realisations, NDArray[np.intp]]:
        """Compute realisations over their times, with those that are fine."""
        end = float(self.problem.times[0]) + self.longer * self.length
        found, told = uqmbd.extend.dense(self.problem, values, end, self._count if known else 0)
        self.spent += len(values)
        self.counters.update(told.counters)
        finite = np.isfinite(found.values).all(axis=(1, 2))
        good = np.flatnonzero(told.good & finite)
        if not len(good):
            reason = next((message for message in told.messages if message), "an output is not finite")
            raise uqmbd.IntegrationError(f"{self.label}: all {len(values)} realisations failed: {reason}")
        return found, told, good

    def _signals(self, found: uqmbd.extend.Dense, k: int) -> Signals:
        return Signals(found.times - found.times[0], found.values[k].T / self.scales).thinned(UNSEEN)

    def _scales(self, values: Array) -> Array:
        """Root mean squares (O,) of outputs (K, O, T) about constants and drifts, where they move most."""
        times = np.linspace(0.0, 1.0, values.shape[2])
        plain = [fit_series(Signals(times, one.T), np.zeros(0), np.zeros((0, 0), dtype=np.int64)) for one in values]
        moving = np.max([one.residual for one in plain], axis=0)
        least = ROUNDING * self.rtol * np.abs(values).max(axis=(0, 2))
        if not (moving > least).any():
            raise uqmbd.StudyError(f"{self.label}: {NOTHING}")
        scales = np.maximum(moving, least)
        return np.asarray(np.where(scales > 0, scales, 1.0))

    def _enough(self, found: Identified) -> bool:
        """Return whether longer realisations would add no information."""
        turns = self.longer * self.length / (2 * np.pi)
        if found.bad.any():
            # some of these are of a base of their own, which may have fewer frequencies
            base, main = len(found.kind.main.T), found.kind.main
            lines = [
                main @ one.frequencies if len(one.frequencies) == base else one.frequencies for one in found.series
            ]
            return min(float(np.abs(some).max()) for some in lines) * turns > FEW
        slowest = min(float(np.abs(one.frequencies).min()) for one in found.series)
        return bool(found.residuals.max() <= ACCURATE or slowest * turns > PERIODS)

    def _refuse(self, series: Sequence[HarmonicSeries]) -> None:
        """Raise where some are no sums of harmonics."""
        left = np.array([one.residual for one in series])
        worst = left.max(axis=1, initial=0.0)
        self.residual = max(self.residual, float(worst.max(initial=0.0)))
        bad = ~(worst <= QUASI_PERIODIC)
        if not bad.any():
            self._refuse_slow(series)
            return
        # what the method watches besides has residuals, too
        output = self.problem.watching().labels.outputs[int(left.max(axis=0).argmax())].name
        until = float(self.problem.times[0]) + self.longer * self.length
        raise uqmbd.StudyError(
            f"{self.label}: alignment='two-frequency' needs motions that are sums of harmonics of one or two "
            f"frequencies; {bad.sum()} of {len(bad)} realisations that were looked at are not, to t = {until:g} s: "
            f"what is left has {worst.max():.2g} of the root mean square of {output!r}, and {QUASI_PERIODIC:g} is "
            "allowed. The motion is chaotic, dies down, has impacts or more frequencies. Use alignment='phase' where "
            "one angle or oscillation goes on, elements, or leave alignment out."
        )

    def _refuse_slow(self, series: Sequence[HarmonicSeries]) -> None:
        """Raise if a frequency corresponds to the whole time span, as in a decaying motion."""
        seen = self.longer * self.length
        slowest = np.array([float(np.abs(one.frequencies).min(initial=np.inf)) for one in series])
        slow = slowest * seen < 2 * np.pi * SEEN
        if not slow.any():
            return
        raise uqmbd.StudyError(
            f"{self.label}: alignment='two-frequency' needs motions that are sums of harmonics of one or two "
            f"frequencies; {slow.sum()} of {len(slow)} realisations that were looked at have one of which {seen:g} s "
            f"show {slowest.min() * seen / (2 * np.pi):.2g} periods, and {SEEN:g} are needed: such a motion may as "
            "well die down, or grow. Study a longer time; use alignment='phase' where one angle or oscillation goes "
            "on, or leave alignment out."
        )

    def _keep(self, values: Array, series: Sequence[HarmonicSeries]) -> None:
        self._known.update(zip(_keys(values), series, strict=True))

    def _lose(self, values: Array, told: uqmbd.extend.Realisations) -> None:
        """Note which realisations failed, those that are not known."""
        for k, key in enumerate(_keys(values)):
            if key not in self._known:
                self.failures += 1
                status = int(told.status[k]) if told.status[k] != Status.OK else int(Status.NOT_FINITE)
                self._lost[key] = status, told.messages[k] or "an output is not finite"


def _needed(series: Sequence[HarmonicSeries]) -> Mask:
    """Return which harmonics (O, H) matter in some realisation: the smallest that together are little are left out."""
    size = np.max([one.sizes() for one in series], axis=0).T
    order = np.argsort(size, axis=1)
    together = np.sqrt(np.cumsum(np.take_along_axis(size, order, axis=1) ** 2, axis=1) / 2)
    found = np.empty(size.shape, dtype=bool)
    np.put_along_axis(found, order, together > LEFT_OUT, axis=1)
    return found


def _keys(values: Array) -> list[bytes]:
    return [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
