"""What a section of a plugin adds to the first screen is shown there as text, and harms nothing if it fails."""

import re

import numpy as np
import pytest

import uqmbd
from uqmbd import extend, report, results
from uqmbd.report import Chart, ChartGroup, Curve, FirstScreen, ReliabilityStatement

from ..test_hostile_names import HOSTILE, check_page


def tree():
    axes = extend.labels([("x", "m")], [], [0.0, 1.0])
    statistics = extend.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 0.1]])
    node = results.propagator_node("mine", statistics, propagator="p", realisations=7, wall_time=1.5)
    return results.study_tree([node], study="crank", mechanism="crank")


def section(screen):
    """Return a section without text that adds this to the first screen; what is callable is called with the tree."""

    class Added:
        title = "Added"

        def render(self, tree):
            return ""

        def first_screen(self, tree):
            return screen(tree) if callable(screen) else screen

    return Added()


def first_of(path):
    text = path.read_text(encoding="utf-8")
    return re.search(r'<section id="summary".*?\n</section>\n<nav', text, re.DOTALL)[0]


def bars(title="by mesh"):
    return Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], title, "%", "mesh")


def test_table_statements_and_charts_are_shown_in_order(tmp_path):
    rows = [(f"row {k}", f"{k} kg") for k in range(8)]
    said = [
        ReliabilityStatement(2, "good", "verified."),
        ReliabilityStatement(0, "bad", "wrong."),
        ReliabilityStatement(1, "poor", "perhaps."),
    ]
    screen = FirstScreen("Part", ("Mass",), rows, [ChartGroup([bars()], "Errors.", "Errors by mesh.")], said)
    first = first_of(report.write_report(tree(), tmp_path / "r.html", sections=[section(screen)]))
    assert (
        re.findall(
            r'<th scope="row">(row \d)</th><td data-name="Mass">(\d kg)</td>', first.replace("\N{NO-BREAK SPACE}", " ")
        )
        == rows[:6]
    )
    assert "2 more in the sections below" in first
    assert re.findall(r'level-(\d)">(.)</span> <strong>(\w+)</strong>', first) == [
        ("0", "✗", "bad"),
        ("1", "!", "poor"),
        ("2", "✓", "good"),
    ]
    assert first.index("row 0") < first.index(">Results<") < first.index("Errors by mesh.")


def test_hostile_texts_stay_texts(tmp_path):
    """Each hostile text is in a cell, a statement and a chart; the page has no other tags than without it."""
    texts = list(HOSTILE.values())
    screens = []
    for text in texts:
        curve = Curve(text, [2.0, 0.1], drawn="bars", quantity=text)
        chart = Chart(text, [f"{text} 1", f"{text} 2"], [curve], text, "%", text)
        screens.append(
            section(FirstScreen(text, (text,), [(text, text)], [ChartGroup([chart], text, text, text)],
                                [ReliabilityStatement(0, text, text)]))
        )  # fmt: skip
    path = report.write_report(tree(), tmp_path / "r.html", sections=screens)
    page = check_page(path.read_text(encoding="utf-8"), texts)
    named = [value for tag, name, value in page.attributes if (tag, name) == ("td", "data-name")]
    assert set(texts) <= set(named)
    assert first_of(path).count('<figure class="charted small contribution"') == len(texts)


@pytest.mark.parametrize(
    ("screen", "reason"),
    [
        (lambda tree: 1 / 0, "ZeroDivisionError"),
        (lambda tree: "<p>text</p>", "returned a str"),
        (lambda tree: FirstScreen("Part", ("Mass",), [("rod",)]), "expected 2 texts"),
    ],
)
def test_a_failure_is_a_warning_and_a_note(tmp_path, screen, reason):
    with pytest.warns(extend.PluginWarning, match="first screen of .*Added is omitted"):
        path = report.write_report(tree(), tmp_path / "r.html", sections=[section(screen)])
    first = first_of(path)
    assert "A part of the first screen could not be made" in first and reason in first and ">Results<" in first


def test_none_adds_nothing_and_the_tree_is_a_copy(tmp_path):
    def spoil(found):
        del found["mine"]

    plain = first_of(report.write_report(tree(), tmp_path / "a.html"))
    assert first_of(report.write_report(tree(), tmp_path / "b.html", sections=[section(spoil)])) == plain


@pytest.mark.parametrize(
    "make",
    [
        lambda: FirstScreen(3),
        lambda: FirstScreen("Part", ("Mass",), ["xy"]),
        lambda: FirstScreen("Part", ("Mass",), [("rod", 1.2)]),
        lambda: FirstScreen("Part", charts=[bars()]),
        lambda: FirstScreen("Part", charts=[ChartGroup([], "a", "b")]),
        lambda: FirstScreen("Part", charts=[ChartGroup([bars(), bars()], "a", "b")]),
        lambda: FirstScreen("Part", charts=[ChartGroup([bars()], "a", "b")] * 4),
        lambda: FirstScreen(
            "Part", charts=[ChartGroup([Chart("x", [0.0, 1.0], [Curve("c", [np.inf, 1.0])])], "a", "b")]
        ),
        lambda: FirstScreen("Part", statements=["good"]),
        lambda: FirstScreen("Part", statements=[ReliabilityStatement(5, "a", "b")]),
        lambda: FirstScreen("Part", statements=[ReliabilityStatement(1, "a", None)]),
    ],
)
def test_parts_that_do_not_fit_are_refused(make):
    with pytest.raises(uqmbd.StudyError, match="expected"):
        make()
