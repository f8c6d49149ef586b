"""Small SVG drawings as text: lines, areas and texts, in colours of the theme of the page.

This module replaces Matplotlib for the drawings of mechanisms, which are visible without scripts. The import of
Matplotlib takes 0.3 s and a drawing 0.1 to 0.2 s. Drawings of this module take about 10 ms and have a dark mode.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from uqmbd.report.drawing.style import COLOURS, FAILED, ON_DARK
from uqmbd.typing import Array

__all__ = ["DARK_STYLE", "GROUND", "LETTER", "PALE", "ROLES", "UNWRITABLE", "Drawing", "mixed"]

GROUND = "#737373"
"""Colour of the ground of a mechanism."""

PALE = 0.72
"""Share of the paper colour in the faces of bodies."""

LETTER = 0.56
"""Ratio of the width of a letter to the font size."""

UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML does not allow; texts in results of other packages may contain them."""

_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif"
_PAPER = ("#ffffff", "#14181d")
_INK = ("#1b1f24", "#e6e9ed")


def mixed(colour: str, other: str, share: float) -> str:
    """Mix a colour ``#rrggbb`` with a share of another colour.

    >>> mixed("#000000", "#ffffff", 0.2)
    '#333333'
    """
    pairs = ((int(colour[k : k + 2], 16), int(other[k : k + 2], 16)) for k in (1, 3, 5))
    return "#" + "".join(f"{round((1 - share) * a + share * b):02x}" for a, b in pairs)


def _between(pair: tuple[str, str], share: float) -> tuple[str, str]:
    return mixed(pair[0], _PAPER[0], share), mixed(pair[1], _PAPER[1], share)


_SOLID = {
    "ink": _INK,
    "dark": _between(_INK, 0.2),
    "plate": _between(_INK, 0.92),
    "paper": _PAPER,
    "soft": ("#57606a", "#a3adb8"),
    "grid": ("#e3e7ec", "#333b44"),
    "limit": (FAILED, "#ff6b81"),
    "drive": ("#b45309", "#f0a04b"),
    "ground": (GROUND, "#9aa2ab"),
    **{f"c{k}": pair for k, pair in enumerate(zip(COLOURS, ON_DARK, strict=True))},
}

ROLES = _SOLID | {f"pale-{name}": _between(pair, PALE) for name, pair in _SOLID.items() if name[0] in "cg"}
"""Roles of colours, with the colour on a light and on a dark page; `colours.js` contains the colours of the page."""

DARK_STYLE = "".join(
    f".still .s-{role} {{ stroke: {dark}; }} .still .f-{role} {{ fill: {dark}; }}\n"
    for role, (_, dark) in ROLES.items()
)
"""CSS of drawings on a dark page; without this CSS they have the colours of a light page."""


@dataclass(frozen=True)
class Drawing:
    """SVG drawing of `width` times `height` points.

    Positions are in points from the upper left corner. Colours are names of `ROLES` or ``#rrggbb``.

    >>> drawing = Drawing(100, 50)
    >>> drawing.line([[0, 0], [10, 5.04]], "c0")
    >>> drawing.inline("A line.").endswith('<path fill="none" stroke="#0072B2" class="s-c0" d="M0 0 10 5"/></svg>')
    True
    """

    width: float
    height: float
    parts: list[str] = field(default_factory=list)

    def line(
        self, points: Any, stroke: str | None, fill: str | None = None, *, closed: bool = False, **looks: object
    ) -> None:
        """Draw a line or area through points (N, 2), interrupted at NaN; `looks` are further SVG attributes."""
        data = path_data(np.asarray(points, dtype=float), closed=closed)
        if data:
            self.parts.append(f'<path{_paint(stroke, fill)}{_attributes(looks)} d="{data}"/>')

    def text(self, x: float, y: float, words: str, colour: str = "ink", **looks: object) -> None:
        """Write a text at a position, aligned by ``text_anchor``."""
        plain = escape(UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", words))
        self.parts.append(f'<text{_fill(colour)} x="{x:g}" y="{y:g}"{_attributes(looks)}>{plain}</text>')

    def within(self, left: float, top: float, width: float, height: float, inner: Drawing) -> None:
        """Add another drawing with the same coordinates, clipped to a box."""
        box = f"{left:g} {top:g} {width:g} {height:g}"
        place = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
        self.parts.append(f'<svg {place} viewBox="{box}">{"".join(inner.parts)}</svg>')

    def inline(self, described: str) -> str:
        """Return an SVG element for a page."""
        text = escape(UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", described))
        return f'<svg class="still" role="img" aria-label="{text}"{self._inner()}'

    def source(self) -> str:
        """Return the data URI of the drawing in the colours of a light page."""
        text = f'<svg xmlns="http://www.w3.org/2000/svg" font-family="{_FONT}"{self._inner()}'
        return "data:image/svg+xml;base64," + base64.b64encode(text.encode("utf-8", "replace")).decode("ascii")

    def _inner(self) -> str:
        size = f'viewBox="0 0 {self.width:g} {self.height:g}" width="{self.width:g}" height="{self.height:g}"'
        joined = 'stroke-linejoin="round" stroke-linecap="round"'
        return f" {size} {joined}>{''.join(self.parts)}</svg>"


def path_data(points: Array, *, closed: bool = False) -> str:
    """Return SVG path data with a resolution of 0.1 points; isolated points between NaN are omitted.

    >>> path_data(np.array([[0, 0], [1, 2.04], [np.nan, 1], [3, 3], [4, 3]]))
    'M0 0 1 2M3 3 4 3'
    >>> path_data(np.array([[0, 0], [1, 0], [0, 1]]), closed=True)
    'M0 0 1 0 0 1Z'
    """
    known = np.isfinite(points).all(axis=-1)
    if known.all():
        runs: Sequence[Array] = [points]
    else:
        ends = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
        runs = [points[a:b] for a, b in ends.reshape(-1, 2)]
    end = "Z" if closed else ""
    written = (" ".join(map("%.6g".__mod__, (np.round(run, 1) + 0.0).ravel().tolist())) for run in runs if len(run) > 1)
    return "".join(f"M{one}{end}" for one in written)


def _paint(stroke: str | None, fill: str | None) -> str:
    classes = [f"{kind}-{role}" for kind, role in (("s", stroke), ("f", fill)) if role in ROLES]
    shown = f' fill="{_plain(fill)}"' + ("" if stroke is None else f' stroke="{_plain(stroke)}"')
    return shown + (f' class="{" ".join(classes)}"' if classes else "")


def _fill(role: str) -> str:
    return f' fill="{_plain(role)}" class="f-{role}"'


def _plain(role: str | None) -> str:
    return "none" if role is None else ROLES[role][0] if role in ROLES else role


def _attributes(looks: dict[str, object]) -> str:
    return "".join(f' {name.replace("_", "-")}="{value}"' for name, value in looks.items() if value is not None)
