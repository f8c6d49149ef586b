"""What a process of the command line loads, and what it does not."""

import subprocess
import sys

import pytest

CODE = """
import sys
from uqmbd.garbage_collection import loading

with loading():
    import numpy, xarray

data = xarray.Dataset({"x": ("t", [1.0, 2.0])}, coords={"t": [0.0, 1.0]})
data.isel(t=0).load(), data.copy(deep=True).mean("t"), data["x"].to_index, repr(data)
print(*[name for name in ("dask", "pint") if name in sys.modules])
"""


def output(code):
    run = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()


@pytest.mark.thorough
def test_arrays_of_packages_that_nobody_imports_cost_nothing():
    """Dask and pint are installed where the tests run; xarray alone imports both for the same lines."""
    pytest.importorskip("dask"), pytest.importorskip("pint")
    assert output(CODE) == [""]


@pytest.mark.thorough
def test_arrays_of_dask_and_pint_are_known_when_somebody_has_them():
    """They behave as in a process where xarray was left alone, though xarray saw arrays of NumPy before."""
    pytest.importorskip("dask"), pytest.importorskip("pint")
    late = """
import dask.array, pint
from xarray.namedarray.pycompat import array_type, is_chunked_array

lazy = xarray.DataArray(dask.array.ones((4,), chunks=2), dims="t")
print(is_chunked_array(lazy.variable._data), lazy.chunks, float(lazy.sum().compute()), type(lazy.data).__name__)
length = xarray.DataArray(pint.UnitRegistry().Quantity(numpy.array([1.0, 2.0]), "m"), dims="t")
print(isinstance(length.data, array_type("pint")), length.to_numpy().tolist(), data.chunk(t=1)["x"].chunks)
print(array_type("dask"), array_type("pint"))
"""
    alone = CODE.replace("with loading():\n    import", "if True:\n    import")
    assert output(CODE + late)[1:] == output(alone + late)[1:]
