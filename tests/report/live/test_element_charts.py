"""Charts of elements show the boxes of the chaos, in the units of the inputs, and the errors in them."""

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from tests.report.live.pages import elements_data
from uqmbd.extend import labels
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.report.charts import json_script, unpacked
from uqmbd.results import PiecewiseChaos, PolynomialChaos, propagator_node

TIMES = [0.0, 1.0]


def whole():
    inputs = [
        uqmbd.RandomVariable("a", chaospy.Uniform(0, 2), units="N/m"),
        uqmbd.RandomVariable("b", chaospy.Uniform(10, 20), units="kg"),
    ]
    return GermBox.whole(GermSpace.of(JointInput.of(inputs)))


def made(boxes, errors=None):
    """Return the node of a method with these elements, constant in each."""
    axes = labels(["x"], [("a", "N/m"), ("b", "kg")], TIMES)
    parts = [PolynomialChaos([[[1.0 * k, 0.0]]], [[0, 0]], box.local, axes) for k, box in enumerate(boxes)]
    data = PiecewiseChaos(parts, boxes).to_dataset()
    if errors is not None:
        data["verification_error"] = (("element", "output"), np.asarray(errors)[:, None])
    statistics = PiecewiseChaos(parts, boxes).statistics()
    return propagator_node("mine", statistics, propagator="p", realisations=2, wall_time=0.0, children={"chaos": data})


def four():
    left, right = whole().split(0)
    return [*left.split(1), *right.split(1)]


def test_boxes_are_those_of_the_elements_in_units_of_the_inputs():
    errors = np.array([0.001, 0.01, 0.1, 0.02])
    data = elements_data(made(four(), errors))
    boxes, (method,) = data["boxes"], data["methods"]
    centre, low, high = (unpacked(line["values"]) for line in method["lines"])
    sides = [unpacked(boxes["left"]), unpacked(boxes["right"]), centre + low, centre + high]
    # as they were split: halves of the ranges of a and b, each an element of a quarter of the probability
    expected = {
        (0.0, 1.0, 10.0, 15.0): 0.001,
        (0.0, 1.0, 15.0, 20.0): 0.01,
        (1.0, 2.0, 10.0, 15.0): 0.1,
        (1.0, 2.0, 15.0, 20.0): 0.02,
    }
    found = dict(zip(map(tuple, np.round(sides, 6).T.tolist()), unpacked(boxes["shade"]).tolist(), strict=True))
    assert found == pytest.approx({box: 100 * error for box, error in expected.items()})
    np.testing.assert_allclose(unpacked(method["columns"][1]["values"]), 0.25)
    assert boxes["ends"] == pytest.approx([0.1, 10.0]) and boxes["log"] and boxes["units"] == "% of std"
    assert np.all(np.diff(unpacked(data["time"])) >= 0) and data["start"] == 2
    assert (data["across"]["name"], data["output"]) == ("a", "b")
    assert data["across"]["texts"][0] == "a from 0 to 1 N/m" and data["across"]["ends"] == [0.0, 2.0]


def test_without_errors_probabilities_shade():
    data = elements_data(made(four()))
    assert data["boxes"]["name"] == "probability in the element" and not data["boxes"]["log"]
    np.testing.assert_allclose(unpacked(data["boxes"]["shade"]), 0.25)


def test_along_one_input_they_are_steps():
    first, second = whole().split(1)
    data = elements_data(made([first, second], [1e-3, 1e-1]))
    assert "boxes" not in data and data["across"]["name"] == "b"
    np.testing.assert_allclose(unpacked(data["time"]), [10, 15, 15, 20])
    np.testing.assert_allclose(unpacked(data["methods"][0]["lines"][0]["values"]), [0.1, 0.1, 10, 10])
    assert data["up"]["log"] and data["up"]["low"] <= 0.1 and data["up"]["high"] >= 10


@pytest.mark.parametrize("errors", [[np.nan, 0.01, np.nan, 0.02], [np.nan] * 4])
def test_elements_whose_error_is_not_known_have_no_shade(errors, node):
    """They are boxes like others, and JSON holds the chart."""
    chart = elements_data(made(four(), errors))
    shares = node(["chart_model.js", "chart_layers.js"], """
    const model = chartModel(given);
    answer = model.boxes.shade.map((_, k) => shadeShare(model.boxes, k));
    """, json.loads(json_script(chart)))  # fmt: skip
    known = np.isfinite(unpacked(chart["boxes"]["shade"]))
    assert [share is not None for share in shares] == known.tolist() and known.sum() == np.isfinite(errors).sum()
    assert not known.any() or unpacked(chart["boxes"]["shade"])[chart["start"]] == pytest.approx(2)
    steps = elements_data(made(whole().split(1), errors[:2]))
    assert json_script(steps)


def test_the_box_that_is_pointed_at_is_reported(node):
    chart = elements_data(made(four(), [0.001, 0.01, 0.1, 0.02]))
    lines = """
    const model = chartModel(given.chart);
    answer = given.places.map(([x, y]) => boxAt(model, x, y)).map((k) => k === null ? null : [placeAt(model, k), ...rowsAt(model, k)[0]]);
    answer.push(csvText(model).split("\\r\\n").map((row) => row.split(",")));
    answer.push([0, 0.1, 1, 10, 99].map((v) => shadeShare({ ...model.boxes, shade: [v] }, 0)));
    """
    names = ["chart_model.js", "chart_layers.js"]
    one, other, outside, rows, shares = node(names, lines, {"chart": chart, "places": [[0.5, 12], [1.5, 18], [3, 3]]})
    assert one[0] == "a from 0 to 1 N/m" and one[2:4] == ["0.10", "0.25"] and one[4].split(" to ")[0].startswith("10")
    assert other[0] == "a from 1 to 2 N/m" and other[2] == "2.0" and outside is None
    assert rows[0][:3] == ["a [N/m]", "left end of a [N/m]", "right end of a [N/m]"]
    assert [float(v) for v in rows[1][:3]] == [0.5, 0.0, 1.0]
    assert shares == pytest.approx([0, 0, 0.5, 1, 1])
