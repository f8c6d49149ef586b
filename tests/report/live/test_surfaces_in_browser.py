"""Shapes in space, in a browser: what is in front hides what is behind, and named poses can be chosen."""

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd.shapes import Box
from uqmbd_montecarlo import MonteCarlo

pytestmark = pytest.mark.slow

TOWARDS = np.array([np.cos(np.radians(-58)), np.sin(np.radians(-58)), 0.0])
"""Horizontal direction to the viewer of the first view."""

MIDDLE = """() => {
  const canvas = document.querySelector("#explore .stage canvas");
  return Array.from(canvas.getContext("2d").getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data);
}"""


@pytest.fixture(scope="module")
def crates(tmp_path_factory):
    """Two crates, the first in front of the second; the first moves upwards."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.01, 0.02), units="m/s")
    mechanism = uqmbd.Mechanism("crates", uqmbd.Spatial())
    looks = {"mass": 1, "inertia": (1, 1, 1), "shape": Box((0.6, 0.6, 0.6))}
    first = mechanism.body("first", position=tuple(0.6 * TOWARDS), velocity=(0, 0, speed), **looks)
    mechanism.body("second", position=tuple(-0.6 * TOWARDS), **looks)
    mechanism.output("height", first.position[2], units="m")
    mechanism.require("low", first.position[2] <= 0.015, "below the beam")
    study = uqmbd.Study("crates", mechanism, np.linspace(0, 1, 5), [MonteCarlo(samples=40, seed=1)])
    tree, note = report.with_motion(study.run(), study)
    assert note == ""
    return report.write_report(tree, tmp_path_factory.mktemp("crates") / "crates.html")


def middle(page):
    page.wait_for_timeout(200)
    red, _, blue, alpha = page.evaluate(MIDDLE)
    assert alpha == 255
    return "first" if blue > red else "second"


def test_what_is_in_front_hides_what_is_behind(opened, crates):
    page = opened(crates)
    assert middle(page) == "first"
    page.locator("#explore .stage").focus()
    for _ in range(18):
        page.keyboard.press("ArrowLeft")
    assert middle(page) == "second"
    page.keyboard.press("0")
    assert middle(page) == "first"


def test_the_view_moves_and_enlarges(opened, crates):
    page = opened(crates)
    stage = page.locator("#explore .stage")
    assert middle(page) == "first"
    stage.scroll_into_view_if_needed()
    box = stage.bounding_box()
    page.mouse.move(box["x"] + 20, box["y"] + 100)
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(box["x"] + 20 + 0.6 * box["width"], box["y"] + 100, steps=3)
    page.mouse.up()
    page.keyboard.up("Shift")
    page.wait_for_timeout(200)
    assert page.evaluate(MIDDLE)[3] == 0
    stage.focus()
    for _ in range(8):
        page.keyboard.press("-")
    page.keyboard.press("0")
    assert middle(page) == "first"


def test_a_named_pose_is_drawn(opened, crates):
    page = opened(crates)
    pose = page.locator("#explore select").last
    assert pose.locator("option").all_inner_texts() == [
        "at the means of the inputs",
        "realisation of monte-carlo with the smallest margin of low",
    ]
    pose.select_option("1")
    assert (
        "Drawn: realisation of monte-carlo with the smallest margin of low."
        in page.locator("#explore .state").first.inner_text()
    )
    assert page.locator("#explore .clock").inner_text().startswith("1.0")


def test_bodies_are_outlines_without_webgl(browser, crates):
    page = browser.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.add_init_script(
        "HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext, "
        "{ apply: (f, self, given) => (given[0].startsWith('webgl') ? null : f.apply(self, given)) });"
    )
    page.goto(crates.as_uri())
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert middle(page) in ("first", "second")
    assert "WebGL is not available" in page.locator("#explore .state").first.inner_text()
    page.close()
    assert not errors


def test_bodies_are_outlines_after_the_loss_of_webgl(browser, crates):
    """The graphics driver fails while the page is open, and makes no new context."""
    page = browser.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.add_init_script(
        "window.contexts = []; window.refused = false;"
        "HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext, { apply: (f, self, given) => {"
        "  if (!given[0].startsWith('webgl')) return f.apply(self, given);"
        "  if (window.refused) return null;"
        "  const made = f.apply(self, given); window.contexts.push(made); return made; } });"
    )
    page.goto(crates.as_uri())
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert middle(page) == "first"
    page.evaluate(
        "window.refused = true; window.contexts.forEach((one) => one.getExtension('WEBGL_lose_context').loseContext())"
    )
    page.wait_for_timeout(200)
    page.locator("#explore .stage").focus()
    page.keyboard.press("ArrowLeft")
    assert middle(page) in ("first", "second")
    page.locator("#explore select").last.select_option("1")
    assert "WebGL is not available" in page.locator("#explore .state").first.inner_text()
    page.close()
    assert not errors


def test_keys_move_the_view(opened, crates):
    page = opened(crates)
    page.locator("#explore .stage").focus()
    for _ in range(20):
        page.keyboard.press("Shift+ArrowRight")
    page.wait_for_timeout(200)
    assert page.evaluate(MIDDLE)[3] == 0
