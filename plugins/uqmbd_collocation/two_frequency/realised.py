"""Realisations as quasi-periodic series: a problem whose outputs are frequencies and amplitudes.

Every rule, fit and refinement accepts this problem like the original problem.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
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
"""Largest ratio of integration time to output time."""

SEEN = 1.5
"""Least number of periods of each frequency in the integration time."""

PERIODS = 30.0
"""Number of periods of the lowest frequency at which all harmonics are separated. If there are fewer periods and a
residual remains, realisations are integrated for longer."""

FEW = 10.0
"""Number of periods of the highest main frequency after which a motion is rejected as not quasi-periodic."""

ACCURATE = 1e-4
"""Residual, relative to the scale of an output, up to which a series is always accepted."""

UNSEEN = 1e-13
"""Largest share of the energy of a motion above the frequencies that a thinned signal can represent."""

LEFT_OUT = 1e-5
"""Largest root mean square of the sum of the omitted harmonics of an output, relative to the scale of the output."""

ROUNDING = 1e4
"""Smallest scale of an output, relative to its largest value times the tolerance, because integration errors add up."""


NOTHING = "alignment='two-frequency' needs oscillating motions, but no output oscillates. Use alignment=None."


@dataclass(frozen=True, eq=False)
class HarmonicSums:
    """Coefficients of frequencies, constants, drifts and harmonics, from the columns of a `SeriesProblem`."""

    frequencies: Array  # (P, M)
    constants: Array
    drifts: Array  # (P, O), like `constants`
    waves: NDArray[np.complex128]  # (P, O, H) a - i b for a cos + b sin


@dataclass
class SeriesProblem(DerivedSource):
    """Problem with outputs: base frequencies, then constant, drift, cosines and sines of each output of the study."""

    problem: uqmbd.extend.Problem
    kind: FrequencyCombinations | None = None  # combinations of all realisations; set by `find`
    scales: Array = field(default_factory=lambda: np.zeros(0))
    """Scales (O,) of residuals: root mean squares of the motion."""
    kept: Mask = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    """Mask (O, H) of the harmonics of each output."""
    longer: float = 1.0  # ratio of the integration time to the output time
    spent: int = 0  # number of realisations so far
    failures: int = 0  # number of failed realisations
    residual: float = 0.0  # largest residual so far, relative to the scale of the output
    counters: Counter[str] = field(default_factory=Counter)
    computed_before: Callable[[Array], uqmbd.extend.Dense | None] = lambda _: None
    """Function that returns realisations of other families at inputs (K, d)."""
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
        """Labels of outputs, with the frequencies as the first output; columns have numbers instead of times."""
        inner = self.problem.labels
        columns = np.arange(float(2 + 2 * len(self.lattice)))
        return replace(inner, outputs=(OutputInfo("frequencies", "rad/s"), *inner.outputs), times=columns)

    @property
    def lattice(self) -> Index:
        """Multiples (H, M) of the base frequencies in the harmonics of the outputs."""
        found: Index = self._kind.lattice[self.kept.any(axis=0)]
        return found

    @property
    def _kind(self) -> FrequencyCombinations:
        if self.kind is None:
            raise uqmbd.StudyError(f"{self.label}: the frequencies were not identified.")
        return self.kind

    def find(self, values: Array) -> None:
        """Find the frequencies and harmonics of realisations at inputs (K, d).

        Raise StudyError if some motions are not sums of harmonics of two frequencies, and IntegrationError if all fail.
        """
        spread = values.std(axis=0)
        self._spread = np.where(spread > 0, spread, 1.0)
        best: tuple[Identified | None, NDArray[np.intp], float, int] | None = None
        while True:
            found, realised, good = self._integrated(values)
            self.scales = self._scales(found.values[good])
            signals = [self._signals(found, k) for k in good]
            identified = identify(signals, values[good] / self._spread)
            if best is None or (identified and best[0] and identified.residuals.max() < best[0].residuals.max()):
                best = identified, good, self.longer, len(found.times)
            if identified is None or self._is_long_enough(identified) or 2 * self.longer > LONGEST:
                break
            self.longer *= 2
        identified, good, self.longer, self._count = best
        if identified is None:
            raise uqmbd.StudyError(f"{self.label}: {NOTHING}")
        self._require_series(identified.series)
        self.kind, self.kept = identified.kind, _retained_harmonics(identified.series)
        self._store_series(values[good], identified.series)
        self._store_failures(values, realised)

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Return realisations as series, with the response (K, 1 + O, 2 + 2 H).

        Raise StudyError if some motions are not sums of these harmonics.
        """
        keys = _keys(values)
        missing = list(dict.fromkeys(k for k in keys if k not in self._known and k not in self._lost))
        if missing:
            rows = values[[keys.index(key) for key in missing]]
            found, realised, good = self._integrated(rows, known=bool(self._count))
            signals = [self._signals(found, k) for k in good]
            places = np.array([np.frombuffer(key) for key in self._known]) / self._spread
            series = follow(signals, rows[good] / self._spread, self._kind, list(self._known.values()), places)
            self._require_series(series)
            self._store_series(rows[good], series)
            self._store_failures(rows, realised)
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
                # multiply a drift by the length, so that it has the size of the other columns
                response[k, 1:, 1] = amplitudes[:, 1] * self.length
                response[k, 1:, 2:] = np.where(waves, amplitudes[:, 2:][:, np.tile(used, 2)], 0.0)
        status = np.array([self._lost.get(key, (int(Status.OK), ""))[0] for key in keys])
        messages = tuple(self._lost.get(key, (0, ""))[1] for key in keys)
        return uqmbd.extend.Realisations(values, response, status, messages, {}, 0.0)

    def split(self, coefficients: Array) -> HarmonicSums:
        """Return sums of harmonics from coefficients (P, 1 + O, 2 + 2 H) of the columns."""
        base, half = self.lattice.shape[1], len(self.lattice)
        outputs = coefficients[:, 1:]
        return HarmonicSums(
            coefficients[:, 0, :base],
            outputs[:, :, 0],
            outputs[:, :, 1] / self.length,
            outputs[:, :, 2 : 2 + half] - 1j * outputs[:, :, 2 + half :],
        )

    def _integrated(
        self, values: Array, known: bool = False
    ) -> tuple[uqmbd.extend.Dense, uqmbd.extend.Realisations, NDArray[np.intp]]:
        """Compute realisations over their times; return also the rows of the successful ones."""
        begin = float(self.problem.times[0])
        before = None if known or self.longer > 1.0 else self.computed_before(values)
        if before is not None:
            self.longer = float(before.times[-1] - begin) / self.length
            status = np.full(len(values), int(Status.OK))
            found = before
            realised = uqmbd.extend.Realisations(values, found.values, status, ("",) * len(values), {}, 0.0)
        else:
            end = begin + self.longer * self.length
            found, realised = uqmbd.extend.dense(self.problem, values, end, self._count if known else 0)
            self.spent += len(values)
            self.counters.update(realised.counters)
        finite = np.isfinite(found.values).all(axis=(1, 2))
        good = np.flatnonzero(realised.good & finite)
        if not len(good):
            reason = next((message for message in realised.messages if message), "an output is not finite")
            raise uqmbd.IntegrationError(f"{self.label}: all {len(values)} realisations failed: {reason}")
        return found, realised, good

    def _signals(self, found: uqmbd.extend.Dense, k: int) -> Signals:
        return Signals(found.times - found.times[0], found.values[k].T / self.scales).thinned(UNSEEN)

    def _scales(self, values: Array) -> Array:
        """Return root mean squares (O,) of outputs (K, O, T) without constant and drift, largest over realisations."""
        times = np.linspace(0.0, 1.0, values.shape[2])
        plain = [fit_series(Signals(times, one.T), np.zeros(0), np.zeros((0, 0), dtype=np.int64)) for one in values]
        moving = np.max([one.residual for one in plain], axis=0)
        least = ROUNDING * self.rtol * np.abs(values).max(axis=(0, 2))
        if not (moving > least).any():
            raise uqmbd.StudyError(f"{self.label}: {NOTHING}")
        scales = np.maximum(moving, least)
        return np.asarray(np.where(scales > 0, scales, 1.0))

    def _is_long_enough(self, found: Identified) -> bool:
        """Return whether longer realisations would add no information."""
        turns = self.longer * self.length / (2 * np.pi)
        if found.bad.any():
            # some of the series have a separate base, which may have fewer frequencies
            base, main = len(found.kind.main.T), found.kind.main
            lines = [
                main @ one.frequencies if len(one.frequencies) == base else one.frequencies for one in found.series
            ]
            return min(float(np.abs(some).max()) for some in lines) * turns > FEW
        slowest = min(float(np.abs(one.frequencies).min()) for one in found.series)
        return bool(found.residuals.max() <= ACCURATE or slowest * turns > PERIODS)

    def _require_series(self, series: Sequence[HarmonicSeries]) -> None:
        """Raise StudyError if some realisations are not sums of harmonics."""
        left = np.array([one.residual for one in series])
        worst = left.max(axis=1, initial=0.0)
        self.residual = max(self.residual, float(worst.max(initial=0.0)))
        bad = ~(worst <= QUASI_PERIODIC)
        if not bad.any():
            self._refuse_slow(series)
            return
        # residuals include the additional observed quantities
        output = self.problem.watching().labels.outputs[int(left.max(axis=0).argmax())].name
        until = float(self.problem.times[0]) + self.longer * self.length
        raise uqmbd.StudyError(
            f"{self.label}: alignment='two-frequency' needs motions that are sums of harmonics of one or two "
            f"frequencies; {bad.sum()} of {len(bad)} examined realisations are not, up to t = {until:g} s. The "
            f"residual is {worst.max():.2g} of the root mean square of {output!r}; {QUASI_PERIODIC:g} is allowed. "
            "The motion is chaotic, decays, has impacts or more frequencies. Use alignment='phase' if one angle or "
            "oscillation persists, use elements, or use alignment=None."
        )

    def _refuse_slow(self, series: Sequence[HarmonicSeries]) -> None:
        """Raise StudyError if a period is about as long as the time span, as in a decaying motion."""
        seen = self.longer * self.length
        slowest = np.array([float(np.abs(one.frequencies).min(initial=np.inf)) for one in series])
        slow = slowest * seen < 2 * np.pi * SEEN
        if not slow.any():
            return
        raise uqmbd.StudyError(
            f"{self.label}: alignment='two-frequency' needs motions that are sums of harmonics of one or two "
            f"frequencies; in {slow.sum()} of {len(slow)} examined realisations, {seen:g} s contain only "
            f"{slowest.min() * seen / (2 * np.pi):.2g} periods of the slowest harmonic; {SEEN:g} are required. A "
            "motion that decays or grows causes the same error. Study a longer time, use alignment='phase' if one "
            "angle or oscillation persists, or use alignment=None."
        )

    def _store_series(self, values: Array, series: Sequence[HarmonicSeries]) -> None:
        self._known.update(zip(_keys(values), series, strict=True))

    def _store_failures(self, values: Array, realised: uqmbd.extend.Realisations) -> None:
        """Record realisations without a series as failed."""
        for k, key in enumerate(_keys(values)):
            if key not in self._known:
                self.failures += 1
                status = int(realised.status[k]) if realised.status[k] != Status.OK else int(Status.NOT_FINITE)
                self._lost[key] = status, realised.messages[k] or "an output is not finite"


def _retained_harmonics(series: Sequence[HarmonicSeries]) -> Mask:
    """Return a mask (O, H) of the harmonics to keep; the smallest harmonics are omitted while their sum is small."""
    size = np.max([one.sizes() for one in series], axis=0).T
    order = np.argsort(size, axis=1)
    together = np.sqrt(np.cumsum(np.take_along_axis(size, order, axis=1) ** 2, axis=1) / 2)
    found = np.empty(size.shape, dtype=bool)
    np.put_along_axis(found, order, together > LEFT_OUT, axis=1)
    return found


def _keys(values: Array) -> list[bytes]:
    return [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
