"""What all figures share: size, colours, axes, legends, and labels that show names as they were written."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

__all__ = [
    "COLOURS",
    "axes_grid",
    "draw_histogram",
    "legend_above",
    "limit_times",
    "single_axes",
    "style",
    "widen_if_constant",
    "wrapped",
]

# Okabe and Ito's colours: distinguishable with every common colour vision, and by their line style in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#000000")
LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)), (0, (9, 3)))
_SUPERSCRIPTS = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
WIDTH = 5.6  # inches: legible at its own size, and still when a phone shrinks it


def style(k: int) -> tuple[str, Any]:
    """Return colour and line style of the k-th method."""
    return COLOURS[k % len(COLOURS)], LINES[k % len(LINES)]


def _layout() -> ConstrainedLayoutEngine:
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    return ConstrainedLayoutEngine(h_pad=0.07, w_pad=0.07)


def single_axes(height: float) -> tuple[Figure, Axes]:
    """Return a figure of some height (inches) with one pair of axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout=_layout())
    axes = figure.add_subplot()
    _dress(axes)
    axes.grid(color="0.9", lw=0.7)
    return figure, axes


def axes_grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with ``count`` axes in at most two columns, each row of some height (inches)."""
    from matplotlib.figure import Figure

    columns = min(count, 2)
    rows = -(-count // columns)
    figure = Figure(figsize=(WIDTH, max(height * rows + 0.3, 2.2)), layout=_layout())
    grid = [figure.add_subplot(rows, columns, k + 1) for k in range(count)]
    for axes in grid:
        _dress(axes)
    return figure, grid


def _dress(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    class PlainFormatter(ScalarFormatter):
        # Powers of ten without mathtext, which takes most of the time of a figure.
        def get_offset(self) -> str:
            return with_powers(super().get_offset())

    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
    for axis in (axes.xaxis, axes.yaxis):
        formatter = PlainFormatter(useMathText=False)
        formatter.set_powerlimits((-3, 4))
        axis.set_major_formatter(formatter)
        axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
        axis.get_offset_text().set_fontsize(9)


def with_powers(offset: str) -> str:
    """Write the factor and offset of an axis with powers of ten.

    Parameters
    ----------
    offset : str
        As Matplotlib writes it.

    Returns
    -------
    str

    Examples
    --------
    >>> with_powers("1e5"), with_powers("1e-7+1.5e3"), with_powers("+2.5"), with_powers("")
    ('× 10⁵', '× 10⁻⁷ +1.5 × 10³', '+2.5', '')
    """

    def power(found: re.Match[str]) -> str:
        sign, mantissa, exponent = found.groups()
        raised = "10" + exponent.replace("+", "").translate(_SUPERSCRIPTS)
        if not sign:
            return f"× {raised}"
        return f" {sign}{raised}" if mantissa == "1" else f" {sign}{mantissa} × {raised}"

    return re.sub(r"([+\-−]?)(\d[\d.]*)e([+\-−]?\d+)", power, offset).strip()


def draw_histogram(axes: Axes, values: NDArray[np.float64], colour: str) -> None:
    """Draw a histogram of values, shape (S,); a constant is one bar that says so."""
    from matplotlib.ticker import MaxNLocator

    low, high = float(values.min()), float(values.max())
    if _is_constant(low, high):
        axes.hist(values, bins=[*_around(low, high, 0.04)], color=colour, alpha=0.8)
        axes.text(0.97, 0.95, "no spread", transform=axes.transAxes, ha="right", va="top", fontsize=9, color="0.3")
        widen_if_constant(axes, "x", low, high)
    else:
        edges = np.histogram_bin_edges(values, "auto")
        if len(edges) > 61:
            edges = np.linspace(low, high, 61)
        axes.hist(values, bins=edges.tolist(), color=colour, alpha=0.8, edgecolor="white", lw=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))


def _is_constant(low: float, high: float) -> bool:
    return high - low <= 1e-9 * max(abs(low), abs(high))


def _around(low: float, high: float, share: float) -> tuple[float, float]:
    centre = (low + high) / 2
    reach = share * (abs(centre) or 1.0)
    return centre - reach, centre + reach


def widen_if_constant(axes: Axes, direction: str, low: float, high: float) -> None:
    """Show a constant as a constant: never magnify rounding to full height."""
    if not _is_constant(low, high):
        return
    ends = _around(low, high, 0.5)
    if direction == "x":
        axes.set_xlim(*ends)
    else:
        axes.set_ylim(*ends)


def limit_times(axes: Axes, times: NDArray[np.float64]) -> None:
    """Let the time axis end where the data ends."""
    if len(times) > 1:
        axes.set_xlim(times[0], times[-1])


def legend_above(figure: Figure, handles: Mapping[str, Any]) -> None:
    """Put a legend above the axes, in as many columns as fit."""
    names = [_shortened(name) for name in handles]
    columns = len(names)
    while columns > 1 and _legend_width(names, columns) > 72 * WIDTH - 10:
        columns -= 1
    legend = figure.legend(
        list(handles.values()), names, loc="outside upper left", ncols=columns, frameon=False, fontsize=9
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def _legend_width(names: Sequence[str], columns: int) -> float:
    """Estimate the width in points: the columns are filled one after the other, as Matplotlib does."""
    rows = -(-len(names) // columns)
    return sum(5.2 * max(map(len, names[k : k + rows])) + 42 for k in range(0, len(names), rows))


def wrapped(text: str, width: int) -> str:
    """Break a long name into lines and take the special meaning from its dollar signs."""
    lines = textwrap.wrap(text, width) or [text]
    return "\n".join(lines).replace("$", r"\$")


def _shortened(text: str) -> str:
    return text if len(text) <= 60 else text[:58] + " …"
