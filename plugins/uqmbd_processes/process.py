"""Stationary random processes over time or distance, for expressions of mechanisms.

Length: one class, whose docstring has a paragraph for each option.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.densities import PowerSpectralDensity, check_density, common_units, largest_power
from uqmbd_processes.descriptions import (
    check_description,
    check_paths,
    check_point,
    check_units_and_mean,
    describe_function,
    describe_options,
    refuse_arithmetic,
)
from uqmbd_processes.estimates import covariance_density, welch_density, welch_error
from uqmbd_processes.paths import (
    ExponentialCovariance,
    FilterPaths,
    KarhunenLoevePaths,
    LineSpectrum,
    ShapingFilter,
    check_positive,
    draw_splines,
    line_powers,
    line_spectrum,
    shaping_filter,
)

__all__ = ["RandomProcess"]

Array = NDArray[np.float64]

CACHED = ("_peak", "description", "marks", "_lines", "_line_powers")  # computed when they are needed


@typechecked(values=False)
@dataclass(frozen=True, repr=False)
class RandomProcess:
    """Stationary random process of the time or of a distance: a road, a gust, the motion of the ground.

    One of four arguments describes the process: `psd`, `covariance`, `filter` or `record`. A call with a linear
    function of time returns an expression for forces, drivers and roads: ``road(20 * uqmbd.t)``. Calls of one process
    with different offsets give one path with a delay, as for two wheels on one track. Different processes are
    independent. Outputs such as `stationary_std` read the response to all processes.

    Parameters
    ----------
    name : str
        Name of the process in messages, unique in a mechanism.
    psd : PowerSpectralDensity, optional
        Power spectral density, for example ``iso8608("C", band=(0.01, 10.0))``.
    covariance : callable, optional
        Covariance as a function of the lag, m or s, for example ``exponential_covariance(0.01, 5.0)``. Other functions
        must take arrays of positive lags and decay to zero.
    filter : tuple of three arrays, optional
        Shaping filter ``(A, B, C)``: ``w = C s``, ``ds/dx = A s + B n`` with white noise ``n`` of unit intensity.
    record : tuple, optional
        ``(step, values)``: samples at a constant step, m or s. Welch's method estimates the density.
    over : {"distance", "time"}
        Argument of the process; `uqmbd.laws.distance` and `uqmbd.t` are accepted, too.
    units : str
        Units of the process; by default the units of `psd`. Named spectra have units.
    mean : float
        Mean of the process, in its units.
    coherence : callable, optional
        Root coherence of the process at two points, ``coherence(frequency, separation)`` with an array of frequencies,
        Hz or cycle/m, and the separation of the points, m; for example ``davenport_coherence(decay, speed)``. `at`
        returns the process at a point.
    point : tuple of float
        Point of the process, m, set by `at`.
    field : str
        Name of the process at all points, set by `at`.
    length : float, optional
        Period P after which sampled paths repeat, m or s. Default: the longest of 16,384 shortest wavelengths, 16
        longest wavelengths of the band, and ``16 G / variance``. G is the largest one-sided density per cycle/m or Hz.
        For an exponential covariance, ``16 G / variance`` is 64 correlation lengths. The upper end of the band
        determines the shortest wavelength; if there is none, `cutoff` does. For ``paths="karhunen_loeve"``, `length` is
        required: the length of the interval of the expansion.
    paths : {"harmonics", "filter", "karhunen_loeve"}
        ``harmonics``: sampled paths are sums of harmonics. ``filter``: sampled paths are the exact discretisation of
        the shaping filter at knots at a distance of ``1 / (8 cutoff)``; they have the exact covariance at the knots and
        do not repeat. ``karhunen_loeve``: sampled paths are expansions of Karhunen and Loeve with ``2 length cutoff``
        terms, at most 512, for arguments between 0 and `length`. A process with a coherence accepts only ``harmonics``.
    cutoff : float, optional
        Highest frequency of sampled paths, cycle/m or Hz, at most the end of the band. Paths with equal `length` and
        different cutoffs are correlated; paths of filters with different cutoffs are independent. Default: the end of
        the band; for a spectrum without an end, the frequency below which the spectrum has 99.9 % of its variance.

    Raises
    ------
    uqmbd.StudyError
        If not exactly one description is given, the units differ from those of `psd`, or an argument is invalid.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import exponential_covariance
    >>> road = RandomProcess("road", covariance=exponential_covariance(0.01, 5.0), over="distance", units="m")
    >>> road(20 * uqmbd.t), round(road.variance, 12)
    (road(20*t), 0.0001)
    """

    name: str
    psd: PowerSpectralDensity | None = None
    covariance: Callable[[Array], Array] | None = None
    filter: ShapingFilter | tuple[Any, Any, Any] | None = None
    record: tuple[float, Any] | None = None
    over: Literal["distance", "time"] | sympy.Symbol = "time"
    units: str = ""
    mean: float = 0.0
    coherence: Callable[[Array, float], Array] | None = None
    point: tuple[float, ...] = ()
    field: str = ""
    length: float | None = None
    cutoff: float | None = None
    paths: Literal["harmonics", "filter", "karhunen_loeve"] = "harmonics"

    def __post_init__(self) -> None:
        where, over = check_description(self)
        object.__setattr__(self, "over", over)
        check_units_and_mean(where, self)
        object.__setattr__(self, "mean", float(self.mean))
        for key in ("length", "cutoff"):
            if getattr(self, key) is not None:
                check_positive(where, **{key: getattr(self, key)})
                object.__setattr__(self, key, float(getattr(self, key)))
        density: PowerSpectralDensity | None = None
        shape: ShapingFilter | None = None
        if self.psd is not None:
            check_density(where, self.psd, over)
            object.__setattr__(self, "units", common_units(where, self.units, self.psd.units))
            density, shape = self.psd, self.psd.filter
        elif isinstance(self.covariance, ExponentialCovariance):
            shape = self.covariance.filter
        elif self.covariance is not None:
            density = covariance_density(where, self.covariance, over)
        elif self.filter is not None:
            shape = self.filter if isinstance(self.filter, ShapingFilter) else shaping_filter(where, self.filter)
            object.__setattr__(self, "filter", shape)
        else:
            density, record = welch_density(where, self.record, over)
            object.__setattr__(self, "record", record)
        object.__setattr__(self, "_texts", tuple(map(describe_function, (self.covariance, self.coherence))))
        object.__setattr__(self, "_density", density)
        object.__setattr__(self, "_shape", shape)
        check_paths(where, self)
        object.__setattr__(self, "_key", uqmbd.extend.path_key(self.family))

    @property
    def shape(self) -> ShapingFilter | None:
        """Shaping filter of a rational spectrum; None for other spectra."""
        found: ShapingFilter | None = vars(self)["_shape"]
        return found

    @property
    def density(self) -> PowerSpectralDensity | None:
        """Power spectral density; None if only a shaping filter describes the process."""
        found: PowerSpectralDensity | None = vars(self)["_density"]
        return found

    @property
    def variance(self) -> float:
        """Variance of the process, in squared units; infinite if it has none."""
        if self.density is not None:
            return self.density.variance
        return math.inf if self.shape is None else self.shape.variance

    @property
    def density_error(self) -> float:
        """Relative standard error of each value of a density that is estimated from a record; otherwise zero.

        The error is that of Welch's method with Hann's window and segments that overlap by half (Welch 1967).
        """
        return 0.0 if self.record is None else welch_error(len(self.record[1]))

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest angular frequency, rad per unit of the argument."""
        return (0.0, math.inf) if self.density is None else self.density.angular_band

    @property
    def corner(self) -> float:
        """Angular frequency at which the process has most of its power per octave; NaN at an end of its band."""
        return self._peak[0]

    @property
    def corner_width(self) -> float:
        """Half width at half of the power per octave, relative to the corner; at most 1/2."""
        return self._peak[1]

    @cached_property
    def _peak(self) -> tuple[float, float]:
        return largest_power(self.two_sided, self.band)

    def two_sided(self, frequency: Array) -> Array:
        """Return the two-sided spectral density per rad at positive angular frequencies.

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
        >>> noise = RandomProcess("noise", filter=([[-2.0]], [1.0], [1.0]), over="time")
        >>> round(float(noise.two_sided(np.array([0.0]))[0] * 2 * np.pi), 12)
        0.25
        """
        if self.density is not None:
            return self.density.two_sided(frequency)
        assert self.shape is not None
        return self.shape.two_sided(frequency)

    @property
    def family(self) -> str:
        """Name of the process, or of the process at all points of a coherent field."""
        return self.field or self.name

    @property
    def sampled_period(self) -> float:
        """Period after which sampled paths repeat, m or s; infinite for paths that are not sums of harmonics."""
        return self._lines.period

    @property
    def key(self) -> uqmbd.RandomVariable:
        """Input of mechanisms with outputs over time, which chooses the sampled path of a realisation."""
        return cast("uqmbd.RandomVariable", vars(self)["_key"])

    @property
    def sampled_band(self) -> tuple[float, float]:
        """Lowest and highest angular frequency of sampled paths, rad per unit of the argument."""
        return self._lines.band

    @property
    def expansion_terms(self) -> int | None:
        """Number of terms of an expansion of Karhunen and Loeve; None for other paths."""
        return self._lines.terms if isinstance(self._lines, KarhunenLoevePaths) else None

    @property
    def lost_variance(self) -> float:
        """Fraction of the variance that sampled paths lack: above their highest frequency, or in omitted terms."""
        return self._lines.lost

    @property
    def changed_density(self) -> Callable[[float, Array], Array] | None:
        """Function of a cutoff factor and of frequencies: how much paths change the density; None for harmonics."""
        return None if isinstance(self._lines, LineSpectrum) else self._lines.changed

    @cached_property
    def marks(self) -> tuple[float, ...]:
        """Angular frequencies at peaks of the density, and next to them."""
        peaks = [] if math.isnan(self.corner) else [(self.corner, self.corner * self.corner_width)]
        peaks += [] if self.shape is None else self.shape.resonances
        return tuple(float(x + y * i) for x, y in peaks for i in range(-4, 5) if x + y * i > 0)

    @cached_property
    def _lines(self) -> LineSpectrum | FilterPaths | KarhunenLoevePaths:
        if self.paths == "karhunen_loeve":
            known = self.covariance if isinstance(self.covariance, ExponentialCovariance) else None
            return KarhunenLoevePaths(self, known)
        return line_spectrum(self) if self.paths == "harmonics" or self.shape is None else FilterPaths(self, self.shape)

    @cached_property
    def _line_powers(self) -> Array:
        assert isinstance(self._lines, LineSpectrum)
        return line_powers(self, self._lines)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields without cached values."""
        return {key: value for key, value in vars(self).items() if key not in CACHED}

    def sample_paths(
        self, sources: Sequence[RandomProcess], keys: Array, begin: float, end: float
    ) -> tuple[float, float, Array]:
        """Return sampled paths without the mean, as uniform cubic B-splines.

        Parameters
        ----------
        sources : sequence of RandomProcess
            The process, or the process at points of a coherent field.
        keys : array
            A number for each of K realisations, which determines its path on the whole axis.
        begin, end : float
            Interval of the argument, m or s.

        Returns
        -------
        first : float
            Argument at the first knot, m or s.
        step : float
            Distance of the knots, m or s.
        coefficients : array
            Coefficients ``c`` (K, sources, n). The value at the knot ``first + i step`` is
            ``(c[i] + 4 c[i + 1] + c[i + 2]) / 6``. There are at least 8 knots beyond both ends.

        Raises
        ------
        uqmbd.StudyError
            If the process has no variance, or the interval is longer than 0.9 periods or outside of an expansion.
            The method also raises this error if a period, or a path of a filter from zero, has more than 4,000,000
            knots. Further reasons are contradictory coherences of the points, and sources that differ in more than
            their points.

        Notes
        -----
        Processes of one name in different mechanisms have the same random numbers, which reduces the sampling error of
        comparisons. With another `cutoff` and the same period, all common harmonics are equal; paths of filters are
        then independent. The default period of a spectrum without an upper end depends on `cutoff`: give `length`.
        Paths at several points are correlated in the order of the coordinates.

        Examples
        --------
        >>> import numpy as np
        >>> from uqmbd_processes import iso8608
        >>> road = RandomProcess("road", psd=iso8608("C", band=(0.01, 10.0)), over="distance")
        >>> first, step, c = road.sample_paths([road], np.array([0.3, 0.7]), 0.0, 50.0)
        >>> heights = (c[..., :-2] + 4 * c[..., 1:-1] + c[..., 2:]) / 6
        >>> c.shape, round(step, 4)
        ((2, 1, 4022), 0.0125)
        """
        keys = np.asarray(keys, dtype=float)
        if isinstance(self._lines, LineSpectrum):
            return draw_splines(self._lines, self._line_powers, sources, keys, begin, end)
        return self._lines.draw(sources, keys, begin, end)

    def at(self, *point: float) -> RandomProcess:
        """Return the process at a point, which is coherent with the process at other points.

        Parameters
        ----------
        *point : float
            Coordinates of the point, m, as many at all points.

        Returns
        -------
        RandomProcess
            The process at the point.

        Raises
        ------
        uqmbd.StudyError
            If the process has no coherence, or a coordinate is not finite.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_processes import RandomProcess, davenport_coherence, kaimal
        >>> gust, coherence = kaimal(1.5, 340.2, 12.0), davenport_coherence(10, 12)
        >>> wind = RandomProcess("wind", psd=gust, units="m/s", coherence=coherence)
        >>> wind.at(0, 20)(), wind.at(0, 30)()
        (wind at 0, 20(t), wind at 0, 30(t))
        """
        check_point(self, point)
        text = ", ".join(f"{x:g}" for x in point)
        where_at = tuple(float(x) for x in point)
        return replace(self, name=f"{self.name} at {text}", point=where_at, field=self.name)

    def coherence_with(self, other: RandomProcess, frequency: Array) -> Array | float:
        """Return the root coherence with the process at another point, at angular frequencies.

        Parameters
        ----------
        other : RandomProcess
            The process at another point.
        frequency : array
            Angular frequencies, rad per unit of the argument.

        Returns
        -------
        array
            Values between 0 and 1; 1 at the same point.

        Raises
        ------
        uqmbd.StudyError
            If the points have different numbers of coordinates.

        Examples
        --------
        >>> import numpy as np
        >>> from uqmbd_processes import RandomProcess, davenport_coherence, kaimal
        >>> gust, coherence = kaimal(1.5, 340.2, 12.0), davenport_coherence(10, 12)
        >>> wind = RandomProcess("wind", psd=gust, units="m/s", coherence=coherence)
        >>> value = wind.at(0, 20).coherence_with(wind.at(0, 26), 2 * np.pi * np.array([0.2]))
        >>> bool(np.isclose(value[0], np.exp(-10 * 0.2 * 6 / 12)))
        True
        """
        if self.point == other.point or self.coherence is None:
            return 1.0
        if len(self.point) != len(other.point):
            raise uqmbd.StudyError(
                f"random process {self.family!r}: the points {self.point} and {other.point} have different numbers of "
                "coordinates; expected equal numbers."
            )
        found = np.asarray(self.coherence(frequency / (2 * math.pi), math.dist(self.point, other.point)), dtype=float)
        return np.asarray(np.clip(found, 0.0, 1.0))

    def __call__(self, argument: Any = None) -> sympy.Expr:
        """Return the process at a linear function of time, for expressions of a mechanism."""
        if argument is None and self.over == "distance":
            raise uqmbd.StudyError(
                f"random process {self.name!r}: it is a function of the distance; call it with the distance over time, "
                f"such as {self.name}(20 * uqmbd.t) at 20 m/s."
            )
        value = uqmbd.extend.excitation(self, uqmbd.t if argument is None else argument)
        return value + sympy.Float(self.mean) if self.mean else value

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = refuse_arithmetic
    __pow__ = __neg__ = refuse_arithmetic

    @cached_property
    def description(self) -> dict[str, str]:
        """All options but the name and the point, as texts; equal at all points of a process."""
        return describe_options(self)

    def __repr__(self) -> str:
        point = {"point": self.point} if self.coherence is not None else {}
        listed = ", ".join(f"{key}={text}" for key, text in (self.description | point).items())
        return f"RandomProcess({self.name!r}, {listed})"
