"""Drawings for readers without scripts: what is where, texts that are escaped, and colours that the page has."""

from __future__ import annotations

import re
from importlib.resources import files

import numpy as np
import pytest

from uqmbd.report import Band, Curve
from uqmbd.report.drawing import ROLES, Drawing
from uqmbd.report.live import still_chart
from uqmbd.report.live.chart_data import curves_data
from uqmbd.report.mechanisms.sheet import sheet_for

TIMES = np.linspace(0, 2, 41)
HOSTILE = "</svg><script>alert(1)</script>\"'&\x00"


def numbers(path):
    return np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2)


def drawn(values, bands=(), **more):
    data, _ = curves_data("force", TIMES, [Curve("one", values, bands)], "N")
    return "".join(still_chart(data | more).parts)


def test_a_line_is_where_its_values_are():
    """A straight line stays one, from corner to corner of the values' box, upwards where it grows."""
    lines = re.findall(r'class="s-c0"[^>]* d="([^"]+)"', drawn(3 * TIMES))
    points = numbers(max(lines, key=len))
    assert len(points) == len(TIMES) and np.all(np.diff(points[:, 0]) > 0) and np.all(np.diff(points[:, 1]) < 0)
    np.testing.assert_allclose(np.diff(points, n=2, axis=0), 0, atol=0.21)


def test_ticks_are_where_they_say():
    """Numbers at the horizontal axis are at the places of their times."""
    found = re.findall(r'x="([\d.]+)" y="[\d.]+" font-size="12" text-anchor="middle">([\d.]+)<', drawn(TIMES**2))
    at, times = np.array(found, dtype=float).T
    assert times.tolist() == [0, 0.5, 1, 1.5, 2]
    np.testing.assert_allclose(np.diff(at, n=2), 0, atol=0.21)


def test_a_band_that_is_not_known_everywhere_has_gaps():
    """Nothing is drawn across a gap, neither of an area nor of a line."""
    low = np.where((TIMES > 0.5) & (TIMES < 1), np.nan, -1.0)
    parts = drawn(np.sin(TIMES), (Band("most", low, low + 3),))
    assert parts.count('fill-opacity="0.16"') == 2


def test_limits_are_drawn_or_told():
    """A near one is a line with its name; one that would flatten everything is told."""
    limits = [{"name": "near", "value": 1.5}, {"name": "far <away>", "value": 1e6}]
    parts = drawn(np.sin(TIMES), limits=limits)
    assert parts.count('class="s-limit"') == 2 and "limit: near" in parts
    assert "the limit of far &lt;away&gt; (10" in parts.replace("1 × ", "")


@pytest.mark.parametrize("values", [np.full(41, np.nan), np.zeros(41), np.full(41, 1e-300), np.full(41, -1e300)])
def test_what_does_not_vary_is_drawn(values):
    """Constants, nothing that is known, and sizes at the ends of what numbers can be."""
    assert "nan" not in drawn(values) and "inf" not in drawn(values)


def test_texts_are_escaped():
    """No name ends the drawing, and none holds what no file may."""
    data, _ = curves_data(HOSTILE, TIMES, [Curve(HOSTILE, TIMES), Curve("b", TIMES)], "N")
    page = still_chart(data | {"limits": [{"name": HOSTILE, "value": 1.0}]}).inline(HOSTILE)
    assert page.count("<svg") == page.count("</svg>") == 2 and "<script" not in page and "\x00" not in page


def test_colours_are_those_of_the_page():
    """Inks and papers of drawings are those that scripts draw with."""
    script = files("uqmbd.report.live").joinpath("colours.js").read_text(encoding="utf-8")
    for name in ("ink", "soft", "paper", "grid", "limit"):
        assert [pair.lower() for pair in ROLES[name]] == re.findall(rf'{name}: "(#\w+)"', script)


def test_a_colour_that_is_no_role_stays():
    drawing = Drawing(10, 10)
    drawing.line([[0, 0], [1, 1]], "#123456")
    assert 'stroke="#123456"' in drawing.parts[0] and "class" not in drawing.parts[0]


def test_a_sheet_in_space_has_one_scale():
    """Of an orthographic view, the squares of the projected unit vectors add up to two, over the scale."""
    sheet = sheet_for(np.array([[0, 0, 0], [3, 1, 0.2]]), 6.4, 4.6)
    ends = sheet.project(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    assert np.sum((ends[1:] - ends[0]) ** 2) * sheet.unit**2 == pytest.approx(2)
