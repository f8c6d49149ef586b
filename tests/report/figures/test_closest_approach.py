"""The closest approach to a limit, and deviations where a band cannot be seen."""

import numpy as np
import pytest

from uqmbd.report import Band, Chart, Curve, chart_figure
from uqmbd.report.figures import OutputLimit, closest_approach, deviation_chart

TIMES = np.linspace(0, 1, 201)
MEAN = np.cos(2 * np.pi * TIMES)


def chart(spread):
    wide = Band("95 % of realisations", MEAN - 2 * spread, MEAN + 2 * spread)
    return Chart("x", TIMES, [Curve("mine", MEAN, (wide,)), Curve("other", MEAN + 0.1 * spread, (wide,))], units="m")


def test_it_is_where_the_margin_is_smallest_in_standard_deviations():
    """Of random means, spreads and limits, by a search over all times and limits."""
    generator = np.random.default_rng(2)
    for _ in range(50):
        mean, std = np.cumsum(generator.normal(size=40)), generator.uniform(0, 1, 40) * (generator.random(40) > 0.2)
        limits = [
            OutputLimit("upper", float(mean.max() + generator.normal()), "highest"),
            OutputLimit("lower", float(mean.min() + generator.normal()), "lowest"),
        ]
        found = closest_approach(mean, std, limits)
        margins = [(limits[0].value - mean), (mean - limits[1].value)]
        every = [(m[k] / std[k], k, m[k]) for m in margins for k in range(40) if std[k] > 0]
        deviations, place, margin = min(every)
        assert (found.deviations, found.place, found.margin) == (deviations, place, margin)


def test_without_a_spread_or_limits_there_is_none():
    assert closest_approach(MEAN, 0 * MEAN, [OutputLimit("upper", 2.0, "highest")]) is None
    assert closest_approach(MEAN, MEAN + 2, []) is None


@pytest.mark.parametrize("spread", [1e-7, 1e-4, 1e-3])
def test_a_narrow_band_fills_the_chart_of_deviations(spread):
    found = deviation_chart(chart(spread), {"floor": -1.0 - 3 * spread})
    mine, other, floor = found.curves
    np.testing.assert_allclose(mine.values, 0)
    np.testing.assert_allclose(other.values, 0.1 * spread, rtol=1e-6)
    np.testing.assert_allclose(
        [np.min(mine.bands[0].low), np.max(mine.bands[0].high)], [-2 * spread, 2 * spread], rtol=1e-6
    )
    low, high = found.ends
    # the band has at least an eighth of the height, and the nearest point of the limit is inside
    assert 4 * spread >= (high - low) / 8 and low < np.max(floor.values) < high
    assert np.max(floor.values) == pytest.approx(-3 * spread)
    assert chart_figure(found).axes[0].get_ylim() == pytest.approx(found.ends)


def test_a_band_that_can_be_seen_needs_none():
    assert deviation_chart(chart(0.1), {"floor": -1.2}) is None
    assert deviation_chart(chart(0.0), {"floor": -1.2}) is None
