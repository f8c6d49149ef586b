"""What tasks say that need a package which is not installed, before anything is computed."""

from __future__ import annotations

import sys

import pytest

import uqmbd
from uqmbd.results import SampleStore
from uqmbd_collocation import Collocation
from uqmbd_reliability import Reliability

CASES = {
    "sklearn": {
        "Collocation(method='omp') needs scikit-learn": lambda folder: Collocation(method="omp", order=2),
        "Collocation(method='lars') needs scikit-learn": lambda folder: Collocation(method="lars", order=2),
        "Reliability(surrogate=...) needs scikit-learn": lambda folder: Reliability(surrogate=Collocation(order=2)),
    },
    "dask": {"uqmbd.results.open (unlike uqmbd.results.load) needs Dask": lambda folder: uqmbd.results.open(folder)},
    "zarr": {
        "the store of many samples needs zarr": lambda folder: SampleStore.create(folder / "a.zarr", 4, 2, AXES),
        "a Zarr folder, needs zarr": lambda folder: uqmbd.results.load(_zarr(folder)),
    },
}
AXES = uqmbd.extend.labels([("x", "m")], [("a", "m")], [0.0, 1.0])


def _zarr(folder):
    """Write a result as a Zarr folder, as others might, without its package."""
    path = folder / "b.zarr"
    path.mkdir()
    (path / ".zgroup").write_text('{"zarr_format": 2}')
    return path


@pytest.mark.parametrize(("package", "said"), [(package, said) for package, cases in CASES.items() for said in cases])
def test_a_package_that_is_missing_is_named_with_its_extra(package, said, tmp_path, monkeypatch):
    for name in [package, *(name for name in sys.modules if name.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(uqmbd.StudyError) as caught:
        CASES[package][said](tmp_path)
    assert said in str(caught.value) and 'pip install "uqmbd[' in str(caught.value)
