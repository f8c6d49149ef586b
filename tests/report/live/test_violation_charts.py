"""Charts of violated requirements show what methods say, with the intervals of the whole motion at the end."""

import numpy as np
import xarray as xr

from tests.report.live.pages import violation_data, violations_data
from uqmbd import extend
from uqmbd.report.charts import draw_on_paper, unpacked
from uqmbd.report.figures import worst_violations_chart

TIMES = np.linspace(0, 2, 21)


def node(probabilities, names=("overload", "stop"), times=TIMES, width=0.3):
    """Return the node of a method whose probabilities grow linearly up to these."""
    # of several requirements there is one more answer, that any of them is violated
    probabilities = [*probabilities, sum(probabilities)] if len(probabilities) > 1 else probabilities
    grown = np.asarray(probabilities)[:, None] * times / times[-1]
    last = np.asarray(probabilities)
    data = extend.requirements_dataset(
        list(names), violation_probability=last, lower=(1 - width) * last, upper=(1 + width) * last,
        times=times, violated_by=grown,
    )  # fmt: skip
    return xr.DataTree.from_dict({"requirements": data}, name="mine")


def lines(chart):
    """Return the lines of each method: the probability, and the ends of its interval."""
    found = {}
    for method in chart["methods"]:
        first, *rest = (unpacked(line["values"]) for line in method["lines"])
        found[method["label"]] = [first, *(np.nan_to_num(first) + one for one in rest)]
    return found


def test_probabilities_and_intervals_are_those_of_the_methods():
    nodes = {"a": node([0.1, 0.2]), "b": node([0.3, 0.4])}
    data = violations_data(nodes)
    assert [view["title"] for view in data["views"]] == ["overload", "stop", "any"] and data["seen"] == 2
    for view in data["views"]:
        np.testing.assert_array_equal(unpacked(view["time"]), TIMES)
        assert "across" not in view  # it has the time of the page
        for label, (values, low, high) in lines(view).items():
            one = nodes[label]["requirements"].to_dataset().sel(requirement=view["title"])
            np.testing.assert_allclose(values, 100 * one["violated_by"].values)
            assert np.isnan(low[:-1]).all() and np.isnan(high[:-1]).all()
            np.testing.assert_allclose([low[-1], high[-1]], 100 * one["interval"].values, rtol=1e-6)
            assert view["up"]["high"] > high[-1] and "log" not in view["up"]


def test_rare_violations_are_on_a_logarithmic_axis():
    (view,) = violations_data({"a": node([1e-6], ["overload"])})["views"]
    up = view["up"]
    # per cent: the smallest probability above zero is a twentieth of the last
    assert up["log"] and up["low"] <= 5e-6 and up["high"] >= 1.3e-4


def test_an_interval_that_says_nothing_leaves_the_curve_readable():
    one = node([0.02], ["overload"])
    data = one["requirements"].to_dataset()
    data["interval"] = (data["interval"].dims, [[0.0, 1.0]])
    (view,) = violations_data({"a": xr.DataTree.from_dict({"requirements": data}, name="a")})["views"]
    assert view["up"]["high"] < 5


def test_methods_that_end_early_have_their_interval_there():
    (view,) = violations_data({"a": node([0.1], ["o"], TIMES[:11]), "b": node([0.1], ["o"])})["views"]
    (_, low, _), _ = lines(view).values()
    assert np.flatnonzero(np.isfinite(low)).tolist() == [10]


def test_one_chart_has_all_requirements_of_the_first_method_or_all_methods():
    nodes = {"a": node([0.1, 0.2]), "b": node([0.3, 0.4])}
    assert list(lines(violation_data(nodes))) == ["overload", "stop", "any"]
    np.testing.assert_allclose(lines(violation_data(nodes))["stop"][0][-1], 20)
    one = {"a": node([0.1], ["o"]), "b": node([0.2], ["o"])}
    assert list(lines(violation_data(one))) == ["a", "b"]


def test_what_does_not_grow_has_no_chart():
    assert violations_data({"a": node([0.0, 0.0])}) is None and violation_data({"a": node([0.0], ["o"])}) is None


def test_the_picture_has_decades_and_bars():
    """A probability that grows by equal factors is a straight line; its interval is a bar from end to end."""
    probabilities = 1e-6 * 10 ** (TIMES - 2)
    data = extend.requirements_dataset(
        ["o"], violation_probability=[1e-6], lower=[5e-7], upper=[2e-6], times=TIMES, violated_by=[probabilities]
    )
    chart = worst_violations_chart({"a": xr.DataTree.from_dict({"requirements": data}, name="a")})
    axes = draw_on_paper(chart).axes[0]
    bar, line = axes.lines
    places = axes.transData.transform(np.column_stack(line.get_data()))
    np.testing.assert_allclose(np.diff(places, n=2, axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(bar.get_data(), [[2, 2], [5e-5, 2e-4]], rtol=1e-6)
    assert axes.get_yscale() == "log" and "10⁻⁴" in axes.yaxis.get_major_formatter().format_ticks(axes.get_yticks())


VIOLATED = {"a": node([0.1], ["o"])}


def test_the_table_has_the_interval_of_the_whole_motion_at_all_times(node):
    (view,) = violations_data(VIOLATED)["views"]
    lines = "const model = chartModel(given); answer = [0, model.at.length - 1].map((k) => rowsAt(model, k)[0].at(-1));"
    first, last = node(["chart_model.js", "chart_layers.js"], lines, view)
    assert first == last and first == "7.0 to 13"
