"""Charts of the report, driven in a browser: their numbers are those of the tree, whatever is done to them."""

import csv
import io
import re

import numpy as np
import pytest

from uqmbd import extend, report, results

from ..test_hostile_names import HOSTILE

pytestmark = pytest.mark.slow

METHODS = ("monte-carlo", "second", "galerkin $3")


@pytest.fixture(scope="module")
def page_file(study, tmp_path_factory):
    """Return the report of a study of three methods, one of which knows no quantiles."""
    return report.write_report(study, tmp_path_factory.mktemp("charts") / "report.html")


def chart(page, number=1):
    """Bring the chart of an output into view."""
    figure = page.locator(f"#output-{number} figure.charted").first
    figure.scroll_into_view_if_needed()
    figure.locator(".plot canvas").wait_for()
    # those above it become charts, too, and are as high as that then
    seen = []

    def rests():
        seen.append(figure.bounding_box()["y"])
        return len(seen) > 4 and len(set(seen[-4:])) == 1

    until(page, rests)
    figure.scroll_into_view_if_needed()
    return figure


def inner(figure):
    """Return where lines are drawn: left, top, width and height."""
    box = figure.locator(".u-over").bounding_box()
    return box["x"], box["y"], box["width"], box["height"]


def until(page, true):
    """Wait for what a busy browser does late; it is false in the end if it does not happen."""
    for _ in range(200):
        if true():
            return
        page.wait_for_timeout(50)
    assert true()


def point(page, figure, share, down=0.5):
    """Move the mouse to a share of the width of a chart."""
    left, top, width, height = inner(figure)
    page.mouse.move(left + share * width, top + down * height, steps=3)


def number(text):
    """Read a number as people do."""
    text = text.replace("−", "-").split(" × 10")
    power = text[1].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) if len(text) > 1 else "0"
    return float(text[0]) * 10.0 ** int(power)


def told(figure):
    """Return the time of the table and, for each method, its mean, standard deviation and band."""
    caption = figure.locator("caption").inner_text()
    rows = {}
    for row in figure.locator("tbody tr").all():
        mean, std, band = row.locator("td").all_inner_texts()
        rows[row.locator("th").inner_text()] = [number(mean), number(std), *map(number, band.split(" to "))]
    return number(re.match(r"At (\S+) s", caption)[1]), rows


def pixels(figure, colour):
    """Count the pixels of a colour in a chart."""
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return figure.locator("canvas").evaluate(
        """(canvas, [r, g, b]) => {
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            let found = 0;
            for (let k = 0; k < data.length; k += 4)
                if (Math.max(Math.abs(data[k] - r), Math.abs(data[k + 1] - g), Math.abs(data[k + 2] - b)) < 3) found++;
            return found;
        }""",
        wanted,
    )


def saved(page, figure, name):
    """Press a button, and return the name and the content of the file that it saves."""
    with page.expect_download() as download:
        figure.get_by_role("button", name=name, exact=True).click()
    return download.value.suggested_filename, download.value.path().read_bytes()


@pytest.mark.parametrize(("number_of_output", "output"), [(1, "slider_x"), (2, r"$F_{pin} \frac <b>&")])
def test_values_beneath_the_pointer_are_those_of_the_tree(opened, page_file, study, number_of_output, output):
    page = opened(page_file)
    figure = chart(page, number_of_output)
    for share in (0.1, 0.5, 0.93):
        point(page, figure, share)
        time, rows = told(figure)
        assert time == pytest.approx(2.0 * share, abs=0.026)
        assert list(rows) == list(METHODS)
        for label, (mean, std, low, high) in rows.items():
            at = study[label]["statistics"].to_dataset().sel(output=output).sel(time=time, method="nearest")
            spread = float(at["std"])
            assert mean == pytest.approx(float(at["mean"]), abs=6e-3 * spread)
            assert std == pytest.approx(spread, rel=6e-4)
            if label != "galerkin $3":
                ends = at["quantile"].sel(probability=[0.025, 0.975]).values
                np.testing.assert_allclose([low, high], ends, rtol=1e-13, atol=6e-3 * spread)


def test_the_table_starts_where_it_is_most_uncertain(opened, page_file, study):
    figure = chart(opened(page_file))
    std = study["monte-carlo/statistics/std"].sel(output="slider_x")
    assert told(figure)[0] == pytest.approx(float(std["time"][std.values.argmax()]), abs=1e-3)


def test_dragging_zooms_and_a_double_click_shows_all(opened, page_file):
    page = opened(page_file)
    figure = chart(page)
    everything = figure.get_by_role("button", name="Show all times")
    assert not everything.is_visible()
    point(page, figure, 0.25)
    page.mouse.down()
    point(page, figure, 0.5)
    page.mouse.up()
    assert everything.is_visible()
    for share, time in ((0.01, 0.5), (0.99, 1.0)):
        point(page, figure, share)
        assert told(figure)[0] == pytest.approx(time, abs=0.026)
    point(page, figure, 0.5)
    page.mouse.dblclick(*[inner(figure)[k] + inner(figure)[k + 2] / 2 for k in (0, 1)])
    assert not everything.is_visible()
    point(page, figure, 0.99)
    assert told(figure)[0] == pytest.approx(2.0, abs=0.026)
    # with Control the wheel zooms about the pointer; without, it scrolls the page
    page.mouse.wheel(0, -100)
    assert not everything.is_visible()
    point(page, figure, 0.5)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -100)
    page.keyboard.up("Control")
    everything.wait_for()
    everything.click()
    assert not everything.is_visible()


def test_methods_are_switched_off_and_on(opened, page_file):
    page = opened(page_file)
    figure = chart(page)
    second = figure.get_by_role("button", name="second")
    assert second.get_attribute("aria-pressed") == "true" and pixels(figure, "#D55E00")
    second.click()
    page.wait_for_timeout(50)
    assert second.get_attribute("aria-pressed") == "false" and not pixels(figure, "#D55E00")
    assert "second" not in figure.locator(".plot").get_attribute("aria-valuetext")
    # the bands are then those of the first one that is left
    figure.get_by_role("button", name="monte-carlo").click()
    page.wait_for_timeout(50)
    assert not pixels(figure, "#0072B2") and pixels(figure, "#009E73")
    second.click()
    page.wait_for_timeout(50)
    assert pixels(figure, "#D55E00")


@pytest.mark.parametrize(("number_of_output", "output"), [(1, "slider_x"), (2, r"$F_{pin} \frac <b>&"), (4, "zero")])
def test_the_data_as_csv_are_those_of_the_tree(opened, page_file, study, number_of_output, output):
    page = opened(page_file)
    name, content = saved(page, chart(page, number_of_output), "CSV")
    assert re.fullmatch(r"[\w.+-]+\.csv", name)
    head, *rows = csv.reader(io.StringIO(content.decode("utf-8")))
    read = np.array(rows, dtype=float)
    assert head[0] == "time [s]" and len(head) == 1 + 3 * 2 + 2 * 4 + 2
    np.testing.assert_array_equal(read[:, 0], study["monte-carlo/statistics/time"].values)
    units = str(study["monte-carlo/statistics/output_units"].sel(output=output).item())
    for label in METHODS:
        data = study[label]["statistics"].to_dataset().sel(output=output)
        mean, std = (data[key].values for key in ("mean", "std"))
        ends = (
            data["quantile"].sel(probability=[0.025, 0.975, 0.25, 0.75]).values
            if label != "galerkin $3"
            else [mean - 1.96 * std, mean + 1.96 * std]
        )
        columns = [
            k for k, text in enumerate(head) if text.endswith(f" of {output} by {label} [{units}]" if units else label)
        ]
        # the mean to the bit, the others to seven digits of their distance from it
        np.testing.assert_array_equal(read[:, columns[0]], mean)
        for column, expected in zip(columns, [mean, std, *ends], strict=True):
            np.testing.assert_allclose(read[:, column], expected, rtol=1e-15, atol=2e-7 * std.max())


def test_pictures_are_saved(opened, page_file):
    page = opened(page_file, color_scheme="dark")
    figure = chart(page)
    name, content = saved(page, figure, "PNG")
    assert name == "slider_x.png" and content.startswith(b"\x89PNG")
    from matplotlib.image import imread

    drawn = imread(io.BytesIO(content))
    assert drawn.shape[1] >= 1600 and drawn[0, 0, :3].tolist() == [1, 1, 1]
    blue = np.abs(drawn[..., :3] - np.array([0, 0x72, 0xB2]) / 255).max(axis=-1) < 0.01
    assert blue[: drawn.shape[0] // 5].any() and blue[drawn.shape[0] // 5 :].sum() > 1000
    name, content = saved(page, figure, "SVG")
    assert name == "slider_x.svg" and b"<svg" in content


def test_keys_do_all_that_the_mouse_does(opened, page_file, study):
    page = opened(page_file)
    figure = chart(page)
    plot = figure.locator(".plot")
    page.locator("#output-1 > details > summary").focus()
    page.keyboard.press("Tab")
    assert plot.evaluate("(plot) => plot === document.activeElement")
    times = study["monte-carlo/statistics/time"].values
    now = lambda: float(plot.get_attribute("aria-valuenow"))  # noqa: E731
    page.keyboard.press("Home")
    assert now() == times[0]
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    assert now() == times[11] and told(figure)[0] == pytest.approx(times[11], abs=1e-3)
    assert "monte-carlo: mean" in plot.get_attribute("aria-valuetext")
    page.keyboard.press("+")
    everything = figure.get_by_role("button", name="Show all times")
    assert everything.is_visible()
    page.keyboard.press("End")  # the window goes along
    assert now() == times[-1] and everything.is_visible()
    page.keyboard.press("0")
    assert not everything.is_visible()
    for _ in range(3):
        page.keyboard.press("Tab")
    with page.expect_download():
        page.keyboard.press("Enter")


def test_all_charts_are_at_one_time(opened, page_file):
    page = opened(page_file)
    second = chart(page, 2)
    first = chart(page, 1)
    page.evaluate("document.addEventListener('uqmbd-time', (e) => (window.heard = e.detail.time))")
    point(page, first, 0.3)
    assert told(first)[0] == told(second)[0] == pytest.approx(page.evaluate("heard"), abs=1e-3)
    page.evaluate("document.dispatchEvent(new CustomEvent('uqmbd-time', { detail: { time: 1.21 } }))")
    assert told(first)[0] == told(second)[0] == pytest.approx(1.2)
    # one that is made later begins there, too
    assert told(chart(page, 4))[0] == pytest.approx(1.2)


def test_fingers_move_the_time_and_zoom(opened, page_file):
    page = opened(page_file, width=390, height=800, has_touch=True, is_mobile=True)
    figure = chart(page)
    left, top, width, height = inner(figure)
    client = page.context.new_cdp_session(page)

    def touch(kind, *shares):
        points = [{"x": left + share * width, "y": top + height / 2, "id": k} for k, share in enumerate(shares)]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 0.2)
    for share in (0.3, 0.4, 0.6):
        touch("touchMove", share)
    touch("touchEnd")
    until(page, lambda: abs(told(figure)[0] - 1.2) < 0.06)
    everything = figure.get_by_role("button", name="Show all times")
    assert not everything.is_visible()
    touch("touchStart", 0.4, 0.6)
    touch("touchMove", 0.3, 0.7)
    touch("touchMove", 0.2, 0.8)
    touch("touchEnd")
    until(page, everything.is_visible)
    everything.tap()
    until(page, everything.is_hidden)


def test_dark_pages_have_dark_charts(opened, page_file):
    page = opened(page_file, color_scheme="dark")
    figure = chart(page)
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    assert pixels(figure, "#56B4E9") and not pixels(figure, "#0072B2")
    page.emulate_media(color_scheme="light")
    page.wait_for_timeout(100)
    assert pixels(figure, "#0072B2") and not pixels(figure, "#56B4E9")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


def test_paper_has_what_the_browser_draws(opened, page_file):
    """Every chart, also those that were never seen, as a drawing on white; methods that are off are not in it."""
    page = opened(page_file, color_scheme="dark")
    first = chart(page)
    first.get_by_role("button", name="second").click()
    assert page.locator(".paper svg").count() == 0
    assert page.pdf().startswith(b"%PDF")
    drawings = page.locator("figure.live > .paper > svg")
    several = page.locator("figure.several")
    assert drawings.count() + several.count() == page.locator("figure.charted").count()
    assert page.locator("figure.live").count() == page.locator("figure.charted").count()
    views = several.locator(".view")
    assert views.locator("> .paper > svg").count() == views.count() > 2 * several.count() > 0
    legend = first.locator(".paper text").all_text_contents()
    assert any(text.startswith("monte-carlo") for text in legend) and not any(t.startswith("second") for t in legend)
    page.emulate_media(media="print")
    assert first.locator(".paper").is_visible() and not first.locator("canvas").is_visible()
    assert not page.locator(".tools:visible").count()


def test_without_scripts_the_figures_stand(opened, page_file):
    page = opened(page_file, java_script_enabled=False)
    assert page.locator("canvas").count() == 0 and page.locator("#in-view figcaption").is_visible()
    assert "its numbers are in the tables" in page.locator("#in-view").inner_text()
    figure = page.locator("#output-1 figure.charted").first
    assert "its numbers are in the tables" in figure.inner_text()
    assert page.locator("#outputs table").first.is_visible()


@pytest.mark.parametrize("width", [390, 768, 1920])
def test_nothing_is_wider_than_the_page(opened, page_file, width):
    page = opened(page_file, width=width)
    for k in (1, 2, 3, 4):
        figure = chart(page, k)
        assert figure.locator("canvas").bounding_box()["width"] <= width
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_a_chart_follows_the_width_of_the_page(opened, page_file):
    page = opened(page_file, width=1200)
    figure = chart(page)
    page.set_viewport_size({"width": 500, "height": 900})
    page.wait_for_timeout(100)
    assert figure.locator("canvas").bounding_box()["width"] <= 500


def test_hostile_names_are_texts(opened, tmp_path):
    names = list(HOSTILE.values())
    axes = extend.labels(
        [(name, names[(k + 5) % len(names)]) for k, name in enumerate(names)], [], np.linspace(0, 1, 5)
    )
    mean = np.arange(5.0) + np.arange(len(names))[:, None]
    nodes = [
        results.propagator_node(
            label,
            extend.statistics_dataset(axes, mean=mean, std=0.1 + 0 * mean),
            propagator="p",
            realisations=1,
            wall_time=0.0,
        )
        for label in (HOSTILE["mathematics"], HOSTILE["attribute"], HOSTILE["underscore"])
    ]
    page = opened(
        report.write_report(results.study_tree(nodes, study="s", mechanism="m"), tmp_path / "report.html"), width=390
    )
    asked = []
    page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    page.evaluate("document.querySelectorAll('details').forEach((folded) => (folded.open = true))")
    elements = set()
    for k, name in enumerate(HOSTILE.values(), 1):
        title = page.locator(f"#output-{k} h3").text_content()
        figure = chart(page, k)
        label = figure.locator(".plot").get_attribute("aria-label")
        assert label == f"Time in the chart of {name}" and title.split() == name.split()
        assert figure.locator("tbody button").all_text_contents() == [node.attrs["label"] for node in nodes]
        file, content = saved(page, figure, "CSV")
        assert re.fullmatch(r"[\w.+-]{1,100}\.csv", file) and not file.startswith(".")
        head = next(csv.reader(io.StringIO(content.decode("utf-8"), newline="")))
        assert all(f" of {name} by " in text for text in head[1:])
        elements |= set(figure.locator(".chart *").evaluate_all("(all) => all.map((one) => one.localName)"))
    assert elements <= set("div canvas table caption thead tbody tr th td button span svg line path".split())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390 and not asked
