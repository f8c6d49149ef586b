"""Whether a record may have come from the model: false alarms, and what is seen."""

import numpy as np
import pytest

from uqmbd_calibration.inference import Bias
from uqmbd_calibration.result.discrepancy import SIGNIFICANCE, find_discrepancy, residuals

from .inference import forward

TIMES = np.linspace(0.0, 9.95, 200)


def said(values, *, noise=0.1, sigma=0.1, **about):
    """Return what residuals of values about zero say."""
    block = forward.block(values, noise, times=TIMES, **about)
    return find_discrepancy(residuals(block, np.zeros(200), np.zeros(1), sigma), 0.0)


@pytest.mark.parametrize("kind", ["known", "unknown", "bias", "robust"])
def test_records_of_the_model_are_rejected_as_rarely_as_stated(kind):
    generator = np.random.default_rng(0)
    modes = Bias(0.3, 0.5).modes(TIMES) if kind == "bias" else np.zeros((200, 0))
    chances = []
    for _ in range(400):
        noise = 0.1 * (generator.standard_t(4, 200) if kind == "robust" else generator.standard_normal(200))
        values = noise + modes @ generator.standard_normal(modes.shape[1])
        about = {"noise": None, "sigma": float(values.std())} if kind == "unknown" else {}
        chances.append(said(values, modes=modes, robust=kind == "robust", **about)["p"])
    # at most as often as p says, and not never
    for level in (0.2, 0.05):
        assert np.mean(np.array(chances) < level) < level + 3 * np.sqrt(level / 400)
    assert np.mean(np.array(chances) < 0.5) > 0.05


def test_what_is_missing_for_a_while_is_seen_there():
    generator = np.random.default_rng(1)
    values = 0.1 * generator.standard_normal(200)
    values[120:150] += 0.15
    found = said(values)
    assert found["p"] < SIGNIFICANCE and found["rejected"]
    ((begin, end),) = found["where"]
    assert begin < 6.5 and end > 7.0 and 5.0 < begin and end < 8.6


def test_slow_residuals_are_seen_where_the_noise_is_unknown():
    values = 0.1 * np.sin(0.8 * TIMES) + 0.05 * np.random.default_rng(1).standard_normal(200)
    found = said(values, noise=None, sigma=float(values.std()))
    assert found["rejected"] and found["correlation"] > 0.3 and found["where"]


def test_outliers_are_counted():
    values = 0.1 * np.random.default_rng(1).standard_normal(200)
    values[[20, 90]] = 1.0
    assert said(values)["outliers"] == 2 and said(values)["rejected"]
    assert sorted(outlier["time"] for outlier in said(values)["outlier_values"]) == pytest.approx([1.0, 4.5])
    robust = said(values, robust=True)
    assert robust["outliers"] == 2 and not robust["rejected"]
