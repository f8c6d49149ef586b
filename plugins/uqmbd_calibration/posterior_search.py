"""Posterior search: computation of posterior draws from records."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.arranging import Arrangement, arrange
from uqmbd_calibration.inference import (
    Bias,
    Direction,
    Inferred,
    MachineRecords,
    OperatingPoint,
    Posterior,
    default_methods,
    directions,
    expected_covariance,
    infer,
    read_prior_surrogates,
    search,
    spread_over_prior,
)
from uqmbd_calibration.records import Record

__all__ = ["Found", "find"]


@dataclass(frozen=True, eq=False)
class Found:
    """Results of a posterior search."""

    arrangement: Arrangement
    inferred: Inferred
    beforehand: tuple[Direction, ...]  # directions that the records do not determine, by the surrogate over the prior
    prior: Posterior  # posterior by the surrogate over the prior, without the stated errors of the surrogate
    notes: tuple[str, ...]  # warnings of the method that computed the surrogate
    method: str  # name and main options of the method that computed the surrogate
    nodes: tuple[list[xr.DataTree], ...]  # surrogates of each operating point
    spent: tuple[int, ...]  # number of realisations for the surrogate at each operating point

    def given(self, place: int, point: OperatingPoint) -> list[xr.DataTree]:
        """Return the surrogates of an equal operating point, and count their realisations for the new point.

        Raise StudyError if the points differ.
        """
        points = self.arrangement.points
        if place >= len(points) or not point.same(points[place]):
            raise uqmbd.StudyError(
                "calibrate: surrogate is a calibration with different inputs, outputs, times or known values. Use a "
                "calibration of the same study with records at the same times, or a method, e.g. Collocation(order=3)."
            )
        point.spent += self.spent[place]
        return self.nodes[place]


def find(
    study: uqmbd.Study,
    records: Sequence[Record],
    *,
    surrogate: uqmbd.extend.Propagator | Found | None,
    realisations: int,
    further: int,
    draws: int,
    chains: int,
    robust: bool,
    bias: Mapping[str, Bias],
    individual: Sequence[str],
    mechanism: bool,
    seed: int,
    executor: Executor | None,
    progress: Any,
) -> Found:
    """Return the posterior of the unknown inputs."""
    arranged = arrange(
        study,
        records,
        robust=robust,
        bias=bias,
        individual=individual,
        realisations=realisations,
        executor=executor,
        progress=progress,
    )
    unknowns, inputs = arranged.unknowns, len(arranged.unknowns.inputs)
    nodes: dict[int, list[xr.DataTree]] = {}
    notes: list[str] = []
    methods: list[str] = []
    for place, point in enumerate(arranged.points):
        if isinstance(surrogate, Found):
            nodes[id(point)] = surrogate.given(place, point)
            continue
        blocks = [block for case in arranged.cases if case.point is point for block in case.blocks]
        outputs = list(dict.fromkeys(block.output for block in blocks if not block.timeless))
        chosen: tuple[uqmbd.extend.Propagator, ...] = () if surrogate is None else (surrogate,)
        if not chosen:
            about: dict[str, Any] = {"moving": bool(outputs), "known": list(point.known), "most": point.most}
            chosen = default_methods(point.study, **about)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            nodes[id(point)] = point.surrogates(chosen, outputs)
        methods += [_described(node) for node in nodes[id(point)]]
        notes += [str(one.message) for one in caught]

    def build(cases: tuple[MachineRecords, ...], *, with_errors: bool = True) -> Posterior:
        """Return the posterior by the surrogates over the prior, with their stated errors added to the noise."""
        predictors = tuple(read_prior_surrogates(nodes[id(case.point)], case.point, case.blocks) for case in cases)
        if with_errors:
            cases = tuple(
                replace(
                    case,
                    blocks=tuple(
                        replace(b, variance=b.variance + v) for b, v in zip(case.blocks, p.variances, strict=True)
                    ),
                )
                for case, p in zip(cases, predictors, strict=True)
            )
        return Posterior(unknowns, cases, predictors)

    spent = tuple(point.spent for point in arranged.points)
    seeds = np.random.SeedSequence(seed).generate_state(3)
    _check_reach(build(arranged.cases), int(seeds[0]))
    peaks = search(build, arranged.cases, inputs, unknowns.dimension, int(seeds[0]))
    prior = build(arranged.cases, with_errors=False)
    levels: Array = peaks.vectors[0, unknowns.first_level :]
    before = directions(expected_covariance(prior, levels, int(seeds[1])), [one.name for one in unknowns.inputs])
    variances = tuple(p.variances for p in prior.predictors)  # type: ignore[attr-defined]
    inferred = infer(
        unknowns,
        arranged.cases,
        prior.predictors,
        variances,
        peaks,
        draws=draws,
        chains=chains,
        seed=int(seeds[2]),
        mechanism=mechanism,
        further=further,
    )
    made = tuple(nodes[id(point)] for point in arranged.points)
    if isinstance(surrogate, Found):
        return Found(arranged, inferred, before, prior, surrogate.notes, surrogate.method, made, spent)
    return Found(arranged, inferred, before, prior, tuple(notes), "; ".join(dict.fromkeys(methods)), made, spent)


REACH, LOOKED_AT = 1e5, 256
"""Deviation beyond which rounding errors exceed the other terms of the likelihood; number of checked prior points."""


def _check_reach(prior: Posterior, seed: int) -> None:
    """Raise StudyError if values are so far from all predictions that their likelihood cannot be computed.

    The log-likelihood contains the square of a deviation, and 64 bits must still resolve its other terms. A noise with
    heavy tails, or a noise level that is estimated from the values, has no such limit.
    """
    vectors = np.zeros((LOOKED_AT, prior.unknowns.dimension))
    inputs = len(prior.unknowns.inputs)
    vectors[1:, :inputs] = spread_over_prior(inputs, LOOKED_AT, seed)[1:]
    for case, predicted in zip(prior.cases, prior.predictions(vectors), strict=True):
        for block, found in zip(case.blocks, predicted, strict=True):
            if block.robust or block.noise is None:
                continue
            if not np.isfinite(found).any(axis=0).all():
                continue  # the search reports failed realisations
            low, high = np.nanmin(found, axis=0), np.nanmax(found, axis=0)
            # a few realisations do not reach the ends of the prior
            low, high = low - 2 * (high - low), high + 2 * (high - low)
            deviation = np.sqrt(block.noise**2 + block.variance + (block.modes**2).sum(axis=1))
            away = np.maximum(low - block.values, block.values - high) / deviation
            worst = int(np.nanargmax(away))
            if away[worst] > REACH:
                at = f"no. {worst + 1}" if block.timeless else f"at {block.times[worst]:g} s"
                raise uqmbd.StudyError(
                    f"calibrate: record {block.record!r}, output {block.output!r}: the value {at} is "
                    f"{block.values[worst]:g}, but the results of the study are between {low[worst]:g} and "
                    f"{high[worst]:g}. The distance is {away[worst]:.2g} standard deviations of the noise, which is "
                    "too large for a likelihood in 64 bits. Replace a wrong value by nan, state a larger noise, or use "
                    "noise='student' for records with outliers."
                )


def _described(node: xr.DataTree) -> str:
    """Return the name of a surrogate's method, with its order and alignment."""
    sentences = [str(node.attrs["propagator"])]
    options = json.loads(node.attrs.get("options", "{}"))
    sentences += [f"{name} {options[name]}" for name in ("order", "alignment") if options.get(name) is not None]
    return ", ".join(sentences)
