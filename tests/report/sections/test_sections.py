"""Sections of the core are sections like those of plugins; types of any package can be drawn in notebooks."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from uqmbd import display, extend, report, results
from uqmbd.report.sections import ABOUT_METHODS, ABOUT_RESULTS, TemplateSection
from uqmbd.report.sections.section import environment


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    axes = extend.labels([("x", "m")], [("k", "N/m")], [0.0, 1.0])
    rng = np.random.default_rng(1)
    inputs = rng.uniform(1, 2, (20, 1))
    response = inputs[:, :, None] * np.array([1.0, 2.0])
    samples = extend.sample_dataset(response[:, None, 0], inputs, axes)
    node = results.propagator_node(
        "mine",
        extend.statistics_of_samples(samples),
        propagator="p",
        realisations=20,
        wall_time=1.0,
        children={"samples": samples},
    )
    return results.study_tree([node], study="s", mechanism="m")


@pytest.mark.parametrize("section", [*ABOUT_RESULTS, *ABOUT_METHODS], ids=lambda section: section.name)
def test_a_section_renders_a_tree(section: TemplateSection, tree: xr.DataTree, tmp_path) -> None:
    """As `uqmbd.report.Section` asks: a title, and HTML of a tree; the page shows the same, and nothing where it is empty."""
    fragment = section.render(tree)
    page = report.write_report(tree, tmp_path / "report.html", sections=[section]).read_text(encoding="utf-8")
    assert page.count(f'<section id="{section.name}">') == bool(fragment)
    assert page.count(f"<h2>{section.title}</h2>") == 2 * bool(fragment)


WEIGHTS = """
class Weight:
    pass


class Heavy(Weight):
    pass


class Other:
    pass


def drawn(weight):
    return f"<b>{type(weight).__name__}</b>"
"""


def test_types_of_any_package_can_be_drawn(tmp_path) -> None:
    """By an entry point of an installed package, under the name of the type or of a base; others are plain text."""
    (tmp_path / "weights.py").write_text(WEIGHTS)
    about = tmp_path / "weights-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: weights\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{display.GROUP}]\nweights.Weight = weights:drawn\n")
    code = (
        "import weights; from uqmbd.display import html_of; print(html_of(weights.Heavy()), html_of(weights.Other()))"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    found = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == ["<b>Heavy</b>", "None"]


def test_compiled_templates_are_kept_and_read_again(monkeypatch, tmp_path) -> None:
    """Warm, the same HTML without a compilation; what is damaged is compiled again."""
    from jinja2 import Environment

    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "kept"))
    compiled: list[str] = []
    compile_one = Environment.compile
    monkeypatch.setattr(
        Environment, "compile", lambda *given, **named: (compiled.append(given[2]), compile_one(*given, **named))[1]
    )

    def page() -> str:
        environment.cache_clear()
        return environment().get_template("charts.css.j2").render()

    try:
        cold = page()
        assert compiled == ["charts.css.j2"]
        assert page() == cold and compiled == ["charts.css.j2"]
        (kept,) = (one for one in (tmp_path / "kept").rglob("*") if one.is_file())
        kept.write_bytes(kept.read_bytes()[:-1])
        assert page() == cold and compiled == ["charts.css.j2"] * 2
    finally:
        environment.cache_clear()
