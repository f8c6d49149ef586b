"""Boxes, bars and ranges of charts, driven in a browser: what the pointer and keys tell, and what paper has."""

import numpy as np
import pytest

from tests.report.live.pages import elements_data
from uqmbd import report, results
from uqmbd.report import Band, Chart, Curve, charts_html
from uqmbd.report.charts import unpacked

from .test_element_charts import four, made
from .test_violation_charts import TIMES
from .test_violation_charts import node as violating

pytestmark = pytest.mark.slow


class Categories:
    """A section with bars over categories and points with ranges."""

    title = "Categories"

    def render(self, tree):
        places = ["first", "the second", "third"]
        band = Band("range", [0.5, 1.5, 2.5], [1.5, 2.5, 3.5], bars=True)
        bars = [Curve("a", [1.0, 2.0, 3.0], drawn="bars"), Curve("b", [3.0, 2.0, 1.0], drawn="bars")]
        points = [Curve("c", [1.0, 2.0, 3.0], (band,), drawn="points")]
        charts = [Chart("size", places, bars, "bars", "m"), Chart("size", places, points, "points", "m")]
        return charts_html(charts, "Sizes of categories.", "Sizes.")


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """Return the report of a method with elements, requirements, and a section of categories."""
    element = made(four(), np.array([0.001, 0.01, 0.1, 0.02]))
    element["requirements"] = violating([0.1, 0.2], times=TIMES / 2)["requirements"]
    tree = results.study_tree([element], study="s", mechanism="m")
    target = tmp_path_factory.mktemp("layers") / "report.html"
    return report.write_report(tree, target, sections=[Categories()])


def figure_of(page, starts):
    described = f':is([data-alt^="{starts}"], :has(> img[alt^="{starts}"]))'
    figure = page.locator(f"figure.charted{described}").last
    figure.scroll_into_view_if_needed()
    figure.locator("canvas").first.wait_for()
    page.wait_for_timeout(200)
    return figure


def colour_at(page, part, across, down):
    """Return the colour of a chart at shares of its width and height."""
    script = """(canvas, [x, y]) => {
        const over = canvas.parentNode.querySelector(".u-over");
        const ratio = canvas.width / canvas.clientWidth;
        const at = [over.offsetLeft + x * over.clientWidth, over.offsetTop + y * over.clientHeight];
        return [...canvas.getContext("2d").getImageData(...at.map((v) => Math.round(v * ratio)), 1, 1).data];
    }"""
    return part.locator("canvas").first.evaluate(script, [across, down])


def test_the_element_under_the_pointer_is_reported_and_shaded_by_its_error(opened, page_file):
    page = opened(page_file)
    figure = figure_of(page, "Elements in the plane")
    box = figure.locator(".u-over").bounding_box()
    chart = elements_data(made(four(), np.array([0.001, 0.01, 0.1, 0.02])))
    shades = []
    for k, error in enumerate(unpacked(chart["boxes"]["shade"])):
        left, down = 0.25 + 0.5 * (k // 2), 0.75 - 0.5 * (k % 2)
        page.mouse.move(box["x"] + (left - 0.1) * box["width"], box["y"] + down * box["height"], steps=2)
        assert figure.locator("caption").inner_text().startswith(f"At {chart['across']['texts'][k]}")
        told = float(figure.locator("tbody td").nth(1).inner_text())
        assert told == pytest.approx(error, rel=0.05)
        shades.append((error, sum(colour_at(page, figure, left - 0.15, down - 0.1)[:3])))
    # the larger the darker
    levels = [level for _, level in sorted(shades)]
    assert levels == sorted(levels, reverse=True) and len(set(levels)) == 4
    figure.locator(".plot").press("Home")
    assert chart["across"]["texts"][0] in figure.locator("caption").inner_text()
    assert "0.10 % of std" in figure.locator(".shades").locator("..").inner_text()


def test_dark_pages_have_shades_of_their_own(opened, page_file):
    page = opened(page_file, color_scheme="dark")
    figure = figure_of(page, "Elements in the plane")
    low, high = (sum(colour_at(page, figure, x, y)[:3]) for x, y in ((0.1, 0.65), (0.6, 0.65)))
    assert low < high


def test_bars_are_over_their_names_and_can_be_switched_off(opened, page_file):
    page = opened(page_file)
    figure = figure_of(page, "Sizes of categories")
    seen = figure.locator(".view:not(.away)")
    paper = colour_at(page, seen, 0.01, 0.05)
    # the first bar of the last category reaches to the top, the second one does not
    assert colour_at(page, seen, 0.78, 0.28) != paper and colour_at(page, seen, 0.88, 0.28) == paper
    seen.locator(".plot").press("End")
    assert (
        seen.locator("caption").inner_text().startswith("At third")
        and "3" in seen.locator("tbody td").nth(0).inner_text()
    )
    seen.locator("tbody button").first.click()
    page.wait_for_timeout(100)
    assert colour_at(page, seen, 0.78, 0.9) != paper and seen.locator("tbody tr.hidden-method").count() == 1
    assert page.pdf().startswith(b"%PDF")
    drawn = figure.locator(".paper text").all_text_contents()
    assert {"first", "the second", "third"} <= set(drawn)


def test_requirements_have_the_time_of_the_page_on_the_first_screen_and_below(opened, page_file):
    page = opened(page_file)
    figure = figure_of(page, "Probability of a violation")
    seen = figure.locator(".view:not(.away)")
    page.evaluate("document.dispatchEvent(new CustomEvent('uqmbd-time', { detail: { time: 0.5, source: null } }))")
    assert seen.locator("caption").inner_text() == "At 0.5 s, in %"
    assert float(seen.locator("tbody td").first.inner_text()) == pytest.approx(15)
    first = page.locator("#in-view")
    seen.locator(".plot").press("End")
    assert seen.locator("tbody td").nth(1).inner_text() == "21 to 39"
    assert first.locator(".now").inner_text().startswith("1 s: ")


def test_without_scripts_the_first_screen_says_where_its_numbers_are(opened, page_file):
    page = opened(page_file, java_script_enabled=False)
    assert "its numbers are in the tables" in page.locator("#in-view").inner_text()
