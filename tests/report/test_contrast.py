"""Contrast of text and lines with what is behind them, by WCAG 2.2, on light and on dark pages."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest

from uqmbd.report.charts.model import QUIET
from uqmbd.report.drawing import COLOURS, ON_DARK, ROLES

TEXT, LINE = 4.5, 3.0
"""Least ratios of WCAG 2.2: of text (1.4.3, AA), and of lines, marks and signs (1.4.11)."""

TEXTS = [("ink", "paper"), ("ink", "tint"), ("ink", "bad-tint"), ("ink", "fine-tint")] + [
    (name, "paper") for name in ("soft", "accent", "bad", "fine", "warn")
]
"""Colours of texts of the style sheet, and what is behind them."""


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour such as #fff or #0b5c94."""
    digits = colour.removeprefix("#")
    digits = "".join(2 * digit for digit in digits) if len(digits) == 3 else digits
    parts = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    red, green, blue = (x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    """Return the ratio of contrast, from 1 to 21."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def colours(theme: str) -> dict[str, str]:
    """Return the colours of the style sheet of pages and notebooks, by name."""
    sheet = files("uqmbd.report.sections").joinpath("templates/charts.css.j2").read_text(encoding="utf-8")
    part = sheet[sheet.index(f"macro {theme}()") :]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-fA-F]{3,6});", part[: part.index("endmacro")]))


def test_the_ratio_is_that_of_the_recommendation() -> None:
    """Black on white is 21, a colour on itself 1, and #777777 on white the well-known 4.48, just too little."""
    assert contrast("#000", "#ffffff") == pytest.approx(21)
    assert contrast("#123456", "#123456") == 1
    assert contrast("#777777", "#fff") == pytest.approx(4.48, abs=0.005)


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("text", "behind"), TEXTS)
def test_texts_can_be_read(theme: str, text: str, behind: str) -> None:
    """Every text colour of the style sheet, on each ground on which it stands."""
    known = colours(theme)
    assert contrast(known[text], known[behind]) >= TEXT


@pytest.mark.parametrize(("theme", "series", "place"), [("light", COLOURS, 0), ("dark", ON_DARK, 1)])
def test_lines_and_marks_of_charts_can_be_seen(theme: str, series: list[str], place: int) -> None:
    """All colours of series, the quiet one, limits and inks of drawings."""
    paper = colours(theme)["paper"]
    drawn = [*series, QUIET[place], *(ROLES[name][place] for name in ("ink", "soft", "limit"))]
    assert {colour: contrast(colour, paper) for colour in drawn if contrast(colour, paper) < LINE} == {}
