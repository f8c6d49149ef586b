"""Figures: what they show is what the data says, whatever the names and magnitudes."""

from __future__ import annotations

import io
import itertools
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from uqmbd import report, results
from uqmbd.errors import StudyError


def _drawn(figure: Figure) -> Figure:
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


@pytest.mark.parametrize("output", ["slider_x", r"$F_{pin} \frac <b>&", "zero"])
def test_every_figure_can_be_drawn(study: xr.DataTree, output: str) -> None:
    """Dollar signs, underscores and backslashes are no mathematics, and constants no trouble."""
    node = study["monte-carlo"]
    for figure in (
        report.bands(study, output, samples=5),
        report.bands(node, output),
        report.bands(study["galerkin $3"], output),
        report.std_over_time(study, output),
        report.histograms(node, output),
        report.inputs(node),
    ):
        _drawn(figure)


def test_names_appear_as_written(study: xr.DataTree) -> None:
    """The label that is drawn is the user's name with its units in brackets."""
    figure = _drawn(report.bands(study, r"$F_{pin} \frac <b>&"))
    assert figure.axes[0].get_ylabel().replace(r"\$", "$") == r"$F_{pin} \frac <b>& [N]"
    assert figure.axes[0].get_xlabel() == "time [s]"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[0] == "monte-carlo: mean" and any("galerkin $3" in text for text in legend)


def test_bands_are_the_mean_and_the_quantiles(study: xr.DataTree) -> None:
    """The line is the mean and the filled areas end at the stored quantiles."""
    node = study["monte-carlo"]
    axes = report.bands(node, "slider_x").axes[0]
    statistics = node["statistics"].to_dataset().sel(output="slider_x")
    np.testing.assert_allclose(axes.lines[0].get_ydata(), statistics["mean"])
    for band, (low, high) in zip(axes.collections, [(0.025, 0.975), (0.25, 0.75)], strict=True):
        edge = band.get_paths()[0].vertices[:, 1]
        assert edge.min() == pytest.approx(float(statistics["quantile"].sel(probability=low).min()))
        assert edge.max() == pytest.approx(float(statistics["quantile"].sel(probability=high).max()))


def test_histograms_count_the_samples_that_succeeded(study: xr.DataTree) -> None:
    """Each histogram holds all samples but the failed ones; times are those asked for."""
    figure = report.histograms(study["monte-carlo"], "slider_x", [0.49, 2.0])
    assert [a.get_title() for a in figure.axes] == ["t = 0.5 s", "t = 2 s"]
    for axes in figure.axes:
        assert sum(patch.get_height() for patch in axes.patches) == 58
    largest = study["monte-carlo/statistics/std"].sel(output="slider_x").idxmax("time").item()
    titles = [a.get_title() for a in report.histograms(study["monte-carlo"], "slider_x").axes]
    assert f"t = {largest:.4g} s" in titles and titles[-1] == "t = 2 s" and len(titles) <= 4


def test_a_constant_is_not_magnified() -> None:
    """Rounding noise of a constant stays a line in the middle of the axes."""
    axes = results.labels(["x"], ["k"], [0.0, 1.0, 2.0])
    noise = 1e-17 * np.random.default_rng(0).normal(size=(9, 1, 3))
    samples = results.sample_dataset(0.15 + noise, np.full((9, 1), 3.0), axes)
    node = results.propagator_node(
        "a", results.statistics_of_samples(samples), samples, propagator="p", realisations=9, wall_time=0.0
    )
    low, high = report.bands(node, "x").axes[0].get_ylim()
    assert low < 0.1 < 0.2 < high
    for figure in (report.histograms(node, "x"), report.inputs(node)):
        assert any(text.get_text() == "no spread" for text in figure.axes[0].texts)


def test_ticks_do_not_overlap() -> None:
    """At tiny, huge, offset and ordinary magnitudes the labels of an axis keep clear of each other and of the edge."""
    times = np.linspace(0, 2, 21)
    noise = np.random.default_rng(0).normal(size=(50, 1))
    outputs = [1e-7 * noise * times, 1e9 * noise + times, 1e5 + 0.01 * noise + 0 * times, 40 * np.pi * times + noise]
    axes = results.labels(["a", "b", "c", "d"], [], times)
    samples = results.sample_dataset(np.stack(outputs, axis=1), np.zeros((50, 0)), axes)
    node = results.propagator_node(
        "a", results.statistics_of_samples(samples), samples, propagator="p", realisations=50, wall_time=0.0
    )
    for name in "abcd":
        for figure in (report.bands(node, name), report.histograms(node, name)):
            _drawn(figure)
            for panel in figure.axes:
                boxes = [label.get_window_extent() for label in panel.get_xticklabels() if label.get_text()]
                inside = [b for b in boxes if panel.bbox.x0 - 1 <= (b.x0 + b.x1) / 2 <= panel.bbox.x1 + 1]
                assert all(not one.overlaps(other) for one, other in itertools.pairwise(inside)), name


def test_long_names_stay_inside() -> None:
    """A name longer than the axes is broken into lines that fit the figure."""
    name = "angle of the very long connecting rod against the crank, measured at the pin of the frame"
    axes = results.labels([(name, "rad")], [], [0.0, 1.0])
    statistics = results.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]])
    node = results.propagator_node("a" * 90, statistics, propagator="p", realisations=1, wall_time=0.0)
    figure = _drawn(report.bands(node, name))
    box = figure.axes[0].yaxis.label.get_window_extent()
    assert box.y0 >= 0 and box.y1 <= figure.bbox.y1 + 1
    assert figure.legends[0].get_window_extent().x1 <= figure.bbox.x1 + 1


def test_errors_say_what_there_is(study: xr.DataTree) -> None:
    """An unknown output lists the known ones; a method without samples has no histograms."""
    with pytest.raises(StudyError, match="no output 'y'; there are 'slider_x'"):
        report.bands(study, "y")
    with pytest.raises(StudyError, match="kept no samples"):
        report.histograms(study["galerkin $3"], "slider_x")
    with pytest.raises(StudyError, match="at least one propagator"):
        report.bands([], "x")


def test_no_global_state() -> None:
    """Drawing never loads pyplot."""
    code = (
        "import sys; from uqmbd import report, results as r; a = r.labels(['x'], [], [0., 1.]);"
        "n = r.propagator_node('n', r.statistics_dataset(a, mean=[[0, 1]], std=[[1, 1]]), propagator='p',"
        "realisations=1, wall_time=0); assert 'matplotlib' not in sys.modules; report.bands(n, 'x');"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
