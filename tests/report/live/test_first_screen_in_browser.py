"""The first screen and the sliders, in a browser: one time, nothing hidden, no hole, and all of it by keys alone."""

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

from ..test_hostile_names import HOSTILE

# surrogates of order 1: their errors do not matter here
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")]

FACTORS = ("a", "b", "c", "d", "e", "f", "last")
"""Inputs; the spread of each is four times that of the one before, so that the last one matters most."""


def swinging():
    """A pendulum of seven inputs, which has to stay above a floor that it reaches, and one that is far below."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    inputs = [
        uqmbd.RandomVariable(name, chaospy.Normal(0.0, 0.03 * 4.0 ** (k - 6)), units="m")
        for k, name in enumerate(FACTORS)
    ]
    length = 0.5 + sum(inputs)
    rod = mechanism.body("rod", mass=1.0, inertia=0.1, position=(length, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length, 0)))
    mechanism.output("height", rod.position[1], units="m")
    mechanism.output("way", rod.position[0] / 1000, units="m")
    mechanism.require("floor", rod.position[1] >= -0.53)
    mechanism.require("cellar", rod.position[1] >= -50.0)
    methods = [MonteCarlo(samples=40, seed=1), Collocation(order=1)]
    return uqmbd.Study("swing", mechanism, np.linspace(0, 1, 51), methods)


@pytest.fixture(scope="module")
def made():
    study = swinging()
    tree, problem = report.with_motion(study.run(), study)
    assert not problem
    return tree


@pytest.fixture(scope="module")
def page_file(made, tmp_path_factory):
    return report.write_report(made, tmp_path_factory.mktemp("first") / "report.html")


def test_player_and_chart_begin_at_the_closest_approach_to_a_limit(opened, page_file, made):
    """The margin of the mean, in standard deviations, is smallest there; the cellar is far below at all times."""
    page = opened(page_file)
    data = made["collocation/statistics"].to_dataset().sel(output="height")
    with np.errstate(divide="ignore"):
        scaled = (data["mean"].values + 0.53) / data["std"].values
    expected = float(data["time"][int(np.nanargmin(np.where(data["std"].values > 0, scaled, np.inf)))])
    assert page.locator("#in-view .now").inner_text().startswith(f"{expected:.4g} s:")
    assert float(page.locator("#mechanism .clock").inner_text().removesuffix(" s")) == expected
    assert f"At {expected:.4g} s" in page.locator(".explorer > .readout:not(.limits) caption").inner_text()


@pytest.mark.parametrize("width", [390, 1200])
def test_all_sliders_are_seen_and_what_matters_most_comes_first(opened, page_file, width):
    page = opened(page_file, width=width)
    assert page.locator(".input-row label").all_inner_texts() == list(reversed(FACTORS))
    # nothing lies in a box of its own that scrolls
    hidden = "(box) => box.scrollHeight - box.clientHeight"
    assert page.locator(".inputs-list").evaluate(hidden) <= 1 and page.locator(".inputs-box").evaluate(hidden) <= 1


def test_a_limit_that_is_far_away_is_reported_and_leaves_the_curve_its_height(opened, page_file):
    page = opened(page_file)
    assert page.locator("#in-view .limits").inner_text().strip() == "limit: floor (\N{MINUS SIGN}0.53 m)"
    assert (
        page.locator("#in-view .beyond:not(.lines)").inner_text() == "Outside the chart: the limit of cellar (−50 m)."
    )
    figure = page.locator("#in-view")
    rows = figure.locator("canvas").evaluate(
        """(canvas) => {
            const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            const rows = new Set();
            for (let k = 0; k < data.length; k += 4) // the blue of the first method
                if (Math.abs(data[k] - 0x00) + Math.abs(data[k + 1] - 0x72) + Math.abs(data[k + 2] - 0xb2) < 12)
                    rows.add(Math.floor(k / 4 / width));
            return rows.size / height;
        }"""
    )
    assert rows > 0.4


def test_without_poses_the_chart_has_the_width_and_the_reason_is_reported(opened, made, tmp_path):
    page = opened(report.write_report(made.drop_nodes("motion"), tmp_path / "report.html"))
    assert "--no-report" in page.locator(".pictures > .soft").inner_text()
    box, whole = page.locator("#in-view canvas").bounding_box(), page.locator(".pictures").bounding_box()
    assert box["width"] > 0.9 * whole["width"]


def test_everything_is_reached_by_keys_alone(opened, page_file):
    """Tab goes once through all that can be used, in the order of the page, and what has the focus shows it."""
    page = opened(page_file)
    reached = []
    for _ in range(200):
        page.keyboard.press("Tab")
        found = page.evaluate(
            """() => {
                const one = document.activeElement;
                if (one === document.body) return null;
                const look = getComputedStyle(one);
                const shown = look.outlineStyle !== "none" || look.boxShadow !== "none";
                return [one.id || one.className || one.textContent.trim().slice(0, 30), shown,
                        one.getBoundingClientRect().top + scrollY];
            }"""
        )
        if found is None:
            break
        reached.append(found)
    names = [name for name, _, _ in reached]
    assert {f"input-{k}" for k in range(7)} <= set(names) and names.count("plot") >= 3 and "▶ Play" in names
    assert [name for name, shown, _ in reached if not shown] == []


def test_the_mechanism_is_drawn_before_it_is_in_the_window(opened, page_file):
    """A picture of the whole page has it: on a low window it is below the fold, and nothing is scrolled."""
    page = opened(page_file, width=390, height=300)
    page.wait_for_timeout(600)
    assert page.locator("#mechanism canvas").bounding_box()["y"] > 300
    inked = """(canvas) => {
        const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        return width > 300 && data.some((value) => value > 0);
    }"""
    assert page.locator("#mechanism canvas").evaluate(inked)


def test_hostile_names_are_texts_in_sliders_player_and_first_screen(opened, tmp_path):
    """Of the study, the mechanism, bodies, inputs, outputs, methods and requirements: no element of the page is theirs."""
    names = list(HOSTILE.values())
    for _ in range(20):
        names.append(f"{names[len(names) - len(HOSTILE)]} again")
    given = iter(names)
    mechanism = uqmbd.Mechanism(next(given), uqmbd.Planar(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable(next(given), chaospy.Normal(0.5, 0.02), units="m")
    mass = uqmbd.RandomVariable(next(given), chaospy.LogNormal(0.0, 0.2), units="kg")
    rod = mechanism.body(next(given), mass=mass, inertia=0.1, position=(length, 0))
    mechanism.add(Revolute(next(given), mechanism.ground, rod, (0, 0), (-length, 0)))
    outputs = [next(given) for _ in range(8)]
    for k, name in enumerate(outputs):
        mechanism.output(name, rod.position[k % 2], units="m")
    mechanism.require(next(given), rod.position[1] >= -0.53, description=next(given))
    methods = [MonteCarlo(samples=40, seed=1, label=next(given)), Collocation(order=2, label=next(given))]
    study = uqmbd.Study(next(given), mechanism, np.linspace(0, 1, 51), methods)
    tree, problem = report.with_motion(study.run(), study)
    assert not problem
    tree, problem = report.with_poses(tree, study)
    assert not problem
    page = opened(report.write_report(tree, tmp_path / "report.html"))
    asked = []
    page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    page.locator("#input-0").focus()
    page.keyboard.press("End")
    page.evaluate("document.querySelectorAll('details').forEach((folded) => (folded.open = true))")
    page.wait_for_timeout(300)
    labels = {text.strip() for text in page.locator(".input-row label").all_text_contents()}
    assert labels == {length.name.strip(), mass.name.strip()}
    shown = [text.split() for text in page.locator(".explorer > .readout:not(.limits) tbody th").all_text_contents()]
    assert sorted(shown) == sorted([*(name.split() for name in outputs)])
    assert page.locator("img:not([src^='data:'])").count() == 0 and not asked
    assert page.locator("script").count() == page.locator('script[type="application/json"], body > script').count()
    assert page.evaluate("document.documentElement.scrollWidth") <= 1200
