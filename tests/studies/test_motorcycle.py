"""The motorcycle: statics against the balance of the whole machine, and three methods over the whole crossing."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

STUDY = Path(__file__).parents[2] / "studies" / "motorcycle.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


@pytest.fixture(scope="module")
def crossing(made):
    """All three methods, with fewer samples than the study's."""
    study = made["study"]
    methods = MonteCarlo(samples=200, seed=1), Collocation(order=2), Galerkin(order=2)
    return {m.node_name: study.propagate(m)["statistics"].to_dataset() for m in methods}


@pytest.mark.thorough
def test_it_has_two_degrees_of_freedom(made):
    """20 coordinates, 15 constraints and 3 drivers."""
    found = uqmbd.check(made["mechanism"])
    assert (found.coordinates, found.equations, found.rank, found.mobility) == (20, 18, 18, 2)


@pytest.mark.thorough
def test_wheels_carry_the_weight():
    """At rest: vertical balance of the whole machine, and its moments about the rear wheel."""
    made = runpy.run_path(str(STUDY))
    mechanism, bodies = made["mechanism"], made["bodies"]
    for end, body, point in (("front", "lower_fork", "p5"), ("rear", "swing_arm", "p7")):
        mechanism.output(f"{end}_load", mechanism.components[f"{end}_wheel"].reaction_force[1], units="N")
        mechanism.output(f"{end}_place", bodies[body].point(made["on"](body, made[point]))[0], units="m")
    for name, body in bodies.items():
        mechanism.output(f"{name}_place", body.position[0], units="m")
    found = {name: float(value) for name, value in uqmbd.static_equilibrium(mechanism).items()}
    weights = {name: made["GRAVITY"] * mass for name, (_, mass, _) in made["parts"].items()}
    assert found["front_load"] + found["rear_load"] == pytest.approx(sum(weights.values()), rel=1e-9)
    moment = sum(weights[name] * (found[f"{name}_place"] - found["rear_place"]) for name in weights)
    assert found["front_load"] * (found["front_place"] - found["rear_place"]) == pytest.approx(moment, rel=1e-9)


@pytest.mark.thorough
def test_methods_agree_over_the_whole_crossing(crossing):
    """Chaos of two kinds within 0.1 % of the largest standard deviation; Monte Carlo within five standard errors."""
    sampled, chaos, galerkin = (crossing[name] for name in ("monte-carlo", "collocation", "galerkin"))
    most = chaos["std"].max("time")
    for name in ("mean", "std"):
        assert float((abs(galerkin[name] - chaos[name]) / most).max()) < 1e-3
        # more than a thousand comparisons
        assert float((abs(sampled[name] - chaos[name]) / (sampled[f"std_error_{name}"] + 1e-6 * most)).max()) < 5


@pytest.mark.thorough
def test_every_realisation_starts_in_equilibrium(crossing):
    """Until the front wheel meets the bump at 0.1 s nothing moves, though heights differ."""
    statistics = crossing["collocation"].sel(time=slice(0, 0.0999))
    still = statistics["mean"] - statistics["mean"].isel(time=0)
    assert float(abs(still / crossing["collocation"]["std"].max("time")).max()) < 1e-3
    assert float(statistics["std"].sel(output="frame_height").min()) > 1e-3


@pytest.mark.thorough
def test_stated_errors_hold(crossing):
    """The verification realisations state less than 1 % for both expansions."""
    for name in ("collocation", "galerkin"):
        assert float(crossing[name]["verification_error"].max()) < 0.01


def test_softer_springs_sink_further(made):
    """The shock's static length follows its stiffness: 3 % softer, k x (free - length) nearly the same load."""
    mechanism = made["mechanism"]
    lengths, loads = [], []
    for stiffness in (58570.0, 0.97 * 58570.0):
        found = uqmbd.static_equilibrium(mechanism, values={"rear_stiffness": stiffness})
        lengths.append(float(found["shock_length"]))
        loads.append(float(found["shock_force"]))
    assert lengths[1] < lengths[0]
    assert loads[1] == pytest.approx(loads[0], rel=0.02)
    np.testing.assert_allclose(loads[0], 58570.0 * (made["SHOCK_FREE_LENGTH"] - lengths[0]), rtol=1e-9)
