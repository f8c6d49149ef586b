"""Figures: what they show is what the data says, whatever the names and magnitudes."""

from __future__ import annotations

import io
import itertools
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from uqmbd import extend, report, results
from uqmbd.errors import StudyError
from uqmbd.report.drawing.ticks import freeze_ticks
from uqmbd.report.figures.distributions import of_surrogate
from uqmbd.report.figures.kernel_density import density
from uqmbd.report.figures.over_time import occurrences


def _drawn(figure: Figure) -> Figure:
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


@pytest.mark.thorough
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
        report.histograms(node["samples"].to_dataset(), output),
        report.time_history_histogram(node, output),
        report.convergence(node, output),
        report.failure_inputs(node),
        report.inputs(node),
    ):
        _drawn(figure)


def test_names_appear_as_written(study: xr.DataTree) -> None:
    """The label that is drawn is the user's name with its units in brackets."""
    figure = _drawn(report.bands(study, r"$F_{pin} \frac <b>&"))
    assert figure.axes[0].get_ylabel().replace(r"\$", "$") == r"$F_{pin} \frac <b>& [N]"
    assert figure.axes[0].get_xlabel() == "time [s]"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[0] == "monte-carlo" and any("galerkin $3" in text for text in legend)


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


def test_histograms_are_densities(study: xr.DataTree) -> None:
    """Bars and curves enclose an area of 1, failed samples left out; times are those asked for; units are inverse."""
    figure = report.histograms(study, "slider_x", [0.49, 2.0])
    assert [a.get_title("right") for a in figure.axes] == ["t = 0.5 s", "t = 2 s"]
    assert figure.axes[0].get_ylabel() == "density [1/m]"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "histogram of monte-carlo", "monte-carlo", "second"
    ]  # fmt: skip
    samples = study["monte-carlo/samples"].to_dataset()
    values = samples["response"].sel(output="slider_x", time=2.0).values[2:]
    for axes in figure.axes:
        assert len(axes.lines) == 3 and len(axes.collections) == 1
        for line in axes.lines:
            area = np.trapezoid(np.nan_to_num(line.get_ydata()), line.get_xdata())
            assert area == pytest.approx(1.0, abs=1e-9 if line is axes.lines[0] else 0.04)  # tails are cut
        inside = axes.lines[0].get_xdata()[np.isfinite(axes.lines[0].get_ydata())]
    assert (inside[0], inside[-1]) == pytest.approx((values.min(), values.max()))
    largest = study["monte-carlo/statistics/std"].sel(output="slider_x").idxmax("time").item()
    titles = [a.get_title("right") for a in report.histograms(study["monte-carlo"], "slider_x").axes]
    assert f"t = {largest:.4g} s" in titles and titles[-1] == "t = 2 s" and len(titles) <= 4


@pytest.mark.parametrize("scale", [1.0, 1e-200, 1e200])
def test_densities_of_every_size(scale: float) -> None:
    """Many samples (counted first), two peaks, far values and extreme units: the area under the curve stays 1."""
    rng = np.random.default_rng(0)
    peaks = np.concatenate([rng.normal(-5, 0.2, 3000), rng.normal(5, 0.2, 3000)])
    for values in (rng.normal(size=100), peaks, np.append(rng.normal(size=99), 40.0)):
        x, f = density(scale * values, 2000)
        assert np.trapezoid(f * scale, x / scale) == pytest.approx(1.0, abs=0.01)
    assert density(np.full(9, scale)) is None and density(np.array([1.0])) is None


@pytest.mark.parametrize("count", [40, 5000])
def test_densities_are_those_of_scipy(count: int) -> None:
    """The sum of kernels is SciPy's, of a skewed distribution; many samples are counted in cells first."""
    from scipy.stats import gaussian_kde

    values = np.random.default_rng(1).gamma(2.0, 3.0, count)
    x, f = density(values)
    quartiles = np.subtract(*np.percentile(values, [75, 25])) / 1.349
    width = 0.9 * min(values.std(ddof=1), quartiles) * count**-0.2
    oracle = gaussian_kde(values, width / values.std(ddof=1))(x)
    np.testing.assert_allclose(f, oracle, atol=(1e-12 if count == 40 else 2e-3) * oracle.max())


def test_a_surrogate_at_some_times_is_that_at_all(orders: xr.DataTree) -> None:
    """Samples at chosen times are those of the whole history; the nearest times are taken."""
    node = orders["collocation-3"]
    whole = of_surrogate(node, "slider_x")
    times = whole["time"].values
    few = of_surrogate(node, "slider_x", np.array([times[3], times[-1], times[-1] + 1.0]))
    assert few["time"].values.tolist() == [times[3], times[-1]]
    np.testing.assert_allclose(few.values, whole.values[:, [3, -1]], rtol=1e-12)


def test_time_history_counts_every_sample_once(study: xr.DataTree) -> None:
    """In each column of time the counts add up to the samples that succeeded, and each lies in its bin."""
    figure = _drawn(report.time_history_histogram(study["monte-carlo"], "slider_x", mean=True))
    counts = figure.axes[0].images[0].get_array()
    assert counts.shape[1] == 41 and 40 <= counts.shape[0] <= 100
    assert np.all(counts.filled(0).sum(axis=0) == 58)
    assert figure.axes[1].get_ylabel() == "number of samples"
    assert figure.axes[0].get_ylabel() == "slider_x [m]"


def test_time_history_is_bounded() -> None:
    """Long and uneven time grids and constants give a small image whose columns count every sample once."""
    times = np.concatenate([np.linspace(0, 1, 3000), [5.0, 9.0]])
    response = np.random.default_rng(0).normal(size=(50, 1)) * np.sin(times)
    counts, columns, _ = occurrences(response, times)
    assert counts.shape[1] == 200 and counts.shape[0] <= 100 and columns[[0, -1]].tolist() == [0.0, 9.0]
    assert np.all(counts.sum(axis=0) == 50)
    counts, _, (low, high) = occurrences(np.full((7, 3), 0.15), np.arange(3.0))
    assert low < 0.15 < high and np.all(counts.max(axis=0) == 7)


def test_convergence_ends_at_the_result(make_node: Callable[..., xr.DataTree]) -> None:
    """The last estimates are the stored mean and standard deviation, the last bands 1.96 stored standard errors."""
    node = make_node("a", samples=300)
    figure = _drawn(report.convergence(node, "slider_x"))
    stored = node["statistics"].to_dataset().sel(output="slider_x")
    last = stored.isel(time=int(stored["std"].values.argmax()))
    for axes, name in zip(figure.axes, ("mean", "std"), strict=True):
        assert axes.get_xscale() == "log"
        line = axes.lines[-1]
        assert line.get_xdata()[-1] == 298
        assert line.get_ydata()[-1] == pytest.approx(float(last[name]))
        band = axes.collections[0].get_paths()[0].vertices
        upper = band[band[:, 0] == 298][:, 1].max()
        assert upper - float(last[name]) == pytest.approx(1.96 * float(last[f"std_error_{name}"]))
    at = report.convergence(node, "slider_x", time=0.51).axes[0]
    assert at.get_title(loc="right") == "t = 0.5 s"
    _drawn(report.convergence(node, "zero"))


def test_convergence_of_replicates(make_node: Callable[..., xr.DataTree]) -> None:
    """Designs whose points depend on one another are shown replicate by replicate."""
    node = make_node("a", samples=320, options={"sampling": "sobol", "replicates": 5})
    figure = _drawn(report.convergence(node, "slider_x"))
    line = figure.axes[1].lines[-1]
    assert line.get_xdata().tolist() == [1, 2, 3, 4, 5]
    assert line.get_ydata()[-1] == pytest.approx(float(node["statistics/std"].sel(output="slider_x").max()))
    assert figure.axes[1].get_xlabel() == "number of replicates (of 64 samples each)"


@pytest.mark.parametrize("options", [{}, {"sampling": "sobol", "replicates": 10}])
def test_convergence_of_samples_not_all_kept(make_node: Callable[..., xr.DataTree], options: dict[str, object]) -> None:
    """Where the results hold the first samples only, the last point is what is stored of all of them."""
    node = make_node("a", samples=320, failing=0, options=options)
    shorter = xr.DataTree.from_dict(
        {
            "/": node.to_dataset(),
            "statistics": node["statistics"].to_dataset(),
            "samples": node["samples"].to_dataset().isel(sample=slice(150)),
        }
    )
    line = _drawn(report.convergence(shorter, "slider_x", 2.0)).axes[0].lines[-1]
    assert line.get_xdata()[-2:].tolist() == ([4, 10] if options else [150, 320])
    assert line.get_ydata()[-1] == float(node["statistics/mean"].sel(output="slider_x", time=2.0))


def test_shares_of_hardly_any_spread_do_not_decide_on_the_axes() -> None:
    """Where nothing spreads, indices are any number: they are covered, and shares fill the axes to 1 elsewhere."""
    axes = extend.labels([("x", "m")], ["k", "c"], np.linspace(0, 1, 5))
    alone = [[[9.0, 0.7, 0.7, 0.6, 0.6]], [[8.0, 0.2, 0.2, 0.3, 0.3]]]
    std = [[1e-9, 1.0, 1.0, 2.0, 2.0]]
    about = extend.statistics_dataset(axes, mean=np.ones((1, 5)), std=std, sobol_first=alone, sobol_total=alone)
    figure = report.sobol_indices(
        results.propagator_node("a", about, propagator="p", realisations=9, wall_time=0.0), "x"
    )
    assert [axes.get_ylim() for axes in figure.axes[:2]] == [(0.0, 1.0)] * 2


def test_long_lines_are_thinned_but_keep_their_peaks() -> None:
    """Ten thousand times are drawn with at most 600 points, and a peak of a single step is among them."""
    times = np.linspace(0, 1, 10_001)
    mean = np.where(np.arange(times.size) == 4321, 7.0, np.sin(times))
    axes = extend.labels(["x"], [], times)
    statistics = extend.statistics_dataset(axes, mean=[mean], std=[0.1 + 0 * times])
    node = results.propagator_node("a", statistics, propagator="p", realisations=1, wall_time=0.0)
    line = report.bands(node, "x").axes[0].lines[0]
    assert len(line.get_ydata()) <= 600 and line.get_ydata().max() == 7.0
    assert line.get_xdata()[[0, -1]].tolist() == [0.0, 1.0]


def test_a_constant_is_not_magnified() -> None:
    """Rounding noise of a constant stays a line in the middle of the axes."""
    axes = extend.labels(["x"], ["k"], [0.0, 1.0, 2.0])
    noise = 1e-17 * np.random.default_rng(0).normal(size=(9, 1, 3))
    samples = extend.sample_dataset(0.15 + noise, np.full((9, 1), 3.0), axes)
    node = results.propagator_node(
        "a", extend.statistics_of_samples(samples), samples, propagator="p", realisations=9, wall_time=0.0
    )
    low, high = report.bands(node, "x").axes[0].get_ylim()
    assert low < 0.1 < 0.2 < high
    for figure in (report.histograms(node, "x"), report.inputs(node)):
        assert any(text.get_text() == "no spread" for text in figure.axes[0].texts)


@pytest.mark.thorough
def test_ticks_do_not_overlap() -> None:
    """At tiny, huge, offset and ordinary magnitudes the labels of an axis keep clear of each other and of the edge."""
    times = np.linspace(0, 2, 21)
    noise = np.random.default_rng(0).normal(size=(50, 1))
    outputs = [1e-7 * noise * times, 1e9 * noise + times, 1e5 + 0.01 * noise + 0 * times, 40 * np.pi * times + noise]
    axes = extend.labels(["a", "b", "c", "d"], [], times)
    samples = extend.sample_dataset(np.stack(outputs, axis=1), np.zeros((50, 0)), axes)
    node = results.propagator_node(
        "a", extend.statistics_of_samples(samples), samples, propagator="p", realisations=50, wall_time=0.0
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
    axes = extend.labels([(name, "rad")], [], [0.0, 1.0])
    statistics = extend.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]])
    node = results.propagator_node("a" * 90, statistics, propagator="p", realisations=1, wall_time=0.0)
    figure = _drawn(report.bands(node, name))
    box = figure.axes[0].yaxis.label.get_window_extent()
    assert box.y0 >= 0 and box.y1 <= figure.bbox.y1 + 1
    assert figure.legends[0].get_window_extent().x1 <= figure.bbox.x1 + 1


@pytest.mark.thorough
@pytest.mark.parametrize("output", ["slider_x", r"$F_{pin} \frac <b>&", "zero"])
def test_frozen_ticks_say_the_same(study: xr.DataTree, output: str) -> None:
    """A figure that is written has the limits and the texts of the figure that was drawn."""
    node = study["monte-carlo"]
    for draw in (report.bands, report.time_history_histogram, report.histograms, report.convergence):
        plain, frozen = draw(node, output), draw(node, output)
        freeze_ticks(frozen)
        _drawn(plain)
        _drawn(frozen)
        for before, after in zip(plain.axes, frozen.axes, strict=True):
            assert after.axis() == pytest.approx(before.axis())
            texts = {text.get_text() for text in after.texts}
            low, high = before.get_ylim()
            shown = [t for t, y in zip(before.get_yticklabels(), before.get_yticks(), strict=True) if low <= y <= high]
            assert {t.get_text() for t in shown} <= texts
            assert before.get_ylabel() in texts | {""}
            assert not after.yaxis.get_visible()


def test_errors_say_what_there_is(study: xr.DataTree) -> None:
    """An unknown output lists the known ones; a method without samples has no histograms."""
    with pytest.raises(StudyError, match="no output 'y'; the outputs are 'slider_x'"):
        report.bands(study, "y")
    with pytest.raises(StudyError, match="stored no samples"):
        report.histograms(study["galerkin $3"], "slider_x")
    with pytest.raises(StudyError, match="at least one propagator"):
        report.bands([], "x")


@pytest.mark.thorough
def test_no_global_state() -> None:
    """Drawing never loads pyplot."""
    code = (
        "import sys; from uqmbd import report, results as r; a = r.labels(['x'], [], [0., 1.]);"
        "n = r.propagator_node('n', r.statistics_dataset(a, mean=[[0, 1]], std=[[1, 1]]), propagator='p',"
        "realisations=1, wall_time=0); assert 'matplotlib' not in sys.modules; report.bands(n, 'x');"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.thorough
def test_a_figure_makes_room_for_what_is_changed_in_it(study: xr.DataTree) -> None:
    """Texts of twice the size run over no edge, neither in one pair of axes nor in a grid of them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    for figure in (report.bands(study, "slider_x"), report.histograms(study, "slider_x")):
        for axes in figure.axes:
            axes.tick_params(labelsize=16)
            for label in (axes.xaxis.label, axes.yaxis.label):
                label.set_fontsize(18)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        for axes in figure.axes:
            box = axes.get_tightbbox(canvas.get_renderer())
            assert figure.bbox.padded(1).contains(box.x0, box.y0) and figure.bbox.padded(1).contains(box.x1, box.y1)
            assert box.y1 <= figure.legends[0].get_window_extent().y0 + 1


def test_pictures_of_the_page_are_where_characters_put_them(study: xr.DataTree) -> None:
    """No layout is computed for them, which would take as long as they themselves."""
    from unittest.mock import patch

    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from uqmbd.report.drawing.images import svg

    with patch.object(ConstrainedLayoutEngine, "execute") as execute:
        svg(report.bands(study, "slider_x"))
        assert not execute.called
        report.bands(study, "slider_x").draw_without_rendering()
        assert execute.called


def test_single_figures_are_drawn_on_given_axes(study: xr.DataTree) -> None:
    """Side by side in a figure of one's own, which keeps its layout; each is as it is alone."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    engine = figure.get_layout_engine()
    draws = {
        left: lambda ax: report.bands(study, "slider_x", ax=ax),
        middle: lambda ax: report.std_over_time(study, "slider_x", ax=ax),
        right: lambda ax: report.failure_inputs(study["monte-carlo"], ax=ax),
    }
    for ax, draw in draws.items():
        assert draw(ax) is figure
        (alone,) = draw(None).axes
        assert ax.get_ylabel() == alone.get_ylabel() and ax.get_xlim() == alone.get_xlim()
        assert [line.get_ydata().tolist() for line in ax.lines] == [line.get_ydata().tolist() for line in alone.lines]
        assert ax.get_legend() is not None
    assert figure.get_layout_engine() is engine and len(figure.axes) == 3 and not figure.legends
