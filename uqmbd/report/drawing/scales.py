"""Scales of axes: numbers with powers of ten, and logarithmic axes."""

from __future__ import annotations

import functools
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.wording import format_integer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["across_axis", "decades", "log_axis", "plain_formatter", "with_powers"]

_SUPERSCRIPTS = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@functools.cache
def plain_formatter() -> Any:
    """Return the formatter class for plain numbers."""
    from matplotlib.ticker import ScalarFormatter

    class PlainFormatter(ScalarFormatter):
        # powers of ten without mathtext, which would take most of the time of a figure
        def get_offset(self) -> str:
            return with_powers(super().get_offset())

    return PlainFormatter


def with_powers(offset: str) -> str:
    """Return the factor and offset of an axis, as Matplotlib writes them in `offset`, with powers of ten.

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


def decades(low: float, high: float) -> tuple[int, int]:
    """Return the ends of a logarithmic axis that shows two values: powers of ten, at least one decade apart.

    >>> decades(3e-4, 0.2), decades(1.0, 1.0)
    ((-4, 0), (0, 1))
    """
    first, last = int(np.floor(np.log10(low) + 1e-9)), int(np.ceil(np.log10(high) - 1e-9))
    return first, max(last, first + 1)


def log_axis(axes: Axes, direction: str, low: float, high: float) -> None:
    """Make an axis logarithmic, with ends at full decades and ticks at every decade, every second decade, ...

    `low` and `high` are the smallest and largest value that must be visible; both are above zero.

    >>> from matplotlib.figure import Figure
    >>> axes = Figure().add_subplot()
    >>> log_axis(axes, "y", 3e-4, 20)
    >>> axes.yaxis.get_major_formatter().format_ticks(axes.get_yticks())
    ['10⁻⁴', '0.01', '1', '100']
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    first, last = decades(low, high)
    axis: Any = axes.xaxis if direction == "x" else axes.yaxis
    # the ends are set first: otherwise Matplotlib chooses ends, and warns if all values are equal
    (axes.set_xlim if direction == "x" else axes.set_ylim)(10.0**first, 10.0**last)
    (axes.set_xscale if direction == "x" else axes.set_yscale)("log")
    step = -(-(last - first) // 5)
    axis.set_major_locator(FixedLocator([10.0**k for k in range(last, first - 1, -step)][::-1]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: _power(value)))


def _power(value: float) -> str:
    exponent = round(float(np.log10(value)))
    return f"{10.0**exponent:g}" if -3 <= exponent <= 3 else "10" + str(exponent).translate(_SUPERSCRIPTS)


def across_axis(axes: Axes, low: float, high: float, *, log: bool, whole: bool) -> None:
    """Set the ends and the ticks of the horizontal axis; logarithmic axes have ticks at 1, 2, 5, 10."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

    if log and high > low:
        axes.set_xlim(low, high)
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        steps = [m * 10.0**k for k in range(-15, 16) for m in ((1, 2, 5) if high < 200 * low else (1,))]
        axes.xaxis.set_major_locator(FixedLocator([s for s in steps if low * (1 - 1e-9) <= s <= high * (1 + 1e-9)]))
    else:
        axes.set_xlim(low - 0.3, high + 0.3)
        axes.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_integer(value) if whole else f"{value:g}"))
