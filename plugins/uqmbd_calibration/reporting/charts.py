"""Charts of a calibration: records against predictions, residuals, pairs of inputs, priors and posteriors."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import xarray as xr

from uqmbd.report import Band, Chart, Curve
from uqmbd.typing import Array

__all__ = ["inputs_of", "reduction_chart", "pair_charts", "posterior_charts", "record_charts"]


MOST_INPUTS = 5
"""Largest number of inputs in charts of pairs."""

POINTS = 600
"""Number of draws in a chart of a pair."""

OUTER = 4.0
"""Largest drawn residual, divided by the noise; larger residuals are drawn at the edge."""

REACH, REACH_BEFORE = 5.0, 3.0
"""Plotted range of an input about its mean, in standard deviations, for posterior and prior."""

POINTS_OF_DENSITY = 100
"""Number of points of a density, for prior and posterior."""


def inputs_of(tree: xr.DataTree) -> list[str]:
    """Return the names of the calibrated inputs, largest reduction of uncertainty first."""
    data = tree["summary"].to_dataset()
    chosen = data.isel(input=np.flatnonzero(~data["noise"].values))
    order = np.argsort(-chosen["reduction"].values, kind="stable")
    return [str(name) for name in chosen["input"].values[order]]


def record_charts(tree: xr.DataTree, name: str) -> list[Chart]:
    """Return charts of the measurements of an output, with prediction bands before and after, and the residuals.

    `tree`: tree of a calibration; `name`: name of a variable of the observed data.
    """
    values = tree["observed_data"].to_dataset()[name]
    (along,) = values.dims
    timeless = str(along).endswith("_repetition")
    at = np.arange(1.0, values.size + 1) if timeless else np.asarray(values[along].values, dtype=float)
    units, across = str(values.attrs.get("units", "")) or "1", "measurement" if timeless else ""
    unknown = np.full(values.size, np.nan)
    after = Curve("after: fit", _of(tree, "fit", name), (_band(tree, "posterior_predictive", name, timeless),), "fit")
    before = Curve("before", unknown, (_band(tree, "prior_predictive", name, timeless),))
    measured = Curve("measured", values.values, (), "measured", drawn="points")
    residuals = _of(tree, "residuals", name)
    inner = np.abs(residuals) <= OUTER
    expected = Band("95 % if the model is correct", np.full(values.size, -1.96), np.full(values.size, 1.96))
    zero = Curve("right model", np.zeros(values.size), (expected,))
    near = Curve("residual", np.where(inner, residuals, np.nan), drawn="points")
    curves = [zero, near]
    if not inner.all():
        far = np.where(inner, np.nan, np.clip(residuals, -OUTER, OUTER))
        curves.append(Curve(f"beyond {OUTER:g}, drawn at the edge", far, drawn="points"))
    ends = (-OUTER - 0.4, OUTER + 0.4)
    return [
        Chart(name, at, [after, before, measured], "measured and predicted", units, across),
        Chart(f"residual of {name} over noise", at, curves, "residuals", across=across, ends=ends),
    ]


def _of(tree: xr.DataTree, group: str, name: str) -> Array:
    return np.asarray(tree[group].to_dataset()[name].values, dtype=float)


def _band(tree: xr.DataTree, group: str, name: str, timeless: bool) -> Band:
    """Return the band that contains 95 % of expected measurements; it is constant for repeated measurements."""
    draws = _of(tree, group, name)
    low, high = np.nanquantile(draws.reshape(-1, draws.shape[-1]), [0.025, 0.975], axis=0)
    if timeless:
        low, high = np.full_like(low, low.mean()), np.full_like(high, high.mean())
    return Band("95 % of measurements", low, high)


def reduction_chart(tree: xr.DataTree) -> Chart:
    """Return a chart of the ratio of posterior to prior width for each calibrated input."""
    data = tree["summary"].to_dataset()
    names = inputs_of(tree)
    left = 100 * np.maximum(1 - data["reduction"].sel(input=names).values, 1e-9)
    low = 10 ** np.floor(np.log10(min(float(left.min()), 50.0)) - 0.3)
    high = max(200.0, 1.3 * float(left.max()))
    bars = Curve("after over before", left, (), "after over before", drawn="bars")
    return Chart("std after / before", names, [bars], "reduction by the calibration", "%", "input",
                 ends=(float(low), high), log=True, limits={"no reduction": 100.0})  # fmt: skip


def posterior_charts(tree: xr.DataTree) -> list[Chart]:
    """Return charts of the density of each input before and after, each divided by its maximum."""
    posterior, prior = tree["posterior"].to_dataset(), tree["prior"].to_dataset()
    units = _units(tree)
    charts = []
    for name in inputs_of(tree)[:MOST_INPUTS]:
        found, before = (np.ravel(group[name].values) for group in (posterior, prior))
        mean, deviation = float(found.mean()), float(found.std()) or 1.0
        # cover the whole prior, with enough points for a narrow posterior
        spans = [(mean, REACH * deviation), (float(before.mean()), REACH_BEFORE * float(before.std()))]
        grids = [np.linspace(middle - reach, middle + reach, POINTS_OF_DENSITY) for middle, reach in spans]
        places = np.unique(np.concatenate(grids))
        curves = [
            Curve(label, _over_maximum(values, places), (), "density over its maximum")
            for label, values in (("after", found), ("before", before))
        ]
        start = int(np.argmax(np.asarray(curves[0].values)))
        chart = Chart("density over its maximum", places, curves, name, "1", name, units[name], ends=(0.0, 1.08),
                      start=start)  # fmt: skip
        charts.append(chart)
    return charts


def _over_maximum(values: Array, places: Array) -> Array:
    """Return the density of values at places, by Gaussian kernels, divided by its maximum."""
    wide = max(1.06 * float(values.std()) * len(values) ** -0.2, 1e-3 * float(np.ptp(places)))
    low, high = float(values.min()), float(values.max())
    counts, own = np.histogram(values, 400, (low, high if high > low else low + 1.0))
    centres = (own[1:] + own[:-1]) / 2
    summed = np.exp(-0.5 * ((places[:, None] - centres) / wide) ** 2) @ counts
    largest = float(summed.max())
    return np.asarray(summed / largest if largest > 0 else np.zeros(len(places)))


def pair_charts(tree: xr.DataTree) -> list[Chart]:
    """Return charts of the posterior draws of each pair of inputs."""
    posterior, units = tree["posterior"].to_dataset(), _units(tree)
    names = inputs_of(tree)[:MOST_INPUTS]
    draws = {name: np.ravel(posterior[name].values) for name in names}
    charts = []
    for one, other in combinations(names, 2):
        chosen = np.linspace(0, len(draws[one]) - 1, min(POINTS, len(draws[one]))).astype(int)
        across, up = draws[one][chosen], draws[other][chosen]
        order = np.argsort(across)
        correlation = float(np.corrcoef(draws[one], draws[other])[0, 1])
        written = f"{correlation:.2f}".replace("-", "\N{MINUS SIGN}")
        dots = Curve(f"draws, correlation {written}", up[order], (), other, drawn="points")
        charts.append(Chart(other, across[order], [dots], f"{other} over {one}", units[other], one, units[one]))
    return charts


def _units(tree: xr.DataTree) -> dict[str, str]:
    data = tree["summary"].to_dataset()
    pairs = zip(data["input"].values.tolist(), data["units"].values.tolist(), strict=True)
    return {str(name): str(units) or "1" for name, units in pairs}
