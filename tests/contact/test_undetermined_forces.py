"""Outputs that depend on contact forces which the motion does not determine are NaN, with the reason."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import RotationalFriction

G = 9.81
CORNERS = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))


def table(feet, com=(0.05, 0.02), friction=0.5, mass=1.0) -> uqmbd.Mechanism:
    """A table at rest on feet (x, y), m; outputs: the force of each foot, and their resultants."""
    mechanism = uqmbd.Mechanism("table", uqmbd.Spatial(gravity=(0, 0, -G)))
    top = mechanism.body("top", mass=mass, inertia=(0.01,) * 3, position=(0, 0, 0.1), com=(*com, 0))
    legs = [
        mechanism.add(
            PlaneImpact(
                f"leg{k}", mechanism.ground, top, (0, 0, 0), (x, y, -0.1), (0, 0, 1), restitution=0, friction=friction
            )
        )
        for k, (x, y) in enumerate(feet)
    ]
    up = [leg.reaction_force[2] for leg in legs]
    for k, force in enumerate(up):
        mechanism.output(f"n{k}", force, units="N")
    mechanism.output("weight", sum(up), units="N")
    mechanism.output("moment", sum(x * force for (x, _), force in zip(feet, up, strict=True)), units="N m")
    mechanism.output("along", sum(leg.reaction_force[0] for leg in legs), units="N")
    mechanism.output("height", top.position[2], units="m")
    return mechanism


def at_rest(mechanism: uqmbd.Mechanism) -> dict[str, float]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "simulate")
        found = uqmbd.simulate(mechanism, [0, 0.1], check=False)
    return {name: float(found[name][-1]) for name in mechanism.outputs}


def test_forces_of_four_legs_are_undetermined_and_their_resultants_are_not() -> None:
    with pytest.warns(UserWarning, match=r"'n0' is not determined at t = 0 s: .* 'leg0', 'leg1', 'leg2', 'leg3'"):
        found = uqmbd.simulate(table(CORNERS), [0, 0.1], check=False)
    assert np.isnan([found[f"n{k}"] for k in range(4)]).all()
    for name, exact in {"weight": G, "moment": 0.05 * G, "along": 0.0, "height": 0.1}.items():
        assert found[name].values == pytest.approx([exact, exact], abs=1e-9)


def test_forces_of_three_legs_are_determined() -> None:
    """Moments about the axes of the table give the forces."""
    found = at_rest(table(CORNERS[:3]))
    inverse = np.linalg.inv([[1, 1, 1], *np.transpose(CORNERS[:3])])
    assert [found[f"n{k}"] for k in range(3)] == pytest.approx(list(inverse @ [G, 0.05 * G, 0.02 * G]), rel=1e-7)


@pytest.mark.thorough
@settings(max_examples=15, deadline=None)
@given(
    feet=st.lists(st.tuples(st.integers(-5, 5), st.integers(-5, 5)), min_size=3, max_size=6, unique=True),
    where=st.lists(st.floats(0.1, 1.0), min_size=6, max_size=6),
)
def test_legs_are_undetermined_where_a_linear_program_finds_a_range(feet, where) -> None:
    """Smooth legs, with the centre of mass between them: the least and the largest possible force of each leg."""
    places = np.array(feet, dtype=float) / 10
    weights = np.array(where[: len(feet)])
    com = weights @ places / weights.sum()
    balance = np.vstack([np.ones(len(feet)), places.T])
    assume(np.linalg.svd(balance, compute_uv=False)[-1] > 0.05)
    found = at_rest(table([tuple(x) for x in places.tolist()], tuple(com.tolist()), friction=0))
    right = G * np.array([1, *com])
    for k in range(len(feet)):
        cost = np.eye(len(feet))[k]
        low, high = (s * linprog(s * cost, A_eq=balance, b_eq=right).fun for s in (1, -1))
        if high - low > 1e-6:
            assert np.isnan(found[f"n{k}"]), (low, high)
        else:
            assert found[f"n{k}"] == pytest.approx(low, abs=1e-6)
    assert found["weight"] == pytest.approx(G, rel=1e-9)


def disc_in_a_corner(friction: float) -> uqmbd.Mechanism:
    """A disc in a corner of 90 degrees, whose walls are inclined by 45 degrees."""
    mechanism = uqmbd.Mechanism("corner", uqmbd.Planar(gravity=(0, -G)))
    r, c = 0.1, np.sqrt(0.5)
    disc = mechanism.body("disc", mass=1, inertia=0.005, position=(0, r / c))
    for name, side in (("left", 1), ("right", -1)):
        # the material point of the disc that touches the wall at rest
        wall = PlaneImpact(
            name, mechanism.ground, disc, (0, 0), (-side * c * r, -c * r), (side * c, c), restitution=0,
            friction=friction,
        )  # fmt: skip
        force = mechanism.add(wall).reaction_force
        mechanism.output(name, side * c * force[0] + c * force[1], units="N")
    return mechanism


def test_a_disc_in_a_corner_is_wedged_more_or_less() -> None:
    """The forces are unique without friction; with friction the disc may be wedged."""
    assert list(at_rest(disc_in_a_corner(0)).values()) == pytest.approx([G * np.sqrt(0.5)] * 2, rel=1e-8)
    assert np.isnan(list(at_rest(disc_in_a_corner(0.3)).values())).all()


def test_friction_of_two_feet_is_undetermined_while_their_normal_forces_are_unique() -> None:
    mechanism = uqmbd.Mechanism("box", uqmbd.Planar(gravity=(0, -G)))
    box = mechanism.body("box", mass=1, inertia=0.01, position=(0, 0.1), com=(0.02, 0))
    up, along = 0, 0
    for k, x in enumerate((-0.1, 0.1)):
        foot = PlaneImpact(f"foot{k}", mechanism.ground, box, (0, 0), (x, -0.1), (0, 1), restitution=0, friction=0.4)
        force = mechanism.add(foot).reaction_force
        mechanism.output(f"normal{k}", force[1], units="N")
        mechanism.output(f"friction{k}", force[0], units="N")
        up, along = up + force[1], along + force[0]
    mechanism.output("friction", along, units="N")
    found = at_rest(mechanism)
    assert [found["normal0"], found["normal1"]] == pytest.approx([0.4 * G, 0.6 * G], rel=1e-8)
    assert np.isnan([found["friction0"], found["friction1"]]).all()
    assert found["friction"] == pytest.approx(0, abs=1e-9)


def test_a_study_states_why_the_realisations_fail() -> None:
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.9, 1.1), units="kg")
    method = MonteCarlo(samples=8, seed=1)
    mechanism = table(CORNERS, mass=mass)
    study = uqmbd.Study("table", mechanism, [0, 0.1], [method])
    with pytest.raises(uqmbd.UqmbdError, match="use an output that depends only on their resultant"):
        study.run()


def test_a_locked_joint_hides_no_undetermined_forces() -> None:
    """The limit of a friction elsewhere in the mechanism is no scale of the forces of three feet."""
    mechanism = uqmbd.Mechanism("box", uqmbd.Planar(gravity=(0, -G)))
    box = mechanism.body("box", mass=1, inertia=0.01, position=(0, 0.1))
    for k, x in enumerate((-0.1, 0.0, 0.1)):
        foot = PlaneImpact(f"foot{k}", mechanism.ground, box, (0, 0), (x, -0.1), (0, 1), restitution=0, friction=0)
        mechanism.output(f"n{k}", mechanism.add(foot).reaction_force[1], units="N")
    disc = mechanism.body("disc", mass=1, inertia=0.01, position=(2, 2))
    mechanism.add(Revolute("axle", mechanism.ground, disc, (2, 2), (0, 0)))
    mechanism.add(RotationalFriction("lock", mechanism.ground, disc, friction=1e8))
    assert np.isnan(list(at_rest(mechanism).values())).all()


@pytest.mark.parametrize("reserve", [2e-7, 0.1], ids=["at the limit", "below the limit"])
def test_a_box_at_its_limit_determines_no_forces_of_another(reserve) -> None:
    """The other box is on a slope of its angle of friction: both of its feet are at the limit, or have a reserve."""
    mechanism = uqmbd.Mechanism("boxes", uqmbd.Planar(gravity=(0, -G)))
    box = mechanism.body("box", mass=1, inertia=0.01, position=(0, 0.1))
    for k, x in enumerate((-0.1, 0.0, 0.1)):
        foot = PlaneImpact(f"foot{k}", mechanism.ground, box, (0, 0), (x, -0.1), (0, 1), restitution=0, friction=0)
        mechanism.output(f"n{k}", mechanism.add(foot).reaction_force[1], units="N")
    tilt = 0.3
    up, along = (-np.sin(tilt), np.cos(tilt)), (np.cos(tilt), np.sin(tilt))
    other = mechanism.body("other", mass=1, inertia=0.01, position=(5 + 0.1 * up[0], 0.1 * up[1]), angle=tilt)
    law = {"restitution": 0, "friction": float(np.tan(tilt) * (1 + reserve))}
    for k, x in enumerate((-0.1, 0.1)):
        foot = PlaneImpact(f"limit{k}", mechanism.ground, other, (5, 0), (x, -0.1), up, **law)
        force = mechanism.add(foot).reaction_force
        mechanism.output(f"t{k}", along[0] * force[0] + along[1] * force[1], units="N")
    found = at_rest(mechanism)
    assert np.isnan([found[f"n{k}"] for k in range(3)]).all()
    if reserve > 1e-3:
        assert np.isnan([found["t0"], found["t1"]]).all()
    else:
        assert found["t0"] + found["t1"] == pytest.approx(G * np.sin(tilt), rel=1e-6)
        assert np.isfinite([found["t0"], found["t1"]]).all()
