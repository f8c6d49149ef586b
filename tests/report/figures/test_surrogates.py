"""Figures of surrogates: influence, decay, stated error, and convergence with the order show what the data says."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from tests.report.live.pages import orders_data
from uqmbd import extend, report, results
from uqmbd.errors import StudyError
from uqmbd.report.charts import unpacked
from uqmbd.report.drawing.ticks import freeze_ticks
from uqmbd.report.figures.sobol import indices_of
from uqmbd.report.figures.surrogates import finest, series, shown_methods

Maker = Callable[..., xr.DataTree]
OUTPUT = "slider_x"


def _drawn(figure: Figure) -> Figure:
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


def _legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def _with_indices(first: np.ndarray, total: np.ndarray, std: np.ndarray, names: list[str]) -> xr.DataTree:
    """Return a node with given indices (I, T), as any method may state them, without a chaos."""
    axes = extend.labels([("x", "N")], names, np.linspace(0, 1, len(std)))
    statistics = extend.statistics_dataset(
        axes, mean=[np.ones_like(std)], std=[std], sobol_first=first[:, None], sobol_total=total[:, None]
    )
    return results.propagator_node("sampled", statistics, propagator="p", realisations=9, wall_time=0.0)


@pytest.mark.thorough
def test_indices_are_stacked(orders: xr.DataTree) -> None:
    """Areas end at the cumulative sums of the first-order indices, lines are the total indices and the deviation."""
    figure = _drawn(report.sobol_indices(orders, OUTPUT))
    data = orders["collocation-5/statistics"].to_dataset().sel(output=OUTPUT)
    shares, totals, spread = figure.axes
    assert _legend(figure)[:2] == ["<script>alert(1)", "k_1$"] == data["input"].values.tolist()
    tops = np.cumsum(data["sobol_first"].values, axis=0)
    for line, top in zip(shares.lines[:2], tops, strict=True):
        np.testing.assert_allclose(line.get_ydata(), top, atol=1e-15)
    for k, low in enumerate((0 * tops[0], tops[0])):
        edges = shares.collections[k].get_paths()[0].vertices
        middle = edges[edges[:, 0] == 1.0][:, 1]
        assert (middle.min(), middle.max()) == pytest.approx((low[20], tops[k][20]))
    for line, total in zip(totals.lines, data["sobol_total"].values, strict=True):
        np.testing.assert_allclose(line.get_ydata(), total)
    np.testing.assert_allclose(spread.lines[0].get_ydata(), data["std"])
    assert spread.get_ylabel() == "std [m]" and spread.get_xlabel() == "time [s]"
    assert shares.get_ylabel().replace("\n", " ") == "share of variance" and totals.get_ylabel() == "total index"


def test_vanishing_spread_is_greyed_out(orders: xr.DataTree) -> None:
    """Exactly the times at which the deviation is at most 1 % of its maximum are covered, in every panel."""
    node = orders["collocation-5"]
    std = node["statistics/std"].sel(output=OUTPUT).values
    times = node["statistics/time"].values
    quiet = std <= 0.01 * std.max()
    assert quiet[0] and 0 < quiet.sum() < 6  # all start at x = 1
    figure = _drawn(report.sobol_indices(node, OUTPUT))
    assert _legend(figure)[-1] == "small standard deviation"
    for axes in figure.axes:
        boxes = [path.get_extents() for path in axes.collections[-1].get_paths()]
        covered = [any(box.x0 <= t < box.x1 for box in boxes) for t in times]
        assert covered == quiet.tolist()
    steady = _with_indices(np.full((2, 3), 0.5), np.full((2, 3), 0.5), np.ones(3), ["a", "b"])
    assert _legend(report.sobol_indices(steady, "x")) == ["a", "b"]


def test_negligible_inputs_are_others() -> None:
    """Of ten inputs those that never matter are summed; where they seem to matter nothing spreads."""
    rng = np.random.default_rng(0)
    std = np.linspace(0.0, 1.0, 50)
    first = np.array([0.6, 0.25, 0.08, *[0.01] * 7])[:, None] * np.ones(50)
    first[9, 0] = 0.9  # at vanishing variance
    total = first + 0.005
    names = [f"input_{k}" for k in rng.permutation(10)]
    figure = _drawn(report.sobol_indices(_with_indices(first, total, std, names), "x"))
    assert _legend(figure) == [*names[:3], "7 others", "small standard deviation"]
    np.testing.assert_allclose(figure.axes[0].lines[3].get_ydata(), first.sum(axis=0))
    np.testing.assert_allclose(figure.axes[1].lines[3].get_ydata(), total[3:].sum(axis=0))


@pytest.mark.parametrize(("count", "expected"), [(1, 1), (2, 2), (4, 4), (6, 6), (7, 6), (10, 6)])
def test_any_number_of_inputs(count: int, expected: int) -> None:
    """At most five are named; a single further one has its name, more are "others"; nothing leaves the figure."""
    first = np.full((count, 4), 0.8 / count)
    names = [f"stiffness of the bushing between the frame and swing arm $\\alpha$ number {k}" for k in range(count)]
    figure = _drawn(report.sobol_indices(_with_indices(first, first + 0.1, np.ones(4), names), "x"))
    shown = _legend(figure)[:-1]
    assert len(shown) == expected == len(set(shown))
    assert shown[-1] == f"{count - 5} others" if count > 6 else shown[-1].endswith(f"number {count - 1}")
    assert _legend(figure)[-1] == "interactions"
    box, frame = figure.legends[0].get_window_extent(), figure.bbox
    # Matplotlib before 3.11 places the axes a pixel higher
    assert box.x1 <= frame.x1 + 1 and box.y0 >= figure.axes[0].get_window_extent().y1 - 2


def test_indices_of_samples_need_no_chaos() -> None:
    """Noisy estimates, below 0 and with a sum above 1, are shown by their lines as they are."""
    first = np.array([[1.02, 0.7], [-0.03, 0.4]])
    figure = _drawn(report.sobol_indices(_with_indices(first, first, np.ones(2), ["a", "b"]), "x"))
    np.testing.assert_allclose([line.get_ydata() for line in figure.axes[1].lines], first)
    assert figure.axes[1].get_ylim()[0] <= -0.03 and figure.axes[0].get_ylim()[1] >= 1.1
    assert "interactions" not in _legend(figure)


def test_germs_are_called_germs(make_chaos: Maker) -> None:
    """Where inputs depend on one another the indices are those of germs, and the figure says so."""
    node = make_chaos("collocation", 3, dependent=True)
    figure = _drawn(report.sobol_indices(node, OUTPUT))
    names = node["statistics"].to_dataset()["germ"].values.tolist()
    assert " | " in names[1] and _legend(figure)[:2] == names
    assert "of germs" in figure.axes[0].get_title("right") and "dependent" in figure.axes[0].get_title("right")
    np.testing.assert_allclose(
        figure.axes[1].lines[1].get_ydata(), node["statistics/sobol_total_germ"].sel(output=OUTPUT)[1]
    )


def test_average_over_time_is_weighted() -> None:
    """The average is the integral of index times variance over the integral of the variance."""
    times = np.linspace(0, 1, 2001)
    found = indices_of(_with_indices(np.stack([times, 1 - times]), np.ones((2, 2001)), times, ["a", "b"]), "x")
    alone, together = found.weighted
    # of t with the weight t^2 on (0, 1): 3 / 4
    assert alone == pytest.approx([0.75, 0.25], abs=1e-3) and together == pytest.approx([1.0, 1.0])


def test_long_series_keep_their_peaks() -> None:
    """Of 5,000 times few are drawn, with the one time at which an input matters."""
    first = np.zeros((2, 5000))
    first[0], first[:, 4321] = 1.0, (0.1, 0.9)
    figure = report.sobol_indices(_with_indices(first, first, np.ones(5000), ["a", "b"]), "x")
    line = figure.axes[1].lines[1]
    assert len(line.get_ydata()) < 700 and line.get_ydata().max() == 0.9


def test_decay_is_that_of_the_coefficients(orders: xr.DataTree) -> None:
    """Points are root sums of squares by order and by degree, over the largest standard deviation."""
    chaos = orders["collocation-5/chaos"].to_dataset().sel(output=OUTPUT)
    squares, index = chaos["coefficients"].values ** 2, chaos["multi_index"].values
    scale = np.sqrt(squares[1:].sum(axis=0).max())
    figure = _drawn(report.coefficient_decay(orders, OUTPUT, times=[1.0]))
    by_order, by_input = figure.axes
    expected = [np.sqrt(squares[index.sum(axis=1) == n].sum(axis=0)) / scale for n in range(1, 6)]
    np.testing.assert_allclose(by_order.lines[1].get_ydata(), [100 * e[20] for e in expected])
    np.testing.assert_allclose(by_order.lines[0].get_ydata(), [100 * e.max() for e in expected])
    for k in (0, 1):
        expected = [100 * np.sqrt(squares[index[:, k] == n].sum(axis=0).max()) / scale for n in range(1, 6)]
        line = next(a for a in by_input.lines if a.get_color() == ("#0072B2", "#D55E00")[k])
        np.testing.assert_allclose(line.get_ydata(), expected)
        assert line.get_xdata().tolist() == [1, 2, 3, 4, 5]
    assert by_order.get_yscale() == "log" and by_order.get_xlabel() == "total order"
    legend = _legend(figure)
    assert {"t = 1 s", "largest over time", "<script>alert(1)", "k_1$", "limit: stated error (1 %)"} == set(legend)
    low, high = by_order.get_ylim()
    assert all(low <= y <= high for axes in figure.axes for line in axes.lines[:2] for y in line.get_ydata())


def test_decay_of_a_constant(orders: xr.DataTree) -> None:
    """What does not vary has nothing to decay, by the words and without a warning."""
    for name in ("constant 力", "zero"):
        figure = report.coefficient_decay(orders, name)
        assert [axes.texts[0].get_text() for axes in figure.axes] == ["no spread", "no spread"]
        assert _legend(report.sobol_indices(orders, name))[-1] == "small standard deviation"


def test_stated_error_and_its_horizon(orders: xr.DataTree) -> None:
    """Lines are the stated errors; a dot lies on the limit at the first time that is above it, and the legend tells."""
    node = orders["collocation-2"]
    stated = node["statistics/verification_error"].to_dataset(name="e")["e"]
    figure = report.verification(node)
    axes = figure.axes[0]
    error, times = stated.sel(output=OUTPUT).values, stated["time"].values
    drawn = axes.lines[0].get_ydata()
    np.testing.assert_allclose(drawn[~np.isnan(drawn)], 100 * error[error > 1e-15])
    first = times[np.argmax(error > 0.01)]
    assert 0 < first < 2
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    assert (dots[0].get_xdata()[0], dots[0].get_ydata()[0]) == (first, 1.0)
    assert _legend(figure)[0] == f"slider_x: above 1 % at {first:.4g} s"
    assert "constant 力: below 1 %" in _legend(figure) and _legend(figure)[-1] == "limit: stated error (1 % of std)"
    assert axes.get_yscale() == "log" and axes.get_xlim() == (0.0, 2.0)
    assert axes.lines[-1].get_ydata()[0] == 1.0


def test_many_outputs_have_one_legend_entry(make_chaos: Maker) -> None:
    """Of ten outputs the five worst are named, the others are one entry."""
    times = np.array([0.0, 1.0])
    axes = extend.labels([f"y{k}" for k in range(10)], [], times)
    zero = np.zeros((10, 2))
    statistics = extend.statistics_dataset(axes, mean=zero, std=zero + 1)
    statistics["verification_error"] = (("output", "time"), 10.0 ** -np.arange(1, 11)[:, None] * [1, 2])
    node = results.propagator_node("a", statistics, propagator="p", realisations=1, wall_time=0.0)
    legend = _legend(_drawn(report.verification(node)))
    assert [text[:2] for text in legend] == ["y0", "y1", "y2", "y3", "y4", "la", "li"]
    with pytest.raises(StudyError, match="states no error.*verify=16"):
        report.verification(make_chaos("collocation", 1, verify=0))


def test_convergence_with_the_order_is_exponential(orders: xr.DataTree) -> None:
    """The points are the differences to the highest order; mean and deviation gain a constant factor with each order."""
    figure = _drawn(report.order_convergence(orders, OUTPUT))
    by_order, by_cost = figure.axes
    reference = orders["collocation-5/statistics"].to_dataset().sel(output=OUTPUT)
    for line, name in zip(by_order.lines, ("mean", "std"), strict=True):
        expected = [
            100
            * float(abs(orders[f"collocation-{n}/statistics/{name}"].sel(output=OUTPUT) - reference[name]).max())
            / float(reference["std"].max())
            for n in range(1, 5)
        ]
        np.testing.assert_allclose(line.get_ydata(), expected)
        assert line.get_xdata().tolist() == [1, 2, 3, 4]
        slopes = np.diff(np.log10(expected))
        assert np.all(slopes < -0.8) and np.ptp(slopes) < 0.5 * abs(slopes.mean())
    assert by_cost.lines[0].get_xdata().tolist() == [12, 17, 24, 33]
    star = by_cost.lines[-1]
    error = float(orders["monte-carlo/statistics/std_error_std"].sel(output=OUTPUT).max())
    assert star.get_xdata()[0] == 200
    assert star.get_ydata()[0] == pytest.approx(100 * error / float(reference["std"].max()))
    assert by_order.get_title("right") == "reference: collocation-5"
    assert _legend(figure) == [
        "collocation: mean", "collocation: standard deviation", "monte-carlo: standard error"
    ]  # fmt: skip
    for view, axes in zip(orders_data(results.propagator_nodes(orders), OUTPUT)["views"], figure.axes, strict=True):
        places, drawn = unpacked(view["time"]), [line for line in axes.lines if len(line.get_xdata())]
        for method, line in zip(view["methods"], drawn, strict=True):
            values = unpacked(method["lines"][0]["values"])
            np.testing.assert_array_equal(places[np.isfinite(values)], line.get_xdata())
            np.testing.assert_allclose(values[np.isfinite(values)], line.get_ydata())
        np.testing.assert_allclose([view["up"]["low"], view["up"]["high"]], axes.get_ylim())
    with pytest.raises(StudyError, match="no other chaos to compare 'collocation-1' with"):
        report.order_convergence({"collocation-1": orders["collocation-1"]}, OUTPUT)


def test_series_are_methods_that_differ_in_order(orders: xr.DataTree, make_chaos: Maker) -> None:
    """Another rule is another series; the reference is the highest order; of many methods lower orders are not drawn."""
    found = {str(name): node for name, node in orders.children.items() if name != "comparison"}
    sparse = make_chaos("sparse", 2)
    sparse.attrs["options"] = '{"order": 2, "rule": "smolyak"}'
    found["sparse"] = sparse
    assert series(found) == {"collocation": [f"collocation-{n}" for n in range(1, 6)], "sparse": ["sparse"]}
    assert finest(found) == "collocation-5"
    assert list(shown_methods(found)) == ["monte-carlo", "collocation-5", "sparse"]
    few = {name: found[name] for name in ("monte-carlo", "collocation-1", "collocation-2", "sparse")}
    assert shown_methods(few) == few


def test_differences_lie_about_their_reference(orders: xr.DataTree) -> None:
    """Lines are what is left of a method less the reference, the band is two of its standard errors."""
    nodes = {name: orders[name] for name in ("monte-carlo", "collocation-1", "collocation-5")}
    figure = _drawn(report.differences(nodes, OUTPUT))
    base = orders["monte-carlo/statistics"].to_dataset().sel(output=OUTPUT)
    for axes, name, words in zip(figure.axes, ("mean", "std"), ("mean", "standard deviation"), strict=True):
        for line, label in zip(axes.lines[1:], list(nodes)[1:], strict=True):
            expected = orders[f"{label}/statistics/{name}"].sel(output=OUTPUT) - base[name]
            np.testing.assert_allclose(line.get_ydata(), expected, atol=1e-15)
        band = axes.collections[0].get_paths()[0].vertices[:, 1]
        assert band.max() == pytest.approx(2 * float(base[f"std_error_{name}"].max()))
        assert axes.get_ylabel().replace("\n", " ") == f"difference of the {words} [m]"
    assert _legend(figure)[:2] == ["monte-carlo, the reference", "± 2 standard errors"]
    exact = report.differences(nodes, OUTPUT, reference="collocation-5")  # which states no standard error
    assert not exact.axes[0].collections and "collocation-5, the reference" in _legend(exact)
    with pytest.raises(StudyError, match="reference is 'x'; expected one of"):
        report.differences(nodes, OUTPUT, reference="x")
    with pytest.raises(StudyError, match="results of two or more methods"):
        report.differences(orders["monte-carlo"], OUTPUT)


def test_methods_that_agree_stay_visible(orders: xr.DataTree) -> None:
    """Lines that coincide are narrower the later they are drawn, with different dashes, and the legend is whole."""
    nodes = {name: orders[name] for name in ("monte-carlo", "collocation-3", "collocation-4", "collocation-5")}
    for figure in (report.bands(nodes, OUTPUT), report.std_over_time(nodes, OUTPUT)):
        _drawn(figure)
        means = {line.get_color(): line for line in figure.axes[0].lines}.values()
        widths = [line.get_linewidth() for line in means]
        assert len(widths) == 4 and widths == sorted(widths, reverse=True) and len(set(widths)) == 4
        assert len({str(line.get_linestyle()) + str(line._dash_pattern) for line in means}) == 4
        box = figure.legends[0].get_window_extent()
        assert box.x1 <= figure.bbox.x1 + 1 and box.y0 >= figure.axes[0].get_window_extent().y1 - 1


@pytest.mark.thorough
def test_frozen_ticks_say_the_same(orders: xr.DataTree) -> None:
    """Written with plain texts, the labels of logarithmic and of linear axes are those of the figure as drawn."""
    for draw in (report.sobol_indices, report.coefficient_decay, report.order_convergence, report.differences):
        plain, frozen = draw(orders, OUTPUT), draw(orders, OUTPUT)
        freeze_ticks(frozen)
        _drawn(plain)
        _drawn(frozen)
        for before, after in zip(plain.axes, frozen.axes, strict=True):
            low, high = before.get_ylim()
            shown = [t for t, y in zip(before.get_yticklabels(), before.get_yticks(), strict=True) if low <= y <= high]
            assert {t.get_text() for t in shown} <= {text.get_text() for text in after.texts}
            assert after.axis() == pytest.approx(before.axis())


def test_errors_say_what_is_missing(study: xr.DataTree, orders: xr.DataTree) -> None:
    """No indices, no chaos, an unknown output: each is a message with the name."""
    with pytest.raises(StudyError, match="results of 'monte-carlo', .* contain no Sobol' indices over time"):
        report.sobol_indices(study, OUTPUT)
    with pytest.raises(StudyError, match="'monte-carlo' has no polynomial chaos"):
        report.coefficient_decay(study["monte-carlo"], OUTPUT)
    with pytest.raises(StudyError, match="None of these results contains a polynomial chaos"):
        report.coefficient_decay(study, OUTPUT)
    for draw in (report.sobol_indices, report.coefficient_decay, report.differences, report.order_convergence):
        with pytest.raises(StudyError, match="no output 'y'|None of these"):
            draw(orders, "y")
