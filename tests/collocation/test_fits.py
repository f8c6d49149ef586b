"""Every way to find a chaos finds the coefficients of a polynomial, and says how; what it leaves is complete."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import validate
from uqmbd_collocation import Collocation

MIXED = (chaospy.Normal(2, 0.5), chaospy.Uniform(-1, 3))


def cubic(a, b):
    """In standard germs a = 2 + z / 2 and b = 1 + 2 u: every coefficient by hand."""
    z, u = 2 * (a - 2), (b - 1) / 2
    return 5 + 3 * z + 2 * u + z * u + (z**2 - 1) + (z**3 - 3 * z)


# E[u^2] = 1/3; the norms of z^2 - 1 and z^3 - 3 z are sqrt(2) and sqrt(6)
BY_HAND = {(0, 0): 5, (1, 0): 3, (0, 1): 2 / 3**0.5, (1, 1): 1 / 3**0.5, (2, 0): 2**0.5, (3, 0): 6**0.5}
WAYS = {
    "Gauss": {},
    "more nodes than needed": {"nodes": (5, 7)},
    "anisotropic": {"weights": (1, 1.5)},
    "tensor": {"index_set": "tensor"},
    "Smolyak": {"rule": "smolyak"},
    "regression on sobol": {"method": "regression"},
    "regression on latin-hypercube": {"method": "regression", "rule": "latin-hypercube"},
    "regression on halton": {"method": "regression", "rule": "halton", "samples": 15},
    "regression on random": {"method": "regression", "rule": "random", "samples": 40},
    "matching pursuit": {"method": "omp"},
    "least-angle regression": {"method": "lars"},
    "raised order": {"adaptive": "order", "order": 0},
    "raised order of a regression": {"adaptive": "order", "order": 1, "method": "regression"},
    "refined dimensions": {"adaptive": "dimension"},
}


@pytest.fixture(scope="module")
def study(resting):
    return resting(cubic, *MIXED)


@pytest.mark.parametrize("way", WAYS)
def test_coefficients_by_hand(study, chaos_of, way):
    node = study.propagate(Collocation(**{"order": 3, "verify": 5} | WAYS[way]))
    chaos = chaos_of(node)
    found = {
        tuple(row): value for row, value in zip(chaos.multi_index.tolist(), chaos.coefficients[:, 0, 0], strict=True)
    }
    for term in {*found, *BY_HAND}:
        assert found.get(term, 0.0) == pytest.approx(BY_HAND.get(term, 0.0), abs=1e-9), term
    np.testing.assert_allclose(chaos.coefficients[..., 0], chaos.coefficients[..., 1], atol=1e-12)
    assert node["statistics"]["verification_error"].max() < 1e-9
    if "method" in WAYS[way]:
        assert node["statistics"]["leave_one_out"].max() < 1e-15
        assert "regression" in node.attrs["fit"]
    else:
        assert "leave_one_out" not in node["statistics"]


def test_clenshaw_curtis_on_uniform_inputs(resting, chaos_of):
    """1 + u1 u2 + P2(u1) with P2 = (3 u^2 - 1) / 2, of norm 1 / sqrt(5)."""
    study = resting(lambda a, b: 1 + a * b + (3 * a**2 - 1) / 2, *[chaospy.Uniform(-1, 1)] * 2)
    for options in ({"order": 2}, {"order": 3, "level": 3}):
        chaos = chaos_of(study.propagate(Collocation(rule="clenshaw-curtis", **options)))
        expected = {(0, 0): 1, (1, 1): 1 / 3, (2, 0): 5**-0.5}
        found = [expected.get(tuple(row), 0.0) for row in chaos.multi_index.tolist()]
        np.testing.assert_allclose(chaos.coefficients[:, 0, 0], found, atol=1e-13)


@pytest.mark.thorough
def test_a_rule_that_is_coarse_for_the_basis_is_a_warning(study, warned):
    node, messages = warned(lambda: study.propagate(Collocation(rule="sobol", samples=4096)))
    assert len(messages) == 1
    assert "4096 samples, sobol" in messages[0]
    assert "10 terms" in messages[0]
    assert float(node["statistics"]["mean"][0, 0]) == pytest.approx(5, abs=0.02)


@pytest.mark.thorough
def test_germs_of_few_values_have_few_terms(resting, chaos_of):
    """A die and a coin: six nodes times two are all there is, and order 9 asks for no more."""
    study = resting(lambda die, coin: die**2 * (1 + coin), chaospy.DiscreteUniform(1, 6), chaospy.Binomial(1, 0.5))
    values = [d**2 * (1 + c) for d in range(1, 7) for c in (0, 1)]
    for options in ({"order": 9}, {"order": 1, "adaptive": "order"}, {"adaptive": "dimension"}):
        node = study.propagate(Collocation(**options))
        assert node["statistics"]["mean"][0, 0] == pytest.approx(np.mean(values), rel=1e-12)
        assert node["statistics"]["std"][0, 0] == pytest.approx(np.std(values), rel=1e-12)
        assert node["statistics"]["verification_error"].max() < 1e-12
        assert (chaos_of(node).multi_index <= [5, 1]).all()
    assert study.propagate(Collocation(order=9)).attrs["realisations"] == 12


def test_what_is_left_in_the_results(study):
    node = study.propagate(Collocation(order=3, label="third"))
    validate(node)
    assert {"statistics", "chaos", "nodes"} == set(node.children)
    expected = {"realisations": 32, "nodes": 16, "verification": 16, "terms": 10, "highest_degree": 3, "failures": 0}
    assert {name: node.attrs[name] for name in expected} == expected
    assert node.attrs["fit"] == "projection by Gauss tensor, 4 x 4 nodes"
    assert json.loads(node.attrs["options"])["order"] == 3
    nodes = node["nodes"]
    assert nodes["purpose"].values.tolist() == ["fit"] * 16 + ["verification"] * 16
    assert int(nodes["status"].sum()) == 0
    assert float(nodes["weight"].sum()) == pytest.approx(1)
    # weights and inputs are those of the distributions
    x, w = nodes["inputs"].values, nodes["weight"].values
    np.testing.assert_allclose(w @ x, [2, 1], rtol=1e-12)
    np.testing.assert_allclose(w @ (x - [2, 1]) ** 2, [0.25, 16 / 12], rtol=1e-12)
    np.testing.assert_allclose(nodes["germs"].values, np.column_stack([2 * (x[:, 0] - 2), (x[:, 1] - 1) / 2]))


def test_no_verification(study):
    node = study.propagate(Collocation(order=1, verify=0))
    assert node.attrs["realisations"] == 4
    assert "verification_error" not in node["statistics"]
    assert "verification_germs" not in node["chaos"]


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of a low order
def test_seed_moves_designs_and_verification_and_nothing_else(study):
    def nodes(**options):
        data = study.propagate(Collocation(order=2, **options))["nodes"]
        return data["germs"].values, data["purpose"].values == "fit"

    (one, fit), (other, _) = nodes(seed=1), nodes(seed=2)
    np.testing.assert_array_equal(one[fit], other[fit])
    assert not np.isin(one[~fit], other[~fit]).any()
    (one, fit), (other, _) = nodes(seed=1, method="regression"), nodes(seed=2, method="regression")
    assert not np.isin(one[fit], other[fit]).any()
    # verification points are no points of the design of the same seed
    assert not np.isin(one[~fit], one[fit]).any()


@pytest.mark.parametrize("options", [{}, {"method": "regression"}, {"method": "omp"}, {"adaptive": "dimension"}])
def test_an_input_that_nothing_depends_on_is_named(resting, warned, options):
    study = resting(lambda a, b: a**2 + b, *[chaospy.Uniform(0, 1)] * 2)
    idle = uqmbd.RandomVariable("idle_mass", chaospy.Uniform(1, 2), units="kg")
    study.mechanism.body("stone", mass=idle)
    _, messages = warned(lambda: study.propagate(Collocation(order=2, **options)))
    (message,) = messages
    assert message.startswith("UnusedInputWarning: study 'resting': no output depends on the random input 'idle_mass'")


def test_an_input_that_a_fit_is_blind_for_is_not_called_idle(resting, warned):
    """Of a product of centred inputs neither has a main effect, and nothing contradicts where nothing is verified."""
    study = resting(lambda a, b: a * b, *[chaospy.Uniform(-1, 1)] * 2)
    node, messages = warned(lambda: study.propagate(Collocation(adaptive="dimension", verify=0)))
    assert messages == []
    assert float(node["statistics"]["std"].max()) == 0
    # with verification it is not fooled
    node = study.propagate(Collocation(adaptive="dimension"))
    assert float(node["statistics"]["std"][0, 0]) == pytest.approx(1 / 3, rel=1e-12)
