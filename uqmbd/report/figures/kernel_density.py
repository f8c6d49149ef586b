"""Kernel density estimates of samples that respect the ends of the support.

`gaussian_kde` of SciPy has no bounds, and the import of `scipy.stats` would extend `uqmbd report` by one second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uqmbd.report.charts import Axis, Chart, Curve, Look
from uqmbd.report.drawing import constant, histogram, line_width
from uqmbd.typing import Array
from uqmbd.wording import reciprocal_units, typeset_units

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = [
    "FAILED_INPUTS",
    "Densities",
    "DensityCurve",
    "densities",
    "density",
    "density_chart",
    "ends_of",
    "known_densities",
]

FAILED_INPUTS = "inputs of failed samples"
"""Name of the marks of failed samples."""

_SHARED = 160
"""Number of points along the axis of a chart, in addition to points at jumps; estimates are smooth."""

_CELLS = 1000
_TAIL = 1e-4
"""Probability beyond each end of the curve of a known distribution with infinite support."""
_ROUGHNESS = 0.5 / math.sqrt(math.pi)
"""Integral of the squared Gaussian kernel, to which the variance of the estimate is proportional."""
_WIDENED = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Factors by which a kernel is widened in turn, until all remaining peaks are significant."""
_CLEAR, _FAR = 2.5, 0.1
"""Minimum depth of a significant dip between two peaks, in standard errors, and minimum height of a peak that counts,
relative to the largest peak."""
_PILED, _ENOUGH = 0.25, 100
"""Ratio of the density at an end to the maximum, above which the end is a bound; minimum number of values for this
test."""


class DensityCurve(NamedTuple):
    """Density of one method."""

    values: NDArray[np.float64]  # (S,)
    style: int = 0  # index of colour and line style
    scales: bool = True  # whether the curve affects the height of the axes; False for a curve with a large error
    # points and density of a curve without estimation
    known: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None


def density(
    values: NDArray[np.float64], points: int = 200, ends: tuple[float, float] = (-math.inf, math.inf)
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Estimate a density with Gaussian kernels.

    The width of the kernels follows the rule of Silverman. The rule uses the smaller of the standard deviation and the
    interquartile range (scaled for a normal distribution). Outliers and several peaks therefore do not blur the
    estimate. The width is increased, at most threefold, while a dip between two peaks is shallower than two and a half
    standard errors of the estimate. At the ends, the parts of the kernels beyond the bound are reflected.

    `values` has the shape (S,). `points` is the number of places, from three widths below the smallest value to
    three above the largest, within the ends. `ends` are bounds of the quantity; see :func:`ends_of`.
    Return None if the values do not vary.

    B. W. Silverman, Density Estimation for Statistics and Data Analysis, Chapman and Hall, 1986, sections 2.10, 3.4.2.

    >>> import numpy as np
    >>> x, f = density(np.random.default_rng(0).normal(size=500))
    >>> round(float(np.trapezoid(f, x)), 2)
    1.0
    >>> density(np.ones(5)) is None
    True
    """
    low, high = float(values.min()), float(values.max())
    if len(values) < 2 or constant(low, high):
        return None
    # shift and scale, so that the variance of values of 1e-200 does not underflow
    scaled = (values - low) / (high - low)
    first, last = ((end - low) / (high - low) for end in ends)
    places, weights = scaled, np.full(len(scaled), 1 / len(scaled))
    if len(scaled) > 2 * _CELLS:
        # count many samples in cells, which are much finer than the width of a kernel
        counts, edges = np.histogram(scaled, _CELLS, (0.0, 1.0))
        places, weights = (edges[:-1] + edges[1:])[counts > 0] / 2, counts[counts > 0] / len(scaled)
    width = _silverman(scaled)
    found: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = []
    for factor in _WIDENED:
        wide = factor * width
        x = np.linspace(max(-3 * wide, first), min(1 + 3 * wide, last), points)
        f = _kernels(x, places, weights, wide)
        for end in (first, last):
            if -3 * wide < end < 1 + 3 * wide:
                f += _kernels(2 * end - x, places, weights, wide)
        found.append((_insignificant_dips(f, len(values) * wide), x, f))
        if not found[-1][0]:
            break
    _, x, f = min(found, key=lambda one: one[0])
    return low + (high - low) * x, f / (high - low)


def known_densities(space: GermSpace) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the densities of inputs from the germ map that a surrogate stores.

    The result contains points and densities by input. Inputs with discrete values, and inputs of a general joint
    distribution, are omitted.

    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> given = JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(0, 4))])
    >>> x, f = known_densities(GermSpace.of(given))["a"]
    >>> round(float(x[0]), 2), round(float(x[-1]), 2), float(f.min().round(9)), float(f.max().round(9))
    (0.0, 4.0, 0.25, 0.25)
    """
    from scipy.special import ndtr, ndtri

    from uqmbd.randomness import cumulated

    found = {}
    for group in space.groups:
        marginals = getattr(group, "marginals", None)
        if marginals is None:
            continue
        for column, marginal in zip(group.columns, marginals, strict=True):
            germ = space.germs[column]
            if germ.values is not None:
                continue
            # several inputs of a group are coupled by a Gaussian copula, whose variables are standard normal
            alone = len(group.columns) == 1
            tails = [_TAIL, 1 - _TAIL]
            low, high = (germ.from_uniform(tails) if alone else ndtri(tails)).tolist()
            if alone:
                reach = 0.05 * (high - low)
                low, high = max(germ.bounds[0], low - reach), min(germ.bounds[1], high + reach)
            z = np.linspace(low, high, 401)
            x, below = marginal.to_input(z), cumulated(germ, z) if alone else ndtr(z)
            steps = np.diff(x)
            if not np.all(steps) or len(np.unique(np.sign(steps))) > 1:
                continue
            f = np.diff(below) / np.abs(steps)
            # place densities at the midpoints between points, and at the end points
            points = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
            found[space.inputs[column]] = points, np.concatenate([f[:1], f, f[-1:]])
    return found


def _silverman(values: NDArray[np.float64]) -> float:
    deviation = float(values.std(ddof=1))
    quartiles = float(np.subtract(*np.percentile(values, [75, 25]))) / 1.349
    scale = min(deviation, quartiles) if quartiles > 0.1 * deviation else deviation
    return 0.9 * scale * float(len(values) ** -0.2)


def _kernels(
    x: NDArray[np.float64], places: NDArray[np.float64], weights: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    summed = np.exp(-0.5 * (np.subtract.outer(x, places) / width) ** 2) @ weights
    return np.asarray(summed / (math.sqrt(2 * math.pi) * width))


def _insignificant_dips(f: NDArray[np.float64], weight: float) -> int:
    """Count dips between peaks that are not significant; ``weight`` is sample count times kernel width."""
    rising = np.sign(np.diff(f))
    turns = np.flatnonzero(rising[:-1] * rising[1:] < 0) + 1
    peaks = [int(k) for k in turns if f[k] > f[k - 1]]
    if rising[0] < 0:
        peaks.insert(0, 0)  # a peak at the bound
    if rising[-1] > 0:
        peaks.append(len(f) - 1)
    count = 0
    for left, right in zip(peaks[:-1], peaks[1:], strict=True):
        lower, bottom = min(f[left], f[right]), f[left : right + 1].min()
        error = math.sqrt((lower + bottom) * _ROUGHNESS / weight)
        count += lower > _FAR * f.max() and lower - bottom < _CLEAR * error
    return count


def ends_of(values: NDArray[np.float64]) -> tuple[float, float]:
    """Estimate the ends of the support of a quantity from samples.

    Zero is a bound if no sample is beyond zero and some samples are near zero. The probability beyond zero is then at
    most 3 / S (with 95 % confidence), which is not visible in a density. The smallest or largest sample is a bound if
    the density there is large, as for a uniform distribution.

    `values` has the shape (S,). Return lower and upper bound; infinite without a bound.

    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> ends_of(abs(rng.normal(size=100))), ends_of(rng.normal(size=100))
    ((0.0, inf), (-inf, inf))
    """
    low, high = float(values.min()), float(values.max())
    if len(values) < 2 or constant(low, high):
        return -math.inf, math.inf
    scaled = (values - low) / (high - low)
    width = _silverman(scaled)
    f = _kernels(np.linspace(0, 1, 101), scaled, np.full(len(scaled), 1 / len(scaled)), width)
    piled = f[[0, -1]] > _PILED * f.max() if len(values) >= _ENOUGH else (False, False)
    near = width * (high - low)
    lower, upper = low if piled[0] else -math.inf, high if piled[1] else math.inf
    if 0 <= low < (near if piled[0] else 3 * near):
        lower = 0.0
    if 0 >= high > -(near if piled[1] else 3 * near):
        upper = 0.0
    return lower, upper


class Densities(NamedTuple):
    """Data of a density chart."""

    bars: tuple[NDArray[np.float64], NDArray[np.float64]] | None  # edges and heights of a histogram, as a density
    # index of colour and line style, points and densities of each curve; the curve is zero at its ends
    curves: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]
    top: float  # largest density that must be visible


def densities(bars: NDArray[np.float64] | None, curves: Sequence[DensityCurve]) -> Densities:
    """Return the data of a density chart: the histogram of values `bars` (S,), and the densities of `curves`."""
    counted = None if bars is None else histogram(bars, density=True)
    tops = {True: 0.0 if counted is None else float(counted[1].max()), False: 0.0}
    found = []
    for values, number, scales, known in curves:
        curve = known or density(values, ends=ends_of(values))
        if curve is None:
            continue
        x, f = curve
        # append zeros, so that the curve also ends on the axis at a bound
        found.append((number, np.concatenate([x[:1], x, x[-1:]]), np.concatenate([[0.0], f, [0.0]])))
        tops[scales] = max(tops[scales], float(f.max()))
    return Densities(counted, found, tops[True] or tops[False])


def density_chart(
    title: str,
    name: str,
    units: str,
    shown: Densities,
    labels: Sequence[str],
    barred: str,
    *,
    span: tuple[float, float] | None = None,
    colour: int | None = None,
    failed: NDArray[np.float64] | None = None,
    heading: str = "",
) -> Chart:
    """Chart densities of a quantity at common positions; a jump has two values at one position.

    ``barred`` is the name of the histogram; ``colour`` is the index of a common colour of all curves; ``failed`` are
    values of failed samples, which get a mark.
    """
    places = _places(shown, span)
    curves = []
    if shown.bars is not None:
        look = Look(colour or 0, (), 0.8)
        curves.append(Curve(barred, _steps(places, *shown.bars), (), "density", "filled", look))
    for number, x, f in shown.curves:
        series = Look(number, width=line_width(number, len(labels)))
        look = series if colour is None else Look(colour, (), series.width)
        curves.append(Curve(labels[number], _at(places, x, f), (), "density", look=look))
    if failed is not None and len(failed):
        marks = [(float(f"{value:.7g}"), 0.0) for value in np.unique(failed)]
        nothing = np.full(len(places), np.nan)
        curves.append(Curve(FAILED_INPUTS, nothing, (), "density", look=Look("limit", (), 1.6), marks=marks))
    return Chart(
        f"density of {name}",
        places,
        curves,
        title,
        reciprocal_units(units),
        axis="density",
        along=Axis(name, typeset_units(units)),
        ends=(0.0, 1.05 * shown.top) if shown.top else None,
        start=len(places) // 2,
        short=True,
        heading=heading,
        words="" if shown.curves or shown.bars is None else "no spread",
    )


def _places(shown: Densities, span: tuple[float, float] | None) -> Array:
    """Return the ascending positions of a chart; positions of jumps occur twice."""
    jumps = [x[[0, -1]] for _, x, _ in shown.curves]
    if shown.bars is not None:
        jumps.append(shown.bars[0])
    if not jumps:
        return np.array([0.0, 1.0] if span is None else span, dtype=float)
    every = np.concatenate(jumps)
    low, high = (float(every.min()), float(every.max())) if span is None else span
    parts = [np.linspace(low, high, _SHARED), every, every]
    # add positions for narrow curves
    parts += [np.linspace(x[0], x[-1], _SHARED // 2) for _, x, _ in shown.curves if 2 * (x[-1] - x[0]) < high - low]
    places = np.sort(np.concatenate(parts))
    return np.asarray(places[(places >= low) & (places <= high)])


def _at(places: Array, x: Array, f: Array) -> Array:
    """Return a curve at given positions; at each end, which occurs twice, the outer value is zero."""
    if x[0] > x[-1]:
        x, f = x[::-1], f[::-1]
    values = np.interp(places, x[1:-1], f[1:-1], left=np.nan, right=np.nan)
    for end, place in ((x[0], np.searchsorted(places, x[0])), (x[-1], np.searchsorted(places, x[-1], "right") - 1)):
        if 0 <= place < len(places) and places[place] == end:
            values[place] = 0.0
    return np.asarray(values)


def _steps(places: Array, edges: Array, heights: Array) -> Array:
    """Return the outline of a histogram at positions that contain each edge twice."""
    values = heights[np.clip(np.searchsorted(edges, places, "right") - 1, 0, len(heights) - 1)]
    values[(places < edges[0]) | (places > edges[-1])] = np.nan
    values[np.searchsorted(places, edges)] = np.concatenate([[0.0], heights])
    values[np.searchsorted(places, edges, "right") - 1] = np.concatenate([heights, [0.0]])
    return np.asarray(values)
