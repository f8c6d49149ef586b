"""A chaos composed of parts of different kinds is what its parts are, output by output."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from tests.report.live.chaoses import chaos_of, space_of
from uqmbd.extend import AlignedElement, labels
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.report.figures import order_of, surrogate_of
from uqmbd.report.view import Method
from uqmbd.results import (
    AlignedChaos,
    ComposedChaos,
    PolynomialChaos,
    load,
    propagator_node,
    save,
    study_tree,
    surrogate,
)
from uqmbd.results.chaos import stored_as

TIMES = np.linspace(0, 1, 7)


def parts():
    """Polynomials of two outputs, b and c, and an aligned chaos of two others, a and d, of the same two inputs."""
    inputs = [uqmbd.RandomVariable("u", chaospy.Uniform(-1, 1)), uqmbd.RandomVariable("v", chaospy.Normal(0, 1))]
    space = GermSpace.of(JointInput.of(inputs))
    draw = np.random.default_rng(0)
    terms = [[0, 0], [1, 0], [0, 1], [1, 1]]
    points, known = draw.uniform(-1, 1, (5, 2)), draw.normal(size=(5, 4, 7))
    verified = {"verification_germs": points}
    plain = PolynomialChaos(
        draw.normal(size=(4, 2, 7)),
        terms,
        space,
        labels(["b", "c"], ["u", "v"], TIMES),
        verification_response=known[:, 1:3],
        **verified,
    )
    edges = np.zeros((4, 3))
    edges[0], edges[1, 1] = (0.0, 0.5, 1.0), 0.05
    element = AlignedElement(GermBox.whole(space), ("hit", ""), edges, draw.normal(size=(4, 2, 2, 3)))
    aligned = AlignedChaos(
        (element,),
        np.array(terms),
        labels([("a", "m"), "d"], ["u", "v"], TIMES),
        verification_response=known[:, [0, 3]],
        **verified,
    )
    return plain, aligned, known


def composed():
    plain, aligned, _ = parts()
    return ComposedChaos({"plain": plain, "events": aligned}, ("a", "b", "c", "d"))


@pytest.mark.thorough
def test_outputs_are_those_of_the_parts():
    """Values, moments, indices, quantiles, densities and stated errors of each output are its part's, to the bit."""
    plain, aligned, known = parts()
    whole = ComposedChaos({"plain": plain, "events": aligned}, ("a", "b", "c", "d"))
    owners = {"a": (aligned, 0), "b": (plain, 0), "c": (plain, 1), "d": (aligned, 1)}
    assert [o.name for o in whole.labels.outputs] == list(owners) and whole.labels.outputs[0].units == "m"
    np.testing.assert_array_equal(whole.verification_response, known)
    germs = np.random.default_rng(1).uniform(-1, 1, (9, 2))
    for row, (name, (part, k)) in enumerate(owners.items()):
        np.testing.assert_array_equal(whole.evaluate_germs(germs)[:, row], part.evaluate_germs(germs)[:, k])
        for what in ("mean", "std", "variance", "skewness", "kurtosis"):
            np.testing.assert_array_equal(getattr(whole, what)[row], getattr(part, what)[k])
        for what in ("sobol_first", "sobol_total"):
            np.testing.assert_array_equal(getattr(whole, what)[:, row], getattr(part, what)[:, k])
        np.testing.assert_array_equal(whole.quantiles([0.1, 0.5])[:, row], part.quantiles([0.1, 0.5])[:, k])
        where = np.linspace(-3, 3, 5)
        np.testing.assert_array_equal(whole.density(where, name, TIMES[2]), part.density(where, name, TIMES[2]))
        np.testing.assert_array_equal(whole.verification_error(name), part.verification_error(name))
        assert whole.verdicts()[row] == part.verdicts()[k]
        assert whole.horizon()[name] == part.horizon()[name]


@pytest.mark.thorough
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_an_output_changes_between_parts_over_time(seed, verified):
    """Values, moments, shapes, samples and stated errors are at each time those of the part that has it."""
    space = space_of(("normal", "uniform"))
    whole = chaos_of("changing", space, [GermBox.whole(space)], 2, seed, error=1e-3 if verified else 0)
    one, other = whole.parts.values()
    first = whole.used["polynomial"]
    germs = np.random.default_rng(seed).uniform(-1, 1, (5, 2))

    def chosen(read):
        return np.where(first, read(one), read(other))

    np.testing.assert_array_equal(whole.evaluate_germs(germs), chosen(lambda part: part.evaluate_germs(germs)))
    for name in ("mean", "std", "skewness", "sobol_first", "sobol_total"):
        np.testing.assert_array_equal(getattr(whole, name), chosen(lambda part, x=name: getattr(part, x)))
    quantiles = chosen(lambda part: part.quantiles([0.1, 0.9]))  # of samples in blocks, which differ
    np.testing.assert_allclose(whole.quantiles([0.1, 0.9]), quantiles, rtol=1e-12, atol=1e-13)
    if verified:
        np.testing.assert_array_equal(whole.verification_rms(), chosen(lambda part: part.verification_rms()))
    paths = {path.split("/")[1]: (path.split("/")[2], data) for path, data in whole.to_datasets().items()}
    again = ComposedChaos.from_datasets(paths)
    np.testing.assert_array_equal(again.evaluate_germs(germs), whole.evaluate_germs(germs))
    node = propagator_node(
        "mine", whole.statistics(), propagator="p", realisations=2, wall_time=0.0, children=whole.to_datasets()
    )
    some = surrogate(node, "y").evaluate_germs(germs)[:, 0]
    np.testing.assert_allclose(some, whole.evaluate_germs(germs)[:, 1], rtol=1e-12, atol=1e-13)
    some = surrogate(node, times=[3, 7]).evaluate_germs(germs)
    np.testing.assert_allclose(some, whole.evaluate_germs(germs)[..., [3, 7]], rtol=1e-12, atol=1e-13)


@pytest.mark.thorough
def test_stored_in_one_node_and_read_whole_or_by_output(tmp_path):
    """Bits survive a file; an output is read from its part alone; figures and sections find them."""
    whole = composed()
    node = propagator_node(
        "mine",
        whole.statistics(),
        propagator="p",
        realisations=2,
        wall_time=0.0,
        children=whole.to_datasets(),
    )
    save(study_tree([node], study="s", mechanism="m"), tmp_path / "results.nc")
    read = load(tmp_path / "results.nc")
    points = [[0.1, 0.2], [-0.7, 1.5]]
    again = surrogate(read["mine"])
    assert isinstance(again, ComposedChaos) and list(again.parts) == ["plain", "events"]
    np.testing.assert_array_equal(again.evaluate(points), whole.evaluate(points))
    np.testing.assert_array_equal(again.verification_error(), whole.verification_error())
    for row, name in enumerate("abcd"):
        one = surrogate(read["mine"], name)
        assert stored_as(one) == ("aligned" if name in "ad" else "chaos")
        np.testing.assert_array_equal(one.evaluate(points)[:, 0], whole.evaluate(points)[:, row])
        np.testing.assert_array_equal(
            surrogate(read["mine"], name, times=[2, 5]).evaluate(points)[:, 0], whole.evaluate(points)[:, row, [2, 5]]
        )
    with pytest.raises(uqmbd.StudyError, match="no output 'e'; its outputs are"):
        surrogate(read["mine"], "e")
    assert order_of(read["mine"]) == 1 and isinstance(surrogate_of(read["mine"]), ComposedChaos)
    assert Method("mine", read["mine"]).surrogate_data.sizes["term"] == 4


def test_an_output_missing_or_twice_is_refused():
    plain, aligned, _ = parts()
    with pytest.raises(
        uqmbd.StudyError, match="contain b, c, a, d; expected each of the outputs a, b, c exactly once at each time"
    ):
        ComposedChaos({"plain": plain, "events": aligned}, ("a", "b", "c"))


@pytest.mark.thorough
@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 2), min_size=5, max_size=5), st.permutations(range(5)), st.integers(0, 2**32 - 1))
def test_any_partition_of_a_chaos_is_the_chaos(owners, order, seed):
    """Outputs of one polynomial chaos, dealt to up to three parts in any order, give it back in all that it tells."""
    inputs = [uqmbd.RandomVariable("u", chaospy.Uniform(-1, 1)), uqmbd.RandomVariable("v", chaospy.Normal(0, 1))]
    space = GermSpace.of(JointInput.of(inputs))
    draw = np.random.default_rng(seed)
    names, terms = [f"y{k}" for k in range(5)], [[0, 0], [1, 0], [0, 1], [1, 1]]
    germs, known, coefficients = draw.uniform(-1, 1, (4, 2)), draw.normal(size=(4, 5, 3)), draw.normal(size=(4, 5, 3))

    def some(rows):
        axes = labels([names[k] for k in rows], ["u", "v"], TIMES[:3])
        return PolynomialChaos(coefficients[:, rows], terms, space, axes, germs, known[:, rows])

    dealt = {f"part{n}": rows for n in range(3) if (rows := [k for k in order if owners[k] == n])}
    whole, composed = some(list(range(5))), ComposedChaos({n: some(rows) for n, rows in dealt.items()}, tuple(names))
    again = ComposedChaos.from_datasets(
        {path.split("/")[1]: ("chaos", data) for path, data in composed.to_datasets().items()}
    )
    for found in (composed, again):
        assert found.labels == whole.labels or [o.name for o in found.labels.outputs] == names
        close = {"rtol": 1e-12, "atol": 1e-12}
        np.testing.assert_allclose(found.evaluate_germs(germs), whole.evaluate_germs(germs), **close)
        for what in ("mean", "std", "variance", "skewness", "kurtosis", "sobol_first", "sobol_total"):
            np.testing.assert_allclose(getattr(found, what), getattr(whole, what), **close)
        np.testing.assert_allclose(found.verification_error(), whole.verification_error(), **close)
        np.testing.assert_allclose(found.verification_response, known, rtol=0)
        np.testing.assert_allclose(found.quantiles([0.2], samples=64), whole.quantiles([0.2], samples=64), **close)
        assert found.verdicts() == whole.verdicts() and found.discontinuities() == whole.discontinuities()
