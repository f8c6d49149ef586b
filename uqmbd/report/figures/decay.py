"""Decay of chaos coefficients with the order, and stated errors of a chaos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Axis, Chart, Curve, Look, Views, draw_on_paper
from uqmbd.report.figures.selection import Results, automatic_times, label_of, percent_ends
from uqmbd.report.figures.surrogates import chaos_of, one_node, stated_error_of, times_of, varies_over_time
from uqmbd.results import varies
from uqmbd.results.assessment import EXACT
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "LARGEST",
    "coefficient_decay",
    "coefficient_parts",
    "decay_chart",
    "errors_chart",
    "horizon",
    "stated_errors",
    "verification",
]


LARGEST = "largest over time"
"""Name of the maximum over time of several curves."""
_ROUNDING = 1e-15
_MOST_LINES = 6
_OTHERS = Look("quiet", (), 1.0)


class CoefficientParts(NamedTuple):
    """Contributions to the largest standard deviation; NaN for contributions at the level of rounding."""

    at_times: dict[str, Array]  # (N,): by total order from 1, at some times
    largest: Array  # (N,): maximum over time
    inputs: list[str]
    of_inputs: Array  # (d, D): by degree from 1 in each input, the maximum over time
    # named, others: inputs with separate line styles, and inputs with a common style
    named: list[int]
    others: list[int]
    ends: tuple[float, float]  # ends of an axis that shows all parts and the limit


def coefficient_parts(
    results: Results, output: str, *, times: Sequence[float] | None = None
) -> CoefficientParts | None:
    """Return the data of `coefficient_decay`; None if the output has no spread.

    Raise StudyError if there is no chaos, or no such output exists.
    """
    chaos = chaos_of(one_node(results), output)
    decay = chaos.decay().isel(output=0)
    grid_of_times, std = times_of(decay), chaos.std[0]
    scale = float(std.max())
    if not varies_over_time(std, chaos.mean[0]).any() or not varies(one_node(results), output):
        return None
    amplitude = np.sqrt(decay["energy"].values[1:]) / scale
    of_inputs = np.sqrt(decay["energy_germ"].values[:, 1:].max(axis=-1)) / scale
    if times is None:
        chosen = [k for k in automatic_times(grid_of_times, std) if std[k] > 0][-3:]
    else:
        chosen = sorted({int(np.abs(grid_of_times - t).argmin()) for t in times})
    seen = np.concatenate([amplitude.max(axis=1), amplitude[:, chosen].ravel(), of_inputs.ravel()])
    seen = seen[seen > _ROUNDING]
    count = len(of_inputs)
    slowest = sorted(range(count), key=lambda k: (-of_inputs[k, -1], -of_inputs[k].max()))
    named = sorted(slowest if count <= _MOST_LINES else slowest[: _MOST_LINES - 1])

    def known(values: Array) -> Array:
        return np.where(values > _ROUNDING, values, np.nan)

    return CoefficientParts(
        {f"t = {grid_of_times[k]:.4g} s": known(amplitude[:, k]) for k in chosen if len(grid_of_times) > 1},
        known(amplitude.max(axis=1)),
        [str(name) for name in decay["germ"].values],
        known(of_inputs),
        named,
        [k for k in slowest if k not in named],
        (max(min(float(seen.min(initial=1.0)), EXACT), 1e-15), max(float(seen.max(initial=1.0)), 1.0)),
    )


def decay_chart(results: Results, output: str, *, times: Sequence[float] | None = None) -> Views | None:
    """Chart the part of the standard deviation from polynomials of each order, in per cent of its maximum.

    One view shows the total order, at some times and as maximum; another shows the degree in each input. Of many
    inputs, those with the slowest decay have separate lines, and one more line is the maximum of the others. Return
    None if the output has no spread.

    Raise StudyError if there is no chaos.
    """
    found = coefficient_parts(results, output, times=times)
    if found is None:
        return None
    orders = [(LARGEST, found.largest), *found.at_times.items()]
    degrees = [(found.inputs[k], found.of_inputs[k]) for k in found.named]
    if found.others:
        degrees.append((f"largest of {len(found.others)} others", np.fmax.reduce(found.of_inputs[found.others])))
    charts = []
    for word, across, rows in (("order", "total order", orders), ("degree", "degree in one input", degrees)):
        looks: list[Look | None] = [None] * len(rows)
        if rows is orders:
            looks[0] = Look("ink", width=2.2)
        elif found.others:
            looks[-1] = _OTHERS
        count = len(rows[0][1])
        charts.append(
            Chart(
                f"part of the largest standard deviation of {output}",
                np.arange(1.0, count + 1),
                [Curve(n, 100 * one, (), "part", "dotted", look) for (n, one), look in zip(rows, looks, strict=True)],
                f"by {across}",
                "%",
                axis="part of the largest std",
                along=Axis(across, whole=True, place_units="", before=f"{word} "),
                ends=percent_ends(found.ends),
                log=True,
                limits={"stated error": 100 * EXACT},
                digits=True,
                start=count - 1,
            )
        )
    return Views(charts, "Orders or degrees", heights=(1.75,))


@typechecked
def coefficient_decay(results: Results, output: str, *, times: Sequence[float] | None = None) -> Figure:
    """Draw the part of the standard deviation from polynomials of each order.

    The left axes show all polynomials of a total order, the right axes polynomials of a degree in one input. Each point
    is the root of the sum of squared coefficients, relative to the largest standard deviation over time. The thick line
    is the maximum over time.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Node of a propagator that makes a chaos. If there are several, the finest chaos is drawn.
    output : str
        Name of the output.
    times : sequence of float, optional
        Times, s; the nearest stored times are drawn in addition to the maximum. Default: up to three times.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If there is no chaos, or no such output exists.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> from uqmbd.results import PolynomialChaos, propagator_node
    >>> from uqmbd.extend import labels
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))]))
    >>> axes = labels([("x", "m")], ["k"], [0.0, 1.0])
    >>> chaos = PolynomialChaos([[[1.0, 1.0]], [[0.0, 0.8]], [[0.0, 0.6]]], [[0], [1], [2]], space, axes)
    >>> node = propagator_node("mine", chaos.statistics(), propagator="p", realisations=3, wall_time=0.0,
    ...                        children={"chaos": chaos.to_dataset()})
    >>> figure = coefficient_decay(node, "x", times=[])
    >>> figure.axes[0].lines[0].get_ydata().round(1).tolist()
    [80.0, 60.0]
    """
    found = decay_chart(results, output, times=times)
    if found is None:
        nothing = Curve("part", np.full(2, np.nan))
        axes = (Axis("total order", whole=True), Axis("degree in one input", whole=True))
        found = Views([Chart("part", [1.0, 2.0], [nothing], along=axis, words="no spread") for axis in axes])
    return draw_on_paper(found)


def horizon(times: Array, error: Array, limit: float = EXACT) -> float | None:
    """Return the first time in s at which an error (T,) exceeds a limit; None if the error never exceeds it.

    >>> import numpy as np
    >>> horizon(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.02, 0.001])), horizon(np.zeros(1), np.zeros(1))
    (1.0, None)
    """
    above = np.flatnonzero(error > limit)
    return float(times[above[0]]) if len(above) else None


class StatedErrors(NamedTuple):
    """Data of the chart of stated errors of a surrogate."""

    times: Array  # (T,)
    names: list[str]  # names of the outputs
    errors: Array  # (N, T): relative to the standard deviation; NaN for errors at the level of rounding
    horizons: list[float | None]  # first time at which each error exceeds the limit, s
    # named, others: outputs with separate line styles, in order, and outputs with a common style, the worst first
    named: list[int]
    others: list[int]
    ends: tuple[float, float]  # ends of an axis that shows the errors and the limit


def stated_errors(results: Results, limit: float = EXACT) -> StatedErrors:
    """Return the data of `verification`.

    Raise StudyError if the propagator states no error.
    """
    node = one_node(results)
    stated = stated_error_of(node)
    if stated is None:
        raise StudyError(
            f"The propagator {label_of(node)!r} states no error of its surrogate. Use verification realisations, such "
            "as verify=16."
        )
    times = np.asarray(stated["time"].values, dtype=float)
    errors = np.asarray(stated.values, dtype=float)
    names = [str(name) for name in stated["output"].values]
    worst = sorted(range(len(names)), key=lambda k: -float(errors[k].max()))
    named = sorted(worst if len(names) <= _MOST_LINES else worst[: _MOST_LINES - 1])
    seen = errors[errors > _ROUNDING]
    low, high = float(seen.min(initial=limit)), float(seen.max(initial=0.0)) or limit
    return StatedErrors(
        times=times,
        names=names,
        errors=np.where(errors > _ROUNDING, errors, np.nan),
        horizons=[horizon(times, error, limit) for error in errors],
        named=named,
        others=[k for k in worst if k not in named],
        # the axis omits errors far below the limit if there are larger errors
        ends=(max(low, min(1e-4 * limit, 0.1 * high)), max(high, 2 * limit)),
    )


def errors_chart(results: Results, limit: float = EXACT) -> Chart:
    """Chart the stated errors of a surrogate over time, in per cent of the standard deviation of each output.

    Of many outputs, the worst have separate lines, and one more line is the largest error of the others. Dots mark the
    first time at which an error exceeds the limit.

    Raise StudyError if the propagator states no error.
    """
    found = stated_errors(results, limit)
    level = f"{100 * limit:g} %"
    curves = []
    for k in found.named:
        first = found.horizons[k]
        note = f"below {level}" if first is None else f"above {level} at {first:.4g} s"
        marks = () if first is None else ((first, 100 * limit),)
        curves.append(Curve(found.names[k], 100 * found.errors[k], (), "stated error", marks=marks, note=note))
    if found.others:
        largest = 100 * np.fmax.reduce(found.errors[found.others])
        curves.append(Curve(f"largest of {len(found.others)} others", largest, (), "stated error", look=_OTHERS))
    worst = np.fmax.reduce([np.asarray(curve.values) for curve in curves])
    return Chart(
        "stated error",
        found.times,
        curves,
        units="% of std",
        ends=percent_ends(found.ends),
        log=True,
        limits={"stated error": 100 * limit},
        digits=True,
        start=int(np.nan_to_num(worst, nan=-1.0).argmax()),
    )


@typechecked
def verification(results: Results, *, limit: Annotated[float, Bounds(1e-12, 1e6)] = EXACT) -> Figure:
    """Draw the stated error of a surrogate over time, and the time from which it exceeds the limit.

    The error refers to realisations that the surrogate does not use, relative to the standard deviation of each output.
    A dot marks the horizon, the first time at which the error exceeds the limit; the legend states this time.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Node of a propagator that states a ``verification_error``. If there are several, the finest chaos is drawn.
    limit : float
        Limit of the error, relative to the standard deviation.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the propagator states no error.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0, 2.0])
    >>> statistics = statistics_dataset(axes, mean=[[0, 0, 0]], std=[[1, 1, 1]])
    >>> statistics["verification_error"] = (("output", "time"), [[1e-4, 1e-3, 1e-1]])
    >>> node = propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> [text.get_text() for text in verification(node).legends[0].get_texts()]
    ['x: above 1 % at 2 s', 'limit: stated error (1 % of std)']
    """
    return draw_on_paper(errors_chart(results, limit), height=2.8)
