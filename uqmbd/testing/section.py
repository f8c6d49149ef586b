"""Test that a section of the report is a self-contained HTML fragment, for any names in a result."""

from __future__ import annotations

import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.isolation import Isolated
from uqmbd.plugins import KINDS, registered_name
from uqmbd.report import Section, write_report
from uqmbd.results import propagator_node, study_tree
from uqmbd.results.schema import labels, sample_dataset, statistics_dataset

__all__ = ["check_section"]

HOSTILE = (
    "<x-hostile onhostile=1>",
    '"><x-hostile onhostile="1',
    "' onhostile='1",
    "]]> --> <x-hostile>",
    "a < b & c > d &lt; é",
)
"""Names of outputs; an element x-hostile, or an attribute onhostile, indicates a name without escapes."""

VOID = frozenset("area base br col embed hr img input link meta source track wbr".split())
"""HTML elements without an end tag."""

FOREIGN = frozenset("html head body base link meta iframe frame object embed applet".split())
"""Elements that do not belong in a fragment, or load data."""

LOADING = frozenset("src srcset poster data action formaction background xlink:href".split())
"""Attributes with a value that a browser loads; `href` is also one, except in a link for the reader."""

CALLS = ("fetch(", "XMLHttpRequest", "WebSocket", "EventSource", "sendBeacon", "importScripts", "import(", "Worker(")
"""Calls in scripts that load data."""

STILL = frozenset("svg img noscript".split())
"""Elements that are visible without scripts and on paper."""

MOVING = frozenset("script canvas video".split())
"""Elements that require scripts, or show motion."""


@typechecked(values=False)
def check_section(section: type[Section], *, trees: Sequence[xr.DataTree] = ()) -> None:
    """Check a section of the report on several results, including names with HTML characters.

    - The section is made without arguments, and its title is plain text.
    - The fragment is well-formed HTML: elements are closed, identifiers are unique, pictures have a text.
    - Names of outputs, methods and inputs are escaped once.
    - The fragment loads no external data: elements, styles and scripts contain no address.
    - Scripts and canvases have a still picture, or a note, for readers without scripts and for paper.
    - The result is unchanged, and the same result gives the same fragment.
    - Results with one time, without samples, or with nodes other than methods, raise no errors.

    Parameters
    ----------
    section : type
        As `uqmbd.report.Section` defines.
    trees : sequence of xarray.DataTree
        Further results, for sections that require other data than statistics and samples. The section must have content
        for at least one of all results.

    Raises
    ------
    AssertionError
        If a check fails; the message states the check.

    Examples
    --------
    >>> import html
    >>> from uqmbd.results import methods
    >>> from uqmbd.testing import check_section
    >>> class Labels:
    ...     \"\"\"The labels of the methods.\"\"\"
    ...     title = "Labels"
    ...     def render(self, tree):
    ...         return "".join(f"<p>{html.escape(name)}</p>" for name in methods(tree))
    >>> check_section(Labels)
    """
    _, problem = registered_name(section, KINDS["report_sections"])
    name = getattr(section, "__name__", repr(section))
    assert not problem, f"{name} is a class {problem}."
    assert section.__doc__, f"{name} has no docstring; describe the section in one sentence."
    made: Any = None
    with Isolated() as work:
        made = section()
    assert not work.failed, f"{name} cannot be instantiated without arguments: {work.reason}"
    title: Any = made.title
    assert isinstance(title, str) and title.strip(), f"{name}: its title is {title!r}; expected a non-empty string."
    assert not set("<>&") & set(title), f"{name}: its title {title!r} contains HTML; expected plain text."
    shown = False
    for what, tree in [*_results(), *((f"given result {k + 1}", tree) for k, tree in enumerate(trees))]:
        shown |= bool(_check_rendered(made, tree, f"{name}, {what}"))
    assert shown, (
        f"{name}: render() returned an empty string for every result. Pass a result that the section displays: "
        "check_section(..., trees=[tree])."
    )


def _check_rendered(section: Section, tree: xr.DataTree, what: str) -> str:
    """Render a section twice and in a report, and check the fragment; return it."""
    before = tree.copy(deep=True)
    fragments: list[Any] = []
    for _ in range(2):
        with Isolated() as work:
            fragments.append(section.render(tree))
        assert not work.failed, f"{what}: render() raised {work.reason}"
    first, second = fragments
    assert isinstance(first, str), f"{what}: render() returned a {type(first).__name__}; expected a string of HTML."
    assert tree.identical(before), f"{what}: render() modified the result; modify a copy instead."
    assert first == second, (
        f"{what}: two calls of render() with the same result return different fragments. Remove times of day and "
        "random numbers."
    )
    _check_fragment(first, what)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        page = write_report(tree, Path(folder) / "report.html", sections=[section]).read_text(encoding="utf-8")
    texts = [str(w.message) for w in caught]
    omitted = [text for text in texts if "report section" in text or "the first screen of" in text]
    assert not omitted, f"{what}: the report omits the section: {omitted[0]}"
    assert not first or section.title in page, f"{what}: its title {section.title!r} is not on the page."
    return first


def _check_fragment(fragment: str, what: str) -> None:
    """Check one fragment of HTML."""
    found = _Fragment()
    found.feed(fragment)
    found.close()
    assert not found.wrong, f"{what}: {found.wrong[0]}."
    assert not found.open, f"{what}: the element <{found.open[-1]}> is not closed."
    twice = [name for name, count in found.names.items() if count > 1]
    assert not twice, f"{what}: the identifier {twice[0]!r} occurs more than once."
    text = " ".join(found.text)
    assert "&lt;" not in text.replace(HOSTILE[-1], "") and "&amp;" not in text, (
        f"{what}: a name is escaped twice, so the page shows '&lt;' or '&amp;'. Pass plain text to chart_html."
    )
    moving = MOVING & set(found.elements)
    assert not moving or STILL & set(found.elements), (
        f"{what}: <{min(moving)}> is invisible without scripts and in print. Add a picture (<svg>, or <img> with a "
        "data URL) or a <noscript>, as uqmbd.report.chart_html does."
    )


class _Fragment(HTMLParser):
    """Parser of the elements, texts and errors of an HTML fragment."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: Counter[str] = Counter()
        self.names: Counter[str] = Counter()
        self.text: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an element and its attributes."""
        self._element(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an element without content."""
        self._element(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        """Close the last element."""
        if self.open and self.open[-1] == tag:
            self.open.pop()
        elif tag not in VOID:
            inside = f", inside <{self.open[-1]}>" if self.open else ""
            self.wrong.append(f"the end tag </{tag}> has no start tag{inside}")

    def handle_data(self, data: str) -> None:
        """Record a text, or check a style or a script."""
        within = self.open[-1] if self.open else ""
        if within == "style":
            self._style(data)
        elif within == "script":
            called = next((word for word in CALLS if word in data), "")
            if called:
                self.wrong.append(f"a script loads an external resource: {called}...; include all data in the fragment")
        else:
            self.text.append(data)

    def _element(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements[tag] += 1
        given = {key: value or "" for key, value in attrs}
        if tag == "x-hostile" or "onhostile" in given:
            self.wrong.append("a name is not escaped and became an element or an attribute. Use html.escape(name)")
        if tag in FOREIGN:
            self.wrong.append(f"the fragment contains <{tag}>, which is not allowed in a self-contained fragment")
        if tag == "img" and not given.get("alt", "").strip():
            self.wrong.append("an <img> has no alt= text")
        if "id" in given:
            self.names[given["id"]] += 1
        for key, value in given.items():
            loads = key in LOADING or (key == "href" and tag != "a")
            if loads and value and not value.strip().startswith(("data:", "#")):
                self.wrong.append(f"<{tag} {key}={value[:60]!r}> loads an external resource; use a data URL")
        self._style(given.get("style", ""))

    def _style(self, text: str) -> None:
        plain = "".join(text.split()).replace("'", "").replace('"', "")
        parts = plain.split("url(")[1:]
        if "@import" in plain or any(not part.startswith(("data:", "#")) for part in parts):
            self.wrong.append("a style loads an external resource with @import or url(...); use a data URL")


def _results() -> Iterator[tuple[str, xr.DataTree]]:
    """Yield results with hostile names, with one time, without samples, and with other nodes."""
    yield "result of one method", study_tree([_node("method", ("height", "speed"))], study="study", mechanism="arm")
    both = [_node("first", HOSTILE), _node(HOSTILE[0], HOSTILE, samples=9)]
    yield "names with HTML characters", study_tree(both, study=HOSTILE[0], mechanism="arm")
    single = _node("method", HOSTILE, times=1, samples=5)
    yield "one time", study_tree([single], study="study", mechanism="arm")
    others = study_tree([_node("method", ("height",))], study="study", mechanism="arm")
    others["pose_surrogate"] = xr.DataTree(xr.Dataset(attrs={"realisations": 3}))
    yield "nodes without methods", others


def _node(label: str, outputs: Sequence[str], times: int = 5, samples: int = 0) -> xr.DataTree:
    """Return the node of a method: means (output, time) with standard deviations, and samples."""
    axes = labels([(name, "m") for name in outputs], ["k"], np.linspace(0, 1, times))
    mean = np.arange(len(outputs) * times, dtype=float).reshape(len(outputs), times)
    drawn = np.random.default_rng(1).normal(size=(samples, *mean.shape))
    data = sample_dataset(mean + drawn, drawn[:, 0, :1], axes, kind="draws") if samples else None
    statistics = statistics_dataset(axes, mean=mean, std=0.1 + 0 * mean)
    return propagator_node(
        label, statistics, data, propagator="any", realisations=samples or 7, wall_time=1.5, options={"order": 2}
    )
