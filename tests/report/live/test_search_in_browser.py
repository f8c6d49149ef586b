"""Many outputs on a page: they are grouped by units, and found by their names."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd_montecarlo import MonteCarlo

pytestmark = pytest.mark.slow

COUNT = 200


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """Return the report of 200 outputs, of which half are in m and half in mm, one of them with a hostile name."""
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    speed = uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1), units="m/s")
    body = mechanism.body("b", mass=1, velocity=speed)
    for k in range(COUNT - 1):
        # a constant of some size makes the outputs the less uncertain, the larger their number is
        name, units = (f"place {k:03d} left", "m") if k % 2 else (f"Place {k:03d} right", "mm")
        mechanism.output(name, (1 if k % 2 else 1000) * (body.position[0] + k), units=units)
    mechanism.output("<b>bold & 'odd'<\\b>", body.position[0] + COUNT, units="m")
    study = uqmbd.Study("s", mechanism, np.linspace(0, 1, 11), [MonteCarlo(samples=20, seed=1)])
    return report.write_report(study.run(), tmp_path_factory.mktemp("many") / "report.html")


def seen(page):
    """Return the names of the outputs whose sections are visible."""
    return [one.inner_text() for one in page.locator("section.output h3").all() if one.is_visible()]


def test_two_hundred_outputs_are_grouped_and_found(opened, page_file):
    page = opened(page_file, unfolded=False)
    assert [one.inner_text() for one in page.locator(".group > summary").all()] == [
        "97 further outputs in mm", "97 further outputs in m",
    ]  # fmt: skip
    assert seen(page) == [f"{'place' if k % 2 else 'Place'} {k:03d} {'left' if k % 2 else 'right'}" for k in range(6)]
    field = page.get_by_label("Find an output")
    assert field.bounding_box()["y"] < 1100
    field.fill("PLACE 15 left")
    names = [f"place {k:03d} left" for k in range(1, COUNT, 2) if "15" in f"{k:03d}"]
    assert sorted(seen(page)) == names
    assert page.locator(".find [role=status]").inner_text() == f"{len(names)} of {COUNT} outputs"
    rows = [row.inner_text() for row in page.locator("#outputs > .wide tbody th").all() if row.is_visible()]
    assert sorted(rows) == names
    links = [one.inner_text() for one in page.locator("nav .minor a").all() if one.is_visible()]
    assert sorted(links) == names
    field.press("Enter")
    assert page.evaluate("document.activeElement.closest('section.output').querySelector('details').open")
    field.fill("bold & 'odd'")
    assert seen(page) == ["<b>bold & 'odd'<\\b>"]
    field.fill("nothing like it")
    assert seen(page) == [] and page.locator(".find [role=status]").inner_text() == f"0 of {COUNT} outputs"
    field.fill("")
    assert len(seen(page)) == 6


@pytest.mark.parametrize("width", [390, 1200])
def test_the_page_of_many_outputs_does_not_scroll_sideways(opened, page_file, width):
    page = opened(page_file, width=width, unfolded=False)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
