"""Results as trees of ArviZ: its schema, its statistics against ours, and its own functions on what it is given."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from ..mechanisms import pendulum


@pytest.fixture(scope="module")
def tree():
    mechanism = pendulum(loaded=True)
    rod = mechanism.bodies["rod"]
    mechanism.output("lowest", uqmbd.minimum(rod.position[1]), units="m")
    methods = [MonteCarlo(samples=300, seed=2), Collocation(order=3)]
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 6), methods).run()


def test_samples_are_draws_of_one_chain(tree):
    """Whatever ArviZ would compute of them is what the samples say."""
    found, samples = uqmbd.to_arviz(tree["monte-carlo"]), tree["monte-carlo/samples"]
    assert list(found.children) == ["prior", "prior_predictive"] and found.attrs["left_out"] == 0
    assert found["prior/length"].dims == ("chain", "draw") and found["prior/length"].sizes == {"chain": 1, "draw": 300}
    assert found["prior_predictive/x"].dims == ("chain", "draw", "time")
    assert found["prior_predictive/lowest"].dims == ("chain", "draw")
    inputs = [found[f"prior/{name}"].values[0] for name in ("length", "mass")]
    assert np.array_equal(np.stack(inputs, axis=1), samples["inputs"].values)
    assert np.array_equal(found["prior_predictive/y"].values[0], samples["response"].values[:, 1])
    assert np.array_equal(found["prior_predictive"]["time"], samples["time"])
    assert found["prior/mass"].attrs["units"] == "kg" and found["prior_predictive/lowest"].attrs["units"] == "m"
    few = uqmbd.to_arviz(tree["monte-carlo"], draws=7)
    assert np.array_equal(few["prior_predictive/x"].values, found["prior_predictive/x"].values[:, :7])


def test_a_surrogate_is_drawn_from(tree):
    """Its draws are those of `sample`, at the same inputs for outputs with and without a time."""
    found = uqmbd.to_arviz(tree["collocation"], draws=400, seed=5)
    inputs, response = uqmbd.results.surrogate(tree["collocation"]).sample(400, 5)
    assert np.array_equal(found["prior/mass"].values[0], inputs[:, 1])
    assert np.array_equal(found["prior_predictive/x"].values[0], response[:, 0])
    lowest = uqmbd.results.surrogate(tree["collocation/scalars"]).evaluate(inputs)
    assert np.allclose(found["prior_predictive/lowest"].values[0], lowest[:, 0], rtol=1e-12)
    again = uqmbd.to_arviz(tree["collocation"], draws=400, seed=5)
    assert again["prior_predictive/y"].equals(found["prior_predictive/y"])
    assert (
        uqmbd.to_arviz(tree["collocation"]).sizes == {}
        and uqmbd.to_arviz(tree["collocation"])["prior"].sizes["draw"] == 1000
    )


def test_what_failed_is_left_out_and_counted():
    axes = uqmbd.extend.labels(["x"], ["k"], [0.0, 1.0])
    response = np.arange(12.0).reshape(6, 1, 2)
    samples = uqmbd.extend.sample_dataset(response, np.arange(6.0)[:, None], axes, status=[0, 0, 2, 0, 3, 0])
    statistics = uqmbd.extend.statistics_of_samples(samples)
    node = uqmbd.results.propagator_node("mine", statistics, samples, propagator="p", realisations=6, wall_time=0.0)
    found = uqmbd.to_arviz(node)
    assert found.attrs["left_out"] == 2
    assert found["prior/k"].values.tolist() == [[0, 1, 3, 5]]
    assert np.isfinite(found["prior_predictive/x"]).all()


def test_inputs_of_a_calibration_are_posterior():
    axes = uqmbd.extend.labels(["x"], ["k"], [0.0])
    samples = uqmbd.extend.sample_dataset([[[1.0]], [[2.0]]], [[3.0], [4.0]], axes)
    node = uqmbd.results.propagator_node(
        "mine", uqmbd.extend.statistics_of_samples(samples), samples, propagator="p", realisations=2, wall_time=0.0,
        attrs={"population": "posterior of a record"},
    )  # fmt: skip
    assert list(uqmbd.to_arviz(node).children) == ["posterior", "posterior_predictive"]


@pytest.mark.thorough
def test_arviz_computes_with_it(tree):
    """ArviZ of either generation: means and deviations of its table are ours, its density is one."""
    given = uqmbd.to_arviz(tree["monte-carlo"])
    ours = tree["monte-carlo/statistics"].to_dataset()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import arviz_base
            import arviz_stats

            table = arviz_stats.summary(given, group="prior_predictive", round_to="none")
            assert isinstance(arviz_base.convert_to_datatree(given), xr.DataTree)
        except ImportError:
            arviz = pytest.importorskip("arviz")
            taken = arviz.from_datatree(given) if hasattr(arviz, "from_datatree") else given
            table = arviz.summary(taken, group="prior_predictive", round_to="none")
    for name in ("x", "y"):
        rows = table[[label.startswith(f"{name}[") for label in table.index]]
        one = ours.sel(output=name)
        assert len(rows) == 6
        assert np.allclose(rows["mean"].astype(float), one["mean"], rtol=0, atol=1e-12)
        # one generation of ArviZ divides by the number of draws, the other by one less
        assert np.allclose(rows["sd"].astype(float), one["std"], rtol=2e-3)


def test_what_is_refused(tree):
    for arguments, words in (
        ((tree,), r"the results of 2 methods are given \('monte-carlo', 'collocation'\); expected one, as to_arviz"),
        ((tree["monte-carlo"], 0), "draws is 0; expected a whole number, 1 or more"),
        ((tree["monte-carlo"], 5, 1), "already has samples, so a seed has no effect; omit seed="),
        (({},), "the type of results is dict; expected the node of a method or a calibration"),
    ):
        with pytest.raises(uqmbd.StudyError, match=words):
            uqmbd.to_arviz(*arguments)
    axes = uqmbd.extend.labels(["x"], ["k"], [0.0])
    bare = uqmbd.extend.statistics_dataset(axes, mean=[[0.0]], std=[[1.0]])
    node = uqmbd.results.propagator_node("mine", bare, propagator="p", realisations=2, wall_time=0.0)
    with pytest.raises(uqmbd.StudyError, match="'mine' contains neither samples nor a surrogate"):
        uqmbd.to_arviz(node)
