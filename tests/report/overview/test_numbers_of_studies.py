"""Numbers on the first screens of the studies, of all kinds, are those of their results in the file."""

import math
import re
import warnings
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import results
from uqmbd.propagation import load_study
from uqmbd.report.overview.answers import ANSWERS
from uqmbd.report.view import StudyResult
from uqmbd_calibration.reporting import CalibrationSection
from uqmbd_collocation import Collocation

from .test_margins import numbers

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::UserWarning"),
    pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning"),
]

STUDIES = Path(__file__).parents[3] / "studies"
NAMES = (
    "slider_crank", "limits", "calibration", "agile_eye", "robot", "tolerances", "clearance", "motorcycle", "long_time",
)  # fmt: skip
SMALL = {"samples": 60, "max_realisations": 1000}
MOST_TIMES = 801


def smaller(propagator):
    """Return a method with fewer realisations, also within another method; chaoses stay as they are."""
    assert is_dataclass(propagator)
    known = {one.name: getattr(propagator, one.name) for one in fields(propagator) if one.init}
    changed = {name: min(value, SMALL[name]) for name, value in known.items() if name in SMALL and value}
    inner = {name: smaller(value) for name, value in known.items() if hasattr(value, "propagate")}
    return replace(propagator, **changed, **inner)


def scalars():
    """A stone whose largest height and flight time are asked for, and nothing over time."""
    mechanism = uqmbd.Mechanism("throw", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("highest", uqmbd.maximum(stone.position[1]), units="m")
    mechanism.output("last", uqmbd.final(stone.position[1]), units="m")
    return uqmbd.Study("throw", mechanism, np.linspace(0, 0.5, 11), [Collocation(order=3)])


@pytest.fixture(scope="module", params=[*NAMES, "scalars"])
def stored(request, tmp_path_factory):
    """The results of a study, read from their file."""
    if request.param == "scalars":
        study = scalars()
    else:
        study = load_study(STUDIES / f"{request.param}.py")
        study = study.with_propagators([smaller(one) for one in study.propagators])
        study = study.with_times(study.times[:MOST_TIMES])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tree = study.run()
    path = results.save(tree, tmp_path_factory.mktemp(request.param) / "results.nc")
    return results.load(path)


def weighted(data):
    """Return the total indices (input,) of an output: the mean over time, weighted by the variance."""
    total, std = data["sobol_total"].values, data["std"].values
    return total if total.ndim == 1 else total @ std**2 / np.sum(std**2)


def shown(values):
    """Compare with numbers of four digits."""
    return pytest.approx(values, rel=6e-4, abs=1e-12)


def check_bars(tree, matters):
    """Compare the main contributors with indices, importance factors or correlations of the file."""
    label = re.search(r"\(([^()]*)\)\.|regression of ([\w-]+) |by ([\w-]+)[,:]", matters["kind"])
    known = tree[label[1] or label[2] or label[3]]
    if matters["kind"].startswith(("Correlations", "Effects")):
        at = numbers(matters["kind"])[0]
        samples = known["samples"].to_dataset().sel(output=matters["of"]).sel(time=at, method="nearest")
        columns = samples["inputs"].transpose("sample", "input").values
        columns, response = ((x - x.mean(axis=0)) / x.std(axis=0) for x in (columns, samples["response"].values))
        effects = np.linalg.lstsq(columns, response, rcond=None)[0]
        found = effects if matters["kind"].startswith("Effects") else columns.T @ response / len(response)
        names = samples["input"].values
    elif matters["kind"].startswith("Importance"):
        data = known["requirements"].to_dataset().sel(requirement=matters["of"])
        found, names = data["importance"].values, data["input"].values
    else:
        held = known["requirements/statistics"] if "of its margin" in matters["kind"] else known["statistics"]
        if matters["of"] not in held["output"].values:
            held = known["scalars/statistics"]
        data = held.to_dataset().sel(output=matters["of"])
        data = data.isel(time=-1) if "of its margin" in matters["kind"] and "time" in data.dims else data
        found, names = weighted(data), data["input"].values
    expected = dict(zip(map(str, names), found, strict=True))
    for bar in matters["bars"]:
        (number,) = numbers(bar["text"].lstrip("+"))
        assert number == pytest.approx(expected[bar["name"]], abs=6e-3)
    assert bar["name"] and matters["bars"][0]["name"] == max(expected, key=lambda name: abs(expected[name]))


def check_output(tree, row):
    """Compare the largest standard deviation of an output, its extremes and their times."""
    data = tree[row["method"]]["statistics"].to_dataset().sel(output=row["known"].quantity)
    at = int(np.nan_to_num(data["std"].values, nan=-1).argmax())
    assert numbers(row["spread"])[0] == shown(float(data["std"][at]))
    assert numbers(row["when"])[0] == shown(float(data["time"][at]))
    low, high = (data["quantile"].sel(probability=p).values for p in (0.025, 0.975))
    size = max(abs(np.nanmin(low)), abs(np.nanmax(high)))
    pair = [numbers(row["extremes"][end])[0] for end in ("low", "high")]
    assert pair == pytest.approx([np.nanmin(low), np.nanmax(high)], abs=6e-4 * size)
    times = [numbers(row["extremes"][f"{end}_at"])[0] for end in ("low", "high")]
    assert times == shown([float(data["time"][np.nanargmin(low)]), float(data["time"][np.nanargmax(high)])])


def check_requirement(tree, row):
    """Compare a probability, its interval, and the margin."""
    known = tree[row["method"]]["requirements"].to_dataset().sel(requirement=row["name"])
    lower, upper = known["interval"].values
    assert numbers(row["value"])[0] == pytest.approx(float(known["violation_probability"]), rel=0.06)
    ends = [one for one, hidden in ((lower, lower <= 0), (upper, upper >= 1)) if not hidden]
    assert numbers(row["interval"]) == pytest.approx(ends, rel=0.06)
    if row["margin"][0]:
        margin = tree[row["method"]]["requirements/statistics"].to_dataset().sel(output=row["name"])
        margin = margin.isel(time=-1) if "time" in margin.dims else margin
        pair = [numbers(text)[0] for text in row["margin"][:2]]
        assert pair == pytest.approx([float(margin["mean"]), float(margin["std"])], rel=1e-3)


def check_scalar(tree, row):
    """Compare mean, standard deviation and interval of a scalar output."""
    data = tree[row["method"]]["scalars/statistics"].to_dataset().sel(output=row["name"])
    assert [numbers(row[key])[0] for key in ("mean", "spread")] == shown([float(data["mean"]), float(data["std"])])
    ends = data["quantile"].sel(probability=[0.025, 0.975]).values
    assert numbers(row["interval"]) == pytest.approx(ends.tolist(), abs=6e-4 * np.abs(ends).max())


CHECKS = {"outputs": check_output, "requirements": check_requirement, "scalars": check_scalar}


def test_the_table_is_that_of_the_file(stored):
    content = ANSWERS.content(StudyResult.of(stored))
    asked = content["results_table"]
    assert asked["rows"]
    for row in asked["rows"]:
        if not row.get("note"):
            CHECKS[asked["kind"]](stored, row)


def test_contributors_reliability_and_costs_are_those_of_the_file(stored):
    result = StudyResult.of(stored)
    content = ANSWERS.content(result)
    check_bars(stored, content["matters"])
    for one in content["next"]["methods"]:
        count, seconds = (numbers(text)[0] for text in one["cost"].split(", "))
        attrs = stored[one["label"]].attrs
        assert count == attrs["realisations"]
        scale = 1e3 if one["cost"].endswith(" ms") else 1.0
        if " min " not in one["cost"]:
            assert seconds == pytest.approx(scale * attrs["wall_time"], rel=0.05, abs=0.51)
    comparison = stored["comparison"].to_dataset() if "comparison" in stored.children else {}
    compared = 0
    for one in result.assessment.reliability:
        if one.kind != "output" or "stated_error_max" not in comparison or one.method not in comparison["method"]:
            continue
        known = comparison.sel({"method": one.method, "output": one.quantity})
        found = re.search(r"at most ([\d.]+) % of the standard deviation \(at (\S+) s\)", one.reason)
        if found and math.isfinite(float(known["stated_error_max"])):
            assert float(found[1]) == pytest.approx(100 * float(known["stated_error_max"]), rel=0.06)
            assert float(found[2]) == shown(float(known["stated_error_time"]))
            compared += 1
    assert compared or content["results_table"]["kind"] != "outputs" or "population" in str(stored["after"].attrs)


def test_calibrated_inputs_are_those_of_the_file(stored):
    """The table of a calibration has the means of the stored posterior."""
    screen = CalibrationSection().first_screen(stored)
    if screen is None:
        assert not any("calibration" in node.children for node in results.methods(stored).values())
        return
    (summary,) = (
        node["calibration/summary"].to_dataset() for node in stored.children.values() if "calibration" in node.children
    )
    for row in screen.rows:
        one = summary.sel(input=row[0].split(" [")[0])
        assert numbers(row[2])[:2] == pytest.approx([float(one["mean"]), float(one["sd"])], rel=0.06)
