"""What the page evaluates is what Python evaluates of the same numbers, and near the surrogate that was stored."""

import json

import chaospy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import uqmbd
from tests.report.live.chaoses import DISTRIBUTIONS, KINDS, TIMES, boxes_of, chaos_of, chaoses, space_of
from uqmbd.extend import labels, statistics_dataset
from uqmbd.randomness import GermSpace, JointInput, cumulated
from uqmbd.report.charts import json_script
from uqmbd.report.live import live_method, live_surrogate, packed_surrogate, shipped
from uqmbd.results import propagator_node, study_tree
from uqmbd.results.chaos import random_germs, reference_spread, stored_as

EVALUATED = """
const live = new LiveSurrogate(given.data);
answer = given.germs.map((germs) => {
  const { values, outside, unverified } = live.evaluate(germs);
  const inputs = live.inputsAt(germs);
  return {
    values: Array.from(values), outside, unverified,
    inputs: Array.from(inputs),
    back: Array.from(germs, (_, k) => live.germOf(k, inputs[k], germs)),
    levels: Array.from(germs, (x, k) => live.level(k, x)),
  };
});
"""

OFTEN = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=10, deadline=None)


def evaluated(node, data, germs):
    """What the page makes of germs (K, d): a list of dictionaries."""
    given = {"data": json.loads(json_script(data)), "germs": np.asarray(germs).tolist()}
    return node(["surrogate.js"], EVALUATED, given)


def values_of(answer, chaos):
    """Values (K, O, T)."""
    return np.array([one["values"] for one in answer], dtype=float).reshape(len(answer), *chaos.labels.shape)


def lost(chaos, data, count=2000):
    """What the compression loses, over a tenth of the stated error (or a millionth of the spread): its maximum."""
    germs = random_germs(chaos.space, count, 5)
    whole = chaos.evaluate_germs(germs)
    loss = np.sqrt(np.nanmean((shipped(chaos, data).evaluate_germs(germs) - whole) ** 2, axis=0))
    least = 1e-6 * reference_spread(np.nan_to_num(np.nanstd(whole, axis=0))) + 1e-14 * np.nanmax(np.abs(whole))
    stated = chaos.verification_rms() if chaos.verification_germs is not None else 0 * least
    return np.nanmax(loss / np.maximum(0.1 * np.nan_to_num(stated), least))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_the_page_evaluates_what_is_shipped(node, kind):
    """To 1e-10 of the largest value, at random germs; NaN where Python has it; inputs, too."""

    @OFTEN
    @given(chaoses(kind), st.integers(0, 99))
    def holds(chaos, seed):
        data = packed_surrogate(chaos)
        germs = random_germs(chaos.space, 20, seed)
        answer = evaluated(node, data, germs)
        expected = shipped(chaos, data).evaluate_germs(germs)
        found = values_of(answer, chaos)
        np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.nanmax(np.abs(expected)))
        assert not any(one["outside"] for one in answer)
        inputs = chaos.space.to_inputs(germs)
        np.testing.assert_allclose([one["inputs"] for one in answer], inputs, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose([one["back"] for one in answer], germs, rtol=1e-9, atol=1e-9)
        assert lost(chaos, data) <= 1  # at other germs than those at which it was measured

    holds()


@pytest.mark.parametrize("error", [0.1, 1e-4])
@pytest.mark.parametrize("kind", KINDS)
def test_the_compression_loses_less_than_a_tenth_of_the_stated_error(kind, error):
    space = space_of(["normal", "uniform"])
    chaos = chaos_of(kind, space, boxes_of(space, [(0, 0)]), 4, 3, error=error)
    data = packed_surrogate(chaos)
    assert data["loss"] <= 1 and lost(chaos, data) <= 1
    if kind == "polynomial":
        # exactly, since its terms are orthonormal
        change = shipped(chaos, data).coefficients - chaos.coefficients
        assert np.all(np.sqrt((change**2).sum(axis=0)) <= 0.1 * chaos.verification_rms())


def test_a_larger_stated_error_takes_fewer_numbers():
    space = space_of(["normal", "uniform", "gamma"])
    sizes = [
        len(json_script(packed_surrogate(chaos_of("polynomial", space, [], 5, 3, error=error))["parts"]))
        for error in (0.3, 1e-2, 1e-5)
    ]
    assert sizes[0] < sizes[1] < sizes[2]


def test_what_cannot_be_shortened_is_kept_whole():
    """Coefficients that are noise in time have as many components as times, or terms."""
    space = space_of(["normal"])
    chaos = chaos_of("polynomial", space, [], 9, 0, error=0.0)
    noise = np.random.default_rng(0).normal(size=chaos.coefficients.shape)
    data = packed_surrogate(type(chaos)(noise, chaos.multi_index, space, chaos.labels))
    assert all(one["right"] is None for one in data["parts"][0]["field"]["outputs"])
    assert data["loss"] <= 1


def test_an_output_that_does_not_vary_stays_as_it_is(node):
    space = space_of(["normal"])
    chaos = chaos_of("polynomial", space, [], 2, 0)
    still = chaos.coefficients.copy()
    still[1:, 0] = 0.0
    still[0, 0] = 1e6 / 3
    chaos = type(chaos)(still, chaos.multi_index, space, chaos.labels)
    (answer,) = values_of(evaluated(node, packed_surrogate(chaos), [[0.7]]), chaos)
    assert np.all(answer[0] == 1e6 / 3)


def test_outputs_without_times(node):
    space = space_of(["uniform", "normal"])
    chaos = chaos_of("polynomial", space, [], 3, 1, times=None)
    germs = random_germs(space, 5, 0)
    data = packed_surrogate(chaos)
    found = values_of(evaluated(node, data, germs), chaos)
    np.testing.assert_allclose(found, shipped(chaos, data).evaluate_germs(germs), rtol=1e-12)


def test_germs_beyond_the_domain_are_reported(node):
    """Beyond the support: outside, and no value from elements; beyond the verification realisations: unverified."""
    space = space_of(["uniform", "normal"])
    chaos = chaos_of("elements", space, boxes_of(space, [(0, 0)]), 2, 0)
    inside, far, beyond, wrong = evaluated(
        node, packed_surrogate(chaos), [[0.1, 0.0], [0.1, 7.0], [1.5, 0.0], [float("nan")] * 2][:3] + [[-1.01, 0.0]]
    )
    low, high = chaos.verification_germs[:, 0].min(), chaos.verification_germs[:, 0].max()
    assert inside["outside"] == [] and (0 in inside["unverified"]) == (not low <= 0.1 <= high)
    assert far["outside"] == [] and 1 in far["unverified"]
    assert beyond["outside"] == [0] and wrong["outside"] == [0]


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(DISTRIBUTIONS))
def test_levels_are_those_of_the_distribution(node, name):
    """Within the error that the table states; between the ends of the slider."""
    space = space_of([name])
    data = packed_surrogate(chaos_of("polynomial", space, [], 1, 0))
    (about,) = data["germs"]
    germs = random_germs(space, 2000, 0)
    germs = germs[(germs[:, 0] >= about["range"][0]) & (germs[:, 0] <= about["range"][1])]
    error = about["table"]["error"] if about["table"] else 0.0
    assert error < 1e-4
    found = np.array([one["levels"][0] for one in evaluated(node, data, germs)])
    assert np.abs(found - cumulated(space.germs[0], germs[:, 0])).max() <= error + 1e-15


@pytest.mark.parametrize("copula", ["vector", "nataf"])
def test_dependent_inputs_have_the_values_of_all_germs(node, copula):
    """A Gaussian copula is kept: exactly with normal marginals, within the stated error of the table with others."""
    if copula == "vector":
        variables = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1.0, 2.0], [[0.04, 0.03], [0.03, 0.09]]))
    else:
        marginals = chaospy.J(chaospy.Gamma(2.5, 0.3), chaospy.Triangle(0.0, 1.0, 3.0))
        variables = uqmbd.random_vector(["a", "b"], chaospy.Nataf(marginals, [[1.0, 0.5], [0.5, 1.0]]))
    space = GermSpace.of(JointInput.of(list(variables)))
    chaos = chaos_of("polynomial", space, [], 2, 0)
    data = packed_surrogate(chaos)
    germs = random_germs(space, 40, 0)
    answer = evaluated(node, data, germs)
    inputs = space.to_inputs(germs)
    error = [one["map"]["table"]["error"] if one["map"]["kind"] == "table" else 1e-12 for one in data["inputs"]]
    assert max(error) < 1e-4 and not any(one["reason"] for one in data["inputs"])
    assert np.all(np.abs(np.array([one["inputs"] for one in answer]) - inputs) <= np.array(error) + 1e-14)
    np.testing.assert_allclose([one["back"] for one in answer], germs, rtol=1e-6, atol=1e-9)


def test_a_general_joint_distribution_is_refused_by_its_reason(node):
    variables = uqmbd.random_vector(
        ["a", "b"], chaospy.Clayton(chaospy.J(chaospy.Uniform(0, 1), chaospy.Uniform(0, 1)), 2.0)
    )
    space = GermSpace.of(JointInput.of(list(variables)))
    chaos = chaos_of("polynomial", space, [], 2, 0)
    data = packed_surrogate(chaos)
    assert all("joint distribution" in one["reason"] for one in data["inputs"])
    (answer,) = evaluated(node, data, [[0.2, 0.3]])
    assert answer["inputs"] == [None, None] and np.isfinite(answer["values"]).all()


def test_samples_alone_are_refused_with_a_reason():
    axes = labels(["x"], ["a"], TIMES)
    still = np.zeros((1, len(TIMES)))
    made = propagator_node(
        "mc", statistics_dataset(axes, mean=still, std=still), propagator="p", realisations=1, wall_time=0.0
    )
    assert "samples, but no surrogate" in live_surrogate(made)["reason"]


def test_a_surrogate_that_is_too_large_for_a_page_is_refused_with_its_size():
    chaos = chaos_of("polynomial", space_of(["normal"]), [], 2, 0)
    made = propagator_node(
        "m",
        chaos.statistics(),
        propagator="p",
        realisations=1,
        wall_time=0.0,
        children={stored_as(chaos): chaos.to_dataset()},
    )
    assert "0.0 MB" in live_surrogate(made, most=1000)["reason"]
    assert set(live_surrogate(made)) == set(packed_surrogate(chaos))


def test_the_page_has_the_surrogate_that_is_recommended_or_states_the_least_error():
    """The cheaper of two that agree; where nothing is compared, the better one; none where there is none."""

    def tree_of(*errors, compared):
        nodes = []
        for label, error in zip("ab", errors, strict=False):
            chaos = chaos_of("polynomial", space_of(["normal"]), [], 3, 0, error=error)
            cost = {"a": 100, "b": 10}[label]
            children = {"chaos": chaos.to_dataset()}
            known = {"propagator": "p", "realisations": cost, "wall_time": cost / 100}
            nodes.append(propagator_node(label, chaos.statistics(), children=children, **known))
        whole = study_tree(nodes, study="s", mechanism="m")
        return whole if compared else whole.drop_nodes("comparison")

    cheaper, better = tree_of(1e-4, 2e-4, compared=True), tree_of(1e-3, 2e-3, compared=True)
    for tree, label in ((cheaper, "b"), (better, "a")):
        assert live_method(tree) == label
        assert tree["comparison"].attrs["recommendation"].startswith(f"Use {label}: ")
    assert live_method(tree_of(1e-3, 2e-3, compared=False)) == "a"
    # outputs without a time alone may have one
    bare = tree_of(1e-3, compared=False)
    bare["a/scalars"] = bare["a"].copy()
    bare["a"] = bare["a"].drop_nodes("chaos")
    assert live_method(bare) == "a"
    assert live_method(tree_of(1e-3, 1e-4, compared=False)) == "b"


def test_germs_at_the_ends_of_elements_belong_to_the_lower_one(node):
    """As in Python: a box holds its upper ends, not its lower ones."""
    space = space_of(["uniform"])
    chaos = chaos_of("elements", space, boxes_of(space, [(0, 0), (1, 0)]), 2, 0)
    germs = np.array([[-1.0], [0.0], [0.5], [1.0]])
    data = packed_surrogate(chaos)
    found = values_of(evaluated(node, data, germs), chaos)
    expected = shipped(chaos, data).evaluate_germs(germs)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_hostile_names_stay_names(node):
    name = "<img src=x onerror=alert(1)>"
    space = space_of(["normal"])
    chaos = chaos_of("polynomial", space, [], 1, 0, outputs=(name, "y"))
    text = json_script(packed_surrogate(chaos))
    assert "<" not in text and json.loads(text)["outputs"][0]["name"] == name
