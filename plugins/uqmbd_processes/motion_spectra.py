"""Outputs of simulated motions: Welch's estimate of a spectral density, standard deviations, and amplitudes of orders.

All these outputs integrate the polynomials of the motion with Gauss' rule. The motion is not sampled:
the results do not depend on output times, and have no aliases.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.paths import check_positive

__all__ = ["check_skip", "estimated_psd", "estimated_std", "order_amplitude", "remaining"]

if TYPE_CHECKING:
    from uqmbd.extend import MotionPolynomials

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)

TERMS = 8
"""Terms of the Taylor series of the exponential in a cell. Gauss' rule is exact for their products with the motion."""

CELLS = 16
"""Cells in the shortest period. The phase changes by at most 0.6 rad in a cell; the series has an error of 2e-9."""

SLACK = 1e-6
"""Part of a segment or turn by which a run may be too short, because of rounding and integration errors."""

MOST_DENOMINATOR = 12
"""Largest denominator of an order."""


def check_skip(where: str, skip: Any) -> float:
    """Return a duration at the beginning of the motion; raise StudyError if it is negative or no number."""
    if isinstance(skip, bool) or not isinstance(skip, (int, float, np.number)) or not 0 <= skip < math.inf:
        raise uqmbd.StudyError(f"{where}: skip is {skip!r}; expected a duration in s, zero or more.")
    return float(skip)


def remaining(where: str, motion: MotionPolynomials, skip: float) -> tuple[float, float]:
    """Return begin and end, s, of the motion without its first part; raise StudyError if no motion is left."""
    begin, end = float(motion.begin[0]) + skip, float(motion.end[-1])
    if begin >= end:
        raise uqmbd.StudyError(
            f"{where}: skip is {skip:g} s, but the run lasts {end - begin + skip:g} s; use a longer run, or a smaller "
            "skip=."
        )
    return begin, end


def _panels(edges: Array, counts: NDArray[np.int64]) -> tuple[Array, Array]:
    """Divide intervals between edges into panels: nodes and weights of Gauss' rule, (panel, node) each."""
    interval = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(interval)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = (np.diff(edges) / counts)[interval]
    begin = edges[:-1][interval] + number * length
    return begin[:, None] + length[:, None] * (NODES + 1) / 2, length[:, None] * WEIGHTS / 2


def _edges(motion: MotionPolynomials, begin: float, end: float, more: Sequence[float] | Array = ()) -> Array:
    """Return the ends of the parts of a motion between two times, with further times."""
    inner = motion.begin[(motion.begin > begin) & (motion.begin < end)]
    return np.unique(np.concatenate([[begin, end], inner, np.asarray(more, dtype=float)]))


@lru_cache(maxsize=4)
def _moments(motion: MotionPolynomials, begin: float, block: float, count: int, cells: int) -> Array:
    """Return integrals of the motion times ``s^m`` in equal cells of each block, (block, cell, m).

    The place s in a cell is between -1 and 1.
    """
    found = np.empty((count, cells, TERMS))
    for k in range(count):  # one block at a time bounds the memory
        bounds = begin + block * (k + np.arange(cells + 1) / cells)
        bounds[-1] = min(bounds[-1], motion.end[-1])
        edges = _edges(motion, float(bounds[0]), float(bounds[-1]), bounds)
        nodes, weights = _panels(edges, np.ones(len(edges) - 1, dtype=np.int64))
        first = np.searchsorted(edges, bounds[:-1]) * len(NODES)
        cell = np.repeat(np.arange(cells), np.diff(np.append(first, nodes.size)))
        place = (nodes.ravel() - bounds[0]) * (2 * cells / block) - (2 * cell + 1)
        integrand = weights.ravel() * motion.at(nodes.ravel())[0]
        for m in range(TERMS):
            found[k, :, m] = np.add.reduceat(integrand, first)
            integrand *= place
    return found


def _transforms(moments: Array, block: float, frequency: float) -> tuple[Array, Array]:
    """Return Fourier integrals of the motion and of 1 over each block, with the phase zero at the first block.

    The exponential in a cell is a Taylor series; the angular frequency is positive.
    """
    count, cells, _ = moments.shape
    half = block / cells / 2
    series = np.array([(-1j * frequency * half) ** m / math.factorial(m) for m in range(TERMS)])
    centres = block * np.arange(count)[:, None] + half * (2 * np.arange(cells) + 1)
    wave = np.exp(-1j * frequency * block * np.arange(count))
    one = wave * (1 - np.exp(-1j * frequency * block)) / (1j * frequency)
    return np.sum((moments @ series) * np.exp(-1j * frequency * centres), axis=1), one


@uqmbd.extend.summary(polynomials=True, power=2, units="s")
def _estimated_psd(motion: MotionPolynomials, frequency: float, segment: float, skip: float, scale: float) -> float:
    """Return Welch's estimate at a frequency, Hz: the two-sided density per Hz, times `scale`."""
    begin, end = remaining("estimated_psd", motion, skip)
    count = math.floor(2 * (end - begin) / segment + SLACK) - 1  # segments
    if count < 1:
        raise uqmbd.StudyError(
            f"estimated_psd: the run lasts {end - begin:g} s after skip={skip:g}, less than one segment of {segment:g} "
            "s; use a longer run, or a shorter segment=."
        )
    highest = 8.0 ** math.ceil(math.log(frequency, 8) - SLACK)  # similar frequencies use the same moments
    block = segment / 2
    moments = _moments(motion, begin, block, count + 1, math.ceil(CELLS * highest * block))
    shift = 2 * math.pi / segment
    angular = 2 * math.pi * frequency
    middle, low, high = (_transforms(moments, block, w) for w in (angular, angular - shift, angular + shift))
    # Hann's window of segment j is (1 - (-1)^j cos(shift t)) / 2
    sign = np.where(np.arange(count) % 2, -1.0, 1.0)
    x, one = (
        ((m[:-1] + m[1:]) - sign * (a[:-1] + a[1:] + b[:-1] + b[1:]) / 2) / 2
        for m, a, b in zip(middle, low, high, strict=True)
    )
    sums = moments[:, :, 0].sum(axis=1)
    transform = x - (sums[:-1] + sums[1:]) / segment * one
    return float(scale * np.mean(np.abs(transform) ** 2) / (3 * segment / 8))


@uqmbd.extend.summary(polynomials=True, further=("rad",), power=1)
def _order_amplitude(motion: MotionPolynomials, numerator: float, denominator: float, skip: float) -> float | str:
    """Return the amplitude of an order, a fraction, by an integral over whole turns of the angle."""
    begin, end = remaining("order_amplitude", motion, skip)
    edges = _edges(motion, begin, end)
    times, _ = _panels(edges, np.ones(len(edges) - 1, dtype=np.int64))
    angle = motion.at(np.concatenate([[begin], times.ravel(), [end]]))[1]
    falling = np.flatnonzero(np.maximum.accumulate(angle) - angle > SLACK * max(2 * math.pi, np.abs(angle).max()))
    if len(falling):
        when = np.concatenate([[begin], times.ravel(), [end]])[falling[0]]
        return (
            f"the angle decreases at t = {when:.6g} s; expected an increasing angle that counts all turns, such as "
            "joint.angle"
        )
    turns = (angle[-1] - angle[0]) / (2 * math.pi)
    whole = math.floor(turns / denominator + SLACK) * denominator
    if whole < denominator:
        return (
            f"the angle completes {turns:.4g} turns; the order {numerator / denominator:g} needs at least "
            f"{denominator:g} turn{'s' * (denominator > 1)}"
        )
    target = angle[0] + 2 * math.pi * whole
    stop = end if target >= angle[-1] else _time_of(motion, target, begin, end)
    edges = _edges(motion, begin, stop)
    order = numerator / denominator
    passed = np.diff(motion.at(edges)[1])
    counts = np.maximum(1, np.ceil(order * np.abs(passed) / math.pi)).astype(np.int64)  # half periods
    nodes, weights = _panels(edges, counts)
    x, theta = motion.at(nodes.ravel())
    measure = weights.ravel() * motion.at(nodes.ravel(), derivative=1)[1]
    x = x - measure @ x / measure.sum()
    return float(abs((measure * np.exp(-1j * order * (theta - angle[0]))) @ x) / (math.pi * whole))


def _time_of(motion: MotionPolynomials, angle: float, low: float, high: float) -> float:
    """Return the time at which the angle has a value, by bisection to rounding."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if motion.at(np.array([middle]))[1, 0] < angle else (low, middle)
    return high


@uqmbd.extend.summary(polynomials=True, power=1)
def _estimated_std(motion: MotionPolynomials, skip: float) -> float:
    """Return the standard deviation over time after a duration; Gauss' rule is exact for squares of the polynomials."""
    begin, end = remaining("estimated_std", motion, skip)
    edges = _edges(motion, begin, end)
    nodes, weights = _panels(edges, np.ones(len(edges) - 1, dtype=np.int64))
    x, measure = motion.at(nodes.ravel())[0], weights.ravel() / (end - begin)
    return math.sqrt(measure @ np.square(x - measure @ x))


@typechecked(values=False)
def estimated_std(expression: Any, *, skip: float = 0.0) -> sympy.Expr:
    """Return the standard deviation over time of a motion, for use in outputs.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion, as for `uqmbd.integral`.
    skip : float
        Omitted duration at the beginning of the motion, s, such as a transient motion.

    Returns
    -------
    expression
        Standard deviation about the mean over time after `skip`, in the units of the expression.

    Raises
    ------
    uqmbd.StudyError
        If `skip` is invalid, or the run is shorter.

    Notes
    -----
    The mean of the run replaces the mean of the process. On a random process, the mean square of the estimate is
    therefore below the variance, by the variance of the mean over time.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import estimated_std
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, velocity=2.0)
    >>> mechanism.output("spread", estimated_std(mass.position[0], skip=1), units="m")
    >>> round(12 * float(uqmbd.simulate(mechanism, [0, 4])["spread"]) ** 2, 9)
    36.0
    """
    found: sympy.Expr = _estimated_std(expression, check_skip("estimated_std", skip))
    return found


@typechecked(values=False)
def estimated_psd(
    expression: Any,
    frequencies: float | Sequence[float],
    *,
    segment: float,
    sided: Literal["one", "two"] = "one",
    per: Literal["Hz", "rad/s"] = "Hz",
    skip: float = 0.0,
) -> Any:
    """Return Welch's estimate of the power spectral density of a motion at frequencies, for use in outputs.

    The motion of a realisation is divided into segments that overlap by half. The estimate is the mean of their
    periodograms, with Hann's window and without the mean of each segment. Each frequency is a scalar output.

    Parameters
    ----------
    expression : SymPy expression
        Expression of the motion, as for `uqmbd.integral`.
    frequencies : float or sequence of float
        Frequencies in the unit `per`. A segment contains at least two periods of each.
    segment : float
        Length L of a segment, s. The window averages the density over frequencies within 2 / L. The estimate is biased
        where the density changes within 2 / L, which is frequent near the lowest frequency, 2 / L.
    sided : {"one", "two"}
        Sides of the density.
    per : {"Hz", "rad/s"}
        Unit of the frequency.
    skip : float
        Omitted duration at the beginning of the motion, s, such as a transient motion.

    Returns
    -------
    expression, or uqmbd.extend.OutputSeries
        Density in the squared units of the expression per unit of the frequency, one for each frequency.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, or the run is shorter than a segment.

    Notes
    -----
    A run of the length T after `skip` has ``K = floor(2 T / L) - 1`` segments. For a Gaussian motion whose density is
    constant within 2 / L, the relative standard error of the estimate is ``sqrt((1 + (1 - 1 / K) / 18) / K)``
    [1]_. At a resonance with the half-power bandwidth B, the estimate is too small: by 40 % for ``L = 1 / B`` and by
    7 % for ``L = 4 / B``. The bias is 0.5 % for ``L = 16 / B``. Fourier integrals over the motion replace
    sums over samples: the estimate does not depend on output times, and there are no aliases and no highest frequency.

    References
    ----------
    .. [1] P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Transactions on
       Audio and Electroacoustics 15 (1967) 70-73.

    Examples
    --------
    The power of a cosine is half of its squared amplitude. The window spreads it over a band of the width 1.5 / L:

    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_processes import estimated_psd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=0.3)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    >>> mechanism.output("density", estimated_psd(mass.position[0], 1.0, segment=10), units="m^2/Hz")
    >>> density = float(uqmbd.simulate(mechanism, [0, 20])["density"])
    >>> bool(np.isclose(density * 1.5 / 10, 0.3**2 / 2, rtol=1e-4))
    True
    """
    where = "estimated_psd"
    if sided not in ("one", "two"):
        raise uqmbd.StudyError(f"{where}: sided is {sided!r}; expected 'one' or 'two'.")
    if per not in ("Hz", "rad/s"):
        raise uqmbd.StudyError(f"{where}: per={per!r}; expected 'Hz' or 'rad/s'.")
    check_positive(where, segment=segment)
    begin = check_skip(where, skip)
    unit = 1.0 if per == "Hz" else 2 * math.pi
    scale = (2.0 if sided == "one" else 1.0) / unit
    given: Any = frequencies
    single = np.ndim(given) == 0
    found = []
    for frequency in [given] if single else list(given):
        check_positive(where, frequency=frequency)
        hertz = float(frequency) / unit
        if hertz * segment < 2 * (1 - SLACK):
            raise uqmbd.StudyError(
                f"{where}: the frequency {frequency:g} {per} has fewer than two periods in a segment of {segment:g} s, "
                f"so the window does not resolve it; expected at least {2 * unit / segment:.4g} {per}, or use a longer "
                "segment=."
            )
        found.append(_estimated_psd(expression, hertz, float(segment), begin, scale))
    if single:
        return found[0]
    return uqmbd.extend.OutputSeries(found, list(given), "frequency", per)


@typechecked(values=False)
def order_amplitude(
    expression: Any, angle: Any, orders: float | Sequence[float], *, skip: float = 0.0
) -> sympy.Expr | uqmbd.extend.OutputSeries:
    """Return the amplitudes of a motion at multiples of a rotation angle, for use in outputs (order analysis).

    Let a be the angle of all whole turns in the motion. The amplitude of the order k is the absolute value of ``2 / a``
    times the integral of ``x exp(-i k angle)`` over this angle. The speed may vary.

    Parameters
    ----------
    expression : SymPy expression
        Expression x of the motion, as for `uqmbd.integral`.
    angle : SymPy expression
        Rotation angle in rad, which increases with every turn: ``body.angle``, ``joint.angle``, ``100 * uqmbd.t``.
    orders : float or sequence of float
        Orders, which are positive: 1 for once per turn; 0.5 for once in two turns. Fractions have denominators up to
        12; the integral is then over a multiple of this number of turns.
    skip : float
        Omitted duration at the beginning of the motion, s.

    Returns
    -------
    expression, or uqmbd.extend.OutputSeries
        Amplitude in the units of the expression, one for each order.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Notes
    -----
    A realisation has no value if the angle decreases, or completes less than one turn. The motion after the last whole
    turn is omitted.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_processes import order_amplitude
    >>> from uqmbd_drivers import RotationDriver
    >>> from uqmbd_joints import Revolute
    >>> mechanism = uqmbd.Mechanism("rotor", uqmbd.Planar())
    >>> rotor = mechanism.body("rotor", mass=1, inertia=1)
    >>> axle = mechanism.add(Revolute("axle", mechanism.ground, rotor, (0, 0), (0, 0)))
    >>> driver = mechanism.add(RotationDriver("drive", mechanism.ground, rotor, angle=5 * uqmbd.t + uqmbd.t**2))
    >>> height = rotor.point((0.2, 0))[1]
    >>> first, second = order_amplitude(height, rotor.angle, [1, 2])
    >>> mechanism.output("first", first, units="m")
    >>> mechanism.output("second", second, units="m")
    >>> found = uqmbd.simulate(mechanism, [0, 3])
    >>> round(float(found["first"]), 6), round(float(found["second"]), 6)
    (0.2, 0.0)
    """
    where = "order_amplitude"
    begin = check_skip(where, skip)
    given: Any = orders
    single = np.ndim(given) == 0
    found = []
    for order in [given] if single else list(given):
        check_positive(where, order=order)
        fraction = Fraction(float(order)).limit_denominator(MOST_DENOMINATOR)
        if not math.isclose(float(fraction), float(order), rel_tol=SLACK):
            raise uqmbd.StudyError(
                f"{where}: the order {order!r} is not a fraction with a denominator up to {MOST_DENOMINATOR}; its "
                "period would be too many turns."
            )
        found.append(_order_amplitude(expression, angle, float(fraction.numerator), float(fraction.denominator), begin))
    if single:
        return found[0]
    return uqmbd.extend.OutputSeries(found, list(given), "order", "1")
