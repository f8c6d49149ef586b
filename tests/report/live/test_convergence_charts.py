"""Charts of errors show what their figures draw."""

import numpy as np

from tests.report.live.pages import decay_data, errors_data, settling_data
from uqmbd import extend, report, results
from uqmbd.report.charts import unpacked
from uqmbd.report.figures.decay import coefficient_parts

from .chaoses import falling


def lines(data):
    """Return the values of each line that is switched on and off, by its name."""
    return {method["label"]: unpacked(method["lines"][0]["values"]) for method in data["methods"]}


def stating(errors, times):
    """Return the node of a method that states errors (N, T) of outputs x0, x1, ..."""
    axes = extend.labels([(f"x{k}", "m") for k in range(len(errors))], [], times)
    statistics = extend.statistics_dataset(axes, mean=0 * errors, std=1 + 0 * errors)
    statistics["verification_error"] = (("output", "time"), errors)
    return results.propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0.0)


def test_stated_errors_are_those_of_the_figure_in_per_cent():
    times = np.linspace(0, 1, 21)
    errors = np.array([1e-3, 1e-2])[:, None] * (1 + times)
    errors[0, 0] = 0.0
    data = errors_data(stating(errors, times))
    axes = report.verification(stating(errors, times)).axes[0]
    drawn = [line for line in axes.lines if len(line.get_xdata()) == len(times)]
    for line, values in zip(drawn, lines(data).values(), strict=True):
        np.testing.assert_array_equal(values, line.get_ydata())
    np.testing.assert_allclose(list(lines(data).values()), 100 * np.where(errors > 0, errors, np.nan), rtol=1e-12)
    assert list(lines(data)) == ["x0", "x1"]
    np.testing.assert_allclose(axes.get_ylim(), [data["up"]["low"], data["up"]["high"]])
    dots = [line.get_xydata()[0] for line in axes.lines if len(line.get_xdata()) == 1]
    marks = [mark for method in data["methods"] for mark in method.get("marks", ())]
    np.testing.assert_allclose(marks, dots)
    assert data["limits"][0]["value"] == 1.0 and marks == [[times[1], 1.0]]


def test_errors_that_are_all_far_below_the_limit_are_seen():
    times = np.linspace(0, 1, 5)
    up = errors_data(stating(1e-9 * np.array([[1.0, 3.0, 2.0, 1.5, 1.0]]), times))["up"]
    assert up["low"] <= 1e-7 and up["high"] >= 1.0


def test_of_many_outputs_the_worst_of_the_others_is_one_line():
    times = np.linspace(0, 1, 5)
    errors = np.geomspace(1e-4, 1e-1, 9)[:, None] * (1 + times)
    node = stating(errors, times)
    found = lines(errors_data(node))
    assert list(found) == ["x4", "x5", "x6", "x7", "x8", "largest of 4 others"]
    np.testing.assert_allclose(found["largest of 4 others"], 100 * errors[3], rtol=1e-12)


def test_an_error_at_one_time_has_no_chart():
    assert errors_data(stating(np.array([[1e-3]]), [1.0])) is None


def sampled(values, **options):
    """Return the node of a method with samples of one output at one time."""
    axes = extend.labels([("x", "m")], [], [0.5])
    data = extend.sample_dataset(values[:, None, None], np.zeros((len(values), 0)), axes)
    statistics = extend.statistics_of_samples(data)
    return results.propagator_node(
        "mc", statistics, data, propagator="p", options=options, realisations=len(values), wall_time=0.0
    )


def bands(view):
    """Return the lines of a view: the estimate, and the lower and upper end of its band."""
    line, low, high = (unpacked(one["values"]) for one in view["methods"][0]["lines"])
    return line, line + low, line + high


def test_estimates_settle_as_in_the_figure():
    node = sampled(np.random.default_rng(0).normal(5.0, 1.0, 300))
    data = settling_data(node, "x")
    for view, axes in zip(data["views"], report.convergence(node, "x").axes, strict=True):
        x, y = axes.lines[1].get_data()
        estimate, low, high = bands(view)
        np.testing.assert_array_equal(unpacked(view["time"]), x)
        np.testing.assert_array_equal(estimate, y)
        area = axes.collections[0].get_paths()[0].vertices
        np.testing.assert_allclose([low.min(), high.max()], [area[:, 1].min(), area[:, 1].max()], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose([view["up"]["low"], view["up"]["high"]], axes.get_ylim())
        assert view["limits"] == [{"name": "final value", "value": y[-1], "reference": True}]
        assert view["across"]["log"] and axes.get_xscale() == "log" and view["across"]["name"] == "number of samples"
    assert [view["units"] for view in data["views"]] == ["m", "m"]


def test_replicates_of_a_design_are_points_on_a_plain_axis():
    node = sampled(np.random.default_rng(0).normal(5.0, 1.0, 64), sampling="sobol", replicates=4)
    view = settling_data(node, "x")["views"][0]
    axes = report.convergence(node, "x").axes
    np.testing.assert_array_equal(unpacked(view["time"]), [1, 2, 3, 4])
    np.testing.assert_array_equal(bands(view)[0], axes[0].lines[1].get_ydata())
    assert "log" not in view["across"] and view["methods"][0]["points"] and axes[0].lines[1].get_marker() == "o"
    assert view["across"]["name"] == axes[1].get_xlabel() == "number of replicates (of 16 samples each)"


def test_values_without_spread_settle_at_once():
    assert "up" not in settling_data(sampled(np.full(50, 3.0)), "x")["views"][0]
    assert settling_data(sampled(np.array([1.0, 2.0])), "x") is None


def test_coefficients_fall_as_in_the_figure():
    node = falling(3)
    by_order, by_input = decay_data(node, "x")["views"]
    left, right = report.coefficient_decay(node, "x").axes
    for view, axes in ((by_order, left), (by_input, right)):
        drawn = {line.get_label(): line for line in axes.lines if len(line.get_xdata()) == 3}
        found = list(lines(view).values())
        for values in found:
            assert any(np.array_equal(values, line.get_ydata()) for line in drawn.values())
        assert len(found) == len(drawn)
        np.testing.assert_array_equal(unpacked(view["time"]), [1, 2, 3])
        np.testing.assert_allclose(axes.get_ylim(), [view["up"]["low"], view["up"]["high"]])
        assert all(method["points"] for method in view["methods"])
    assert list(lines(by_order))[0] == "largest over time" and list(lines(by_input)) == ["k0", "k1", "k2"]
    legend = [text.get_text() for text in left.figure.legends[0].get_texts()]
    assert set(lines(by_order)) | set(lines(by_input)) | {"limit: stated error (1 %)"} == set(legend)


def test_of_many_inputs_the_largest_of_the_others_is_one_line():
    node = falling(9, order=2)
    found = lines(decay_data(node, "x")["views"][1])
    shares = coefficient_parts(node, "x")
    np.testing.assert_allclose(
        found["largest of 4 others"], 100 * np.nanmax(shares.of_inputs[shares.others], axis=0), rtol=1e-6
    )
    assert len(found) == 6


def test_one_order_has_no_chart():
    assert decay_data(falling(2, order=1), "x") is None
