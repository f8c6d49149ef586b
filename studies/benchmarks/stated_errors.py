"""Compare every stated error with the true one, for forty mechanisms: the calibration of the stated errors.

Each row is one kind of error of one mechanism, over repetitions with other seeds:

- ``integration``: root mean square and 99 % quantile of the error of the time integration;
- ``mean``, ``standard deviation``: of 100 independent samples, and of 128 points of a Sobol' sequence;
- ``quantile``: the bound of quantiles that are counted, against those of all stored samples;
- ``first index``, ``total index``: Sobol' indices of 128 pairs of samples;
- ``probability``: of a violation in 10 % of realisations, by samples and by the surrogate; in 2 % by reliability
  analysis;
- ``surrogate``: the verification error, against the error at 1,024 other realisations over the whole time;
- ``alignment``: the error of ``alignment="auto"``, against its best member alone;
- ``posterior``: 95 % intervals of a calibration with a record of inputs that are drawn from the prior.

True values are those of reference solutions (`error_mechanisms`).  They are means over 131,072 points of a Sobol'
sequence, over 4,096 where a mechanism has no closed form.  Outputs and times of one run are dependent, so shares of
intervals count one mean share for each seed.

A surrogate error is the root mean square over the standard deviation.  Half of its points are in the tails, with
smaller weights.  With 1,024 points that are distributed like the inputs, the root mean square itself is uncertain by
more than a factor of two.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/stated_errors.py [--errors NAME ...] [--only MECHANISM ...]
[--seeds N] [--workers N] [--table]``.  Rows go to ``docs/explanation/stated_errors.csv``; rows that are there are not
computed again.  ``--table`` prints the table, and draws it in ``docs/pictures``.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import qmc

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from error_mechanisms import MECHANISMS, Array, TestedMechanism
from measure import console, table_of

import uqmbd
from uqmbd.report import Band, Chart, Curve, chart_figure
from uqmbd.results import clopper_pearson, surrogate
from uqmbd.typing import Mask
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

__all__ = ["ERRORS", "Row", "rows_of"]

DOCS = HERE.parents[1] / "docs"
STORED = DOCS / "explanation" / "stated_errors.csv"
PICTURES = DOCS / "pictures"

SEEDS = 20
FEWER = {"integration": 5, "quantile": 5, "surrogates": 5, "reliability": 10, "aligned": 3, "alignment": 1}
"""Most repetitions of what is costly: many samples each, surrogates with few random parts, aligned surrogates."""
LEAST = 0.92
"""Least share of intervals that contain the true value."""
AGREE = 0.5, 2.0
"""Limits of a stated error over the true one."""
NEAR = 0.9
"""Least share of stated errors within these limits."""
ABOVE = 0.02
"""Largest share of realisations above the stated 99 % quantile."""
FIFTH, LARGE, SMALL = 0.2, 1e-2, 1e-4
"""Least stated over true surrogate error where that is above `LARGE`; those below `SMALL` do not count."""
ROUNDING = 1e-9
"""True integration error over the largest standard deviation, a thousandth of the tolerance, that does not count."""
POINTS, TIGHT, PAIRS = 17, 12, 14
"""Binary logarithms of the numbers of points of true values: with a closed form, without one, and of indices."""
KNOWN = 2e-3
"""Error of true Sobol' indices."""


@dataclass(frozen=True)
class Row:
    """One kind of error of one mechanism.

    Attributes
    ----------
    error, mechanism, kind : str
        Kind of the error, the mechanism, and its kind.
    seeds : int
        Number of repetitions.
    ratio, lowest, highest : float
        Stated over true error: median, smallest and largest; NaN where there is no true error to compare with.
    within : float
        Share of these ratios from 0.5 to 2.
    share, share_low, share_high : float
        Share of intervals that contain the true value, and its 95 % interval.  Of ``integration``: share of samples
        above the stated quantile.  Of ``surrogate``: share of large errors that are at most five times the stated one.
        Of ``alignment``: share of times within the limit.
    cost : float
        Of ``integration`` and ``alignment``: accelerations over those of the samples, or of the costliest member.
    holds : str
        ``yes`` or ``no``; empty: there is nothing to compare.
    seconds : float
        Processor time of the row.
    """

    error: str
    mechanism: str
    kind: str
    seeds: int
    ratio: float = np.nan
    lowest: float = np.nan
    highest: float = np.nan
    within: float = np.nan
    share: float = np.nan
    share_low: float = np.nan
    share_high: float = np.nan
    cost: float = np.nan
    holds: str = ""
    seconds: float = 0.0


def yes_or_no(holds: bool) -> str:
    """Return the word of a judgement."""
    return "yes" if holds else "no"


def of_ratios(row: Row, ratios: Array) -> Row:
    """Add the summary of stated over true errors (N,) to a row."""
    ratios = np.asarray(ratios)[np.isfinite(ratios)]
    if not len(ratios):
        return row
    within = float(((ratios >= AGREE[0]) & (ratios <= AGREE[1])).mean())
    middle, low, high = float(np.median(ratios)), float(ratios.min()), float(ratios.max())
    return replace(row, ratio=middle, lowest=low, highest=high, within=within)


def index_estimates(first: Array, second: Array, mixed: Array) -> tuple[Array, Array]:
    """Return first and total index (..., T) of one input, by the estimators of Saltelli and Jansen.

    `mixed` (K, ..., T) has the input of the `second` sample, and all others of the `first`.  For the first index
    Saltelli's estimator is exact where the input has no effect, Jansen's where it has all of it.
    """
    mean = (first.mean(axis=0) + second.mean(axis=0)) / 2
    variance = (first.var(axis=0) + second.var(axis=0)) / 2
    variance = np.where(variance > 0, variance, np.nan)
    small = ((second - mean) * (mixed - first)).mean(axis=0) / variance
    large = 1 - ((second - mixed) ** 2).mean(axis=0) / 2 / variance
    total = ((first - mixed) ** 2).mean(axis=0) / 2 / variance
    return np.where(total < 0.5, small, large), total


class Reference:
    """Responses of a mechanism by its reference solution, or by an integration at a thousandth of the tolerance."""

    def __init__(self, tested: TestedMechanism) -> None:
        self.tested = tested
        self.mechanism = tested.make()
        self.inputs = self.mechanism.inputs
        every = tested.count - 1
        self.coarse = tested.times[np.unique(np.linspace(0, every, 6).round().astype(int))]

    def study(
        self, times: Array | None = None, rtol: float = 1e-6, mechanism: uqmbd.Mechanism | None = None
    ) -> uqmbd.Study:
        """Return the study, at few times by default."""
        made = self.mechanism if mechanism is None else mechanism
        if not made.outputs:
            return uqmbd.Study("errors", made)
        return uqmbd.Study("errors", made, self.coarse if times is None else times, rtol=rtol, start=self.tested.start)

    def responses(self, values: Array, times: Array) -> dict[str, Array]:
        """Return the outputs (K, T), without a time (K, 1), for inputs (K, input)."""
        if self.tested.exact is not None:
            by_name = {name: values[:, [k]] for k, name in enumerate(self.inputs.names)}
            found = self.tested.exact(by_name, times)
            return {name: y if y.ndim == 2 else y[:, None] for name, y in found.items()}
        run = self.study(times, 1e-9).problem(MonteCarlo()).realise(values)
        response = np.where(run.good[:, None, None], run.response, np.nan)
        return {name: response[:, k] for k, name in enumerate(self.mechanism.outputs)}

    def drawn(self, power: int, width: int | None = None) -> Array:
        """Return points of a Sobol' sequence in (0, 1)."""
        points = qmc.Sobol(width or len(self.inputs), rng=np.random.default_rng(2026)).random_base2(power)
        return np.clip(points, 1e-12, 1 - 1e-12)

    @cached_property
    def population(self) -> dict[str, Array]:
        """Outputs at the few times for many inputs."""
        power = TIGHT if self.tested.exact is None else POINTS
        return self.responses(self.inputs.from_uniform(self.drawn(power)), self.coarse)

    @cached_property
    def moments(self) -> dict[str, tuple[Array, Array]]:
        """Mean and standard deviation (T,) of each output."""
        return {name: (np.nanmean(y, axis=0), np.nanstd(y, axis=0)) for name, y in self.population.items()}

    @cached_property
    def indices(self) -> dict[str, tuple[Array, Array]]:
        """First and total Sobol' indices (input, T), by estimators of Saltelli and Jansen."""
        d = len(self.inputs)
        both = self.drawn(PAIRS if self.tested.exact is not None else 9, 2 * d)
        one, two = both[:, :d], both[:, d:]
        first, second = (self.responses(self.inputs.from_uniform(u), self.coarse) for u in (one, two))
        parts: dict[str, list[tuple[Array, Array]]] = {name: [] for name in first}
        for i in range(d):
            mixed = one.copy()
            mixed[:, i] = two[:, i]
            third = self.responses(self.inputs.from_uniform(mixed), self.coarse)
            for name, y in third.items():
                parts[name].append(index_estimates(first[name], second[name], y))
        return {name: (np.array([p[0] for p in own]), np.array([p[1] for p in own])) for name, own in parts.items()}


def stated(node: xr.DataTree, variable: str) -> Iterator[tuple[str, Array]]:
    """Yield each output and its values (..., T); those without a time have one."""
    for path in ("statistics", "scalars/statistics"):
        if path.split("/")[0] in node.children and variable in node[path]:
            data = node[path].dataset[variable]
            timed = "time" in data.dims
            for name in map(str, data["output"].values):
                values = data.sel(output=name)
                yield name, values.transpose(..., "time").values if timed else values.values[..., None]


def coverage(row: Row, hits: Sequence[float], errors: Sequence[Array], errors_of_seeds: Sequence[Array]) -> Row:
    """Add the share of seeds (N,) whose intervals hold, and the ratio of root mean squares of the seeds."""
    if not len(hits):
        return row
    share, count = float(np.mean(hits)), len(hits)
    low, high = (float(end) for end in clopper_pearson(round(share * count), count))
    with np.errstate(all="ignore"):
        true, estimated = (
            np.sqrt(np.nanmean(np.square(x), axis=0)) for x in (np.array(errors), np.array(errors_of_seeds))
        )
        row = of_ratios(row, np.where(true > 0, estimated / true, np.nan).ravel())
    return replace(row, share=share, share_low=low, share_high=high, holds=yes_or_no(high >= LEAST))


def clear(reference: Reference, name: str) -> Mask:
    """Return at which of the few times (T,) an output varies."""
    std = reference.moments[name][1]
    return np.asarray(std > max(1e-6 * np.nanmax(std), 0.0))


# kinds of errors


def sampling(row: Row, reference: Reference, seeds: int) -> list[Row]:
    """Compare standard errors of means and standard deviations."""
    study, found = reference.study(), []
    for design, samples, words in (("random", 100, ""), ("sobol", 128, ", Sobol' points")):
        hits: dict[str, list[float]] = {"mean": [], "std": []}
        off: dict[str, list[Array]] = {"mean": [], "std": []}
        errors_of_seeds: dict[str, list[Array]] = {"mean": [], "std": []}
        for seed in range(seeds):
            node = study.propagate(MonteCarlo(samples=samples, sampling=design, seed=seed))
            for k, statistic in enumerate(("mean", "std")):
                errors = dict(stated(node, f"std_error_{statistic}"))
                parts = [
                    (
                        value - reference.moments[name][k],
                        errors[name],
                        clear(reference, name),
                        reference.moments[name][1],
                    )
                    for name, value in stated(node, statistic)
                    if name in reference.moments
                ]
                wrong, error, own, std = (np.concatenate(one) for one in zip(*parts, strict=True))
                wrong, error = wrong[own] / std[own], error[own] / std[own]
                hits[statistic].append(float((np.abs(wrong) <= 1.96 * error).mean()))
                off[statistic].append(wrong)
                errors_of_seeds[statistic].append(error)
        for statistic, title in (("mean", "mean"), ("std", "standard deviation")):
            own_row = replace(row, error=title + words)
            found.append(coverage(own_row, hits[statistic], off[statistic], errors_of_seeds[statistic]))
    return found


def quantiles(row: Row, reference: Reference, seeds: int) -> list[Row]:
    """Compare the bounds of counted quantiles with the quantiles of all samples."""
    study, hits, ratios = reference.study(), [], []
    for seed in range(seeds):
        counted = study.propagate(MonteCarlo(samples=500, keep=50, seed=seed))
        stored = study.propagate(MonteCarlo(samples=500, seed=seed))
        value, bound, right = (
            np.concatenate([y.ravel() for _, y in stated(node, name)])
            for node, name in ((counted, "quantile"), (counted, "quantile_error"), (stored, "quantile"))
        )
        known = np.isfinite(right)
        off = np.abs(value - right)[known]
        scale = np.abs(right[known]).max()
        hits.append(float((off <= bound[known] + 1e-12 * scale).mean()))
        ratios.append(
            np.sqrt(np.mean(bound[known] ** 2) / max(np.mean(off**2), 1e-300)) if off.max() > 1e-9 * scale else np.nan
        )
    return [replace(of_ratios(coverage(row, hits, [], []), np.array(ratios)), holds=yes_or_no(min(hits) == 1.0))]


def indices(row: Row, reference: Reference, seeds: int) -> list[Row]:
    """Compare the intervals of Sobol' indices."""
    study, found = reference.study(), []
    methods = [MonteCarlo(samples=256, sobol_indices=True, seed=seed) for seed in range(seeds)]
    if len(reference.inputs) < 2 or methods[0].obstacle(study):
        return []
    nodes = [study.propagate(method) for method in methods]
    for k, (name, title) in enumerate((("sobol_first", "first index"), ("sobol_total", "total index"))):
        hits, off, errors_of_seeds = [], [], []
        for node in nodes:
            values, parts = dict(stated(node, name)), []
            for output, (low, high) in stated(node, f"{name}_interval"):
                if output not in reference.indices:
                    continue
                own = (
                    clear(reference, output)
                    & np.isfinite(reference.indices[output][k]).all(axis=0)
                    & np.isfinite(low).all(axis=0)
                )
                parts.append([x[:, own].ravel() for x in (values[output], low, high, reference.indices[output][k])])
            value, low, high, right = (np.concatenate(one) for one in zip(*parts, strict=True))
            if len(value):
                hits.append(float(((low - KNOWN <= right) & (right <= high + KNOWN)).mean()))
                off.append(np.where(np.abs(value - right) > KNOWN, value - right, np.nan))
                errors_of_seeds.append((high - low) / (2 * 1.96))
        found.append(coverage(replace(row, error=title), hits, off, errors_of_seeds))
    return found


def required(reference: Reference, share: float) -> tuple[uqmbd.Mechanism, str, float]:
    """Return the mechanism with a requirement that a `share` of realisations violates, its name, and the true share."""
    made = reference.tested.make()
    name = next(iter([*made.outputs, *made.scalars]))
    last = reference.population[name][:, -1]
    level = float(f"{np.quantile(last, 1 - share):.5g}")
    expression = uqmbd.final(made.outputs[name].expression) if name in made.outputs else made.scalars[name].expression
    title = f"last {share:.0%}".replace(" ", "_").replace("%", "_percent")
    if title not in made.requirements:
        made.require(title, expression <= level)
    return made, title, float((last > level).mean())


def probabilities(row: Row, reference: Reference, seeds: int) -> list[Row]:
    """Compare the intervals of probabilities."""
    options = reference.tested.options
    methods: list[tuple[str, float, Callable[[int], uqmbd.extend.Propagator]]] = [
        ("probability", 0.1, lambda seed: MonteCarlo(samples=100, seed=seed))
    ]
    if options:
        methods.append(("probability, surrogate", 0.1, lambda seed: Collocation(seed=seed, **options)))
    if reference.tested.exact is not None and len(reference.inputs) < 20:
        methods.append(
            ("probability, reliability", 0.02, lambda seed: Reliability(seed=seed, requirement="last_2_percent"))
        )
    found = []
    for title, wanted, method in methods:
        made, name, share = required(reference, wanted)
        study = reference.study(mechanism=made)
        hits, off, errors_of_seeds = [], [], []
        fewer = {"probability, surrogate": "surrogates", "probability, reliability": "reliability"}.get(title, "")
        for seed in range(min(seeds, FEWER.get(fewer, seeds))):
            try:
                data = study.propagate(method(seed))["requirements"].to_dataset().sel(requirement=name)
            except uqmbd.UqmbdError as error:
                print(f"{title}, {row.mechanism}: {error}", file=sys.stderr)
                break
            low, high = data["interval"].values
            hits.append(float(low <= share <= high))
            off.append(np.array([float(data["violation_probability"]) - share]))
            errors_of_seeds.append(np.array([(high - low) / (2 * 1.96)]))
        found.append(coverage(replace(row, error=title, seeds=len(hits)), hits, off, errors_of_seeds))
    return found


@dataclass(frozen=True)
class Verified:
    """Surrogate errors over the standard deviation, shape (output, time), accelerations, and families of alignment."""

    stated: Array
    true: Array
    cost: float
    families: tuple[str, ...]


def verified(reference: Reference, seed: int = 0, points: int = 1024, **options: Any) -> Verified:
    """Compute a surrogate and its errors at other realisations."""
    study = reference.study(reference.tested.times, 1e-8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        node = study.propagate(Collocation(seed=seed, **{**reference.tested.options, **options}))
    chaos = surrogate(node)
    drawn = uqmbd.extend.VerificationPoints.drawn(chaos.space, points, 20_000, 0)
    known = reference.__dict__.setdefault("_others", {})
    if points not in known:
        known[points] = reference.responses(chaos.space.to_inputs(drawn.germs), reference.tested.times)
    right = np.stack([known[points][name] for name in reference.mechanism.outputs], axis=1)
    wrong = chaos.evaluate_germs(drawn.germs) - right
    # a few in a thousand are farther out than any sample of the statistics, where phases are unknown
    kept = np.isfinite(wrong).all(axis=(1, 2))
    if kept.mean() < 0.98:
        raise uqmbd.UqmbdError(f"the surrogate has no value at {1 - kept.mean():.1%} of the points")
    weights = drawn.weights[kept] / drawn.weights[kept].sum()
    spread = np.maximum(chaos.std, 0.01 * chaos.std.max(axis=1, keepdims=True))
    true = np.sqrt(np.tensordot(weights, wrong[kept] ** 2, axes=1)) / spread
    stated_error = node["statistics"]["verification_error"].transpose("output", "time").values
    cost = json.loads(node.attrs["solver_counters"])["accelerations"]
    families = node["families"].dataset["family"].values.tolist() if "families" in node.children else ["plain"]
    return Verified(stated_error, true, float(cost), tuple(families))


def surrogates(row: Row, reference: Reference, seeds: int, **options: Any) -> list[Row]:
    """Compare verification errors; with an alignment where the mechanism has one."""
    if not reference.tested.options:
        return []
    if reference.tested.helps is not None:
        options = {"alignment": "phase", **options}
    count = seeds if reference.tested.helps is None else min(seeds, FEWER["aligned"])
    every = [verified(reference, seed, **options) for seed in range(count)]
    estimated, true = (np.stack([getattr(one, name) for one in every]) for name in ("stated", "true"))
    counted = true > SMALL
    if not counted.any():
        return [replace(row, seeds=count)]
    row = of_ratios(replace(row, seeds=count), estimated[counted] / true[counted])
    large = true > LARGE
    least = float((estimated[large] / true[large]).min()) if large.any() else np.nan
    share = float((estimated[large] / true[large] >= FIFTH).mean()) if large.any() else np.nan
    holds = row.within >= NEAR and not least < FIFTH
    return [replace(row, share=share, holds=yes_or_no(holds))]


MEMBERS: Mapping[str, Any] = {
    "plain": None, "events": "events", "phase": "phase", "two-frequency": "two-frequency",
    "events+phase": ("events", "phase"),
}  # fmt: skip


def alignment(row: Row, reference: Reference, seeds: int) -> list[Row]:
    """Compare the errors of ``alignment="auto"`` with those of its best member, and its cost with the costliest."""
    if not reference.tested.options or reference.tested.options.get("method"):
        return []
    ratios, shares, costs, count = [], [], [], seeds
    scale = np.nanstd(responses_over_time(reference), axis=0).max(axis=1, keepdims=True)
    for seed in range(count):
        chosen = verified(reference, seed, 256, alignment="auto")
        members = {name: verified(reference, seed, 256, alignment=MEMBERS[name]) for name in chosen.families}
        best = np.min([one.true for one in members.values()], axis=0)
        limit = 1.5 * best + 1e-3 * scale / np.maximum(np.nanstd(responses_over_time(reference), axis=0), 0.01 * scale)
        ratios.append((chosen.true / limit).ravel())
        shares.append(float((chosen.true <= limit).mean()))
        costs.append(chosen.cost / max(one.cost for one in members.values()))
    found = np.concatenate(ratios)
    cost = float(max(costs))
    return [
        replace(
            row,
            seeds=count,
            ratio=float(np.median(found)),
            lowest=float(found.min()),
            highest=float(found.max()),
            share=float(np.mean(shares)),
            cost=cost,
            holds=yes_or_no(bool(found.max() <= 1.0) and cost <= 1.1),
        )  # fmt: skip
    ]


def responses_over_time(reference: Reference) -> Array:
    """Return 1,024 responses (K, output, time) over the whole time."""
    known = reference.__dict__.setdefault("_over_time", {})
    if not known:
        found = reference.responses(reference.inputs.from_uniform(reference.drawn(10)), reference.tested.times)
        known["all"] = np.stack([found[name] for name in reference.mechanism.outputs], axis=1)
    return known["all"]


def integration(row: Row, reference: Reference, seeds: int, samples: int = 500, rtol: float = 1e-6) -> list[Row]:
    """Compute samples, compare all of them with the reference, and compare the errors."""
    tested = reference.tested
    if tested.count < 3:
        return []
    times = np.linspace(0, min(tested.end, 20.0), min(tested.count, 201))
    if tested.kind == "controller":
        times = tested.times
    study, check = reference.study(times, rtol), reference.study(times, 1e-2 * rtol)
    ratios, above, costs = [], [], []
    for seed in range(seeds):
        node = study.propagate(method := MonteCarlo(samples=samples, seed=seed + 1))
        values = node["samples"]["inputs"].transpose("sample", "input").values
        first = study.problem(method).realise(values)
        exact = reference.responses(values, times)
        right = np.stack([exact[name] for name in reference.mechanism.outputs], axis=1)
        good = first.good & np.isfinite(right).all(axis=(1, 2))
        true = np.abs(first.response[good] - right[good])
        names = ("integration_error_rms", "integration_error")
        rms, quantile = (node["statistics"][name].transpose("output", "time").values for name in names)
        true_rms = np.sqrt((true**2).mean(axis=0))
        counted = true_rms > ROUNDING * first.response[good].std(axis=0).max(axis=1, keepdims=True)
        ratios += [
            float(np.sqrt((rms[k][own] ** 2).mean() / (true_rms[k][own] ** 2).mean()))
            for k, own in enumerate(counted)
            if own.any()
        ]
        if counted.any():
            above.append(float((true > quantile).mean(axis=0)[counted].mean()))
        repeated = node["statistics"]["integration_error"].attrs.get("realisations", 0)
        if seed == 0:
            other = check.problem(method).realise(values[:50])
            costs.append(repeated / 50 * other.counters["accelerations"] / first.counters["accelerations"])
    row = of_ratios(replace(row, cost=float(costs[0])), np.array(ratios))
    if not ratios:
        return [row]
    share, count = float(np.mean(above)), samples * seeds
    low, high = (float(end) for end in clopper_pearson(round(share * count), count))
    holds = row.within >= NEAR and share <= ABOVE
    return [replace(row, share=share, share_low=low, share_high=high, holds=yes_or_no(holds))]


def posterior(row: Row, reference: Reference, seeds: int, noise: float = 0.05, measured: int = 20) -> list[Row]:
    """Draw inputs from the prior, calibrate with records of them, and compare the 95 % intervals."""
    tested = reference.tested
    names = reference.inputs.names
    end = min(tested.end, 20.0)
    times = tested.times[tested.times <= end * (1 + 1e-9)]
    times = times[np.unique(np.linspace(0, len(times) - 1, measured + 1).round().astype(int))[1:]]
    hits, off, errors_of_seeds = [], [], []
    outputs = {**reference.mechanism.outputs, **reference.mechanism.scalars}
    prior = reference.inputs.from_uniform(reference.drawn(10)).std(axis=0)
    for seed in range(seeds):
        draw = np.random.default_rng(seed)
        values = reference.inputs.from_uniform(draw.uniform(size=(1, len(names))))
        # a study begins at its first time
        exact = reference.responses(values, np.append(tested.times[0], times))
        exact = {name: y[:, 1:] if name in reference.mechanism.outputs else y for name, y in exact.items()}
        series = []
        for name in list(exact)[: 1 if reference.mechanism.outputs else 2]:
            std = noise * float(np.nanmax(reference.moments[name][1]))
            y = exact[name][0] + std * draw.normal(size=exact[name].shape[1])
            at = times if name in reference.mechanism.outputs else []
            series.append(Series(name, at, y, outputs[name].units, std))
        found = calibrate(reference.study(tested.times), Record("run", series), seed=seed, draws=2000)
        data = found.tree["posterior"].dataset
        draws = np.stack([data[name].values.ravel() for name in names], axis=1)
        low, high = np.quantile(draws, [0.025, 0.975], axis=0)
        hits.append(float(((low <= values[0]) & (values[0] <= high)).mean()))
        off.append((draws.mean(axis=0) - values[0]) / prior)
        errors_of_seeds.append(draws.std(axis=0) / prior)
    return [coverage(row, hits, off, errors_of_seeds)]


ERRORS: Mapping[str, Callable[..., list[Row]]] = {
    "integration": integration, "sampling": sampling, "quantile": quantiles, "indices": indices,
    "probability": probabilities, "surrogate": surrogates, "alignment": alignment, "posterior": posterior,
}  # fmt: skip
"""Functions of the rows, by what ``--errors`` names."""


def rows_of(error: str, mechanism: str, seeds: int = SEEDS, **options: Any) -> list[Row]:
    """Return the rows of one kind of errors of one mechanism.

    Parameters
    ----------
    error, mechanism : str
        Keys of `ERRORS` and `MECHANISMS`.
    seeds : int
        Number of repetitions.
    **options
        Options of the function in `ERRORS`.

    Returns
    -------
    list of Row
    """
    tested, begin, count = MECHANISMS[mechanism], time.process_time(), min(seeds, FEWER.get(error, seeds))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = ERRORS[error](Row(error, mechanism, tested.kind, count), Reference(tested), count, **options)
    spent = time.process_time() - begin
    return [replace(row, seconds=round(spent / len(found), 2)) for row in found]


# the table


def stored(path: Path) -> list[Row]:
    """Read rows."""
    if not path.exists():
        return []
    types = {one.name: {"str": str, "int": int, "float": float}[str(one.type)] for one in fields(Row)}
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Row(**{name: types[name](value if value or types[name] is str else "nan") for name, value in row.items()})
            for row in csv.DictReader(file)
        ]


def store(path: Path, rows: Sequence[Row]) -> None:
    """Write rows in the order of errors and mechanisms; numbers have four digits."""
    order = {name: k for k, name in enumerate(TITLES)}, {name: k for k, name in enumerate(MECHANISMS)}
    rows = sorted(rows, key=lambda row: (order[0].get(row.error, 99), order[1].get(row.mechanism, 99)))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([one.name for one in fields(Row)])
        for row in rows:
            values = [getattr(row, one.name) for one in fields(Row)]
            writer.writerow(["" if v != v else f"{v:.4g}" if isinstance(v, float) else v for v in values])


TITLES: Mapping[str, str] = {
    "integration": "integration", "mean": "sampling", "standard deviation": "sampling",
    "mean, Sobol' points": "sampling", "standard deviation, Sobol' points": "sampling", "quantile": "quantile",
    "first index": "indices", "total index": "indices", "probability": "probability",
    "probability, surrogate": "probability", "probability, reliability": "probability", "surrogate": "surrogate",
    "alignment": "alignment", "posterior": "posterior",
}  # fmt: skip
"""Kinds of rows, and the functions of `ERRORS` that compute them."""


def summary(rows: Sequence[Row]) -> list[Row]:
    """Return one row for each kind of error: medians and extremes over mechanisms, and the share of all seeds."""
    found = []
    for error in TITLES:
        own = [row for row in rows if row.error == error and row.holds]
        if not own:
            continue
        weights = np.array([row.seeds for row in own], dtype=float)

        def mean(name: str, own: Sequence[Row] = own, weights: Array = weights) -> float:
            values = np.array([getattr(row, name) for row in own])
            known = np.isfinite(values)
            return float(np.average(values[known], weights=weights[known])) if known.any() else np.nan

        ratios = np.array([row.ratio for row in own if np.isfinite(row.ratio)])
        share, count = mean("share"), int(weights.sum())
        low, high = clopper_pearson(round(share * count), count)
        yes = sum(row.holds == "yes" for row in own)
        found.append(
            Row(
                error,
                f"{yes} of {len(own)}",
                "",
                count,
                float(np.median(ratios)),
                float(ratios.min()),
                float(ratios.max()),
                mean("within"),
                share,
                float(low),
                float(high),
                mean("cost"),
                yes_or_no(yes == len(own)),
                sum(row.seconds for row in rows if row.error == error),
            )  # fmt: skip
        )
    return found


def show(rows: Sequence[Row]) -> None:
    """Print the table of a kind of error or of all."""
    columns = (
        "error",
        "mechanism",
        "seeds",
        "stated over true",
        "range",
        "within 0.5 to 2",
        "share",
        "interval",
        "cost",
        "holds",
        "s",
    )
    table = table_of("Stated and true errors", *columns)
    for row in rows:
        shares = ["" if v != v else f"{v:.1%}" for v in (row.within, row.share)]
        interval = "" if row.share_low != row.share_low else f"{row.share_low:.1%} to {row.share_high:.1%}"
        cost = "" if row.cost != row.cost else f"{row.cost:.2f}"
        numbers = f"{row.ratio:.2f}", f"{row.lowest:.2g} to {row.highest:.2g}"
        table.add_row(
            row.error, row.mechanism, str(row.seeds), *numbers, *shares, interval, cost, row.holds, f"{row.seconds:.0f}"
        )
    console.print(table)


GROUPS: Mapping[str, Sequence[str]] = {
    "stated_errors.png": ("integration", "surrogate", "mean", "standard deviation"),
    "stated_errors_of_intervals.png": (
        "first index", "total index", "probability", "probability, reliability", "posterior",
    ),
}  # fmt: skip
"""Kinds of errors in each picture."""


def page_table(rows: Sequence[Row]) -> str:
    """Return the table of the page: a line for each kind of error, as Markdown."""
    of_intervals = "intervals that contain the true value"
    heads = (
        "stated error",
        "mechanisms",
        "repetitions",
        "stated over true",
        "0.5 to 2",
        of_intervals,
        "within the limits",
    )
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for row in summary([one for one in rows if one.error != "alignment"]):
        own = [one for one in rows if one.error == row.error and one.holds]
        ratio = f"{row.ratio:.2f} ({row.lowest:.2g} to {row.highest:.2g})"
        within = f"{row.within:.0%}".replace("%", " %") if np.isfinite(row.within) else ""
        covered = ""
        if TITLES[row.error] not in ("integration", "surrogate", "alignment"):
            covered = f"{100 * row.share:.1f} % ({100 * row.share_low:.0f} to {100 * row.share_high:.0f})"
        cells = (row.error, str(len(own)), str(row.seeds), ratio, within, covered, row.mechanism)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def chart(rows: Sequence[Row], group: Sequence[str]) -> Chart:
    """Chart stated over true errors of the mechanisms: the median, two quantiles and the range."""
    own = {error: np.array([row.ratio for row in rows if row.error == error]) for error in group}
    ratios = {error: of[np.isfinite(of)] for error, of in own.items() if np.isfinite(of).any()}
    low, below, middle, above, high = (
        np.array([np.quantile(of, q) for of in ratios.values()]) for q in (0, 0.1, 0.5, 0.9, 1)
    )
    curves = [
        Curve(
            "median; bar: range over mechanisms",
            middle,
            (Band("all mechanisms", low, high, bars=True),),
            drawn="points",
        ),
        Curve("one of ten mechanisms is below", below, drawn="points"),
        Curve("one of ten mechanisms is above", above, drawn="points"),
    ]
    ends = float(min(low.min() / 1.5, 0.3)), float(max(high.max() * 1.5, 3.0))
    limits = {"twice": AGREE[1], "half": AGREE[0]}
    name, across = "stated over true error", "kind of error"
    return Chart(name, list(ratios), curves, across=across, ends=ends, log=True, limits=limits)


def missing(rows: Sequence[Row], errors: Sequence[str], names: Sequence[str]) -> list[tuple[str, str]]:
    """Return what is not stored yet: function of the rows, and mechanism."""
    known = {(TITLES[row.error], row.mechanism) for row in rows}
    return [(error, name) for error in errors for name in names if (error, name) not in known]


def main() -> None:
    """Compute what is missing, or print and draw the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--errors", nargs="*", choices=ERRORS, default=list(ERRORS), help="kinds of errors")
    parser.add_argument("--only", nargs="*", choices=MECHANISMS, default=list(MECHANISMS), help="mechanisms")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of repetitions with other points")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    parser.add_argument("--out", type=Path, default=STORED, help="file of the rows")
    parser.add_argument("--table", action="store_true", help="print and draw the stored table")
    given = parser.parse_args()
    rows = stored(given.out)
    if given.table:
        show(rows)
        print(page_table(rows))
        for name, group in GROUPS.items():
            chart_figure(chart(rows, group)).savefig(PICTURES / name, bbox_inches="tight", dpi=110)
        return
    tasks = missing(rows, given.errors, given.only)
    with ProcessPoolExecutor(given.workers) as pool:
        running = {pool.submit(rows_of, error, name, given.seeds): (error, name) for error, name in tasks}
        for future in as_completed(running):
            error, name = running[future]
            try:
                found = future.result()
            except Exception as raised:  # the others go on, and this one is tried again in the next run
                print(f"{error}, {name}: {type(raised).__name__}: {raised}", file=sys.stderr, flush=True)
                continue
            rows += found
            store(given.out, rows)
            print(f"{error}, {name}: {sum(row.seconds for row in found):.1f} s", flush=True)


if __name__ == "__main__":
    main()
