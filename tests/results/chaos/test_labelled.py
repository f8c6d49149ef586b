"""Inputs by their names in, labelled values with units out: whatever gives the inputs, the numbers are the same."""

from __future__ import annotations

import chaospy
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import labels
from uqmbd.randomness import GermSpace, JointInput, index_set
from uqmbd.results import PolynomialChaos, output

TIMES = [0.0, 0.5, 1.0]
UNITS = {"crank": "m", "rod": "m", "load": "N"}
VARIABLES = [
    uqmbd.RandomVariable("rod", chaospy.Uniform(0.3, 0.4), units="m"),
    uqmbd.RandomVariable("crank", chaospy.Normal(0.15, 0.003), units="m"),
    uqmbd.RandomVariable("load", chaospy.Uniform(1, 3), units="N"),
]


def surrogate(times=TIMES):
    space = GermSpace.of(JointInput.of(VARIABLES))
    axes = labels([("x", "m"), ("F", "N")], [(name, UNITS[name]) for name in space.inputs], times)
    terms = index_set(3, 2)
    return PolynomialChaos(np.random.default_rng(1).normal(size=(len(terms), *axes.shape)), terms, space, axes)


CHAOS = surrogate()
POINTS = {"load": [1.5, 2.5, 2.0], "crank": [0.15, 0.148, 0.16], "rod": [0.34, 0.35, 0.31]}
PLAIN = CHAOS.evaluate(np.array([POINTS[name] for name in CHAOS.space.inputs]).T)


def test_a_plain_array_gives_a_plain_array():
    """Also a list, and a DataArray without a dimension of inputs."""
    rows = np.array([POINTS[name] for name in CHAOS.space.inputs]).T
    assert isinstance(PLAIN, np.ndarray) and PLAIN.shape == (3, 2, 3)
    for given_ in (rows.tolist(), xr.DataArray(rows), rows):
        np.testing.assert_array_equal(CHAOS.evaluate(given_), PLAIN)
    np.testing.assert_array_equal(CHAOS.evaluate(inputs=rows), PLAIN)
    assert isinstance(CHAOS.gradient(rows), np.ndarray) and CHAOS.gradient(rows).shape == (3, 3, 2, 3)


def forms():
    """The same points in all forms, in an order of inputs that is not that of the surrogate."""
    frame = pd.DataFrame(POINTS)
    named = xr.Dataset({name: ("run", values, {"units": UNITS[name]}) for name, values in POINTS.items()})
    table = xr.DataArray(np.array(list(POINTS.values())).T, dims=("sample", "input"), coords={"input": list(POINTS)})
    return {
        "mapping": (POINTS, "point"),
        "frame": (frame, "point"),
        "named frame": (frame.set_index(pd.Index([7, 8, 9], name="design")), "design"),
        "dataset": (named, "run"),
        "table": (table, "sample"),
        "coordinates": (xr.Dataset(coords={k: ("run", v) for k, v in POINTS.items()}), "run"),
    }


@pytest.mark.parametrize("form", forms())
def test_the_order_of_names_does_not_matter(form):
    given_, dim = forms()[form]
    found = CHAOS.evaluate(given_)
    assert isinstance(found, xr.DataArray) and found.dims == (dim, "output", "time") and found.name == "response"
    np.testing.assert_array_equal(found.values, PLAIN)
    for name, values in POINTS.items():
        np.testing.assert_array_equal(found[name], values)
        assert found[name].dims == (dim,) and found[name].attrs == {"long_name": name, "units": UNITS[name]}
    assert found["time"].attrs == {"units": "s", "long_name": "time"} and "units" not in found.attrs
    assert found["output_units"].values.tolist() == ["m", "N"]
    one = output(found, "F")
    assert (one.name, one.dims, one.attrs["units"]) == ("F", (dim, "time"), "N")
    if form == "named frame":
        assert found["design"].values.tolist() == [7, 8, 9]
    gradient = CHAOS.gradient(given_)
    assert gradient.dims == (dim, "input", "output", "time")
    assert gradient["input"].values.tolist() == list(CHAOS.space.inputs)
    assert output(gradient, "F", input="crank").attrs["units"] == "N/m"


def test_keywords_numbers_and_lists_mix():
    found = CHAOS.evaluate(crank=0.15, rod=[0.34, 0.35], load=np.float64(2))
    assert found.dims == ("point", "output", "time") and found["crank"].ndim == 0
    expected = [dict(crank=0.15, rod=rod, load=2.0) for rod in (0.34, 0.35)]
    np.testing.assert_array_equal(found, CHAOS.evaluate([[p[name] for name in CHAOS.space.inputs] for p in expected]))
    one = CHAOS.evaluate(crank=0.15, rod=0.34, load=2)
    assert one.dims == ("output", "time")
    np.testing.assert_allclose(one, found.isel(point=0), rtol=1e-12)  # products of matrices round by their shape


@settings(deadline=None, max_examples=25)
@given(st.integers(1, 4), st.integers(1, 3), st.booleans())
def test_arrays_with_dimensions_of_their_own_are_combined(many, few, swap):
    """All combinations, each of which is what the point alone gives."""
    crank = xr.DataArray(np.linspace(0.14, 0.16, many), dims="crank")
    rod = xr.DataArray(np.linspace(0.31, 0.39, few), dims="size", coords={"size": np.arange(few) + 5})
    values = {"rod": rod, "crank": crank} if swap else {"crank": crank, "rod": rod}
    found = CHAOS.evaluate(**values, load=2.0)
    assert set(found.dims) == {"crank", "size", "output", "time"} and found["size"].values.tolist() == list(
        range(5, 5 + few)
    )
    np.testing.assert_array_equal(found["crank"], crank)
    for i in range(many):
        for j in range(few):
            alone = CHAOS.evaluate(crank=float(crank[i]), rod=float(rod[j]), load=2.0)
            np.testing.assert_allclose(found.isel(crank=i, size=j).transpose("output", "time"), alone, rtol=1e-12)


def test_samples_of_a_method_go_in_as_they_are():
    drawn = CHAOS.to_xarray(samples=6, seed=2)
    found = CHAOS.evaluate(drawn["inputs"])
    assert found.dims == ("sample", "output", "time")
    np.testing.assert_allclose(found, drawn["response"], rtol=1e-9)


def test_statistics_and_samples_are_labelled_data():
    found = CHAOS.to_xarray(samples=50, seed=3, probabilities=(0.1, 0.9))
    assert {"mean", "std", "quantile", "sobol_first", "sobol_total", "response", "inputs"} <= set(found.data_vars)
    np.testing.assert_array_equal(found["mean"], CHAOS.mean)
    np.testing.assert_array_equal(found["sobol_total"], CHAOS.sobol_total)
    assert found["probability"].values.tolist() == [0.1, 0.9]
    inputs, response = CHAOS.sample(50, seed=3)
    np.testing.assert_array_equal(found["response"], response)
    np.testing.assert_array_equal(found["inputs"], inputs)
    assert found.uqmbd.output("x")["quantile"].attrs["units"] == "m"
    assert "response" not in CHAOS.to_xarray() and CHAOS.to_xarray().identical(CHAOS.statistics())


def test_outputs_without_a_time():
    found = surrogate(None).evaluate(POINTS)
    assert found.dims == ("point", "output") and "time" not in found.coords


def test_inputs_that_are_called_like_what_results_have():
    variables = [uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)) for name in ("point", "output", "inputs")]
    space = GermSpace.of(JointInput.of(variables))
    axes = labels(["x"], list(space.inputs), [0.0])
    chaos = PolynomialChaos(np.ones((4, 1, 1)), index_set(3, 1), space, axes)
    found = chaos.evaluate({"point": [0.1, 0.2], "output": 0.5, "inputs": 0.5})
    assert found.dims == ("point", "output", "time") and found["output"].values.tolist() == ["x"]
    assert found["point"].values.tolist() == [0.1, 0.2] and found["output_"].item() == 0.5


WRONG = {
    "missing": ({"crank": 0.15}, "Values of load, rod are missing; expected one for each input: crank, load, rod"),
    "unknown": (
        {**POINTS, "crnak": 1.0},
        "The surrogate has no input 'crnak'; the inputs are: crank, load, rod; did you mean 'crank'",
    ),
    "lengths": (
        {**POINTS, "load": [1.0, 2.0]},
        r"different numbers of values along 'point' \(crank: 3, load: 2, rod: 3\)",
    ),
    "outside": ({**POINTS, "load": [1.5, 2.5, 3.5]}, r"'load' is 3.5 in row 2, outside the support .*\[1, 3\]"),
    "no number": ({**POINTS, "load": float("nan")}, "'load' is nan"),
    "text": ({**POINTS, "load": "heavy"}, "Input 'load' is 'heavy'; expected a number"),
    "shape": ({**POINTS, "load": [[1.0, 2.0]]}, r"Input 'load' has the shape \(1, 2\)"),
    "units": (
        {**POINTS, "crank": xr.DataArray(15.0, attrs={"units": "cm"})},
        "'crank' has the units 'cm'; expected 'm'",
    ),
    "dimension": (
        {**POINTS, "load": xr.DataArray([1.0], dims="time")},
        "the dimension 'time', whose name is reserved for results",
    ),
    "coordinates": (
        {
            "crank": xr.DataArray([0.15, 0.151], dims="run", coords={"run": [0, 1]}),
            "rod": xr.DataArray([0.35, 0.351], dims="run", coords={"run": [1, 2]}),
            "load": 2.0,
        },
        "Coordinates of the inputs differ",
    ),
    "column": (pd.DataFrame({**POINTS, "mass": 1.0}), "The surrogate has no input 'mass'"),
    "columns": (pd.DataFrame({"rod": [0.35]}), "Values of crank, load are missing"),
    "table": (xr.DataArray([[0.15, 0.35]], dims=("run", "input")), "'input' has 2 entries without names; expected 3"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_reported(case):
    given_, words = WRONG[case]
    for function in (CHAOS.evaluate, CHAOS.gradient):
        with pytest.raises(uqmbd.StudyError, match=words):
            function(given_)


def test_inputs_are_given_once():
    with pytest.raises(uqmbd.StudyError, match=r"given twice, as an array and by name \(crank\)"):
        CHAOS.evaluate(POINTS, crank=0.15)


def test_germs_outside_their_support_are_reported():
    k = CHAOS.space.inputs.index("load")
    point = np.zeros((2, 3))
    point[1, k] = 1.2
    with pytest.raises(
        uqmbd.StudyError, match="Germ 'load' is 1.2 in row 1; expected a number in its support, from -1 to 1"
    ):
        CHAOS.evaluate_germs(point)
