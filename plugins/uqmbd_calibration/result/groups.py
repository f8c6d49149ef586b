"""ArviZ groups of a calibration, as a tree of datasets."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_calibration.inference import Block, Posterior, spread_over_prior
from uqmbd_calibration.posterior_search import Found
from uqmbd_calibration.result.checks import checks_of
from uqmbd_calibration.result.discrepancy import Residuals, residuals
from uqmbd_calibration.result.marginals import marginals_of

__all__ = ["tree_of"]


PREDICTED = 200
"""Number of draws with stored predictions."""

PRIOR = 2**12
"""Number of draws of the prior."""

MOST = 2_000_000
"""Largest number of stored values of the log-likelihood."""


def tree_of(study: uqmbd.Study, found: Found, seed: int, about: Mapping[str, Any]) -> xr.DataTree:
    """Return the tree of a calibration.

    `found`: posterior and predictions; `seed`: seed of the noise draws; `about`: additional attributes of the root.
    """
    target, draws, unknowns = found.inferred.target, found.inferred.draws, found.arrangement.unknowns
    generator = np.random.default_rng(seed)
    chains, count, width = draws.vectors.shape
    prior = spread_over_prior(width, PRIOR, seed)[None]
    some = draws.vectors[:, np.linspace(0, count - 1, max(1, PREDICTED // chains)).astype(int)]
    centre = draws.flat.mean(axis=0)
    parts = _residuals(target, some.reshape(-1, width), centre)
    numbers = sum(len(one.block.values) for one in parts)
    kept = np.arange(0, count, max(1, int(np.ceil(chains * count * numbers / MOST))))

    def with_noise(block: Block, values: Array, vectors: Array) -> Array:
        return block.drawn(values, block.sigma(unknowns, vectors), vectors, generator)

    def likely(block: Block, values: Array, vectors: Array) -> Array:
        return block.each(block.misfit(values, vectors), block.sigma(unknowns, vectors))

    checks = checks_of(found, parts)
    likelihood = _predicted(target, draws.vectors[:, kept], likely).assign_coords(draw=kept)
    posterior = _values(study, found, draws.vectors)
    physical = _values(study, found, prior)
    named = _named(target)
    data = {
        "posterior": posterior,
        "prior": physical,
        "posterior_predictive": _predicted(target, some, with_noise),
        "prior_predictive": _predicted(found.prior, prior[:, :PREDICTED], with_noise),
        "log_likelihood": likelihood,
        "sample_stats": xr.Dataset(
            {"lp": (("chain", "draw"), draws.log_density, {"long_name": "logarithm of the density, unnormalised"})},
            coords=_draws(chains, count),
        ),
        "observed_data": _series(named, [block.values for _, block in named]),
        "constant_data": _series(
            named,
            [np.sqrt(one.block.sigma(unknowns, centre[None])[0] ** 2 + one.block.variance) for one in parts],
            long_name="standard deviation of the noise",
        ),
        "fit": _series(
            named,
            [one.predicted for one in parts],
            long_name="posterior mean of the predictions, including the bias of the output",
        ),
        "residuals": _series(
            named,
            [one.raw for one in parts],
            units="",
            long_name="value minus prediction, divided by the standard deviation of the noise",
        ),
        "summary": _summary(study, found, posterior, physical, _unreliable(found, checks["model"])),
        "marginals": marginals_of(found, draws.vectors.reshape(-1, width)),
    }
    tree = xr.DataTree.from_dict(data, name="calibration")
    tree.attrs |= {
        **about,
        "study": study.name,
        "mechanism": study.mechanism.name,
        "realisations": sum(point.spent for point in found.arrangement.points),
        "checks": json.dumps(checks),
        "unidentified": json.dumps([{"name": d.name, "left": d.variance**0.5} for d in found.beforehand]),
    }
    return tree


def _named(target: Posterior) -> list[tuple[str, Block]]:
    """Return the blocks with the names of their outputs; add the record to the name if several records contain it."""
    blocks = [block for case in target.cases for block in case.blocks]
    outputs = [block.output for block in blocks]
    return [(b.output if outputs.count(b.output) == 1 else f"{b.output}[{b.record}]", b) for b in blocks]


def _draws(chains: int, draws: int) -> dict[str, Index]:
    return {"chain": np.arange(chains), "draw": np.arange(draws)}


def _series(
    named: Sequence[tuple[str, Block]],
    data: Sequence[Array],
    leading: tuple[str, ...] = (),
    units: str | None = None,
    long_name: str = "",
) -> xr.Dataset:
    """Return a dataset of arrays (..., n), one for each block, at the times of the block."""
    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    for (name, block), values in zip(named, data, strict=True):
        last = f"{name}_{'repetition' if block.timeless else 'time'}"
        about = {"units": block.units if units is None else units}
        variables[name] = ((*leading, last), values, {**about, **({"long_name": long_name} if long_name else {})})
        at = np.arange(len(block.values)) if block.timeless else block.times
        coords[last] = (last, at, {} if block.timeless else {"units": "s"})
    return xr.Dataset(variables, coords=coords)


def _predicted(target: Posterior, vectors: Array, made: Callable[[Block, Array, Array], Array]) -> xr.Dataset:
    """Return a dataset of a function of predictions, at draws (chain, draw, N)."""
    chains, count, width = vectors.shape
    flat = vectors.reshape(-1, width)
    data = [
        made(block, values, flat).reshape(chains, count, -1)
        for case, predicted in zip(target.cases, target.predictions(flat), strict=True)
        for block, values in zip(case.blocks, predicted, strict=True)
    ]
    return _series(_named(target), data, ("chain", "draw")).assign_coords(_draws(chains, count))


def _residuals(target: Posterior, vectors: Array, centre: Array) -> list[Residuals]:
    """Return the residuals of all blocks from the mean of predictions, with the noise levels at a centre."""
    predictions = target.predictions(vectors)
    return [
        residuals(block, values, vectors, float(block.sigma(target.unknowns, centre[None])[0]))
        for case, predicted in zip(target.cases, predictions, strict=True)
        for block, values in zip(case.blocks, predicted, strict=True)
    ]


def _values(study: uqmbd.Study, found: Found, vectors: Array) -> xr.Dataset:
    """Return the unknown inputs and noise levels of draws (chain, draw, N), in their units."""
    (chains, count), flat = vectors.shape[:2], vectors.reshape(-1, vectors.shape[2])
    unknowns = found.arrangement.unknowns
    physical, noise = found.arrangement.physical(flat), unknowns.noise(flat)
    units = study.mechanism.inputs.units
    data = {}
    for k, one in enumerate(unknowns.inputs):
        data[one.name] = (("chain", "draw"), physical[:, k].reshape(chains, count), {"units": units[one.input]})
    for k, level in enumerate(unknowns.levels):
        about = {"units": level.units, "long_name": f"standard deviation of the noise of {level.output}"}
        data[level.name] = (("chain", "draw"), noise[:, k].reshape(chains, count), about)
    return xr.Dataset(data, coords=_draws(chains, count))


def _unreliable(found: Found, model: Sequence[Mapping[str, Any]]) -> Array:
    """Return a mask (D,) of the unknown inputs that depend on a record that contradicts the model."""
    unreliable = np.zeros(len(found.arrangement.unknowns.inputs), dtype=bool)
    names = {one["record"] for one in model if one["rejected"] and not one["robust"]}
    for case in found.arrangement.cases:
        if any(block.record in names for block in case.blocks):
            unreliable[case.columns[case.free]] = True
    return unreliable


def _summary(
    study: uqmbd.Study, found: Found, posterior: xr.Dataset, prior: xr.Dataset, unreliable: Array
) -> xr.Dataset:
    """Return a table of the unknowns: prior, posterior, and convergence of the chains."""
    unknowns, draws = found.arrangement.unknowns, found.inferred.draws
    names = list(posterior.data_vars)
    after = np.stack([posterior[name].values.ravel() for name in names])
    before = np.stack([prior[name].values.ravel() for name in names])
    levels = np.arange(len(names)) >= len(unknowns.inputs)
    # the prior of a noise level is too wide for useful moments
    spread = np.where(levels, np.nan, before.std(axis=1))
    where = [*range(len(unknowns.inputs)), *range(unknowns.first_level, unknowns.dimension)]
    columns = {
        "prior_mean": (np.where(levels, np.nan, before.mean(axis=1)), "mean of the prior"),
        "prior_sd": (spread, "standard deviation of the prior"),
        "mean": (after.mean(axis=1), "mean of the posterior"),
        "sd": (after.std(axis=1, ddof=1), "standard deviation of the posterior"),
        "lower": (np.quantile(after, 0.025, axis=1), "lower end of the 95 % interval"),
        "upper": (np.quantile(after, 0.975, axis=1), "upper end of the 95 % interval"),
        "reduction": (
            1 - after.std(axis=1, ddof=1) / spread,
            "1 minus the ratio of the standard deviations of posterior and prior",
        ),
        "rhat": (draws.rhat[where], "R-hat"),
        "ess": (draws.ess[where], "effective draws"),
    }
    units = np.array([posterior[name].attrs["units"] for name in names], dtype=np.str_)
    data = {name: ("input", values, {"long_name": text}) for name, (values, text) in columns.items()}
    return xr.Dataset(
        {
            **data,
            "units": ("input", units),
            "noise": ("input", levels),
            "unreliable": ("input", np.concatenate([unreliable, np.zeros(len(names) - len(unreliable), dtype=bool)])),
        },
        coords={"input": np.array(names, dtype=np.str_)},
    )
