"""Derivatives of surrogates with respect to inputs, held against central differences of what they evaluate."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import AlignedElement, QuasiPeriodicElement, labels
from uqmbd.randomness import GermBox, GermSpace, JointInput, index_set
from uqmbd.results import AlignedChaos, ComposedChaos, PiecewiseChaos, PolynomialChaos, QuasiPeriodicChaos

TIMES = np.linspace(0.0, 2.0, 9)
DISTRIBUTIONS = {
    "normal": chaospy.Normal(0.4, 0.05),
    "uniform": chaospy.Uniform(-1, 3),
    "beta": chaospy.Beta(2, 3, 0, 4),
    "gamma": chaospy.Gamma(3, 0.5, shift=1),
    "lognormal": chaospy.LogNormal(0.1, 0.2),
    "falling": -1.5 * chaospy.LogNormal(0.0, 0.3) + 4,
    "triangle": chaospy.Triangle(0, 1, 3),
    "truncated": chaospy.TruncNormal(0.2, 2.0, 1.0, 0.5),
    "student": chaospy.StudentT(12),
}
KINDS = ("polynomial", "piecewise", "aligned", "quasi-periodic", "composed")


def space_of(names, *, joint=None):
    """Germs of independent inputs, or of those of a joint distribution."""
    if joint is not None:
        return GermSpace.of(JointInput.of(uqmbd.random_vector(("a", "b"), joint)))
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"v{k}", DISTRIBUTIONS[x]) for k, x in enumerate(names)]))


def made(kind, space, seed, outputs=("x", "y")):
    """A surrogate with random coefficients that fall with the degree."""
    draw, terms = np.random.default_rng(seed), index_set(space.dimension, 2)
    axes = labels(list(outputs), list(space.inputs), TIMES)
    falling = 4.0 ** -terms.sum(axis=1)

    def fallen(*shape):
        return draw.normal(size=(len(terms), *shape)) * falling.reshape(-1, *(1,) * len(shape))

    def boxes():
        return GermBox.whole(space).split(0)

    if kind == "polynomial":
        return PolynomialChaos(fallen(*axes.shape), terms, space, axes)
    if kind == "piecewise":
        return PiecewiseChaos([PolynomialChaos(fallen(*axes.shape), terms, b.local, axes) for b in boxes()], boxes())
    if kind == "aligned":
        elements = []
        for box in boxes():
            edges = 0.01 * fallen(4)
            edges[0] = 0.0, 0.63, 1.31, 2.4
            edges[:, 0] *= 0
            elements.append(AlignedElement(box, ("hit", "hit", ""), edges, fallen(3, len(outputs), 4)))
        return AlignedChaos(tuple(elements), terms, axes)
    if kind == "quasi-periodic":
        lattice = np.array([[1, 0], [0, 1], [2, -1]])
        elements = []
        for box in boxes():
            rates = 0.3 * fallen(2)
            rates[0] = 3.0, 4.2
            waves = fallen(len(outputs), 3) + 1j * fallen(len(outputs), 3)
            elements.append(QuasiPeriodicElement(box, rates, fallen(len(outputs)), fallen(len(outputs)), waves))
        return QuasiPeriodicChaos(tuple(elements), lattice, 0.25, terms, axes)
    parts = {
        "plain": made("polynomial", space, seed, outputs[1:]),
        "hits": made("aligned", space, seed + 1, outputs[:1]),
    }
    return ComposedChaos(parts, tuple(outputs))


def differences(chaos, points, step):
    """Central differences of fourth order (K, d, O, T), and how large the values are."""
    scale = np.ptp(chaos.space.to_inputs(chaos.space.from_uniform(np.array([[0.25], [0.75]]) + 0 * points[:1])), axis=0)
    found = []
    for k in range(points.shape[1]):
        values = []
        for times in (-2, -1, 1, 2):
            moved = points.copy()
            moved[:, k] += times * step * scale[k]
            values.append(chaos.evaluate(moved))
        one, two, three, four = values
        found.append((one - 8 * two + 8 * three - four) / (12 * step * scale[k]))
    return np.stack(found, axis=1), scale


def inner(chaos, count, seed):
    """Inputs away from the ends of supports."""
    uniform = np.random.default_rng(seed).uniform(0.03, 0.97, (count, chaos.space.dimension))
    return chaos.space.to_inputs(chaos.space.from_uniform(uniform))


def held(chaos, points, *, step=1e-3, tolerance=2e-6):
    """Compare with differences of two steps: where these differ something jumps between the points."""
    gradient = chaos.gradient(points)
    coarse, scale = differences(chaos, points, step)
    fine, _ = differences(chaos, points, step / 2)
    size = np.abs(chaos.evaluate(points)).max() + 1
    scaled = scale[:, None, None] / size
    with np.errstate(invalid="ignore"):
        smooth = np.abs(coarse - fine) * scaled < tolerance
    assert gradient.shape == coarse.shape
    assert smooth.mean() > 0.9
    np.testing.assert_allclose((gradient * scaled)[smooth], (fine * scaled)[smooth], rtol=0, atol=10 * tolerance)


@pytest.mark.thorough
@settings(deadline=None, max_examples=40)
@given(
    kind=st.sampled_from(KINDS),
    names=st.lists(st.sampled_from(sorted(DISTRIBUTIONS)), min_size=1, max_size=3),
    seed=st.integers(0, 999),
)
def test_the_gradient_is_that_of_central_differences(kind, names, seed):
    chaos = made(kind, space_of(names), seed)
    held(chaos, inner(chaos, 12, seed))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "joint",
    [
        chaospy.MvNormal([1, 2], [[0.04, 0.03], [0.03, 0.09]]),
        chaospy.Nataf(chaospy.J(chaospy.Uniform(0, 1), chaospy.LogNormal(0, 0.3)), [[1, 0.6], [0.6, 1]]),
        chaospy.Clayton(chaospy.J(chaospy.Uniform(0, 1), chaospy.Normal(0, 1)), 1.5),
    ],
    ids=["normal", "gaussian-copula", "rosenblatt"],
)
def test_of_dependent_inputs_each_is_moved_while_the_others_are_held(kind, joint):
    chaos = made(kind, space_of((), joint=joint), 3)
    held(chaos, inner(chaos, 12, 4), tolerance=1e-5)


def test_the_gradient_of_a_known_function():
    """x = k**2 + 3 k c, a polynomial that two inputs of other scales span exactly."""
    k, c = (
        uqmbd.RandomVariable("k", chaospy.Normal(100, 5), units="N/m"),
        uqmbd.RandomVariable("c", chaospy.Uniform(0.1, 0.3)),
    )
    space = GermSpace.of(JointInput.of([k, c]))
    terms = index_set(2, 2)
    nodes = np.random.default_rng(0).normal(size=(40, 2)).clip(-0.99, 0.99)
    at = {name: column for name, column in zip(space.inputs, space.to_inputs(nodes).T, strict=True)}
    response = at["k"] ** 2 + 3 * at["k"] * at["c"]
    coefficients = np.linalg.lstsq(space.evaluate(nodes, terms), response[:, None], rcond=None)[0]
    chaos = PolynomialChaos(
        coefficients[..., None],
        terms,
        space,
        labels([("x", "m")], [(n, {"k": "N/m"}.get(n, "")) for n in space.inputs], [0.0]),
    )
    found = chaos.gradient(k=[90.0, 110.0], c=0.2)
    np.testing.assert_allclose(found.sel(input="k", output="x", time=0), [180.6, 220.6], rtol=1e-9)
    np.testing.assert_allclose(found.sel(input="c", output="x", time=0), [270.0, 330.0], rtol=1e-9)
    assert found.dims == ("point", "input", "output", "time")
    assert found.uqmbd.output("x", input="k").attrs["units"] == "m/(N/m)"
    assert "units" not in found.attrs


def test_at_an_edge_the_derivative_is_that_of_the_element_which_holds_the_point():
    space = space_of(["uniform"])
    axes, boxes = labels(["x"], ["v0"], [0.0]), GermBox.whole(space).split(0)
    parts = [
        PolynomialChaos([[[0.0]], [[s]]], [[0], [1]], box.local, axes)
        for s, box in zip((-1.0, 2.0), boxes, strict=True)
    ]
    chaos = PiecewiseChaos(parts, boxes)
    edge = space.to_inputs([[boxes[0].upper[0]]])
    beside = chaos.gradient(np.concatenate([edge - 1e-3, edge, edge + 1e-3])).ravel()
    assert beside[0] == beside[1] < 0 < beside[2]


def test_behind_the_last_landmark_nothing_is_known():
    chaos = made("aligned", space_of(["uniform"]), 0)
    elements = tuple(
        AlignedElement(e.box, e.events, np.where(np.arange(4) < 3, e.edges, e.edges * 0.7), e.segments)
        for e in chaos.elements
    )
    short = AlignedChaos(elements, chaos.multi_index, chaos.labels)
    points = inner(short, 8, 1)
    np.testing.assert_array_equal(np.isnan(short.gradient(points)[:, 0]), np.isnan(short.evaluate(points)))
    assert np.isnan(short.gradient(points)).any()


def test_an_input_outside_its_distribution_is_reported():
    chaos = made("polynomial", space_of(["uniform"]), 0)
    with pytest.raises(uqmbd.StudyError, match="'v0' is 3.5 in row 1, outside the support"):
        chaos.gradient(v0=[0.0, 3.5])
