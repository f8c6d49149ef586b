"""Singular poses, equations that become dependent on the way, mechanisms that lock up, reactions that are not unique.

The chains of parallelograms are the IFToMM benchmark "N four-bar mechanism" (A02): bars of 1 m and 1 kg, cranks upright,
1 m/s.  As long as they stay parallelograms they have one degree of freedom, whose equation SciPy integrates.
"""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo

G = 9.81
redundant = pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")


def windows(count, space="planar", speed=1.0, angle=np.pi / 2, mass=1.0):
    """`count` square windows of bars of 1 m; the mass of the first crank and the speed may be random."""
    spatial = space == "spatial"
    mechanism = uqmbd.Mechanism("windows", uqmbd.Spatial((0, -G, 0)) if spatial else uqmbd.Planar((0, -G)))
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)} if spatial else {}
    tip = np.array([np.cos(angle), np.sin(angle)])

    def at(x, y=0.0):
        return (x, y, 0) if spatial else (x, y)

    def bar(name, x, y, angle, mass=1.0, **more):
        turned = {"quaternion": (np.cos(angle / 2), 0, 0, np.sin(angle / 2))} if spatial else {"angle": angle}
        inertia = (mass / 600, mass / 12, mass / 12) if spatial else mass / 12
        return mechanism.body(name, mass=mass, inertia=inertia, position=at(x, y), **turned, **more)

    cranks = []
    for k in range(count + 1):
        spin = {"angular_velocity": (0, 0, -speed) if spatial else -speed} if k == 0 else {}
        crank = bar(f"crank{k}", k + tip[0] / 2, tip[1] / 2, angle, mass if k == 0 else 1.0, **spin)
        mechanism.add(Revolute(f"A{k}", mechanism.ground, crank, at(k), at(-0.5), **axes))
        cranks.append(crank)
    for k in range(count):
        coupler = bar(f"coupler{k}", k + 0.5 + tip[0], tip[1], 0.0)
        mechanism.add(Revolute(f"B{k}", cranks[k], coupler, at(0.5), at(-0.5), **axes))
        mechanism.add(Revolute(f"C{k}", coupler, cranks[k + 1], at(0.5), at(0.5), **axes))
    mechanism.output("x", 2 * cranks[0].position[0], units="m")
    mechanism.output("y", 2 * cranks[0].position[1], units="m")
    mechanism.output("last_y", 2 * cranks[-1].position[1], units="m")
    return mechanism


def parallelograms(count, times, speed=1.0, mass=1.0, angle=np.pi / 2):
    """Angle of the cranks of `windows`, by the equation of one degree of freedom."""
    inertia = (count + mass) / 3 + count
    moment = (count + mass) / 2 + count
    found = solve_ivp(
        lambda t, y: [y[1], -G * moment / inertia * np.cos(y[0])],
        (times[0], times[-1]),
        [angle, -speed],
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=1e-12,
    )
    return found.y[0]


@pytest.mark.thorough
@pytest.mark.parametrize(("space", "integrator"), [("planar", "auto"), ("spatial", "auto"), ("planar", "ida")])
@redundant
def test_two_windows_pass_their_singular_poses(space, integrator, energy):
    """Twice in every turn all bars are in line."""
    times = np.linspace(0, 10, 501)
    data = uqmbd.simulate(windows(2, space), times, rtol=1e-6 if integrator == "auto" else 1e-8, integrator=integrator)
    angle = parallelograms(2, times)
    assert np.ptp(angle) > 8 * np.pi
    np.testing.assert_allclose(data.last_y, data.y, rtol=0, atol=1e-6)
    np.testing.assert_allclose(data.x, np.cos(angle), rtol=0, atol=2e-3)
    np.testing.assert_allclose(data.y, np.sin(angle), rtol=0, atol=2e-3)
    if integrator == "auto":
        kinetic, potential = energy(windows(2, space), times)
        total = kinetic + potential
        assert np.abs(total - total[0]).max() < 0.1  # what the benchmark asks for
        assert np.abs(total - total[0]).max() < 2e-3


def random_windows(count, times, rtol):
    """Motions of `count` four-bars with random speeds and masses, the angles by one degree of freedom, energies."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.3, 3), units="rad/s")
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.3, 6), units="kg")
    model = build(windows(1, speed=speed, mass=mass))
    rng = np.random.default_rng(1)
    by_name = {"speed": rng.uniform(0.3, 3, count), "mass": rng.uniform(0.3, 6, count)}
    ensemble = Ensemble(model, np.stack([by_name[name] for name in model.inputs], axis=1))
    found = integrate(ensemble, times, rtol, method="dop853")
    assert not any(found.messages)
    angles = [parallelograms(1, times, v, m) for v, m in zip(by_name["speed"], by_name["mass"], strict=True)]
    energy = ensemble.energies(times, found.states).sum(axis=1)
    return ensemble.outputs(times, found.states), np.array(angles), energy, found.counters


@pytest.mark.thorough
def test_dense_output_over_singular_poses():
    """States within a step over a pose, where interpolation is poor, are those of the motion, too."""
    response, angles, *_ = random_windows(12, np.linspace(0, 6, 1201), 1e-6)
    np.testing.assert_allclose(response[:, 1], np.sin(angles), rtol=0, atol=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-9, 1e-11))])
def test_every_realisation_stays_on_its_branch(rtol):
    """Unequal cranks load the coupler in the singular pose; wherever a step ends, momentum decides."""
    response, angles, energy, _ = random_windows(24, np.linspace(0, 6, 121), rtol)
    # an error of the energy at the start is an error of the phase in the end
    np.testing.assert_allclose(response[:, 1], np.sin(angles), rtol=0, atol=max(1e-7, 600 * rtol))
    np.testing.assert_allclose(response[:, 2], response[:, 1], rtol=0, atol=max(1e-8, 100 * rtol))
    assert np.abs(energy - energy[:, :1]).max() < max(1e-7, 1000 * rtol)


@pytest.mark.thorough
def test_motions_are_continued_over_singular_poses():
    """With a tight tolerance steps end so near the pose that it must be passed over by continuation."""
    response, angles, energy, counters = random_windows(6, np.linspace(0, 6, 121), 1e-11)
    assert counters.passages > 0
    np.testing.assert_allclose(response[:, 1], np.sin(angles), rtol=0, atol=1e-7)
    np.testing.assert_allclose(response[:, 2], response[:, 1], rtol=0, atol=1e-8)
    assert np.abs(energy - energy[:, :1]).max() < 1e-7


@pytest.mark.parametrize("integrator", ["auto", "ida"])
@pytest.mark.parametrize("speed", [0.0, 1.0])
@redundant
def test_a_drawn_pose_that_is_singular_is_named(integrator, speed):
    """All bars in line: whether the cranks will be parallel or not is not said; no motion is made up."""
    with pytest.raises(
        uqmbd.IntegrationError, match="'C0: point x'.*the given pose is singular.*farther along the motion"
    ):
        uqmbd.simulate(windows(1, speed=speed, angle=0.0), np.linspace(0, 1, 11), integrator=integrator)


@pytest.mark.parametrize("integrator", ["auto", "ida"])
def test_a_drawn_pose_may_be_next_to_a_singular_one(integrator):
    """From there the singular pose is passed at once."""
    times = np.linspace(0, 1, 11)
    for angle in (1e-4, 1e-2):
        data = uqmbd.simulate(windows(1, angle=angle), times, rtol=1e-8, integrator=integrator)
        np.testing.assert_allclose(data.y, np.sin(parallelograms(1, times, angle=angle)), rtol=0, atol=1e-5)
        np.testing.assert_allclose(data.last_y, data.y, rtol=0, atol=1e-5)


def locomotive(spin):
    """Three parallel cranks with a triangle as coupler: redundant, and never singular."""
    mechanism = uqmbd.Mechanism("locomotive", uqmbd.Planar(gravity=(0, -G)))
    coupler = mechanism.body("coupler", mass=1, inertia=0.1, position=(0.4 * np.cos(1), -0.4 * np.sin(1)))
    for k, point in enumerate([(0, 0), (1, 0), (0.5, 0.6)]):
        given = {"angular_velocity": spin} if k == 0 else {}
        crank = mechanism.body(f"crank{k}", mass=1, inertia=0.01, position=point, angle=-1.0, **given)
        mechanism.add(Revolute(f"A{k}", mechanism.ground, crank, point, (0, 0)))
        mechanism.add(Revolute(f"B{k}", crank, coupler, (0.4, 0), point))
    mechanism.output("x", coupler.position[0], units="m")
    mechanism.output("force", mechanism.components["B2"].reaction_force[0], units="N")
    return mechanism


def crank_angle(spin, times):
    """Angle of the cranks of `locomotive`, by the equation of one degree of freedom."""
    found = solve_ivp(
        lambda t, y: [y[1], -G * 0.4 / (0.03 + 0.16) * np.cos(y[0])],
        (times[0], times[-1]),
        [-1.0, spin],
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=1e-12,
    )
    return found.y[0]


def test_other_equations_are_chosen_where_the_kept_ones_become_dependent():
    times = np.linspace(0, 1.5, 31)
    with pytest.warns(uqmbd.RedundantConstraintWarning) as caught:
        data = uqmbd.simulate(locomotive(-12.0), times, rtol=1e-9)
    texts = [str(w.message) for w in caught]
    assert any("become dependent" in x and "are used instead of 'B" in x for x in texts)
    np.testing.assert_allclose(data.x, 0.4 * np.cos(crank_angle(-12.0, times)), rtol=0, atol=1e-6)


@redundant
@pytest.mark.parametrize("spin", [-15.0, -12.0, -8.0])
def test_every_equation_may_be_kept_again_after_another_change(spin):
    """Whatever was left out before may be needed now, however often the equations change."""
    times = np.linspace(0, 6, 61)
    ensemble = Ensemble(build(locomotive(spin)), np.zeros((1, 0)))
    found = integrate(ensemble, times, 1e-11, method="dop853")
    assert found.messages == ("",)
    assert found.counters.repivots > 5
    assert found.counters.steps < 1000
    x = ensemble.outputs(times, found.states)[0, 0]
    np.testing.assert_allclose(x, 0.4 * np.cos(crank_angle(spin, times)), rtol=0, atol=1e-8)


@redundant
def test_the_change_is_counted():
    found = integrate(Ensemble(build(locomotive(-12.0)), np.zeros((1, 0))), np.linspace(0, 4, 5), 1e-9, method="dop853")
    assert found.counters.repivots == len(found.notes) > 0
    assert all(note.startswith("at t = ") for note in found.notes)


@redundant
def test_output_times_before_and_between_changes_are_on_the_constraints():
    """Whoever integrated up to a change of the equations has put its states onto them, too."""
    mechanism = locomotive(-12.0)
    coupler = mechanism.bodies["coupler"]
    for k, point in enumerate([(0, 0), (1, 0), (0.5, 0.6)]):
        gap = coupler.point(point) - mechanism.bodies[f"crank{k}"].point((0.4, 0))
        mechanism.output(f"gap{k}", gap[0], units="m")
        mechanism.output(f"rise{k}", gap[1], units="m")
    ensemble, times = Ensemble(build(mechanism), np.zeros((1, 0))), np.linspace(0, 6, 601)
    found = integrate(ensemble, times, 1e-6, "dop853")
    assert not found.messages[0] and found.counters.repivots > 1
    gaps = ensemble.outputs(times, found.states)[0, 2:]
    assert np.abs(gaps).max() < 1e-7  # a tenth of the tolerance


def slider_crank(rod):
    """A driven crank of 0.2 m and a slider 0.3 m off its axis: turns fully if the rod is longer than 0.5 m."""
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -G)))
    crank = mechanism.body("crank", mass=1, inertia=0.01, angle=-0.5)
    tip = (0.2 * np.cos(0.5), -0.2 * np.sin(0.5))
    body = mechanism.body("rod", mass=1, inertia=0.01, position=tip, angle=-0.6)
    slider = mechanism.body("slider", mass=1, inertia=0.01, position=(tip[0] + 0.3, -0.3))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, body, (0.2, 0), (0, 0)))
    mechanism.add(Revolute("C", body, slider, (rod, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, slider, (0, -0.3), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, crank, -0.5 + 2 * uqmbd.t))
    mechanism.output("x", slider.position[0], units="m")
    return mechanism


@pytest.mark.parametrize("integrator", ["auto", "dop853", "ida"])
def test_a_short_rod_locks_up_with_time_and_joints(integrator, capfd):
    """The rod is upright, and can reach no farther, when 0.3 m + 0.2 m sin(angle) = 0.35 m."""
    when = (np.arcsin(0.05 / 0.2) + 0.5) / 2
    with pytest.raises(uqmbd.IntegrationError, match="locks up") as caught:
        uqmbd.simulate(slider_crank(0.35), np.linspace(0, 3, 61), integrator=integrator)
    text = str(caught.value)
    assert f"t = {when:.4g}" in text
    assert "'drive'" in text
    assert "'C'" in text
    assert "'guide'" in text


def test_a_four_bar_without_a_full_turn_locks_up():
    """Crank 0.6, coupler and rocker 0.5 on a base of 1: stretched when the diagonal is 1."""
    mechanism = uqmbd.Mechanism("four_bar", uqmbd.Planar(gravity=(0, -G)))
    crank = mechanism.body("crank", mass=1, inertia=0.01, angle=0.3)
    tip = (0.6 * np.cos(0.3), 0.6 * np.sin(0.3))
    coupler = mechanism.body("coupler", mass=1, inertia=0.01, position=tip, angle=0.7)
    rocker = mechanism.body("rocker", mass=1, inertia=0.01, position=(1, 0), angle=2.0)
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, coupler, (0.6, 0), (0, 0)))
    mechanism.add(Revolute("C", coupler, rocker, (0.5, 0), (0.5, 0)))
    mechanism.add(Revolute("D", mechanism.ground, rocker, (1, 0), (0, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, crank, 0.3 + 2 * uqmbd.t))
    mechanism.output("x", coupler.position[0], units="m")
    when = (np.arccos((0.6**2 + 1 - 1) / (2 * 0.6)) - 0.3) / 2
    with pytest.raises(uqmbd.IntegrationError, match=rf"t = {when:.5g}.*locks up.*'B: point x'.*'drive'"):
        uqmbd.simulate(mechanism, np.linspace(0, 3, 61))


@pytest.mark.thorough
def test_a_realisation_that_locks_up_leaves_the_others_alone():
    rod = uqmbd.RandomVariable("rod", chaospy.Uniform(0.4, 0.7), units="m")
    mechanism, times = slider_crank(rod), np.linspace(0, 3, 31)
    model, lengths = build(mechanism), np.array([0.42, 0.55, 0.46, 0.65])
    ensemble = Ensemble(model, lengths[:, None])
    found = integrate(ensemble, times)
    assert [bool(message) for message in found.messages] == [True, False, True, False]
    assert all("locks up" in found.messages[k] for k in (0, 2))
    # nothing but the time of its dead point is lost
    assert np.isfinite(found.states[0, 0]).all()
    angle = -0.5 + 2 * times
    for k in (1, 3):
        expected = 0.2 * np.cos(angle) + np.sqrt(lengths[k] ** 2 - (0.3 + 0.2 * np.sin(angle)) ** 2)
        seen = ensemble.select(np.array([k])).outputs(times, found.states[[k]])[0, 0]
        np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-6)


@pytest.mark.thorough
def test_monte_carlo_counts_what_locks_up():
    rod = uqmbd.RandomVariable("rod", chaospy.Uniform(0.48, 0.7), units="m")
    mechanism = slider_crank(rod)
    study = uqmbd.Study("lock", mechanism, times=np.linspace(0, 2, 9), propagators=[MonteCarlo(samples=40, seed=3)])
    with pytest.warns(UserWarning, match="realisations failed; .*locks up"):
        node = study.propagate(study.propagators[0])
    locked = int((node["samples"]["inputs"].sel(input="rod") < 0.5).sum())
    assert 0 < locked < 10
    assert int(node.attrs["failures"]) == locked


@pytest.mark.thorough
@redundant
def test_reactions_out_of_the_plane_are_not_unique():
    """In a planar mechanism of spatial revolutes forces along the axes and moments across them have no unique value."""
    mechanism = windows(1, "spatial", angle=1.0)
    pin = mechanism.components["A0"]
    for k in range(3):
        mechanism.output(f"force{k}", pin.reaction_force[k], units="N")
        mechanism.output(f"moment{k}", pin.reaction_moment[k], units="N m")
    expected = {f"{j}.reaction_{x}" for j in mechanism.components for x in ("force[2]", "moment[0]", "moment[1]")}
    assert set(uqmbd.check(mechanism).not_unique) == expected
    data = uqmbd.simulate(mechanism, [0, 0.1])
    assert set(data.attrs["not_unique"].split(", ")) == {"force2", "moment0", "moment1"}
    planar = windows(1, angle=1.0)
    for k in range(2):
        planar.output(f"force{k}", planar.components["A0"].reaction_force[k], units="N")
    same = uqmbd.simulate(planar, [0, 0.1])
    assert "not_unique" not in same.attrs
    assert not uqmbd.check(planar).not_unique
    for k in range(2):  # what is not flagged is the reaction of the planar mechanism
        np.testing.assert_allclose(data[f"force{k}"], same[f"force{k}"], rtol=1e-5)


@redundant
def test_forces_along_three_cranks_are_not_unique():
    mechanism = locomotive(-1.0)
    names = uqmbd.check(mechanism).not_unique
    assert {x.split(".")[0] for x in names} == set(mechanism.components)
    assert all("force" in x for x in names)  # a pin transmits no moment, redundant or not


@pytest.mark.thorough
@redundant
def test_all_methods_run_on_a_redundant_spatial_four_bar():
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.6), units="kg")
    mechanism = windows(1, "spatial", angle=-1.0, mass=mass, speed=0.5)
    # a number that varies, and contains a force that is not unique
    mechanism.output(
        "mixed", mechanism.components["A0"].reaction_force[2] + 10 * mechanism.bodies["crank0"].position[1]
    )
    methods = [MonteCarlo(samples=16, seed=1), Collocation(order=2), Galerkin(order=2)]
    tree = uqmbd.Study("four_bar", mechanism, times=np.linspace(0, 0.5, 6), propagators=methods).run()
    collocation, galerkin = (tree[x]["statistics"]["std"] for x in ("collocation", "galerkin"))
    seen = collocation.sel(output="y").max()
    assert seen > 1e-4
    np.testing.assert_allclose(galerkin.sel(output="y"), collocation.sel(output="y"), rtol=0, atol=1e-3 * float(seen))
    for method in ("monte-carlo", "collocation", "galerkin"):
        assert tree[method].attrs["not_unique"] == "mixed"
        assert int(tree[method].attrs["failures"]) == 0
