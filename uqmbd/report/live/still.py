"""A chart for readers without scripts: an SVG from the data of the page's chart, as `chart_paper.js` makes one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.report.drawing import COLOURS, LETTER, Drawing, shortened
from uqmbd.report.figures import thinned
from uqmbd.report.live.packing import unpacked
from uqmbd.typing import Array
from uqmbd.wording import format_number, format_power, minus, power_of_ten

__all__ = ["still_chart"]

WIDTH, HEIGHT = 560.0, 250.0
"""Points, without the names at the top."""

SIZE, ROW, SAMPLE = 12, 17, 26
"""Of letters, of a row of names, and of the line before a name."""

MOST = 300
"""About how many places are drawn: lines of two points are as wide as some of them; peaks of the first method stay."""

REACH = 2.0
"""How many times the height of what is drawn a limit may be away from it, as in `chart_model.js`."""

STEPS = (1, 2, 5, 10)
"""What ticks are apart, times a power of ten."""


def still_chart(data: Mapping[str, Any]) -> Drawing:
    """Draw a chart of lines over an axis that is linear; of several views that which is seen first.

    Parameters
    ----------
    data : mapping
        Of `bands_data` or `curves_data`, or of several views.
    """
    if "views" in data:
        data = data["views"][data["seen"]]
    places = np.asarray(unpacked(data["time"]), dtype=float)
    values = [_lines(method) for method in data["methods"]]
    low, high = _extremes([line for lines in values for line in lines])
    areas = [band for band in data["methods"][0]["bands"] if not band.get("bars")]
    low_edge, high_edge = (values[0][areas[0][end] if areas else 0] for end in ("low", "high"))
    chosen = thinned(low_edge, high_edge, MOST)
    places, values = places[chosen], [[line[chosen] for line in lines] for lines in values]
    limits, beyond = _limits(data, low, high)
    own = data.get("up") or {}
    ends = _ends(own, min([low, *limits.values()]), max([high, *limits.values()]))
    across = _Axis(float(places[0]), float(places[-1]), 7)
    up = _LogAxis(own["low"], own["high"], 5) if own.get("log") else _Axis(*ends, 5)
    names = _names(data["methods"], limits)
    starts, top = _placed([name for name, _ in names])
    made = Drawing(WIDTH, top + HEIGHT + (ROW if beyond else 0))
    left = 32 + LETTER * SIZE * max(map(len, up.labels), default=1)
    box = _Box(left, top + 8, WIDTH - left - 14, HEIGHT - 52)
    place = data.get("across") or {"name": "time", "units": "s"}
    _grid(made, box, across, up, _named(place, across), _named({"name": data.get("axis", data["output"]), **data}, up))

    inner = Drawing(made.width, made.height)
    x = box.left + box.width * across.share(places)
    for k, (method, lines) in enumerate(zip(data["methods"], values, strict=True)):
        heights = [box.top + box.height * (1 - up.share(line)) for line in lines]
        _draw(inner, method, x, heights, box.top + box.height * (1 - float(up.share(np.zeros(())))), first=k == 0)
    for value in limits.values():
        at = box.top + box.height * (1 - float(up.share(np.asarray(value))))
        inner.line([[box.left, at], [box.left + box.width, at]], "limit", **_LIMIT)
    made.within(box.left, box.top, box.width, box.height, inner)
    _ranges(made, data["methods"], box, x, values, up)

    for (name, looks), (start, down) in zip(names, starts, strict=True):
        made.line([[start, down], [start + SAMPLE, down]], **looks)
        made.text(start + SAMPLE + 6, down + 4, name, font_size=SIZE)
    if beyond:
        words = ", ".join(f"{name} ({format_number(v)} {data['units']}".strip() + ")" for name, v in beyond.items())
        words = f"Too far away to be drawn: the limit of {words}."
        made.text(4, made.height - 5, words, "soft", font_size=SIZE)
    return made


_LIMIT: dict[str, Any] = {"stroke_width": 1.6, "stroke_dasharray": "2 4"}


@dataclass(frozen=True)
class _Box:
    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class _Axis:
    """Ends, ticks, and by which power of ten their labels are divided."""

    low: float
    high: float
    most: int

    def share(self, values: Array) -> Array:
        """Return where values are, from 0 at the low to 1 at the high end."""
        return np.asarray((values - self.low) / ((self.high - self.low) or 1.0))

    @property
    def step(self) -> float:
        """What ticks are apart."""
        rough = (self.high - self.low) / self.most
        power = 10.0 ** math.floor(math.log10(rough)) if rough > 0 else 1.0
        return next((s * power for s in STEPS if s * power >= rough * (1 - 1e-9)), power)

    @property
    def ticks(self) -> list[float]:
        """Values of the ticks."""
        first, last = math.ceil(self.low / self.step - 1e-9), math.floor(self.high / self.step + 1e-9)
        return [k * self.step for k in range(first, last + 1)]

    @property
    def power(self) -> int:
        """Power of ten that labels are divided by."""
        largest = max(abs(self.low), abs(self.high))
        return power_of_ten(largest) if self.high - self.low > 1e-4 * largest else 0

    @property
    def labels(self) -> list[str]:
        """Numbers of the ticks, all with the same decimals."""
        scale = 10.0**self.power
        decimals = max(0, -math.floor(math.log10(self.step / scale) + 1e-9))
        return [minus(f"{tick / scale + 0.0:.{decimals}f}") for tick in self.ticks]


@dataclass(frozen=True)
class _LogAxis(_Axis):
    """A logarithmic one between powers of ten, with a tick at some of them."""

    def share(self, values: Array) -> Array:
        """Return where values are; what is not above zero is nowhere."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.log(np.where(values > 0, values, np.nan) / self.low) / np.log(self.high / self.low)
        return np.asarray(found)

    @property
    def ticks(self) -> list[float]:
        """Values of the ticks: powers of ten, the highest is one."""
        first, last = (round(math.log10(end)) for end in (self.low, self.high))
        step = -(-(last - first) // self.most)
        return [float(f"1e{k}") for k in range(last, first - 1, -step)][::-1]

    @property
    def power(self) -> int:
        """Labels are not divided."""
        return 0

    @property
    def labels(self) -> list[str]:
        """Powers of ten, small and large ones as such."""
        return [format_number(tick).removeprefix("1 × ") for tick in self.ticks]


def _lines(method: Mapping[str, Any]) -> list[Array]:
    """Return what a method draws: the first line, and the others, which are stored as distances from it."""
    first, *others = (np.asarray(unpacked(line["values"]), dtype=float) for line in method["lines"])
    return [first, *(np.nan_to_num(first) + away for away in others)]


def _extremes(lines: Sequence[Array]) -> tuple[float, float]:
    every = np.concatenate(lines)
    every = every[np.isfinite(every)]
    return (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)


def _limits(data: Mapping[str, Any], low: float, high: float) -> tuple[dict[str, float], dict[str, float]]:
    """Return the limits that are drawn, and those that would leave a flat line."""
    every = {one["name"]: float(one["value"]) for one in data.get("limits", ())}
    far = {n for n, v in every.items() if high > low and max(v - high, low - v) > REACH * (high - low)}
    return {n: v for n, v in every.items() if n not in far}, {n: v for n, v in every.items() if n in far}


def _ends(own: Mapping[str, float], low: float, high: float) -> tuple[float, float]:
    """Return the ends of the vertical axis: with some room, and not beyond where the data end it."""
    largest = max(abs(low), abs(high))
    room = 0.05 * (high - low) if high - low > 1e-9 * largest else 0.05 * largest or 0.5
    first, last = max(low - room, own.get("low", -math.inf)), min(high + room, own.get("high", math.inf))
    return (first, last) if first < last else (low - room, high + room)


def _named(what: Mapping[str, Any], axis: _Axis) -> str:
    units = f" [{what['units']}]" if what["units"] else ""
    return shortened(f"{what['name']}{units}") + (f" × {format_power(axis.power)}" if axis.power else "")


def _names(methods: Sequence[Mapping[str, Any]], limits: Mapping[str, float]) -> list[tuple[str, dict[str, Any]]]:
    """Return what the signs mean, with how the line before each is drawn."""
    found: list[tuple[str, dict[str, Any]]] = []
    for k, method in enumerate(methods):
        label = method["label"] if len(methods) > 1 else method["lines"][0]["name"]
        found.append((shortened(label), _stroke(method)))
        if k == 0:
            for depth, band in enumerate(method["bands"]):
                if band.get("bars"):
                    continue
                area = {"stroke_width": 9, "stroke_opacity": _opacity(depth), "stroke_linecap": "butt"}
                found.append((band["name"], {"stroke": _role(method), **area}))
    return found + [(f"limit: {shortened(name)}", {"stroke": "limit", **_LIMIT}) for name in limits]


def _placed(names: Sequence[str]) -> tuple[list[tuple[float, float]], float]:
    """Return where the names stand, row by row, and the height of all rows."""
    places: list[tuple[float, float]] = []
    across, down = 4.0, 0.6 * ROW
    for name in names:
        wide = SAMPLE + 6 + LETTER * SIZE * len(name) + 16
        if across > 4 and across + wide > WIDTH:
            across, down = 4.0, down + ROW
        places.append((across, down))
        across += wide
    return places, down + 0.4 * ROW


def _grid(made: Drawing, box: _Box, across: _Axis, up: _Axis, foot: str, side: str) -> None:
    """Draw the axes: lines at ticks, their numbers, and what the axes are."""
    bottom = box.top + box.height
    for value, label in zip(up.ticks, up.labels, strict=True):
        at = round(bottom - box.height * float(up.share(np.asarray(value))), 1)
        made.line([[box.left - 4, at], [box.left + box.width, at]], "grid")
        made.text(box.left - 7, at + 4, label, "soft", font_size=SIZE, text_anchor="end")
    for value, label in zip(across.ticks, across.labels, strict=True):
        at = round(box.left + box.width * float(across.share(np.asarray(value))), 1)
        made.line([[at, box.top], [at, bottom + 4]], "grid")
        made.text(at, bottom + 17, label, "soft", font_size=SIZE, text_anchor="middle")
    made.text(box.left + box.width / 2, bottom + 36, foot, font_size=SIZE, text_anchor="middle")
    letters = min(float(SIZE), box.height / (LETTER * len(side)))
    middle = round(box.top + box.height / 2, 1)
    turned = f"rotate(-90 13 {middle:g})"
    made.text(13, middle, side, font_size=f"{letters:.1f}", text_anchor="middle", transform=turned)


def _draw(
    made: Drawing, method: Mapping[str, Any], x: Array, heights: Sequence[Array], zero: float, *, first: bool
) -> None:
    """Draw the line of a method, and its bands: areas of the first method, the outer ends of others."""
    for depth, band in enumerate(method["bands"]):
        if band.get("bars"):
            continue
        ends = heights[band["low"]], heights[band["high"]]
        if first:
            _area(made, x, ends, _role(method), _opacity(depth))
        elif depth == 0:
            for end in ends:
                made.line(np.column_stack([x, end]), **_stroke(method, 0.6))
    if method.get("filled"):
        _area(made, x, (heights[0], np.full(len(x), zero)), _role(method), _opacity(0))
    made.line(np.column_stack([x, heights[0]]), **_stroke(method))


def _ranges(
    made: Drawing,
    methods: Sequence[Mapping[str, Any]],
    box: _Box,
    x: Array,
    values: Sequence[Sequence[Array]],
    up: _Axis,
) -> None:
    """Draw ranges at places as bars, those of several methods beside one another."""
    some = [(k, band) for k, method in enumerate(methods) for band in method["bands"] if band.get("bars")]
    for number, (k, band) in enumerate(some):
        shares = [np.clip(np.nan_to_num(up.share(values[k][band[end]])), 0.0, 1.0) for end in ("low", "high")]
        for j in np.flatnonzero(np.isfinite(values[k][band["low"]]) & np.isfinite(values[k][band["high"]])):
            at = float(x[j]) + 6 * (number - (len(some) - 1) / 2)
            places = [[at, box.top + box.height * (1 - float(share[j]))] for share in shares]
            made.line(places, _role(methods[k]), stroke_width=3, stroke_linecap="butt")


def _area(made: Drawing, x: Array, ends: tuple[Array, Array], role: str, opacity: float) -> None:
    """Draw what is between two curves, wherever both are known."""
    known = np.isfinite(ends[0]) & np.isfinite(ends[1])
    turns = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    for start, stop in turns.reshape(-1, 2):
        low, high = (np.column_stack([x, end])[start:stop] for end in ends)
        made.line(np.concatenate([low, high[::-1]]), None, role, closed=True, fill_opacity=opacity)


def _opacity(depth: int) -> float:
    return 0.16 if depth == 0 else 0.3


def _stroke(method: Mapping[str, Any], share: float = 1.0) -> dict[str, Any]:
    width = share * method["width"]
    dashes = " ".join(f"{length * width:.3g}" for length in method["dash"]) or None
    return {
        "stroke": _role(method),
        "stroke_width": f"{width:.3g}",
        "stroke_dasharray": dashes,
        "stroke_linecap": "butt",
    }


def _role(method: Mapping[str, Any]) -> str:
    light = str(method["colours"][0])
    return f"c{COLOURS.index(light)}" if light in COLOURS else light
