"""Circular statistics against closed forms and independent routes."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
import scipy.stats
from scipy.spatial.transform import Rotation

from uqmbd import results
from uqmbd.errors import StudyError
from uqmbd.results.statistics import circular_of_components


def test_angles_agree_with_scipy() -> None:
    """Mean and deviation of angles about the cut at pi are those of scipy.stats, along any axis."""
    angles = np.random.default_rng(1).normal(3.1, 0.7, (40, 3, 5))
    np.testing.assert_allclose(
        np.exp(1j * results.circular_mean(angles, axis=0)), np.exp(1j * scipy.stats.circmean(angles, axis=0))
    )
    np.testing.assert_allclose(results.circular_std(angles, axis=0), scipy.stats.circstd(angles, axis=0), rtol=1e-12)
    turned = np.moveaxis(angles, 0, 2)
    np.testing.assert_allclose(results.circular_mean(turned, axis=2), results.circular_mean(angles), rtol=1e-14)
    np.testing.assert_allclose(results.circular_std(turned, axis=-1), results.circular_std(angles), rtol=1e-14)


def test_wrapped_normal_has_the_deviation_of_its_normal() -> None:
    """E[cos] and E[sin] of Normal(m, s) are exp(-s^2/2) times those of m: mean m, deviation s, however wide s is."""
    for m, s in ((3.0, 0.01), (-2.0, 1.0), (0.5, 4.0)):
        shrunk = np.exp(-(s**2) / 2)
        mean, std = circular_of_components(shrunk * np.cos(m), shrunk * np.sin(m))
        assert mean == pytest.approx(m) and std == pytest.approx(s, rel=1e-10)


def test_small_deviations_keep_their_digits() -> None:
    """A deviation of a millionth, where the resultant length differs from 1 in its last digits only."""
    angles = np.array([np.pi - 1e-6, -np.pi + 1e-6])
    assert results.circular_std(angles) == pytest.approx(1e-6, rel=1e-9)
    assert abs(results.circular_mean(angles)) == pytest.approx(np.pi, abs=1e-12)
    assert results.circular_std(np.array([0.3, 0.3])) == 0.0


def test_weights_repeat_angles() -> None:
    """A weight of three is the same angle three times."""
    angles = np.array([0.1, 3.0, -2.5])
    repeated = np.repeat(angles, [3, 1, 2])
    assert results.circular_mean(angles, weights=[3, 1, 2]) == pytest.approx(results.circular_mean(repeated))
    assert results.circular_std(angles, weights=[3, 1, 2]) == pytest.approx(results.circular_std(repeated))


def test_directions_that_cancel_have_no_mean() -> None:
    """Opposite directions: NaN for the mean, an infinite deviation, no warning."""
    angles = np.array([0.0, np.pi])
    assert np.isnan(results.circular_mean(angles)) and np.isinf(results.circular_std(angles))
    direction, length = results.mean_direction([[1.0, 0.0], [-2.0, 0.0]])
    assert np.isnan(direction).all() and length == 0.0
    assert np.isnan(results.mean_rotation(np.eye(4))).all()
    assert np.isnan(results.rotation_std(np.eye(4)))


def test_unwrapping_removes_jumps_and_gathers_samples() -> None:
    """Wrapped angles of turning cranks come back but for one common number of turns; failed samples stay NaN."""
    rng = np.random.default_rng(2)
    times = np.linspace(0.0, 3.0, 200)
    start, rate = rng.normal(3.1, 0.4, 30), rng.normal(7.0, 0.5, 30)
    true = start[:, None] + rate[:, None] * times
    wrapped = np.angle(np.exp(1j * true))
    wrapped[4] = np.nan
    found = results.unwrap_samples(wrapped)
    good = np.delete(np.arange(30), 4)
    turns = (found - true)[good] / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns[0, 0]), atol=1e-12)
    assert np.isnan(found[4]).all()
    stacked = np.stack([wrapped, wrapped + 1.0], axis=2)
    np.testing.assert_allclose(results.unwrap_samples(stacked, axis=1)[:, :, 0], found)
    # directions that cancel have no centre, but the samples are continuous still
    assert np.isfinite(results.unwrap_samples([[0.0, 1.0], [np.pi, 3.0]])).all()


def test_mean_direction_on_the_sphere() -> None:
    """The mean of a cone's directions is its axis, the length the cosine of its opening."""
    around = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    opening = 0.3
    cone = np.stack(
        [np.sin(opening) * np.cos(around), np.sin(opening) * np.sin(around), np.full(12, np.cos(opening))], axis=1
    )
    direction, length = results.mean_direction(cone * np.arange(1, 13)[:, None])
    np.testing.assert_allclose(direction, [0.0, 0.0, 1.0], atol=1e-15)
    assert length == pytest.approx(np.cos(opening))


def test_mean_rotation_agrees_with_scipy() -> None:
    """The eigenvector method is that of scipy's Rotation.mean; the deviation that of the angles from it."""
    base = Rotation.from_euler("xyz", [2.0, -0.4, 3.0])
    rotations = base * Rotation.from_rotvec(np.random.default_rng(3).normal(0.0, 0.3, (25, 3)))
    weights = np.random.default_rng(4).uniform(1.0, 2.0, 25)
    quaternions = rotations.as_quat() * np.random.default_rng(5).choice([-1.0, 1.0], 25)[:, None]
    found = Rotation.from_quat(results.mean_rotation(quaternions, weights=weights))
    mean = rotations.mean(weights=weights)
    assert (found.inv() * mean).magnitude() < 1e-12
    angles = (mean.inv() * rotations).magnitude()
    expected = np.sqrt(np.average(angles**2, weights=weights))
    assert results.rotation_std(quaternions, weights=weights) == pytest.approx(expected, rel=1e-10)
    many = np.stack([quaternions, quaternions], axis=1)
    assert results.mean_rotation(many).shape == (2, 4)
    assert results.rotation_std(many).shape == (2,)
    for axis in (1, -2):
        turned = results.rotation_std(np.moveaxis(many, 0, 1), axis=axis)
        np.testing.assert_allclose(turned, results.rotation_std(many))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: results.circular_mean([]), "at least one value"),
        (lambda: results.circular_mean([1.0, 2.0], weights=[1.0]), "2 values and weights of the shape"),
        (lambda: results.circular_std([1.0, 2.0], weights=[0.0, 0.0]), "positive sum"),
        (lambda: results.unwrap_samples([1.0, 2.0]), "expected samples along the first axis"),
        (lambda: results.mean_direction([1.0, 0.0]), "components along the last axis"),
        (lambda: results.mean_direction([[1.0, 0.0], [0.0, 0.0]]), "vector with the index 1 has length zero"),
        (lambda: results.mean_rotation([[1.0, 0.0, 0.0]]), "four components"),
    ],
)
def test_bad_input(call: object, message: str) -> None:
    """Each gets one error that says what was given."""
    with pytest.raises(StudyError, match=message):
        call()  # type: ignore[operator]


def test_scipy_has_no_circular_statistics_that_would_do() -> None:
    """No weights, no digits of small deviations, a mean where there is none; once it has, it takes over."""
    for function in (scipy.stats.circmean, scipy.stats.circstd, scipy.stats.directional_stats):
        assert "weights" not in inspect.signature(function).parameters
    assert scipy.stats.circstd([1e-9, -1e-9]) < 0.5e-9 < results.circular_std([1e-9, -1e-9])
    opposite = Rotation.from_quat([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    assert np.isfinite(opposite.mean().as_quat()).all()
    assert np.isnan(results.mean_rotation(opposite.as_quat())).all()
