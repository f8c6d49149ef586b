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


POSTPONED = """
import sys, threading
from uqmbd.garbage_collection import loading

with loading():
    import chaospy, xarray
    import scipy.stats, scipy.optimize
print(*[name for name in ("pandas", "scipy.stats._stats_py", "scipy.optimize._minimize") if name in sys.modules])
"""


def test_chaospy_is_imported_without_what_it_does_not_use():
    """chaospy imports statistics and optimisation of SciPy for five names; distributions do not need them."""
    used = """
print(chaospy.Normal(1, 2).inv(0.5), chaospy.LogNormal(0, 1).mom(1).round(6), chaospy.E(chaospy.Uniform(0, 2)))
print("scipy.stats._stats_py" in sys.modules)
"""
    lines = output(POSTPONED + used)
    assert (lines[0], lines[-1]) == ("", "False")


@pytest.mark.thorough
def test_postponed_names_of_chaospy_have_their_values():
    """Functions of chaospy that use postponed names return the values of a process without postponed imports."""
    used = """
import numpy
from scipy.stats import norm

truncated = chaospy.TruncNormal(-1, 2, 0.3, 0.8)
print(truncated.cdf([-0.5, 0.3, 1.0]), truncated.inv([0.1, 0.9]), truncated.pdf([0.0]))
adopted = chaospy.ScipyStatsDist(norm(1, 2))
print(adopted.cdf([0.0, 1.0]), adopted.pdf([0.5]))
try:
    chaospy.ScipyStatsDist(3)
except AssertionError as error:
    print(error)
q0, q1 = chaospy.variable(2)
print(chaospy.Spearman(chaospy.polynomial([q0, q0 + q1]), chaospy.J(chaospy.Normal(), chaospy.Normal()), sample=50, seed=1))
print(chaospy.quadrature.leja(2, chaospy.Uniform(-1, 1)))
print(chaospy.quadrature.newton_cotes(3, chaospy.Uniform(0, 1)))
"""
    alone = POSTPONED.replace("with loading():\n    import", "if True:\n    import")
    assert output(POSTPONED + used)[1:] == output(alone + used)[1:]


@pytest.mark.thorough
def test_threads_wait_for_a_postponed_module():
    """All threads that use a postponed module for the first time get the complete module."""
    used = """
sys.setswitchinterval(1e-5)
found, start = [], threading.Barrier(8)


def use():
    start.wait()
    found.append((xarray.DataTree.__name__, scipy.stats.norm.cdf(0.0)))


threads = [threading.Thread(target=use) for _ in range(8)]
[one.start() for one in threads], [one.join(60) for one in threads]
print(len(found), len(set(found)))
"""
    assert output(POSTPONED + used)[1:] == ["8 1"]


@pytest.mark.thorough
def test_results_have_their_accessor_with_postponed_imports():
    used = """
import uqmbd.results

print(hasattr(xarray.Dataset, "uqmbd"), hasattr(xarray.DataTree, "uqmbd"))
"""
    assert output(POSTPONED + used)[1:] == ["True True"]


@pytest.mark.thorough
@pytest.mark.parametrize("module", ["_qmc", "mstats", "_continuous_distns", "_sensitivity_analysis"])
def test_a_thread_that_imports_a_module_of_a_postponed_package_does_not_block(module):
    """One thread executes a package while another one imports a module below it."""
    used = f"""
import time

first = threading.Thread(target=lambda: scipy.stats.norm.cdf(0.0), daemon=True)
second = threading.Thread(target=lambda: __import__("scipy.stats.{module}"), daemon=True)
first.start(), time.sleep(0.01), second.start(), first.join(60), second.join(60)
print(first.is_alive(), second.is_alive(), scipy.stats.qmc.Sobol.__name__)
"""
    assert output(POSTPONED + used)[1:] == ["False False Sobol"]


@pytest.mark.thorough
def test_functions_that_name_postponed_modules_are_sent_and_have_one_fingerprint(tmp_path):
    (tmp_path / "commanding.py").write_text(
        "import scipy.stats as stats\nimport xarray as xr\n\n\ndef command(t):\n    return stats.norm.cdf(t), xr\n"
    )
    used = f"""
import pickle

sys.path.insert(0, {str(tmp_path)!r})
import commanding
from uqmbd.dynamics.control.shipped import Shipped

shipped = Shipped(commanding.command, "controller")
first, packed = shipped.digest(), pickle.dumps(shipped)
print(pickle.loads(packed).function(0.0)[0], shipped.digest() == first, len(first) > 0)
print(first)
"""
    alone = POSTPONED.replace("with loading():\n    import", "if True:\n    import")
    found = output(POSTPONED + used)[1:]
    assert found[0] == "0.5 True True" and found == output(alone + used)[1:]
