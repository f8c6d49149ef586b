"""Statistics of outputs that are angles, against the wrapped normal distribution and brute force."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats
import xarray as xr

from uqmbd import RandomVariable, extend, results
from uqmbd.errors import StudyError
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.results import PolynomialChaos
from uqmbd.results.statistics import circular

TURN = 2 * np.pi
SIGMA = np.array([0.01, 0.3, 1.0, 2.0])
TIMES = np.arange(4.0)


def axes(turns: tuple[float, float] = (TURN, 360.0)) -> extend.Labels:
    """Return two angles and what is none."""
    outputs = [("a", "rad", turns[0]), ("b", "deg", turns[1]), ("c", "m")]
    return extend.labels(outputs, [("k", "", "Normal(mu=0, sigma=1)")], TIMES)


def normal_samples(count: int = 20_001) -> tuple[np.ndarray, np.ndarray]:
    """Return samples of Normal(pi, SIGMA), evenly spread quantiles, in rad, in deg and in rad but no angle."""
    germs = scipy.stats.norm.ppf((np.arange(count) + 0.5) / count)
    angle = np.pi + germs[:, None] * SIGMA
    return np.stack([angle, np.degrees(angle), angle], axis=1), germs[:, None]


def statistics_of(response: np.ndarray, inputs: np.ndarray, status: np.ndarray | None = None) -> xr.Dataset:
    """Return the statistics of samples."""
    return extend.statistics_of_samples(extend.sample_dataset(response, inputs, axes(), status=status))


def test_wrapped_normal_about_half_a_turn() -> None:
    """Mean pi where the naive one is 0; the length of the mean direction is exp(-sigma^2/2), so the deviation sigma."""
    response, inputs = normal_samples()
    found = statistics_of(response, inputs)
    wrapped = np.mod(response[:, 0] + np.pi, TURN) - np.pi
    np.testing.assert_allclose(wrapped.mean(axis=0), 0, atol=5e-4)
    np.testing.assert_allclose(found["mean"].sel(output="a"), np.pi, rtol=1e-12)
    np.testing.assert_allclose(found["std"].sel(output="a"), SIGMA, rtol=1e-3)
    for name, scale in (("a", 1.0), ("b", 180 / np.pi)):
        np.testing.assert_allclose(np.abs(found["circular_mean"].sel(output=name)), np.pi * scale, rtol=1e-9)
        np.testing.assert_allclose(found["circular_std"].sel(output=name), SIGMA * scale, rtol=1e-3)
    length = np.abs(np.exp(1j * response[:, 0]).mean(axis=0))
    np.testing.assert_allclose(length, np.exp(-(SIGMA**2) / 2), rtol=1e-4)
    np.testing.assert_allclose(found["circular_std"].sel(output="a"), np.sqrt(-2 * np.log(length)), rtol=1e-8)
    assert np.isnan(found["circular_mean"].sel(output="c")).all()
    assert np.isnan(found["circular_std"].sel(output="c")).all()


def test_turns_do_not_matter_to_directions() -> None:
    """Whole turns more or less leave the circular statistics alone, and rotate with everything."""
    response, inputs = normal_samples(501)
    turns = np.random.default_rng(1).integers(-9, 9, (501, 1, 1)) * np.array([TURN, 360.0, 1.0])[:, None]
    one, other = statistics_of(response, inputs), statistics_of(response + turns, inputs)
    for name in ("circular_mean", "circular_std"):
        away = (one[name] - other[name]).values[:2] * [[1], [np.pi / 180]]
        np.testing.assert_allclose(np.exp(1j * away), 1, atol=1e-9)
    assert other["std"].sel(output="a").min() > TURN


def test_failed_samples_are_left_out() -> None:
    """Statistics of the rest, as if the failed ones had never been there."""
    response, inputs = normal_samples(301)
    status = np.arange(301) % 7 == 0
    whole = statistics_of(response, inputs, status.astype(int))
    np.testing.assert_allclose(
        whole["circular_std"], statistics_of(response[~status], inputs[~status])["circular_std"], rtol=1e-13
    )


@pytest.mark.thorough
def test_blocks_change_nothing() -> None:
    """More times than fit a block give what few give; outputs without times are served as well."""
    response, _ = normal_samples(101)
    turns = axes().turns
    whole = circular.circular_of_samples(response, turns)
    many = circular.circular_of_samples(np.tile(response, (1, 1, 6000)), turns)
    again = {name: values[:, -response.shape[2] :] for name, values in many.items()}
    alone = circular.circular_of_samples(response[:, :, 2], turns)
    for name, values in whole.items():
        np.testing.assert_allclose(again[name], values, rtol=1e-13)
        np.testing.assert_allclose(alone[name], values[:, 2], rtol=1e-13)
    assert circular.circular_of_samples(response, np.zeros(3)) == {}


@pytest.fixture(scope="module")
def chaos() -> PolynomialChaos:
    """Return the chaos of the normal angles: pi + sigma germ."""
    space = GermSpace.of(JointInput.of([RandomVariable("k", chaospy.Normal(0, 1))]))
    coefficients = np.stack([np.full(4, np.pi), SIGMA])[:, None] * np.array([1, 180 / np.pi, 1])[:, None]
    return PolynomialChaos(coefficients, [[0], [1]], space, axes())


def test_chaos_of_angles(chaos: PolynomialChaos) -> None:
    """From surrogate samples: mean pi and deviation sigma, in the units of each output; plain moments as ever."""
    found = chaos.statistics()
    np.testing.assert_allclose(found["mean"].sel(output="a"), np.pi)
    np.testing.assert_allclose(found["std"].sel(output="a"), SIGMA)
    for name, scale in (("a", 1.0), ("b", 180 / np.pi)):
        mean = found["circular_mean"].sel(output=name).values / scale
        np.testing.assert_allclose(np.exp(1j * mean), -1, atol=1e-3)
        np.testing.assert_allclose(found["circular_std"].sel(output=name), SIGMA * scale, rtol=1e-3)
    assert np.isnan(found["circular_std"].sel(output="c")).all()
    assert set(PolynomialChaos(chaos.coefficients, chaos.multi_index, chaos.space, axes((0, 0))).circular()) == set()


@pytest.mark.thorough
def test_declaration_is_stored(chaos: PolynomialChaos, tmp_path) -> None:
    """A result that was read back knows its angles; one that was written without them has none."""
    response, inputs = normal_samples(50)
    nodes = []
    for label, turns in (("declared", (TURN, 360.0)), ("plain", (0.0, 0.0))):
        samples = extend.sample_dataset(response, inputs, axes(turns))
        stored = PolynomialChaos(chaos.coefficients, chaos.multi_index, chaos.space, axes(turns))
        statistics = extend.statistics_of_samples(samples)
        nodes.append(
            results.propagator_node(
                label,
                statistics,
                samples,
                propagator="p",
                realisations=50,
                wall_time=0.0,
                children={"chaos": stored.to_dataset()},
            )
        )
    tree = results.study_tree(nodes, study="s", mechanism="m")
    results.validate(tree)
    loaded = results.load(results.save(tree, tmp_path / "a.nc"))
    results.validate(loaded)
    assert loaded.identical(tree)
    for label, turns in (("declared", [TURN, 360.0, 0.0]), ("plain", [0.0, 0.0, 0.0])):
        node = loaded[label]
        back = PolynomialChaos.from_dataset(node["chaos"])
        assert [o.turn for o in back.labels.outputs] == turns and back.labels.turns.tolist() == turns
        again = extend.statistics_of_samples(node["samples"].to_dataset())
        assert again.identical(node["statistics"].to_dataset())
        assert ("output_angle" in again.coords) == ("circular_mean" in again) == (label == "declared")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.assign_coords(output_angle=("output", [TURN, -1.0, 0.0])), "expected lengths of a turn"),
        (lambda d: d.assign_coords(output_angle=("output", ["a", "b", "c"])), "expected lengths of a turn"),
        (lambda d: d.assign_coords(output_angle=("time", TIMES)), "output_angle: found the dimensions"),
        (lambda d: d.assign(circular_std=-d["std"]), "circular_std: found a negative value"),
        (lambda d: d.assign(circular_mean=d["mean"].isel(time=0)), "circular_mean: found the dimensions"),
    ],
)
def test_breaches_of_the_schema(change, message: str) -> None:
    """Each is told by its path."""
    response, inputs = normal_samples(50)
    statistics = change(statistics_of(response, inputs))
    node = results.propagator_node("a", statistics, propagator="p", realisations=50, wall_time=0.0)
    with pytest.raises(StudyError, match=message):
        results.validate(node)


@pytest.mark.parametrize("turn", [-1.0, float("inf"), float("nan"), "rad"])
def test_turns_have_a_length(turn: object) -> None:
    """A label cannot say otherwise."""
    with pytest.raises(StudyError, match="turn is"):
        extend.labels([("a", "rad", turn)], [], None)
