"""Drawings for readers without scripts: their colours, and their scale."""

from __future__ import annotations

import re
from importlib.resources import files

import numpy as np
import pytest

from uqmbd.report.drawing import ROLES, Drawing
from uqmbd.report.mechanisms.sheet import sheet_for


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
