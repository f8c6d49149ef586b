"""Charts in a plane: outputs over one another, errors against cost, inputs of failures; as data, and in a browser."""

import csv
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import xarray as xr

from tests.report.live.pages import error_cost_data, failures_data, over_data
from uqmbd import extend, report, results
from uqmbd.report.charts import unpacked
from uqmbd.report.figures import failure_reasons

from ..test_hostile_names import HOSTILE

TIMES = np.linspace(0.0, 2.0, 301)


def method_node(x, y, label="loops", times=TIMES, inputs=None, status=None):
    """Return the node of a method whose samples are the rows of x and y."""
    axes = extend.labels([("x", "m"), ("y", "deg")], ["k <b>", "m"][: 1 if inputs is None else inputs.shape[1]], times)
    drawn = np.ones((len(x), 1)) if inputs is None else inputs
    messages = None if status is None else ["too stiff" if s else "" for s in status]
    samples = extend.sample_dataset(np.stack([x, y], axis=1), drawn, axes, status=status, messages=messages)
    statistics = extend.statistics_of_samples(samples)
    return results.propagator_node(
        label, statistics, samples=samples, propagator="p", realisations=len(x), wall_time=0.0
    )


def loops(count=80, seed=0, label="loops", times=TIMES):
    """Return ellipses of random size, which no function of x has."""
    size = 100.0 + np.random.default_rng(seed).normal(0, 1e-2, (count, 2, 1))
    return method_node(size[:, 0] * np.sin(4 * times), size[:, 1] * np.cos(4 * times), label, times)


def values(method):
    """Return the values of a method's line."""
    return unpacked(method["lines"][0]["values"])


def test_a_loop_is_drawn_by_the_means_at_each_time():
    nodes = {"one": loops(label="one"), "short": loops(seed=1, label="short", times=TIMES[:200])}
    data = over_data(nodes, "y", "x")
    assert (data["units"], data["plane"]) == ("deg", {"name": "x", "units": "m"})
    np.testing.assert_array_equal(unpacked(data["time"]), TIMES)
    for label, method in zip(nodes, data["methods"], strict=True):
        statistics = nodes[label]["statistics"].to_dataset()
        for name, found in (("x", unpacked(method["places"])), ("y", values(method))):
            known = statistics["mean"].sel(output=name).values
            np.testing.assert_allclose(found[: len(known)], known, rtol=1e-12, atol=1e-12)
            assert np.isnan(found[len(known) :]).all()


def test_lines_between_the_points_of_a_realisation_are_not_seen_to_depart_from_it():
    samples = loops()
    strands = over_data({"one": samples}, "y", "x")["methods"][0]["strands"]
    across, up = (unpacked(strands[k]) + strands["origin"][n] for n, k in enumerate(("across", "up")))
    response = samples["samples"]["response"].values
    assert across.shape == up.shape == (60, len(strands["at"])) and len(strands["at"]) < 100
    for found, exact in ((across, response[:60, 0]), (up, response[:60, 1])):
        np.testing.assert_allclose(found, exact[:, strands["at"]], atol=1e-4)
        between = np.array([np.interp(TIMES, TIMES[strands["at"]], one) for one in found])
        assert np.abs(between - exact).max() < np.ptp(exact) / 700


def test_functions_of_another_output_have_the_bands_of_the_figure():
    rng = np.random.default_rng(2)
    x = rng.uniform(0.9, 1.1, (300, 1)) * TIMES
    one = method_node(x, rng.uniform(1, 2, (300, 1)) * x)
    data = over_data({"one": one}, "y", "x")
    axes = report.over_output(one, "y", over="x").axes[0]
    places, mean = axes.lines[0].get_data()
    np.testing.assert_array_equal(unpacked(data["time"]), places)
    np.testing.assert_array_equal(values(data["methods"][0]), mean)
    assert data["across"] == {"name": "x", "units": "m", "place_units": "m"}
    low, high = (unpacked(data["methods"][0]["lines"][k]["values"]) for k in (1, 2))
    area = axes.collections[0].get_paths()[0].vertices[:, 1]
    np.testing.assert_allclose([(mean + low).min(), (mean + high).max()], [area.min(), area.max()], rtol=1e-6)


def test_one_time_has_no_line_over_another_output():
    assert over_data({"one": loops(times=TIMES[:1])}, "y", "x") is None


def convergence():
    """Return errors of two methods at three levels, of which one is unknown and one is rounding."""
    dims = ("method", "level", "output")
    std = np.array([[1e-1, 1e-2, 1e-3], [0.3, 0.2, np.nan]])[..., None]
    mean = np.array([[1e-2, 1e-4, 1e-17], [0.1, 0.05, np.nan]])[..., None]
    return xr.Dataset(
        {"mean_error_l2": (dims, mean), "std_error_l2": (dims, std), "realisations": (dims[:2], [[4, 9, 16], [90, 30, 0]]),
         "wall_time": (dims[:2], [[0.1, 0.2, 0.4], [0.9, 0.3, np.nan]]),
         "level_name": (dims[:2], [["order 1", "order 2", "order 3"], ["samples 90", "samples 30", ""]]),
         "reference_mean_error": ("output", [1e-5]), "reference_std_error": ("output", [5e-3])},
        coords={"method": ["chaos", "mc"], "output": ["x"]}, attrs={"reference": "finest"},
    )  # fmt: skip


def test_errors_are_those_of_the_dataset_in_the_order_of_levels():
    by_runs, by_time = error_cost_data(convergence(), "x")["views"]
    for view, cost in ((by_runs, "realisations"), (by_time, "wall_time")):
        methods = {method["label"]: method for method in view["methods"]}
        assert list(methods)[:4] == ["chaos: mean", "chaos: standard deviation", "mc: mean", "mc: standard deviation"]
        np.testing.assert_allclose(values(methods["chaos: mean"]), [1, 0.01, np.nan])
        np.testing.assert_allclose(values(methods["mc: standard deviation"]), [30, 20, np.nan])
        np.testing.assert_allclose(unpacked(methods["mc: mean"]["places"])[:2], convergence()[cost].values[1, :2])
        assert methods["mc: mean"]["texts"] == [{"name": "level", "values": ["samples 90", "samples 30", ""]}]
        assert view["start"] == 1  # the last level that both methods have
        assert view["up"]["low"] <= 0.01 and view["up"]["high"] >= 30
    # told apart without colour: methods by the shape of their points, quantities by fill and dash
    looks = [(m["shape"], m.get("hollow", False), tuple(m["dash"])) for m in by_runs["methods"][:4]]
    assert len(set(looks)) == 4 and looks[0][0] == looks[1][0] != looks[2][0]
    own = [m for m in by_runs["methods"] if m.get("quiet")]
    assert [m["label"] for m in own] == ["reference error: standard deviation"]
    np.testing.assert_allclose(values(own[0]), 0.5)


@pytest.mark.parametrize("count", [1, 2])
def test_failed_samples_are_drawn_at_their_inputs(count):
    drawn = np.random.default_rng(0).normal(size=(200, count))
    status = np.where(drawn[:, 0] > 1, 2, 0)
    one = method_node(np.ones((200, 1)), np.ones((200, 1)), times=[0.0], inputs=drawn, status=status)
    data = failures_data(one, failure_reasons(one)[0])
    fine, failed = data["methods"]
    samples = unpacked(data["time"]).astype(int)
    for method, expected in ((fine, status == 0), (failed, status != 0)):
        places = unpacked(method["places"])
        np.testing.assert_array_equal(samples[np.isfinite(places)], np.flatnonzero(expected))
        np.testing.assert_array_equal(places[np.isfinite(places)], drawn[expected, 0])
        if count == 2:
            np.testing.assert_array_equal(values(method)[np.isfinite(places)], drawn[expected, 1])
    assert (fine["label"], failed["label"]) == (f"succeeded ({sum(status == 0)})", f"failed ({sum(status != 0)})")
    assert fine["shape"] != failed["shape"] and data["plane"]["name"] == "k <b>"
    assert data.get("up", {}).get("hidden", False) == (count == 1)
    assert status[samples[data["start"]]] == 2


def test_marks_are_reported_and_saved_with_both_values(node):
    data = error_cost_data(convergence(), "x")["views"][0]
    lines = (
        "const model = chartModel(given);\n"
        "answer = { heads: headsOf(model), rows: rowsAt(model, 1), said: sentenceAt(model, 1), csv: csvText(model),"
        " nearest: nearestMark(model, [Math.log10(9), 1], (x, y) => [x, y], 0) };"
    )
    found = node(["chart_model.js", "colours.js"], lines, data)
    assert found["heads"] == ["relative error [%]", "realisations", "level"]
    assert found["rows"][:2] == [["0.010", "9", "order 2"], ["1.0", "9", "order 2"]]
    assert "chaos: mean: relative error 0.010 %, realisations 9, order 2" in found["said"]
    assert found["nearest"] == 1
    rows = list(csv.reader(found["csv"].splitlines()))
    assert rows[0][:4] == [
        "level",
        "realisations by chaos: mean",
        "error of x by chaos: mean [%]",
        "level of chaos: mean",
    ]
    assert rows[2][:4] == ["2", "9", "0.01", "order 2"] and len(rows) == 4


def test_a_chart_of_nothing_known_has_axes(node):
    data = over_data({"one": loops(count=2)}, "y", "x")
    for method in data["methods"]:
        method["places"] = {"kind": "float64", "shape": [0], "base64": ""}
        del method["strands"]
    assert node(["chart_model.js"], "answer = chartModel(given).plane.right;", data) == [0, 1]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """Return a report with an output over another one, and with failures."""
    rng = np.random.default_rng(3)
    drawn = rng.normal(size=(120, 2))
    status = np.where(drawn[:, 0] > 1, 2, 0)
    size = 1 + 0.1 * drawn[:, :1]
    x, y = size * np.sin(4 * TIMES), size * np.cos(4 * TIMES)
    nodes = [method_node(x, y, "one", inputs=drawn, status=status), method_node(1.3 * y, -1.1 * x, "<b>two")]
    tree = results.study_tree(nodes, study="s", mechanism="m", attrs={"over": json.dumps({"y": "x"})})
    return tree, report.write_report(tree, tmp_path_factory.mktemp("marks") / "report.html")


def shown(page, starts):
    """Bring a chart into view, when those above it have their height."""
    figure = page.locator(f'figure.charted[data-alt^="{starts}"]')
    for _ in range(8):
        figure.scroll_into_view_if_needed()
        page.wait_for_timeout(200)
    figure.locator("canvas").wait_for()
    return figure


def cells(figure):
    """Return the numbers beside each method; none where there is no mark."""
    rows = {}
    for row in figure.locator("tbody tr").all():
        texts = [text.replace("−", "-") for text in row.locator("td").all_inner_texts()]
        rows[row.locator("th").inner_text()] = [None if text == "–" else float(text) for text in texts]
    return rows


def saved(page, figure, name):
    """Return what a button saves."""
    with page.expect_download() as download:
        figure.get_by_role("button", name=name, exact=True).click()
    return download.value.path().read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_loop_has_the_time_of_the_page(opened, page_file, scheme):
    tree, path = page_file
    page = opened(path, color_scheme=scheme)
    figure = shown(page, "y over x")
    page.evaluate("document.dispatchEvent(new CustomEvent('uqmbd-time', { detail: { time: 0.4, source: null } }))")
    assert figure.locator("caption").inner_text() == "At 0.4 s"
    for label, (y, x) in cells(figure).items():
        means = tree[label]["statistics"]["mean"].sel(time=0.4, method="nearest")
        assert y == pytest.approx(float(means.sel(output="y")), abs=1e-3)
        assert x == pytest.approx(float(means.sel(output="x")), abs=1e-3)
    # the pointer chooses the nearest mark, and the page follows
    page.evaluate("document.addEventListener('uqmbd-time', ({ detail }) => (window.heard = detail.time))")
    ring = figure.locator(".ring").nth(1).bounding_box()
    page.mouse.move(ring["x"] + 40, ring["y"] + 60, steps=3)
    page.wait_for_timeout(100)
    heard = page.evaluate("window.heard")
    assert figure.locator("caption").inner_text() == f"At {heard:.4g} s" and heard != 0.4
    now = figure.locator(".ring").nth(1).bounding_box()
    assert (now["x"], now["y"]) != (ring["x"], ring["y"])
    plot = figure.locator(".plot")
    plot.press("Home")
    assert page.evaluate("window.heard") == 0
    said = plot.get_attribute("aria-valuetext")
    assert said.startswith("0 s: one: y ") and " deg, x 0" in said and "<b>two: y" in said
    # what is switched off is neither ringed nor told
    figure.locator("tbody button").first.click()
    assert not figure.locator(".ring").first.is_visible() and figure.locator(".ring").nth(1).is_visible()
    assert "one" not in plot.get_attribute("aria-valuetext").split(": ")


@pytest.mark.slow
def test_a_plane_zooms_along_both_axes(opened, page_file):
    _, path = page_file
    page = opened(path)
    figure = shown(page, "y over x")
    everything = figure.get_by_role("button", name="Show all", exact=True)
    left, top, right, bottom = (figure.locator(".u-over").bounding_box()[k] for k in ("x", "y", "width", "height"))
    before = figure.locator("canvas").screenshot()
    page.mouse.move(left + 0.2 * right, top + 0.2 * bottom)
    page.mouse.down()
    page.mouse.move(left + 0.5 * right, top + 0.5 * bottom, steps=4)
    page.mouse.up()
    page.wait_for_timeout(100)
    assert everything.is_visible() and figure.locator("canvas").screenshot() != before
    drawing = ET.fromstring(saved(page, figure, "SVG"))
    ticks = [one.text for one in drawing.iter("{http://www.w3.org/2000/svg}text")]
    everything.click()
    page.wait_for_timeout(100)
    assert not everything.is_visible()
    plot = figure.locator(".plot")
    for _ in range(3):
        plot.press("+")
    page.wait_for_timeout(100)
    assert everything.is_visible() and figure.locator(".ring:visible").count() >= 1
    plot.press("0")
    page.wait_for_timeout(100)
    whole = ET.fromstring(saved(page, figure, "SVG"))
    assert ticks != [one.text for one in whole.iter("{http://www.w3.org/2000/svg}text")]
    assert "<b>two: mean at each time" in [one.text for one in whole.iter("{http://www.w3.org/2000/svg}text")]
    assert saved(page, figure, "PNG").startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1200])
def test_failures_tell_the_sample_beneath_the_pointer(opened, page_file, width):
    tree, path = page_file
    page = opened(path, width=width)
    figure = shown(page, "Inputs of failed")
    samples = tree["one"]["samples"].to_dataset()
    failed = np.flatnonzero(samples["status"].values)
    assert figure.locator("caption").inner_text() == f"At sample {failed[0]}"
    ring = figure.locator(".ring:visible")
    assert ring.count() == 1
    box = ring.bounding_box()
    figure.locator(".plot").press("Home")
    assert figure.locator("caption").inner_text() == "At sample 0"
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, steps=3)
    assert figure.locator("caption").inner_text() == f"At sample {failed[0]}"
    rows = cells(figure)
    heads = figure.locator("thead th").all_inner_texts()[1:]
    units = dict(zip((f"{n}" for n in samples["input"].values), samples["inputs"].values[failed[0]], strict=True))
    expected = [next(v for n, v in units.items() if head.startswith(n)) for head in heads]
    assert rows[f"failed ({len(failed)})"] == pytest.approx(expected, abs=0.01)
    assert rows[f"succeeded ({120 - len(failed)})"] == [None, None]
    rows = list(csv.reader(saved(page, figure, "CSV").decode().splitlines()))
    assert len(rows) == 121 and rows[0][0] == "sample"
    column = next(k for k, head in enumerate(rows[0]) if re.match(r"k <b>.*by failed", head))
    told = {int(row[0]): float(row[column]) for row in rows[1:] if row[column]}
    assert told == pytest.approx({int(k): samples["inputs"].values[k, 0] for k in failed})
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.slow
def test_paper_has_points_and_loops(opened, page_file):
    _, path = page_file
    page = opened(path)
    assert page.pdf().startswith(b"%PDF")
    figure = page.locator('figure.charted[data-alt^="Inputs of failed"] .paper svg')
    # one path of marks for those that failed, and one for the others
    marks = """(all) => all.filter((one) => one.getAttribute("d").length > 500 && one.getAttribute("fill") !== "none").length"""
    assert figure.locator("g path").evaluate_all(marks) == 2
    loop = page.locator('figure.charted[data-alt^="y over x"] .paper svg')
    assert "one: mean at each time, single realisations" in loop.locator("text").all_text_contents()


@pytest.mark.slow
def test_hostile_names_are_texts_in_a_plane(opened, tmp_path):
    """Names of outputs, inputs, methods and reasons that look like HTML, scripts or formulas are told as they are."""
    hostile = [HOSTILE[key] for key in ("script", "close", "attribute", "template", "mathematics")]
    drawn = np.random.default_rng(3).normal(size=(60, 2))
    status = np.where(drawn[:, 0] > 1, 2, 0)
    x, y = drawn[:, :1] * np.sin(4 * TIMES), drawn[:, :1] * np.cos(4 * TIMES)
    axes = extend.labels([(hostile[0], "m"), (hostile[1], "m")], hostile[2:4], TIMES)
    messages = [hostile[4] if s else "" for s in status]
    samples = extend.sample_dataset(np.stack([x, y], axis=1), drawn, axes, status=status, messages=messages)
    statistics = extend.statistics_of_samples(samples)
    one = results.propagator_node(
        hostile[4], statistics, samples=samples, propagator="p", realisations=60, wall_time=0.0
    )
    tree = results.study_tree([one], study="s", mechanism="m", attrs={"over": json.dumps({hostile[1]: hostile[0]})})
    page = opened(report.write_report(tree, tmp_path / "report.html"))
    asked = []
    page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    for starts, heads in ((f"{hostile[1]} over", hostile[1::-1]), ("Inputs of failed", None)):
        figure = page.locator("figure.charted").filter(has=page.locator("figcaption")).nth(0)
        for candidate in page.locator("figure.charted").all():
            if (candidate.get_attribute("data-alt") or "").startswith(starts):
                figure = candidate
        for _ in range(8):
            figure.scroll_into_view_if_needed()
            page.wait_for_timeout(150)
        told = figure.locator("thead th").all_text_contents()[1:]
        if heads is None:
            assert sorted(told) == sorted(hostile[2:4])
        else:
            assert told == [f"{name} [m]" for name in heads]
        head = next(csv.reader(saved(page, figure, "CSV").decode().splitlines()))
        assert all(not re.match(r"[=+@\t\r-]", one) for one in head)
        elements = set(figure.locator(".chart *").evaluate_all("(all) => all.map((one) => one.localName)"))
        assert elements <= set("div canvas table caption thead tbody tr th td button span svg line path".split())
        drawing = ET.fromstring(saved(page, figure, "SVG"))
        kinds = {one.tag.removeprefix("{http://www.w3.org/2000/svg}") for one in drawing.iter()}
        assert kinds <= {"svg", "rect", "text", "path", "g", "clipPath"}
    assert asked == []


@pytest.mark.thorough
def test_a_page_of_every_chart_loads_no_matplotlib(tmp_path):
    """Loops, functions of another output, failures, errors against cost, one time: none of them is Matplotlib's."""
    rng = np.random.default_rng(3)
    drawn = rng.normal(size=(60, 2))
    x = (1 + 0.1 * drawn[:, :1]) * np.sin(4 * TIMES)
    node = method_node(x, x**2, inputs=drawn, status=np.where(drawn[:, 0] > 1, 2, 0))
    tree = results.study_tree([node], study="s", mechanism="m", attrs={"over": json.dumps({"y": "x"})})
    curves = convergence().assign_coords(output=["y"])
    more = {
        "option": (("method",), ["order", "samples"]),
        "problem": (("method", "level"), [[""] * 3] * 2),
        "std_rate": (("method", "output"), [[1.0], [0.5]]),
        "mean_rate": (("method", "output"), [[1.0], [0.5]]),
    }
    tree["convergence"] = xr.DataTree(curves.assign(more))
    still = results.study_tree([loops(times=TIMES[:1])], study="s", mechanism="m")
    results.save(tree, tmp_path / "tree.nc")
    results.save(still, tmp_path / "still.nc")
    told = subprocess.run(
        [sys.executable, "-c", ALONE, str(tmp_path)], capture_output=True, text=True, timeout=120, check=False
    )
    assert told.stdout.split() == ["False"], told.stderr
    page = (tmp_path / "tree.html").read_text(encoding="utf-8")
    assert page.count("<img") == 0 and 'id="growth"' in page and "Inputs of the failed" in page
    assert "could not be drawn" not in page


ALONE = """
import sys
from pathlib import Path
from uqmbd import extend, report, results
for name in ("tree", "still"):
    report.write_report(results.load(Path(sys.argv[1]) / f"{name}.nc"), Path(sys.argv[1]) / f"{name}.html")
print("matplotlib" in sys.modules)
"""
