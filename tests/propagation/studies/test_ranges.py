"""A realisation in which a number leaves its range has failed, whoever computes it, and the study says so before."""

from __future__ import annotations

import json
import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import Status
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import RotationalFriction, SpringDamper

WEAR = uqmbd.RandomVariable("wear", chaospy.Normal(0.5, 0.25))
LOAD = uqmbd.RandomVariable("load", chaospy.Uniform(0.5, 1.5))


def bearing(start_output=False, requirement=False):
    """A disc whose bearing is damped by what the wear leaves: none is left from a wear of 1 on."""
    mechanism = uqmbd.Mechanism("bearing", uqmbd.Planar())
    disc = mechanism.body("disc", mass=1, inertia=1, angular_velocity=1)
    damping = (1 - WEAR) * LOAD
    mechanism.add(RotationalFriction("seal", mechanism.ground, disc, friction=0, damping=damping))
    mechanism.add(SpringDamper("spring", mechanism.ground, disc, (0, 0), (0, 0), stiffness=10))
    mechanism.output("speed", disc.angular_velocity, units="rad/s")
    if start_output:
        mechanism.output("fastest", uqmbd.maximum(disc.angular_velocity), units="rad/s")
    if requirement:
        mechanism.require("slow", disc.angular_velocity <= 2)
    return mechanism


def ran(study, **options):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        tree = study.run(**options)
    return tree, told


@pytest.mark.thorough
@pytest.mark.parametrize("workers", [1, 2])
def test_monte_carlo_counts_realisations_outside(workers):
    study = uqmbd.Study("turn", bearing(), [0, 0.5, 1], [MonteCarlo(samples=200, seed=3)])
    tree, told = ran(study, workers=workers)
    samples = tree["monte-carlo/samples"]
    wear, load = samples["inputs"].sel(input=["wear", "load"]).values.T
    outside = (1 - wear) * load < 0
    assert 0 < outside.sum() < 20
    assert np.array_equal(samples["status"].values, np.where(outside, Status.OUTSIDE_LIMITS, Status.OK))
    assert samples["status"].attrs["flag_meanings"].split()[-1] == "outside_limits"
    assert (
        np.isnan(samples["response"].values[outside]).all() and np.isfinite(samples["response"].values[~outside]).all()
    )
    for text in samples["message"].values[outside]:
        assert (
            text.startswith("the damping of RotationalFriction 'seal' is −")
            and "rad: expected 0 or more; load = " in text
        )
    before, after = told
    assert "study 'turn': the damping of RotationalFriction 'seal' is outside of its range (0 or more)" in str(
        before.message
    )
    assert issubclass(before.category, uqmbd.StudyWarning) and before.filename == __file__
    assert f"{outside.sum()} of 200 realisations failed" in str(after.message)
    assert json.loads(tree.attrs["warnings"])[0] + "." == str(before.message).removeprefix("study 'turn': ")


@pytest.mark.thorough
def test_outputs_without_a_time_and_margins_have_the_same_status():
    study = uqmbd.Study(
        "turn", bearing(start_output=True, requirement=True), [0, 0.5], [MonteCarlo(samples=100, seed=3)]
    )
    node = ran(study)[0]["monte-carlo"]
    expected = node["samples/status"].values
    assert (expected == Status.OUTSIDE_LIMITS).any()
    found = [part["status"].values for part in node.subtree if "status" in part.data_vars]
    assert len(found) > 1 and all(np.array_equal(one, expected) for one in found)


@pytest.mark.thorough
def test_collocation_tells_nodes_outside():
    study = uqmbd.Study("turn", bearing(), [0, 0.5], [Collocation(order=6, verify=0)])
    tree, told = ran(study)
    nodes = tree["collocation/nodes"]
    wear = nodes["inputs"].sel(input="wear").values
    assert np.array_equal(nodes["status"].values == Status.OUTSIDE_LIMITS, wear > 1) and (wear > 1).any()
    assert any("nodes failed" in str(w.message) and "'seal' is −" in str(w.message) for w in told)


@pytest.mark.thorough
def test_galerkin_refuses_where_one_of_its_nodes_is_outside():
    study = uqmbd.Study("turn", bearing(), [0, 0.5], [Galerkin(order=4, verify=0)])
    with pytest.warns(uqmbd.StudyWarning, match="outside of its range"):
        with pytest.raises(uqmbd.StudyError, match=r"'seal' is −.* expected 0 or more; load = .*Truncate the distrib"):
            study.run()


def test_one_motion_tells_its_inputs():
    mechanism = bearing()
    assert np.isfinite(uqmbd.simulate(mechanism, [0, 0.5], values={"wear": 0.9})["speed"]).all()
    for start in ("drawn", "equilibrium"):
        with pytest.raises(
            uqmbd.UqmbdError,
            match="is −0.1 N\N{NARROW NO-BREAK SPACE}m\N{NARROW NO-BREAK SPACE}s/rad: expected 0 or more; load = 1, wear = 1.1",
        ):
            uqmbd.simulate(mechanism, [0, 0.5], values={"wear": 1.1}, start=start)


def test_a_start_in_equilibrium_has_the_same_status():
    study = uqmbd.Study("turn", bearing(), [0, 0.5], [MonteCarlo(samples=2, seed=3)], start="equilibrium")
    found = study.problem(study.propagators[0]).realise(np.array([[1.0, 0.5], [1.0, 1.5]]))
    assert found.status.tolist() == [Status.OK, Status.OUTSIDE_LIMITS]


def test_rare_realisations_are_reported_where_as_many_are_computed_that_one_may_come():
    """Of a deviation of 0.25 from 1 the tail below 0 is 3.2e-5: a twentieth of one among 1579 realisations."""
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1, 0.25), units="kg")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    stone = mechanism.body("stone", mass=mass)
    mechanism.output("momentum", mass * stone.velocity[0], units="kg m/s")
    for samples, count in [(1500, 0), (1600, 1)]:
        study = uqmbd.Study("fall", mechanism, [0, 1], [MonteCarlo(samples=samples, seed=1)])
        assert len(study.predict_warnings()) == count
    assert study.predict_warnings([MonteCarlo(samples=100, seed=1)]) == ()
    with pytest.warns(DeprecationWarning, match="predict_warnings"):
        assert study.foretold() == study.predict_warnings()


def test_a_method_that_is_run_alone_is_reported_too():
    damping = uqmbd.RandomVariable("damping", chaospy.Normal(0.2, 0.1), units="N s/m")
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, cart, 0, 0, stiffness=10, damping=damping))
    mechanism.output("x", cart.position[0], units="m")
    study = uqmbd.Study("roll", mechanism, [0, 1], [Collocation(order=2)])
    with pytest.warns(
        uqmbd.StudyWarning,
        match="the damping of SpringDamper 'spring' is negative in 2.3 % .* these realisations succeed",
    ):
        node = study.propagate(Collocation(order=2))
    assert (node["nodes/status"].values == Status.OK).all()
