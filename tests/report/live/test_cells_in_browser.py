"""Outputs of notebooks stand beside each other on a page that is not ours: each is alive, and none disturbs another."""

import pytest

from uqmbd import report

pytestmark = pytest.mark.slow

PAGE = """<!doctype html><meta charset="utf-8">
<style>button, figure, table, canvas {{ display: none !important; }} .plot {{ width: 10px !important; }}</style>
<p class="tools" id="own">the notebook's own</p>
{cells}
"""

INSERTED = """
([html, clone]) => {
  // as JupyterLab does: the text as HTML, and then scripts made anew, which run
  const place = document.createElement("div");
  place.innerHTML = html;
  document.body.append(place);
  for (const script of place.querySelectorAll("script")) {
    const made = document.createElement("script");
    for (const { name, value } of script.attributes) made.setAttribute(name, value);
    made.textContent = script.textContent;
    // as VS Code does: they are taken away at once
    if (clone) place.append(made), made.remove();
    else script.replaceWith(made);
  }
}
"""


@pytest.fixture
def html(study):
    """Return an output with two charts."""
    return report.show(study, ["slider_x", "zero"]).html


def alive(page, cell):
    """Bring the charts of an output into view."""
    for figure in cell.locator("figure.charted").all():
        figure.scroll_into_view_if_needed()
        figure.locator("canvas").wait_for()
    return [figure.locator("caption").inner_text() for figure in cell.locator("figure.charted").all()]


def hover(page, cell, share):
    """Point at a share of the width of the first chart."""
    plot = cell.locator(".u-over").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + share * box["width"], box["y"] + 50, steps=3)


def test_outputs_on_one_page_are_alive_and_apart(opened, html, study, tmp_path):
    path = tmp_path / "page.html"
    other = report.show(study["monte-carlo"], ["slider_x"]).html
    path.write_text(PAGE.format(cells=html + other + html), encoding="utf-8")
    page = opened(path)
    cells = page.locator(".uqmbd-cell").all()
    assert len(cells) == 3
    for cell in cells:
        before = alive(page, cell)
        assert (
            cell.get_by_role("button", name="CSV").first.is_visible()
            and cell.locator("canvas").first.bounding_box()["width"] > 500
        )
        assert len(set(before)) <= 2
    first = [alive(page, cell) for cell in cells]
    hover(page, cells[0], 0.25)
    # one time for all charts of an output, and its own
    now = [alive(page, cell) for cell in cells]
    assert now[0] == ["At 0.5 s, in m", "At 0.5 s, in rad"] and now[1:] == first[1:]
    assert page.evaluate("getComputedStyle(document.querySelector('#own')).float") == "none"
    assert page.evaluate("Object.keys(window).filter((name) => /plot|chart|cell/i.test(name))") == []


@pytest.mark.parametrize("clone", [False, True], ids=["JupyterLab", "VS Code"])
def test_scripts_run_where_notebooks_put_them(opened, html, tmp_path, clone):
    path = tmp_path / "page.html"
    path.write_text("<!doctype html><meta charset='utf-8'>", encoding="utf-8")
    page = opened(path)
    for k in range(2):
        page.evaluate(INSERTED, [html, clone])
        cell = page.locator(".uqmbd-cell").nth(k)
        assert len(alive(page, cell)) == 2
    with page.expect_download() as download:
        page.locator(".uqmbd-cell").nth(1).get_by_role("button", name="CSV").first.click()
    assert download.value.suggested_filename == "slider_x.csv"


def test_without_scripts_the_figures_stand(opened, html, tmp_path):
    path = tmp_path / "page.html"
    path.write_text("<!doctype html><meta charset='utf-8'>" + html, encoding="utf-8")
    page = opened(path, java_script_enabled=False)
    assert page.locator("figure img").count() == 2 and page.locator("figure img").first.is_visible()
    assert page.locator("canvas").count() == 0


@pytest.mark.parametrize(("scheme", "ground"), [("light", "rgb(255, 255, 255)"), ("dark", "rgb(20, 24, 29)")])
def test_charts_and_their_ground_go_together(opened, html, tmp_path, scheme, ground):
    """On any page: a notebook has a theme of its own, which may be another one than the system's."""
    path = tmp_path / "page.html"
    path.write_text("<!doctype html><meta charset='utf-8'><body style='background:#888'>" + html, encoding="utf-8")
    page = opened(path, color_scheme=scheme)
    alive(page, page.locator(".uqmbd-cell"))
    cell = page.locator(".cell")
    assert cell.evaluate("(one) => getComputedStyle(one).backgroundColor") == ground
    # the grid is seen on the ground, and is fainter than the letters
    grid = "e3e7ec" if scheme == "light" else "333b44"
    wanted = [int(grid[k : k + 2], 16) for k in (0, 2, 4)]
    count = """(canvas, [r, g, b]) => {
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let found = 0;
        for (let k = 0; k < data.length; k += 4) found += data[k] === r && data[k + 1] === g && data[k + 2] === b;
        return found;
    }"""
    assert cell.locator("canvas").first.evaluate(count, wanted) > 500


@pytest.mark.parametrize(
    ("body", "other"),
    [
        ('data-jp-theme-light="false"', "document.body.dataset.jpThemeLight = 'true'"),
        ('class="vscode-dark"', "document.body.className = 'vscode-light'"),
        ('data-vscode-theme-kind="vscode-high-contrast"', "document.body.dataset.vscodeThemeKind = 'vscode-light'"),
    ],
)
def test_an_output_is_as_dark_as_its_notebook(opened, html, tmp_path, body, other):
    """Whatever the system prefers; it changes with the notebook."""
    path = tmp_path / "page.html"
    path.write_text(f'<!doctype html><meta charset="utf-8"><body {body}>{html}', encoding="utf-8")
    page = opened(path, color_scheme="light")
    cell = page.locator(".uqmbd-cell")
    alive(page, cell)
    ground = "(place) => getComputedStyle(place.shadowRoot.querySelector('.cell')).backgroundColor"
    canvas = "(place) => place.shadowRoot.querySelector('canvas').toDataURL()"
    dark = cell.evaluate(canvas)
    assert cell.evaluate(ground) == "rgb(20, 24, 29)"
    page.evaluate(other)
    page.wait_for_timeout(200)
    assert cell.evaluate(ground) == "rgb(255, 255, 255)" and cell.evaluate(canvas) != dark
