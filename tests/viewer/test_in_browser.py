"""The viewer in a browser: a study file that changes, breaks and returns; mistakes are marked, and names are inert."""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import uqmbd
from uqmbd.shapes import Box
from uqmbd_joints import Revolute

pytestmark = pytest.mark.slow

STUDIES = Path(__file__).parents[2] / "studies"

CHAIN = """
import uqmbd
from uqmbd_joints import Revolute
mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
first = mechanism.body("first", mass=1, inertia=0.1, position=(0.5, 0))
second = mechanism.body("second", mass=1, inertia=0.1, position=(1.5, 0))
mechanism.add(Revolute("A", mechanism.ground, first, (0, 0), (-0.5, 0)))
mechanism.add(Revolute("B", first, second, (0.5, 0), (-0.5, WRONG)))
mechanism.output("y", second.position[1], units="m")
study = uqmbd.Study("double", mechanism, [0, 0.5, 1])
"""


SHOWN = "document.body.dataset.state === 'shown'"
ERROR = "document.body.dataset.state === 'error'"


def test_a_file_is_followed_through_changes_errors_loops_and_deletion(watch):
    text = CHAIN.replace("WRONG", "0")
    seen = watch(text, seconds=8.0)
    seen.until(SHOWN)
    seen.until("document.querySelector('#mobility').textContent === '2 degrees of freedom'")
    assert "Nothing was found" in seen.text("findings")
    for broken, words, line in [
        (text + "\nx = (\n", "SyntaxError", 12),
        (text + "\n1 / 0\n", "ZeroDivisionError", 12),
        (text + "\nwhile True:\n    pass\n", "did not finish within 8 s", None),
        (None, "does not exist", None),
    ]:
        seen.settle()
        seen.file.write_text(broken) if broken is not None else seen.file.unlink()
        seen.until(ERROR)
        assert words in seen.text("banner") and "last good state" in seen.text("banner")
        assert line is None or f"Line {line}:" in seen.text("banner")
        assert "second" in seen.text("tree")  # the last good state
        seen.settle()
        seen.file.write_text(text)
        seen.until(SHOWN)
        assert not seen.page.is_visible("#banner")
    seen.settle()
    seen.file.write_text(text.replace('"second"', '"other"'))
    seen.until("document.querySelector('#tree').textContent.includes('other')")


def test_a_joint_point_that_is_one_metre_off_is_marked(watch):
    seen = watch(CHAIN.replace("WRONG", "1.0"))
    seen.until(SHOWN)
    assert "B: the points of the joint are 1 m apart in the given pose" in seen.text("findings")
    before = seen.page.locator("#drawing").screenshot()
    seen.page.check("#as-drawn")
    seen.until_changed(before)
    # the line of the gap is red; it is between the two points of the joint
    red = seen.page.evaluate(
        """() => { const c = document.querySelector('#drawing'); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        let n = 0; for (let k = 0; k < d.length; k += 4) if (d[k] > 150 && d[k + 1] < 40 && d[k + 2] < 70 && d[k + 3] > 200) n++; return n; }"""
    )
    assert red > 50


def test_slider_simulation_and_escape(watch_file, tmp_path):
    file = tmp_path / "slider_crank_copy.py"
    shutil.copy(STUDIES / "slider_crank.py", file)
    seen = watch_file(file)
    seen.until(SHOWN)
    before = seen.page.locator("#drawing").screenshot()
    seen.page.locator("#input-0").focus()
    seen.page.keyboard.press("End")
    assert "0.1" in seen.page.inner_text("output[for=input-0]")
    seen.until_changed(before)
    seen.page.get_by_role("button", name="Simulate").click()
    seen.until("/^0\\.[0-9]*[1-9]/.test(document.querySelector('.clock').textContent)")
    seen.page.locator("#stage").focus()
    seen.page.keyboard.press("Escape")
    assert seen.viewer.ended.wait(10)
    seen.viewer.close()
    seen.until("document.body.dataset.state === 'ended'")


def tree_of_22_bodies():
    mechanism = uqmbd.Mechanism("tree", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    bodies = [mechanism.ground]
    for k in range(22):
        parent = bodies[k // 2]
        start = np.zeros(3) if k < 2 else np.array([0.5, 0, 0])
        body = mechanism.body(f"b{k}", mass=1, inertia=(0.1, 0.1, 0.1), position=(0.5 + k // 2, 0.2 * k, 0))
        mechanism.add(Revolute(f"j{k}", parent, body, tuple(start), (-0.5, 0, 0), axis_i=(0, 1, 0), axis_j=(0, 1, 0)))
        bodies.append(body)
    return mechanism


def test_a_frame_of_22_bodies_costs_less_than_40_ms(browser):
    view = tree_of_22_bodies().view()
    page = browser.new_page(viewport={"width": 1200, "height": 800})
    page.goto(view.address)
    costs = []
    for _ in range(30):
        page.locator("#stage").focus()
        page.keyboard.press("ArrowLeft")
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        costs.append(float(page.locator("#drawing").get_attribute("data-cost")))
    page.close()
    view.close()
    assert np.median(costs) < 40


def test_hostile_names_are_text(browser):
    name = "<img src=x onerror=alert(1)>'\"</script>"
    mechanism = uqmbd.Mechanism(name.replace("/", ""), uqmbd.Planar())
    body = mechanism.body(name.replace("/", ""), mass=1, inertia=1, position=(1, 0))
    mechanism.add(Revolute("${alert(2)}", mechanism.ground, body, (0, 0), (-1, 0)))
    view = mechanism.view()
    page = browser.new_page()
    wrong = []
    page.on("dialog", lambda one: wrong.append(one.message))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(view.address)
    page.wait_for_selector("#tree li")
    assert "<img src=x onerror=alert(1)>" in page.inner_text("#tree")
    assert page.locator("aside img").count() == 0
    page.mouse.move(400, 300)
    page.close()
    view.close()
    assert not wrong


def test_the_command_ends_with_its_page(browser, tmp_path):
    import subprocess

    file = tmp_path / "chain_study.py"
    file.write_text(CHAIN.replace("WRONG", "0"))
    command = [sys.executable, "-m", "uqmbd", "view", str(file), "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", address)
        page = browser.new_page()
        page.goto(address)
        page.wait_for_selector("#tree li", timeout=90_000)
        page.close()
        assert process.wait(20) == 0


def test_shapes_are_drawn_and_exported(browser):
    mechanism = uqmbd.Mechanism("crate", uqmbd.Spatial())
    body = mechanism.body("crate", mass=1, inertia=(1, 1, 1), shape=Box((1, 1, 1)))
    view = mechanism.view()
    page = browser.new_page(viewport={"width": 1000, "height": 700})
    wrong = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    # a remark of Chromium about drawings without a GPU
    page.on("console", lambda said: "GPU stall due to ReadPixels" in said.text or wrong.append(said.text))
    page.goto(view.address)
    page.wait_for_selector("#tree li")
    with page.expect_download() as saved:
        page.get_by_role("button", name="glTF").click()
    found = json.loads(Path(saved.value.path()).read_text(encoding="utf-8"))
    assert [mesh["name"] for mesh in found["meshes"]] == [body.name]
    assert found["accessors"][0]["min"] == [-0.5, -0.5, -0.5] and found["accessors"][0]["max"] == [0.5, 0.5, 0.5]
    page.close()
    view.close()
    assert not wrong
