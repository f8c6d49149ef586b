"""The two-storey frame against its posterior on a grid, by a likelihood in closed form."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

STUDY = Path(__file__).parents[3] / "studies" / "published" / "two_storey_oscillator.py"


@pytest.mark.slow
def test_the_posterior_is_that_on_a_grid():
    """Published on a grid: (1.0086, .9907), (.0264, .0416), correlation .008."""
    case = SimpleNamespace(**runpy.run_path(str(STUDY)))
    k1, k2 = np.meshgrid(np.linspace(0.8, 1.3, 501), np.linspace(0.7, 1.2, 501), indexing="ij")
    value = (k1 + 2 * k2 - np.sqrt(k1**2 + 4 * k2**2)) / 2
    ratio = (k1 + k2 - value) / k2
    misfit = sum(
        ((x - predicted) / sd) ** 2
        for many, predicted, sd in ((case.EIGENVALUES, value, 0.0191), (case.RATIOS, ratio, 0.0809))
        for x in many
    )
    weight = np.exp(-0.5 * (misfit - misfit.min()))
    weight /= weight.sum()
    mean = np.array([(weight * k).sum() for k in (k1, k2)])
    sd = np.sqrt([(weight * (k - m) ** 2).sum() for k, m in zip((k1, k2), mean, strict=True)])
    np.testing.assert_allclose(mean, (1.0086, 0.9907), atol=1e-4)
    np.testing.assert_allclose(sd, (0.0264, 0.0416), atol=1e-4)

    draws = np.stack([case.found.tree["posterior"][name].values.ravel() for name in ("k1", "k2")])
    np.testing.assert_allclose(draws.mean(axis=1), mean, atol=0.05 * sd.min())
    np.testing.assert_allclose(draws.std(axis=1), sd, rtol=0.03)
    assert abs(np.corrcoef(draws)[0, 1] - 0.008) < 0.04
    assert case.found.realisations < 200
