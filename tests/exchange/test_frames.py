"""Results as frames of pandas: every number is that of the result, a row is one thing, and nothing multiplies out."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import uqmbd
from uqmbd.exchange import frames
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from ..mechanisms import pendulum

TIMES = np.linspace(0, 1, 6)


@pytest.fixture(scope="module")
def tree():
    mechanism = pendulum(loaded=True)
    mechanism.output("lowest", uqmbd.minimum(mechanism.bodies["rod"].position[1]), units="m")
    return uqmbd.Study("pendulum", mechanism, TIMES, [MonteCarlo(samples=50, seed=2), Collocation(order=3)]).run()


def test_a_row_is_a_method_an_output_and_a_time(tree):
    frame = uqmbd.to_frame(tree)
    assert len(frame) == 2 * (2 * 6 + 1)
    assert not frame.duplicated(["method", "output", "time"]).any()
    assert list(frame.columns[:6]) == ["method", "output", "units", "time", "mean", "standard_deviation"]
    for method in ("monte-carlo", "collocation"):
        for output in ("x", "y"):
            rows = frame[(frame["method"] == method) & (frame["output"] == output)]
            data = tree[f"{method}/statistics"].to_dataset().sel(output=output)
            assert np.array_equal(rows["time"], TIMES)
            assert np.array_equal(rows["mean"], data["mean"])
            assert np.array_equal(rows["standard_deviation"], data["std"])
            assert np.array_equal(rows["quantile_0.05"], data["quantile"].sel(probability=0.05))
        timeless = frame[(frame["method"] == method) & (frame["output"] == "lowest")]
        assert timeless["time"].isna().all() and len(timeless) == 1
        assert timeless["mean"].item() == float(tree[f"{method}/scalars/statistics"]["mean"].item())
    chaos = frame[frame["method"] == "collocation"]
    assert np.array_equal(
        chaos[chaos["output"] == "y"]["sobol_total_mass"],
        tree["collocation/statistics"]["sobol_total"].sel(output="y", input="mass"),
    )
    assert frame[frame["method"] == "monte-carlo"]["sobol_total_mass"].isna().all()
    assert set(frame["units"]) == {"m"}


def test_a_frame_is_what_pandas_makes_of_the_data(tree):
    """xarray's own way, of one variable: the same numbers in the same rows."""
    data = tree["collocation/statistics"].to_dataset()
    theirs = data["mean"].to_dataframe().reset_index()
    ours = uqmbd.to_frame(tree["collocation"], outputs=["x", "y"])
    merged = pd.merge(ours, theirs, on=["output", "time"], suffixes=("", "_theirs"))
    assert len(merged) == len(ours) == len(theirs) and np.array_equal(merged["mean"], merged["mean_theirs"])


def test_a_row_is_a_realisation(tree):
    frame = uqmbd.samples_to_frame(tree["monte-carlo"])
    samples = tree["monte-carlo/samples"].to_dataset()
    assert list(frame.columns) == ["sample", "length", "mass", "lowest", "status"] and len(frame) == 50
    assert np.array_equal(frame[["length", "mass"]].to_numpy(), samples["inputs"])
    assert np.array_equal(frame["lowest"], tree["monte-carlo/scalars/samples"]["response"].values[:, 0])
    assert set(frame["status"]) == {"ok"}
    assert frame.attrs["units"] == {"length": "m", "mass": "kg", "lowest": "m"}
    assert uqmbd.samples_to_frame(tree).equals(frame)  # only one of the methods keeps samples


def test_outputs_over_time_are_chosen_and_joined_by_the_sample(tree):
    frame = uqmbd.samples_to_frame(tree["monte-carlo"], ["y"], times=[0.4, 1.0])
    assert list(frame.columns) == ["sample", "time", "y"] and len(frame) == 100
    response = tree["monte-carlo/samples"]["response"]
    wide = frame.pivot(index="sample", columns="time", values="y")
    assert np.array_equal(wide.to_numpy(), response.values[:, 1][:, [2, 5]])
    joined = frame.merge(uqmbd.samples_to_frame(tree["monte-carlo"]), on="sample")
    assert np.array_equal(joined["length"], np.repeat(tree["monte-carlo/samples"]["inputs"].values[:, 0], 2))
    assert len(uqmbd.samples_to_frame(tree["monte-carlo"], "x")) == 50 * 6


def test_failures_are_rows_with_a_word():
    axes = uqmbd.extend.labels(["x"], ["k"], [0.0, 1.0])
    samples = uqmbd.extend.sample_dataset(
        np.arange(8.0).reshape(4, 1, 2),
        [[1.0], [2.0], [3.0], [4.0]],
        axes,
        status=[0, 7, 2, 0],
        meanings={0: "ok", 2: "lost", 7: "given up"},
    )
    node = uqmbd.results.propagator_node(
        "mine", uqmbd.extend.statistics_of_samples(samples), samples, propagator="p", realisations=4, wall_time=0.0
    )
    assert uqmbd.samples_to_frame(node)["status"].tolist() == ["ok", "given_up", "lost", "ok"]
    assert uqmbd.samples_to_frame(node, "x")["x"].isna().tolist() == [
        False,
        False,
        True,
        True,
        True,
        True,
        False,
        False,
    ]


def test_what_is_refused(tree, monkeypatch):
    monkeypatch.setattr(frames, "MOST", 1000)
    for call, words in (
        (lambda: uqmbd.to_frame(tree, "z"), "to_frame: the results have no output 'z'"),
        (lambda: uqmbd.to_frame(3), "to_frame: results is 3; expected an xarray.DataTree"),
        (lambda: uqmbd.to_frame(tree, []), "outputs is empty"),
        (
            lambda: uqmbd.samples_to_frame(tree["collocation"]),
            "expected the samples of one method, but no samples are given",
        ),
        (lambda: uqmbd.samples_to_frame(tree, times=1.0), "times=1.0 has no effect without outputs="),
        (
            lambda: uqmbd.samples_to_frame(tree, "x", times=0.33),
            r"0.33 s is not an output time; the nearest output time is 0.4 s",
        ),
        (
            lambda: uqmbd.samples_to_frame(tree, ["x", "y"]),
            r"50 realisations of 2 outputs at 6 times are 1.2e\+03 numbers",
        ),
    ):
        with pytest.raises(uqmbd.StudyError, match=words):
            call()
