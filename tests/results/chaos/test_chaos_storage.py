"""A stored chaos is the same chaos: read back, evaluated and sampled without the mechanism and without chaospy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr

from uqmbd import RandomVariable, extend, results
from uqmbd.errors import StudyError
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.randomness.variable import random_vector
from uqmbd.results import PolynomialChaos

DEPENDENT = [[4.0, 1.0], [1.0, 9.0]]


@pytest.fixture(scope="module", params=["independent", "dependent"])
def chaos(request: pytest.FixtureRequest) -> PolynomialChaos:
    """Return a chaos of families of all kinds, with verification data."""
    if request.param == "dependent":
        variables = [*random_vector(["a", "b"], chaospy.MvNormal([1.0, 2.0], DEPENDENT), ["m", "N"])]
    else:
        variables = [
            RandomVariable("a", chaospy.Trunc(chaospy.Normal(1.0, 2.0), lower=0.0), units="m"),
            RandomVariable("b", chaospy.LogNormal(0.0, 0.2)),
            RandomVariable("c", chaospy.Beta(2.0, 3.0)),
        ]
    inputs = JointInput.of([*variables, RandomVariable("last", chaospy.Uniform(-1.0, 3.0))])
    space = GermSpace.of(inputs)
    index = index_set(len(inputs), 3)
    rng = np.random.default_rng(1)
    values = rng.normal(size=(len(index), 2, 5))
    axes = extend.labels(
        [("$F_{pin}$ & <b>", "N"), ("länge", "")],
        list(zip(inputs.names, inputs.units, inputs.descriptions, strict=True)),
        np.linspace(0.0, 2.0, 5),
    )
    germs = space.from_uniform(rng.uniform(size=(8, len(inputs))))
    return PolynomialChaos(
        values, index, space, axes, verification_germs=germs, verification_response=rng.normal(size=(8, 2, 5))
    )


SCRIPT = """
import sys
import numpy as np
from uqmbd import extend, results
tree = results.load(sys.argv[1])
chaos = results.PolynomialChaos.from_dataset(tree["pce/chaos"])
inputs, response = chaos.sample(100, seed=5)
np.savez(sys.argv[2], inputs=inputs, response=response, again=chaos.evaluate(inputs), kurtosis=chaos.kurtosis,
         total=chaos.sobol_total_germ, quantiles=chaos.quantiles([0.1, 0.9], samples=256), words=chaos.verdicts())
foreign = {"chaospy", "numpoly", "uqmbd.mechanism", "uqmbd.dynamics", "sksundae", "symengine"} & set(sys.modules)
assert not foreign, foreign
"""


@pytest.mark.thorough
def test_round_trip(chaos: PolynomialChaos, tmp_path: Path) -> None:
    """All data and names come back exactly; another process gets the same without mechanism and chaospy."""
    node = results.propagator_node(
        "pce",
        chaos.statistics(samples=64),
        propagator="collocation",
        realisations=64,
        wall_time=1.0,
        children={"chaos": chaos.to_dataset()},
    )
    tree = results.study_tree([node], study="s", mechanism="m")
    results.validate(tree)
    path = results.save(tree, tmp_path / "results.nc")
    loaded = results.load(path)
    results.validate(loaded)
    assert loaded.identical(tree)
    back = PolynomialChaos.from_dataset(loaded["pce/chaos"])
    for attribute in ("coefficients", "multi_index", "verification_germs", "verification_response"):
        np.testing.assert_array_equal(getattr(back, attribute), getattr(chaos, attribute))
    assert back.labels.outputs == chaos.labels.outputs and back.labels.inputs == chaos.labels.inputs
    np.testing.assert_array_equal(back.labels.times, chaos.labels.times)
    assert back.germ_names == chaos.germ_names
    assert back.to_dataset().identical(chaos.to_dataset())
    assert back.horizon() == chaos.horizon()
    stored = loaded["pce/chaos/verification_error"]
    assert stored.dims == ("output", "time")
    np.testing.assert_array_equal(stored, chaos.verification_error())

    if chaos.space.independent:
        in_another_process(chaos, path, tmp_path / "found.npz")


def in_another_process(chaos: PolynomialChaos, path: Path, target: Path) -> None:
    """Check that a process without mechanism and chaospy finds the same from what is stored."""
    subprocess.run([sys.executable, "-c", SCRIPT, str(path), str(target)], check=True)
    found = np.load(target)
    inputs, response = chaos.sample(100, seed=5)
    np.testing.assert_array_equal(found["inputs"], inputs)
    np.testing.assert_array_equal(found["response"], response)
    np.testing.assert_allclose(found["again"], response, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(found["kurtosis"], chaos.kurtosis)
    np.testing.assert_array_equal(found["total"], chaos.sobol_total_germ)
    np.testing.assert_array_equal(found["quantiles"], chaos.quantiles([0.1, 0.9], samples=256))
    assert found["words"].tolist() == list(chaos.verdicts())


def test_schema_and_units(chaos: PolynomialChaos) -> None:
    """Names, dimensions and units are those of the design."""
    dataset = chaos.to_dataset()
    assert dataset["coefficients"].dims == ("term", "output", "time")
    assert dataset["multi_index"].dims == ("term", "input")
    assert dataset["output_units"].values.tolist() == ["N", ""]
    assert dataset["input_units"].values[0] == "m" and dataset["time"].attrs["units"] == "s"
    dependent = not chaos.space.independent
    assert ("inputs are dependent" in dataset["multi_index"].attrs["comment"]) == dependent


def test_other_datasets_are_refused(chaos: PolynomialChaos) -> None:
    """The message says what is missing."""
    dataset = chaos.to_dataset()
    for name, kind in (("coefficients", "variable"), ("multi_index", "variable"), ("input_units", "coordinate")):
        with pytest.raises(StudyError, match=f"needs the {kind} '{name}'"):
            PolynomialChaos.from_dataset(dataset.drop_vars(name))
    with pytest.raises(StudyError, match="no germ space"):
        PolynomialChaos.from_dataset(dataset.drop_vars("germ_alpha"))
    assert isinstance(PolynomialChaos.from_dataset(xr.DataTree(dataset)), PolynomialChaos)
