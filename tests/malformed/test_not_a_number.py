"""What is no number, or none that can be computed with, is told with its place: outputs, drivers, forces, times, events."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

TIMES = [0, 0.05, 0.1]


def rod():
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -9.81)))
    body = mechanism.body("bar", mass=1, inertia=0.1, position=(0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0), (-0.5, 0)))
    mechanism.output("x", body.position[0], units="m")
    return mechanism, body


@pytest.mark.thorough
def test_a_sample_with_an_output_that_is_not_finite_has_a_reason():
    width = uqmbd.RandomVariable("width", chaospy.Uniform(-1, 3))
    mechanism, body = rod()
    mechanism.output("level", sympy.log(width) + body.position[0])
    with pytest.warns(UserWarning, match=r"realisations failed; .*an output is not finite: 'level' is nan at t = 0 s"):
        tree = uqmbd.Study("study", mechanism, TIMES, [MonteCarlo(samples=20, seed=1)]).run()
    samples = tree["monte-carlo/samples"]
    negative = samples["inputs"].values[:, 0] < 0
    assert 0 < negative.sum() < 10
    assert (samples["status"].values[negative] == 3).all() and (samples["status"].values[~negative] == 0).all()
    assert all(str(m).startswith("an output is not finite: 'level'") for m in samples["message"].values[negative])


@pytest.mark.parametrize("method", [MonteCarlo(samples=4, seed=1), Collocation(order=1)], ids=lambda m: m.name)
def test_a_run_of_which_everything_fails_gives_the_reason(method):
    mechanism, body = rod()
    mechanism.output("level", sympy.sqrt(uqmbd.RandomVariable("width", chaospy.Uniform(-3, -1))) * body.position[0])
    with pytest.raises(uqmbd.IntegrationError, match="an output is not finite: 'level' is nan at t = 0 s; check its"):
        uqmbd.Study("study", mechanism, TIMES, [method]).run()


def test_a_simulation_with_an_output_that_is_not_finite_says_which_and_when():
    mechanism, body = rod()
    mechanism.output("pole", 1 / (uqmbd.t - 0.05) + body.position[0])
    with pytest.warns(UserWarning, match=r"simulate 'rod': an output is not finite: 'pole' is .*inf at t = 0.05 s"):
        found = uqmbd.simulate(mechanism, TIMES)
    assert np.isfinite(found["x"]).all()


DRIVERS = {
    "a logarithm of nothing": (sympy.log(uqmbd.t - 1), uqmbd.AssemblyError, "the equation 'drive: angle' is nan"),
    "a pole": (1 / uqmbd.t, uqmbd.AssemblyError, "the equation 'drive: angle' is nan"),
    "an infinite speed": (sympy.sqrt(uqmbd.t), uqmbd.AssemblyError, "the rate in time of the equation 'drive: angle' is .* at t = 0 s"),
    "an infinite acceleration": (uqmbd.t ** sympy.Rational(3, 2), uqmbd.AssemblyError, "the second derivative in time of the equation 'drive: angle' is .* at t = 0 s"),
    "later": (sympy.log(1 - uqmbd.t / 0.06), uqmbd.IntegrationError, "the equation 'drive: angle' is nan at t = 0.06"),
}  # fmt: skip


@pytest.mark.parametrize("integrator", ["auto", "ida"])
@pytest.mark.parametrize(("angle", "kind", "words"), DRIVERS.values(), ids=DRIVERS)
def test_a_driver_that_is_not_a_number_is_named(angle, kind, words, integrator):
    mechanism, body = rod()
    mechanism.add(RotationDriver("drive", mechanism.ground, body, angle=angle))
    with pytest.raises(kind, match=words + ".*an argument of 'drive'"):
        uqmbd.simulate(mechanism, TIMES, integrator=integrator)


def test_a_force_that_is_not_a_number_names_its_body():
    mechanism, body = rod()
    mechanism.add(PointForce("push", body, (0, 0), (sympy.log(uqmbd.t - 1), 0)))
    with pytest.raises(uqmbd.AssemblyError, match="the force on body 'bar' is nan at t = 0 s"):
        uqmbd.simulate(mechanism, TIMES)


def test_of_several_forces_those_that_act_on_the_body_are_named():
    mechanism, body = rod()
    mechanism.add(PointForce("push", body, (0, 0), (sympy.log(uqmbd.t - 1), 0)))
    with pytest.raises(uqmbd.AssemblyError, match="is nan at t = 0 s: 'push' has no finite value there"):
        uqmbd.simulate(mechanism, TIMES)
    mechanism.add(PointForce("pull", body, (0, 0), (1, 0)))
    with pytest.raises(uqmbd.AssemblyError, match="is nan at t = 0 s: one of 'push', 'pull' has no finite value there"):
        uqmbd.simulate(mechanism, TIMES)


def ball():
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    body = mechanism.body("ball", mass=1, position=(0, 1))
    return mechanism, mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1)))


def test_an_event_that_there_is_not_is_refused_with_those_that_there_are():
    mechanism, floor = ball()
    mechanism.output("first", floor.event_time("impakt"), units="s")
    with pytest.raises(
        uqmbd.StudyError, match="output 'first': PlaneImpact 'floor' has no event 'impakt'; did you mean 'impact'"
    ):
        uqmbd.simulate(mechanism, TIMES)
    with pytest.raises(uqmbd.StudyError, match="the label is 3; expected"):
        floor.event_time(3)


def test_an_event_that_does_not_happen_costs_its_own_output_only():
    mechanism, floor = ball()
    mechanism.output("y", mechanism.bodies["ball"].position[1], units="m")
    mechanism.output("first", floor.event_time("impact"), units="s")
    with pytest.warns(UserWarning, match="the event 'floor: impact 1' does not occur by the last output time"):
        found = uqmbd.simulate(mechanism, TIMES)
    assert np.isnan(found["first"])
    np.testing.assert_allclose(found["y"], 1 - 9.81 * found["time"] ** 2 / 2, atol=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert float(uqmbd.simulate(mechanism, [0, 0.5])["first"]) == pytest.approx(np.sqrt(2 / 9.81), rel=1e-6)


@pytest.mark.parametrize(
    "times",
    [[0, 1e-150, 2e-150], [0, 1e-320], [0, 1e300], [1.0, 1.0 + 3e-16, 2.0], [1e17, 1e17 + 64], [False, True], "0, 1", None, [0, [1, 2]]],
)  # fmt: skip
def test_times_between_which_there_are_no_steps_are_refused(times):
    with pytest.raises(uqmbd.StudyError, match="times"):
        uqmbd.simulate(rod()[0], times)


@pytest.mark.parametrize("size", [10**400, 1e300, -1e300, 1e150, sympy.Integer(10) ** 200])
def test_numbers_beyond_arithmetic_are_refused_by_name(size):
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    with pytest.raises(uqmbd.StudyError, match="body 'bar': position is .*too large: its square exceeds"):
        mechanism.body("bar", mass=1, inertia=1, position=(size, 0))


def test_a_random_number_beyond_arithmetic_is_a_failed_realisation():
    exponent = uqmbd.RandomVariable("exponent", chaospy.Uniform(-50, 150))
    mechanism = uqmbd.Mechanism("far", uqmbd.Translational())
    body = mechanism.body("stone", mass=1, position=(10.0**exponent, 0))
    mechanism.output("speed", body.velocity[0])
    with pytest.warns(UserWarning, match="a parameter is not finite, or larger than 1e"):
        tree = uqmbd.Study("study", mechanism, TIMES, [MonteCarlo(samples=20, seed=1)]).run()
    samples = tree["monte-carlo/samples"]
    np.testing.assert_array_equal(samples["status"].values > 0, samples["inputs"].values[:, 0] > 100)


RUNS = {
    "progress": [("yes", "progress"), (3, "progress")],
    "folder": [(3, "folder"), ([], "folder")],
    "resume": [(1, "resume"), ("yes", "resume")],
    "only": [(3, "only"), ([], "only"), ([3], "only"), (["nobody"], "nobody")],
    "workers": [(0, "workers"), ("2", "workers"), (1.5, "workers")],
}


@pytest.mark.parametrize(("argument", "value", "word"), [(k, v, w) for k, given in RUNS.items() for v, w in given])
def test_arguments_of_a_run_are_refused_before_anything_is_computed(argument, value, word):
    mechanism, _ = rod()
    study = uqmbd.Study("study", mechanism, TIMES, [MonteCarlo(samples=4)])
    with pytest.raises(uqmbd.StudyError, match=word):
        study.run(**{argument: value})


def test_a_body_without_mass_in_a_space_without_rotation_is_reported():
    mechanism = uqmbd.Mechanism("nothing", uqmbd.Translational())
    mechanism.output("x", mechanism.body("dust", mass=0).position[0])
    with pytest.raises(uqmbd.StudyError, match="body 'dust' can be accelerated without any force"):
        uqmbd.simulate(mechanism, TIMES)


POINTS = [
    (1,),
    (1, 2, 3),
    (None, 0),
    (True, 0),
    ("a", 0),
    (float("nan"), 0),
    (float("inf"), 0),
    (1j, 0),
    ({}, 0),
    (1e300, 0),
    "ab",
    3,
]


@pytest.mark.parametrize("local", POINTS, ids=str)
@pytest.mark.parametrize("method", ["point", "point_velocity", "point_acceleration", "direction"])
def test_points_that_are_none_are_refused_where_they_are_given(method, local):
    _, body = rod()
    with pytest.raises(uqmbd.StudyError, match=r"point\(\)|direction\(\)"):
        getattr(body, method)(local)


@pytest.mark.parametrize(
    "wrong", ["1", b"1", True, float("nan"), 1j, dict, {}, None, np.True_, sympy.eye(2), uqmbd.t > 0], ids=str
)
@pytest.mark.parametrize("place", range(5))
def test_a_step_of_what_is_no_number_names_the_argument(place, wrong):
    arguments = [uqmbd.t, 0, 1, 2, 3]
    assert uqmbd.step(*arguments).doit().subs(uqmbd.t, 1) == 2
    arguments[place] = wrong
    with pytest.raises(uqmbd.StudyError, match=f"step: {('x', 'x0', 'y0', 'x1', 'y1')[place]} (is|has) "):
        uqmbd.step(*arguments)


def test_a_step_with_other_than_five_arguments_is_refused():
    with pytest.raises(uqmbd.StudyError, match=r"step: 4 arguments are given; expected step\(x, x0, y0, x1, y1\)"):
        uqmbd.step(uqmbd.t, 0, 1, 2)


def _yielding(make):
    class Acting(uqmbd.Component):
        spaces = (uqmbd.Line,)

        def terms(self, p):
            yield make(p)

    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    body = mechanism.body("b", mass=1)
    mechanism.add(Acting("acting", mechanism.ground, body))
    mechanism.output("x", body.position[0])
    return mechanism


TERMS = {
    "force": lambda p, x: uqmbd.VirtualWork(x, p.body_j.velocity[0]),
    "velocity": lambda p, x: uqmbd.VirtualWork(1, p.body_j.velocity[0] + x),
    "constraint": lambda p, x: uqmbd.Constraint(p.body_j.position[0] - x),
    "gap": lambda p, x: uqmbd.extend.Separation(p.body_j.position[0] + x),
    "guard": lambda p, x: uqmbd.Event(p.body_j.position[0] - x, uqmbd.extend.Impact(p.body_j.velocity[0])),
    "restitution": lambda p, x: uqmbd.Event(p.body_j.position[0] + 1, uqmbd.extend.Impact(p.body_j.velocity[0], x)),
    "start": lambda p, x: uqmbd.Auxiliary(p.state("a"), 1, x),
    "rate": lambda p, x: uqmbd.Auxiliary(p.state("a"), x, 0),
}


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize(
    "value", [np.nan, np.inf, -np.inf, sympy.oo, -sympy.oo, sympy.zoo, 10**400, -(10**400)], ids=str
)
def test_a_term_of_a_component_is_finite(term, value):
    with pytest.raises(uqmbd.StudyError, match=r"terms\(\) contains"):
        uqmbd.simulate(_yielding(lambda p: TERMS[term](p, value)), TIMES)


def test_terms_with_ordinary_numbers_are_accepted():
    for make in TERMS.values():
        uqmbd.simulate(_yielding(lambda p, make=make: make(p, 0)), TIMES, check=False)


@pytest.mark.parametrize(
    "give",
    [
        lambda m, b, x: m.output("y", b.position[0] + x),
        lambda m, b, x: m.output("y", sympy.Piecewise((x, b.position[0] > 5), (b.position[0], True))),
        lambda m, b, x: m.output("y", uqmbd.maximum(b.position[0] + x)),
        lambda m, b, x: m.add(PointForce("f", b, (0, 0), (0, x * uqmbd.t))),
        lambda m, b, x: m.body("c", mass=1, inertia=1 + x * uqmbd.RandomVariable("a", chaospy.Uniform(1, 2))),
    ],
)
@pytest.mark.parametrize(
    "value", [10**400, sympy.Rational(10**400, 3), sympy.Float("1e400")], ids=["int", "rational", "float"]
)
def test_a_number_in_an_expression_fits_into_64_bits(give, value):
    mechanism, body = rod()
    with pytest.raises(uqmbd.StudyError, match="exceeds the range of 64-bit numbers"):
        give(mechanism, body, value)
