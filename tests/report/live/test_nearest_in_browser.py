"""Sliders of a study by samples alone: the page shows the nearest stored realisation, and says so."""

import json
import re

import numpy as np
import pytest

from uqmbd import report, results
from uqmbd.report.charts import unpacked
from uqmbd.report.live import collect_nearest_data

from .test_explorer_in_browser import number, settle

TIMES = 41


def stored(tree, **more):
    """Return the data of the page for the first method of a study."""
    return collect_nearest_data(tree["monte-carlo"], "monte-carlo", ["slider_x"], [], **more)


def alone(make_node, **options):
    return results.study_tree([make_node("monte-carlo", **options)], study="crank <1>", mechanism="m")


def test_realisations_in_the_page_are_those_of_the_results(make_node):
    """Without the failed ones: numbers, inputs and outputs."""
    tree = alone(make_node, samples=60, failing=3)
    samples = tree["monte-carlo/samples"].to_dataset()
    part = stored(tree)["histories"]["surrogate"]
    rows = unpacked(part["numbers"])
    assert rows.tolist() == list(range(3, 60))
    np.testing.assert_array_equal(unpacked(part["points"]), samples["inputs"].values[rows])
    exact = samples["response"].sel(output=["slider_x"]).values[rows]
    found = unpacked(part["origin"]) + unpacked(part["responses"])
    # a page writes a hundredth to a thousandth of the spread: less than half of that is lost
    assert (np.abs(found - exact) <= 5e-4 * exact.std(axis=0) + 1e-15).all()
    json.dumps(stored(tree), allow_nan=False)


@pytest.mark.parametrize(("samples", "times"), [(30, 5000), (5000, 41), (300, 4001)])
def test_the_data_stay_small(samples, times):
    """Many realisations, or many times: fewer of both are stored, with the first and the last time."""
    from uqmbd import extend

    axes = extend.labels([("x", "m"), ("y", "m")], [("a", "m", "")], np.linspace(0, 1, times))
    inputs = np.random.default_rng(1).normal(size=(samples, 1))
    response = np.repeat(np.repeat(inputs[:, :, None], 2, axis=1), times, axis=2)
    data = extend.sample_dataset(response, inputs, axes)
    node = results.propagator_node(
        "n", extend.statistics_of_samples(data), data, propagator="p", realisations=samples, wall_time=0.0
    )
    found = collect_nearest_data(node, "n", ["x", "y"], [])
    part = found["histories"]["surrogate"]
    own = unpacked(part["times"])
    assert len(json.dumps(found)) < 450_000 and found["nearest"] >= 20 and own[[0, -1]].tolist() == [0, 1]
    exact = np.broadcast_to(unpacked(part["points"])[:, :, None], unpacked(part["responses"]).shape)
    made = unpacked(part["origin"]) + unpacked(part["responses"])
    np.testing.assert_allclose(made, exact, rtol=1e-6, atol=5e-4 * exact[:, 0, 0].std())


@pytest.mark.slow
def test_the_page_shows_the_nearest_realisation(opened, make_node, tmp_path):
    """Nearest in standard deviations of the inputs, by the samples of the results; table, sentence and chart agree."""
    tree = alone(make_node, samples=60)
    page = opened(report.write_report(tree, tmp_path / "report.html"))
    samples = tree["monte-carlo/samples"].to_dataset()
    inputs, good = samples["inputs"].values, np.flatnonzero(samples["status"].values == 0)
    assert "This page evaluates no surrogate" in page.locator("#explore > p").first.inner_text()
    rows = [page.locator(f".input-row:has(#input-{k})") for k in (0, 1)]
    rng = np.random.default_rng(3)
    for _ in range(6):
        wanted = inputs.mean(axis=0) + rng.uniform(-1, 1, 2) * inputs.std(axis=0)
        for row, value in zip(rows, wanted, strict=True):
            row.locator("input.value").fill(f"{value:.6g}")
            row.locator("input.value").press("Enter")
        settle(page)
        at = np.array([float(f"{value:.6g}") for value in wanted])
        distance = np.linalg.norm((inputs[good] - at) / inputs.std(axis=0), axis=1)
        nearest = int(good[distance.argmin()])
        said = page.locator(".inputs-box .state").inner_text()
        assert f"sample {nearest}: k_1$ = " in said and "<script>alert(1) = " in said
        table = page.locator(".explorer > .readout:not(.limits)")
        time = number(re.search(r"At (\S+) s", table.locator("caption").inner_text())[1])
        exact = samples["response"].sel(output="slider_x").sel(time=time, method="nearest").values
        cells = table.locator("tbody tr").first.locator("td").all_inner_texts()
        assert number(cells[0]) == pytest.approx(exact[nearest], abs=2e-3)
        five = exact[good[np.argsort(distance)[:5]]]
        assert [number(end) for end in cells[2].split(" to ")] == pytest.approx([five.min(), five.max()], abs=2e-3)
    figure = page.locator("#output-1 figure.charted").first
    figure.scroll_into_view_if_needed()
    figure.locator(".plot canvas").wait_for()
    row = figure.locator("tbody tr").last
    assert "nearest realisation" in row.inner_text() and "a stored realisation" in row.inner_text()
    rows[0].locator("input.value").fill("-5")
    rows[0].locator("input.value").press("Enter")
    refused = rows[0].locator(".refusal").inner_text()
    low, high = re.search(r"values of k_1\$ from (\S+) to (\S+) N/m", refused).groups()
    assert [float(low), float(high)] == pytest.approx([inputs[:, 0].min(), inputs[:, 0].max()], abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1200, 1920])
def test_it_is_no_wider_than_the_page(opened, make_node, tmp_path, width):
    page = opened(report.write_report(alone(make_node, samples=60), tmp_path / "report.html"), width=width)
    page.get_by_role("button", name="Another realisation").click()
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_indices_of_samples_lead_the_first_screen(tmp_path):
    """Sobol' indices that Monte Carlo was asked for are shown; without them, effects of a regression."""
    import chaospy

    import uqmbd
    from uqmbd_montecarlo import MonteCarlo

    mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
    height, speed = (
        uqmbd.RandomVariable(n, chaospy.Normal(1, s), units=u) for n, s, u in (("h", 0.1, "m"), ("v", 0.3, "m/s"))
    )
    mechanism.output("y", mechanism.body("ball", mass=1, position=height, velocity=speed).position[0], units="m")
    for asked in (True, False):
        study = uqmbd.Study(
            "s", mechanism, np.linspace(0, 1, 3), [MonteCarlo(samples=200, seed=1, sobol_indices=asked)]
        )
        text = report.write_report(study.run(), tmp_path / "report.html").read_text(encoding="utf-8")
        first = text[text.index('id="matters-head"') : text.index('id="reliability-head"')]
        assert ("Total Sobol" in first) == asked and ("regression" in first) != asked
