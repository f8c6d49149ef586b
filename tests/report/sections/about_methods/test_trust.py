"""The report's sections on surrogates: there where a method holds a chaos, with what it says, and nowhere else."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from uqmbd import report, results

Maker = Callable[..., xr.DataTree]
MATTER, TRUST = "Sensitivity to inputs", "Accuracy of the surrogates"


def _write(tree: xr.DataTree, path: Path) -> str:
    return report.write_report(tree, path / "report.html").read_text(encoding="utf-8")


def _text(source: str) -> str:
    import html

    return " ".join(html.unescape(re.sub(r"<style>.*?</style>|<[^>]*>", " ", source, flags=re.S)).split())


def _section(source: str, name: str) -> str:
    return source[source.index(f'<section id="{name}">') :].split("<h2>")[1]


@pytest.fixture(scope="module")
def source(orders: xr.DataTree, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the report of Monte Carlo and of surrogates of five orders."""
    return _write(orders, tmp_path_factory.mktemp("report"))


@pytest.mark.thorough
def test_sections_only_where_there_is_a_chaos(study: xr.DataTree, source: str, tmp_path: Path) -> None:
    """Without a chaos neither headings nor entries of the contents nor figures of differences."""
    plain = re.sub("<script.*?</script>", "", _write(study, tmp_path), flags=re.DOTALL)
    # what is told in their place
    for stated in (
        "The results contain samples, but no surrogate. Add a method that computes one, such as 'collocation' or 'galerkin'.",
        "This page evaluates no surrogate: outputs and charts show the nearest of",
    ):
        plain = plain.replace(stated, "")
    for words in (MATTER, TRUST, "Sobol", "surrogate", "Difference of the mean of each method"):
        assert words not in plain
    for name, words in (("influence", MATTER), ("trust", TRUST)):
        assert f'<a href="#{name}">{words}</a>' in source and f'<section id="{name}">\n<h2>{words}</h2>' in source
    assert "could not be drawn" not in source and "could not be drawn" not in plain


def test_every_tag_is_closed(source: str) -> None:
    """The page is well formed, and names of inputs and outputs are text, never markup."""
    for tag in ("section", "div", "table", "tr", "p", "ul", "li", "figure", "th", "td"):
        assert len(re.findall(rf"<{tag}[ >]", source)) == source.count(f"</{tag}>"), tag
    assert "<script>alert" not in source and "&lt;script&gt;alert(1)" in _section(source, "influence")
    assert r"$F_{pin} \frac &lt;b&gt;&amp;" in _section(source, "trust")
    images = re.findall(r"<img [^>]*>", source)
    assert all(re.search(r'alt="[^"]{20,}"', image) for image in images)


def test_table_of_influence(source: str, orders: xr.DataTree) -> None:
    """The table holds the total indices, averaged with the variance as weight, for outputs that vary."""
    part = _section(source, "influence")
    data = orders["collocation-5/statistics"].to_dataset().sel(output="slider_x")
    std = data["std"].values
    weight = np.where(std > 0.01 * std.max(), std, 0.0) ** 2 * np.gradient(data["time"].values)
    for k, name in enumerate(("&lt;script&gt;alert(1)", "k_1$")):
        total, first = (float(data[f"sobol_{n}"].values[k] @ weight / weight.sum()) for n in ("total", "first"))
        assert 0.1 < total < 0.9
        row = part[part.index(f'<th scope="row">{name}</th>') :]
        assert " ".join(row.split("</td>")[0].split()).endswith(f">{100 * total:.0f} % ({100 * first:.0f} %)")
    assert "constant 力" not in part and part.count('class="charted"') == 2
    assert "The Sobol' indices were computed by collocation-5." in _text(part)
    assert re.search(
        r"k_1\$ contributes to \d+ % of the variance of slider_x, <script>alert\(1\) to \d+ %", _text(part)
    )


def test_verdicts_and_errors(source: str, orders: xr.DataTree) -> None:
    """The comparison has verdicts of the highest order word for word; the table has a row for each order and output."""
    part = _section(source, "trust")
    words, compared = _text(part), _text(_section(source, "comparison"))
    chaos = results.PolynomialChaos.from_dataset(orders["collocation-5/chaos"])
    for output, verdict in zip(chaos.labels.outputs, chaos.verdicts(), strict=True):
        # a spread that is not there has no error
        still = output.name in ("constant 力", "zero")
        said = "does not vary beyond the integration error" if still else verdict.partition(": ")[2]
        assert f"{output.name} collocation-5 {said}" in compared and said not in words
    assert "collocation-5 (order 5, 21 terms)" in words
    error = orders["collocation-2/statistics/verification_error"].sel(output="slider_x")
    first = float(error["time"][int(np.argmax(error.values > 0.01))])
    assert f"slider_x collocation-2 2 6 17 {100 * float(error.max()):.2g} % {first:.4g} s" in words
    assert part.count('<th scope="row">slider_x</th>') == 5
    assert "at 8 realisations that were not used for the fit" in words
    assert re.search(r"collocation, from order 1 \(12 realisations\) to order 4 \(33\): .* decreases from", words)
    alts = re.findall(r'alt="([^"]*)"', part)
    assert [alt.split(" of ")[0] for alt in alts] == [
        "Stated error", *["Contribution", "Difference"] * 2
    ]  # fmt: skip


def test_both_methods_together(source: str) -> None:
    """Bands and differences hold Monte Carlo and the highest order; the caption says that others are left out."""
    words = _text(source)
    assert "Only the highest order of a surrogate is shown." in words
    assert "Difference of the mean between each method and monte-carlo." in words


@pytest.mark.thorough
def test_one_surrogate_alone(make_chaos: Maker, tmp_path: Path) -> None:
    """A single order has no convergence figure; without verification the verdict is that of the decay."""
    tree = results.study_tree([make_chaos("collocation", 2, verify=0)], study="s", mechanism="m")
    part = _section(_write(tree, tmp_path), "trust")
    assert part.count('class="charted"') == 2 and "by order and by number" not in part and "Stated error" not in part
    assert "order 2 is not enough for slider_x" in _text(part)


@pytest.mark.thorough
def test_dependent_inputs_are_explained(make_chaos: Maker, tmp_path: Path) -> None:
    """The table is one of germs, with a sentence on what these are."""
    tree = results.study_tree([make_chaos("collocation", 3, dependent=True)], study="s", mechanism="m")
    part = _section(_write(tree, tmp_path), "influence")
    assert "the variance cannot be attributed to single inputs" in _text(part) and '<th scope="col">Germ</th>' in part
    assert re.search(r'<th scope="row">[^<]* \| [^<]*</th>', part)


@pytest.mark.thorough
def test_a_chaos_that_cannot_be_read(make_chaos: Maker, tmp_path: Path) -> None:
    """A chaos without its germs is a note with the reason; everything else stands."""
    node = make_chaos("collocation", 2)
    chaos = node["chaos"].to_dataset()
    kept = chaos[["coefficients", "multi_index", "verification_error"]].drop_attrs(deep=False)
    node["chaos"] = xr.DataTree(kept.drop_vars([v for v in kept.coords if str(v).startswith("germ")]))
    source = _write(results.study_tree([node], study="s", mechanism="m"), tmp_path)
    assert "The polynomial chaos of collocation cannot be read" in _text(source)
    assert MATTER in source and "Stated error of the surrogate of collocation" in source


@pytest.mark.thorough
def test_nodes_that_failed_have_their_reasons(make_chaos: Maker, tmp_path: Path) -> None:
    """Nodes that failed are listed with inputs and reason, and it is said that the surrogate did without them."""
    node = make_chaos("collocation", 2)
    nodes = xr.Dataset(
        {
            "inputs": (("node", "input"), np.array([[1.0, 40.0], [0.9, 41.5]])),
            "status": ("node", np.array([0, 2], dtype=np.int32)),
            "message": ("node", np.array(["", "no step at 'pin' <b>"])),
        },
        coords={"input": ["<script>alert(1)", "k_1$"]},
    )
    node["nodes"] = xr.DataTree(nodes)
    node.attrs |= {"failures": 1, "fit": "regression on the 8 of 9 nodes that did not fail"}
    words = _text(_write(results.study_tree([node], study="s", mechanism="m"), tmp_path))
    assert "1 failed, and the surrogate was fitted without them: regression on the 8 of 9 nodes" in words
    assert "The statistics are those of a surrogate that was fitted without them" in words
    assert "Integration failed: 1 sample" in words and "no step at 'pin' <b>" in words and "0.9 41.5" in words


@pytest.mark.thorough
def test_leave_one_out_is_shown_where_it_is_known(make_chaos: Maker, tmp_path: Path) -> None:
    """The stored error is over the variance; the table gives its root, over the standard deviation, where there is one."""
    node = make_chaos("collocation", 2)
    statistics = node["statistics"].to_dataset()
    statistics["leave_one_out"] = (("output", "time"), np.full((4, 41), 4e-4))
    statistics["std"].values[:, 0], statistics["leave_one_out"].values[:, 0] = 1e-12, 10.0
    node["statistics"] = xr.DataTree(statistics)
    part = _section(_write(results.study_tree([node], study="s", mechanism="m"), tmp_path), "trust")
    assert "Leave-one-out error, largest" in part
    assert re.search('<td class="number"[^>]*>2.0\N{NO-BREAK SPACE}%</td>', part)


@pytest.mark.thorough
def test_it_stays_small(source: str, orders: xr.DataTree, tmp_path: Path) -> None:
    """Five surrogates beside Monte Carlo add less than 250 kB for each of the two outputs that vary."""
    plain = _write(results.study_tree([orders["monte-carlo"].copy()], study="s", mechanism="m"), tmp_path)
    assert len(source) - len(plain) < 2 * 250e3
