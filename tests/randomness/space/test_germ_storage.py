"""Germ spaces on disk: read back without chaospy, to the bit, and honest about what was not stored."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.randomness import GermSpace, JointInput, index_set

INDEPENDENT = {
    "a": chaospy.Normal(1, 2), "b": chaospy.Uniform(2, 3), "c": chaospy.Beta(2, 3), "d": chaospy.Gamma(2, 3),
    "e": chaospy.LogNormal(0.1, 0.5), "f": chaospy.Triangle(0, 1, 4), "g": chaospy.DiscreteUniform(1, 6),
    "h": chaospy.StudentT(8),
}  # fmt: skip


def everything():
    variables = [uqmbd.RandomVariable(name, distribution) for name, distribution in INDEPENDENT.items()]
    variables += uqmbd.random_vector(["z", "y"], chaospy.MvNormal([1, 2], [[4, 3], [3, 9]]))
    variables += uqmbd.random_vector(
        ["w", "x"], chaospy.Nataf(chaospy.J(chaospy.Uniform(), chaospy.Weibull(2)), [[1, 0.5], [0.5, 1]])
    )
    return GermSpace.of(JointInput.of(variables))


def test_round_trip_to_the_bit(tmp_path):
    from uqmbd.results import load, save

    space = everything()
    tree = xr.DataTree.from_dict({"/chaos": space.to_dataset()})
    stored = load(save(tree, tmp_path / "space.nc"))["chaos"].to_dataset()
    again = GermSpace.from_dataset(stored)
    assert again.inputs == space.inputs and again.names == space.names
    assert [g.family for g in again.germs] == [g.family for g in space.germs]
    assert not again.independent and again.names[-1] == "z"
    uniform = np.random.default_rng(1).random((50, 12))
    germs = space.from_uniform(uniform)
    assert np.array_equal(again.from_uniform(uniform), germs)
    inputs = space.to_inputs(germs)
    assert np.array_equal(again.to_inputs(germs), inputs)
    assert np.array_equal(again.to_germs(inputs), space.to_germs(inputs))
    index = index_set(12, 2)
    assert np.array_equal(again.evaluate(germs, index), space.evaluate(germs, index))
    for one, other in zip(space.germs, again.germs, strict=True):
        assert np.array_equal(one.gauss(5)[0], other.gauss(5)[0]) and one.bounds == other.bounds
    xr.testing.assert_identical(again.to_dataset(), space.to_dataset())


def test_dimensions_are_declared():
    stored = everything().to_dataset()
    allowed = {"germ", "input"}
    assert all(str(dim) in allowed or str(dim).startswith("germ_") for dim in stored.dims)
    assert all(variable.dtype.kind in "fiU" for variable in stored.variables.values())
    assert stored["germ"].values.tolist() == list(everything().names)


@pytest.mark.thorough
def test_reading_needs_no_chaospy(tmp_path):
    path = tmp_path / "space.nc"
    space = everything()
    space.to_dataset().to_netcdf(path, engine="h5netcdf")
    code = f"""
        import sys
        sys.modules["chaospy"] = None
        import numpy as np, xarray as xr
        from uqmbd.randomness import GermSpace
        space = GermSpace.from_dataset(xr.open_dataset({str(path)!r}, engine="h5netcdf"))
        germs = space.from_uniform(np.full((3, 12), 0.3))
        print(repr(space.to_inputs(germs)[0].tolist()))
        assert np.allclose(space.to_germs(space.to_inputs(germs)), germs, atol=1e-9)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    expected = space.to_inputs(space.from_uniform(np.full((1, 12), 0.3)))[0]
    assert np.array_equal(eval(done.stdout), expected)


def test_a_general_rosenblatt_transform_of_an_earlier_version_is_not_stored():
    a = chaospy.Uniform(1, 2)
    joint = JointInput.of(uqmbd.random_vector(["a", "b"], chaospy.J(a, chaospy.Normal(a, 0.3))))
    space = GermSpace.of(joint)
    again = GermSpace.from_dataset(space.to_dataset().drop_vars("germ_joint"))
    assert again.names == ("a", "b | a") and not again.independent
    germs = np.array([[0.1, 0.5]])
    index = index_set(2, 3)
    assert np.array_equal(again.evaluate(germs, index), space.evaluate(germs, index))
    with pytest.raises(uqmbd.StudyError, match="does not contain the map to inputs .*Evaluate the chaos at germs"):
        again.to_inputs(germs)
    with pytest.raises(uqmbd.StudyError, match="does not contain the map to germs"):
        again.to_germs(germs)


def test_another_dataset():
    with pytest.raises(uqmbd.StudyError, match="no germ space, because germ, input, germ_family"):
        GermSpace.from_dataset(xr.Dataset())


@pytest.mark.thorough
def test_importing_is_light():
    """Random variables are imported by every script: neither chaospy nor xarray nor scipy.stats come with them."""
    code = "import sys, uqmbd.randomness; print([m for m in ('chaospy', 'xarray', 'scipy.stats', 'scipy.optimize') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
