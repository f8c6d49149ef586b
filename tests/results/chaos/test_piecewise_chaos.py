"""Multi-element chaos: merged moments, Sobol' indices, quantiles, stated error, storage."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import labels, project
from uqmbd.randomness import GermBox, GermSpace, JointInput, gauss_tensor, index_set
from uqmbd.results import PiecewiseChaos, PolynomialChaos, load, propagator_node, save, validate
from uqmbd.results.chaos import chaos_from_dataset

U, N = chaospy.Uniform(-1, 1), chaospy.Normal(0, 1)
TIMES = np.array([0.0, 0.5, 1.0])


def space_of(*distributions):
    """The germ space of independent inputs a, b, ..."""
    pairs = zip("abc", distributions, strict=False)
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(n, d, units="m") for n, d in pairs]))


def divided(space, *cuts):
    """Split boxes by their number, along a germ, one after the other: a halved box is replaced by its halves."""
    boxes = [GermBox.whole(space)]
    for number, germ in cuts:
        boxes[number : number + 1] = boxes[number].split(germ)
    return boxes


def pieces(function, boxes, order, verify=0):
    """Project a function of germs (K, d) and times onto each box."""
    axes = labels([("y", "m")], [(n, "m") for n in boxes[0].space.inputs], TIMES)
    found = []
    for k, box in enumerate(boxes):
        terms, rule = index_set(box.space.dimension, order), gauss_tensor(box.local, order + 2)
        at = box.local.from_uniform(np.random.default_rng(k).random((verify, box.space.dimension)))
        values = function(rule.nodes)[:, None, None] * (1 + TIMES)
        known = {"verification_germs": at, "verification_response": function(at)[:, None, None] * (1 + TIMES)}
        coefficients = project(values, box.local.evaluate(rule.nodes, terms), rule.weights)
        found.append(PolynomialChaos(coefficients, terms, box.local, axes, **(known if verify else {})))
    return PiecewiseChaos(found, boxes)


CUTS = ((0, 0), (1, 1), (2, 0), (0, 1), (3, 1))
"""A partition that is no grid: neighbours end at different places."""


@pytest.mark.thorough
@pytest.mark.parametrize("distributions", [(U, U), (U, N), (chaospy.Gamma(2), chaospy.Triangle(0, 0.3, 1))])
def test_a_polynomial_is_what_it_is_without_elements(distributions):
    """Split or not, a polynomial of the germs has the same moments, Sobol' indices and values."""
    space = space_of(*distributions)

    def function(x):
        return 1 + 2 * x[:, 0] - x[:, 1] + x[:, 0] * x[:, 1] + 0.5 * x[:, 1] ** 2

    plain = pieces(function, divided(space), 2).elements[0]
    split = pieces(function, divided(space, *CUTS), 2)
    assert len(split.boxes) == 6
    for name in ("mean", "std", "skewness", "kurtosis", "sobol_first", "sobol_total", "sobol_second"):
        np.testing.assert_allclose(getattr(split, name), getattr(plain, name), rtol=1e-7, atol=1e-9, err_msg=name)
    inputs, values = split.sample(100, 3)
    same, expected = plain.sample(100, 3)
    np.testing.assert_array_equal(inputs, same)
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(split.evaluate(inputs), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(split.quantiles(), plain.quantiles(), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        split.density([0.5, 2.0], "y", 0.5), plain.density([0.5, 2.0], "y", 0.5), rtol=1e-9, atol=1e-9
    )


def test_absolute_value():
    """|a| of a uniform a on [-1, 1] is uniform on [0, 1]: two elements of order 1 say so exactly."""
    chaos = pieces(lambda x: np.abs(x[:, 0]), divided(space_of(U), (0, 0)), 1)
    assert chaos.mean[0, 0] == pytest.approx(0.5) and chaos.variance[0, 0] == pytest.approx(1 / 12)
    assert chaos.skewness[0, 0] == pytest.approx(0, abs=1e-9) and chaos.kurtosis[0, 0] == pytest.approx(1.8)
    np.testing.assert_allclose(chaos.quantiles([0.1, 0.5, 0.9])[:, 0, 0], [0.1, 0.5, 0.9], atol=1e-3)
    np.testing.assert_allclose(chaos.density([0.3, 0.6], "y", 0.0), [1, 1], atol=0.03)


def test_step_and_interaction():
    """Of sign(a) sign(b) + sign(a) / 2 the variance is 5/4: a has 1/5 alone, b nothing, their interaction 4/5."""

    def function(x):
        return np.sign(x[:, 0]) * np.sign(x[:, 1]) + np.sign(x[:, 0]) / 2

    chaos = pieces(function, divided(space_of(U, N), (0, 0), (0, 1), (2, 1)), 1)
    np.testing.assert_allclose(chaos.variance[0], 1.25 * (1 + TIMES) ** 2)
    np.testing.assert_allclose(chaos.sobol_first[:, 0, 1], [0.2, 0], atol=1e-12)
    np.testing.assert_allclose(chaos.sobol_total[:, 0, 1], [1, 0.8], atol=1e-12)
    np.testing.assert_allclose(chaos.sobol_second[0, 1, 0], 0.8, atol=1e-12)


@pytest.mark.thorough
def test_indices_by_numerical_integration():
    """On a partition that is no grid, with any coefficients, indices are those of nested midpoint sums."""
    space, rng = space_of(U, U, U), np.random.default_rng(5)
    boxes = divided(space, *CUTS, (2, 2), (5, 2))
    axes, terms = labels(["y"], ["a", "b", "c"], [0.0]), index_set(3, 2)
    parts = [PolynomialChaos(rng.normal(size=(len(terms), 1, 1)), terms, box.local, axes) for box in boxes]
    chaos = PiecewiseChaos(parts, boxes)
    n = 64  # a power of two: cells do not straddle boxes
    x = (np.arange(n) + 0.5) / n * 2 - 1
    grid = np.array(list(itertools.product(x, x, x)))
    y = chaos.evaluate_germs(grid).reshape(n, n, n)
    assert chaos.mean.item() == pytest.approx(y.mean(), abs=2e-3)
    assert chaos.std.item() == pytest.approx(y.std(), rel=2e-3)
    for k in range(3):
        others = tuple(i for i in range(3) if i != k)
        assert chaos.sobol_first[k].item() == pytest.approx(y.mean(axis=others).var() / y.var(), abs=2e-3)
        assert chaos.sobol_total[k].item() == pytest.approx(1 - y.mean(axis=k).var() / y.var(), abs=2e-3)
    third, fourth = (np.mean(((y - y.mean()) / y.std()) ** p) for p in (3, 4))
    assert chaos.skewness.item() == pytest.approx(third, abs=1e-2)
    assert chaos.kurtosis.item() == pytest.approx(fourth, rel=1e-2)


def test_stated_error():
    """Errors of elements count by their probabilities, whatever the number of points in each; verdicts say them."""

    def function(x):
        return np.exp(x[:, 0]) + np.where(x[:, 0] > 0.5, 1.0, 0.0)

    boxes = divided(space_of(U), (0, 0), (1, 0))
    chaos = pieces(function, boxes, 1, verify=400)
    assert "within" not in chaos.verdicts()[0] and "increase max_elements" in chaos.verdicts(1e-4)[0]
    first = chaos.elements[0]
    fewer = PolynomialChaos(
        first.coefficients, first.multi_index, first.space, first.labels,
        verification_germs=first.verification_germs[:200], verification_response=first.verification_response[:200],
    )  # fmt: skip
    chaos = PiecewiseChaos((fewer, *chaos.elements[1:]), boxes)
    assert chaos.verification_weights.sum() == pytest.approx(1)
    u = (np.arange(4000) + 0.5) / 2000 - 1
    wrong = chaos.evaluate_germs(u[:, None])[:, 0, 0] - function(u[:, None])
    expected = np.sqrt(np.mean(wrong**2)) / chaos.std[0, 0]
    assert chaos.verification_error("y", 0.0) == pytest.approx(expected, rel=0.1)
    merged = np.sqrt(chaos.probabilities @ chaos.element_errors()[:, 0, 0] ** 2)
    assert chaos.verification_error("y", 0.0) == pytest.approx(merged)
    assert chaos.horizon(expected * 2) == {"y": None}
    bare = pieces(function, boxes, 1)
    assert "terms of the highest order contribute" in bare.verdicts()[0]
    with pytest.raises(uqmbd.StudyError, match="no verification realisations"):
        bare.verification_error()


@pytest.mark.thorough
@pytest.mark.parametrize(
    "distributions", [(U, N), (chaospy.Beta(2, 3), chaospy.Weibull(2)), (chaospy.DiscreteUniform(0, 4), U)]
)
def test_storage(tmp_path, distributions):
    """What is read evaluates, samples and states the same, to the bit, and the schema accepts it."""
    boxes = divided(space_of(*distributions), (0, 0), (0, 1), (2, 0))
    terms = [index_set(2, 1), index_set(2, 2), index_set(2, 1), index_set(2, 1)]
    axes, rng = labels([("y", "m")], [("a", "m"), ("b", "m")], TIMES), np.random.default_rng(1)
    parts = []
    for box, index in zip(boxes, terms, strict=True):
        index = index[
            [all(g.values is None or n < g.values for g, n in zip(box.local.germs, row, strict=True)) for row in index]
        ]
        germs = box.local.from_uniform(rng.random((2, 2)))
        parts.append(
            PolynomialChaos(
                rng.normal(size=(len(index), 1, 3)), index, box.local, axes,
                verification_germs=germs, verification_response=rng.normal(size=(2, 1, 3)),
            )
        )  # fmt: skip
    chaos = PiecewiseChaos(parts, boxes)
    node = propagator_node(
        "mine", chaos.statistics(), propagator="p", realisations=9, wall_time=0.0,
        children={"chaos": chaos.to_dataset()},
    )  # fmt: skip
    validate(node)
    save(node, tmp_path / "results.nc")
    found = chaos_from_dataset(load(tmp_path / "results.nc")["chaos"])
    assert isinstance(found, PiecewiseChaos) and repr(found) == repr(chaos)
    for one, other in zip(found.boxes, chaos.boxes, strict=True):
        assert (one.lower, one.upper, one.probability) == (other.lower, other.upper, other.probability)
    for mine, theirs in zip(chaos.sample(50, 2), found.sample(50, 2), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    for name in ("mean", "std", "kurtosis", "sobol_first", "sobol_total"):
        np.testing.assert_array_equal(getattr(found, name), getattr(chaos, name))
    np.testing.assert_array_equal(found.verification_error(), chaos.verification_error())
    assert found.verdicts() == chaos.verdicts()
    with pytest.raises(uqmbd.StudyError, match="contains a polynomial chaos with elements"):
        PolynomialChaos.from_dataset(node["chaos"])


def test_dependent_inputs_and_angles():
    """Shares are of germs where inputs depend on one another; angles have directions."""
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]]))
    boxes = divided(GermSpace.of(JointInput.of([a, b])), (0, 1))
    axes = labels([("angle", "degree", 360.0)], ["a", "b"], [0.0])
    parts = [
        PolynomialChaos([[[s]], [[1.0]]], [[0, 0], [1, 0]], x.local, axes)
        for s, x in zip((179, 183), boxes, strict=True)
    ]
    chaos = PiecewiseChaos(parts, boxes)
    statistics = chaos.statistics()
    assert statistics["circular_mean"].item() == pytest.approx(-179, abs=0.1)
    np.testing.assert_allclose(statistics["sobol_first_germ"].values[:, 0, 0], [0.2, 0.8])
    with pytest.raises(uqmbd.StudyError, match="sobol_first_germ"):
        _ = chaos.sobol_first


def test_what_does_not_fit():
    """Boxes that do not fill the space, or do not belong to the chaoses, are refused."""
    space = space_of(U)
    boxes = divided(space, (0, 0))
    chaos = pieces(lambda x: x[:, 0], boxes, 1)
    with pytest.raises(uqmbd.StudyError, match="sum of the probabilities of the boxes is 0.5"):
        PiecewiseChaos(chaos.elements[:1], boxes[:1])
    with pytest.raises(uqmbd.StudyError, match="2 polynomial chaoses and 1 boxes"):
        PiecewiseChaos(chaos.elements, boxes[:1])
    other = PolynomialChaos([[[1.0]]], [[0]], boxes[1].local, labels(["z"], ["a"], [0.0]))
    with pytest.raises(uqmbd.StudyError, match="same outputs"):
        PiecewiseChaos((chaos.elements[0], other), boxes)
    with pytest.raises(uqmbd.StudyError, match=r"\(K, 1\)"):
        chaos.evaluate_germs([1.0])
