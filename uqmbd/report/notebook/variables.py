"""Notebook view of a random variable: distribution, units, mean, central interval and density."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.report.drawing import Drawing
from uqmbd.report.notebook.charts import noted
from uqmbd.report.notebook.objects import page, table
from uqmbd.typing import Array
from uqmbd.wording import format_power, minus, typeset_units

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace, RandomVariable

__all__ = ["variable_html"]

WIDTH, HEIGHT = 260.0, 110.0
"""Width and height of the picture, points."""

MARGIN, BASE = 34.0, 84.0
"""Horizontal margin of the density, and distance of the axis from the top, points."""

ENDS = (0.025, 0.975)
"""Probabilities at the ends of the interval."""

SAMPLES = 4096
"""Number of realisations of a variable without a closed-form density."""

CERTAIN = 1e-12
"""Density relative to its maximum below which values are not drawn."""


def variable_html(variable: RandomVariable) -> str:
    """Return the distribution, units, mean and central interval of a random variable, next to its density."""
    units = typeset_units(variable.units)
    facts = [("distribution", variable.description), ("units", units or "not stated")]
    drawn = noted("The density cannot be drawn", lambda: _picture(variable, facts))
    return page(f"{variable.name} – random variable", table("", ("random variable", ""), facts), drawn)


def _picture(variable: RandomVariable, facts: list[tuple[str, str]]) -> str:
    """Return the density as an image, and add the mean and the central interval to the facts."""
    from uqmbd.randomness import GermSpace, JointInput

    x, below, f = _distribution(GermSpace.of(JointInput.of([variable])), variable.name)
    ends = [
        float(x[min(int(np.searchsorted(below, p)), len(x) - 1)] if f is None else np.interp(p, below, x)) for p in ENDS
    ]
    units = typeset_units(variable.units)
    numbers = [variable.mean, *ends]
    mean, low, high = _written(numbers, ends[1] - ends[0])
    suffix = f" {units}" if units else ""
    facts += [("mean", f"{mean}{suffix}"), ("95 % of the values", f"{low} to {high}{suffix}")]
    alt = escape(
        f"Density of {variable.name}: mean {mean}, 95 % of the values from {low} to {high}{suffix}.", quote=True
    )
    source = _drawn(x, below, f, numbers, (mean, low, high)).source()
    return f'<img src="{source}" alt="{alt}" style="max-width:100%;background:#fff">'


def _written(numbers: list[float], width: float) -> tuple[str, ...]:
    """Return numbers as texts with a resolution of at least one hundredth of `width`."""
    largest = max(map(abs, numbers))
    power = 0 if largest == 0 or 1e-3 <= largest < 1e5 else math.floor(math.log10(largest))
    scaled = (width or largest or 1.0) / 10.0**power
    decimals = min(max(2 - math.floor(math.log10(scaled)), 0), 14)
    tail = f" × {format_power(power)}" if power else ""
    return tuple(minus(f"{x / 10.0**power:.{decimals}f}") + tail for x in numbers)


def _distribution(space: GermSpace, name: str) -> tuple[Array, Array, Array | None]:
    """Return values (N,), their cumulative probabilities, and their density, which is None for discrete values."""
    from uqmbd.report.figures import density, known_densities

    column = list(space.inputs).index(name)
    if name in (known := known_densities(space)):
        x, f = known[name]
        order = np.argsort(x)
        x, f = x[order], f[order]
    else:
        germ = space.germs[column] if column < len(space.germs) else None
        if germ is not None and germ.values is not None and germ.table is not None and len(space.germs) == 1:
            levels, values = (np.asarray(part, dtype=float) for part in germ.table)
            return space.to_inputs(values[:, None])[:, column], levels, None
        uniform = np.random.default_rng(0).random((SAMPLES, len(space.germs)))
        samples = space.to_inputs(space.from_uniform(uniform))[:, column]
        found = density(samples)
        if found is None or len(np.unique(samples)) < SAMPLES // 10:
            values, counts = np.unique(samples, return_counts=True)
            return values, np.cumsum(counts) / SAMPLES, None
        x, f = found
        # use the realisations for probabilities, because kernels widen the tails of the density
        return x, np.searchsorted(np.sort(samples), x, side="right") / SAMPLES, f
    steps = np.concatenate([[0.0], np.cumsum(np.diff(x) * (f[1:] + f[:-1]) / 2)])
    return x, steps / steps[-1], f


def _drawn(x: Array, below: Array, f: Array | None, numbers: list[float], texts: tuple[str, ...]) -> Drawing:
    """Draw a density, or bars of single values, above an axis with the mean and the ends of the interval."""
    drawing = Drawing(WIDTH, HEIGHT)
    if f is not None:
        seen = f > CERTAIN * f.max()
        x, f = x[seen], f[seen]
    room = 0.5 * float(np.diff(x).min()) if f is None and len(x) > 1 else 0.0
    first, last = float(x[0]) - room, float(x[-1]) + room
    first, last = (first, last) if last > first else (first - 0.5, last + 0.5)

    def across(values: Array | list[float]) -> Array:
        return MARGIN + (np.asarray(values) - first) / (last - first) * (WIDTH - 2 * MARGIN)

    if f is None:
        shares = np.diff(below, prepend=0.0)
        tops = BASE - (BASE - 6) * shares / shares.max()
        half = min(max(float(across([first + room])[0] - MARGIN) * 0.8, 0.75), 9.0)
        for place, top in zip(across(x), tops, strict=True):
            corners = [[place - half, BASE], [place - half, top], [place + half, top], [place + half, BASE]]
            drawing.line(corners, "c0", "pale-c0", closed=True)
    else:
        curve = np.column_stack([across(x), BASE - (BASE - 6) * f / f.max()])
        drawing.line([[curve[0, 0], BASE], *curve.tolist(), [curve[-1, 0], BASE]], None, "pale-c0", closed=True)
        drawing.line(curve, "c0", stroke_width=1.5)
    drawing.line([[MARGIN, BASE], [WIDTH - MARGIN, BASE]], "soft")
    places = across(np.array(numbers)).tolist()
    drawing.line([[places[0], 6], [places[0], BASE]], "soft", stroke_dasharray="3 3")
    for place in places:
        drawing.line([[place, BASE], [place, BASE + 4]], "soft")
    rows = (BASE + 15, BASE + 15, BASE + 15) if min(places[0] - places[1], places[2] - places[0]) > 62 else (
        BASE + 25, BASE + 14, BASE + 14)  # fmt: skip
    for place, row, text in zip(places, rows, texts, strict=True):
        middle = min(max(place, 24.0), WIDTH - 24.0)
        drawing.text(middle, row, text, "soft", font_size=9, text_anchor="middle")
    return drawing
