"""Many samples: streamed statistics are those of the stored samples, and all samples are in a store."""

from __future__ import annotations

from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo


@pytest.fixture(scope="module")
def study() -> uqmbd.Study:
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 0.5, 11))


@pytest.mark.thorough
@pytest.mark.parametrize("sampling", ["random", "latin-hypercube"])
def test_streamed_statistics_are_those_of_all_samples(study: uqmbd.Study, tmp_path: Path, sampling: str) -> None:
    options = {"samples": 200, "seed": 3, "sampling": sampling, "replicates": 8}
    stored = study.propagate(MonteCarlo(**options))
    few = study.with_propagators([MonteCarlo(**options, keep=70)]).run(folder=tmp_path)["monte-carlo"]
    assert few["samples"].sizes["sample"] == 70
    np.testing.assert_array_equal(few["samples"]["response"], stored["samples"]["response"][:70])
    for name in ("mean", "std", "skewness", "kurtosis", "std_error_mean", "std_error_std"):
        expected = stored["statistics"][name]
        np.testing.assert_allclose(few["statistics"][name], expected, rtol=1e-7, atol=1e-12, err_msg=name)
    everything = xr.load_dataset(tmp_path / few.attrs["all_samples"], engine="zarr")
    np.testing.assert_array_equal(everything["response"], stored["samples"]["response"])
    np.testing.assert_array_equal(everything["inputs"], stored["samples"]["inputs"])
    assert list(everything["output"].values.astype(str)) == ["angle"]
    assert everything["time"].attrs["units"] == "s"
