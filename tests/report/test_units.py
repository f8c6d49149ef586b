"""Units are shown by one rule: powers raised, nothing for a pure number; in HTML, figures and on the terminal."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from uqmbd import extend, report, results
from uqmbd.cli.tables import show_summary
from uqmbd.wording import reciprocal_units, typeset_units

RAW = re.compile(r"m/s\^2|kg\*m\*\*2|N m|\[1\]|\d( ± [\d.]+)? 1$", re.MULTILINE)


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    """Two methods with an acceleration, a ratio and a moment, over time."""
    axes = extend.labels(
        [("a", "m/s^2"), ("ratio", "1"), ("M", "N m")],
        [("I", "kg*m**2"), ("c", "1"), ("k", "N m/rad")],
        np.linspace(0, 2, 5),
    )
    rng = np.random.default_rng(1)
    nodes = []
    for label in ("mine", "yours"):
        inputs = rng.uniform(1, 2, (60, 3))
        response = inputs[:, :, None] * np.linspace(3, 4, 5)
        samples = extend.sample_dataset(response, inputs, axes)
        about = extend.statistics_of_samples(samples)
        nodes.append(
            results.propagator_node(
                label, about, propagator="p", realisations=60, wall_time=1.0, children={"samples": samples}
            )
        )
    return results.study_tree(nodes, study="s", mechanism="m")


def test_no_page_shows_units_as_they_were_typed(tree, tmp_path) -> None:
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    text = re.sub(r"<(style|script).*?</\1>|src=\"[^\"]*\"|<[^>]+>", "\n", page, flags=re.DOTALL)
    assert "m/s²" in text
    assert "kg·m²" in text
    assert "N\N{NARROW NO-BREAK SPACE}m/rad" in text
    assert not RAW.search(text), RAW.search(text)
    charts = [json.loads(data) for data in re.findall(r'<script type="application/json">(.*?)</script>', page)]
    labels = "\n".join([*re.findall(r"<text[^>]*>([^<]*)", page), *(c["units"] for c in charts if "units" in c)])
    assert "m/s²" in labels
    assert "N\N{NARROW NO-BREAK SPACE}m" in labels
    assert not re.search(r"\^|\*|\[1\]|N m", labels)


def test_the_terminal_shows_units_as_reports_do(tree, capsys) -> None:
    show_summary(tree, files={})
    lines = capsys.readouterr().out.splitlines()
    assert not any("uncertainty" in line for line in lines) and any("stated error" in line for line in lines)
    (ratio,) = (line.split() for line in lines if line.startswith("ratio"))
    assert ratio[1] != "1"
    assert any("m/s²" in line for line in lines)


@pytest.mark.parametrize("units", ["m", "m/s^2", "1/s", "N m", "kg m^2 / s", "% of std", "kg*m^2/s", "s^-1", "1", ""])
def test_what_is_typeset_stays(units: str) -> None:
    """Whoever typesets units again, or turns them over twice, changes nothing."""
    shown = typeset_units(units)
    assert typeset_units(shown) == shown
    if "(" not in reciprocal_units(units):
        assert reciprocal_units(reciprocal_units(units)) == shown
