"""Outputs of cycles of simulated motions, by rainflow counting of ASTM E1049-85."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.motion_spectra import check_skip, remaining
from uqmbd_processes.paths import check_positive

__all__ = ["rainflow_counts", "rainflow_damage"]

if TYPE_CHECKING:
    from uqmbd.extend import MotionPolynomials

Array = NDArray[np.float64]


def _counted(where: str) -> Any:
    """Return the package that counts cycles."""
    return uqmbd.extend.require_package("rainflow", where, "uqmbd[fatigue]")


@lru_cache(maxsize=2)
def _cycles(where: str, motion: MotionPolynomials, skip: float) -> tuple[Array, Array]:
    """Return the ranges of the cycles of a motion, and their counts: 1, or 1/2 for half cycles."""
    begin, end = remaining(where, motion, skip)
    turns = (motion.between(begin, end) if skip else motion).turning_points()
    if len(turns) == 2:
        turns = np.array([turns[0], turns.mean(), turns[1]])  # the package does not count two points
    cycles = [(size, count) for size, _, count, _, _ in _counted(where).extract_cycles(turns.tolist())]
    found = np.array(cycles, dtype=float).reshape(-1, 2)
    return found[:, 0], found[:, 1]


@uqmbd.extend.summary(polynomials=True, power=0)
def _rainflow_damage(motion: MotionPolynomials, exponent: float, coefficient: float, skip: float) -> float:
    """Return Miner's sum."""
    ranges, counts = _cycles("rainflow_damage", motion, skip)
    return float(counts @ ranges**exponent / coefficient)


@uqmbd.extend.summary(polynomials=True, power=0)
def _rainflow_count(motion: MotionPolynomials, low: float, high: float, closed: float, skip: float) -> float:
    """Return the number of cycles with ranges in an interval; `closed` is 1 if its upper end belongs to it."""
    ranges, counts = _cycles("rainflow_counts", motion, skip)
    return float(counts[(ranges >= low) & ((ranges < high) | ((ranges == high) & (closed > 0)))].sum())


@typechecked(values=False)
def rainflow_damage(expression: Any, *, exponent: float, coefficient: float, skip: float = 0.0) -> sympy.Expr:
    """Return Miner's damage sum of the rainflow cycles of a motion, for use in an output.

    A cycle of the range r takes the share ``r^exponent / coefficient`` of the life, and a half cycle half of it, as for
    `fatigue_damage`. Ranges include local extremes between integration steps.

    Parameters
    ----------
    expression : SymPy expression
        Stress or force, as for `uqmbd.maximum`.
    exponent, coefficient : float
        Exponent and coefficient of the Woehler curve ``cycles = coefficient / range^exponent``.
    skip : float
        Omitted duration at the beginning of the motion, s.

    Returns
    -------
    expression
        Damage of the run; failure at 1.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, or the package rainflow is not installed.

    Notes
    -----
    Cycles are counted as in ASTM E1049-85, section 5.4.4, with half cycles for the residue [1]_. The mean of a cycle
    has no influence.

    References
    ----------
    .. [1] ASTM E1049-85, "Standard practices for cycle counting in fatigue analysis", 2017.

    Examples
    --------
    Two and a half periods of a cosine with the range 0.6 are five half cycles:

    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_processes import rainflow_damage
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=0.3)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    >>> mechanism.output("damage", rainflow_damage(mass.position[0], exponent=3, coefficient=0.6**3), units="1")
    >>> round(float(uqmbd.simulate(mechanism, [0, 2.5], rtol=1e-9)["damage"]), 4)
    2.5
    """
    where = "rainflow_damage"
    check_positive(where, exponent=exponent, coefficient=coefficient)
    begin = check_skip(where, skip)
    _counted(where)
    return _rainflow_damage(expression, float(exponent), float(coefficient), begin)


@typechecked(values=False)
def rainflow_counts(expression: Any, edges: Sequence[float], *, skip: float = 0.0) -> list[sympy.Expr]:
    """Return the numbers of rainflow cycles of a motion with ranges between edges, for use in outputs.

    Parameters
    ----------
    expression : SymPy expression
        Stress or force, as for `uqmbd.maximum`.
    edges : sequence of float
        Increasing edges of bins of the range, in the units of the expression. A range at an edge belongs to the bin
        above it, or to the last bin. Ranges outside of all bins are not counted.
    skip : float
        Omitted duration at the beginning of the motion, s.

    Returns
    -------
    list of expressions
        Number of cycles in each bin, one expression for each bin; half cycles count 1/2.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, or the package rainflow is not installed.

    Notes
    -----
    A count jumps where a range passes an edge, so surrogates converge slowly. Choose a lowest edge well above the
    integration error: cycles that are due to this error are then not counted.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_processes import rainflow_counts
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=0.3)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    >>> small, large = rainflow_counts(mass.position[0], [0.1, 0.5, 1.0])
    >>> mechanism.output("small", small, units="1")
    >>> mechanism.output("large", large, units="1")
    >>> found = uqmbd.simulate(mechanism, [0, 2.5])
    >>> float(found["small"]), float(found["large"])
    (0.0, 2.5)
    """
    where = "rainflow_counts"
    begin = check_skip(where, skip)
    bounds = np.asarray(edges, dtype=float).tolist() if np.ndim(edges) == 1 else []
    rising = all(one < other for one, other in zip(bounds[:-1], bounds[1:], strict=True))
    if len(bounds) < 2 or bounds[0] < 0 or not rising or not math.isfinite(bounds[-1]):
        raise uqmbd.StudyError(
            f"{where}: edges is {edges!r}; expected two or more increasing ranges, zero or positive."
        )
    _counted(where)
    ends = [0.0] * (len(bounds) - 2) + [1.0]
    pairs = zip(bounds[:-1], bounds[1:], ends, strict=True)
    return [_rainflow_count(expression, low, high, closed, begin) for low, high, closed in pairs]
