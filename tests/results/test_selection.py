"""Data as users of xarray expect it: units in attributes, one layout of all methods, one output with its unit."""

from __future__ import annotations

import json
import subprocess
import sys

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.extend import labels, sample_dataset, statistics_dataset
from uqmbd.results import by_output, load, output, save, surrogate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

# methods are coarse: their results are read here
pytestmark = pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")

TIMES = np.linspace(0, 1, 11)
UNITS = {"x": "m", "angle": "rad", "rate": "rad/s", "bare": "", "fastest": "rad/s"}
"""Of all outputs; the last has no time."""

METHODS = {
    "sampling": MonteCarlo(samples=16, seed=1, label="sampling"),
    "indices": MonteCarlo(samples=16, seed=1, sobol_indices=True, label="indices"),
    "collocation": Collocation(order=2),
    "regression": Collocation(order=1, method="regression", samples=12, label="regression"),
    "elements": Collocation(order=1, elements=2, label="elements"),
    "phase": Collocation(order=2, alignment="phase", clock="angle", label="phase"),
    "mixed": Collocation(order=2, alignment=("plain", "phase"), clock="angle", label="mixed"),
    "galerkin": Galerkin(order=2),
}


def turning():
    """A mechanism that turns, with outputs of several units."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(0.5, 0.01), units="m")
    rate = uqmbd.RandomVariable("rate0", chaospy.Uniform(7.5, 8.5), units="rad/s")
    mechanism = uqmbd.Mechanism("turning", uqmbd.Planar(gravity=(0, -9.81)))
    body = mechanism.body("body", mass=2, inertia=0.3, position=(length, 0), angle=0, angular_velocity=rate)
    mechanism.add(Revolute("pin", mechanism.ground, body, point_i=(0, 0), point_j=(-length, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("angle", body.angle, units="rad")
    mechanism.output("rate", body.angular_velocity, units="rad/s")
    mechanism.output("bare", body.position[1] / length)
    mechanism.output("fastest", uqmbd.maximum(body.angular_velocity), units="rad/s")
    return mechanism


@pytest.fixture(scope="module")
def mechanism():
    return turning()


@pytest.fixture(scope="module")
def tree(mechanism):
    return uqmbd.Study("turning", mechanism, times=TIMES, propagators=list(METHODS.values())).run()


@pytest.fixture(scope="module")
def motion(mechanism):
    return uqmbd.simulate(mechanism, TIMES)


@pytest.mark.thorough
def test_a_variable_says_its_unit_where_it_has_one(tree):
    """Of numbers in statistics and samples: pure numbers have units, those of outputs where one output is chosen."""
    pure = {"skewness", "kurtosis", "sobol_first", "sobol_total", "verification_error", "verification_factor"}
    pure |= {"sobol_first_interval", "sobol_total_interval", "leave_one_out", "censored", "censored_bound"}
    pure |= {"integration_error_factor"}
    for label in METHODS:
        for name, units in UNITS.items():
            found = output(tree[label], name)
            assert "output" not in found.dims and len(found.data_vars) >= 5
            for key, one in found.data_vars.items():
                said = one.attrs.get("units", "")
                if key in pure:
                    assert said == "1", (label, key)
                elif key == "variance":
                    assert said == {"m": "m^2", "rad": "rad^2", "rad/s": "(rad/s)^2", "": ""}[units]
                else:
                    assert said == units, (label, key)
                assert one.attrs["long_name"].startswith(f"{name}: ")
            # several outputs, several units: none is said of all together
            assert "units" not in tree[label]["statistics/mean"].attrs
    assert tree["sampling/samples"].uqmbd.output("x")["response"].attrs["units"] == "m"
    assert {one.attrs["units"] for one in (tree["comparison"][x] for x in ("ks", "compared_until"))} == {"1", "s"}


@pytest.mark.thorough
def test_simulate_and_all_methods_have_one_layout(tree, motion):
    """Names, their order, dimensions, coordinates, types and units of outputs are those of a simulation."""
    for label in METHODS:
        found = by_output(tree[label])
        assert list(found) == list(motion)
        for name, one in found.items():
            assert (one.dims, one.shape, one.dtype) == (motion[name].dims, motion[name].shape, motion[name].dtype)
            assert one.attrs.get("units", "") == motion[name].attrs.get("units", "") == UNITS[name]
        assert found["time"].identical(motion["time"]) and found["time"].attrs == {"units": "s", "long_name": "time"}
        statistics = tree[label]["statistics"]
        for key in ("output", "output_units"):
            assert statistics[key].variable.identical(motion[key].variable), key
        others = tree["collocation/statistics"]
        for key in set(statistics.variables) & set(others.variables):
            assert (statistics[key].dims, statistics[key].dtype.kind) == (others[key].dims, others[key].dtype.kind)
            assert list(statistics[key].coords) == list(others[key].coords) or "input" in statistics.coords
    assert motion["integration_error"].dims == tree["sampling/statistics/integration_error"].dims


@pytest.mark.thorough
def test_an_output_of_all_methods_has_them_side_by_side(tree):
    found = tree.uqmbd.output("x")
    assert found["propagator"].values.tolist() == list(METHODS) and found["mean"].dims == ("propagator", "time")
    for label in METHODS:
        np.testing.assert_array_equal(
            found["mean"].sel(propagator=label), tree[label]["statistics/mean"].sel(output="x")
        )
    share = tree.uqmbd.output("x", input="rate0")["sobol_total"]
    assert share.dims == ("propagator", "time") and np.isnan(share.sel(propagator="sampling")).all()
    # what some of them have not is not known of those
    error = found["std_error_mean"]
    assert np.isnan(error.sel(propagator="galerkin")).all() and np.isfinite(error.sel(propagator="sampling")).all()


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["nc", "zarr 2", "zarr 3"])
def test_files_give_back_the_same_without_a_warning(tree, motion, tmp_path, kind):
    """By uqmbd, and by xarray alone; in memory text has fixed width, and no variable is of objects."""
    suffix, _, form = kind.partition(" ")
    # a part of it: every array is a file
    some = ("elements/statistics", "elements/chaos", "sampling/samples", "comparison")
    tree = xr.DataTree.from_dict({path: tree[path].to_dataset(inherit=False) for path in some})
    assert {one.dtype.kind for node in tree.subtree for one in node.variables.values()} <= set("bfiuU")
    assert load(save(tree, tmp_path / "ours.nc")).identical(tree)
    for name, data in {"tree": tree, "motion": xr.DataTree(motion)}.items():
        path = tmp_path / f"{name}.{suffix}"
        if suffix == "nc":
            data.to_netcdf(path, engine="h5netcdf")
        else:
            # of consolidated metadata in format 3 zarr warns, whatever the data
            data.to_zarr(path, zarr_format=int(form), consolidated=form == "2")
        about = {"engine": "h5netcdf"} if suffix == "nc" else {"engine": "zarr", "consolidated": form == "2"}
        with xr.open_datatree(path, decode_timedelta=False, **about) as opened:
            for one in data.subtree:
                for key, value in one.to_dataset(inherit=False).variables.items():
                    found = opened[one.path][key]
                    assert found.attrs.get("units") == value.attrs.get("units")
                    assert (found.dtype.kind == "f") == (value.dtype.kind == "f")
                    np.testing.assert_array_equal(found.values.astype(value.dtype), value.values)
            if form == "3" and name == "tree":
                kinds = json.loads((path / "elements" / "statistics" / "output" / "zarr.json").read_bytes())
                assert kinds["data_type"] == "string"


@pytest.mark.thorough
def test_pint_reads_the_units_of_a_motion_and_of_an_output(tree, motion):
    pytest.importorskip("pint_xarray", exc_type=ImportError)
    known = {name: units for name, units in UNITS.items() if units}
    for data in (motion, by_output(tree["galerkin"], "std")):
        found = data.pint.quantify()
        assert {name: found[name].pint.units for name in known} == {
            name: found[name].pint.registry.parse_units(units) for name, units in known.items()
        }
    square = output(tree["collocation"], "rate").pint.quantify()["variance"]
    assert square.pint.to("deg**2/s**2").pint.units == square.pint.registry.parse_units("deg**2/s**2")


@pytest.mark.thorough
def test_units_of_what_is_derived_are_those_that_pint_finds(tree):
    """The recipe of docs/how-to/data.md; without it a product has the units of its factor, or none."""
    pytest.importorskip("pint_xarray", exc_type=ImportError)
    plain = output(tree["collocation"], "rate")["std"]
    assert plain.attrs["units"] == "rad/s" and (plain * plain).attrs.get("units") in (None, "rad/s")
    std = plain.pint.quantify()
    variance = (std * std).pint.dequantify(format="~C")
    assert variance.attrs["units"] == "rad**2/s**2"
    np.testing.assert_array_equal(variance.values, plain.values**2)


def two(units=("m", "N")):
    """Statistics and samples of two outputs and two inputs, at two times."""
    axes = labels([("x", units[0]), ("F", units[1])], [("k", "N/m"), ("c", "1")], [0.0, 0.5])
    numbers = np.arange(4.0).reshape(2, 2)
    drawn = np.arange(12.0).reshape(3, 2, 2)
    statistics = statistics_dataset(axes, mean=numbers, std=numbers + 1, sobol_first=np.ones((2, 2, 2)))
    return statistics, sample_dataset(drawn, np.ones((3, 2)), axes)


def test_outputs_that_share_a_unit_have_it_in_common():
    statistics, samples = two(("m", "m"))
    assert statistics["mean"].attrs["units"] == samples["response"].attrs["units"] == "m"
    assert (
        "units" not in samples["inputs"].attrs
        and samples.isel(input=1).uqmbd.output("x")["inputs"].attrs["units"] == "1"
    )
    statistics, _ = two()
    assert "units" not in statistics["mean"].attrs


def test_a_plot_labels_itself():
    import matplotlib.pyplot as plt

    statistics, samples = two()
    statistics.uqmbd.output("x")["mean"].plot()
    axes = plt.gca()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "x: mean [m]")
    plt.close()
    drawn = samples["response"].uqmbd.output("F")
    assert drawn.name == "F" and drawn.attrs["long_name"] == "F" and drawn.dims == ("sample", "time")
    drawn.isel(sample=0).plot()
    assert plt.gca().get_ylabel() == "F [N]"
    plt.close()


def test_names_that_are_wrong_are_reported_with_the_nearest():
    statistics, _ = two()
    for wrong, words in {("X",): "no output 'X'", ("x", "K"): "no input 'K'"}.items():
        with pytest.raises(uqmbd.StudyError, match=f"There is {words}; there are: '(x', 'F|k', 'c)'"):
            output(statistics, wrong[0], input=wrong[1] if len(wrong) > 1 else None)
    with pytest.raises(uqmbd.StudyError, match="did you mean 'force'"):
        output(statistics.assign_coords(output=["x", "force"]), "forse")
    with pytest.raises(uqmbd.StudyError, match="no variable 'means' with the dimension 'output'"):
        by_output(statistics, "means")
    with pytest.raises(uqmbd.StudyError, match="expected an xarray.DataTree or an xarray.DataArray"):
        statistics.uqmbd.surrogate()
    with pytest.raises(uqmbd.StudyError, match=r"A DataArray contains no surrogate; expected .* tree\['LABEL'\]"):
        surrogate(statistics["mean"])


def test_outputs_that_are_called_like_dimensions():
    axes = labels([("input", "m"), ("probability", "N"), ("output", "K")], [("mean", "1")], [0.0])
    statistics = statistics_dataset(axes, mean=[[1.0], [2.0], [3.0]], std=[[1.0], [1.0], [1.0]])
    found = by_output(statistics, "quantile")
    assert list(found) == ["input", "probability", "output"] and found["probability"].dims == ("probability_", "time")
    assert by_output(statistics)["output"].item() == 3.0 and by_output(statistics)["output"].attrs["units"] == "K"
    assert output(statistics, "output")["mean"].item() == 3.0


def test_the_accessor_is_there_with_results_alone():
    """And a plain import of uqmbd stays without xarray."""
    code = """
import sys, uqmbd
early = "xarray" in sys.modules
import uqmbd.results, xarray
print(early, *[hasattr(kind, "uqmbd") for kind in (xarray.DataTree, xarray.Dataset, xarray.DataArray)])
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stdout.split() == ["False", "True", "True", "True"], run.stderr
