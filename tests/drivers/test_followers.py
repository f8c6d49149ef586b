"""Joints that follow other joints: hinges and slides, chains, trees, random laws, and turns before the start."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import replace

import chaospy
import numpy as np
import pytest
from scipy.optimize import brentq

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import TorsionSpringDamper

from .trees import Law, random_tree

TIMES = np.linspace(0, 0.4, 9)


def positions(tree, mechanism, rtol=1e-8):
    """Positions of all joints that uqmbd computes, shape (T, joint)."""
    found = uqmbd.simulate(mechanism, TIMES, rtol=rtol, check=False)
    return np.array([found[f"joint{k}"].values for k in range(len(tree.links))]).T


def require_laws_and_motion(seed, planar, by_joints):
    """Laws hold at every output time, and the motion is that of the equations in the independent joints."""
    tree = random_tree(seed, planar=planar)
    found = positions(tree, tree.mechanism(by_joints=by_joints))
    for k, link in enumerate(tree.links):
        if link.law is not None:
            np.testing.assert_allclose(found[:, k], [link.law(p) for p in found], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found, tree.motion(TIMES), rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", [11])
def test_a_small_planar_tree(seed):
    require_laws_and_motion(seed, planar=True, by_joints=False)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("planar", [True, False], ids=["planar", "spatial"])
@pytest.mark.parametrize("by_joints", [True, False], ids=["start conditions", "stated velocities"])
def test_random_trees(seed, planar, by_joints):
    require_laws_and_motion(seed, planar, by_joints)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 140))
@pytest.mark.parametrize("planar", [True, False], ids=["planar", "spatial"])
def test_many_random_trees(seed, planar):
    require_laws_and_motion(seed, planar, by_joints=bool(seed % 3))


def wheels(space, laws, drawn=(0.0, 0.0, 0.0), order=None, rates=()):
    """Three wheels on one axis; `laws` of wheel 0, 1, 2 are functions of the angles of all (None: it turns freely).

    Drivers are added in the given order; `rates` are stated of the free ones.
    """
    flat = space is uqmbd.Planar
    mechanism = uqmbd.Mechanism("wheels", space())
    axes = {} if flat else {"axis": (0, 0, 1)}
    origin = (0,) * (2 if flat else 3)
    bodies, joints = [], []
    for k, angle in enumerate(drawn):
        pose = {"angle": angle} if flat else {"quaternion": (np.cos(angle / 2), 0, 0, np.sin(angle / 2))}
        bodies.append(mechanism.body(f"w{k}", mass=1, inertia=k + 1 if flat else (3, 3, k + 1), **pose))
        joints.append(mechanism.add(Revolute(f"j{k}", mechanism.ground, bodies[k], at=origin, **axes)))
    angles = [joint.angle for joint in joints]
    for k in order or range(len(laws)):
        if laws[k] is not None:
            driver = RotationDriver(f"d{k}", mechanism.ground, bodies[k], angle=laws[k](angles), **axes)
            mechanism.add(driver)
    for k, rate in rates:
        mechanism.start(joints[k].speed, rate)
    for k, angle in enumerate(angles):
        mechanism.output(f"a{k}", angle, units="rad")
    return mechanism, angles


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_a_chain_in_any_order_of_declaration(space):
    """Wheel 2 follows wheel 1, which follows wheel 0: all turn at constant rates, over many turns."""
    laws = [None, lambda a: -2 * a[0] + 0.3, lambda a: 1.5 * a[1] - 0.2]
    for order in itertools.permutations(range(3)):
        mechanism, _ = wheels(space, laws, (0, 0.3, 0.25), order, rates=[(0, 5.0)])
        assert uqmbd.check(mechanism).mobility == 1
        found = uqmbd.simulate(mechanism, np.linspace(0, 4, 5), rtol=1e-9, check=False)
        first = 5 * found["time"].values
        np.testing.assert_allclose(found["a0"], first, rtol=0, atol=1e-6)
        np.testing.assert_allclose(found["a1"], -2 * first + 0.3, rtol=0, atol=1e-6)
        np.testing.assert_allclose(found["a2"], 1.5 * (-2 * first + 0.3) - 0.2, rtol=0, atol=1e-6)


def first_values(mechanism):
    """Angles at the start, and warnings of turns that are not counted."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = uqmbd.simulate(mechanism, [0, 1e-3], check=False)
    return [float(found[f"a{k}"][0]) for k in range(3)], [
        str(x.message) for x in said if "whole turns" in str(x.message)
    ]


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
@pytest.mark.parametrize("follower", [4.0, 4.0 - 2 * np.pi], ids=["a turn on", "within half a turn"])
def test_turns_that_a_follower_hides_are_reported(space, follower):
    """Wheel 1 turns twice as far as wheel 0, which is drawn at 2 rad: at 4 rad, or a whole turn away from the law."""
    laws = [None, lambda a: 2 * a[0], None]
    mechanism, _ = wheels(space, laws, (2.0, follower, 0.0))
    angles, said = first_values(mechanism)
    whole = follower if space is uqmbd.Planar else 4.0 - 2 * np.pi  # in space a body is drawn within half a turn
    np.testing.assert_allclose(angles[:2], [2.0, whole], rtol=0, atol=1e-9)
    if abs(whole - 4.0) < 1e-9:
        assert not said
    else:
        assert len(said) == 1
        assert (
            "driver 'd1' starts at 4 rad, more than half a turn from the angle of the given pose, -2.283 rad" in said[0]
        )
        assert "State j0.angle as well, which the driver follows" in said[0]


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_turns_of_a_follower_may_be_stated(space):
    laws = [None, lambda a: 2 * a[0], None]
    drawn = (2.0, 4.0 - 2 * np.pi, 0.0)
    for stated, expected, hidden in (
        ({0: 2.0, 1: 4.0}, (2.0, 4.0), False),
        ({0: 2.0}, (2.0, 4.0 - 2 * np.pi), True),
        ({1: 4.0}, (2.0 + np.pi, 4.0), True),  # it moves what it follows
        ({2: 1.0}, (2.0, 4.0 - 2 * np.pi), True),  # that of another wheel decides nothing
    ):
        mechanism, angles = wheels(space, laws, drawn)
        for k, value in stated.items():
            mechanism.start(angles[k], value)
        found, said = first_values(mechanism)
        np.testing.assert_allclose(found[:2], expected, rtol=0, atol=1e-9)
        assert bool(said) == hidden
    mechanism, angles = wheels(space, laws)  # turns that are made from the given pose on are counted of both
    mechanism.start(angles[0], 5.0)
    found, said = first_values(mechanism)
    np.testing.assert_allclose(found[:2], (5.0, 10.0), rtol=0, atol=1e-9)
    assert not said


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*assembly moved")
def test_turns_that_a_follower_hides_in_some_realisations():
    """A follower drawn at 0.5 rad turns k times as far as a wheel at 2 rad: half a turn away where 2 k = 0.5 + pi."""
    factor = uqmbd.RandomVariable("factor", chaospy.Uniform(1, 2))
    mechanism, angles = wheels(uqmbd.Spatial, [None, lambda a: factor * a[0], None], (2.0, 0.5, 0.0))
    mechanism.start(angles[0], 2.0)
    assert 2 - (0.5 + np.pi) / 2 == pytest.approx(0.179, abs=1e-3)
    with pytest.warns(uqmbd.StudyWarning, match=r"driver 'd1' starts at .* rad in 1[78] % of the realisations"):
        uqmbd.simulate(mechanism, [0, 1e-3], check=False)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*assembly moved")
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_laws_with_random_coefficients(seed):
    """All methods; each realisation of Monte Carlo against its own equations in the independent joints."""
    tree = random_tree(seed, planar=bool(seed % 2))
    laws, variables = {}, []
    for k, link in enumerate(tree.links):
        if link.law is not None:
            x = uqmbd.RandomVariable(f"c{k}", chaospy.Uniform(link.law.constant - 0.1, link.law.constant + 0.1))
            (joint, coefficients), *others = link.law.terms
            y = uqmbd.RandomVariable(f"m{k}", chaospy.Uniform(coefficients[0] - 0.1, coefficients[0] + 0.1))
            laws[k] = Law(x, ((joint, (y, *coefficients[1:])), *others)) if len(variables) < 2 else link.law
            variables += [x, y] if len(variables) < 2 else []
    methods = [Collocation(order=4), Galerkin(order=4), MonteCarlo(samples=128, seed=1, sampling="sobol")]
    mechanism = tree.mechanism(laws, by_joints=True)
    results = uqmbd.Study("s", mechanism, times=TIMES[::4], propagators=methods, rtol=1e-8).run()
    samples = results["monte-carlo/samples"]
    index = {str(name): k for k, name in enumerate(samples["input"].values)}
    for row, response in zip(samples["inputs"].values[:8], samples["response"].values[:8], strict=True):

        def given(x, row=row):
            return float(row[index[str(x)]]) if str(x) in index else float(x)

        links = list(tree.links)
        for k, law in laws.items():
            terms = tuple((j, tuple(map(given, cs))) for j, cs in law.terms)
            links[k] = replace(links[k], law=Law(given(law.constant), terms))
        expected = replace(tree, links=tuple(links)).motion(TIMES)[::4]
        order = [list(samples["output"].values).index(f"joint{k}") for k in range(len(links))]
        np.testing.assert_allclose(response[order].T, expected, rtol=0, atol=1e-6)
    statistics = [results[f"{label}/statistics"] for label in ("collocation", "galerkin", "monte-carlo")]
    size = float(statistics[0]["std"].max())
    for other, agree in zip(statistics[1:], (1e-4, 0.05), strict=True):
        np.testing.assert_allclose(other["mean"], statistics[0]["mean"], rtol=0, atol=agree * size)
        np.testing.assert_allclose(other["std"], statistics[0]["std"], rtol=0, atol=agree * size)


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_equilibrium_and_eigenfrequency_of_a_follower(space):
    """Two equal rods under gravity; one on a torsion spring turns by q, and the other one by 2 q."""
    flat = space is uqmbd.Planar
    gravity, rate, mass, arm, inertia = 9.81, 40.0, 1.0, 0.5, 0.1
    mechanism = uqmbd.Mechanism("rods", space(gravity=(0, -gravity) if flat else (0, -gravity, 0)))
    size = 2 if flat else 3
    axes = {} if flat else {"axis": (0, 0, 1)}
    joints, bodies = [], []
    for name in "ab":
        about = inertia if flat else (inertia,) * 3
        bodies.append(mechanism.body(name, mass=mass, inertia=about, position=(arm, 0, 0)[:size]))
        joints.append(mechanism.add(Revolute(f"j{name}", mechanism.ground, bodies[-1], at=(0, 0, 0)[:size], **axes)))
        mechanism.output(name, joints[-1].angle, units="rad")
    mechanism.add(RotationDriver("follow", mechanism.ground, bodies[1], angle=2 * joints[0].angle, **axes))
    mechanism.add(TorsionSpringDamper("spring", mechanism.ground, bodies[0], stiffness=rate, **axes))

    def moment(q):
        return rate * q + mass * gravity * arm * (np.cos(q) + 2 * np.cos(2 * q))

    q = brentq(moment, -1, 0, xtol=1e-14)
    found = uqmbd.static_equilibrium(mechanism)
    assert float(found["a"]) == pytest.approx(q, abs=1e-9)
    assert float(found["b"]) == pytest.approx(2 * q, abs=1e-9)
    stiffness = rate - mass * gravity * arm * (np.sin(q) + 4 * np.sin(2 * q))
    expected = np.sqrt(stiffness / (5 * (inertia + mass * arm**2))) / (2 * np.pi)
    (frequency,) = uqmbd.eigenfrequencies(mechanism)["frequency"].values
    assert frequency == pytest.approx(expected, rel=1e-7)
