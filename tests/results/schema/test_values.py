"""Values of statistics that no statistic has are refused by variable, output and place; those of methods never are."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import results
from uqmbd.errors import StudyError
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

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
    return found


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
    if kind == "nan" and name in ("skewness", "kurtosis", "quantile") and "unknown" in node[path][name].attrs:
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
    along = dict(zip(dataset[name].dims, index, strict=True))
    dim = "requirement" if path == "requirements" else "output"
    assert f"{path}/{name}: found" in str(refused.value), (kind, str(refused.value))
    assert str(dataset[dim].values[along[dim]]) in str(refused.value)


@dataclass(frozen=True, kw_only=True)
class Wrong(uqmbd.Propagator):
    """A method whose statistics are changed before they are returned."""

    name: ClassVar[str] = "wrong"
    variable: str = "std"
    value: complex = -1.0

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        labels = problem.labels
        ones = np.ones(labels.shape)
        given = results.statistics_dataset(labels, mean=ones, std=ones, std_error_mean=ones, std_error_std=ones)
        values = given[self.variable].values.astype(complex if np.imag(self.value) else float)
        values[..., 0] = self.value if np.imag(self.value) else np.real(self.value)
        given[self.variable] = given[self.variable].copy(data=values)
        return problem.node(self, given, realisations=1, wall_time=0.0)


@pytest.mark.parametrize("variable", ["mean", "std", "variance", "std_error_mean"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1 + 2j, -1.0])
def test_a_run_refuses_them_by_name(variable: str, value: complex) -> None:
    """A study does not return what a plugin must not have returned; the message names the method."""
    if value == -1.0 and variable == "mean":
        return
    with pytest.raises(StudyError, match=f"test_values.Wrong returned a node .* statistics/{variable}: found"):
        study().propagate(Wrong(variable=variable, value=value))


@pytest.mark.parametrize("name", ["mean", "std", "skewness", "quantile", "std_error_std"])
def test_builders_refuse_what_they_would_lose(name: str) -> None:
    """The imaginary part and the mask of an array are not dropped silently."""
    axes = results.labels(["x"], [], [0.0, 1.0])
    shape = (7, 1, 2) if name == "quantile" else (1, 2)
    for wrong, words in (
        (
            np.ma.array(np.ones(shape), mask=np.arange(np.prod(shape)).reshape(shape) == 1),
            "is a masked array with 1 masked",
        ),
        (np.ones(shape) * (1 + 1j), "is complex"),
    ):
        with pytest.raises(StudyError, match=f"'{name}' {words}"):
            results.statistics_dataset(axes, **{"mean": [[0.0, 1.0]], "std": [[0.0, 1.0]], name: wrong})
    whole = np.ma.array(np.ones(shape))  # nothing is masked
    results.statistics_dataset(axes, **{"mean": [[0.0, 1.0]], "std": [[0.0, 1.0]], name: whole})
    with pytest.raises(StudyError, match="'response' is a masked array"):
        results.sample_dataset(np.ma.array(np.ones((2, 1, 2)), mask=True), np.zeros((2, 0)), axes)
