"""The realisation with the smallest margin of each requirement, and its pose in the report."""

import json

import chaospy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import uqmbd
from uqmbd.report import with_motion
from uqmbd.report.live import collect_player_data
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.gathering import WorstRealisations


@given(
    st.lists(
        st.tuples(st.lists(st.floats(-3, 3) | st.just(np.inf), min_size=4, max_size=4), st.booleans()),
        min_size=1,
        max_size=30,
    ),
    st.lists(st.integers(0, 30), max_size=5),
)
def test_chunks_find_what_the_whole_ensemble_contains(drawn, cuts):
    """Against a loop over realisations; margins of two requirements at two times."""
    running = np.array([numbers for numbers, _ in drawn]).reshape(-1, 2, 2)
    running = np.minimum.accumulate(running, axis=2)
    failed = np.array([bad for _, bad in drawn])
    running[failed] = np.nan
    values = np.arange(len(drawn), dtype=float)[:, None]
    ends = sorted({min(k, len(drawn)) for k in cuts} | {0, len(drawn)})
    parts = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
    found = None
    for part in parts:
        one = WorstRealisations.of(running[part], failed[part], values[part])
        found = one if found is None else found.or_worse(one)
    for r in range(2):
        best = np.inf
        for k in range(len(drawn)):
            if not failed[k] and running[k, r, -1] < best:
                best, at, frame = running[k, r, -1], k, int(np.flatnonzero(running[k, r] == running[k, r, -1])[0])
        assert found.margins[r] == best
        if np.isfinite(best):
            assert (found.inputs[r, 0], found.frames[r]) == (at, frame)


@pytest.fixture(scope="module")
def study():
    """A stone with a random speed upwards: its height is v t - 5 t^2, largest at t = v / 10."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(4, 6), units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Planar(gravity=(0, -10)))
    stone = mechanism.body("stone", mass=1, inertia=1, velocity=(0, speed))
    mechanism.output("height", stone.position[1], units="m")
    mechanism.require("below the lamp", stone.position[1] <= 1.5, "no contact with the lamp")
    mechanism.require("comes back", stone.position[1] >= -0.9, "the net is at -0.9 m")
    methods = [
        MonteCarlo(samples=300, seed=3, keep=2),
        MonteCarlo(samples=60, seed=4, sampling="latin-hypercube", label="designed"),
    ]
    return uqmbd.Study("throw", mechanism, np.linspace(0, 1, 11), methods)


def test_the_smallest_margin_is_that_of_the_closed_form(study):
    tree = study.run()
    for label, samples in (("monte-carlo", 300), ("designed", 60)):
        data = tree[f"{label}/requirements"].to_dataset()
        high, low, both = (data.sel(requirement=name) for name in ("below the lamp", "comes back", "any"))
        fastest, slowest = float(high["worst_inputs"][0]), float(low["worst_inputs"][0])
        # the largest of n uniform numbers is at least 1 - 20 / n with probability 1 - 2e-9
        assert 6 - 40 / samples < fastest <= 6 and 4 <= slowest < 4 + 40 / samples
        assert float(high["worst_margin"]) == pytest.approx(1.5 - fastest**2 / 20, abs=1e-6)
        assert float(high["worst_time"]) == pytest.approx(np.ceil(fastest - 1e-9) / 10)
        assert float(low["worst_margin"]) == pytest.approx(slowest - 5 + 0.9, abs=1e-6)
        assert float(low["worst_time"]) == 1.0
        assert np.isnan(both["worst_margin"]) and np.isnan(both["worst_inputs"]).all()


def test_the_report_has_the_poses_of_the_worst_realisations(study):
    tree, note = with_motion(study.run(), study)
    assert note == ""
    motion = tree["motion"].to_dataset()
    named = json.loads(motion.attrs["named"])
    assert [one["pictured"] for one in named] == [False, False]
    player = collect_player_data(motion)
    assert [one["name"] for one in player["named"]] == [one["name"] for one in named]
    count = player["realisations"]
    assert player["poses"]["shape"][0] == count + 2 == motion.sizes["realisation"]
    for one in named:
        requirement = one["name"].rpartition(" margin of ")[2]
        label = one["name"].removeprefix("realisation of ").partition(" with ")[0]
        inputs = tree[f"{label}/requirements"].sel(requirement=requirement)["worst_inputs"]
        assert motion["inputs"][one["realisation"]].values == pytest.approx(inputs.values)
        height = motion["pose"][one["realisation"], -1, 0].sel(coordinate="y")
        assert float(height) == pytest.approx(float(inputs[0]) - 5, abs=1e-5)


def test_results_of_inputs_with_other_names_have_a_motion(study):
    """As after a study file was edited: the stored realisations do not belong to its inputs."""
    tree = study.run()
    swiftness = uqmbd.RandomVariable("swiftness", chaospy.Uniform(4, 6), units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Planar(gravity=(0, -10)))
    stone = mechanism.body("stone", mass=1, inertia=1, velocity=(0, swiftness))
    mechanism.output("height", stone.position[1], units="m")
    extended, note = with_motion(tree, uqmbd.Study("throw", mechanism, np.linspace(0, 1, 11)))
    assert note == "" and "named" not in extended["motion"].attrs


@pytest.mark.parametrize("named", ['[{"realisation": 1e400, "name": "x", "time": 0}]', "[3]", "no JSON", '{"a": 1}'])
def test_named_realisations_of_other_programs_are_not_drawn(study, named):
    motion = with_motion(study.run(), study)[0]["motion"].to_dataset()
    motion.attrs["named"] = named
    assert collect_player_data(motion)["named"] == []
