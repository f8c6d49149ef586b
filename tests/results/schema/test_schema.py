"""The schema: what the builders make, and what validation says about each breach."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from uqmbd import extend, results
from uqmbd.errors import StudyError

MakeNode = Callable[..., xr.DataTree]


def test_a_study_keeps_to_the_schema(make_node: MakeNode, study: xr.DataTree) -> None:
    """Whole results and single nodes validate; names, units and provenance are where the contract says."""
    results.validate(study)
    results.validate(make_node("alone"))
    results.validate(study["monte-carlo"])
    assert list(results.propagator_nodes(study)) == ["monte-carlo", "second"]
    node = study["monte-carlo"]
    assert node["statistics/mean"].dims == ("output", "time")
    assert node["statistics/quantile"].dims == ("probability", "output", "time")
    assert node["samples/response"].dims == ("sample", "output", "time")
    assert node["samples"].coords["output_units"].values.tolist() == ["m", "N", ""]
    assert node["samples"].coords["time"].attrs["units"] == "s"
    assert node.attrs["failures"] == 3
    assert json.loads(node.attrs["options"]) == {"samples": 200}
    assert node["samples/status"].attrs["flag_meanings"].split()[2] == "integration_failed"


def test_failed_samples_are_nan_with_a_reason(study: xr.DataTree) -> None:
    """Failed responses are NaN, their inputs stay, and the reason is a text."""
    samples = study["monte-carlo/samples"].to_dataset()
    assert np.isnan(samples["response"][:3]).all()
    assert np.isfinite(samples["inputs"]).all()
    assert samples["message"][0].item().startswith("step too small")
    assert samples["message"][3].item() == ""


def test_unknown_children_and_variables_are_allowed(make_node: MakeNode) -> None:
    """Other packages may add to a node."""
    node = make_node("mine")
    node["chaos"] = xr.DataTree(
        xr.Dataset(
            {
                "coefficients": (("term", "output", "time"), np.zeros((4, 3, 101))),
                "multi_index": (("term", "input"), np.zeros((4, 2), dtype=int)),
            }
        )
    )
    node["scalars/statistics"] = xr.DataTree(xr.Dataset({"mean": ("output", [1.0])}))
    node["statistics"]["verification_error"] = node["statistics/mean"] * 0
    results.validate(node)


def test_outputs_without_time() -> None:
    """Event times and eigenfrequencies use the same builders without a time axis."""
    axes = extend.labels([("t_impact", "s")], [("h", "m")], None)
    samples = extend.sample_dataset([[0.4], [0.5], [np.nan]], [[1.0], [1.1], [1.2]], axes)
    assert samples["response"].dims == ("sample", "output")
    assert samples["message"][2].item() == "output 't_impact' is not finite (nan)"
    assert extend.statistics_of_samples(samples)["mean"].item() == pytest.approx(0.45)


@pytest.mark.parametrize(
    ("outputs", "inputs", "times", "message"),
    [
        (["x", "x"], [], [0.0], "Output name 'x' occurs twice"),
        (["a/b"], [], [0.0], "Output name 'a/b': expected a non-empty name"),
        (["time"], [], [0.0], "Output name 'time': expected a non-empty name other than 'time'"),
        (["x"], [" "], [0.0], "Input name ' ': expected a non-empty name"),
        ([], [], [0.0], "at least one output"),
        (["x"], [], [0.0, 0.0], "increasing numbers"),
        (["x"], [], [], "increasing numbers"),
        ([3], [], [0.0], r"outputs is \[3\]; expected a sequence of .*OutputInfo"),
    ],
)
def test_bad_labels(outputs: list[str], inputs: list[str], times: list[float], message: str) -> None:
    """Names and times that cannot be used are refused by name."""
    with pytest.raises(StudyError, match=message):
        extend.labels(outputs, inputs, times)


def test_builders_refuse_wrong_shapes() -> None:
    """The message says which array, its meaning and both shapes."""
    axes = extend.labels(["x"], ["k"], [0.0, 1.0])
    with pytest.raises(
        StudyError, match=r"'response' has the shape .*; expected \(sample, output, time\) = \(3, 1, 2\)"
    ):
        extend.sample_dataset(np.zeros((3, 2, 1)), np.zeros((3, 1)), axes)
    with pytest.raises(StudyError, match="'inputs' has the shape .*; expected"):
        extend.sample_dataset(np.zeros((3, 1, 2)), np.zeros((3, 2)), axes)
    with pytest.raises(StudyError, match="The status 77 is unknown"):
        extend.sample_dataset(np.zeros((1, 1, 2)), [[0.0]], axes, status=[77])
    with pytest.raises(StudyError, match="one string for each of the 1 samples"):
        extend.sample_dataset(np.zeros((1, 1, 2)), [[0.0]], axes, messages=[])
    with pytest.raises(StudyError, match="'sobol_first' has the shape .*; expected"):
        extend.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 1.0]], sobol_first=[[0.0, 1.0]])
    statistics = extend.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 1.0]])
    for label in ("", "a/b", "comparison", "statistics"):
        with pytest.raises(StudyError, match="label"):
            results.propagator_node(label, statistics, propagator="p", realisations=1, wall_time=0.0)
    node = results.propagator_node("a", statistics, propagator="p", realisations=1, wall_time=0.0)
    with pytest.raises(StudyError, match="Two propagators have the label 'a'"):
        results.study_tree([node, node], study="s", mechanism="m")
    with pytest.raises(StudyError, match="at least one propagator"):
        results.study_tree([], study="s", mechanism="m")


def _drop(name: str) -> Callable[[xr.DataTree], None]:
    return lambda node: node.attrs.__delitem__(name)


def _set(path: str, value: float, index: tuple[int, ...]) -> Callable[[xr.DataTree], None]:
    return lambda node: node[path].values.__setitem__(index, value)


def _replace(child: str, change: Callable[[xr.Dataset], xr.Dataset]) -> Callable[[xr.DataTree], None]:
    def apply(node: xr.DataTree) -> None:
        node[child] = xr.DataTree(change(node[child].to_dataset()))

    return apply


@pytest.mark.parametrize(
    ("breach", "message"),
    [
        (_drop("options"), "/: attribute 'options' is missing; expected a text"),
        (_drop("failures"), "attribute 'failures' = None; expected a whole number"),
        (lambda n: n.attrs.update(wall_time="fast"), "'wall_time' = 'fast'; expected seconds"),
        (lambda n: n.attrs.update(options="{"), "'options' = '{'; expected a JSON object"),
        (lambda n: n.attrs.update(failures=1), "'failures' = 1; expected 3, the number of samples"),
        (_set("statistics/mean", np.nan, (1, 0)), r"/statistics/mean: found a value that is not finite at output \$F"),
        (_set("statistics/std", -1.0, (0, 2)), "/statistics/std: found a negative value at output slider_x, time 0.04"),
        (_set("statistics/variance", 9.0, (0, 0)), "differs from std"),
        (_set("statistics/kurtosis", 0.0, (0, 9)), "not the excess"),
        (_set("statistics/quantile", 9e9, (0, 0, 0)), "falls with the probability"),
        (_set("statistics/largest", -9e9, (0, 0)), "/statistics/quantile: found a quantile that is beyond the samples"),
        (_set("samples/response", 1.0, (0, 0, 0)), "/samples/response: found a number in a failed sample at sample 0"),
        (_set("samples/response", np.inf, (5, 0, 0)), "not finite in a sample of status 0 at sample 5"),
        (_set("samples/status", 55, (5,)), "'flag_values' does not list at sample 5"),
        (_replace("statistics", lambda d: d.drop_vars("kurtosis")), "/statistics: found no variable 'kurtosis'"),
        (_replace("statistics", lambda d: d.drop_vars("output_units")), "no coordinate 'output_units'"),
        (_replace("statistics", lambda d: d.transpose()), r"dimensions \(time, output\); expected \(output, time\)"),
        (_replace("statistics", lambda d: d.isel(time=slice(None, None, -1))), "finite and increasing"),
        (_replace("statistics", lambda d: d.assign_coords(output=[0, 1, 2])), "expected texts"),
        (_set("statistics/variance_reduction", -1.0, (0, 0)), "/statistics/variance_reduction: found a negative value"),
        (
            _set("statistics/sobol_total_interval", np.nan, (1, 0, 0, 0)),
            "sobol_total_interval: found a lower end that is not below the upper one at input k",
        ),
        (
            _replace("statistics", lambda d: d.assign_coords(bound=["low", "high"])),
            r"/statistics/bound: found \['low', 'high'\]; expected",
        ),
        (
            _replace("statistics", lambda d: d.assign(sobol_total_interval=d.sobol_total_interval.mean("bound"))),
            r"expected \(bound, input, output, time\)",
        ),
        (_replace("samples", lambda d: d.isel(time=slice(9))), "/samples/time: found a coordinate other than"),
        (_replace("samples", lambda d: d.assign(status=d.status * 1.0)), "expected whole numbers"),
        (_replace("samples", lambda d: d.drop_vars("message")), "no variable 'message'"),
        (_replace("chaos", lambda d: xr.Dataset()), "/chaos: found no variable 'coefficients'"),
        (_replace("chaos", lambda d: d.drop_vars("multi_index")), "/chaos: found no variable 'multi_index'"),
        (_replace("chaos", lambda d: d.isel(time=0)), r"dimensions \(term, output\); expected \(term, output, time\)"),
        (_replace("chaos", lambda d: d.transpose()), r"coefficients: found the dimensions \(time, output, term\)"),
        (
            _replace("chaos", lambda d: d.assign_coords(output=["a", "b", "c"])),
            "/chaos/output: found a coordinate other",
        ),
        (_replace("chaos", lambda d: d.assign(multi_index=d.multi_index * 0.5)), "expected whole numbers"),
        (_replace("chaos", lambda d: d.assign(multi_index=d.multi_index - 1)), "a negative degree at term 0, input 0"),
        (
            _set("chaos/coefficients", np.nan, (0, 1, 2)),
            "/chaos/coefficients: found a value that is not finite at term 0",
        ),
        (
            _set("chaos/verification_error", np.nan, (0, 2)),
            "/chaos/verification_error: found no error at output 0, time 2",
        ),
    ],
)
def test_validation_names_the_breach(make_node: MakeNode, breach: Callable[[xr.DataTree], None], message: str) -> None:
    """Each breach of the schema has one message with its path, what was found and what was expected."""
    node = make_node("mine")
    node["chaos"] = xr.DataTree(
        xr.Dataset(
            {
                "coefficients": (("term", "output", "time"), np.ones((1, 3, 101))),
                "multi_index": (("term", "input"), [[0, 0]]),
                "verification_error": (("output", "time"), np.ones((3, 101))),
            }
        )
    )
    interval = xr.DataArray(
        np.ones((2, 1, 3, 101)),
        dims=("bound", "input", "output", "time"),
        coords={"bound": ["lower", "upper"], "input": ["k"]},
    )
    statistics = node["statistics"].to_dataset()
    node["statistics"] = xr.DataTree(
        statistics.assign(variance_reduction=statistics["mean"] * 0 + 1, sobol_total_interval=interval)
    )
    results.validate(node)
    breach(node)
    with pytest.raises(StudyError, match=message):
        results.validate(node)


def test_validation_of_the_whole(study: xr.DataTree) -> None:
    """A study without comparison, or one that compares other methods, is refused."""
    for change, message in [
        (lambda t: t.__delitem__("comparison"), "no child 'comparison'"),
        (lambda t: t.__delitem__("second"), "comparison/method: found .* expected the labels"),
        (lambda t: t["second"].__delitem__("statistics"), "/second: found no child 'statistics'"),
        (lambda t: t["comparison"].attrs.update(reference="x"), "'reference' = 'x'"),
    ]:
        broken = study.copy(deep=True)
        change(broken)
        with pytest.raises(StudyError, match=message):
            results.validate(broken)
