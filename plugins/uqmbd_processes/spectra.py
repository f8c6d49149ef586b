"""Spectral densities of roads, wind and ground motion from standards and the literature, and white noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.densities import UNBOUNDED, Per, PowerSpectralDensity, Sided, check_band
from uqmbd_processes.paths import ShapingFilter, check_positive

__all__ = ["davenport_coherence", "iso8608", "kaimal", "kanai_tajimi", "von_karman", "white_noise"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Power:
    """Power law ``value (f / reference) ** exponent``."""

    value: float
    reference: float
    exponent: float

    def __call__(self, frequency: Array) -> Array:
        return np.asarray(self.value * (frequency / self.reference) ** self.exponent)


@dataclass(frozen=True)
class _Kaimal:
    variance: float
    ratio: float

    def __call__(self, frequency: Array) -> Array:
        return np.asarray(self.variance * 4 * self.ratio / (1 + 6 * frequency * self.ratio) ** (5 / 3))


@dataclass(frozen=True)
class _VonKarman:
    variance: float
    ratio: float

    def __call__(self, frequency: Array) -> Array:
        return np.asarray(self.variance * 4 * self.ratio / (1 + 70.8 * (frequency * self.ratio) ** 2) ** (5 / 6))


@dataclass(frozen=True)
class _KanaiTajimi:
    density: float
    frequency: float
    damping: float

    def __call__(self, frequency: Array) -> Array:
        r = (frequency / self.frequency) ** 2
        return np.asarray(self.density * (1 + 4 * self.damping**2 * r) / ((1 - r) ** 2 + 4 * self.damping**2 * r))


@typechecked(values=False)
def iso8608(road_class: str, band: tuple[float, float] = UNBOUNDED) -> PowerSpectralDensity:
    """Return the displacement spectrum of a road class, ``G(n) = G(n0) (n / n0)^-2`` with ``n0 = 0.1 cycle/m``.

    The one-sided density per cycle/m at ``n0`` is the geometric mean of the class: 16e-6 m^3 for class A, and four
    times as much for each further class up to H.

    Parameters
    ----------
    road_class : str
        Class of the road, from ``"A"`` to ``"H"``.
    band : tuple of float
        Lowest and highest spatial frequency, cycle/m. ISO 8608 reports the band from 0.01 to 10 cycle/m. Default:
        unbounded; the displacement then has no variance.

    Returns
    -------
    PowerSpectralDensity
        One-sided density per cycle/m, m^3.

    Raises
    ------
    uqmbd.StudyError
        If the class or the band is invalid.

    Notes
    -----
    The classes and their geometric means are from ISO 8608 [1]_, annex C, table C.1.

    References
    ----------
    .. [1] ISO 8608:2016, "Mechanical vibration - Road surface profiles - Reporting of measured data".

    Examples
    --------
    >>> import numpy as np
    >>> road = iso8608("C", band=(0.01, 10.0))
    >>> round(float(road.function(np.array([0.1]))[0]) * 1e6, 9), road.sided, road.per
    (256.0, 'one', 'cycle/m')
    """
    if not isinstance(road_class, str) or len(road_class) != 1 or road_class not in "ABCDEFGH":
        raise uqmbd.StudyError(f"iso8608: the class is {road_class!r}; expected a letter from 'A' to 'H'.")
    check_band("iso8608", band)
    value = 16e-6 * 4.0 ** "ABCDEFGH".index(road_class)
    return PowerSpectralDensity(_Power(value, 0.1, -2.0), "one", "cycle/m", band, units="m")


@typechecked(values=False)
def kaimal(deviation: float, length: float, speed: float) -> PowerSpectralDensity:
    """Return the Kaimal spectrum of the wind speed, ``f S / s^2 = 4 n / (1 + 6 n)^(5/3)`` with ``n = f L / U``.

    Parameters
    ----------
    deviation : float
        Standard deviation s of the wind speed, m/s.
    length : float
        Length L of the component, m: for the longitudinal component, 8.1 times the turbulence scale.
    speed : float
        Mean wind speed U, m/s.

    Returns
    -------
    PowerSpectralDensity
        One-sided density per Hz, m^2/s.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive.

    Notes
    -----
    The form is from IEC 61400-1 [1]_, annex C, after the measurements of Kaimal et al. [2]_. The spectrum decays with
    the power -5/3, so that the rate of the wind speed has no variance.

    References
    ----------
    .. [1] IEC 61400-1:2019, "Wind energy generation systems - Part 1: Design requirements".
    .. [2] J. C. Kaimal, J. C. Wyngaard, Y. Izumi, O. R. Cote, "Spectral characteristics of surface-layer turbulence",
       Quarterly Journal of the Royal Meteorological Society 98 (1972) 563-589.

    Examples
    --------
    >>> round(kaimal(1.5, 340.2, 12.0).variance, 4)
    2.25
    """
    check_positive("kaimal", deviation=deviation, length=length, speed=speed)
    return PowerSpectralDensity(_Kaimal(float(deviation) ** 2, float(length) / float(speed)), "one", "Hz", units="m/s")


@typechecked(values=False)
def von_karman(deviation: float, length: float, speed: float) -> PowerSpectralDensity:
    """Return the von Karman spectrum of the longitudinal wind speed.

    ``f S / s^2 = 4 n / (1 + 70.8 n^2)^(5/6)`` with ``n = f L / U``.

    Parameters
    ----------
    deviation : float
        Standard deviation s of the wind speed, m/s.
    length : float
        Longitudinal length scale L of the turbulence, m.
    speed : float
        Mean wind speed U, m/s.

    Returns
    -------
    PowerSpectralDensity
        One-sided density per Hz, m^2/s.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive.

    Notes
    -----
    See von Karman [1]_; the number 70.8 is from ESDU 85020 [2]_.

    References
    ----------
    .. [1] T. von Karman, "Progress in the statistical theory of turbulence", Proceedings of the National Academy of
       Sciences 34 (1948) 530-539.
    .. [2] ESDU 85020, "Characteristics of atmospheric turbulence near the ground", 1985.

    Examples
    --------
    >>> round(von_karman(1.5, 100.0, 12.0).variance, 2)
    2.25
    """
    check_positive("von_karman", deviation=deviation, length=length, speed=speed)
    shape = _VonKarman(float(deviation) ** 2, float(length) / float(speed))
    return PowerSpectralDensity(shape, "one", "Hz", units="m/s")


@typechecked(values=False)
def kanai_tajimi(density: float, frequency: float, damping: float) -> PowerSpectralDensity:
    """Return the Kanai-Tajimi spectrum of the acceleration of the ground.

    White noise in the rock excites a layer of soil: ``S = S0 (1 + 4 z^2 r^2) / ((1 - r^2)^2 + 4 z^2 r^2)`` with
    ``r = frequency / ground frequency``.

    Parameters
    ----------
    density : float
        Two-sided density S0 of the acceleration of the rock per rad/s, m^2/s^3.
    frequency : float
        Angular frequency of the ground, rad/s; 15.6 rad/s is usual for firm ground.
    damping : float
        Damping ratio z of the ground; 0.6 is usual for firm ground.

    Returns
    -------
    PowerSpectralDensity
        Two-sided density per rad/s, with its shaping filter.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive.

    Notes
    -----
    See Kanai [1]_ and Tajimi [2]_. The variance is ``pi S0 w (1 + 4 z^2) / (2 z)``. At low frequencies the spectrum is
    constant, so that displacements relative to the rock have no variance in a system without stiffness.

    References
    ----------
    .. [1] K. Kanai, "Semi-empirical formula for the seismic characteristics of the ground", Bulletin of the Earthquake
       Research Institute 35 (1957) 309-325.
    .. [2] H. Tajimi, "A statistical method of determining the maximum response of a building structure during an
       earthquake", Proceedings of the 2nd World Conference on Earthquake Engineering (1960) 781-797.

    Examples
    --------
    >>> import numpy as np
    >>> ground = kanai_tajimi(0.01, 15.6, 0.6)
    >>> bool(np.isclose(ground.variance, np.pi * 0.01 * 15.6 * (1 + 4 * 0.6**2) / 1.2))
    True
    """
    check_positive("kanai_tajimi", density=density, frequency=frequency, damping=damping)
    w, z = float(frequency), float(damping)
    shape = ShapingFilter(
        ((0.0, 1.0), (-(w**2), -2 * z * w)), (0.0, math.sqrt(2 * math.pi * float(density))), (w**2, 2 * z * w)
    )
    return PowerSpectralDensity(_KanaiTajimi(float(density), w, z), "two", "rad/s", filter=shape, units="m/s^2")


@dataclass(frozen=True)
class _Davenport:
    rate: float

    def __call__(self, frequency: Array, separation: float) -> Array:
        return np.asarray(np.exp(-self.rate * frequency * separation))


@typechecked(values=False)
def davenport_coherence(decay: float, speed: float) -> Callable[[Array, float], Array]:
    """Return Davenport's root coherence of the wind at two points, ``exp(-C f d / U)``.

    Parameters
    ----------
    decay : float
        Decay factor C; about 10 for points above each other, and 16 for points next to each other.
    speed : float
        Mean wind speed U, m/s.

    Returns
    -------
    callable
        Function of the frequency f, Hz, and the separation d, m.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive.

    Notes
    -----
    See Davenport [1]_.

    References
    ----------
    .. [1] A. G. Davenport, "The spectrum of horizontal gustiness near the ground in high winds", Quarterly Journal of
       the Royal Meteorological Society 87 (1961) 194-211.

    Examples
    --------
    >>> import numpy as np
    >>> coherence = davenport_coherence(10, 12)
    >>> bool(np.isclose(coherence(np.array([0.2]), 6.0)[0], np.exp(-1)))
    True
    """
    check_positive("davenport_coherence", decay=decay, speed=speed)
    return _Davenport(float(decay) / float(speed))


@typechecked(values=False)
def white_noise(density: float, sided: Sided, per: Per, band: tuple[float, float] = UNBOUNDED) -> PowerSpectralDensity:
    """Return a constant density. Without a band, the process is white noise, whose variance is infinite.

    Parameters
    ----------
    density : float
        Density, in the squared units of the process per unit of the frequency.
    sided : {"one", "two"}
        Sides of the density.
    per : {"rad/s", "Hz", "rad/m", "cycle/m"}
        Unit of the frequency.
    band : tuple of float
        Lowest and highest frequency, in the unit `per`.

    Returns
    -------
    PowerSpectralDensity
        The density.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Examples
    --------
    >>> round(white_noise(0.5, sided="one", per="Hz", band=(0, 20)).variance, 9)
    10.0
    """
    check_positive("white_noise", density=density)
    check_band("white_noise", band)
    flat = PowerSpectralDensity(_Power(float(density), 1.0, 0.0), sided, per, band)
    if tuple(band) != UNBOUNDED:
        return flat
    level = float(flat.two_sided(np.ones(1))[0])
    shape = ShapingFilter((), (), (), math.sqrt(2 * math.pi * level))
    return PowerSpectralDensity(flat.function, sided, per, band, shape)
