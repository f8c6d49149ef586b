"""Results of every method and feature are saved, loaded, opened and compared as they are: to the bit, with attributes.

A method that the built-in packages register without a row in the table fails a test.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import chaospy
import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd import plugins
from uqmbd.results import compare, failed_methods, load, propagator_nodes, save, validate
from uqmbd_calibration import Calibrated, Calibration, Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import LowFidelity, MonteCarlo
from uqmbd_reliability import Reliability
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 1, 11)
BUILT_IN = {path.name for path in Path(uqmbd.__file__).parents[1].joinpath("plugins").glob("uqmbd_*")}


def same(tree: xr.DataTree, found: xr.DataTree, *, order: bool = True) -> None:
    """Compare all that two trees hold, numbers by their bits."""
    paths = [[node.path for node in one.subtree] for one in (tree, found)]
    assert paths[0] == paths[1] if order else sorted(paths[0]) == sorted(paths[1])
    for node in tree.subtree:
        one, other = node.to_dataset(inherit=False), found[node.path].to_dataset(inherit=False)
        xr.testing.assert_identical(one, other)
        assert {key: type(value) for key, value in one.attrs.items()} == {
            key: type(value) for key, value in other.attrs.items()
        }
        for name, variable in one.variables.items():
            again = other.variables[name]
            assert again.dtype.kind == variable.dtype.kind
            if variable.dtype.kind != "U":
                assert again.dtype == variable.dtype and again.values.tobytes() == variable.values.tobytes(), name


def check(tree: xr.DataTree, folder: Path) -> None:
    path = save(tree, folder / "results.nc")
    found = load(path)
    assert found.encoding["digest"] == "verified"
    same(tree, found)
    with h5py.File(path) as file:
        plain: list[str] = []

        def note(name: str, one: h5py.Group | h5py.Dataset) -> None:
            if isinstance(one, h5py.Dataset) and one.size and one.shape and not one.fletcher32:
                if b"netCDF dimension but not" not in bytes(np.bytes_(one.attrs.get("NAME", b""))):
                    plain.append(name)

        file.visititems(note)
    assert plain == []
    pytest.importorskip("dask")
    with uqmbd.results.open(path) as opened:
        assert opened.encoding["digest"] == "verified"
        if not any("all_samples" in node.attrs for node in tree.subtree):
            same(tree, opened.load())
    tree.to_netcdf(folder / "xarray.nc", engine="h5netcdf")
    other = load(folder / "xarray.nc")
    assert other.encoding["digest"] == "not verified"
    assert [node.path for node in other.subtree] == [node.path for node in tree.subtree]


def stone(*, required: bool) -> uqmbd.Study:
    """A stone with a summary, an event that some realisations do not reach, an angle, and a value without a time."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    push = uqmbd.RandomVariable("push", chaospy.Uniform(0, 0.2), units="m")
    body = mechanism.body("stone", mass=1, position=push, velocity=speed)
    way = body.position[0]
    mechanism.output("way", way, units="m")
    mechanism.output("turn", 7 * way, units="rad", angle=True)
    mechanism.output("most", uqmbd.maximum(way), units="m")
    mechanism.output("passed", uqmbd.first_time(way >= 1.1), units="s")
    if required:
        mechanism.require("short", way <= 1.3)
        mechanism.require("slow", uqmbd.maximum(way) <= 1.2)
    return uqmbd.Study("stone", mechanism, TIMES)


def spring(*, required: bool) -> uqmbd.Study:
    """A mass on a spring, whose phase depends on both inputs, with its frequency."""
    mechanism = uqmbd.Mechanism("spring", uqmbd.Line())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(90, 110), units="N/m")
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.09, 0.11), units="m")
    mass = mechanism.body("mass", mass=1, position=start)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    if required:
        mechanism.require("near", mass.position[0] <= 0.105)
    return uqmbd.Study("spring", mechanism, np.linspace(0, 4, 81))


def ball(*, required: bool) -> uqmbd.Study:
    """A ball that bounces, with the time of its second impact, which some realisations do not reach."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.75, 0.85), units="1")
    body = mechanism.body("ball", mass=1, position=(0, height), velocity=(0, 0))
    floor = PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), restitution=restitution)
    mechanism.add(floor)
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("second", floor.event_time("impact", 2), units="s")
    if required:
        mechanism.require("low", body.position[1] <= 1.05)
    return uqmbd.Study("ball", mechanism, np.linspace(0, 1.2, 61))


MECHANISMS: Mapping[str, Callable[..., uqmbd.Study]] = {"stone": stone, "spring": spring, "ball": ball}

ROWS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "monte-carlo": {
        "random": {"samples": 40, "seed": 1},
        "sobol": {"samples": 32, "sampling": "sobol"},
        "latin-hypercube": {"samples": 32, "sampling": "latin-hypercube"},
        "sensitivity": {"samples": 64, "sobol_indices": True},
        "samples apart": {"samples": 60, "keep": 20, "seed": 2},
        "sensitivity, samples apart": {"samples": 64, "keep": 20, "sobol_indices": True},
        "control": {"samples": 60, "control": Collocation(order=2, verify=2)},
        "low-fidelity": {"samples": 60, "control": LowFidelity},
    },
    "collocation": {
        "projection": {"order": 3, "verify": 4},
        "not verified": {"order": 2, "verify": 0},
        "regression": {"order": 2, "method": "regression", "verify": 4},
        "omp": {"order": 3, "method": "omp", "samples": 30, "verify": 4},
        "lars": {"order": 3, "method": "lars", "samples": 30, "verify": 4},
        "smolyak": {"order": 3, "rule": "smolyak", "level": 3, "verify": 4},
        "tensor": {"order": 2, "index_set": "tensor", "verify": 4},
        "adaptive": {"adaptive": "order", "max_realisations": 200, "verify": 4},
        "adaptive dimensions": {"adaptive": "dimension", "max_realisations": 200, "verify": 4},
        "elements": {"order": 2, "elements": 2, "verify": 4},
        "adaptive elements": {"order": 2, "elements": "adaptive", "max_elements": 4, "verify": 4},
        "events": {"order": 2, "alignment": "events", "verify": 4},
        "phase": {"order": 2, "alignment": "phase", "verify": 4},
        "two-frequency": {"order": 2, "alignment": "two-frequency", "verify": 4},
        "auto": {"order": 2, "alignment": "auto", "verify": 4},
        "composed": {"order": 2, "alignment": ("events", "phase"), "verify": 4},
        "aligned elements": {"order": 2, "alignment": "phase", "elements": 2, "verify": 4},
        "nataf": {"order": 2, "transform": "nataf", "verify": 4},
    },
    "galerkin": {
        "projected": {"order": 2, "verify": 4},
        "explicit": {"order": 2, "integrator": "dop853", "verify": 4},
        "ida": {"order": 2, "integrator": "ida", "verify": 4},
        "samples": {"order": 2, "rule": "sobol", "samples": 64, "verify": 4},
        "elements": {"order": 2, "elements": 2, "verify": 4},
        "phase": {"order": 2, "alignment": "phase", "verify": 4},
    },
    "reliability": {
        "auto": {"max_realisations": 500, "target_cov": 0.2},
        "form": {"method": "form", "max_realisations": 500, "target_cov": 0.2},
        **(
            {"subset": {"method": "subset", "max_realisations": 500, "target_cov": 0.5}}
            if find_spec("openturns")
            else {}
        ),
        "surrogate": {"surrogate": Collocation(order=2, verify=2), "max_realisations": 3000, "target_cov": 0.2},
    },
}
"""Options of each method that is registered, by what they are called here."""


def test_every_method_has_a_row() -> None:
    """Also one that is added: its results are to be tested, too."""
    built_in = {name for name, kind in plugins.propagators().items() if kind.__module__.split(".")[0] in BUILT_IN}
    # it needs sampled paths, which the mechanisms here do not have: tests/processes/test_motion.py
    assert built_in - {"common-paths"} == set(ROWS)


def method(name: str, words: str, of: Callable[..., uqmbd.Study]) -> uqmbd.extend.Propagator:
    """Return a method of the table, whose low-fidelity model is the study itself without its requirements."""
    given = dict(ROWS[name][words])
    if given.get("control") is LowFidelity:
        given["control"] = LowFidelity(of(required=False), cost=0.1)
    made: uqmbd.extend.Propagator = plugins.propagator(name)(**given, label=f"by {words}")
    return made


@contextmanager
def silence() -> Iterator[None]:
    """What some methods cannot do, and how coarse they are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def check_comparison(tree: xr.DataTree, folder: Path) -> None:
    """What is read compares as what was computed, and the two do not differ."""
    found = load(folder / "results.nc")
    before, after = propagator_nodes(tree), propagator_nodes(found)
    assert list(before) == list(after)
    with silence():
        xr.testing.assert_identical(compare(before), compare(after))
        for label in before:
            both = compare({"before": before[label], "after": after[label]}, reference="before")
            for name in ("mean_difference_max", "std_difference_max", "quantile_difference_max"):
                if name in both:
                    assert not np.nan_to_num(both[name].sel({"method": "after"}).values).any(), (label, name)


def run_and_check(study: uqmbd.Study, folder: Path) -> xr.DataTree:
    folder.mkdir()
    with silence():
        tree = study.run(folder=folder)
    validate(tree)
    check(tree, folder)
    check_comparison(tree, folder)
    return tree


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_every_method_and_feature(tmp_path: Path, name: str) -> None:
    """A method that cannot do a study is in its results, too; each can do one of them."""
    could = dict.fromkeys(ROWS[name], 0)
    for (of, make), required in itertools.product(MECHANISMS.items(), (True, False)):
        methods = [method(name, words, make) for words in ROWS[name]]
        study = make(required=required).with_propagators([*methods, MonteCarlo(samples=20, seed=1, label="other")])
        failed = failed_methods(run_and_check(study, tmp_path / f"{of}-{required}"))
        for words in could:
            could[words] += f"by {words}" not in failed
    assert all(could.values()), could


@pytest.mark.thorough
def test_of_a_method_with_a_requirement(tmp_path: Path) -> None:
    """One of the table, on a mechanism that takes little to compute."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    body = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("way", body.position[0], units="m")
    mechanism.require("short", body.position[0] <= 1.3)
    methods = [MonteCarlo(samples=20, keep=5, seed=1), Collocation(order=2, verify=2)]
    assert not failed_methods(run_and_check(uqmbd.Study("stone", mechanism, TIMES, methods), tmp_path / "run"))


@pytest.mark.slow
def test_of_a_calibration_and_of_methods_with_its_posterior(tmp_path: Path) -> None:
    measured = np.random.default_rng(0).normal(0.1 + 1.05 * TIMES, 0.02)
    record = Record("run 1", [Series("way", TIMES, measured, "m", noise=0.02)])
    with silence():
        found = calibrate(stone(required=False), record, seed=1, draws=200)
    (tmp_path / "found.nc").unlink(missing_ok=True)
    same(found.tree, Calibration.load(found.save(tmp_path / "found.nc")).tree)
    methods = [
        Calibrated(Collocation(order=2, verify=4), found, label="after"),
        Calibrated(Reliability(max_realisations=500, target_cov=0.2), found, label="rare"),
        Collocation(order=2, verify=4, label="before"),
        MonteCarlo(samples=20, seed=1),
    ]
    assert not failed_methods(run_and_check(stone(required=True).with_propagators(methods), tmp_path / "run"))


@pytest.mark.slow
def test_results_that_xarray_stored_as_zarr(tmp_path: Path) -> None:
    study = stone(required=True).with_propagators([MonteCarlo(samples=20, seed=1), Collocation(order=2)])
    with silence():
        tree = study.run()
    for form in (2, 3):
        # of consolidated metadata in format 3 zarr warns
        tree.to_zarr(tmp_path / f"{form}.zarr", zarr_format=form, consolidated=False)
        same(tree, load(tmp_path / f"{form}.zarr"), order=False)
