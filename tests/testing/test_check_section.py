"""Mutants of a sound section of the report, each with one realistic mistake: `check_section` finds every one."""

from __future__ import annotations

import html
import itertools

import numpy as np
import pytest

from uqmbd.extend import labels, statistics_dataset
from uqmbd.report import Curve, chart_html
from uqmbd.results import methods, propagator_node, study_tree
from uqmbd.testing import check_section

CALLS = itertools.count()
RED = "data:image/png;base64,iVBORw0KGgo="


def made(render, title="Costs", doc="Show costs."):
    """Make a class of sections from a function of the result."""
    return type("Made", (), {"__doc__": doc, "title": title, "render": lambda self, tree: render(tree)})


def table(tree, shown=html.escape):
    """Return a table of outputs and numbers of realisations."""
    rows = "".join(
        f"<tr><td>{shown(label)}</td><td>{shown(output)}</td><td>{node.attrs['realisations']}</td></tr>"
        for label, node in methods(tree).items()
        for output in node["statistics"]["output"].values.tolist()
    )
    return f"<table>{rows}</table>" if rows else ""


def charts(tree):
    found = [node["statistics"].to_dataset() for node in methods(tree).values()]
    return "".join(
        chart_html(
            name, data["time"].values, [Curve("mean", data["mean"].sel(output=name).values)], name, name, units="m"
        )
        for data in found
        for name in data["output"].values.tolist()
        if data.sizes["time"] > 1
    )


def drawn(tree):
    """Return a table and a drawing."""
    return table(tree) + '<svg role="img" aria-label="a line"><path d="M 0 0 L 1 1"/></svg>'


def changed(tree):
    for node in methods(tree).values():
        node.attrs["realisations"] = 0
    return table(tree)


def with_data(tree):
    for node in methods(tree).values():
        node["statistics"]["mean"].values[:] = 0
    return table(tree)


def of_every_child(tree):
    return "".join(
        f"<p>{html.escape(k)}: {x.attrs['realisations']} {x['statistics'].sizes}</p>" for k, x in tree.children.items()
    )


SOUND = {
    "table": table,
    "charts": charts,
    "drawing": drawn,
    "picture": lambda t: table(t) + f'<img alt="red" src="{RED}">',
}
MUTANTS = {
    "names not escaped": (lambda t: table(t, str), "a name is not escaped"),
    "names escaped twice": (lambda t: table(t, lambda x: html.escape(html.escape(x))), "a name is escaped twice"),
    "names in an attribute": (
        lambda t: "".join(f'<p title="{html.escape(x, quote=False)}">x</p>' for x in _outputs(t)), "a name is not escaped"),
    "names in single quotes": (lambda t: "".join(f"<p title='{x.replace('<', '')}'>x</p>" for x in _outputs(t)), "not escaped"),
    "script from a network": (lambda t: table(t) + '<script src="https://cdn.org/d3.js"></script><svg></svg>', "loads an external resource"),
    "style from a network": (lambda t: "<link rel='stylesheet' href='https://x.org/a.css'>" + table(t), "contains <link>"),
    "font by @import": (lambda t: "<style>@import 'https://x.org/a.css';</style>" + table(t), "a style loads an external resource"),
    "background by url()": (lambda t: table(t) + "<p style=\"background: url('//x.org/a.png')\">x</p>", "a style loads an external resource with @import or url"),
    "picture in another file": (lambda t: table(t) + '<img alt="a chart" src="costs.png">', "loads an external resource; use a data URL"),
    "request by a script": (lambda t: drawn(t) + "<script>fetch('/costs.json')</script>", "a script loads an external resource"),
    "picture without a text": (lambda t: table(t) + f'<img src="{RED}">', "has no alt= text"),
    "canvas alone": (lambda t: table(t) + "<canvas></canvas><script>draw()</script>", "is invisible without scripts and in print"),
    "a whole page": (lambda t: f"<html><body>{table(t)}</body></html>", "which is not allowed in a self-contained fragment"),
    "an element not closed": (lambda t: f"<div>{table(t)}", "<div> is not closed"),
    "an end too many": (lambda t: f"{table(t)}</div>", "the end tag </div> has no start tag"),
    "the same id for each output": (lambda t: "".join('<p id="cost">x</p>' for _ in _outputs(t)), "occurs more than once"),
    "the time of the day": (lambda t: table(t) + f"<p>{next(CALLS)}</p>", "two calls of render\\(\\) with the same result return different fragments"),
    "attributes changed": (changed, "render\\(\\) modified the result"),
    "data changed": (with_data, "render\\(\\) modified the result"),
    "every node a method": (of_every_child, "render\\(\\) raised"),
    "rates of one time": (lambda t: table(t) + "".join(f"{np.gradient(n['statistics']['mean'].values, axis=1).sum()}" for n in methods(t).values()), "one time: render\\(\\) raised"),
    "samples that are not there": (lambda t: "".join(str(n["samples"].sizes) for n in methods(t).values()), "raised"),
    "None for nothing": (lambda t: None, "returned a NoneType"),
    "nothing at all": (lambda t: "", "returned an empty string for every result"),
}  # fmt: skip


def _outputs(tree):
    return [x for n in methods(tree).values() for x in n["statistics"]["output"].values.tolist()]


QUICK = ("names not escaped", "canvas alone", "table")


def cases(table):
    return [pytest.param(k, id=k, marks=() if k in QUICK else pytest.mark.thorough) for k in table]


@pytest.mark.parametrize("name", cases(MUTANTS))
def test_mutants_are_found(name):
    render, words = MUTANTS[name]
    with pytest.raises(AssertionError, match=words):
        check_section(made(render))


@pytest.mark.parametrize("name", cases(SOUND))
def test_sound_sections_pass(name):
    check_section(made(SOUND[name]))


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (made(table, title="<b>Costs</b>"), "its title '<b>Costs</b>' contains HTML"),
        (made(table, title=None), "its title is None; expected a non-empty string"),
        (made(table, doc=None), "has no docstring"),
        (type("Bare", (), {"title": "x", "__doc__": "x"}), "has no method 'render'"),
        (
            type("Asks", (), {"render": table, "title": "x", "__doc__": "x", "__init__": lambda s, k: None}),
            "without arg",
        ),
    ],
)
def test_declarations(section, words):
    with pytest.raises(AssertionError, match=words):
        check_section(section)


@pytest.mark.thorough
def test_sections_of_special_results_are_given_one():
    def special(tree):
        return table(tree) if "author" in tree.attrs else ""

    axes = labels([("x", "m")], [], [0.0, 1.0])
    node = propagator_node(
        "mine", statistics_dataset(axes, mean=[[0, 1]], std=[[0, 1]]), propagator="p", realisations=1, wall_time=1
    )
    tree = study_tree([node], study="study", mechanism="arm")
    tree.attrs["author"] = "Euler"
    check_section(made(special), trees=[tree])
    with pytest.raises(AssertionError, match="returned an empty string for every result"):
        check_section(made(special))
