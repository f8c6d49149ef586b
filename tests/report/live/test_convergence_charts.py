"""Charts of errors show what their figures draw."""

import numpy as np

from uqmbd import report, results
from uqmbd.report.live import errors_data, unpacked


def lines(data):
    """Return the values of each line that is switched on and off, by its name."""
    return {method["label"]: unpacked(method["lines"][0]["values"]) for method in data["methods"]}


def stating(errors, times):
    """Return the node of a method that states errors (N, T) of outputs x0, x1, ..."""
    axes = results.labels([(f"x{k}", "m") for k in range(len(errors))], [], times)
    statistics = results.statistics_dataset(axes, mean=0 * errors, std=1 + 0 * errors)
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
        np.testing.assert_allclose(values, 100 * line.get_ydata(), rtol=1e-12)
    assert list(lines(data)) == ["x0", "x1"]
    np.testing.assert_allclose(100 * np.array(axes.get_ylim()), [data["up"]["low"], data["up"]["high"]])
    dots = [line.get_xydata()[0] for line in axes.lines if len(line.get_xdata()) == 1]
    marks = [mark for method in data["methods"] for mark in method["marks"]]
    np.testing.assert_allclose(marks, [[x, 100 * y] for x, y in dots])
    assert data["limits"][0]["value"] == 1.0 and marks == [[times[1], 1.0]]


def test_of_many_outputs_the_worst_of_the_others_is_one_line():
    times = np.linspace(0, 1, 5)
    errors = np.geomspace(1e-4, 1e-1, 9)[:, None] * (1 + times)
    node = stating(errors, times)
    found = lines(errors_data(node))
    assert list(found) == ["x4", "x5", "x6", "x7", "x8", "largest of 4 others"]
    pale = [line.get_ydata() for line in report.verification(node).axes[0].lines[:4]]
    np.testing.assert_allclose(found["largest of 4 others"], 100 * np.max(pale, axis=0), rtol=1e-12)


def test_an_error_at_one_time_has_no_chart():
    assert errors_data(stating(np.array([[1e-3]]), [1.0])) is None
