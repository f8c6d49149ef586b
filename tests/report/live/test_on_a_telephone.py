"""Pages of 390 pixels, in a browser: what is said is read whole, and only tables of numbers scroll."""

import pytest

from uqmbd import report

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
