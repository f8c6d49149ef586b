"""Contributions of sections, deviations and margins on the first screen, in a browser, with hostile names."""

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd.report import Chart, ChartGroup, Curve, FirstScreen, ReliabilityStatement
from uqmbd_collocation import Collocation

from ..test_hostile_names import HOSTILE

pytestmark = pytest.mark.slow


class Added:
    """A section that adds a hostile name to each part of the first screen."""

    title = "Added"

    def render(self, tree):
        return ""

    def first_screen(self, tree):
        names = list(HOSTILE.values())
        said = [ReliabilityStatement(0, name, name) for name in names[:6]]
        charts = [Chart(name, [0.0, 1.0], [Curve(name, [0.0, 1.0])], name, across=name) for name in names[:2]]
        return FirstScreen(
            names[0], (names[1],), [(name, name) for name in names], [ChartGroup(charts, *names[:3])], said
        )


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    start = uqmbd.RandomVariable(HOSTILE["script"], chaospy.Normal(0, 1e-4), units="m")
    body = mechanism.body("stone", mass=1, position=start, velocity=2)
    mechanism.output(HOSTILE["attribute"], body.position[0], units="m")
    mechanism.require(HOSTILE["close"], body.position[0] <= 2.0002)
    study = uqmbd.Study("stone", mechanism, np.linspace(0, 1, 11), [Collocation(order=1)])
    tree, problem = report.with_motion(study.run(), study)
    assert not problem
    return report.write_report(tree, tmp_path_factory.mktemp("added") / "report.html", sections=[Added()])


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1200, "light"), (1920, "light")])
def test_nothing_scrolls_sideways_and_texts_stay_texts(opened, page_file, width, scheme):
    page = opened(page_file, width=width, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(".contributed tbody tr").count() == 6 and page.locator(".contributed li").count() == 6
    assert page.locator(".contribution .views button").count() == 2
    # the only image is the picture of the chart of the section, for pages without scripts
    assert page.locator(".first script:not([type])").count() == 0
    images = page.locator(".first img").evaluate_all("(all) => all.map((one) => [one.parentNode.className, one.src])")
    assert len(images) == 1 and all("charted" in kind for kind, _ in images)
    assert all(source.startswith("data:image/svg+xml;base64,") for _, source in images)


def test_deviations_are_seen_first_and_begin_at_the_limit(opened, page_file):
    page = opened(page_file)
    assert page.locator("#in-view .views button[aria-pressed='true']").inner_text() == "deviation"
    assert page.locator("#in-view .now").first.inner_text().startswith("1 s:")
    page.locator("#in-view .views button").nth(1).click()
    assert page.locator("#in-view .view:not(.away) .now").inner_text().startswith("1 s:")
    assert page.locator(".yield").inner_text().startswith("Yield (requirement met):")
