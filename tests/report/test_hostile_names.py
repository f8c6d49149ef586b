"""Names, units, labels and descriptions that are hostile go unchanged from the study to every page, or are refused."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
import xml.etree.ElementTree as ET
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd import report, results
from uqmbd.cli.compare import show_comparison
from uqmbd.cli.tables import show_summary
from uqmbd.report import figures
from uqmbd.report.notebook import chaos_html, mechanism_html, result_html, study_html
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

HOSTILE = {
    "script": "<script>alert(1)<\\script>",
    "close": '</title></style><!-- --><img src=x onerror="alert(1)">'.replace("/", "\N{DIVISION SLASH}"),
    "attribute": "\" onload='alert(2)' x=\"&lt;&#60;&amp",
    "template": "{{ 7*7 }} {% raw %} {# no #} ${x} %(y)s %s {0}",
    "mathematics": r"$x_1$ and $\frac{1}{",
    "one dollar": "$",
    "backslashes": "\\frac\\$\\\\n\\u0041\\",
    "quotes": '\'"`\N{LEFT DOUBLE QUOTATION MARK}\'\' """',
    "words": "first -- second --> third | fourth",
    "long": "long " * 60,
    "one long word": "w" * 300,
    "right to left": "\N{RIGHT-TO-LEFT OVERRIDE}שלום عالم\N{RIGHT-TO-LEFT ISOLATE}x",
    "combining": "Z\u0351\u036b\u0343\u036a\u0302\u0343\u0302 e\u0301 \N{ZERO WIDTH JOINER}\N{ZERO WIDTH SPACE}\ufeff",
    "emoji": "\N{GRINNING FACE}\N{WOMAN}\N{ZERO WIDTH JOINER}\N{ROCKET} \U0001f1e9\U0001f1ea",
    "rich": "[bold red]x[bold] [nonsense] [link=a]b :smile:",
    "underscore": "_nolegend_",
    "path": "..\\..\\etc\\passwd CON nul.txt C:",
    "json": '{"a": "\\u2028", NaN}',
    "spaces": "  around  ",
    "attribute of xarray": "output",
    "number": "-0.0",
}
REFUSED = {
    "lines": "first\nsecond\r\nthird",
    "tab": "third\ttab",
    "ends of lines of JavaScript": "first\u2028second\u2029third",
    "bell": "bell\x07",
    "escape": "\x1b[31mred",
    "vertical tab": "a\x0bb",
    "delete": "a\x7f",
    "control of the second kind": "a\x9b31m",
    "no character": "\ufffe",
    "null": "a\0b",
    "null at the end": "a\0",
    "half of a Unicode surrogate pair": "a\ud800b",
    "empty": "",
    "blank": " \t ",
    "slash": "a/b",
}

TAGS = set(
    "html head meta title style body header h1 h2 h3 h4 p nav ul li a main section div table thead tbody tr th td figure "
    "img figcaption details summary dl dt dd pre time code br span strong noscript caption script svg path text".split()
)
VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Tags in balance, texts, and attributes."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.texts: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.feed(page)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, (tag, self.getpos())

    def handle_data(self, data):
        self.texts.append(data)

    def handle_comment(self, data):
        raise AssertionError(f"a comment: {data}")


def check_page(page: str, names: list[str]) -> Page:
    """Check that a page is what its template makes, and holds the names as texts."""
    found = Page(page)
    assert set(found.tags) <= TAGS, set(found.tags) - TAGS
    for tag, name, value in found.attributes:
        placed = tag in ("svg", "text") and re.fullmatch(r"-?[\d.]+", value or "")
        assert not name.startswith("on") and (name not in ("x", "srcdoc") or placed), (tag, name, value)
        if name in ("src", "href"):
            assert value is not None and value.startswith(("data:image/", "#")), value
    text = squeezed("".join(found.texts))
    for name in names:
        assert squeezed(name) in text, name
    return found


def squeezed(text: str) -> str:
    """Return a text as a browser shows it: white space collapses, and what is no character is replaced."""
    return re.sub(r"[\s\N{NO-BREAK SPACE}]+", "", text)


def hostile_study() -> uqmbd.Study:
    """Make the study; that its units are none is told, and they are kept."""
    with pytest.warns(uqmbd.UnitsWarning, match="not a known unit"):
        return made_of_hostile_names()


def made_of_hostile_names() -> uqmbd.Study:
    """A pendulum on a spring all of whose names are hostile."""
    names = list(HOSTILE.values())
    k = uqmbd.RandomVariable(HOSTILE["attribute"], chaospy.Uniform(9, 11), units=HOSTILE["mathematics"])
    m = uqmbd.RandomVariable(HOSTILE["script"], chaospy.Uniform(0.9, 1.1), units=HOSTILE["template"])
    others = [
        uqmbd.RandomVariable(name, chaospy.Uniform(-1e-3, 1e-3), units=HOSTILE["close"])
        for name in (HOSTILE["words"], HOSTILE["right to left"])
    ]
    mechanism = uqmbd.Mechanism(HOSTILE["close"], uqmbd.Planar(gravity=(0, -9.81)))
    ground = mechanism.ground
    arm = mechanism.body(HOSTILE["mathematics"], mass=m, inertia=0.1 + others[0], position=(0.5 + others[1], 0))
    more = mechanism.body(HOSTILE["rich"], mass=1, inertia=1, position=(0, 1))
    mechanism.add(Revolute(HOSTILE["words"], ground, arm, (0, 0), (-0.5, 0)))
    mechanism.add(SpringDamper(HOSTILE["emoji"], ground, arm, (1, 0.2), (0.5, 0), stiffness=k, free_length=0.2))
    mechanism.add(SpringDamper(HOSTILE["long"], ground, more, (0, 0), (0, 0), stiffness=1.0, free_length=1))
    for n, name in enumerate(names):
        units = names[(n + 5) % len(names)][:200]
        mechanism.output(name, (1 + n % 3) * arm.position[n % 2] + more.position[0], units=units)
    mechanism.output("f " + HOSTILE["script"], uqmbd.eigenfrequency(1), units=HOSTILE["quotes"])
    methods = [
        MonteCarlo(samples=24, seed=1, label=HOSTILE["mathematics"]),
        Collocation(order=1, label=HOSTILE["attribute"]),
        Collocation(order=2, rule="smolyak", label=HOSTILE["underscore"]),
    ]
    return uqmbd.Study(HOSTILE["script"], mechanism, np.linspace(0, 0.2, 5), methods)


@pytest.fixture(scope="module")
def study() -> uqmbd.Study:
    """Return the study."""
    return hostile_study()


@pytest.fixture(scope="module")
def stored(study: uqmbd.Study, tmp_path_factory: pytest.TempPathFactory) -> tuple[xr.DataTree, Path]:
    """Return its results, saved and loaded, and their file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = study.run()
    tree["motion"] = xr.DataTree(report.motion(study, samples=2, frames=3))
    path = results.save(tree, tmp_path_factory.mktemp("run") / "results.nc")
    return results.load(path), path


@pytest.mark.thorough
def test_names_are_stored_as_they_were_given(stored: tuple[xr.DataTree, Path], study: uqmbd.Study) -> None:
    tree, _ = stored
    results.validate(tree)
    assert list(results.propagator_nodes(tree)) == [p.node_name for p in study.propagators]
    assert tree.attrs["study"] == study.name and tree.attrs["mechanism"] == study.mechanism.name
    for node in results.propagator_nodes(tree).values():
        statistics = node["statistics"].to_dataset()
        assert statistics["output"].values.tolist() == list(HOSTILE.values())
        names = list(HOSTILE.values())
        assert statistics["output_units"].values.tolist() == [
            names[(n + 5) % len(names)][:200] for n in range(len(names))
        ]
    data = next(iter(results.propagator_nodes(tree).values()))["samples"].to_dataset()
    assert set(data["input"].values) == {HOSTILE[k] for k in ("attribute", "script", "words", "right to left")}


@pytest.mark.thorough
def test_a_report_of_hostile_names_is_whole(stored: tuple[xr.DataTree, Path], tmp_path: Path) -> None:
    """Nothing but what the template makes, every figure drawn, files of safe names."""
    tree, _ = stored
    path = report.write_report(tree, tmp_path / "report.html", folder=tmp_path / "figures")
    page = path.read_text(encoding="utf-8")
    assert "could not be drawn" not in page and "cannot be read" not in page
    check_page(page, [*HOSTILE.values(), *results.propagator_nodes(tree)])
    drawn = sorted((tmp_path / "figures").glob("*.svg"))
    assert page.count("data-alt=") > 10 and len(drawn) > 10
    texts = ""
    for image in drawn:
        root = ET.fromstring(image.read_bytes())
        assert not list(root.iter("{http://www.w3.org/2000/svg}script"))
        texts += "".join(root.itertext())
    # names are no formulas: dollars and backslashes stand as they were written
    assert r"$x_1$ and $\frac{1}{" in re.sub(r"\s+", " ", texts)
    files = [p.name for p in (tmp_path / "figures").iterdir()]
    assert len(files) >= len(drawn) and all(re.fullmatch(r"[\w.+-]{1,120}\.(svg|gif)", name) for name in files)
    assert {p.name for p in tmp_path.iterdir()} == {"report.html", "figures"}


@pytest.mark.thorough
def test_labels_of_axes_leave_room_for_the_figure(stored: tuple[xr.DataTree, Path]) -> None:
    """What is very long is cut in the middle; the axes keep most of the figure."""
    tree, _ = stored
    nodes = results.propagator_nodes(tree)
    for key in ("long", "one long word", "mathematics"):
        for figure in (figures.bands(nodes, HOSTILE[key]), figures.histograms(nodes, HOSTILE[key])):
            for axes in figure.axes:
                assert max(axes.get_ylabel().count("\n"), axes.get_xlabel().count("\n")) < 5
            assert figure.axes[0].get_position().x0 < 0.25


@pytest.mark.thorough
def test_notebooks_show_hostile_names(stored: tuple[xr.DataTree, Path], study: uqmbd.Study) -> None:
    tree, _ = stored
    chaos = results.surrogate(tree[HOSTILE["attribute"]])
    pages = {
        mechanism_html(study.mechanism): [HOSTILE["rich"], HOSTILE["emoji"], HOSTILE["mathematics"]],
        study_html(study): [HOSTILE["attribute"], HOSTILE["underscore"]],
        chaos_html(chaos): [HOSTILE["script"], HOSTILE["template"]],
        result_html(tree): [HOSTILE["attribute"]],
        result_html(tree, [HOSTILE["script"], HOSTILE["json"]]): [HOSTILE["script"], HOSTILE["json"]],
    }
    for page, names in pages.items():
        assert "cannot be drawn" not in page
        check_page(page, names)


@pytest.mark.thorough
def test_the_terminal_shows_hostile_names(
    stored: tuple[xr.DataTree, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Markup of the terminal's library is text, and an escape sequence of a name does not reach the terminal."""
    tree, path = stored
    show_summary(tree, files={"results": path})
    monkeypatch.setattr("uqmbd.cli.report.write", lambda tree, path, **_: path)
    show_comparison([path], out=tmp_path / "both")
    said = capsys.readouterr().out
    assert "\x1b" not in said and "\x07" not in said
    assert "[bold" in said and "red]x[bold]" in said
    both = results.load(tmp_path / "both" / "comparison.nc")
    assert both["comparison"]["output"].values.tolist() == list(HOSTILE.values())


@pytest.mark.thorough
@pytest.mark.parametrize("name", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_a_name_is_refused_where_it_is_given(name: str) -> None:
    mechanism = uqmbd.Mechanism("m", uqmbd.Translational())
    body = mechanism.body("b", mass=1)
    for make in (
        lambda: mechanism.body(name, mass=1),
        lambda: mechanism.output(name, body.position[0]),
        lambda: uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)),
        lambda: SpringDamper(name, mechanism.ground, body, (0, 0), (0, 0), stiffness=1.0),
        lambda: MonteCarlo(samples=3, label=name),
        lambda: uqmbd.Mechanism(name, uqmbd.Translational()),
        lambda: uqmbd.Study(name, mechanism, [0, 1], []),
    ):
        with contextlib.redirect_stdout(io.StringIO()), pytest.raises(uqmbd.StudyError):
            made = make()
            # a label is checked where the study is run at the latest
            uqmbd.Study("s", mechanism, [0, 1], [made])


@pytest.mark.thorough
@pytest.mark.parametrize("units", ["m\0", "m\0s", "\ud800", "\x1b[2J"])
def test_units_that_cannot_be_stored_are_refused(units: str) -> None:
    mechanism = uqmbd.Mechanism("m", uqmbd.Translational())
    body = mechanism.body("b", mass=1)
    with pytest.raises(uqmbd.StudyError, match="units"):
        mechanism.output("x", body.position[0], units=units)
    with pytest.raises(uqmbd.StudyError, match="units"):
        uqmbd.RandomVariable("k", chaospy.Uniform(0, 1), units=units)
