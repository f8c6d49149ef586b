"""Charts along axes other than time, driven in a browser: densities over a quantity, estimates over samples."""

import csv
import re

import numpy as np
import pytest

from tests.report.live.pages import decay_data, densities_data, settling_data
from uqmbd import report, results
from uqmbd.report.charts import unpacked

from .chaoses import falling

pytestmark = pytest.mark.slow

METHOD = "monte-carlo"


@pytest.fixture(scope="module")
def page_file(study, tmp_path_factory):
    """Return the report of a study of three methods."""
    return report.write_report(study, tmp_path_factory.mktemp("axes") / "report.html")


def figure_of(page, starts):
    """Bring the figure whose text begins so into view, and return it, and the chart that is seen."""
    figure = page.locator(f'#output-1 figure.charted[data-alt^="{starts}"]')
    figure.scroll_into_view_if_needed()
    seen = figure.locator(".view:not(.away)")
    seen.locator("canvas").wait_for()
    page.wait_for_timeout(200)
    figure.scroll_into_view_if_needed()
    return figure, seen


def point(page, part, share):
    """Move the mouse to a share of the width of a chart."""
    box = part.locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"], steps=3)


def test_densities_are_reported_and_saved_with_the_quantity(opened, page_file, study):
    page = opened(page_file)
    figure, seen = figure_of(page, "Probability densities")
    data = densities_data({name: study[name] for name in study.children if "samples" in study[name]}, "slider_x")
    views = figure.locator(".views button")
    assert views.all_inner_texts() == [view["title"] for view in data["views"]]
    views.last.click()
    assert views.last.get_attribute("aria-pressed") == "true" and figure.locator(".view:not(.away)").count() == 1
    view, places = data["views"][-1], unpacked(data["views"][-1]["time"])
    point(page, seen, 0.5)
    told = float(re.match(r"At (\S+) m, in 1/m", seen.locator("caption").inner_text())[1].replace("−", "-"))
    assert told == pytest.approx(places[0] + (places[-1] - places[0]) / 2, abs=0.02 * (places[-1] - places[0]))
    with page.expect_download() as download:
        seen.get_by_role("button", name="CSV").click()
    rows = list(csv.reader(download.value.path().read_text(encoding="utf-8").splitlines()))
    assert rows[0][:2] == ["slider_x [m]", "density of slider_x by histogram of monte-carlo [1/m]"]
    np.testing.assert_allclose([float(row[0]) for row in rows[1:]], places)
    drawn = unpacked(view["methods"][0]["lines"][0]["values"])
    np.testing.assert_allclose([float(row[1] or "nan") for row in rows[1:]], drawn, rtol=1e-6)


def test_they_have_no_part_in_the_time_of_the_page(opened, page_file):
    page = opened(page_file)
    figure_of(page, "Probability densities")
    page.evaluate("document.addEventListener('uqmbd-time', ({ detail }) => (window.heard = detail.time))")
    for starts in ("Probability densities", "Mean and standard"):
        _, seen = figure_of(page, starts)
        before = seen.locator("caption").inner_text()
        point(page, seen, 0.3)
        assert seen.locator("caption").inner_text() != before
        seen.locator(".plot").press("ArrowLeft")
        assert page.evaluate("window.heard === undefined")
        now = seen.locator("caption").inner_text()
        page.evaluate("document.dispatchEvent(new CustomEvent('uqmbd-time', { detail: { time: 1.9, source: null } }))")
        assert seen.locator("caption").inner_text() == now
        page.evaluate("delete window.heard")


def test_numbers_of_samples_are_along_a_logarithmic_axis(opened, page_file, study):
    page = opened(page_file)
    figure, seen = figure_of(page, "Mean and standard")
    counts = unpacked(settling_data(study[METHOD], "slider_x")["views"][0]["time"])
    plot = seen.locator(".plot")
    assert seen.locator("caption").inner_text().startswith(f"At {counts[-1]:.0f} samples")
    plot.press("Home")
    assert seen.locator("caption").inner_text().startswith(f"At {counts[0]:.0f} samples")
    point(page, seen, 0.5)
    middle = float(re.match(r"At (\S+) samples", seen.locator("caption").inner_text())[1])
    assert middle == pytest.approx(np.sqrt(counts[0] * counts[-1]), rel=0.05)
    plot.press("+")
    assert seen.get_by_role("button", name="Show all").is_visible()
    plot.press("0")
    assert not seen.get_by_role("button", name="Show all").is_visible()
    figure.get_by_role("button", name="standard deviation at").focus()
    page.keyboard.press("Enter")
    assert "standard deviation" in figure.locator(".view:not(.away) thead").inner_text()


def test_orders_are_whole_and_reported_as_such(opened, tmp_path):
    node = falling(3)
    tree = results.study_tree([node], study="s", mechanism="m")
    page = opened(report.write_report(tree, tmp_path / "report.html"))
    figure = page.locator('figure.charted[data-alt^="Contribution of the polynomials"]')
    figure.scroll_into_view_if_needed()
    seen = figure.locator(".view:not(.away)")
    seen.locator("canvas").wait_for()
    plot = seen.locator(".plot")
    for key, order in (("Home", 1), ("ArrowRight", 2), ("End", 3)):
        plot.press(key)
        assert seen.locator("caption").inner_text() == f"At order {order}, in %"
    part = float(seen.locator("tbody tr").first.locator("td").inner_text())
    largest = unpacked(decay_data(node, "x")["views"][0]["methods"][0]["lines"][0]["values"])
    assert part == pytest.approx(largest[2], rel=0.05)  # it is told with two digits
    assert page.pdf().startswith(b"%PDF")
    drawn = figure.locator(".view").first.locator(".paper text").all_text_contents()
    assert {"1", "2", "3", "100"} <= set(drawn) and "1.5" not in drawn


def test_ticks_of_logarithmic_axes(node):
    lines = "answer = given.map(([low, high, most, fine]) => decadeTicks(low, high, most, fine));"
    asked = [[10, 500, 10, True], [0.5, 2e4, 5, True], [210, 230, 8, True], [1e-4, 10, 6, False], [1, 1e9, 5, False]]
    found = node(["numbers.js"], lines, asked)
    assert found[0] == [10, 20, 50, 100, 200, 500]
    assert found[1] == [1, 10, 100, 1000, 10000]
    assert found[2] == [210, 215, 220, 225, 230] or found[2] == [210, 220, 230]
    assert found[3] == [1e-4, 1e-3, 1e-2, 0.1, 1, 10]
    assert found[4] == [10, 1000, 1e5, 1e7, 1e9]
    assert node(["numbers.js"], "answer = given.map(powerText);", [1, 100, 1e-4, 0.5]) == ["1", "100", "10⁻⁴", "0.5"]
