"""Main contributors: the share of each input in the variance of an output, or in a violation of a requirement."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.report.figures import has_indices, indices_of, label_of, node_with_indices
from uqmbd.report.view import StudyResult
from uqmbd.results.assessment import COARSE
from uqmbd.results.chaos import exceeds_locally, spread_words
from uqmbd.status import Status
from uqmbd.typing import Array
from uqmbd.wording import format_at_most, format_index, format_share, minus

__all__ = ["FEWEST_SAMPLES", "SAMPLES", "Influences", "of_history", "of_requirement", "of_scalar"]

LEAST = 0.005
"""Minimum share of an input on the first screen."""

SAMPLES = 4
"""Minimum number of samples per input for a regression."""

FEWEST_SAMPLES = 30
"""Minimum number of samples for a regression."""

COMMON = 0.02
"""Excess of the sum of total indices over one above which the report states an interaction of inputs."""

DEPENDENT = 0.3
"""Correlation of two inputs above which a regression cannot separate their effects."""


@dataclass(frozen=True)
class Influences:
    """Influence of each input on a quantity."""

    names: tuple[str, ...]  # inputs, or germs if inputs are dependent; the largest share first
    shares: tuple[float, ...]  # shares of the variance or of the squared reliability index, or signed effects
    kind: str  # description of the numbers
    signed: bool = False  # whether the numbers are signed; a negative number decreases the quantity
    correlations: bool = False  # whether the numbers are correlations instead of shares or effects
    # share of the variance due to each input alone, in the same order; empty if `shares` are not shares of the variance
    alone: tuple[float, ...] = ()
    # 95 % intervals of shares of the variance that are estimated from samples, in the same order; otherwise empty
    intervals: tuple[tuple[float, float], ...] = ()

    @property
    def together(self) -> str:
        """Text on the effect of interactions on the sum of the shares; empty if the sum is about one."""
        total = sum(self.shares)
        if not self.alone or not total > 1 + COMMON:
            return ""
        # interactions are certain only if the excess is larger than the sum of the widths of the 95 % intervals
        if total - 1 <= sum(high - low for low, high in self.intervals):
            return (
                f"The total indices add up to {format_share(total)}; the excess over 100 % is within their sampling "
                "errors. Solid: the first-order index."
            )
        return (
            f"The total indices add up to {format_share(total)}, because interactions count for each input involved. "
            "Solid: the first-order index."
        )

    @property
    def words(self) -> str:
        """Text on the largest influence, for a table."""
        if not self.names or not math.isfinite(self.shares[0]):
            return ""
        if self.correlations:
            return f"{self.names[0]} (correlation {self.written(0)})"
        direction = ""
        if self.signed:
            direction = ", increases it" if self.shares[0] > 0 else ", decreases it"
        return f"{self.names[0]} ({self.written(0).lstrip('+−')}{direction})"

    def written(self, k: int) -> str:
        """Return the k-th number as text: a share or a signed effect in per cent, or a correlation as a number."""
        share = self.shares[k]
        if self.correlations:
            return minus(f"{share:+.2f}")
        if not self.signed:
            return format_index(share, *(self.intervals[k] if self.intervals else ()))
        text = format_share(abs(share))
        return f"{'−' if share < 0 else '+'}{text}" if text != "0 %" else text


def _order(result: StudyResult) -> list[str]:
    """Return the labels of the methods, the most reliable first."""
    return [label for label in result.assessment.order if label in result.methods]


def of_history(result: StudyResult, name: str, *, correlations: bool = False) -> Influences | None:
    """Return the influences on an output over time; None if the results do not contain them."""
    nodes = {label: node for label, node in result.nodes.items() if has_indices(node) and _has(node, name)}
    if nodes:
        node = node_with_indices(nodes)
        found = indices_of(node, name)
        if found.meaningful.any():
            kind = "Total Sobol’ indices: share of the variance, over all times, to which each input contributes"
            alone, total = found.weighted
            text = f"{kind} ({label_of(node)})." + _of_poor_surrogate(node, name)
            return _sorted(found.names, total, text, alone=alone, intervals=found.averaged_interval)
    return _of_samples(result, name, scalar=False, correlations=correlations)


def _of_poor_surrogate(node: xr.DataTree, name: str) -> str:
    """State the error of the surrogate from which the indices of an output come; empty if the error is small."""
    data = node.children["statistics"].to_dataset()
    if "verification_error" not in data or name not in data["output"].values:
        return ""
    errors, std = (np.atleast_1d(data[key].sel(output=name).values) for key in ("verification_error", "std"))
    error = float(errors.max())
    if not error > COARSE:
        return ""
    size = format_at_most(error, spread_words(exceeds_locally(errors, std, error)))
    return f" Unreliable: the stated error of the surrogate is {size}."


def of_scalar(result: StudyResult, name: str, *, correlations: bool = False) -> Influences | None:
    """Return the influences on a scalar output; None if the results do not contain them."""
    for label in _order(result):
        inner = result.methods[label].scalars
        if inner is not None and name in inner.names and (found := _total(inner.of(name), label)):
            return found
    return _of_samples(result, name, scalar=True, correlations=correlations)


def of_requirement(result: StudyResult, name: str) -> Influences | None:
    """Return the influences on the violation of a requirement; None if the results do not contain them."""
    children = {label: result.methods[label].node.children.get("requirements") for label in _order(result)}
    nodes = {label: node for label, node in children.items() if node is not None}
    for label, node in nodes.items():
        data = node.to_dataset()
        if "importance" in data and name in data["requirement"].values:
            row = data.sel(requirement=name)
            if np.isfinite(row["importance"].values).all():
                kind = "Importance factors: share of each input in the squared reliability index"
                return _sorted(row["input"].values, row["importance"].values, f"{kind} ({label}).")
    for label, node in nodes.items():
        inner = node.children["statistics"].to_dataset() if "statistics" in node.children else None
        if inner is not None and name in inner["output"].values:
            # the running margin at the last time is the margin of the whole motion
            margin = inner.sel(output=name)
            margin = margin.isel(time=-1) if "time" in margin.dims else margin
            if found := _total(margin, label, "of its margin "):
                return found
    return None


def _has(node: xr.DataTree, name: str) -> bool:
    return name in node.children["statistics"].to_dataset()["output"].values


def _total(data: xr.Dataset, label: str, quantity: str = "") -> Influences | None:
    """Return total indices of a scalar output, or of an output over time weighted by its variance.

    `quantity` is a text on the quantity, such as "of its margin ".
    """
    for end, dim in (("", "input"), ("_germ", "germ")):
        if f"sobol_total{end}" not in data:
            continue
        std = np.asarray(data["std"].values, dtype=float)
        values = _over_time(data[f"sobol_total{end}"].values, std)
        if not np.isfinite(values).all() or not np.nanmax(std) > 0:
            continue
        kind = f"Total Sobol’ indices: share of the variance {quantity}to which each input contributes ({label})."
        first = _over_time(data[f"sobol_first{end}"].values, std) if f"sobol_first{end}" in data else None
        ends = data[f"sobol_total{end}_interval"].values if f"sobol_total{end}_interval" in data else None
        intervals = None if ends is None else np.stack([_over_time(one, std) for one in ends], axis=1)
        return _sorted(data[dim].values, values, kind, alone=first, intervals=intervals)
    return None


def _over_time(values: Array, std: Array) -> Array:
    """Return indices (input,) unchanged, or indices (input, time) as mean over time weighted by the variance."""
    if values.ndim == 1:
        return np.asarray(values, dtype=float)
    weight = np.nan_to_num(std) ** 2
    return np.asarray(values @ weight / weight.sum() if weight.sum() > 0 else values[:, 0] * np.nan, dtype=float)


def _of_samples(result: StudyResult, name: str, *, scalar: bool, correlations: bool) -> Influences | None:
    """Return the effects of a linear regression, or correlations, at the time of the largest standard deviation."""
    for label in _order(result):
        method = result.methods[label]
        inner = method.scalars if scalar else method
        if inner is None or inner.samples is None or name not in inner.names or "input" not in inner.samples.sizes:
            continue
        samples = inner.samples.isel(output=inner.names.index(name))
        samples = samples.isel(sample=np.flatnonzero(samples["status"].values == Status.OK))
        paths = ""
        if "input_key" in samples.coords:  # omit keys of sampled paths, which have no linear effect
            samples = samples.isel(input=~samples["input_key"].values)
            paths = " Sampled paths are not included; their share is a Sobol' index."
        count, columns = samples["inputs"].shape
        if not columns or count < max(FEWEST_SAMPLES, SAMPLES * columns):
            return None
        response, when = np.asarray(samples["response"].values, dtype=float), ""
        if response.ndim > 1:
            at = int(np.nan_to_num(inner.of(name)["std"].values, nan=-1.0).argmax())
            response, when = response[:, at], f" at {float(samples['time'][at]):.4g} s"
        values = np.asarray(samples["inputs"].values, dtype=float)
        dependent = _dependent(values)
        if (dependent or correlations) and np.ptp(response) > 0:
            inputs = ", whose inputs are dependent" if dependent else ""
            kind = f"Correlations{when} by {label}{inputs}: + increases, − decreases the output.{paths}"
            found = _standard(values).T @ _standard(response) / count
            return _sorted(samples["input"].values, found, kind, signed=True, correlations=True)
        effects, explained = _regression(values, response)
        if not np.isfinite(effects).all() or not np.ptp(response) > 0:
            return None
        kind = (
            f"Effects{when}, as shares of the standard deviation, by a linear regression of {label} that explains "
            f"{format_share(explained)} of the variance: + increases, − decreases the output.{paths}"
        )
        return _sorted(samples["input"].values, effects, kind, signed=True)
    return None


def _dependent(inputs: Array) -> bool:
    """Return whether any two inputs (K, input) are so correlated that a regression cannot separate their effects."""
    x = _standard(inputs)
    return bool((np.abs(np.triu(x.T @ x / len(x), 1)) > max(DEPENDENT, 4 / math.sqrt(len(x)))).any())


def _standard(values: Array) -> Array:
    """Return standardised values (K, ...); zero for zero standard deviation."""
    scale = values.std(axis=0)
    return np.asarray((values - values.mean(axis=0)) / np.where(scale > 0, scale, 1.0))


def _regression(inputs: Array, response: Array) -> tuple[Array, float]:
    """Return standardised regression coefficients, and the share of the variance that they explain."""
    x, y = _standard(inputs), _standard(response)
    effects = np.asarray(np.linalg.lstsq(x, y, rcond=None)[0], dtype=float)
    return effects, float(np.clip(1 - np.mean((y - x @ effects) ** 2), 0.0, 1.0))


def _sorted(
    names: Iterable[object],
    shares: Array,
    kind: str,
    *,
    signed: bool = False,
    correlations: bool = False,
    alone: Array | None = None,
    intervals: Array | None = None,
) -> Influences:
    known = [str(name) for name in names]
    order = sorted(range(len(shares)), key=lambda k: (-abs(shares[k]), k))
    numbers = tuple(float(shares[k]) for k in order)
    own = () if alone is None or not np.isfinite(alone).all() else tuple(float(alone[k]) for k in order)
    ends: tuple[tuple[float, float], ...] = ()
    if intervals is not None and np.isfinite(intervals).all():
        ends = tuple((float(intervals[k, 0]), float(intervals[k, 1])) for k in order)
    return Influences(tuple(known[k] for k in order), numbers, kind, signed, correlations, own, ends)
