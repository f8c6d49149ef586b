"""The report: one offline file that says everything once, escapes everything, and survives broken plugins."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd import extend, report, results
from uqmbd.errors import StudyError

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Collects tags, attributes and text, and checks that every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open and "script" not in self.open:
            self.text += data


class Extra:
    """A section as a plugin gives it."""

    title = "Extra & more"

    def render(self, tree: xr.DataTree) -> str:
        """Return a fragment."""
        return f"<p>From <b>{len(tree.children)}</b> nodes.</p>"


class Broken:
    """A section that raises."""

    title = "Broken <section>"

    def render(self, tree: xr.DataTree) -> str:
        """Raise."""
        raise RuntimeError("no <data>")


class Wrong:
    """A section that returns no text."""

    title = "Wrong"

    def render(self, tree: xr.DataTree) -> str:
        """Return a number."""
        return 3  # type: ignore[return-value]


@pytest.fixture(scope="module")
def source(study: xr.DataTree, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the report of the study with three plugin sections."""
    path = tmp_path_factory.mktemp("report") / "new" / "report.html"
    with pytest.warns(uqmbd.extend.PluginWarning, match="is omitted") as told:
        assert report.write_report(study, path, sections=[Extra(), Broken(), Wrong()]) == path
    assert len(told) == 2
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    return path.read_text(encoding="utf-8")


@pytest.mark.thorough
def test_it_is_self_contained(source: str) -> None:
    """No fonts, no links to anywhere: every address is inside the file, and the page forbids itself any other."""
    page = Page(source)
    names = {tag for tag, _ in page.tags}
    assert not names & {"link", "iframe", "object"}
    (policy,) = [attrs["content"] for _, attrs in page.tags if attrs.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy and "http" not in policy and "unsafe-eval" not in policy
    for _, attrs in page.tags:
        for key in ("src", "href"):
            value = attrs.get(key) or "#"
            assert value.startswith(("#", "data:image/svg+xml;base64,"))
        assert not any(key.startswith("on") for key in attrs)
    assert not re.search(r"url\((?!#)", source) and "@import" not in source  # a part of the page itself
    targets = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    assert {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"} <= targets


def test_it_is_accessible(source: str) -> None:
    """Language, viewport, a text for every image, a scope for every table header."""
    page = Page(source)
    assert ("html", {"lang": "en"}) in page.tags
    assert any(attrs.get("name") == "viewport" for _, attrs in page.tags)
    said = [attrs["alt"] for tag, attrs in page.tags if tag == "img"]
    said += [attrs["aria-label"] for tag, attrs in page.tags if tag == "svg" and attrs.get("role") == "img"]
    said += [
        attrs["data-alt"]
        for tag, attrs in page.tags
        if tag == "figure" and "data-alt" in attrs and attrs.get("class", "").startswith("charted")
    ]
    assert said and all(said)
    assert all(attrs.get("data-alt", "of the first screen") for attrs in (a for tag, a in page.tags if tag == "figure"))
    assert all(attrs.get("scope") in ("col", "row") for tag, attrs in page.tags if tag == "th")


def test_it_says_everything(source: str, study: xr.DataTree) -> None:
    """Study, outputs, inputs, failures with reasons, cost, comparison, provenance and the command are there."""
    text = " ".join(Page(source).text.split())
    for expected in (
        "crank <1>",
        "Mechanism: oscillator",
        "2 inputs",
        "4 outputs",
        "3 methods",
        "Normal(mu=40, sigma=2)",
        r"$F_{pin} \frac <b>&",
        "2 of 60 realisations (3.33 %) failed",
        "Integration failed: 2 samples (100 % of the failures)",
        "step too small at 'pin' <img src=x>",
        "No realisation of second, galerkin $3 failed.",
        "residual evaluations12 345",
        "realisations integrated separately3",
        "time in the integrator, summed over workers1 min 15 s",
        "my counter1.5",
        "Largest standard deviation",
        "with 95 % confidence",
        "240 samples instead of 60 would halve the stated error",
        "Differences from the reference, second",
        "uqmbd run 'a & b.py'",
        "option samples",
    ):
        assert expected in text, expected
    assert "could not be drawn" not in text
    mean = float(study["monte-carlo/statistics/mean"].sel(output="slider_x", time=2.0))
    assert f"{mean:.3f} ± " in text
    k = float(study["monte-carlo/samples/inputs"][0, 0])
    assert f"{k:.6g}" in text


def test_the_contents_lead_to_every_output(source: str) -> None:
    """Each output has an anchor in the contents and is open; only details are folded, and paper has them all."""
    page = Page(source)
    targets = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    assert [t for t in targets if t.startswith("#output-")] == [f"#output-{k}" for k in range(1, 5)]
    headings = [tag for tag, _ in page.tags if tag in ("h1", "h2", "h3", "h4")]
    assert headings[0] == "h1" and headings.count("h1") == 1
    folded = [attrs for tag, attrs in page.tags if tag == "details" and "open" not in attrs]
    assert {one["class"] for one in folded} == {"more", "provenance"}
    assert "details::details-content" in source


def test_figures_come_in_order_with_their_words(source: str) -> None:
    """Bands, densities, convergence, standard deviation: each with an alternative text."""
    every = [attrs.get("alt") or attrs.get("data-alt") for tag, attrs in Page(source).tags if tag in ("img", "figure")]
    alts = [alt for alt in every if alt]
    starts = ["Mean of", "Probability densities of", "Mean and standard", "Standard dev"]
    of_first = alts[1:5]
    assert all(alt.startswith(start) and "slider_x" in alt for alt, start in zip(of_first, starts, strict=True))


@pytest.mark.thorough
def test_reports_stay_small(tmp_path: Path) -> None:
    """Noisy outputs of 1,000 samples at 2,000 times: with twenty of them the file would stay below 15 MB."""
    times = np.linspace(0, 1, 2000)
    rng = np.random.default_rng(0)
    names = [(f"x{k}", "m") for k in range(3)]
    response = np.sin(30 * times + rng.normal(size=(1000, 3, 1))) + 0.01 * rng.normal(size=(1000, 3, 2000))
    axes = extend.labels(names, ["k"], times)
    samples = extend.sample_dataset(response, rng.normal(size=(1000, 1)), axes)
    node = results.propagator_node(
        "a", extend.statistics_of_samples(samples), samples, propagator="p", realisations=1000, wall_time=1.0
    )
    path = report.write_report(results.study_tree([node], study="s", mechanism="m"), tmp_path / "a.html")
    assert path.stat().st_size / 3 * 20 < 15e6


def test_user_text_is_escaped(source: str) -> None:
    """Names and messages are text, never markup: scripts are the data of charts, the library, and our own."""
    kinds = [attrs.get("type") for tag, attrs in Page(source).tags if tag == "script"]
    classes = [(attrs.get("class") or "").split() for tag, attrs in Page(source).tags if tag in ("figure", "div")]
    data = sum("charted" in names or "explorer" in names for names in classes)
    data += source.count('id="shared-arrays"')
    assert kinds == ["application/json"] * data + [None, "module"] and data > 7
    assert len(re.findall("<script", source, re.I)) == len(kinds)
    assert "<img src=x" not in source
    assert "&lt;script&gt;alert(1)" in source


def test_plugin_sections(source: str) -> None:
    """A section is shown as it renders; one that raises is a note with its name and the reason."""
    assert "<p>From <b>4</b> nodes.</p>" in source
    text = " ".join(Page(source).text.split())
    assert "The section “Broken <section>” could not be written: RuntimeError: no <data>" in text
    assert "The section “Wrong” could not be written: TypeError: render() returned a int" in text


@pytest.mark.thorough
def test_one_method_and_no_failures(make_node: Callable[..., xr.DataTree], tmp_path: Path) -> None:
    """A single method has no comparison; success is said in a sentence; equal results give equal files."""
    tree = results.study_tree([make_node("only", failing=0)], study="s", mechanism="m")
    pages = [report.write_report(tree, tmp_path / f"{k}.html").read_text(encoding="utf-8") for k in "ab"]
    assert pages[0] == pages[1]
    assert "No realisation failed" in pages[0] and "Comparison of methods" not in pages[0]
    assert not re.search(r"<th[^>]*>Method</th><th[^>]*>Mean", pages[0])


@pytest.mark.thorough
def test_from_a_file(study: xr.DataTree, tmp_path: Path) -> None:
    """The report of a stored result is that of the result."""
    tree = results.study_tree([study["second"].copy()], study="s", mechanism="m")
    loaded = results.load(results.save(tree, tmp_path / "r.nc"))
    one = report.write_report(tree, tmp_path / "a.html").read_text(encoding="utf-8")
    assert report.write_report(loaded, tmp_path / "b.html").read_text(encoding="utf-8") == one


def test_odd_nodes_do_not_end_the_report(make_node: Callable[..., xr.DataTree], tmp_path: Path) -> None:
    """A single time, all quantiles unknown, or unreadable options still make a report."""
    axes = extend.labels(["x"], [], [1.0])
    statistics = extend.statistics_dataset(axes, mean=[[1.0]], std=[[0.1]])
    node = results.propagator_node("one", statistics, propagator="p", realisations=0, wall_time=0.0)
    node.attrs["wall_time"] = np.nan
    node.attrs["options"] = "not JSON"
    tree = results.study_tree([node], study="s", mechanism="m")
    text = report.write_report(tree, tmp_path / "a.html").read_text(encoding="utf-8")
    assert "could not be drawn" not in text and "not JSON" in text and "unknown" in text


@pytest.mark.thorough
def test_unusable_targets_are_named(study: xr.DataTree, tmp_path: Path) -> None:
    """A path that cannot be written, and a tree without results, are one message each."""
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="cannot be written"):
        report.write_report(
            results.study_tree([study["galerkin $3"].copy()], study="s", mechanism="m"), tmp_path / "file" / "a.html"
        )
    with pytest.raises(StudyError, match="at least one propagator"):
        report.write_report(xr.DataTree(), tmp_path / "a.html")


@pytest.mark.thorough
@pytest.mark.parametrize("before", ["", "import matplotlib"])
def test_what_a_section_sets_is_undone(tmp_path: Path, before: str) -> None:
    """Settings of Matplotlib are as before, also where the section is the first to load it; other sections do not."""
    code = f"""
import sys
from uqmbd import extend, report, results
{before}
class Plain:
    title = "plain"
    def render(self, tree):
        return "<p>text</p>"
class Bold:
    title = "bold"
    def render(self, tree):
        import matplotlib
        matplotlib.rcParams["font.size"] = 99
        return "<p>text</p>"
axes = extend.labels(["x"], [], [0.0])
node = results.propagator_node(
    "m", extend.statistics_dataset(axes, mean=[[0]], std=[[0]]), propagator="p", realisations=1, wall_time=0
)
tree = results.study_tree([node], study="s", mechanism="m")
report.write_report(tree, "a.html", sections=[Plain()])
print("matplotlib" in sys.modules)
report.write_report(tree, "b.html", sections=[Bold()])
print(sys.modules["matplotlib"].rcParams["font.size"] == 99)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert run.stdout.split() == [str(bool(before)), "False"], run.stderr
