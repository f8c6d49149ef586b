"""Tolerances by their cost: the closed form of a linear stack, a slider-crank, and what a surrogate cannot decide alone."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd_joints import Prismatic, Revolute
from uqmbd_reliability import allocate
from uqmbd_reliability.allocation.allocation_search import verified
from uqmbd_reliability.allocation.surrogates import fitted
from uqmbd_springs import Torque

WIDTHS = {"box": 0.4, "a": 0.4, "b": 0.3, "c": 0.4}
SIZES = {"box": 60.25, "a": 25, "b": 15, "c": 20}
COSTS = {"box": 1.0, "a": 2.0, "b": 0.5, "c": 1.0}
GAP = 0.25


def stack(widths=WIDTHS, cpk=1.0):
    """Three parts in a box: the gap is a sum of sizes, as on every drawing."""
    mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    sizes = {k: uqmbd.RandomVariable(k, uqmbd.tolerance(SIZES[k], w, w, cpk), units="mm") for k, w in widths.items()}
    mechanism.require("gap", sizes["box"] - sizes["a"] - sizes["b"] - sizes["c"] >= 0, description="parts go in")
    return uqmbd.Study("stack", mechanism)


def closed_form(probability, costs, cpk=1.0):
    """Minimise ``sum c / t`` with ``sum t^2 = (3 cpk gap / z)^2``: t is the cube root of c, scaled."""
    root = np.cbrt(costs)
    return root * 3 * cpk * GAP / scipy.stats.norm.isf(probability) / np.sqrt((root**2).sum())


@pytest.mark.thorough
@pytest.mark.parametrize(("probability", "cpk"), [(0.01, 1.0), pytest.param(0.0013, 1.0, marks=pytest.mark.slow)])
def test_a_linear_stack_has_the_cost_of_the_closed_form(probability, cpk):
    found = allocate(stack(cpk=cpk), "gap", probability, cost=COSTS)
    costs = np.array([COSTS[name] for name in found.inputs])
    best = closed_form(probability, costs, cpk)
    exact = scipy.stats.norm.sf(GAP / (np.sqrt((found.after**2).sum()) / (3 * cpk)))
    assert exact == pytest.approx(probability, rel=0.03)  # yield within 0.1 percentage points
    assert abs(exact - probability) < 1e-3
    assert found.lower <= exact <= found.upper
    assert found.cost_after == pytest.approx((costs / best).sum(), rel=3e-3)
    assert found.after == pytest.approx(best, rel=0.06)  # the minimum is flat
    assert found.cost_before == pytest.approx(sum(COSTS[k] / WIDTHS[k] for k in COSTS))
    one = np.sqrt((best**2).sum() / (found.before**2).sum())  # one factor for all
    assert found.cost_alike == pytest.approx(found.cost_before / one, rel=0.01)
    assert found.cost_alike > found.cost_after
    # d ln P / d ln t of a normal sum
    index = scipy.stats.norm.isf(exact)
    share = found.after**2 / (found.after**2).sum()
    assert found.sensitivity == pytest.approx(scipy.stats.norm.pdf(index) * index * share / exact, rel=0.15)
    assert found.surrogate_error < 1e-6


@pytest.mark.thorough
def test_a_cost_that_is_a_function_and_bounds_that_are_active():
    """One tolerance is free, so that it stays as it is; the other two share what is left by the closed form."""
    costs = {"box": lambda t: 1 / t, "a": lambda t: 1 / t, "b": lambda t: 1e-6 / t}
    found = allocate(stack({**WIDTHS, "b": 0.1, "c": 0.05}), "gap", 0.01, cost=costs)
    free = dict(zip(found.inputs, found.after, strict=True))
    assert found.inputs == ("a", "b", "box")
    left = (3 * GAP / scipy.stats.norm.isf(0.01)) ** 2 - 0.05**2
    total = free["a"] ** 2 + free["b"] ** 2 + free["box"] ** 2
    assert total == pytest.approx(left, rel=0.02)
    assert free["a"] == pytest.approx(free["box"], rel=0.1)
    assert free["b"] < 0.35 * free["a"]


@pytest.mark.thorough
def test_nothing_is_tightened_where_nothing_has_to_be():
    found = allocate(stack({k: w / 4 for k, w in WIDTHS.items()}), "gap", 0.1)
    assert (found.factors == 1).all() and found.cost_after == found.cost_before
    assert any("No tolerance has to be" in note for note in found.notes)


@pytest.mark.slow
@pytest.mark.parametrize("cost", [{"x": 1, "y": 1}, {"skewed": 1, "y": 1}], ids=["affine", "skewed"])
def test_inputs_may_be_discrete_dependent_skewed_or_inspected(cost):
    """Against 200,000 samples of the relation itself; a skewed input is drawn together to its mean, too."""
    mechanism = uqmbd.Mechanism("mixed", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    n = uqmbd.RandomVariable("n", chaospy.Binomial(4, 0.3))
    skewed = uqmbd.RandomVariable("skewed", chaospy.LogNormal(0, 0.3))
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([0, 0], [[1, 0.6], [0.6, 1]]))
    x = uqmbd.RandomVariable("x", uqmbd.tolerance(0, 1, 1, cpk=0.7, inspected=True))
    y = uqmbd.RandomVariable("y", chaospy.Uniform(-1, 1))
    relation = 3.2 + 0.1 * n - skewed + 0.2 * a - 0.1 * b - 2 * x - 2 * y + 0.1 * x * y
    mechanism.require("sum", relation >= 0)
    study = uqmbd.Study("mixed", mechanism)
    found = allocate(study, "sum", 0.02, cost=cost, verify=2000)
    assert found.factors.min() < 0.95 and found.lower <= 0.02 <= found.upper
    inputs = study.problem(_method()).inputs
    uniform = np.random.default_rng(3).random((200_000, 6))
    drawn = dict(zip(inputs.names, inputs.from_uniform(uniform).T, strict=True))
    means = dict(zip(inputs.names, inputs.means, strict=True))
    for name, factor in zip(found.inputs, found.factors, strict=True):
        drawn[name] = means[name] + factor * (drawn[name] - means[name])
    symbols = (n, skewed, a, b, x, y)
    margin = sympy.lambdify(symbols, relation, "numpy")(*(drawn[s.name] for s in symbols))
    assert np.mean(margin < 0) == pytest.approx(0.02, abs=1e-3)


def slider_crank(limit):
    """Driven by a constant torque; the force in the piston pin grows with speed and mass, and falls with the lengths."""
    t = uqmbd.tolerance
    a = uqmbd.RandomVariable("crank", t(0.15, 0.004, 0.004, cpk=1), "m")
    b = uqmbd.RandomVariable("rod", t(0.35, 0.008, 0.008, cpk=1), "m")
    h = uqmbd.RandomVariable("guide", t(0, 0.006, 0.006, cpk=1), "m")
    mass = uqmbd.RandomVariable("slider_mass", t(0.5, 0.03, 0.03, cpk=1), "kg")
    x, y = a * sympy.cos(sympy.pi / 4), a * sympy.sin(sympy.pi / 4)
    angle = -sympy.asin((y - h) / b)
    end = x + b * sympy.cos(angle)
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    ground = mechanism.ground
    crank = mechanism.body("crank", mass=0.36, inertia=0.36 * a**2 / 12, position=(x / 2, y / 2), angle=sympy.pi / 4)
    rod = mechanism.body("rod", mass=0.15, inertia=0.15 * b**2 / 12, position=((x + end) / 2, (y + h) / 2), angle=angle)
    slider = mechanism.body("slider", mass=mass, inertia=1e-4, position=(end, h))
    mechanism.add(Revolute("bearing", ground, crank, point_i=(0, 0), point_j=(-a / 2, 0)))
    mechanism.add(Revolute("crank_pin", crank, rod, point_i=(a / 2, 0), point_j=(-b / 2, 0)))
    pin = mechanism.add(Revolute("piston_pin", rod, slider, point_i=(b / 2, 0), point_j=(0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, point_i=(0, h), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(Torque("drive", crank, torque=1.0))
    mechanism.require("no_overload", pin.reaction_force[0] <= limit, description="piston pin")
    return uqmbd.Study("slider_crank", mechanism, np.linspace(0, 0.32, 33))


@pytest.mark.slow
def test_the_yield_of_a_slider_crank_is_that_of_real_realisations():
    """With a million (20,000 here) of other random numbers: 0.1 percentage points and twice their standard error."""
    study = slider_crank(65.0)
    found = allocate(study, "no_overload", 0.01)
    wide = dict(zip(found.inputs, found.after, strict=True))
    count = 20_000
    problem = study.problem(_method())
    uniform = np.random.default_rng(77).random((count, len(problem.inputs)))
    factors = np.array([dict(zip(found.inputs, found.factors, strict=True))[n] for n in problem.inputs.names])
    centres = np.array([uqmbd.extend.stated_tolerance(v.distribution).mean for v in problem.inputs.variables])
    drawn = centres + factors * (problem.inputs.from_uniform(uniform) - centres)
    violated = np.mean(problem.margins(drawn).values[:, 0] < 0)
    assert abs(violated - 0.01) <= 1e-3 + 2 * np.sqrt(0.01 / count)
    assert found.lower - 2 * np.sqrt(0.01 / count) <= violated <= found.upper + 2 * np.sqrt(0.01 / count)
    assert wide["slider_mass"] < 0.8 * 0.03 and wide["rod"] > 0.9 * 0.008  # the mass matters, the rod hardly
    same = allocate(study, "no_overload", 0.01)
    assert (same.after == found.after).all() and same.probability == found.probability


def _method():
    from uqmbd_montecarlo import MonteCarlo

    return MonteCarlo(samples=10, seed=1)


@pytest.mark.thorough
def test_what_cannot_be_reached_is_reported_with_real_realisations():
    """The mean gap is at the limit: however tight, half of the boxes are too small."""
    mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    box = uqmbd.RandomVariable("box", uqmbd.tolerance(10, 0.1, 0.1))
    part = uqmbd.RandomVariable("part", uqmbd.tolerance(10, 0.1, 0.1))
    mechanism.require("gap", box - part >= 0)
    with pytest.raises(uqmbd.StudyError, match="cannot reduce the probability to 0.01.* the probability is still 0.5"):
        allocate(uqmbd.Study("stack", mechanism), "gap", 0.01, verify=200)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"requirement": "gab"}, "expected one of gap"),
        ({"probability": 0}, "probability is 0"),
        ({"probability": 1e-9}, "from 1e-05 to 0.5"),
        ({"cost": {"lid": 1}}, "cost contains 'lid'; expected names of inputs"),
        ({"cost": {"box": -1}}, "cost of box is -1"),
        ({"cost": {"box": lambda t: t}}, "increases as the tolerance is tightened"),
        ({"cost": {}}, "cost is {}"),
        ({"verify": 3}, "verify is 3"),
        ({"narrowest": 2}, "narrowest is 2"),
        ({"loosest": 0.5}, "loosest is 0.5"),
        ({"cost": {"box": lambda t: (t - 0.5) ** 2}, "loosest": 3}, "increases as the tolerance is tightened"),
        ({"workers": 0}, "workers is 0"),
        ({"study": "stack"}, "expected a uqmbd.Study"),
    ],
)
def test_what_cannot_be_used_is_refused(changes, said):
    arguments = {"study": stack(), "requirement": "gap", "probability": 0.01, **changes}
    with pytest.raises(uqmbd.StudyError, match=said):
        allocate(**arguments)


def test_inputs_without_a_tolerance_are_named_and_dependent_ones_refused():
    mechanism = uqmbd.Mechanism("plain", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    x = uqmbd.RandomVariable("x", chaospy.Normal(1, 0.1))
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]]))
    mechanism.require("sum", x + a + b <= 10)
    study = uqmbd.Study("plain", mechanism)
    with pytest.raises(uqmbd.StudyError, match="no input has a tolerance"):
        allocate(study, "sum", 0.1)
    with pytest.raises(uqmbd.StudyError, match="a depends on b"):
        allocate(study, "sum", 0.1, cost={"a": 1})
    mechanism = uqmbd.Mechanism("bare", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    mechanism.output("x", x)
    with pytest.raises(uqmbd.StudyError, match="no requirements"):
        allocate(uqmbd.Study("bare", mechanism, [0, 0.1]), None, 0.1)


@pytest.mark.thorough
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.002, 0.3), st.floats(0, 0.3), st.floats(0, 0.3))
def test_the_interval_of_a_corrected_count_holds_the_true_probability(seed, share, missed, invented):
    """A surrogate that misses and invents violations: in 60 draws of 400 realisations at most 9 intervals are wrong."""
    generator = np.random.default_rng(seed)
    hits = 0
    invented = invented * share  # false violations are as rare as true ones
    counted = share * (1 - missed) + (1 - share) * invented
    for _ in range(60):
        real = generator.random(400) < share
        predicted = np.where(real, generator.random(400) >= missed, generator.random(400) < invented)
        found = verified(counted, 10**6, predicted, np.where(real, -1.0, 1.0))
        hits += found.lower <= share <= found.upper
    assert hits >= 51


def test_failed_realisations_are_neither_safe_nor_violations():
    margins = np.r_[np.full(10, np.nan), np.full(990, 1.0)]
    found = verified(0.0, 10**6, np.zeros(1000, dtype=bool), margins)
    without = verified(0.0, 10**6, np.zeros(1000, dtype=bool), np.ones(1000))
    assert found.failures == 10 and found.probability == 0
    assert found.upper > 0.01 > without.upper and found.lower == without.lower == 0


def test_surrogates_are_as_good_as_they_say():
    """The error left out, of a function that polynomials do not hold, is that at new points; far tails apart."""
    a, b = (uqmbd.RandomVariable(n, uqmbd.tolerance(0, 1, 1, cpk=1 / 3)) for n in "ab")
    mechanism = uqmbd.Mechanism("s", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    mechanism.output("a", a + b)
    problem = uqmbd.Study("s", mechanism, [0, 0.1]).problem(_method())
    generator = np.random.default_rng(1)
    values, fresh = generator.standard_normal((300, 2)), generator.standard_normal((4000, 2))

    fresh = fresh[(np.abs(fresh) < np.abs(values).max(axis=0)).all(axis=1)]

    def function(x):
        return np.column_stack([np.exp(0.5 * x[:, 0]) + x[:, 1] ** 2, np.abs(x[:, 0])])

    space = problem.germ_space()
    found = fitted(space, values, function(values))
    true = np.sqrt(np.mean((found.margins(space.to_germs(fresh)) - function(fresh)) ** 2, axis=0)) / function(
        values
    ).std(axis=0)
    assert found.order >= 3
    assert (found.error > true / 2).all() and (found.error < 3 * true).all()


@pytest.mark.slow
def test_workers_do_not_change_the_result():
    one, two = (allocate(stack(), "gap", 0.01, cost=COSTS, verify=500, workers=k) for k in (1, 2))
    assert (one.after == two.after).all()
    assert (one.probability, one.lower, one.upper) == (two.probability, two.lower, two.upper)


@pytest.mark.thorough
def test_tolerances_are_loosened_where_that_is_cheaper():
    """The closed form of Lagrange's multipliers, whose tolerances of b, c and a are wider than the present ones."""
    begin = {"box": 0.6, "a": 0.2, "b": 0.05, "c": 0.15}
    found = allocate(stack(begin), "gap", 0.01, cost=COSTS, loosest=4)
    costs = np.array([COSTS[name] for name in found.inputs])
    best = closed_form(0.01, costs)
    assert found.before == pytest.approx([begin[name] for name in found.inputs])
    assert (found.factors > 1).any() and (found.factors < 1).any() and found.factors.max() <= 4
    assert found.after == pytest.approx(best, rel=0.06)
    assert found.cost_after == pytest.approx((costs / best).sum(), rel=3e-3)
    assert found.cost_before == pytest.approx(sum(COSTS[k] / begin[k] for k in COSTS))
    exact = scipy.stats.norm.sf(GAP / (np.sqrt((found.after**2).sum()) / 3))
    assert exact == pytest.approx(0.01, rel=0.03)
    assert found.lower <= exact <= found.upper
    now = scipy.stats.norm.sf(GAP / (np.sqrt((found.before**2).sum()) / 3))
    assert found.probability_before == pytest.approx(now, rel=0.02)


@pytest.mark.thorough
def test_where_all_may_be_loosened_they_are_as_loose_as_allowed():
    """Inspected parts, whose limits are loosened with them: the present ones never violate the requirement."""
    mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    a, b = (uqmbd.RandomVariable(n, uqmbd.tolerance(10, 0.1, 0.1, cpk=0.5, inspected=True), units="mm") for n in "ab")
    mechanism.require("sum", a + b <= 20.25)
    study = uqmbd.Study("stack", mechanism)
    found = allocate(study, "sum", 0.2, loosest=2, verify=500)
    assert found.probability_before == 0
    assert found.factors == pytest.approx([2, 2])
    assert found.notes == ("All tolerances can be widened to 2 times their present width.",)
    inputs = study.problem(_method()).inputs
    drawn = 10 + 2 * (inputs.from_uniform(np.random.default_rng(1).random((200_000, 2))) - 10)
    share = np.mean(drawn.sum(axis=1) > 20.25)
    assert found.lower <= share <= found.upper
    assert 0 < share < 0.2
