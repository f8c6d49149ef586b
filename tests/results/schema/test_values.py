"""Values of statistics that no statistic has are refused by variable, output and place; those of methods never are."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import uqmbd
from uqmbd import extend, results
from uqmbd.errors import StudyError
from uqmbd.results.schema import check_probabilities, check_values
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability
from uqmbd_springs import SpringDamper

SPEED = uqmbd.RandomVariable("speed", chaospy.Uniform(0.9, 1.1), units="m/s")
START = uqmbd.RandomVariable("start", chaospy.Normal(0, 0.01), units="m")


def study(*, heavy: bool = False) -> uqmbd.Study:
    """A point on a line, with outputs over time, one without, one that may not happen, and a requirement."""
    mechanism = uqmbd.Mechanism("line", uqmbd.Line())
    tail = uqmbd.RandomVariable("tail", chaospy.StudentT(2.5)) if heavy else 0
    point = mechanism.body("point", mass=1, position=START + tail, velocity=SPEED)
    mechanism.output("place", point.position[0], units="m")
    mechanism.output("speed", point.velocity[0], units="m/s")
    mechanism.output("farthest", uqmbd.maximum(point.position[0]), units="m")
    mechanism.require("in reach", point.position[0] <= 1.15)
    return uqmbd.Study("line", mechanism, [0.0, 0.5, 1.0])


def of_methods() -> dict[str, xr.DataTree]:
    """Nodes of all kinds of built-in methods."""
    methods = [
        MonteCarlo(samples=64, label="random"),
        MonteCarlo(samples=64, sampling="sobol", replicates=4, label="sobol"),
        MonteCarlo(samples=64, sobol_indices=True, label="indices"),
        MonteCarlo(samples=64, control=Collocation(order=1), label="control"),
        MonteCarlo(samples=64, keep=30, label="counted"),
        Collocation(order=2, label="projection"),
        Collocation(order=2, method="lars", label="sparse"),
        Collocation(order=1, elements=2, label="elements"),
        Galerkin(order=2, label="galerkin"),
        Reliability(max_realisations=500, label="reliability"),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = {method.node_name: study().propagate(method) for method in methods}
        found["heavy"] = study(heavy=True).propagate(MonteCarlo(samples=64, label="heavy"))
        found["late"] = bouncing().propagate(Collocation(order=1, alignment="events", label="late"))
        design = {"sampling": "sobol", "replicates": 4, "max_failures": 0.6}
        found["failing"] = failing().propagate(MonteCarlo(samples=64, label="failing", **design))
        indices = MonteCarlo(samples=64, sobol_indices=True, label="failing-indices", **design)
        found["failing-indices"] = failing().propagate(indices)
        few = MonteCarlo(samples=4, sampling="latin-hypercube", replicates=2, max_failures=0.6, label="few")
        found["few"] = failing().propagate(few)
        found["early"] = swinging().propagate(Galerkin(order=2, stop_at=0.05, label="early"))
    assert found["late"].attrs["ends_at"] < 2.5 and found["failing"].attrs["failures"] > 0
    assert found["early"].attrs["ends_at"] < 6
    return found


def bouncing() -> uqmbd.Study:
    """A ball that bounces so often that some samples of a surrogate of low order do not reach the last time."""
    height = uqmbd.RandomVariable("h", chaospy.Normal(1.0, 0.2), units="m")
    mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
    ball = mechanism.body("ball", mass=1, position=height)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=0.8))
    mechanism.output("height", ball.position[0], units="m")
    return uqmbd.Study("fall", mechanism, np.linspace(0, 2.5, 26))


def swinging() -> uqmbd.Study:
    """A mass on a spring of random stiffness, of which an expansion of low order holds for some time only."""
    stiffness = uqmbd.RandomVariable("k", chaospy.Uniform(1, 9), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=1.0, velocity=0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness))
    mechanism.output("x", body.position[0], units="m")
    return uqmbd.Study("oscillator", mechanism, np.linspace(0, 6, 13))


def failing() -> uqmbd.Study:
    """A root that 30 % of the realisations do not have."""
    a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 1))
    mechanism = uqmbd.Mechanism("root", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=0, velocity=a)
    mechanism.output("root", sympy.sqrt(a - 0.3) + 0 * point.position[0])
    mechanism.output("speed", point.velocity[0], units="m/s")
    return uqmbd.Study("root", mechanism, [0.0, 1.0])


@pytest.fixture(scope="module")
def nodes() -> dict[str, xr.DataTree]:
    return of_methods()


@pytest.mark.slow
def test_results_of_every_method_are_valid(nodes: dict[str, xr.DataTree]) -> None:
    for node in nodes.values():
        results.validate(node)


NOT_NEGATIVE = {"std", "variance", "std_error_mean", "std_error_std", "quantile_error", "integration_error"}
NOT_NEGATIVE |= {"variance_reduction", "variance_reduction_std", "verification_error", "violation_probability"}
NOT_NEGATIVE |= {"std_error", "interval", "violated_by", "censored", "censored_bound"}
CHECKED = NOT_NEGATIVE | {
    "mean",
    "skewness",
    "kurtosis",
    "quantile",
    "smallest",
    "largest",
    "sobol_first",
    "sobol_total",
}
CHECKED |= {"sobol_first_interval", "sobol_total_interval", "verification_factor"}
MAY_BE_INFINITE = {"verification_factor"}


def places(node: xr.DataTree) -> list[tuple[str, str]]:
    """Datasets and variables of a node that are statistics."""
    paths = [p for p in ("statistics", "scalars/statistics", "requirements") if p in node]
    return [(path, str(n)) for path in paths for n in node[path].data_vars if n in CHECKED and node[path][n].size]


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_random_corruption_is_refused_by_its_place(nodes: dict[str, xr.DataTree], data: st.DataObject) -> None:
    """NaN, infinite, negative or complex: the message names the variable, and the output or requirement."""
    node = nodes[data.draw(st.sampled_from(sorted(nodes)))]
    path, name = data.draw(st.sampled_from(places(node)))
    kinds = ["nan", "complex"] + ["inf", "-inf"] * (name not in MAY_BE_INFINITE) + ["negative"] * (name in NOT_NEGATIVE)
    kind = data.draw(st.sampled_from(kinds))
    values = node[path][name].values
    index = tuple(data.draw(st.integers(0, size - 1)) for size in values.shape)
    if kind == "nan" and np.isnan(values[index]):
        return  # it is one, with its reason
    reasons = json.loads(node[path][name].attrs.get("unknown", "{}"))
    along = dict(zip(node[path][name].dims, index, strict=True))
    dim = "requirement" if path == "requirements" else "output"
    if kind == "nan" and {"*", str(node[path][dim].values[along[dim]])} & reasons.keys():
        return  # it has a reason to be one
    broken = node.copy(deep=True)
    changed = values.astype(complex if kind == "complex" else float)
    amount = data.draw(st.floats(1e-6, 1e6))
    changed[index] = {
        "nan": np.nan, "inf": np.inf, "-inf": -np.inf, "negative": -amount, "complex": changed[index] + 1j * amount
    }[kind]  # fmt: skip
    dataset = broken[path].to_dataset(inherit=False)
    broken[path].dataset = dataset.assign({name: dataset[name].copy(data=changed)})
    with pytest.raises(StudyError) as refused:
        results.validate(broken)
    assert f"{path}/{name}: found" in str(refused.value), (kind, str(refused.value))
    assert str(dataset[dim].values[along[dim]]) in str(refused.value)


@dataclass(frozen=True, kw_only=True)
class Wrong(uqmbd.extend.Propagator):
    """A method whose statistics are changed before they are returned."""

    name: ClassVar[str] = "wrong"
    variable: str = "std"
    value: complex = -1.0

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        labels = problem.labels
        ones = np.ones(labels.shape)
        given = extend.statistics_dataset(labels, mean=ones, std=ones, std_error_mean=ones, std_error_std=ones)
        values = given[self.variable].values.astype(complex if np.imag(self.value) else float)
        values[..., 0] = self.value if np.imag(self.value) else np.real(self.value)
        given[self.variable] = given[self.variable].copy(data=values)
        return problem.node(self, given, realisations=1, wall_time=0.0)


@pytest.mark.parametrize("variable", ["mean", "std", "variance", "std_error_mean"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1 + 2j, -1.0])
def test_a_run_refuses_them_by_name(variable: str, value: complex) -> None:
    """A study does not return what a plugin must not have returned; the message names the method."""
    if (value == -1.0 and variable == "mean") or (np.isnan(value) and variable == "std_error_mean"):
        return
    with pytest.raises(StudyError, match=f"test_values.Wrong returned an invalid node: statistics/{variable}: found"):
        study().propagate(Wrong(variable=variable, value=value))


@pytest.mark.parametrize("name", ["mean", "std", "skewness", "quantile", "std_error_std"])
def test_builders_refuse_what_they_would_lose(name: str) -> None:
    """The imaginary part and the mask of an array are not dropped silently."""
    axes = extend.labels(["x"], [], [0.0, 1.0])
    shape = (7, 1, 2) if name == "quantile" else (1, 2)
    for wrong, words in (
        (
            np.ma.array(np.ones(shape), mask=np.arange(np.prod(shape)).reshape(shape) == 1),
            "is a masked array with 1 masked",
        ),
        (np.ones(shape) * (1 + 1j), "is complex"),
    ):
        with pytest.raises(StudyError, match=f"{name} {words}"):
            extend.statistics_dataset(axes, **{"mean": [[0.0, 1.0]], "std": [[0.0, 1.0]], name: wrong})
    whole = np.ma.array(np.ones(shape))  # nothing is masked
    extend.statistics_dataset(axes, **{"mean": [[0.0, 1.0]], "std": [[0.0, 1.0]], name: whole})
    with pytest.raises(StudyError, match="response is a masked array"):
        extend.sample_dataset(np.ma.array(np.ones((2, 1, 2)), mask=True), np.zeros((2, 0)), axes)


@dataclass(frozen=True, kw_only=True)
class Shapes(uqmbd.extend.Propagator):
    """A method that passes on what scipy says of the shape of samples, and no reasons."""

    name: ClassVar[str] = "shapes"

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        values = problem.inputs.from_uniform(np.random.default_rng(0).random((32, len(problem.inputs))))
        x = problem.realise(values).response
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # nearly equal samples
            shape = {"skewness": stats.skew(x, axis=0), "kurtosis": stats.kurtosis(x, axis=0, fisher=False)}
        error = x.std(axis=0) / np.sqrt(len(x))
        given = {**shape, "std_error_mean": np.where(error > 0, error, np.nan)}
        statistics = extend.statistics_dataset(problem.labels, mean=x.mean(axis=0), std=x.std(axis=0), **given)
        return problem.node(self, statistics, realisations=len(x), wall_time=0.0)


def common_start() -> uqmbd.Study:
    """A point that starts at 1 m with a random speed, and its place squared."""
    mechanism = uqmbd.Mechanism("line", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=1, velocity=SPEED)
    mechanism.output("place", point.position[0], units="m")
    return uqmbd.Study("line", mechanism, [0.0, 1.0])


def test_shapes_and_standard_errors_without_a_reason_get_the_default_one() -> None:
    """Samples that are all equal have no skewness: the run warns, and goes on; its result is valid."""
    with pytest.warns(
        uqmbd.StudyWarning, match="test_values.Shapes returned NaN without a reason: statistics/skewness of 'place'"
    ):
        node = common_start().propagate(Shapes())
    statistics = node["statistics"]
    for name in ("skewness", "kurtosis", "std_error_mean"):
        assert np.isnan(statistics[name].values).any()
        assert json.loads(statistics[name].attrs["unknown"]) == {"place": "not stated"}, name
    results.validate(node)


def as_before(tree: xr.DataTree, version: int | None) -> xr.DataTree:
    """A tree as versions wrote it in which no NaN had a reason."""
    old = tree.copy(deep=True)
    for part in old.subtree:
        dataset = part.to_dataset(inherit=False)
        for variable in dataset.data_vars.values():
            variable.attrs.pop("unknown", None)
        part.dataset = dataset
    old.attrs.pop("schema_version")
    old.attrs |= {} if version is None else {"schema_version": version}
    return old


@pytest.mark.parametrize("version", [None, 0, 1])
def test_results_without_reasons_are_valid_if_they_are_older(version: int | None, tmp_path: Path) -> None:
    """Skewness, quantiles and standard errors of requirements that nobody knows, as they were written before."""
    axes = extend.labels(["x"], [], [0.0, 1.0])
    statistics = extend.statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 1.0]])
    asked = extend.requirements_dataset(["r"], violation_probability=[0.1], lower=[0.0], upper=[0.2])
    about = {"propagator": "mine", "realisations": 1, "wall_time": 0.0}
    node = results.propagator_node("mine", statistics, children={"requirements": asked}, **about)
    tree = results.study_tree([node], study="s", mechanism="m")
    results.validate(tree)
    old = as_before(tree, version)
    results.validate(old)
    if version is not None:
        results.validate(old["mine"])
        results.validate(results.load(results.save(old, tmp_path / "old.nc")))
    now = old.copy(deep=True)
    now.attrs["schema_version"] = tree.attrs["schema_version"]
    with pytest.raises(StudyError, match="mine/statistics/skewness: found a value that is not finite"):
        results.validate(now)
    # nodes that are joined anew have the default reason
    again = results.study_tree([old["mine"]], study="s", mechanism="m")
    results.validate(again)
    assert json.loads(again["mine/statistics/skewness"].attrs["unknown"]) == {"x": "not stated"}
    # other values are refused as ever
    old["mine/statistics"].dataset = (
        old["mine/statistics"].to_dataset(inherit=False).assign({name: statistics[name] - 2 for name in ("std",)})
    )
    with pytest.raises(StudyError, match="mine/statistics/std: found a negative value at output x"):
        results.validate(old)


@pytest.mark.parametrize("inputs", [1, 2, 3])
def test_intervals_may_have_their_dimensions_in_any_order(inputs: int) -> None:
    """Ends are compared with each other, not two inputs; without `bound` the message says so."""
    axes = extend.labels(["x"], [f"i{k}" for k in range(inputs)], [0.0, 1.0])
    ones = np.ones((1, 2))
    given = extend.statistics_dataset(axes, mean=ones, std=ones, sobol_first=np.full((inputs, 1, 2), 0.5))
    place = np.arange(inputs, 0, -1)[:, None, None, None] * 0.1  # falls with the input
    ends = place + np.array([0.0, 0.05])
    data = np.broadcast_to(ends, (inputs, 1, 2, 2)).copy()
    dims = ("input", "output", "time", "bound")
    check_values(given.assign(sobol_first_interval=(dims, data)), "statistics")
    data[inputs - 1, 0, 1] = 0.4, 0.3
    with pytest.raises(
        StudyError, match=rf"sobol_first_interval: found .* at input i{inputs - 1}, output x.* 0.4 and 0.3"
    ):
        check_values(given.assign(sobol_first_interval=(dims, data)), "statistics")
    with pytest.raises(StudyError, match="expected a dimension 'bound' of size 2"):
        check_values(given.assign(sobol_first_interval=(dims[:3], data[..., 0])), "statistics")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("violation_probability", 1.2, "a value outside of its interval"),
        ("std_error", -0.25, "found -0.25 at requirement r; expected a standard error that is finite and 0 or more"),
        ("interval", 1.2, "found 1.2 at requirement r, bound upper; expected a probability from 0 to 1"),
        ("violated_by", 1.2, "found 1.2 at requirement r, time 1.0; expected a probability from 0 to 1"),
    ],
)
def test_messages_name_the_value(name: str, value: float, words: str) -> None:
    asked = extend.requirements_dataset(
        ["r"], violation_probability=[0.1], lower=[0.0], upper=[0.2], std_error=[0.1],
        times=[0.0, 1.0], violated_by=[[0.0, 0.1]],
    )  # fmt: skip
    asked[name].values.flat[-1] = value
    with pytest.raises(StudyError, match=words):
        check_probabilities(asked, "requirements")
