"""Outputs of the stationary response of the linearised mechanism to random processes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array
from uqmbd_processes.paths import check_positive
from uqmbd_processes.spectral_moments import density, moments

__all__ = ["crossing_rate", "expected_maximum", "fatigue_damage", "stationary_psd", "stationary_std"]

if TYPE_CHECKING:
    from uqmbd.extend import LinearSystem

At = Literal["equilibrium", "start", "steady"]


@uqmbd.extend.linear_output(power=1)
def _stationary_std(system: LinearSystem) -> tuple[Array, list[str]]:
    """Return standard deviations of the response."""
    found, reasons = moments(system, (0,))
    return np.sqrt(found[0]), reasons


@uqmbd.extend.linear_output(power=2, units="s")
def _stationary_psd(system: LinearSystem, frequency: float, scale: float) -> tuple[Array, list[str]]:
    """Return densities of the response: the two-sided densities per rad/s, times `scale`."""
    found, reasons = density(system, frequency)
    return scale * found, reasons


@uqmbd.extend.linear_output(power=0, units="1/s")
def _crossing_rate(system: LinearSystem, level: float) -> tuple[Array, list[str]]:
    """Return rates of upward crossings by Rice's formula."""
    found, reasons = moments(system, (0, 2))
    with np.errstate(all="ignore"):
        rate = np.sqrt(found[2] / found[0]) / (2 * np.pi)
        values = rate * np.exp(-((level - system.mean) ** 2) / (2 * found[0]))
        return values, _without_mean(system, _unmoved(system, found[0], reasons))


@uqmbd.extend.linear_output(power=1)
def _davenport_maximum(system: LinearSystem, duration: float) -> tuple[Array, list[str]]:
    """Return expected maxima by Davenport's formula."""
    deviation, crossings, reasons = _extremes(system, duration)
    with np.errstate(all="ignore"):
        root = np.sqrt(2 * np.log(crossings))
        return system.mean + deviation * (root + np.euler_gamma / root), reasons


@uqmbd.extend.linear_output(power=1)
def _poisson_maximum(system: LinearSystem, duration: float) -> tuple[Array, list[str]]:
    """Return expected maxima if upward crossings of a level form a Poisson process."""
    deviation, crossings, reasons = _extremes(system, duration)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    level = (np.arange(12.0)[:, None] + (nodes + 1) / 2).ravel()
    weight = np.tile(weights / 2, 12)
    with np.errstate(all="ignore"):
        above = -np.expm1(-crossings[:, None] * np.exp(-(level**2) / 2))
    return system.mean + deviation * (above @ weight), reasons


@uqmbd.extend.linear_output(power=0)
def _narrow_band_damage(
    system: LinearSystem, duration: float, exponent: float, coefficient: float
) -> tuple[Array, list[str]]:
    """Return Miner's sums with Rayleigh's distribution of the ranges."""
    found, reasons = moments(system, (0, 2))
    with np.errstate(all="ignore"):
        rate = np.sqrt(found[2] / found[0]) / (2 * np.pi)
        ranges = (2 * np.sqrt(2 * found[0])) ** exponent * math.gamma(1 + exponent / 2)
        return rate * duration * ranges / coefficient, _unmoved(system, found[0], reasons)


@uqmbd.extend.linear_output(power=0)
def _dirlik_damage(
    system: LinearSystem, duration: float, exponent: float, coefficient: float
) -> tuple[Array, list[str]]:
    """Return Miner's sums with Dirlik's distribution of the ranges."""
    found, reasons = moments(system, (0, 1, 2, 4))
    with np.errstate(all="ignore"):
        m0, m1, m2, m4 = (found[k] for k in (0, 1, 2, 4))
        irregularity = m2 / np.sqrt(m0 * m4)
        mean_frequency = m1 / m0 * np.sqrt(m2 / m4)
        d1 = 2 * (mean_frequency - irregularity**2) / (1 + irregularity**2)
        r = (irregularity - mean_frequency - d1**2) / (1 - irregularity - d1 + d1**2)
        d2 = (1 - irregularity - d1 + d1**2) / (1 - r)
        d3 = 1 - d1 - d2
        q = 1.25 * (irregularity - d3 - d2 * r) / d1
        part = d1 * q**exponent * math.gamma(1 + exponent)
        part = part + 2 ** (exponent / 2) * math.gamma(1 + exponent / 2) * (d2 * np.abs(r) ** exponent + d3)
        peaks = np.sqrt(m4 / m2) / (2 * np.pi)
        return peaks * duration / coefficient * (2 * np.sqrt(m0)) ** exponent * part, _unmoved(system, m0, reasons)


def _extremes(system: LinearSystem, duration: float) -> tuple[Array, Array, list[str]]:
    """Return standard deviations, expected upward crossings of the mean, and reasons."""
    found, reasons = moments(system, (0, 2))
    with np.errstate(all="ignore"):
        crossings = np.sqrt(found[2] / found[0]) / (2 * np.pi) * duration
    reasons = _without_mean(system, _unmoved(system, found[0], reasons))
    few = [
        f"{system.name} crosses its mean {number:.3g} times in {duration:g} s; the expected maximum needs at least "
        f"{LEAST:g} crossings, so use a longer duration"
        if not reason and not number >= LEAST
        else ""
        for number, reason in zip(crossings.tolist(), reasons, strict=True)
    ]
    return np.sqrt(found[0]), crossings, [one or other for one, other in zip(reasons, few, strict=True)]


LEAST = 3.0
"""Smallest number of crossings for which the formulas of the expected maximum are used."""


def _unmoved(system: LinearSystem, variance: Array, reasons: list[str]) -> list[str]:
    """Return the reasons, including a reason for constant responses."""
    text = f"{system.name} does not respond to a random process, so it has no crossings"
    return [reason or (text if value == 0 else "") for reason, value in zip(reasons, variance.tolist(), strict=True)]


def _without_mean(system: LinearSystem, reasons: list[str]) -> list[str]:
    """Return the reasons, including a reason for responses whose mean changes."""
    text = f"the mean of {system.name} changes during the steady motion; levels and maxima need a constant mean"
    unknown = np.isnan(system.mean).tolist()
    return [reason or (text if lost else "") for reason, lost in zip(reasons, unknown, strict=True)]


@typechecked(values=False)
def stationary_std(expression: Any, at: At = "equilibrium") -> sympy.Expr:
    """Return the standard deviation of the stationary response of an expression, for use in an output.

    The mechanism is linearised about a pose at rest, or a steady motion. The linearised mechanism responds to all its
    random processes; no integration over time is needed. Polynomials or Lyapunov's equation give the variance for a
    process with a shaping filter, if the process acts at one point. Other variances are integrals over frequency. A
    realisation fails if the estimated relative error of its variance is above 1e-6. The output is a scalar output.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion: positions, accelerations, reactions, and processes in the mechanism.
    at : {"equilibrium", "start", "steady"}
        Pose, or steady motion, about which the motion is linearised, as for `uqmbd.eigenfrequency`.

    Returns
    -------
    expression
        Standard deviation, in the units of the expression.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, or `at` is invalid.

    Notes
    -----
    A realisation fails, with a message, if the response has no variance: the response contains white noise, its
    spectrum is not integrable, or the pose is unstable. See [1]_, chapter 5.

    References
    ----------
    .. [1] L. D. Lutes, S. Sarkani, "Random Vibrations: Analysis of Structural and Mechanical Systems", Elsevier, 2004.

    Examples
    --------
    A unit mass on a spring with white noise of the two-sided density 0.1 N^2 s: the variance is ``pi S / (c k)``.

    >>> import numpy as np, uqmbd
    >>> from uqmbd_springs import PointForce, SpringDamper
    >>> from uqmbd_processes import RandomProcess, stationary_std, white_noise
    >>> force = RandomProcess("force", psd=white_noise(0.1, sided="two", per="rad/s"), units="N")
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, 9, damping=0.6, free_length=1))
    >>> load = mechanism.add(PointForce("load", mass, 0, force()))
    >>> mechanism.output("deviation", stationary_std(mass.position[0]), units="m")
    >>> deviation = float(uqmbd.simulate(mechanism, [0, 1])["deviation"])
    >>> bool(np.isclose(deviation**2, np.pi * 0.1 / (0.6 * 9)))
    True
    """
    return _stationary_std(expression, at=at)


@typechecked(values=False)
def stationary_psd(
    expression: Any,
    frequencies: float | Sequence[float],
    *,
    sided: Literal["one", "two"] = "one",
    per: Literal["Hz", "rad/s"] = "Hz",
    at: At = "equilibrium",
) -> Any:
    """Return the power spectral density of the stationary response at frequencies, for use in outputs.

    Each frequency is a scalar output.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion, as for `stationary_std`.
    frequencies : float or sequence of float
        Frequencies in the unit `per`.
    sided : {"one", "two"}
        Sides of the density.
    per : {"Hz", "rad/s"}
        Unit of the frequency.
    at : {"equilibrium", "start", "steady"}
        Pose, or steady motion, about which the motion is linearised.

    Returns
    -------
    expression, or uqmbd.extend.OutputSeries
        Density in the squared units of the expression per unit of the frequency; one for each frequency, which
        ``mechanism.output(name, ...)`` records as a series.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import stationary_psd
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> len(stationary_psd(mass.acceleration[0], [0.5, 1.0, 2.0]))
    3
    """
    where = "stationary_psd"
    if sided not in ("one", "two"):
        raise uqmbd.StudyError(f"{where}: sided is {sided!r}; expected 'one' or 'two'.")
    if per not in ("Hz", "rad/s"):
        raise uqmbd.StudyError(f"{where}: per={per!r}; expected 'Hz' or 'rad/s'.")
    factor = 2 * math.pi if per == "Hz" else 1.0
    scale = factor * (2.0 if sided == "one" else 1.0)
    given: Any = frequencies
    single = np.ndim(given) == 0
    found = []
    for frequency in [given] if single else list(given):
        check_positive(where, frequency=frequency)
        found.append(_stationary_psd(expression, float(frequency) * factor, scale, at=at))
    if single:
        return found[0]
    return uqmbd.extend.OutputSeries(found, list(given), "frequency", per)


@typechecked(values=False)
def crossing_rate(expression: Any, level: float, at: At = "equilibrium") -> sympy.Expr:
    """Return the rate of upward crossings of a level by a Gaussian stationary response, 1/s, for use in an output.

    Rice's formula: ``sqrt(m2 / m0) / (2 pi) exp(-(level - mean)^2 / (2 m0))``, with the mean in the pose of the
    linearisation.  Downward crossings are as frequent.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion, as for `stationary_std`.
    level : float
        Level, in the units of the expression.
    at : {"equilibrium", "start", "steady"}
        Pose, or steady motion, about which the motion is linearised.

    Returns
    -------
    expression
        Rate, 1/s.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Notes
    -----
    See Rice [1]_. A response whose rate has no variance crosses a level infinitely often, and is rejected.

    References
    ----------
    .. [1] S. O. Rice, "Mathematical analysis of random noise", Bell System Technical Journal 24 (1945) 46-156.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import crossing_rate
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> crossing_rate(mass.position[0], 0.5)
    crossing_rate(mass.x, 0.5)
    """
    return _crossing_rate(expression, level, at=at)


@typechecked(values=False)
def expected_maximum(
    expression: Any,
    duration: float,
    rule: Literal["davenport", "poisson"] = "davenport",
    at: At = "equilibrium",
) -> sympy.Expr:
    """Return the expected maximum of a Gaussian stationary response in a duration, for use in an output.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion, as for `stationary_std`.
    duration : float
        Duration T, s.
    rule : {"davenport", "poisson"}
        ``davenport``: ``mean + s (g + 0.5772 / g)`` with ``g = sqrt(2 ln(n T))`` and the rate n of upward crossings of
        the mean. ``poisson``: the mean of the distribution ``exp(-n T exp(-x^2 / 2))`` of the maximum over positive x,
        for which the upward crossings of a level form a Poisson process.
    at : {"equilibrium", "start", "steady"}
        Pose, or steady motion, about which the motion is linearised.

    Returns
    -------
    expression
        Expected maximum, in the units of the expression.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Notes
    -----
    Davenport's formula [1]_ approximates the mean of the Poisson rule for many crossings. A realisation with fewer than
    three expected crossings of the mean fails.

    References
    ----------
    .. [1] A. G. Davenport, "Note on the distribution of the largest value of a random function with application to gust
       loading", Proceedings of the Institution of Civil Engineers 28 (1964) 187-196.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import expected_maximum
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> expected_maximum(mass.position[0], 600, rule="poisson")
    poisson_maximum(mass.x, 600)
    """
    check_positive("expected_maximum", duration=duration)
    rules = {"davenport": _davenport_maximum, "poisson": _poisson_maximum}
    if rule not in rules:
        raise uqmbd.StudyError(f"expected_maximum: rule is {rule!r}; expected 'davenport' or 'poisson'.")
    return rules[rule](expression, float(duration), at=at)


@typechecked(values=False)
def fatigue_damage(
    expression: Any,
    duration: float,
    *,
    exponent: float,
    coefficient: float,
    rule: Literal["dirlik", "narrow_band"] = "dirlik",
    at: At = "equilibrium",
) -> sympy.Expr:
    """Return Miner's damage sum of a stationary Gaussian stress in a duration, for use in an output.

    A cycle of the range r takes the share ``r^exponent / coefficient`` of the life; ranges are twice the amplitudes.

    Parameters
    ----------
    expression : SymPy expression
        Stress or force, as for `stationary_std`.
    duration : float
        Duration, s.
    exponent, coefficient : float
        Exponent and coefficient of the Woehler curve ``cycles = coefficient / range^exponent``.
    rule : {"dirlik", "narrow_band"}
        Distribution of the ranges: Dirlik's, for every bandwidth, or Rayleigh's, for narrow bands.
    at : {"equilibrium", "start", "steady"}
        Pose, or steady motion, about which the motion is linearised.

    Returns
    -------
    expression
        Damage; failure at 1.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Notes
    -----
    Dirlik [1]_ fitted the distribution of rainflow ranges to the moments of orders 0, 1, 2 and 4. The second rate of
    the response therefore needs a variance. The mean stress has no influence.

    References
    ----------
    .. [1] T. Dirlik, "Application of computers in fatigue analysis", PhD thesis, University of Warwick, 1985.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import fatigue_damage
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> fatigue_damage(1e9 * mass.position[0], 3600, exponent=4, coefficient=1e30, rule="narrow_band")
    narrow_band_damage(1000000000.0*mass.x, 3600, 4, 1e+30)
    """
    check_positive("fatigue_damage", duration=duration, exponent=exponent, coefficient=coefficient)
    rules = {"dirlik": _dirlik_damage, "narrow_band": _narrow_band_damage}
    if rule not in rules:
        raise uqmbd.StudyError(f"fatigue_damage: rule is {rule!r}; expected 'dirlik' or 'narrow_band'.")
    return rules[rule](expression, float(duration), float(exponent), float(coefficient), at=at)
