"""Requirements in every method, against closed forms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import statistics_dataset
from uqmbd.results import load, save, validate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 2, 5)


def oscillator(outputs=()):
    """A mass of 2 kg on a spring of random stiffness k, let go at 1 m: x = cos(sqrt(k / 2) t)."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(6, 10), units="N/m")
    mass = mechanism.body("mass", mass=2, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    mechanism.require("stiff", uqmbd.eigenfrequency(1) >= 0.3, description="first mode, 0.3 Hz")
    mechanism.require("weak", stiffness <= 9)
    if "x" in outputs:
        mechanism.output("x", mass.position[0], units="m")
    if "frequency" in outputs:
        mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    return mechanism


STIFF = (2 * (2 * np.pi * 0.3) ** 2 - 6) / 4
KNOWN = np.array([STIFF, 0.25, STIFF + 0.25])
METHODS = [MonteCarlo(samples=400, seed=1), Collocation(order=4), Galerkin(order=4)]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "outputs", [(), ("x", "frequency"), *(pytest.param((x,), marks=pytest.mark.slow) for x in ("x", "frequency"))]
)
def test_every_method_gives_the_probability_and_an_interval_that_holds_it(outputs, tmp_path):
    study = uqmbd.Study("stiffness", oscillator(outputs), TIMES, METHODS)
    tree = study.run()
    validate(tree)
    for method in METHODS:
        data = tree[f"{method.node_name}/requirements"].to_dataset()
        assert data["requirement"].values.tolist() == ["stiff", "weak", "any"]
        assert data["description"].values.tolist()[0] == "first mode, 0.3 Hz"
        low, high = data["interval"].values.T
        assert np.all((low <= KNOWN) & (KNOWN <= high))
        assert np.all(high - low < (0.11 if method.node_name == "monte-carlo" else 0.01))
        assert np.all(np.abs(data["violated_by"].values - data["violation_probability"].values[:, None]) < 0.01)
        assert ("scalars" in tree[method.node_name].children) == ("frequency" in outputs)
        assert tree[f"{method.node_name}/statistics"].sizes["output"] == ("x" in outputs)
    again = load(save(tree, tmp_path / "results.nc"))
    assert again["monte-carlo/requirements"].to_dataset().equals(tree["monte-carlo/requirements"].to_dataset())


def test_a_study_of_statics_needs_no_times():
    study = uqmbd.Study("stiffness", oscillator(), propagators=[MonteCarlo(samples=50, seed=1)])
    assert study.run()["monte-carlo/requirements"]["violation_probability"].shape == (3,)
    mechanism = oscillator()
    mechanism.require("travel", mechanism.bodies["mass"].position[0] <= 2)
    with pytest.raises(uqmbd.StudyError, match="times are missing.*'travel'"):
        uqmbd.Study("stiffness", mechanism)


@pytest.mark.thorough
def test_the_seed_decides_and_neither_workers_nor_resuming(tmp_path):
    study = uqmbd.Study("stiffness", oscillator(("x",)), TIMES, [MonteCarlo(samples=200, seed=2)])
    one = study.run()["monte-carlo/requirements"].to_dataset()
    assert one.equals(study.run(workers=2)["monte-carlo/requirements"].to_dataset())
    kept = study.run(folder=tmp_path)["monte-carlo/requirements"].to_dataset()
    assert kept.equals(study.run(folder=tmp_path, resume=True)["monte-carlo/requirements"].to_dataset())
    assert one.equals(kept)


def test_realisations_are_shared(monkeypatch):
    """Outputs, scalars and requirements cost the realisations of one of them."""
    import uqmbd.propagation.execution.chunks as chunks

    computed = []
    original = chunks.margins_of
    monkeypatch.setattr(chunks, "margins_of", lambda e, *a: computed.append(len(e)) or original(e, *a))
    uqmbd.Study("s", oscillator(("x", "frequency")), TIMES, [Collocation(order=3, verify=4)]).run()
    # two more tell whether the input changes anything
    assert sum(computed) == 4 + 4 + 2


def test_margins_for_propagators():
    problem = uqmbd.Study("s", oscillator(("x",)), TIMES).problem(MonteCarlo())
    values = np.array([[6.0], [8.0], [9.5]])
    found = problem.margins(values)
    frequency = np.sqrt(values[:, 0] / 2) / (2 * np.pi)
    assert found.values == pytest.approx(np.stack([frequency - 0.3, 9 - values[:, 0]], axis=1))
    assert found.running.shape == (3, 2, 5) and not found.failed.any()
    assert np.array_equal(problem.realise(values).margins.values, found.values)
    assert [r.name for r in problem.requirements] == ["stiff", "weak"]
    for kind in ((), ("frequency",)):
        mechanism = oscillator(kind)
        mechanism.require("still", uqmbd.maximum(mechanism.bodies["mass"].velocity[0]) <= 2)
        other = uqmbd.Study("s", mechanism, TIMES).problem(MonteCarlo())
        given = other.without_time() if kind else other.of_requirements()
        assert given.margins(values).running.shape == (3, 3, 5)
        assert np.array_equal(given.margins(values).running, other.margins(values).running)
    bare = uqmbd.Mechanism("bare", uqmbd.Translational())
    bare.output("x", bare.body("mass", mass=1).position[0])
    with pytest.raises(uqmbd.StudyError, match="the mechanism has no requirements; add one"):
        uqmbd.Study("s", bare, TIMES).problem(MonteCarlo()).margins(np.zeros((1, 0)))


class Bare(uqmbd.extend.Propagator):
    """Gives means alone."""

    name = "bare"

    def propagate(self, problem):
        values = problem.realise(problem.inputs.means[None, :]).response[0]
        return problem.node(
            self, statistics_dataset(problem.labels, mean=values, std=0 * values), realisations=1, wall_time=0.0
        )


class Careless(Bare):
    """Says that it answers requirements, and does not."""

    requirements = True


def test_methods_of_others():
    study = uqmbd.Study("s", oscillator(("x",)), TIMES)
    data = study.propagate(Bare())["requirements"].to_dataset()
    assert np.isnan(data["violation_probability"]).all() and data["interval"].values.tolist() == [[0, 1]] * 3
    assert "neither samples nor a surrogate" in data.attrs["how"]
    with pytest.raises(uqmbd.StudyError, match="declares that it computes requirements, but returned a node without"):
        study.propagate(Careless())


def test_without_verification_nothing_is_known():
    node = uqmbd.Study("s", oscillator(("x",)), TIMES).propagate(Collocation(order=4, verify=0))
    data = node["requirements"].to_dataset()
    assert data["interval"].values.tolist() == [[0, 1]] * 3 and "verify=16" in data.attrs["how"]
    assert data["violation_probability"].values == pytest.approx(KNOWN, abs=0.01)


def test_one_motion_tells_its_margins():
    mechanism = oscillator(("x",))
    mechanism.require("travel", mechanism.bodies["mass"].position[0] >= -0.5)
    found = uqmbd.simulate(mechanism, TIMES, check=False)
    assert found["requirement"].values.tolist() == ["stiff", "weak", "travel"]
    assert found["requirement_met"].values.tolist() == [True, True, False]
    smallest = np.minimum.accumulate(np.cos(2 * TIMES) + 0.5)
    assert found["requirement_margin"].sel(requirement="travel").values[:3] == pytest.approx(smallest[:3], abs=1e-5)
    still = uqmbd.simulate(oscillator(), TIMES)
    assert still["requirement_margin"].dims == ("requirement",)
    assert float(still["requirement_margin"].sel(requirement="weak")) == pytest.approx(1.0)
