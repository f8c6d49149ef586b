"""Charts of plugins' sections are drawn, told and saved like those of the core, whatever their names are."""

import base64
import csv
import io
import json
import re

import numpy as np
import pytest

from uqmbd import StudyError, extend, report, results
from uqmbd.report import Band, Chart, Curve, chart_html, charts_html
from uqmbd.report.charts import unpacked

from ..test_hostile_names import HOSTILE

TIMES = np.linspace(0, 2, 41)
SIN, COS = np.sin(TIMES), np.cos(TIMES)


def data_of(html):
    """Return the data of the only chart of a fragment."""
    (text,) = re.findall(r'<script type="application/json">(.*?)</script>', html)
    return json.loads(text)


def values(data, curve, line):
    """Return the values of a line; those of bands are stored as the distance from the curve."""
    lines = [unpacked(one["values"]) for one in data["methods"][curve]["lines"]]
    return lines[line] + (np.nan_to_num(lines[0]) if line else 0)


def test_the_data_of_the_page_are_those_that_are_given():
    band = Band("bounds", SIN - 0.1, SIN + 0.3)
    html = chart_html("x", TIMES, [Curve("a", SIN, (band,)), Curve("b", COS)], "alt", "caption", units="m/s^2")
    data = data_of(html)
    assert data["units"] == "m/s²" and [one["label"] for one in data["methods"]] == ["a", "b"]
    np.testing.assert_array_equal(unpacked(data["time"]), TIMES)
    np.testing.assert_array_equal(values(data, 0, 0), SIN)
    np.testing.assert_array_equal(values(data, 1, 0), COS)
    np.testing.assert_allclose(values(data, 0, 1), SIN - 0.1, atol=1e-7)
    np.testing.assert_allclose(values(data, 0, 2), SIN + 0.3, atol=1e-7)


def test_where_only_the_band_is_known_it_is_kept():
    known = np.where(TIMES < 1, SIN, np.nan)
    data = data_of(chart_html("x", TIMES, [Curve("a", known, (Band("b", SIN, COS + 2),))], "", ""))
    np.testing.assert_array_equal(values(data, 0, 0), known)
    np.testing.assert_allclose(values(data, 0, 1), SIN, atol=1e-6)
    np.testing.assert_allclose(values(data, 0, 2), COS + 2, atol=1e-6)


def test_peaks_of_each_of_many_times_are_kept():
    times = np.linspace(0, 1, 30_001)
    low, high = 0 * times, 0 * times
    low[777], high[22_222] = -1, 1
    data = data_of(chart_html("x", times, [Curve("low", low), Curve("high", high)], "", ""))
    assert len(unpacked(data["time"])) <= 1000 and data["of"] == 30_001
    assert values(data, 0, 0).min() == -1 and values(data, 1, 0).max() == 1


@pytest.mark.parametrize(
    ("times", "curves", "told"),
    [
        ([0.0], [Curve("a", [1.0])], "times have the shape (1,); expected two or more"),
        ([0.0, 0.0], [Curve("a", [1.0, 2.0])], "expected two or more finite, increasing numbers"),
        ([0.0, np.nan], [Curve("a", [1.0, 2.0])], "finite, increasing numbers"),
        ([0.0, 1.0], [], "expected a sequence of one or more uqmbd.report.Curve"),
        ([0.0, 1.0], Curve("a", [1.0, 2.0]), "expected a sequence"),
        ([0.0, 1.0], [[1.0, 2.0]], "expected a sequence"),
        ([0.0, 1.0], [Curve("a", [1.0])], "curve 'a' has the shape (1,); expected (2,), as for times"),
        ([0.0, 1.0], [Curve("a", [1.0, np.inf])], "curve 'a' contains an infinity; expected numbers"),
        ([0.0, 1.0], [Curve("a", ["x", "y"])], "expected real numbers"),
        (
            [0.0, 1.0],
            [Curve("a", [1.0, 2.0], (Band("b", [0.0], [1.0, 1.0]),))],
            "the lower end of 'b' of 'a' has the shape (1,)",
        ),
        ([0.0, 1.0], [Curve("a", [1.0, 2.0])] * 2, "a different name for each"),
        ([0.0, 1.0], [Curve(3, [1.0, 2.0])], "expected texts"),
        ([0.0, 1.0], [Curve("a", [1.0, 2.0], (Band("b", [0, 0], [1, 1]),) * 3)], "3 bands; expected at most two"),
    ],
)
def test_what_does_not_fit_together_is_reported(times, curves, told):
    with pytest.raises(StudyError, match=re.escape(told)) as raised:
        chart_html("forces", times, curves, "", "")
    assert str(raised.value).startswith(("chart 'forces'", "chart_html: curves is "))


class Own:
    """A section whose only chart has every hostile name."""

    title = "Own"

    def render(self, tree):
        """Return a chart."""
        names = list(HOSTILE.values())
        curves = [
            Curve(name, SIN + k, (Band(names[k - 1], SIN + k - 0.1, SIN + k + 0.1),), names[k - 2])
            for k, name in enumerate(names)
        ]
        return chart_html(
            HOSTILE["script"], TIMES, curves, HOSTILE["attribute"], HOSTILE["close"], units=HOSTILE["quotes"]
        )


def report_of(section, path):
    """Return the report of a study without histories, so that no other chart is on the page."""
    axes = extend.labels([("x", "m")], [], [1.0])
    statistics = extend.statistics_dataset(axes, mean=[[1.0]], std=[[0.1]])
    node = results.propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)
    return report.write_report(results.study_tree([node], study="s", mechanism="m"), path, sections=[section])


def test_a_page_with_a_plugin_s_chart_alone_has_the_scripts(tmp_path):
    page = report_of(Own(), tmp_path / "report.html").read_text(encoding="utf-8")
    assert "startCharts();" in page

    class Plain:
        title = "Plain"

        def render(self, tree):
            return "<p>no chart</p>"

    assert "startCharts" not in report_of(Plain(), tmp_path / "report.html").read_text(encoding="utf-8")


def test_names_are_data_and_end_no_element():
    html = Own().render(None)
    data = data_of(html)
    assert [one["label"] for one in data["methods"]] == list(HOSTILE.values())
    assert re.findall(r"<(\w+)", html) == ["figure", "img", "figcaption", "script"]


def test_heads_of_tables_and_files_are_plain_texts(node):
    """No head of a column is a formula for programs of tables; heads name what all curves are."""
    curves = [
        Curve("b", SIN, (Band("bounds", SIN - 1, SIN + 1),), "=1+1"),
        Curve("c", COS, (), "=1+1"),
    ]
    data = data_of(chart_html("x", TIMES, curves, "", "", units="m"))
    lines = """
    const model = chartModel(given);
    answer = { heads: headsOf(model), rows: rowsAt(model, 0), told: sentenceAt(model, 0), csv: csvText(model) };
    """
    found = node(["chart_model.js"], lines, data)
    assert found["heads"] == ["=1+1", "bounds"]
    assert found["rows"] == [["0.000", "−1.000 to 1.000"], ["1.000", "–"]]
    assert found["told"] == "0 s: b: =1+1 0.000 m, bounds from −1.000 to 1.000 m. c: =1+1 1.000 m"
    head, first, *_ = csv.reader(io.StringIO(found["csv"]))
    assert head[:2] == ["time [s]", "'=1+1 of x by b [m]"]
    assert [float(text) for text in first] == pytest.approx([0, 0, -1, 1, 1], abs=1e-6)


@pytest.mark.slow
def test_it_is_alive_like_other_charts(opened, tmp_path):
    class Two:
        title = "Two"

        def render(self, tree):
            bounds = Band("bounds", SIN - 0.1, SIN + 0.1)
            return "".join(
                chart_html(name, TIMES, [Curve("sine", SIN, (bounds,)), Curve("cosine", COS)], "", "", units="m")
                for name in ("one", "two")
            )

    page = opened(report_of(Two(), tmp_path / "report.html"))
    figures = page.locator("figure.charted")
    for k in (1, 0):
        figures.nth(k).scroll_into_view_if_needed()
        figures.nth(k).locator("canvas").wait_for()
    box = figures.nth(0).locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 50, steps=3)
    for figure in figures.all():
        assert figure.locator("caption").inner_text() == "At 1 s, in m"
        cells = [row.locator("td").all_inner_texts() for row in figure.locator("tbody tr").all()]
        assert cells == [["0.8415", "0.7415 to 0.9415"], ["0.5403", "–"]]
    with page.expect_download() as download:
        figures.nth(0).get_by_role("button", name="CSV").click()
    rows = np.array(list(csv.reader(io.StringIO(download.value.path().read_text("utf-8"))))[1:], dtype=float)
    np.testing.assert_allclose(rows.T, [TIMES, SIN, SIN - 0.1, SIN + 0.1, COS], atol=1e-7)
    figures.nth(0).get_by_role("button", name="cosine").click()
    assert "cosine" not in figures.nth(0).locator(".plot").get_attribute("aria-valuetext")
    for kind, start in (("PNG", b"\x89PNG"), ("SVG", b"<?xml")):
        with page.expect_download() as download:
            figures.nth(0).get_by_role("button", name=kind).click()
        assert download.value.path().read_bytes().startswith(start)
    # a drawing is drawn once, with the lines over the grid
    drawing = download.value.path().read_text("utf-8")
    assert drawing.count(">time [s]<") == 1
    assert drawing.rindex('stroke="#e3e7ec"') < drawing.index('stroke="#0072B2"', drawing.index(">time [s]<"))
    figures.nth(0).locator(".plot").focus()
    page.keyboard.press("+")
    assert figures.nth(0).get_by_role("button", name="Show all times").is_visible()


@pytest.mark.slow
def test_hostile_names_are_texts_in_a_browser(opened, tmp_path):
    path = report_of(Own(), tmp_path / "report.html")
    page = opened(path, width=390)
    figure = page.locator("figure.charted")
    figure.scroll_into_view_if_needed()
    figure.locator("canvas").wait_for()
    assert figure.locator("tbody button").all_text_contents() == list(HOSTILE.values())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page = opened(path, java_script_enabled=False)
    assert page.locator("figure.charted img").is_visible() and page.locator("canvas").count() == 0


def view_of(*charts, **more):
    return data_of(charts_html(charts, "alt", "caption", **more))


def test_categories_are_places_with_names():
    names = [HOSTILE["script"], "b", "c"]
    html = charts_html([Chart("error", names, [Curve("mine", [3.0, 2.0, 1.0], drawn="bars")], "t", "%")], "a", "c")
    assert "<script>alert" not in html and 'alt="a"' in html and html.count("<img") == 1
    # the picture for readers without scripts, in which the name is a text, too
    drawn = base64.b64decode(html.partition("svg+xml;base64,")[2].partition('"')[0]).decode("utf-8")
    assert "<svg" in drawn and "&lt;script&gt;" in drawn and "<script" not in drawn
    (view,) = data_of(html)["views"]
    assert view["across"]["texts"] == names and view["across"]["ends"] == [0.5, 3.5] and view["methods"][0]["bars"]
    np.testing.assert_array_equal(unpacked(view["time"]), [1, 2, 3])
    np.testing.assert_array_equal(unpacked(view["methods"][0]["lines"][0]["values"]), [3, 2, 1])


def test_several_charts_have_axes_of_their_own():
    dots = Curve("draws", [1.0, 3.0, 2.0], drawn="points")
    data = view_of(
        Chart("y", [0.0, 1.0, 1.0], [dots], "pairs", "m", "x", "kg", ends=(0.1, 10.0), log=True, limits={"most": 5.0}),
        Chart("z", TIMES, [Curve("a", SIN)], "over time"),
        choose="What",
    )
    first, second = data["views"]
    assert data["choose"] == "What" and [one["title"] for one in data["views"]] == ["pairs", "over time"]
    assert (first["across"]["name"], first["across"]["units"], first["units"]) == ("x", "kg", "m")
    assert first["up"] == {"low": 0.1, "high": 10.0, "log": True} and first["methods"][0]["dots"]
    assert first["limits"] == [{"name": "most", "value": 5.0}]
    assert first["across"]["ends"][0] < 0 and first["across"]["ends"][1] > 1
    # over time it has that of the page
    assert "across" not in second and "up" not in second


@pytest.mark.parametrize(
    ("chart", "expected"),
    [
        (Chart("y", [1.0, 0.0], [Curve("a", [1, 2])], "t", across="x"), "do not decrease"),
        (Chart("y", [0.0, 0.0], [Curve("a", [1, 2])], "t"), "increasing numbers in s"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2, 3])], "t"), "as for times"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2], drawn="pie")], "t"), "line, points or bars"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2])], "t", log=True), "two ends above zero"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2])], "t", ends=(2.0, 1.0)), "two finite numbers that increase"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2])], "t", ends=(1.0, 2.0, 3.0)), "two finite numbers"),
        (
            Chart("y", [0.0, 0.1], [Curve("a", [1, 2], drawn="bars")], "t"),
            "bars, but its places are numbers; expected names",
        ),
        (Chart("y", ["a", 2.0], [Curve("a", [1])], "t"), "names or numbers, not both"),
        (Chart("y", "ab", [Curve("a", [1, 2])], "t"), "expected a list of names"),
        (Chart("y", [0.0, 1.0], [Curve("a", [1, 2])], 3), "title is 3; expected a text"),
        (
            Chart("y", [0.0, 1.0], [Curve("a", [1, 2])], "t", limits={"x": "high"}),
            "a mapping from names to finite numbers",
        ),
        (Chart("y", [0.0, 1.0], [Curve("a", [1, 2])], "t", limits=[1.0]), "a mapping from names to finite numbers"),
        (Chart("y", ["a", "b"], [Curve("a", [1, 2])], "t", limits={"x": np.inf}), "finite"),
    ],
)
def test_charts_that_do_not_fit_together_are_refused(chart, expected):
    with pytest.raises(StudyError, match=expected):
        charts_html([chart], "", "")
    with pytest.raises(StudyError, match="a different title"):
        report.charts_html([Chart("y", [0.0, 1.0], [Curve("a", [1, 2])], "t")] * 2, "alt", "caption")
    with pytest.raises(StudyError, match="a sequence of one or more uqmbd.report.Chart"):
        charts_html([], "", "")


def test_bars_stand_beside_one_another_and_ranges_at_their_places(node):
    curves = [Curve(n, [1.0, 2.0], (Band("r", [0.5, np.nan], [1.5, np.nan], bars=True),), drawn="bars") for n in "ab"]
    (view,) = view_of(Chart("y", ["one", "two"], curves, "t"))["views"]
    lines = """
    const model = chartModel(given);
    answer = [barsOf(model), rangesOf(model), [placeAt(model, 1), csvText(model).split("\\r\\n")[2].split(",")[0]], model.whole];
    model.methods[0].shown = false;
    answer.push(barsOf(model));
    """
    bars, ranges, told, whole, left = node(["chart_model.js", "chart_layers.js"], lines, view)
    sides = sorted((bar["left"], bar["right"]) for bar in bars)
    assert all(one[1] <= other[0] for one, other in zip(sides[:-1], sides[1:], strict=True)) and len(sides) == 4
    assert sides[0][0] > 0.5 and sides[-1][1] < 2.5 and whole == [0.5, 2.5]
    assert [(r["place"], r["ends"]) for r in ranges] == [(1, [0.5, 1.5])] * 2 and ranges[0]["shift"] < ranges[1][
        "shift"
    ]
    assert told == ["two", "two"]
    assert len(left) == 2 and left[0]["right"] - left[0]["left"] > bars[0]["right"] - bars[0]["left"]
