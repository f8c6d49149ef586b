"""Details are folded: a page is at most half as long, and pictures of it and paper have every chart that they show."""

import pytest

from uqmbd import report, results

from ..test_hostile_names import HOSTILE

pytestmark = pytest.mark.slow

MISSING = """() => [...document.querySelectorAll("figure.charted")]
    .filter((one) => !one.closest("details:not([open])") && !one.classList.contains("live"))
    .map((one) => one.textContent.slice(0, 80))"""

HEIGHT = "document.documentElement.scrollHeight"


def until(page, true):
    """Wait for what a busy browser does late."""
    for _ in range(200):
        if true():
            return
        page.wait_for_timeout(50)
    assert true()


@pytest.fixture(scope="module")
def page_file(make_node, make_chaos, tmp_path_factory):
    """Return the report of a study by samples and two surrogates."""
    nodes = [make_node("monte-carlo", samples=200), make_chaos("coarse", 2), make_chaos(HOSTILE["script"], 4)]
    study = results.study_tree(nodes, study=HOSTILE["script"], mechanism="m")
    return report.write_report(study, tmp_path_factory.mktemp("folded") / "report.html")


@pytest.mark.parametrize("width", [390, 1200, 1920])
def test_a_page_is_at_most_half_as_long_as_its_content(opened, page_file, width):
    """A reader who unfolds everything by the button finds the rest; the page never scrolls sideways."""
    page = opened(page_file, width=width, unfolded=False)
    until(page, lambda: page.evaluate(MISSING) == [])
    short = page.evaluate(HEIGHT)
    page.get_by_role("button", name="Unfold all details").click()
    assert page.locator("details:not([open])").count() == 0
    until(page, lambda: page.evaluate(MISSING) == [])
    assert short <= 0.5 * page.evaluate(HEIGHT)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.get_by_role("button", name="Fold details").click()
    until(page, lambda: page.evaluate(HEIGHT) <= short + 40)


def test_a_picture_of_the_whole_page_has_all_charts(opened, page_file):
    """Nobody scrolls: charts that are not folded are drawn all the same, and one that is unfolded follows."""
    page = opened(page_file, unfolded=False)
    until(page, lambda: page.evaluate(MISSING) == [])
    folded = page.locator("details:not([open]) figure.charted:not(.live)").count()
    assert folded > 0
    page.locator("#output-1 details.more").evaluate("(one) => (one.open = true)")
    until(page, lambda: page.evaluate(MISSING) == [])
    assert page.locator("details:not([open]) figure.charted:not(.live)").count() < folded


def test_paper_has_every_chart_and_every_table(opened, page_file):
    """Whatever is folded on the screen is printed, with its drawing; afterwards it is folded as before."""
    page = opened(page_file, unfolded=False)
    page.emulate_media(media="print")
    before = page.locator("details[open]").count()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    figures = page.locator("figure.charted").count()
    seen = """(all) => all.filter((one) => one.checkVisibility() && one.getBoundingClientRect().height > 20).length"""
    assert page.locator("figure.charted:has(.paper svg)").evaluate_all(seen) == figures > 10
    drawings = page.locator(".paper svg").evaluate_all(seen)
    assert drawings == page.locator(".paper").count() >= figures
    tables = page.locator("main > section:not(#explore) table:not(.readout table)")
    assert tables.evaluate_all(seen) == tables.count() > 5
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details[open]").count() == before
