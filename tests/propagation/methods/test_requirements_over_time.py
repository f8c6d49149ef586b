"""Requirements over time: they hold between the output times, too, and tell when they were violated first."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import sympy
from scipy.special import ndtr

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


def oscillator():
    """A mass of 2 kg on a spring of random stiffness k, let go at 1 m: x = cos(w t) with w = sqrt(k / 2)."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(6, 10), units="N/m")
    mass = mechanism.body("mass", mass=2, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    return mechanism, mass.position[0]


def margins(mechanism, times, stiffness=(6.0, 8.0, 9.5)):
    problem = uqmbd.Study("s", mechanism, times).problem(MonteCarlo())
    return problem.margins(np.array(stiffness)[:, None])


def test_the_smallest_margin_is_found_between_two_output_times():
    mechanism, x = oscillator()
    mechanism.require("left", x >= -0.9)
    mechanism.require("right", x <= 2)
    found = margins(mechanism, [0, 2.5])  # all of them reach -1 before
    assert found.values == pytest.approx(np.array([[-0.1, 1.0]] * 3), abs=1e-5)
    assert found.running[:, :, 0] == pytest.approx(np.array([[1.9, 1.0]] * 3))


def test_the_first_passage_is_that_of_the_closed_form():
    mechanism, x = oscillator()
    mechanism.require("right of the middle", x >= 0)
    times = np.linspace(0, 1.2, 25)
    study = uqmbd.Study("s", mechanism, times)
    data = study.propagate(MonteCarlo(samples=200, seed=3))["requirements"].to_dataset()
    inputs = study.problem(MonteCarlo()).inputs.from_uniform(np.random.default_rng(0).random((1, 1)))
    assert inputs.shape == (1, 1)
    first = np.pi / 2 / np.sqrt(np.array([6.0, 10.0]) / 2)  # latest and earliest
    by = data["violated_by"].values[0]
    assert np.all(by[times < first[1] - 1e-6] == 0) and np.all(by[times > first[0] + 1e-6] == 1)
    middle = (times > first[1]) & (times < first[0])
    exact = (10 - 2 * (np.pi / 2 / times[middle]) ** 2) / 4
    assert np.all(np.abs(by[middle] - exact) < 4 * np.sqrt(0.25 / 200))
    smooth = study.propagate(Collocation(order=6))["requirements"].to_dataset()["violated_by"].values[0]
    assert smooth[middle] == pytest.approx(exact, abs=5e-3)


def test_a_limit_of_the_largest_value_is_one_at_all_times():
    mechanism, x = oscillator()
    limit = uqmbd.RandomVariable("limit", chaospy.Normal(2, 0.1))
    stated = {
        "largest": uqmbd.maximum(x) <= limit, "smallest": uqmbd.minimum(x) >= -0.9, "turned": 0.9 >= -uqmbd.minimum(x),
        "scaled": 2 * uqmbd.maximum(x) - 1 < limit,
    }  # fmt: skip
    for name, relation in stated.items():
        mechanism.require(name, relation)
    alike = {"largest": limit - x, "smallest": x + 0.9, "turned": x + 0.9, "scaled": limit + 1 - 2 * x}
    assert all(one.over_time for one in mechanism.requirements.values())
    assert {
        name: (margin.expression - alike[name]).simplify() for name, margin in mechanism.margins.items()
    } == dict.fromkeys(stated, 0)
    assert mechanism.requirements["smallest"].relation == "minimum(mass.x) >= -0.9"
    once = {
        "at least once": uqmbd.maximum(x) >= 0.5, "stroke": uqmbd.maximum(x) - uqmbd.minimum(x) <= 2,
        "of the frequency": uqmbd.maximum(x) <= 1.0 * uqmbd.eigenfrequency(1),
    }  # fmt: skip
    for name, relation in once.items():
        mechanism.require(name, relation)
        assert not mechanism.requirements[name].over_time


def test_what_sums_the_motion_up_is_known_at_its_end():
    mechanism, x = oscillator()
    mechanism.require("stroke", uqmbd.maximum(x) - uqmbd.minimum(x) <= 1.9)
    found = margins(mechanism, [0, 1, 2.5])
    assert found.values[:, 0] == pytest.approx(-0.1, abs=1e-5) and np.all(np.isinf(found.running[:, 0, :-1]))
    study = uqmbd.Study("s", mechanism, [0, 1, 2.5])
    for method in (MonteCarlo(samples=20, seed=1), Collocation(order=2)):
        data = study.propagate(method)["requirements"].to_dataset()
        assert data["violated_by"].values.tolist() == [[0, 0, 1]], method.node_name


def test_what_does_not_happen_is_late_and_not_soon():
    """At 1 s, x <= -0.5 has been reached where the stiffness is above 2 (2 pi / 3)^2 = 8.77 N/m."""
    mechanism, x = oscillator()
    reached = uqmbd.first_time(x <= -0.5)
    mechanism.require("late", reached >= 0.99)
    mechanism.require("soon", reached <= 0.97)
    found = margins(mechanism, [0, 1])
    assert not found.failed.any()
    when = np.pi * 2 / 3 / np.sqrt(9.5 / 2)
    assert found.values[:, 0] == pytest.approx([0.01, 0.01, when - 0.99], abs=1e-6)
    assert found.values[:, 1] == pytest.approx([-0.03, -0.03, 0.97 - when], abs=1e-6)
    mechanism.require("not known", reached <= 1.5)
    found = margins(mechanism, [0, 1])
    assert found.failed.tolist() == [True, True, False]
    assert "requirement 'not known': a first time in it does not occur by the last output time" in found.messages[0]
    with pytest.warns(UserWarning, match="27 of 50 realisations failed"):
        node = uqmbd.Study("s", mechanism, [0, 1]).propagate(MonteCarlo(samples=50, seed=1, max_failures=1))
    data = node["requirements"].to_dataset()
    low, high = data["interval"].sel(requirement="not known").values
    assert data.attrs["failed"] > 10 and low == 0 and high > data.attrs["failed"] / 50


@pytest.mark.thorough
def test_both_sides_of_an_impact_count():
    """A ball rebounds at 0.9 of its speed: it falls fastest right before the impact, rises fastest right after it."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -10)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    ball = mechanism.body("ball", mass=1, position=(0, height))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.9))
    mechanism.require("falls", ball.velocity[1] >= -4.4)
    mechanism.require("rises", ball.velocity[1] <= 4)
    values = np.array([[0.95], [1.05]])
    found = uqmbd.Study("s", mechanism, [0, 0.3, 0.7]).problem(MonteCarlo()).margins(values)
    speed = np.sqrt(20 * values[:, 0])
    assert found.values == pytest.approx(np.stack([4.4 - speed, 4 - 0.9 * speed], axis=1), abs=1e-6)
    assert found.running[:, :, 1] == pytest.approx(np.array([[1.4, 4.0]] * 2), abs=1e-6)


def slider_crank():
    """Turn a slider-crank once at about 60 rad/s; the force at its piston pin is limited."""
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0.0, -9.81)))
    crank_length = uqmbd.RandomVariable("crank_length", chaospy.Normal(0.15, 0.001), units="m")
    rod_length = uqmbd.RandomVariable("rod_length", chaospy.Normal(0.35, 0.001), units="m")
    slider_mass = uqmbd.RandomVariable("slider_mass", chaospy.Normal(0.5, 0.01), units="kg")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(60, 1.2), units="rad/s")
    pin_y = crank_length * sympy.sin(1.0)
    angle = -sympy.asin(pin_y / rod_length)
    pin_x = crank_length * sympy.cos(1.0)
    x = pin_x + rod_length * sympy.cos(angle)
    crank = mechanism.body("crank", mass=0.36, inertia=0.001, position=(pin_x / 2, pin_y / 2), angle=1.0)
    rod = mechanism.body("rod", mass=0.15, inertia=0.0015, position=((pin_x + x) / 2, pin_y / 2), angle=angle)
    slider = mechanism.body("slider", mass=slider_mass, inertia=1e-4, position=(x, 0))
    ground = mechanism.ground
    mechanism.add(Revolute("bearing", ground, crank, (0, 0), (-crank_length / 2, 0)))
    mechanism.add(Revolute("crank_pin", crank, rod, (crank_length / 2, 0), (-rod_length / 2, 0)))
    pin = mechanism.add(Revolute("piston_pin", rod, slider, (rod_length / 2, 0), (0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("drive", ground, crank, angle=1.0 + speed * uqmbd.t))
    mechanism.require("overload", sympy.Abs(pin.reaction_force[0]) <= 415)
    return uqmbd.Study("pin force", mechanism, [0, 0.12])


@pytest.mark.slow
def test_a_surrogate_of_64_realisations_agrees_with_20000_real_ones():
    study = slider_crank()
    node = study.propagate(Collocation(order=2, method="regression", samples=48, verify=16))
    found = node["requirements"].to_dataset().isel(requirement=0)
    assert node.attrs["realisations"] == 64
    counted = study.propagate(MonteCarlo(samples=20_000, seed=1))["requirements"].to_dataset().isel(requirement=0)
    low, high = counted["interval"].values
    assert low <= found["violation_probability"] <= high
    below, above = found["interval"].values
    assert below <= counted["violation_probability"] <= above and above - below < 0.01
    # a naive one, of first order and from few realisations, is wrong and says so
    naive = study.propagate(Collocation(order=1, method="regression", samples=8, verify=4))["requirements"].to_dataset()
    below, above = naive["interval"].values[0]
    assert below <= counted["violation_probability"] <= above and above - below > 5 * (high - low)


def test_each_requirement_knows_by_itself_when_it_is_known():
    mechanism, x = oscillator()
    mechanism.require("stroke", uqmbd.maximum(x) - uqmbd.minimum(x) <= 1.9)
    mechanism.require("stiff", uqmbd.eigenfrequency(1) >= 0.3)
    running = margins(mechanism, [0, 1, 2.5]).running
    assert np.isinf(running[:, 0, :-1]).all() and np.isfinite(running[:, 1]).all()


def test_a_reaction_that_redundant_constraints_leave_open_has_no_limit():
    mechanism = uqmbd.Mechanism("door", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    weight = uqmbd.RandomVariable("weight", chaospy.Uniform(1, 2))
    door = mechanism.body("door", mass=weight, inertia=(1, 1, 1), position=(0.5, 0, 0))
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    lower, _ = (
        mechanism.add(Revolute(n, mechanism.ground, door, (0, 0, z), (-0.5, 0, z), **axes))
        for n, z in (("lower", -1), ("upper", 1))
    )
    mechanism.require("hinge", lower.reaction_force[2] <= 10)
    mechanism.require("angle", door.position[0] >= 0)
    found = uqmbd.findings(uqmbd.Study("s", mechanism, [0, 0.1]))
    assert any("requirement 'hinge' limits a reaction that redundant constraints leave" in x.message for x in found)
    assert any(x.category is uqmbd.RedundantConstraintWarning for x in found)
    assert not any("'angle'" in finding.message for finding in found)


@pytest.mark.thorough
def test_convergence_asks_for_outputs_alone():
    mechanism, x = oscillator()
    mechanism.output("x", x, units="m")
    mechanism.require("right", x >= 0)
    study = uqmbd.Study("s", mechanism, [0, 0.5, 1])
    found = study.converge(Collocation(verify=0), order=[1, 2], reference=Collocation(order=4))
    assert np.isfinite(found["std_error_l2"].values).any()


@pytest.mark.thorough
@pytest.mark.parametrize("alignment", ["phase", "auto"])
def test_chaoses_that_are_aligned_with_a_clock_have_requirements(alignment):
    mechanism, x = oscillator()
    mechanism.output("x", x, units="m")
    limit = uqmbd.RandomVariable("limit", chaospy.Normal(0.9, 0.05))
    mechanism.require("left", -x <= limit)
    # after half a period all of them have reached -1: violated where the limit is below 1
    study = uqmbd.Study("s", mechanism, np.linspace(0, 6, 31))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        node = study.propagate(Collocation(order=3, alignment=alignment))
    data = node["requirements"].to_dataset()
    low, high = data["interval"].values[0]
    assert low <= ndtr(2) <= high and high - low < 0.02


@pytest.mark.thorough
def test_chaoses_that_are_aligned_with_events_have_requirements():
    """A ball is dropped from 0.9 to 1.1 m: after the impact it rises to 0.81 of that height."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -10)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    ball = mechanism.body("ball", mass=1, position=(0, height))
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.9))
    mechanism.output("y", ball.position[1], units="m")
    mechanism.require("slow", ball.velocity[1] <= 4)
    study = uqmbd.Study("s", mechanism, np.linspace(0, 0.9, 19))
    # margins are expanded at equal times, of which some fall among the impacts: it says so
    with pytest.warns(UserWarning, match="slow looks discontinuous, or has a kink, in height from t = 0.45 s on"):
        node = study.propagate(Collocation(order=4, alignment="events"))
    assert "aligned" in node.children
    data = node["requirements"].to_dataset()
    exact = (1.1 - (4 / 0.9) ** 2 / 20) / 0.2
    low, high = data["interval"].values[0]
    assert low <= exact <= high and high - low < 0.02
    times = data["time"].values
    # before the earliest impact nothing rises, and after the latest one all that will be violated is
    by = data["violated_by"].values[0]
    assert np.all(by[times < np.sqrt(0.18)] == 0) and by[times > np.sqrt(0.22) + 0.05] == pytest.approx(exact, abs=0.02)
