"""Power spectral densities with stated sides and stated frequency units."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.descriptions import describe_function
from uqmbd_processes.paths import ShapingFilter

__all__ = [
    "UNBOUNDED",
    "Per",
    "PowerSpectralDensity",
    "Sided",
    "check_band",
    "check_density",
    "common_units",
    "largest_power",
]

Array = NDArray[np.float64]
Per = Literal["rad/s", "Hz", "rad/m", "cycle/m"]
Sided = Literal["one", "two"]

FACTORS: dict[str, float] = {"rad/s": 1.0, "Hz": 2 * math.pi, "rad/m": 1.0, "cycle/m": 2 * math.pi}
"""Angular frequency of a unit of each frequency."""

UNBOUNDED = (0.0, math.inf)

PROBED = 1025
"""Number of frequencies at which a density is evaluated when it is constructed."""

MOST_PANELS = 4096
"""Largest number of panels of the integral of a density."""


@typechecked(values=False)
@dataclass(frozen=True)
class PowerSpectralDensity:
    """Power spectral density of a stationary random process.

    Parameters
    ----------
    function : callable
        ``function(frequency)`` returns the density for an array of positive frequencies. The variance is the integral
        of a one-sided density over positive frequencies, or of a two-sided density over all frequencies.
    sided : {"one", "two"}
        Sides of the density.
    per : {"rad/s", "Hz", "rad/m", "cycle/m"}
        Unit of the frequency; the density is in the squared units of the process per this unit.
    band : tuple of float
        Lowest and highest frequency, in the unit `per`; the density is zero elsewhere. Default: unbounded.
    units : str
        Units of a process with this density, such as ``"m"``; `RandomProcess` compares its units. Default: unknown.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, or the density is negative or not finite in its band.

    Examples
    --------
    >>> import numpy as np
    >>> swell = PowerSpectralDensity(lambda f: 0.1 * np.exp(-((f - 0.1) / 0.02) ** 2), sided="one", per="Hz")
    >>> round(swell.variance, 6)
    0.003545
    """

    function: Callable[[Array], Array]
    sided: Sided
    per: Per
    band: tuple[float, float] = UNBOUNDED
    filter: ShapingFilter | None = field(default=None, repr=False)
    """Shaping filter with this density, if it is rational."""
    units: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        where = "PowerSpectralDensity"
        if not callable(self.function):
            raise uqmbd.StudyError(f"{where}: function is {self.function!r}; expected a function of the frequency.")
        if self.sided not in ("one", "two"):
            raise uqmbd.StudyError(
                f"{where}: sided is {self.sided!r}; expected 'one' (the integral over positive frequencies is the "
                "variance) or 'two' (the integral over all frequencies is the variance)."
            )
        if self.per not in FACTORS:
            listed = ", ".join(map(repr, FACTORS))
            raise uqmbd.StudyError(f"{where}: per={self.per!r}; expected the unit of the frequency: {listed}.")
        check_band(where, self.band)
        object.__setattr__(self, "band", (float(self.band[0]), float(self.band[1])))
        if self.filter is None:
            try:
                found = np.asarray(self.function(samples := self._samples()), dtype=float)
            except (TypeError, ValueError) as error:
                raise uqmbd.StudyError(
                    f"{where}: function failed for an array of frequencies ({error}); expected a function of NumPy "
                    "arrays, such as one written with numpy.exp."
                ) from None
            if found.shape != samples.shape:
                raise uqmbd.StudyError(
                    f"{where}: function returned an array of shape {found.shape} for frequencies of shape "
                    f"{samples.shape}; expected a density for each frequency."
                )
            self._refuse_impossible(samples, found)
        # make the text once, because the content of the function may change
        object.__setattr__(self, "_text", describe_function(self.function))

    def _samples(self) -> Array:
        low, high = self.band
        low = low if low > 0 else min(1e-2, high / 100)
        high = high if math.isfinite(high) else max(1e2, 100 * low)
        return np.geomspace(low, high, PROBED)

    def _refuse_impossible(self, frequency: Array, density: Array) -> None:
        """Raise StudyError if a density at frequencies in the unit `per` is negative or not finite."""
        wrong = ~(np.isfinite(density) & (density >= 0))
        if wrong.any():
            k = int(np.argmax(wrong))
            raise uqmbd.StudyError(
                f"PowerSpectralDensity: function returned {density.flat[k]:g} for the frequency {frequency.flat[k]:g} "
                f"{self.per}; expected a finite density that is not negative in the band, from {self.band[0]:g} to "
                f"{self.band[1]:g} {self.per}."
            )

    @property
    def over(self) -> str:
        """Argument of the process: ``distance`` or ``time``."""
        return "distance" if self.per in ("rad/m", "cycle/m") else "time"

    @property
    def angular_band(self) -> tuple[float, float]:
        """Band in rad per unit of the argument."""
        factor = FACTORS[self.per]
        return self.band[0] * factor, self.band[1] * factor

    def two_sided(self, frequency: Array) -> Array:
        """Return the two-sided density per rad at positive angular frequencies; zero outside the band.

        Parameters
        ----------
        frequency : array
            Angular frequencies, rad per unit of the argument.

        Returns
        -------
        array
            Densities, of the same shape.

        Examples
        --------
        >>> import numpy as np
        >>> flat = PowerSpectralDensity(np.ones_like, sided="one", per="Hz", band=(1, 2))
        >>> (flat.two_sided(np.array([0.5, 1.5]) * 2 * np.pi) * 4 * np.pi).tolist()
        [0.0, 1.0]
        """
        factor = FACTORS[self.per]
        low, high = self.angular_band
        inside = (frequency >= low * (1 - 1e-12)) & (frequency <= high * (1 + 1e-12))
        given = np.where(inside, frequency, max(low, min(1.0, high))) / factor
        density = np.asarray(self.function(given), dtype=float)
        self._refuse_impossible(given, density)
        found = np.where(inside, density, 0.0)
        return np.asarray(found / factor / (2.0 if self.sided == "one" else 1.0))

    @property
    def variance(self) -> float:
        """Variance of the process in the band; infinite if it has none."""
        if self.filter is not None and self.band == UNBOUNDED:
            return self.filter.variance
        low, high = self.angular_band

        def value(x: Array) -> Array:
            return np.asarray(2 * self.two_sided(np.exp(x)) * np.exp(x))

        ends = (math.log(low) if low > 0 else -40.0, math.log(high) if math.isfinite(high) else 40.0)
        nodes, weights = np.polynomial.legendre.leggauss(16)
        total, panels = math.nan, 32
        while panels <= MOST_PANELS:
            bounds = np.linspace(*ends, panels + 1)
            half = (bounds[1] - bounds[0]) / 2
            before, total = total, float(value(bounds[:-1, None] + half * (nodes + 1)).sum(axis=0) @ weights * half)
            if abs(total - before) <= 1e-9 * total:
                break
            panels *= 2
        edges = [
            float(value(np.array([x]))[0])
            for x, open_end in zip(ends, (low == 0, high == math.inf), strict=True)
            if open_end
        ]
        return math.inf if any(x > 1e-6 * total for x in edges) else total

    def __repr__(self) -> str:
        shape = "" if self.filter is None else f", filter={self.filter!r}"
        named = vars(self)["_text"]
        return f"PowerSpectralDensity({named}, sided={self.sided!r}, per={self.per!r}, band={self.band}{shape})"


def largest_power(density: Callable[[Array], Array], band: tuple[float, float]) -> tuple[float, float]:
    """Return the frequency of the largest power per octave, and its relative half-width; NaN at an end of the band."""

    def power(frequency: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.asarray(np.nan_to_num(frequency * density(frequency)))

    frequency = np.geomspace(max(band[0], 1e-9), min(band[1], 1e9), 721)
    most = int(np.argmax(power(frequency)))
    if not 0 < most < len(frequency) - 1:
        return math.nan, math.nan
    for _ in range(12):  # narrow peaks are between the frequencies
        frequency = np.linspace(frequency[max(most - 1, 0)], frequency[min(most + 1, len(frequency) - 1)], 41)
        most = int(np.argmax(power(frequency)))
    corner = float(frequency[most])
    distance = np.geomspace(1e-9, 0.5, 271)
    half = power(np.array([corner])) / 2
    below = [power(corner * (1 + sign * distance)) < half for sign in (1, -1)]
    narrow = np.flatnonzero(below[0] & below[1])
    return corner, float(distance[narrow[0]]) if len(narrow) else 0.5


def check_density(where: str, psd: Any, over: str) -> None:
    """Raise StudyError unless a density has the frequency of the argument of the process, distance or time."""
    if not isinstance(psd, PowerSpectralDensity):
        raise uqmbd.StudyError(
            f"{where}: psd is {psd!r}; expected PowerSpectralDensity(function, sided=..., per=...), which "
            "states its sides and its frequency, or a spectrum such as iso8608('C', band=(0.01, 10.0))."
        )
    if psd.over != over:
        raise uqmbd.StudyError(
            f"{where}: psd is a density per {psd.per} over {psd.over}, but over={over!r}; state "
            f"over={psd.over!r}, or a density over {over}."
        )


def common_units(where: str, units: str, known: str) -> str:
    """Return the common units of a process and of its density; raise StudyError if they differ."""
    if units and known and not uqmbd.extend.same_units(units, known):
        raise uqmbd.StudyError(
            f"{where}: units is {units!r}, but psd is the density of a process in {known}. Write "
            f"units={known!r}, and multiply the process in expressions by a factor for other units."
        )
    return units or known


def check_band(where: str, band: Any) -> None:
    """Raise StudyError unless a band consists of two increasing numbers."""
    try:
        low, high = (float(x) for x in band)
    except (TypeError, ValueError):
        low = high = math.nan
    if not 0 <= low < high:
        raise uqmbd.StudyError(
            f"{where}: band is {band!r}; expected the lowest and the highest frequency, such as (0.01, 10.0)."
        )
