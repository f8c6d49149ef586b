"""How the coefficients of a chaos fall with the order, and how large an error it states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, axes_grid, limit_times, log_axis, style
from uqmbd.report.figures.selection import Results, automatic_times, label_of, thinned
from uqmbd.report.figures.surrogates import chaos_of, one_node, stated_error_of, times_of, varies_over_time
from uqmbd.results import varies
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "LARGEST",
    "LIMIT",
    "StatedErrors",
    "coefficient_decay",
    "coefficient_parts",
    "horizon",
    "stated_errors",
    "verification",
]


LIMIT = 0.01
"""Error, relative to the standard deviation, up to which a surrogate is trusted."""
LARGEST = "largest over time"
"""What the maximum over time of several curves is called."""
_ROUNDING = 1e-15
_MOST_LINES = 6
_MARKERS = "osD^vP"
_PALE = "0.72"


class CoefficientParts(NamedTuple):
    """Parts of the largest standard deviation that polynomials carry: NaN where they are zero but for rounding.

    Attributes
    ----------
    at_times : dict of str to array, shape (N,)
        By total order from 1, at some times.
    largest : array, shape (N,)
        Its maximum over time.
    inputs : list of str
    of_inputs : array, shape (d, D)
        By degree from 1 in each input, the maximum over time.
    named, others : list of int
        Inputs with a line of their own, and those that share one look.
    ends : tuple of float
        Between which values an axis shows them and the limit.
    """

    at_times: dict[str, Array]
    largest: Array
    inputs: list[str]
    of_inputs: Array
    named: list[int]
    others: list[int]
    ends: tuple[float, float]


def coefficient_parts(
    results: Results, output: str, *, times: Sequence[float] | None = None
) -> CoefficientParts | None:
    """Return what `coefficient_decay` draws; None if the output has no spread.

    Raises
    ------
    StudyError
        If there is no chaos, or no such output exists.
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
        (max(min(float(seen.min(initial=1.0)), LIMIT), 1e-15), max(float(seen.max(initial=1.0)), 1.0)),
    )


def coefficient_decay(results: Results, output: str, *, times: Sequence[float] | None = None) -> Figure:
    """Draw how much of the spread the polynomials of each order carry; it falls fast where the order suffices.

    On the left all polynomials of a total order, on the right those of a degree in one input. Each point is the root
    of the sum of squared coefficients, relative to the largest standard deviation over time; thick: its maximum over
    time.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        The node of a propagator that makes a chaos. Of several the finest chaos is drawn.
    output : str
        Name of the output.
    times : sequence of float, optional
        In seconds; the nearest stored times are drawn besides the maximum. Default: up to three.

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
    >>> from uqmbd.results import PolynomialChaos, labels, propagator_node
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(1, 0.1))]))
    >>> axes = labels([("x", "m")], ["k"], [0.0, 1.0])
    >>> chaos = PolynomialChaos([[[1.0, 1.0]], [[0.0, 0.8]], [[0.0, 0.6]]], [[0], [1], [2]], space, axes)
    >>> node = propagator_node("mine", chaos.statistics(), propagator="p", realisations=3, wall_time=0.0,
    ...                        children={"chaos": chaos.to_dataset()})
    >>> figure = coefficient_decay(node, "x", times=[])
    >>> figure.axes[0].lines[0].get_ydata().round(3).tolist()
    [0.8, 0.6]
    """
    found = coefficient_parts(results, output, times=times)
    figure, grid = axes_grid(2, 2.2)
    by_order, by_input = grid
    if found is None:
        return _nothing(figure, grid, "no spread")
    handles: dict[str, Any] = {}
    for n, (name, values) in enumerate(found.at_times.items()):
        (handles[name],) = _curve(by_order, values, color=("0.75", "0.6", "0.45")[n % 3], marker=_MARKERS[n % 6])
    (handles[LARGEST],) = _curve(by_order, found.largest, color="black", marker="o", lw=2.2)
    handles |= _draw_inputs(by_input, found)
    for axes, title in zip(grid, ("total order", "degree in one input"), strict=True):
        handles["1 %"] = axes.axhline(LIMIT, color="black", lw=0.8, ls=(0, (2, 2)), zorder=1)
        axes.set_xlabel(title)
    by_order.set_ylabel("part of the largest std")
    _whole_orders(grid, len(found.largest), found.of_inputs.shape[1])
    for axes in grid:
        log_axis(axes, "y", *found.ends)
        axes.grid(color="0.9", lw=0.7)
    arrange(figure, grid, 2, legend=handles, heights=(1.75,))
    return figure


def _draw_inputs(axes: Axes, found: CoefficientParts) -> dict[str, Any]:
    """Draw a line for each input; of many, those that fall least by name."""
    handles: dict[str, Any] = {}
    rest: dict[str, Any] = {}
    for k in found.others:
        (rest[f"{len(found.others)} others"],) = _curve(axes, found.of_inputs[k], color=_PALE, lw=0.9)
    for n, k in enumerate(found.named):
        colour, line = style(n)
        (drawn,) = _curve(axes, found.of_inputs[k], color=colour, ls=line, marker=_MARKERS[n % 6], ms=4)
        handles[found.inputs[k]] = drawn
    return handles | rest


def _curve(axes: Axes, values: Array, **looks: Any) -> Any:
    """Draw values (N,) over the orders 1 .. N; what is not known is left out."""
    orders = np.arange(1, len(values) + 1)
    used = ~np.isnan(values)
    looks = {"lw": 1.3, "ms": 3.5, "clip_on": False} | looks
    return axes.plot(orders[used], values[used], **looks)


def _whole_orders(grid: Sequence[Axes], *counts: int) -> None:
    from matplotlib.ticker import FixedLocator

    for axes, count in zip(grid, counts, strict=True):
        axes.set_xlim(0.7, max(count, 2) + 0.3)
        axes.xaxis.set_major_locator(FixedLocator(list(range(1, count + 1, -(-count // 8)))))


def _nothing(figure: Figure, grid: Sequence[Axes], words: str) -> Figure:
    for axes in grid:
        axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="0.3")
    arrange(figure, list(grid), len(grid))
    return figure


def horizon(times: Array, error: Array, limit: float = LIMIT) -> float | None:
    """Return the first time at which an error (T,) exceeds a limit; None if it never does.

    Examples
    --------
    >>> import numpy as np
    >>> horizon(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.02, 0.001])), horizon(np.zeros(1), np.zeros(1))
    (1.0, None)
    """
    above = np.flatnonzero(error > limit)
    return float(times[above[0]]) if len(above) else None


class StatedErrors(NamedTuple):
    """What a surrogate states of its own error, as it is drawn.

    Attributes
    ----------
    times : array, shape (T,)
    names : list of str
        Of the outputs.
    errors : array, shape (N, T)
        Relative to the standard deviation; NaN where they are zero but for rounding.
    horizons : list of float or None
        When each exceeds the limit for the first time.
    named, others : list of int
        Outputs with a line of their own, in their order, and those that share one look, the worst first.
    ends : tuple of float
        Between which values an axis shows them and the limit.
    """

    times: Array
    names: list[str]
    errors: Array
    horizons: list[float | None]
    named: list[int]
    others: list[int]
    ends: tuple[float, float]


def stated_errors(results: Results, limit: float = LIMIT) -> StatedErrors:
    """Return what `verification` draws.

    Raises
    ------
    StudyError
        If the propagator states no error.
    """
    node = one_node(results)
    stated = stated_error_of(node)
    if stated is None:
        raise StudyError(
            f"The propagator {label_of(node)!r} states no error of its surrogate; give it verification realisations, "
            "verify=16."
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
        # What is far below the limit needs no room, where there is anything else.
        ends=(max(low, min(1e-4 * limit, 0.1 * high)), max(high, 2 * limit)),
    )


def verification(results: Results, *, limit: float = LIMIT) -> Figure:
    """Draw the error that a surrogate states of itself over time, and when it is no longer to be trusted.

    The error at realisations that did not enter the surrogate, relative to the standard deviation, for each output. A
    dot marks its horizon, where the error passes the limit for the first time; the legend tells when.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        The node of a propagator that states a ``verification_error``. Of several the finest chaos is drawn.
    limit : float
        Relative to the standard deviation.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the propagator states no error.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0, 2.0])
    >>> statistics = statistics_dataset(axes, mean=[[0, 0, 0]], std=[[1, 1, 1]])
    >>> statistics["verification_error"] = (("output", "time"), [[1e-4, 1e-3, 1e-1]])
    >>> node = propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> [text.get_text() for text in verification(node).legends[0].get_texts()]
    ['x: above 1 % at 2 s', 'limit 1 %']
    """
    found = stated_errors(results, limit)
    times, names = found.times, found.names
    figure, grid = axes_grid(1, 2.8, 1)
    axes = grid[0]
    rest: dict[str, Any] = {}
    for k in found.others:
        (rest[f"{len(found.others)} others"],) = axes.plot(times, found.errors[k], color=_PALE, lw=0.8)
    handles: dict[str, Any] = {}
    level = f"{100 * limit:g} %"
    for n, k in enumerate(found.named):
        colour, line = style(n)
        filled = np.nan_to_num(found.errors[k])
        chosen = thinned(filled, filled, 400)
        marker = "o" if len(times) == 1 else ""
        (drawn,) = axes.plot(times[chosen], found.errors[k][chosen], color=colour, ls=line, lw=1.4, marker=marker)
        first = found.horizons[k]
        if first is not None:
            axes.plot([first], [limit], "o", color=colour, ms=7, mec="white", mew=1.0, zorder=4, clip_on=False)
        handles[f"{names[k]}: {f'above {level} at {first:.4g} s' if first is not None else f'below {level}'}"] = drawn
    line = axes.axhline(limit, color="black", lw=1.0, ls=(0, (2, 2)), zorder=1)
    log_axis(axes, "y", *found.ends, percent=True)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("stated error /\nstandard deviation")
    limit_times(axes, times)
    axes.grid(color="0.9", lw=0.7)
    arrange(figure, grid, legend=handles | rest | {f"limit {level}": line}, heights=(2.1,))
    return figure
