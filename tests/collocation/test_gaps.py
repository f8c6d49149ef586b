"""Further verification points in gaps: errors in thin layers of the germ space are not missed."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import GermSpace, VerificationPoints
from uqmbd.randomness import JointInput
from uqmbd_collocation import Collocation
from uqmbd_collocation.gaps import with_gap

INPUTS = {"uniform": chaospy.Uniform(-1, 1), "normal": chaospy.Normal(0, 1), "gamma": chaospy.Gamma(3, 0.5)}


def study_of(*outputs: sympy.Expr) -> uqmbd.Study:
    """Return a study of outputs of the inputs, without motion."""
    mechanism = uqmbd.Mechanism("layers", uqmbd.Line())
    mechanism.body("mass", mass=1)
    for number, output in enumerate(outputs):
        mechanism.output(f"y{number}", output)
    return uqmbd.Study("layers", mechanism, [0.0, 1.0])


@pytest.mark.parametrize("names", [("uniform",), ("normal", "uniform"), ("gamma", "normal", "uniform")])
def test_a_further_point_is_between_points_and_takes_their_weight(names):
    """For 20 random shares of the error; the sum of the weights is unchanged, and no weight is negative."""
    inputs = [uqmbd.RandomVariable(f"v{k}", INPUTS[name]) for k, name in enumerate(names)]
    space = GermSpace.of(JointInput.of(inputs))
    among = VerificationPoints.drawn(space, 512, 3, 7)
    for seed in range(20):
        points = VerificationPoints.drawn(space, 16, seed, 1)
        shares = np.random.default_rng(seed).dirichlet(np.full(16, 0.2))
        found = with_gap(points, shares, among)
        assert found is not None and len(found) == 17
        np.testing.assert_array_equal(found.germs[:16], points.germs)
        assert (found.germs[16] == among.germs).all(axis=1).any()
        assert found.weights.sum() == pytest.approx(points.weights.sum(), rel=1e-12)
        assert (found.weights >= 0).all() and (found.weights[:16] <= points.weights * (1 + 1e-12)).all()
        if len(names) == 1:
            assert points.germs.min() < found.germs[16, 0] < points.germs.max()


def test_the_largest_gap_next_to_the_error_is_chosen():
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", INPUTS["uniform"])]))
    germs = np.array([-0.9, -0.5, -0.3, 0.3, 0.5, 0.6, 0.9])[:, None]
    shares = np.array([0.0, 0.05, 0.5, 0.4, 0.05, 0.0, 0.0])
    among = VerificationPoints.drawn(space, 512, 3, 7)
    found = with_gap(VerificationPoints(germs, np.ones(7)), shares, among)
    assert found is not None and abs(found.germs[-1, 0]) < 0.15 and 0.5 < found.weights[-1] < 2.0
    assert with_gap(VerificationPoints(germs, np.ones(7)), np.zeros(7), among) is None


@pytest.mark.filterwarnings("ignore:.*discontinuous:UserWarning")
def test_inaccurate_surrogates_alone_have_further_points():
    """Two more realisations; none for an accurate one, for few verification points, or beyond `max_realisations`."""
    a = uqmbd.RandomVariable("a", INPUTS["uniform"])
    layer, smooth = study_of(1 / (1 + 400 * a**2)), study_of(sympy.exp(a))
    with pytest.warns(uqmbd.SurrogateWarning):
        nodes = [layer.propagate(Collocation(order=4, **options)) for options in ({}, {"max_realisations": 22})]
        few = layer.propagate(Collocation(order=4, verify=7))
    assert [node.attrs["realisations"] for node in (*nodes, few)] == [23, 21, 12]
    assert nodes[0].attrs["verification"] == 18
    assert smooth.propagate(Collocation(order=6)).attrs["realisations"] == 7 + 16


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_errors_in_thin_layers_are_not_missed():
    """Of 24 surrogates with peaks 0.02 to 0.1 wide, the stated error is a fifth of the true one at least.

    Without further points seven of 96 such surrogates state less than a fifth; the least ratio is 0.055.
    """
    a = uqmbd.RandomVariable("a", INPUTS["uniform"])
    rng, at, ratios = np.random.default_rng(4), np.linspace(-1, 1, 4001)[:, None], []
    for place, width in zip(rng.uniform(-0.8, 0.8, 24)[::3], rng.uniform(0.02, 0.1, 24)[::3], strict=True):
        study = study_of(1 / (1 + ((a - place) / width) ** 2))
        right = 1 / (1 + ((at - place) / width) ** 2)
        for seed in range(3):
            node = study.propagate(Collocation(order=4, seed=seed))
            chaos = node.uqmbd.surrogate()
            true = np.sqrt(((chaos.evaluate(at)[:, 0, :1] - right) ** 2).mean()) / chaos.std[0, 0]
            ratios.append(node["statistics"]["verification_error"].values[0, 0] / true)
    inside = (np.array(ratios) >= 0.5) & (np.array(ratios) <= 2.0)
    assert np.min(ratios) > 0.35 and inside.mean() >= 0.8, np.round(ratios, 2)
