"""A chart on paper has what the page has of the same data, and says what it leaves out."""

from __future__ import annotations

import io
import re

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.report import Band, Chart, Curve, chart_figure, chart_html
from uqmbd.report.charts import Axis, Look, Views, checked_chart, draw_on_paper, page_data, unpacked
from uqmbd.report.drawing import svg

TIMES = np.linspace(0, 2, 41)
HOSTILE = "</svg><script>alert(1)</script>\"'&\x00$x_{1}$"


def drawn(values, bands=(), **more):
    """Return the axes of a chart of one curve."""
    return chart_figure(Chart("force", TIMES, [Curve("one", values, bands)], units="N", **more)).axes[0]


def test_a_line_is_where_its_values_are():
    (line,) = drawn(3 * TIMES).lines
    np.testing.assert_array_equal(line.get_data(), [TIMES, 3 * TIMES])


def test_a_band_that_is_not_known_everywhere_has_gaps():
    """Nothing is drawn across a gap."""
    low = np.where((TIMES > 0.5) & (TIMES < 1), np.nan, -1.0)
    (area,) = drawn(np.sin(TIMES), (Band("most", low, low + 3),)).collections
    parts = [path.vertices[:, 0] for path in area.get_paths()]
    assert len(parts) == 2 and parts[0].max() <= 0.5 and parts[1].min() >= 1


def test_limits_are_drawn_or_reported():
    """A near one is a line with its name; one that would flatten the chart is stated in a note."""
    axes = drawn(np.sin(TIMES), limits={"near": 1.5, "far <away>": 1e6})
    said = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert "limit: near (1.5 N)" in said and "outside the chart: limit far <away> (1 × 10⁶ N)" in said
    assert axes.get_ylim()[1] < 3 and 1.5 in [line.get_ydata()[0] for line in axes.lines if len(line.get_ydata())]


@pytest.mark.parametrize("values", [np.full(41, np.nan), np.zeros(41), np.full(41, 1e-300), np.full(41, -1e300)])
def test_what_does_not_vary_is_drawn(values):
    """Constants, nothing that is known, and sizes at the ends of what numbers can be."""
    low, high = drawn(values).get_ylim()
    assert np.isfinite([low, high]).all() and low < high


def test_texts_are_escaped():
    """No name ends the drawing, is mathematics, or holds what no file may."""
    chart = Chart(HOSTILE, TIMES, [Curve(HOSTILE, TIMES), Curve("b", TIMES)], limits={HOSTILE: 1.0})
    source = svg(chart_figure(chart))
    assert source.startswith("data:image/svg+xml;base64,")
    html = chart_html(HOSTILE, TIMES, [Curve(HOSTILE, TIMES)], HOSTILE, HOSTILE)
    assert re.findall(r"<(\w+)", html) == ["figure", "img", "figcaption", "script"]


def test_bars_stand_side_by_side_at_their_categories():
    curves = [Curve(name, [2.0, 1.0], drawn="bars") for name in "ab"]
    axes = chart_figure(Chart("error", ["coarse", "fine"], curves, "t", "%")).axes[0]
    sides = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches)
    assert len(sides) == 4 and all(one[1] <= other[0] for one, other in zip(sides[:-1], sides[1:], strict=True))
    assert [text.get_text() for text in axes.get_xticklabels()] == ["coarse", "fine"]


def test_several_charts_share_a_legend_and_keep_their_axes():
    charts = [Chart(n, TIMES, [Curve("mine", TIMES), Curve("yours", 2 * TIMES)], n, heading=n) for n in ("x", "y")]
    figure = draw_on_paper(Views(charts))
    assert [axes.get_title("right") for axes in figure.axes] == ["x", "y"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mine", "yours"]


NUMBERS = arrays.arrays(float, 12, elements=st.floats(-1e6, 1e6) | st.just(np.nan), fill=st.nothing())


@st.composite
def charts(draw):
    """Draw curves of any kind, with bands, over time or over numbers that may be equal."""
    over = draw(st.booleans())
    steps = draw(arrays.arrays(float, 12, elements=st.floats(0 if over else 0.1, 10)))
    curves = []
    for k in range(draw(st.integers(1, 7))):
        band = Band("b", draw(NUMBERS), draw(NUMBERS), draw(st.booleans()))
        kind = draw(st.sampled_from(["line", "points", "dotted", "filled"]))
        curves.append(Curve(f"c{k}", draw(NUMBERS), (band,) if draw(st.booleans()) else (), drawn=kind))
    levels = draw(st.dictionaries(st.sampled_from(["low", "high"]), st.floats(-1e6, 1e6)))
    return Chart("f", np.cumsum(steps), curves, "t", "N", "x" if over else "", limits=levels)


@pytest.mark.thorough
@settings(max_examples=40, deadline=None)
@given(charts())
def test_the_page_and_paper_have_the_same_values(chart):
    """Each curve is drawn with the values that the page stores, where they are known, and can be written."""
    chart = checked_chart(chart)
    data, figure = page_data(chart), draw_on_paper(chart)
    for method in data["methods"]:
        values, places = unpacked(method["lines"][0]["values"]), unpacked(data["time"])
        known = np.isfinite(values)
        lines = [np.array(line.get_data()) for line in figure.axes[0].lines]
        same = [
            np.array_equal(x[np.isfinite(y)], places[known]) and np.array_equal(y[np.isfinite(y)], values[known])
            for x, y in lines
        ]
        assert any(same)
    figure.savefig(io.BytesIO(), format="png", dpi=30)


def test_marks_in_a_plane_are_at_their_places():
    x, y = np.array([3.0, 1.0, np.nan]), np.array([1.0, 2.0, 3.0])
    marks = Look(shape="square")

    chart = Chart("y", [1.0, 2.0, 3.0], [Curve("a", y, look=marks, places=x)], plane=Axis("x", "m"))
    (line,) = draw_on_paper(chart).axes[0].lines
    assert line.get_linestyle() == "None" and line.get_xydata().tolist() == [[3, 1], [1, 2]]
