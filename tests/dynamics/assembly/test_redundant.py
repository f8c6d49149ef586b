"""Reference case "Redundant constraints": chains of planar four-bars built from spatial revolutes."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import sympy
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Revolute

G, LENGTH, BASE, CRANK, COUPLER = 9.81, 0.4, 0.5, 1.2, 2.0
START = np.deg2rad(-40.0)  # of the cranks, from the horizontal


def chain(count, space):
    """`count` couplers on `count + 1` parallel cranks in the x-y plane, gravity along -y."""
    spatial = space == "spatial"
    mechanism = uqmbd.Mechanism(
        f"chain{count}", uqmbd.Spatial(gravity=(0, -G, 0)) if spatial else uqmbd.Planar(gravity=(0, -G))
    )
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)} if spatial else {}

    def at(x, y=0.0):
        return (x, y, 0) if spatial else (x, y)

    def pose(angle):
        return {"quaternion": (np.cos(angle / 2), 0, 0, np.sin(angle / 2))} if spatial else {"angle": angle}

    def inertia(mass, length):
        uniform = mass * length**2 / 12
        return (uniform / 50, uniform, uniform) if spatial else uniform

    tip = LENGTH * np.array([np.cos(START), np.sin(START)])
    cranks = []
    for k in range(count + 1):
        middle = at(k * BASE + tip[0] / 2, tip[1] / 2)
        crank = mechanism.body(f"crank{k}", mass=CRANK, inertia=inertia(CRANK, LENGTH), position=middle, **pose(START))
        mechanism.add(Revolute(f"A{k}", mechanism.ground, crank, at(k * BASE), at(-LENGTH / 2), **axes))
        cranks.append(crank)
    for k in range(count):
        middle = at((k + 0.5) * BASE + tip[0], tip[1])
        coupler = mechanism.body(f"coupler{k}", mass=COUPLER, inertia=inertia(COUPLER, BASE), position=middle)
        mechanism.add(Revolute(f"B{k}", cranks[k], coupler, at(LENGTH / 2), at(-BASE / 2), **axes))
        mechanism.add(Revolute(f"C{k}", coupler, cranks[k + 1], at(BASE / 2), at(LENGTH / 2), **axes))
    mechanism.output("x", 2 * cranks[0].position[0])
    mechanism.output("y", 2 * cranks[0].position[1])
    mechanism.output("last_y", 2 * cranks[-1].position[1])
    mechanism.output("coupler_vx", coupler.velocity[0])
    return mechanism


def closed_form(count, times):
    """Angle of the cranks: the couplers only translate, so the chain is a pendulum (elliptic functions)."""
    inertia = (count + 1) * CRANK * LENGTH**2 / 3 + count * COUPLER * LENGTH**2
    moment = (count + 1) * CRANK * LENGTH / 2 + count * COUPLER * LENGTH
    k = np.sin((START + np.pi / 2) / 2)
    sn, *_ = ellipj(ellipk(k**2) - np.sqrt(G * moment / inertia) * np.asarray(times), k**2)
    return 2 * np.arcsin(k * sn) - np.pi / 2


@pytest.mark.thorough
@pytest.mark.parametrize(("count", "equations", "rank"), [(1, 20, 17), (2, 35, 29), (5, 80, 65)])
def test_counts_of_equations_rank_and_mobility(count, equations, rank):
    """The published counts; each body adds the unit norm of its quaternion to both."""
    found = uqmbd.check(chain(count, "spatial"))
    bodies = 2 * count + 1
    assert found.equations == equations + bodies
    assert found.rank == rank + bodies
    assert len(found.redundant) == equations - rank
    assert found.mobility == 1


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, 2, 5])
def test_redundant_equations_are_named_in_the_warning(count):
    mechanism = chain(count, "spatial")
    names = uqmbd.check(mechanism).redundant
    joints = set(mechanism.components)
    assert all(name.split(":")[0] in joints for name in names)
    with pytest.warns(uqmbd.RedundantConstraintWarning) as caught:
        uqmbd.simulate(mechanism, [0, 0.01])
    text = str(caught[0].message)
    assert all(name in text for name in names)


@pytest.mark.thorough
def test_planar_chain_does_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        uqmbd.simulate(chain(1, "planar"), [0, 0.01])


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, 2, 5])
def test_chain_runs_unmodified_and_agrees_with_the_planar_model(count, close):
    times = np.linspace(0, 2, 41)
    planar = uqmbd.simulate(chain(count, "planar"), times, rtol=1e-8)
    with pytest.warns(uqmbd.RedundantConstraintWarning):
        spatial = uqmbd.simulate(chain(count, "spatial"), times, rtol=1e-8)
    angle = closed_form(count, times)
    for data in (planar, spatial):
        close(data.x, LENGTH * np.cos(angle))
        close(data.y, LENGTH * np.sin(angle))
        close(data.last_y, LENGTH * np.sin(angle))
    for name in planar.data_vars:
        close(spatial[name], planar[name], what=name)


@pytest.mark.thorough
@pytest.mark.parametrize(("count", "space"), [(1, "planar"), (1, "spatial"), (2, "spatial"), (5, "spatial")])
@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
def test_energy_of_the_chain_is_kept(count, space, energy):
    kinetic, potential = energy(chain(count, space), np.linspace(0, 2, 41))
    total = kinetic + potential
    assert kinetic.max() > 1
    assert np.abs(total - total[0]).max() < 1e-5 * kinetic.max()


def three_cranks(length):
    """One rigid coupler on three parallel cranks: redundant as long as the middle one is as long as the others."""
    mechanism = uqmbd.Mechanism("three_cranks", uqmbd.Planar(gravity=(0, -G)))
    angle = -1.0
    tip = (LENGTH * np.cos(angle), LENGTH * np.sin(angle))
    coupler = mechanism.body("coupler", mass=1, inertia=0.1, position=(BASE + tip[0], tip[1]))
    for k, radius in enumerate((LENGTH, length, LENGTH)):
        crank = mechanism.body(f"crank{k}", mass=1, inertia=0.01, position=(k * BASE, 0), angle=angle)
        mechanism.add(Revolute(f"A{k}", mechanism.ground, crank, (k * BASE, 0), (0, 0)))
        mechanism.add(Revolute(f"B{k}", crank, coupler, (radius, 0), ((k - 1) * BASE, 0)))
    mechanism.output("y", coupler.position[1])
    return mechanism


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
def test_random_length_that_breaks_a_redundant_loop_is_refused():
    """Redundant at the mean, infeasible beside it: the residual of a dropped equation is watched."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(LENGTH, 0.01), units="m")
    mechanism = three_cranks(length)
    found = uqmbd.check(mechanism)
    assert (found.mobility, len(found.redundant)) == (1, 1)
    uqmbd.simulate(mechanism, [0, 0.2])
    with pytest.raises(uqmbd.AssemblyError, match=r"[AB]\d"):
        uqmbd.simulate(mechanism, [0, 0.2], values={"length": LENGTH + 0.01})


@pytest.mark.parametrize("size", [100.0, 1.0, 1e-3, 1e-5])
@pytest.mark.parametrize(("ratio", "rtol"), [(1.5, 1e-6), (1.001, 1e-6), (1.0001, 1e-8)])
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_drivers_that_contradict_each_other_later_are_reported_at_any_size(size, ratio, rtol, integrator):
    """At the start, and until 1 s, one of them is redundant; the check knows the size of the mechanism."""
    mechanism = uqmbd.Mechanism("two", uqmbd.Translational())
    body = mechanism.body("body", mass=1, position=(0, 0))
    mechanism.output("x", body.position[0], units="m")
    late = size * sympy.Max(0, uqmbd.t - 1) ** 3
    for name, displacement in (("first", size + late), ("second", size + ratio * late)):
        mechanism.add(PositionDriver(name, mechanism.ground, body, (-size, 0), (0, 0), (1, 0), displacement))
    with (
        pytest.warns(uqmbd.RedundantConstraintWarning),
        pytest.raises(uqmbd.IntegrationError, match="'second: displacement', omitted as redundant .* contradict"),
    ):
        uqmbd.simulate(mechanism, np.linspace(0, 2, 11), rtol=rtol, integrator=integrator)
