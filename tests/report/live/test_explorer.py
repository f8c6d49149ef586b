"""Sliders: where they stand, what they say of a distribution, and how they get to the means."""

import re

import chaospy
import numpy as np
import pytest
from scipy import stats

import uqmbd
from tests.report.live.chaoses import DISTRIBUTIONS, chaos_of, space_of
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.report.live import collect_explorer_data, packed_surrogate
from uqmbd.results import propagator_node, study_tree

MEANS = """
const surrogate = new LiveSurrogate(given);
const germs = meanGerms(surrogate);
answer = [Array.from(germs), Array.from(surrogate.inputsAt(germs))];
"""


def data_of(space, order=2):
    """The data of a surrogate over a space."""
    return packed_surrogate(chaos_of("polynomial", space, [], order, 0))


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_inputs_are_reset_to_their_means(node, name):
    """The mean of Chaospy; of few values the nearest one."""
    distribution = DISTRIBUTIONS[name]()
    data = data_of(space_of([name]))
    found = node(["germs.js", "surrogate.js"], MEANS, data)[1][0]
    mean = float(np.asarray(uqmbd.RandomVariable("x", distribution).distribution.mom(1)).item())
    assert data["inputs"][0]["mean"] == pytest.approx(mean, rel=1e-6)
    if name == "discrete":
        assert found == pytest.approx(round(mean))
    else:
        assert found == pytest.approx(mean, rel=1e-6)


def test_dependent_inputs_are_reset_to_their_means_together(node):
    marginals = chaospy.J(chaospy.Gamma(2.5, 0.3), chaospy.Triangle(0.0, 1.0, 3.0))
    variables = uqmbd.random_vector(["a", "b"], chaospy.Nataf(marginals, [[1.0, 0.5], [0.5, 1.0]]))
    space = GermSpace.of(JointInput.of(list(variables)))
    germs, inputs = node(["germs.js", "surrogate.js"], MEANS, data_of(space))
    means = [2.5 * 0.3, 4 / 3]
    np.testing.assert_allclose(inputs, means, rtol=1e-5)
    np.testing.assert_allclose(space.to_inputs(np.array([germs]))[0], means, rtol=1e-4)


RANDOM = """
const surrogate = new LiveSurrogate(given.data);
let k = 0;
answer = given.shares.map(() => Array.from(randomGerms(surrogate, () => given.shares[k++])));
"""


@pytest.mark.parametrize("name", ["normal", "gamma", "discrete"])
def test_a_random_realisation_has_its_probability(node, name):
    """What a share of the distribution is below, is where the quantile function of Python has it."""
    space = space_of([name])
    shares = np.linspace(0.01, 0.99, 25)
    found = node(["germs.js", "surrogate.js"], RANDOM, {"data": data_of(space), "shares": shares.tolist()})
    np.testing.assert_allclose(np.ravel(found), space.germs[0].from_uniform(shares), rtol=2e-4, atol=1e-5)


PATH = "answer = densityPath(new LiveSurrogate(given), 0, false);"


def test_the_density_along_a_slider_is_that_of_the_germ(node):
    """Against SciPy's normal density; discrete inputs have bars as high as their probabilities."""
    data = data_of(space_of(["normal"]))
    path = node(["input_row.js", "surrogate.js"], PATH, data)
    points = np.array(re.findall(r"[L ]?([\d.e-]+) ([\d.e-]+)(?=L)", path.split("L", 1)[1]), dtype=float)
    low, high = data["germs"][0]["range"]
    expected = stats.norm.pdf(low + points[:, 0] * (high - low))
    assert len(points) > 70
    np.testing.assert_allclose(points[:, 1], expected / stats.norm.pdf(0), atol=4e-3)
    bars = node(["input_row.js", "surrogate.js"], PATH, data_of(space_of(["discrete"])))
    heights = np.array(re.findall(r"V([\d.e-]+)H", bars), dtype=float)
    parts = stats.binom.pmf(np.arange(8), 7, 0.4)
    np.testing.assert_allclose(heights, parts / parts.max(), rtol=1e-9)


def test_per_cents_have_digits_that_mean_something(node):
    levels = [0.5, 0.632, 0.024, 0.9996, 0.0]
    found = node(["input_row.js"], "answer = given.map(formatLevel);", levels)
    assert found == ["50 %", "63 %", "2.4 %", "99.96 %", "0.00 %"]


def test_the_data_hold_the_surrogate_and_its_statistics():
    chaos = chaos_of("polynomial", space_of(["normal"]), [], 3, 0)
    node = propagator_node(
        "c", chaos.statistics(), propagator="p", realisations=9, wall_time=0.1, children={"chaos": chaos.to_dataset()}
    )
    tree = study_tree([node], study="s", mechanism="m")
    found = collect_explorer_data(tree)
    assert found["method"] == "c" and found["scalars"] is None and not found["missing"]
    assert (
        found["histories"]["mean"]["shape"] == [2, 33] and found["histories"]["surrogate"]["outputs"][0]["name"] == "x"
    )


def test_the_input_that_matters_most_comes_first(make_chaos):
    tree = study_tree([make_chaos("c", 3)], study="s", mechanism="m")
    data = collect_explorer_data(tree)
    names = [one["name"] for one in data["histories"]["surrogate"]["inputs"]]
    statistics = tree["c/statistics"].to_dataset().sel(output="slider_x")
    weighted = (statistics["sobol_total"] * statistics["std"] ** 2).sum("time")
    assert [names[k] for k in data["order"]] == weighted["input"].values[np.argsort(-weighted.values)].tolist()


def test_without_a_surrogate_there_is_a_reason(study):
    assert "samples, but no surrogate" in collect_explorer_data(study)["reason"]


@pytest.mark.parametrize(
    ("limit", "end", "error", "kind", "words"),
    [
        (3.5, "highest", None, "met", "met by 0.50 m: 3 m at 2 s"),
        (2.5, "highest", None, "violated", "violated by 0.50 m: 3 m at 2 s"),
        (-1.2, "lowest", None, "met", "met by 0.20 m: −1 m at 1 s"),
        (-0.9, "lowest", 0.2, "near", "undecided, nearer than the stated error: −1 m at 1 s"),
    ],
)
def test_limits_are_held_against_the_nearest_value(node, limit, end, error, kind, words):
    given = {
        "limit": {"limit": limit, "end": end},
        "found": {"values": [0, -1, 3], "times": [0, 1, 2], "rms": [error] * 3 if error else None},
    }
    found = node(["limits.js"], 'answer = limitAt(given.limit, given.found, "m");', given)
    assert (found["kind"], found["words"]) == (kind, words)


@pytest.mark.parametrize(
    ("margin", "error", "kind", "words"),
    [
        (0.5, 0.01, "met", "met by 0.50; stated error 0.010"),
        (-0.5, None, "violated", "violated by 0.50; error unknown"),
        (-0.5, 0.6, "near", "undecided: stated error 0.60"),
        (None, 0.1, "unknown", "unknown"),
    ],
)
def test_margins_are_held_against_their_errors(node, margin, error, kind, words):
    found = node(["limits.js"], "answer = marginAt(given[0] ?? NaN, given[1]);", [margin, error])
    assert found == {"kind": kind, "words": words}
