"""More samples than are kept: what is said is said of all of them, with its error where it is not exact."""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import load, save, validate
from uqmbd.results.statistics import quantiles
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.all_samples import Passing

from .conftest import Quadrature, resting


@pytest.fixture(autouse=True)
def few_first_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quantiles, "FIRST_SAMPLES", 60)


@pytest.fixture(scope="module")
def study() -> uqmbd.Study:
    """A pendulum whose angle is one, and a number that is not real for one sample in twenty."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.05), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(-2.0, 2.0))
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    motion = {"position": (length / 2, 0), "velocity": (0, speed * length / 2), "angular_velocity": speed}
    rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, **motion)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad", angle=True)
    mechanism.output("x", rod.position[0], units="m")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 0.5, 4))


def holds(few: xr.Dataset, whole: xr.Dataset) -> None:
    """Every statistic of all samples, as those have it that are all kept."""
    assert set(whole.data_vars) <= set(few.data_vars)
    intervals = (one["quantile_interval"].transpose("bound", ...) for one in (few, whole))
    (low, high), (lower, upper) = (one.values for one in intervals)
    if "unknown" in few["quantile_interval"].attrs:
        # those of a design follow from its replicates: all samples must be stored
        assert np.isnan(low).all() and np.isnan(high).all()
    elif "quantile_error" in few.data_vars:
        assert (low <= lower).all() and (upper <= high).all()
    else:
        np.testing.assert_array_equal((low, high), (lower, upper))
    # the realisations that are integrated again are chosen among the stored samples
    again = {"integration_error", "integration_error_rms", "integration_error_factor"}
    for name in again & set(whole.data_vars):
        np.testing.assert_allclose(few[name], whole[name], rtol=0.5, atol=1e-12, err_msg=str(name))
    for name in set(whole.data_vars) - {"quantile", "quantile_interval"} - again:
        np.testing.assert_allclose(few[name], whole[name], rtol=1e-7, atol=1e-12, err_msg=str(name))
    if "quantile_error" in few.data_vars:
        assert np.all(np.abs(few["quantile"] - whole["quantile"]) <= few["quantile_error"])
        assert np.all(few["quantile_error"] <= 0.02 * whole["std"].max("time"))
    else:
        np.testing.assert_array_equal(few["quantile"], whole["quantile"])
    for name in ("smallest", "largest"):
        np.testing.assert_array_equal(few[name], whole[name])


@pytest.mark.thorough
@pytest.mark.parametrize("folder", [True, False])
@pytest.mark.parametrize("sampling", ["random", "latin-hypercube", "sobol"])
def test_statistics_are_those_of_all_samples(study: uqmbd.Study, tmp_path: Path, sampling: str, folder: bool) -> None:
    """In a folder and without one; angles, and replicates of designs."""
    options = {"samples": 512, "seed": 3, "sampling": sampling, "replicates": 8}
    whole = study.propagate(MonteCarlo(**options))["statistics"].to_dataset()
    method = study.with_propagators([MonteCarlo(**options, keep=70)])
    tree = method.run(folder=tmp_path) if folder else method.run()
    validate(tree)
    few = tree["monte-carlo/statistics"].to_dataset()
    assert ("unknown" in few["quantile_interval"].attrs) == (sampling != "random")
    assert {"circular_mean", "circular_std"} <= set(few.data_vars)
    assert ("quantile_error" in few) != folder
    holds(few, whole)
    with ThreadPoolExecutor(2) as threads:
        (tmp_path / "threads").mkdir()
        again = method.run(threads, folder=tmp_path / "threads" if folder else None)
        xr.testing.assert_identical(few, again["monte-carlo/statistics"].to_dataset())
    save(tree, tmp_path / "again.nc")
    validate(load(tmp_path / "again.nc"))


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*realisations failed:UserWarning")
@pytest.mark.filterwarnings("ignore:.*indices failed:UserWarning")
@pytest.mark.parametrize("folder", [True, False])
def test_sobol_indices_failures_and_a_control(tmp_path: Path, folder: bool) -> None:
    a, b = (uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)) for name in "ab")
    study = resting({"y": sympy.sqrt(sympy.Rational(95, 100) - a) + b})
    options = {"samples": 400, "seed": 1, "sobol_indices": True}
    whole = study.propagate(MonteCarlo(**options))
    method = study.with_propagators([MonteCarlo(**options, keep=90)])
    few = (method.run(folder=tmp_path) if folder else method.run())["monte-carlo"]
    holds(few["statistics"].to_dataset(), whole["statistics"].to_dataset())
    for name in ("failures", "realisations", "sobol_rows", "sobol_rows_dropped"):
        assert few.attrs[name] == whole.attrs[name]


@pytest.mark.thorough
def test_a_control_beyond_keep(curved: uqmbd.Study) -> None:
    options = {"samples": 400, "seed": 1, "control": Quadrature(order=3, nodes=5)}
    whole = curved.propagate(MonteCarlo(**options))["statistics"].to_dataset()
    few = curved.propagate(MonteCarlo(**options, keep=90))["statistics"].to_dataset()
    holds(few, whole)


@pytest.mark.thorough
def test_the_report_says_of_which_samples(curved: uqmbd.Study, tmp_path: Path) -> None:
    tree = curved.with_propagators([MonteCarlo(samples=200, seed=1, keep=100)]).run()
    text = " ".join(write_report(tree, tmp_path / "report.html").read_text().split())
    assert "Statistics of monte-carlo use all 200 samples. Histograms and densities use the first 100" in text
    assert "Quantiles are computed from counts between edges; their error is at most" in text


@pytest.mark.thorough
def test_realisations_for_indices_are_not_samples_of_the_statistics(curved: uqmbd.Study, tmp_path: Path) -> None:
    tree = curved.with_propagators([MonteCarlo(samples=40, seed=1, sobol_indices=True)]).run()
    assert tree["monte-carlo"].attrs["realisations"] > 40 == tree["monte-carlo"].attrs["sample_size"]
    text = " ".join(write_report(tree, tmp_path / "report.html").read_text().split())
    assert "160 samples instead of 40 would halve" in text and "Statistics of monte-carlo use all" not in text


def test_a_full_disk_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full:
        def seek(self, place: int) -> None:
            pass

        def write(self, content: bytes) -> None:
            raise OSError(28, "No space left on device")

        def close(self) -> None:
            pass

    monkeypatch.setattr(tempfile, "TemporaryFile", Full)
    passing = Passing(uqmbd.extend.labels(["x"], ["k"], [0.0]), again=True)
    with pytest.raises(uqmbd.StudyError, match="No space left on device.*Run the study in a run folder, or set TMPDIR"):
        passing.add(0, np.ones((2, 1, 1)), np.ones(2, dtype=bool))
