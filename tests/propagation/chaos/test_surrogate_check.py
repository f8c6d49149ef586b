"""One rule for all surrogates: a large stated error, and a mean that no realisation comes near, are warned of."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.propagation.chaos import warn_of_surrogates
from uqmbd.results import PolynomialChaos, surrogate
from uqmbd.results.chaos import StoredSurrogate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper

STIFFNESS = uqmbd.RandomVariable("k", chaospy.Uniform(1, 9), units="N/m")
TIMES = np.linspace(0, 6, 13)


def oscillator(times=TIMES, scale=1.0, shift=0.0):
    """A mass on a spring of random stiffness: x = cos(sqrt(k) t), in any units."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=1.0, velocity=0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, STIFFNESS))
    mechanism.output("x", scale * body.position[0] + shift, units="m")
    return uqmbd.Study("oscillator", mechanism, times)


def told(study, method):
    """The node of a method, and what it says of its surrogate."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        node = study.propagate(method)
    return node, [str(one.message) for one in seen if issubclass(one.category, uqmbd.SurrogateWarning)]


@dataclass(frozen=True, kw_only=True)
class Line(uqmbd.extend.Propagator):
    """A straight line through three realisations: a method of a third party, with a surrogate."""

    name: ClassVar[str] = "line"
    verify: int = 16
    mean: float = 0.0
    """What the mean is too large by."""

    def propagate(self, problem):
        space = problem.germ_space()
        rule = uqmbd.extend.gauss_tensor(space, 3)
        terms = uqmbd.extend.index_set(space.dimension, 1)
        response = problem.realise(space.to_inputs(rule.nodes)).response
        basis = space.evaluate(rule.nodes, terms)
        coefficients = np.einsum("k,kp,kot->pot", rule.weights, basis, response)
        coefficients[0] += self.mean
        points = uqmbd.extend.VerificationPoints.drawn(space, self.verify, 0, 7)
        verified = uqmbd.extend.Verification.of(space, points, problem.realise(space.to_inputs(points.germs)))
        chaos = verified.chaos(coefficients, terms, problem.labels)
        data = {"chaos": chaos.to_dataset()}
        count = len(rule.nodes) + self.verify
        return problem.node(self, chaos.statistics(), realisations=count, wall_time=0.0, children=data)


METHODS = {
    "gauss": Collocation(order=3, label="c"),
    "smolyak": Collocation(order=3, rule="smolyak", label="c"),
    "clenshaw-curtis": Collocation(order=3, rule="clenshaw-curtis", label="c"),
    "regression": Collocation(order=3, method="regression", label="c"),
    "lars": Collocation(order=3, method="lars", samples=20, label="c"),
    "adaptive": Collocation(order=1, adaptive="order", max_realisations=20, label="c"),
    "elements": Collocation(order=1, elements=2, label="c"),
    "galerkin": Galerkin(order=3, label="c"),
    "galerkin of elements": Galerkin(order=1, elements=2, label="c"),
    "third party": Line(label="c"),
}


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_every_method_warns_where_its_stated_error_is_large(method):
    """Output, times and error are named once, and the truth is as large, within a factor of three."""
    node, said = told(oscillator(), method)
    text = next(one for one in said if "stated error" in one)
    denominator = r"the standard deviation(, taken as at least 1 % of its maximum)?: 'x' "
    assert re.match(f"c: the stated error of the surrogate exceeds 10% of {denominator}", text)
    stated = node["statistics"]["verification_error"].values[0]
    begin, end, largest = (
        float(re.search(what, text)[1])
        for what in (r"from t = ([0-9.]+) s", r"to t = ([0-9.]+) s", r"up to ([0-9.]+) %")
    )
    assert begin == TIMES[stated > 0.1][0] and end == TIMES[stated > 0.1][-1]
    assert largest == pytest.approx(100 * stated.max(), rel=0.01)
    assert "order" in text and "shorter time" in text
    k = 1 + 8 * (np.arange(4000) + 0.5) / 4000
    exact = np.cos(np.sqrt(k)[:, None] * TIMES)
    wrong = surrogate(node).evaluate(k[:, None])[:, 0] - exact
    std = node["statistics"]["std"].values[0]
    true = np.sqrt((wrong**2).mean(axis=0)) / np.maximum(std, 0.01 * std.max())
    assert true.max() / 3 < stated.max() < 3 * true.max()


@pytest.mark.thorough
@pytest.mark.parametrize("scale", [1e-9, -1.0, 1e9])
def test_units_change_nothing(scale):
    """The same oscillation in other units, and about another place, is reported in the same words."""
    methods = Collocation(order=3), Line()
    for method in methods:
        words = [told(oscillator(scale=s, shift=b), method)[1] for s, b in ((1.0, 0.0), (scale, 100 * scale))]
        assert words[0] == words[1] and words[0]


def test_a_surrogate_that_is_right_says_nothing():
    for method in (Collocation(order=12), Galerkin(order=12)):
        assert not told(oscillator(np.linspace(0, 2, 9)), method)[1]


def test_outputs_without_a_time_are_reported_too():
    mechanism = oscillator().mechanism
    mechanism.output("last", uqmbd.final(mechanism.bodies["body"].position[0] ** 2), units="m^2")
    _, said = told(uqmbd.Study("oscillator", mechanism, TIMES), Collocation(order=2))
    assert any(re.search(r"-scalars: the stated error .*: 'last' \([0-9]+ %\)\. Do not rely", one) for one in said)


def test_many_outputs_are_counted():
    mechanism = oscillator().mechanism
    for k in range(7):
        mechanism.output(f"x{k}", (k + 2) * mechanism.bodies["body"].position[0], units="m")
    _, (text,) = told(uqmbd.Study("oscillator", mechanism, TIMES), Collocation(order=3))
    assert text.count("'x") == 5 and ", and 3 more." in text


@pytest.mark.parametrize("verify", [0, 16])
def test_a_mean_outside_of_all_realisations_is_reported(verify):
    """Of any method, verified or not: all positions are at most 1 m, and the mean is 3 m too large."""
    _, said = told(oscillator(), Line(verify=verify, mean=3.0))
    (text,) = [one for one in said if "mean of the surrogate" in one]
    assert "is outside the range of the realisations" in text and "'x' " in text
    assert not [one for one in told(oscillator(), Line(verify=verify))[1] if "mean of the surrogate" in one]


def node_of(response, mean, std):
    """The node of a surrogate that states no error, with verification realisations (V, T)."""
    inputs = uqmbd.Mechanism("inputs", uqmbd.Line())
    inputs.output("a", uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1)))
    space = uqmbd.extend.GermSpace.of(inputs.inputs)
    axes = uqmbd.extend.labels(["y"], ["a"], np.arange(float(response.shape[1])))
    germs = np.linspace(-1, 1, len(response))[:, None]
    known = dict(verification_germs=germs, verification_response=response[:, None])
    coefficients = np.stack([mean, std])[:, None]
    chaos = PolynomialChaos(coefficients, [[0], [1]], space, axes, **known)
    statistics = uqmbd.extend.statistics_dataset(axes, mean=[mean], std=[std])
    return xr.DataTree.from_dict(
        {"statistics": statistics, "chaos": chaos.to_dataset().drop_vars("verification_error")}
    )


@pytest.mark.thorough
def test_the_mean_of_a_true_distribution_is_hardly_ever_outside():
    """Sixteen draws of skewed and rare outputs: their true mean is not reported, but one in thousands."""
    rng, reported, count = np.random.default_rng(0), 0, 0
    for _ in range(60):
        p, s = rng.uniform(1e-4, 0.5, 50), rng.uniform(0.1, 2.5, 50)
        rare = (rng.random((16, 50)) < p) * 1.0
        heavy = np.exp(s * rng.standard_normal((16, 50)))
        response = np.concatenate([rare, heavy], axis=1)
        mean = np.concatenate([p, np.exp(s**2 / 2)])
        std = np.concatenate([np.sqrt(p * (1 - p)), mean[50:] * np.sqrt(np.expm1(s**2))])
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            warn_of_surrogates(node_of(response, mean, std), "m", 1e-6)
        count += 100
        reported += sum(wrong_times(str(one.message)) for one in seen)
    assert count == 6000 and reported <= 6


def wrong_times(said: str) -> int:
    """How many of the times 0, 1, 2, ... s a warning of one output names: some, a range of them, or one."""
    if some := re.search(r"'y' at ([0-9]+) of [0-9]+ times from t", said):
        return int(some[1])
    if whole := re.search(r"'y' from t = ([0-9]+) s to t = ([0-9]+) s", said):
        return int(whole[2]) - int(whole[1]) + 1
    assert re.search(r"'y' at t = [0-9]+ s", said), said
    return 1


@pytest.mark.parametrize("where", [[3], [2, 3, 4, 5], [0, 1, 7], list(range(20))])
def test_wrong_times_are_counted_one_by_one(where):
    """Means that are wrong at known times, contiguous ones and others: as many are counted."""
    mean = np.zeros(20)
    mean[where] = 1e3
    response = np.linspace(-1, 1, 16)[:, None] * np.ones((1, 20))
    with pytest.warns(uqmbd.SurrogateWarning) as seen:
        warn_of_surrogates(node_of(response, mean, np.full(20, 0.6)), "m", 1e-6)
    assert sum(wrong_times(str(one.message)) for one in seen) == len(where)


def test_where_nodes_are_known_the_range_is_that_of_all_of_them():
    """A mean between the realisations of a method, outside of those of its verification, is fine, and vice versa."""
    response = np.linspace(0, 0.1, 16)[:, None] * np.ones((1, 2))
    mean, std = np.array([0.15, 0.15]), np.array([0.2, 0.2])
    node = node_of(response, mean, std)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_surrogates(node, "m", 1e-6, (np.zeros((1, 2)), np.full((1, 2), 0.2), 40))
    with pytest.warns(uqmbd.SurrogateWarning, match=r"'y' from t = 0 s to t = 1 s \(up to 25 % at t = 0 s\)"):
        warn_of_surrogates(node, "m", 1e-6, (np.zeros((1, 2)), np.full((1, 2), 0.1), 40))


@pytest.mark.parametrize("errors", [(0.5, 0.0), (0.0, 0.5), (0.5, 0.5)])
def test_each_output_gets_the_advice_of_its_own_surrogate(monkeypatch, errors):
    """Of a surrogate composed of a custom one and an expansion, the custom one has a remedy for its outputs only."""
    axes = uqmbd.extend.labels(["x", "y"], ["a"], [0.0, 1.0])
    statistics = uqmbd.extend.statistics_dataset(axes, mean=np.zeros((2, 2)), std=np.ones((2, 2)))
    node = xr.DataTree.from_dict({"statistics": statistics})
    stated = [xr.Dataset({"verification_error": (("output", "time"), [[e, e]])}) for e in errors]
    parts = (
        StoredSurrogate("surrogate", stated[0].assign_attrs(remedy="add training nodes."), np.array([0])),
        StoredSurrogate("chaos", stated[1], np.array([1])),
    )
    monkeypatch.setattr("uqmbd.propagation.chaos.surrogate_check.stored_surrogates", lambda node: parts)
    with pytest.warns(uqmbd.SurrogateWarning) as seen:
        warn_of_surrogates(node, "m", 1e-6)
    said = str(seen[0].message)
    assert len(seen) == 1
    assert ("dd training nodes" in said, "aise the order" in said) == (errors[0] > 0, errors[1] > 0)
    assert ("For 'x': add training nodes. For 'y': raise the order" in said) == (min(errors) > 0)
