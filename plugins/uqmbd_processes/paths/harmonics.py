"""Sampled paths of stationary Gaussian processes, as uniform cubic B-splines.

A path is a sum of harmonics at the multiples of ``2 pi / P`` with independent normal amplitudes (Shinozuka & Deodatis
1991). The path is therefore exactly Gaussian, and repeats after the period P. The power of each line is the integral of
the spectral density over its bin, so that the variance is exact. The discrete Fourier transform of the coefficients is
the transform of the knots, divided by the transform of the cubic B-spline, ``(4 + 2 cos(w h)) / 6``.

M. Shinozuka, G. Deodatis, "Simulation of stochastic processes by spectral representation", Applied Mechanics Reviews 44
(1991) 191-204.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd_processes.descriptions import check_family

__all__ = [
    "KNOTS_PER_WAVE",
    "MARGIN",
    "MOST_KNOTS",
    "UNITS",
    "LineSpectrum",
    "SampledProcess",
    "check_interval",
    "draw_splines",
    "highest_frequency",
    "integral_above",
    "line_powers",
    "line_spectrum",
    "normal_numbers",
]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Density = Callable[[Array], Array]

KNOTS_PER_WAVE = 8
"""Knots in the shortest wavelength.

The rms error between knots, relative to the rms value, is then 8e-4 for the shortest wavelength (its second derivative:
2.5e-2), and 9e-6 for a road of ISO 8608 over three decades (second derivative: 1.6e-2). The error is a sum over the
aliases of each frequency; `test_paths` compares it with paths.
"""

MOST_KNOTS = 4_000_000
"""Largest number of knots in a period."""

INSIDE = 0.999
"""Share of the variance below the highest frequency of a spectrum that has no upper end."""

FLATNESS = 16
"""Least ratio of the total power to the power of a single line with the largest density, by default."""

LINES = 16_384
"""Least number of shortest wavelengths in a period by default."""

USABLE = 0.9
"""Largest part of a period that may be requested."""

MARGIN = 9
"""Knots beyond each end of the requested interval."""

BLOCK = 2**22
"""Largest number of complex amplitudes, or of entries of coherence matrices, that are in memory at once."""

SINGULAR = 1e-12
"""Pivot of a coherence matrix that counts as zero."""


UNITS = {"distance": ("m", "cycle/m"), "time": ("s", "Hz")}
"""Units of the argument and of the frequency."""


class SampledProcess(Protocol):
    """Properties of a process that sampling reads."""

    @property
    def family(self) -> str:
        """Name of the process at all points."""

    @property
    def point(self) -> tuple[float, ...]:
        """Coordinates, m; empty if the process has no point."""

    @property
    def over(self) -> Any:
        """Argument, a key of `UNITS`."""

    @property
    def length(self) -> float | None:
        """Period that the user gave."""

    @property
    def cutoff(self) -> float | None:
        """Highest frequency that the user gave, Hz or cycle/m."""

    @property
    def variance(self) -> float:
        """Variance."""

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest angular frequency."""

    @property
    def marks(self) -> tuple[float, ...]:
        """Angular frequencies at peaks of the density and next to them."""

    def two_sided(self, frequency: Array) -> Array:
        """Return the two-sided density."""

    def coherence_with(self, other: Any, frequency: Array) -> Array | float:
        """Return the root coherence at angular frequencies."""


@dataclass(frozen=True)
class LineSpectrum:
    """Lines of sampled paths: the multiples of ``2 pi / period`` whose bins overlap the band."""

    period: float
    """Period P of the paths, m or s."""
    band: tuple[float, float]
    """Lowest and highest angular frequency."""
    lost: float
    """Fraction of the variance outside of the band."""
    knots: int
    """Number of knots in a period, with small prime factors."""

    @property
    def step(self) -> float:
        """Distance of the knots, m or s."""
        return self.period / self.knots

    @property
    def lines(self) -> NDArray[np.int64]:
        """Numbers of the lines; line k has the angular frequency ``2 pi k / period``."""
        low, high = (x * self.period / (2 * math.pi) for x in self.band)
        return np.arange(max(math.floor(low + 0.5), 0), _last_line(high) + 1)


def highest_frequency(process: SampledProcess) -> tuple[float, Array, Array]:
    """Return the highest angular frequency of sampled paths, frequencies in the band, and the power above them."""
    where, units = f"random process {process.family!r}", UNITS[process.over]
    density, cutoff = process.two_sided, process.cutoff
    if not math.isfinite(process.variance):
        raise uqmbd.StudyError(
            f"{where}: the process has no finite variance, like white noise or a road of ISO 8608 without a band, and "
            f"therefore no sampled paths. Give its spectrum a band=, such as (0.01, 10.0) {units[1]}, or use outputs "
            "of the stationary response, such as stationary_std."
        )
    low, end = process.band
    edges = _octaves(low, end, process.marks)
    parts = _integrals(density, edges)
    # sum from the upper end, so that small tails are exact
    above = np.append(np.cumsum(parts[::-1])[::-1], 0.0)
    high = end
    if cutoff is not None:
        high = min(2 * math.pi * cutoff, end)
        if high <= low:
            raise uqmbd.StudyError(
                f"{where}: cutoff is {cutoff:g} {units[1]}, and the band begins at {low / (2 * math.pi):g} {units[1]}; "
                "expected a frequency above this."
            )
    elif end == math.inf:
        high = 2 * math.pi * _rounded_up(_quantile(density, edges, above, 1 - INSIDE) / (2 * math.pi))
    return high, edges, above


def line_spectrum(process: SampledProcess) -> LineSpectrum:
    """Return the period, band and knots of sampled paths."""
    where, units = f"random process {process.family!r}", UNITS[process.over]
    density, length, (low, end) = process.two_sided, process.length, process.band
    high, edges, above = highest_frequency(process)
    # paths with different cutoffs have the same lines if the spectrum has an end
    whole = end if end < math.inf else high
    if length is None:
        # one-sided density per Hz or cycle/m
        peak = 4 * math.pi * _largest(density, edges[edges <= whole], edges[0])
        flat = FLATNESS * peak / (2 * float(above[0]))
        waves = FLATNESS * 2 * math.pi / low if low > 0 else 0.0
        period = _rounded_up(max(flat, waves, LINES * 2 * math.pi / whole))
    else:
        period = float(length)
        if 0 < period * low < 2 * math.pi * (1 - 1e-9):
            raise uqmbd.StudyError(
                f"{where}: length is {period:g} {units[0]}, shorter than the longest wavelength of the band, "
                f"{2 * math.pi / low:g} {units[0]}; expected several times this wavelength."
            )
    from scipy.fft import next_fast_len

    wanted = KNOTS_PER_WAVE * _last_line(high * period / (2 * math.pi))
    if wanted > MOST_KNOTS:
        least, most = MOST_KNOTS * period / wanted, MOST_KNOTS / (KNOTS_PER_WAVE * period)
        raise uqmbd.StudyError(
            f"{where}: sampled paths would have {wanted} knots in their period of {period:g} {units[0]}, with "
            f"harmonics up to {high / (2 * math.pi):g} {units[1]}; at most {MOST_KNOTS} are supported. "
            f"Write a shorter period, such as length={_rounded_down(least):g}, or a lower frequency, "
            f"such as cutoff={_rounded_down(most):g}."
        )
    tail = 0.0 if high >= end else integral_above(density, edges, above, high)
    return LineSpectrum(period, (low, high), tail / float(above[0]), int(next_fast_len(max(wanted, 16), real=True)))


def line_powers(process: SampledProcess, spectrum: LineSpectrum) -> Array:
    """Return the power of each line: the integral of the two-sided density over its bin, at positive frequencies."""
    spacing = 2 * math.pi / spectrum.period
    numbers = spectrum.lines
    low, high = spectrum.band
    bounds = np.clip((np.append(numbers, numbers[-1] + 1) - 0.5) * spacing, low, high)
    # the first bin may begin at zero, where the density may be unbounded
    first = bounds[1] * 2.0 ** np.arange(-40.0, 0.0)
    inside = [x for x in (*process.marks, *first) if bounds[0] < x < bounds[-1]]
    edges = np.unique(np.concatenate([bounds, inside]))
    parts = np.append(_integrals(process.two_sided, edges), 0.0)
    starts = np.searchsorted(edges, bounds[:-1])
    return np.asarray(np.where(np.diff(bounds) > 0, np.add.reduceat(parts, starts), 0.0))


def draw_splines(
    spectrum: LineSpectrum, powers: Array, sources: Sequence[SampledProcess], keys: Array, begin: float, end: float
) -> tuple[float, float, Array]:
    """Return the first knot, the step and the coefficients (K, sources, n) of paths on an interval."""
    where, units = f"random process {sources[0].family!r}", UNITS[sources[0].over][0]
    check_interval(where, begin, end)
    if end - begin > USABLE * spectrum.period:
        raise uqmbd.StudyError(
            f"{where}: a path of {end - begin:g} {units} was requested, but sampled paths repeat after "
            f"{spectrum.period:g} {units}; write length={_rounded_up((end - begin) / USABLE, 2):g}."
        )
    check_family(sources)
    points = sorted({x.point: x for x in sources}.items())
    places = [[p for p, _ in points].index(x.point) for x in sources]
    step = spectrum.step
    start, stop = math.floor(begin / step) - MARGIN, math.ceil(end / step) + MARGIN
    # coefficient c[i] belongs to the knot before knot i
    wanted = np.arange(start - 1, stop + 2) % spectrum.knots
    found = np.empty((len(keys), len(sources), len(wanted)))
    amplitudes = _amplitudes(spectrum, powers)
    numbers = spectrum.lines
    each = max(1, BLOCK // (len(points) * len(numbers)))
    lines = np.zeros(spectrum.knots // 2 + 1, dtype=complex)
    for begins in range(0, len(keys), each):
        block = keys[begins : begins + each]
        normal = [[normal_numbers(x, key, 2 * len(numbers)) for _, x in points] for key in block]
        harmonics = np.array(normal).view(np.complex128)
        if len(points) > 1:
            # the bin of the line at zero ends at half the spacing
            frequency = np.where(numbers == 0, 0.25, numbers) * (2 * math.pi / spectrum.period)
            _correlate(where, harmonics, [x for _, x in points], frequency)
        for k, paths in enumerate(harmonics):
            # one transform at a time: its rounding does not depend on the number of paths
            for place, path in enumerate(paths):
                lines[numbers] = path * amplitudes
                whole = np.fft.irfft(lines, spectrum.knots, norm="forward")[wanted]
                for j in (j for j, x in enumerate(places) if x == place):
                    found[begins + k, j] = whole
    return start * step, step, found


def check_interval(where: str, begin: float, end: float) -> None:
    """Raise StudyError unless the ends of an interval are finite and do not decrease."""
    if not (math.isfinite(begin) and math.isfinite(end) and begin <= end):
        raise uqmbd.StudyError(
            f"{where}: paths from {begin} to {end} were requested; expected finite numbers that do not decrease."
        )


def _amplitudes(spectrum: LineSpectrum, powers: Array) -> Array:
    """Return the factors of complex normal numbers in the transform of the coefficients."""
    numbers = spectrum.lines
    # a line at zero has the powers of both sides, and a real amplitude of the standard deviation 1
    scale = np.where(numbers == 0, 2 * powers, powers / 2)
    return np.asarray(np.sqrt(scale) * 6 / (4 + 2 * np.cos(2 * math.pi * numbers / spectrum.knots)))


def normal_numbers(source: SampledProcess, key: float, count: int, *parts: int) -> Array:
    """Return normal numbers, which depend only on the key, the family, the point and the part of the path."""
    digest = hashlib.sha256(repr((source.family, source.point)).encode()).digest()
    words = np.frombuffer(np.asarray(key, dtype="<f8").tobytes() + digest, dtype="<u4")
    generator = np.random.Generator(np.random.SFC64(np.random.SeedSequence([*words.tolist(), *parts])))
    return np.asarray(generator.standard_normal(count))


def _correlate(where: str, harmonics: Complex, points: list[SampledProcess], frequency: Array) -> None:
    """Replace independent harmonics (K, points, lines) by coherent harmonics: by Cholesky factors at each line.

    The loops over points use products of single numbers. Their rounding does not depend on the number of paths.
    """
    count = len(points)
    each = max(1, BLOCK // count**2)
    for begin in range(0, len(frequency), each):
        part = slice(begin, begin + each)
        factor = _cholesky(where, points, frequency[part])
        for i in reversed(range(count)):
            total = factor[i, i] * harmonics[:, i, part]
            for j in range(i):
                total += factor[i, j] * harmonics[:, j, part]
            harmonics[:, i, part] = total


def _cholesky(where: str, points: list[SampledProcess], frequency: Array) -> Array:
    """Return Cholesky factors (points, points, lines) of coherence matrices, which may be singular."""
    count = len(points)
    factor = np.zeros((count, count, len(frequency)))
    for j in range(count):
        pivot = 1.0 - sum(factor[j, m] ** 2 for m in range(j))
        pivot = np.asarray(np.broadcast_to(pivot, frequency.shape))
        if pivot.min() < -1e-8:
            line = frequency[int(np.argmin(pivot))] / (2 * math.pi)
            raise uqmbd.StudyError(
                f"{where}: the matrix of coherences of {count} points at {line:g} {UNITS[points[j].over][1]} has a "
                "negative eigenvalue, so that no processes have it; give another coherence=."
            )
        regular = pivot > SINGULAR
        factor[j, j] = np.sqrt(np.where(regular, pivot, 0.0))
        divisor = np.where(regular, factor[j, j], 1.0)
        for i in range(j + 1, count):
            value = points[j].coherence_with(points[i], frequency)
            if not np.isfinite(value).all():
                line = frequency[int(np.argmin(np.isfinite(value)))] / (2 * math.pi)
                raise uqmbd.StudyError(
                    f"{where}: coherence at the frequency {line:g} {UNITS[points[j].over][1]} is not finite; expected "
                    "numbers between 0 and 1."
                )
            rest = value - sum(factor[i, m] * factor[j, m] for m in range(j))
            factor[i, j] = np.where(regular, rest / divisor, 0.0)
    return factor


def _octaves(low: float, high: float, marks: Sequence[float]) -> Array:
    """Return increasing frequencies through a band, equally spaced on a logarithmic scale, and the marks."""
    ends = (math.log(low) if low > 0 else -40.0, math.log(high) if math.isfinite(high) else 40.0)
    edges = np.exp(np.linspace(*ends, 2049))
    edges[0], edges[-1] = (low if low > 0 else edges[0]), (high if math.isfinite(high) else edges[-1])
    return np.unique(np.concatenate([edges, [x for x in marks if edges[0] < x < edges[-1]]]))


def _integrals(density: Density, edges: Array) -> Array:
    """Return the integrals of a density between edges, by Gauss panels that are halved where two results differ."""
    nodes, weights = np.polynomial.legendre.leggauss(4)

    def integrate(chosen: NDArray[np.int64], panels: int) -> Array:
        widths = np.diff(edges)[chosen] / panels
        begins = edges[chosen, None] + widths[:, None] * np.arange(panels)
        places = begins[..., None] + widths[:, None, None] * (nodes + 1) / 2
        with np.errstate(all="ignore"):
            values = np.nan_to_num(density(places.ravel()), posinf=0.0).reshape(places.shape)
        return np.asarray((values @ weights).sum(axis=1) * widths / 2)

    left = np.arange(len(edges) - 1)
    found = integrate(left, 1)
    panels = 2
    while len(left) and panels <= 2048:
        before, found[left] = found[left], integrate(left, panels)
        change = np.abs(found[left] - before)
        left = left[(change > 1e-8 * found[left]) & (change > 1e-11 * found.sum())]
        panels *= 2
    return found


def integral_above(density: Density, edges: Array, above: Array, frequency: float) -> float:
    """Return the integral of a density above a frequency."""
    after = int(np.searchsorted(edges, frequency))
    if after >= len(edges):
        return 0.0
    return float(above[after] + _integrals(density, np.array([frequency, edges[after]]))[0])


def _quantile(density: Density, edges: Array, above: Array, share: float) -> float:
    """Return the frequency above which a share of the power is."""
    from scipy.optimize import brentq

    target = share * float(above[0])
    bin_ = int(np.flatnonzero(above >= target)[-1])
    bounds = edges[bin_], edges[min(bin_ + 1, len(edges) - 1)]
    return float(brentq(lambda x: integral_above(density, edges, above, x) - target, *bounds, rtol=1e-9))


def _largest(density: Density, edges: Array, low: float) -> float:
    """Return the largest density at frequencies and between them."""
    frequency = edges if len(edges) > 2 else np.linspace(low, edges[-1], 3)
    with np.errstate(all="ignore"):
        for _ in range(8):
            values = np.nan_to_num(density(frequency), posinf=0.0)
            most = int(np.argmax(values))
            frequency = np.linspace(frequency[max(most - 1, 0)], frequency[min(most + 1, len(frequency) - 1)], 41)
    return float(values[most])


def _last_line(high: float) -> int:
    """Return the number of the last line whose bin begins below a frequency, in multiples of the spacing."""
    return max(math.ceil(high - 0.5 - 1e-9), 1)


def _rounded_up(value: float, digits: int = 3) -> float:
    """Return a number rounded up to a few digits, so that it does not depend on rounding errors."""
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / unit - 1e-6) * unit:.{digits}g}")


def _rounded_down(value: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit) * unit:.2g}")
