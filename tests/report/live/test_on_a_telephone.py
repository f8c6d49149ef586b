"""Pages of 390 pixels, in a browser: what is said is read whole, and only tables of numbers scroll."""

import chaospy
import pytest

import uqmbd
from uqmbd import report, results
from uqmbd.shapes import Box
from uqmbd_montecarlo import MonteCarlo

pytestmark = pytest.mark.slow

CUT = """() => [...document.querySelectorAll("p, li, h1, h2, h3, dd, .stacked td, .stacked th, .verdict, figcaption")]
    .filter((one) => one.checkVisibility() && !one.closest(".wide:has(> table:not(.stacked))"))
    .filter((one) => one.getBoundingClientRect().right > innerWidth + 1 || one.scrollWidth > one.clientWidth + 1)
    .map((one) => one.tagName + ": " + one.textContent.trim().slice(0, 60))"""


@pytest.mark.parametrize("width", [390, 1200])
def test_no_verdict_is_cut(opened, study, tmp_path, width):
    """Sentences and verdicts end within the window; the page itself does not scroll sideways."""
    page = opened(report.write_report(study, tmp_path / "report.html"), width=width, height=844)
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert page.locator("table.stacked td").count() > 5
    assert page.evaluate(CUT) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width


SIDEWAYS = """() => [...document.querySelectorAll(".wide")]
    .filter((one) => one.checkVisibility() && (one.querySelector(":scope > table.stacked") || one.matches(".readout")))
    .filter((one) => one.scrollWidth > one.clientWidth + 1)
    .map((one) => one.textContent.trim().slice(0, 60))"""


def test_numbers_of_charts_and_influences_do_not_scroll_sideways(opened, make_chaos, tmp_path):
    """Every chart of the page is made; names stand above their numbers, which are seen whole."""
    study = results.study_tree([make_chaos("coarse", 2), make_chaos("fine", 4)], study="s", mechanism="m")
    page = opened(report.write_report(study, tmp_path / "report.html"), width=390, height=844)
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    for figure in page.locator("figure.charted").all():
        figure.scroll_into_view_if_needed()
        figure.locator(".chart").first.wait_for()
    assert page.locator(".readout").count() > 3 and page.locator("#influence table.stacked td").count() > 0
    assert page.evaluate(SIDEWAYS) == []
    name, number = (page.locator(".readout tbody tr:has(td ~ td)").first.locator(of).first for of in ("th", "td"))
    assert number.bounding_box()["y"] > name.bounding_box()["y"] + 5


def test_charts_of_one_figure_have_one_legend_on_paper(opened, study, tmp_path):
    """The legend stands above the charts; a file of one of them has it inside."""
    page = opened(report.write_report(study, tmp_path / "report.html"))
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    figure = page.locator("figure.several:has(> .legend svg)").first
    names = set(figure.locator("> .legend svg text").all_text_contents())
    drawn = figure.locator(".view > .paper svg").all()
    assert names and len(drawn) > 1
    assert not any(names & set(one.locator("text").all_text_contents()) for one in drawn)


def test_long_names_of_poses_fit_on_the_page(opened, tmp_path):
    """The list of poses contains the names of requirements; it is as wide as the page at most."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2), units="m/s")
    mechanism = uqmbd.Mechanism("crate", uqmbd.Spatial())
    crate = mechanism.body("crate", mass=1, inertia=(1, 1, 1), velocity=(speed, 0, 0), shape=Box((1, 1, 1)))
    mechanism.output("way", crate.position[0], units="m")
    mechanism.require("distance of the crate from the wall at the end of the hall " * 2, crate.position[0] <= 1.5)
    study = uqmbd.Study("crate", mechanism, [0, 0.5, 1], [MonteCarlo(samples=20, seed=1)])
    tree, note = report.with_motion(study.run(), study)
    assert not note
    page = opened(report.write_report(tree, tmp_path / "report.html"), width=390, height=844)
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    page.locator(".player:not(.small) select[title^=Realisation]").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
