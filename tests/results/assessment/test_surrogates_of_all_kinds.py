"""What reads a surrogate reads it whatever its kind: plain, aligned, of elements, or composed of several."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

import uqmbd
from uqmbd.extend import AlignedElement, labels
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.results import AlignedChaos, ComposedChaos, PolynomialChaos, propagator_node, validate
from uqmbd.results.assessment.error_sentences import own_statements
from uqmbd.results.assessment.own_errors import own_error
from uqmbd.results.chaos import stored_as
from uqmbd.results.statistics import settled
from uqmbd.testing.propagators import stated_errors
from uqmbd.testing.propagators.moments import ERRORS

TIMES = np.linspace(0, 1, 5)
TERMS = np.array([[0], [1], [2]])
KINDS = ("chaos", "aligned", "composed")


def chaos(kind, outputs, count, seed):
    """A chaos of one input with `count` verification realisations; a composed one has the first output aligned."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("u", chaospy.Uniform(-1, 1))]))
    draw = np.random.default_rng(seed)
    if kind == "composed":
        parts = {"plain": chaos("chaos", outputs[1:], count, seed), "phase": chaos("aligned", outputs[:1], count, seed)}
        return ComposedChaos(parts, tuple(outputs))
    axes, verified = labels(list(outputs), ["u"], TIMES), {}
    if count:
        points = np.random.default_rng(count).uniform(-1, 1, (count, 1))
        verified = {
            "verification_germs": points,
            "verification_response": draw.normal(size=(count, len(outputs), len(TIMES))),
        }
    if kind == "chaos":
        return PolynomialChaos(draw.normal(size=(3, len(outputs), len(TIMES))), TERMS, space, axes, **verified)
    edges = np.zeros((3, 3))
    edges[0], edges[1, 1] = (0.0, 0.5, 1.0), 0.05
    element = AlignedElement(GermBox.whole(space), ("", ""), edges, draw.normal(size=(3, 2, len(outputs), 3)), "phase")
    return AlignedChaos((element,), TERMS, axes, **verified)


def node_of(whole):
    """The node of a method that holds it."""
    children = whole.to_datasets() if isinstance(whole, ComposedChaos) else {stored_as(whole): whole.to_dataset()}
    return propagator_node("mine", whole.statistics(), propagator="p", realisations=9, wall_time=0.0, children=children)


@pytest.mark.thorough
@settings(deadline=None, max_examples=12)
@given(kind=st.sampled_from(KINDS), count=st.integers(1, 40), seed=st.integers(0, 99))
def test_the_margin_is_that_of_the_realisations_which_there_were(kind, count, seed):
    """The bound of the bias counts the verification realisations by chi-squared; the acceptance test allows for it."""
    whole = chaos(kind, ("x", "y"), count, seed)
    node = node_of(whole)
    found, error = own_error(node), whole.verification_error()
    spread = np.maximum(whole.std, 0.01 * whole.std.max(axis=1, keepdims=True))
    np.testing.assert_allclose(found.bias, np.sqrt(count / chi2.ppf(0.01, count)) * error * spread, rtol=1e-9)
    statistics = node["statistics"].to_dataset()
    sampled = [statistics[n].values if n in statistics else 0.0 for n in ("std_error_mean", "std_error_std")]
    assert ("std_error_std" in statistics) == (kind != "chaos")  # moments of polynomials are exact
    np.testing.assert_allclose(found.stated_at, error + 1.96 * np.maximum(*sampled) / spread)
    assert found.order == 2
    for allowed, noise in zip(stated_errors(node), sampled, strict=True):
        np.testing.assert_allclose(allowed, 3 * error * spread + ERRORS * noise)


@pytest.mark.parametrize("kind", KINDS)
def test_top_orders_are_those_of_expansions_at_equal_times(kind):
    """Each output's, wherever its coefficients are stored; of aligned ones it is not known."""
    whole = chaos(kind, ("x", "y"), 3, 1)
    plain = {"chaos": whole, "aligned": None, "composed": getattr(whole, "parts", {}).get("plain")}[kind]
    known = {"chaos": [True, True], "aligned": [False, False], "composed": [False, True]}[kind]
    found = own_error(node_of(whole)).top_order
    np.testing.assert_array_equal(np.isfinite(found), known)
    if plain is not None:
        square = plain.coefficients**2
        part = np.sqrt(square[2].sum(axis=-1) / square[1:].sum(axis=(0, 2)))
        np.testing.assert_allclose(found[known], part)


@pytest.mark.thorough
def test_statements_name_what_helps_and_what_is_known():
    """An aligned chaos of one element needs a higher order; without verification plain outputs tell their decay."""
    said = own_statements(node_of(chaos("composed", ("x", "y"), 3, 1)))
    assert all("raise the order" in text and "elements" not in text for text in said)
    without = own_statements(node_of(chaos("composed", ("x", "y"), 0, 1)))
    assert without[0] == "states no error" and "order" in without[1]
    assert without[1] == own_statements(node_of(chaos("chaos", ("y",), 0, 1)))[0]


@pytest.mark.parametrize("kind", KINDS)
def test_what_varies_at_the_realisations_is_not_settled(kind):
    """A surrogate that is constant, of an output that is not, keeps its error of 1."""
    from uqmbd.results.chaos import verified_std

    whole = chaos(kind, ("x", "y"), 6, 2)
    node = node_of(whole)
    seen = verified_std(node, (2, len(TIMES)))
    np.testing.assert_allclose(seen, whole.verification_response.std(axis=0), rtol=1e-14)
    still = whole.statistics()
    still = still.assign(std=still["std"] * 0, variance=still["variance"] * 0)
    np.testing.assert_array_equal(
        settled(still, 1e-6, seen)["verification_error"].values, still["verification_error"].values
    )
    assert not settled(still, 1e-6)["verification_error"].values.any()
    validate(node)


def spoilt(node, path, change):
    """The node with one of its datasets changed."""
    made = node.copy(deep=True)
    made[path].dataset = change(made[path].to_dataset(inherit=False))
    return made


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.drop_vars("segment_coefficients"), "no variable 'segment_coefficients'"),
        (lambda d: d.assign(segment_coefficients=d["segment_coefficients"] * np.nan), "not finite"),
        (lambda d: d.assign(edge_coefficients=d["edge_coefficients"] * np.inf), "not finite"),
        (lambda d: d.assign(multi_index=d["multi_index"] - 1), "a negative degree"),
        (lambda d: d.assign(upper=d["lower"]), "not below 'upper'"),
        (lambda d: d.assign_coords(time=d["time"] + 1.0), "other than that of 'statistics'"),
        (lambda d: d.assign_coords(output=[f"{x}_" for x in d["output"].values]), "other than that of 'statistics'"),
    ],
)
@pytest.mark.parametrize("kind", ["aligned", "composed"])
def test_breaches_in_aligned_surrogates_are_reported(kind, change, message):
    """Wherever one is stored: alone, or as a part of a composed one."""
    node = node_of(chaos(kind, ("x", "y"), 2, 1))
    path = "aligned" if kind == "aligned" else "composed/phase/aligned"
    validate(node)
    with pytest.raises(uqmbd.StudyError, match=f"{path}.*{message}"):
        validate(spoilt(node, path, change))


def test_a_composed_surrogate_has_each_output_once():
    node = node_of(chaos("composed", ("x", "y"), 2, 1))
    for place, message in ((1, "other than that of"), (7, "numbers of outputs"), (0.5, "numbers of outputs")):
        with pytest.raises(uqmbd.StudyError, match=message):
            validate(spoilt(node, "composed/phase/aligned", lambda d, k=place: d.assign(place=("output", [k]))))
    del node["composed"]["plain"]
    with pytest.raises(uqmbd.StudyError, match="in no part or in several"):
        validate(node)
