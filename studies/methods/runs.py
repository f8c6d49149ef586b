"""Error against cost: one row for each mechanism, method, size and seed."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.errors import UqmbdError
from uqmbd.results import stated_accuracy, surrogate

from .candidates import Candidate, candidates
from .cases import CASES, Array, Reference, stated, study_with_levels
from .truths import QUANTILES, Truth, load_truth

__all__ = ["QUESTIONS", "Row", "rows_of"]

QUESTIONS = "mean", "std", "quantile_0.01", "quantile_0.99", "first", "total"
"""Statistics whose errors are compared; probabilities have a row each."""
DRAWS = 2**15
"""Points at which a surrogate is evaluated for quantiles beyond those that results contain."""
STILL = 1e-9
"""Largest standard deviation over the largest mean of an output that does not vary."""
SEEDS = 3
"""Repetitions of methods whose result depends on the seed."""


@dataclass(frozen=True)
class Row:
    """Error and cost of one run.

    Attributes
    ----------
    mechanism, kind, method, size : str
        What was run.
    seed : int
        Its seed.
    question : str
        The statistic; ``exceeds_P`` for a probability of about P.
    error : float
        Largest error over outputs and times; of means, standard deviations and quantiles over the largest standard
        deviation of the output; of Sobol' indices absolute; of probabilities relative to the true one.
    truth_error : float
        Error of the reference in the same measure.
    stated : float
        Stated error in the same measure; NaN: the result states none.
    realisations : int
        Those of the attribute ``realisations`` of the result.
    seconds : float
        Processor time of the method, s.
    failure : str
        Message of a method that failed.
    """

    mechanism: str
    kind: str
    method: str
    size: str
    seed: int
    question: str
    error: float
    truth_error: float
    stated: float
    realisations: int
    seconds: float
    failure: str = ""


def rows_of(mechanism: str, only: str = "", most_seconds: float = 60.0) -> Iterator[Row]:
    """Yield the rows of a mechanism; sizes of a method end where one has taken `most_seconds` of processor time.

    `only` restricts the methods to those whose name begins with it.
    """
    reference, truth = Reference(CASES[mechanism]), load_truth(mechanism)
    too_long: set[str] = set()
    for one in candidates(reference.tested, len(reference.inputs), tuple(truth.levels)):
        if one.method in too_long or not one.method.startswith(only):
            continue
        levels = {key: x for key, x in truth.levels.items() if one.requirement in (None, key)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            study = study_with_levels(Reference(CASES[mechanism]), levels)
        for seed in range(SEEDS if one.random else 1):
            about = mechanism, reference.tested.kind, one.method, one.size, seed
            begin = time.process_time()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    node = study.propagate(one.make(seed))
            except UqmbdError as raised:
                yield Row(*about, "", np.nan, np.nan, np.nan, 0, time.process_time() - begin, first_line(raised))
                too_long.add(one.method) if "alignment" in one.method else None
                break
            seconds = time.process_time() - begin
            for question, (error, known, claimed) in errors(node, truth, one).items():
                yield Row(*about, question, error, known, claimed, int(node.attrs["realisations"]), seconds)
            if seconds > most_seconds:
                too_long.add(one.method)
                break


def first_line(error: Exception) -> str:
    """Return the beginning of a message."""
    return str(error).splitlines()[0][:160] if str(error) else type(error).__name__


def errors(node: xr.DataTree, truth: Truth, one: Candidate) -> dict[str, tuple[float, float, float]]:
    """Return error, error of the reference and stated error of each question that a result answers."""
    found: dict[str, tuple[float, float, float]] = {}
    if one.requirement is None:
        claimed = stated_accuracy(node).value
        for statistic, value in answers(node).items():
            if statistic in truth.values:
                pair = largest(value, truth, statistic)
                found[statistic] = (*pair, claimed if statistic in ("mean", "std") else np.nan)
    if "requirements" in node.children:
        data = node["requirements"].dataset
        for k, level in enumerate(truth.levels):
            if level in data["requirement"].values:
                own, true = data.sel(requirement=level), truth.values["probability"][k]
                if not true:  # no relative error exists
                    continue
                low, high = own["interval"].transpose("bound", ...).values
                found[level] = (
                    abs(float(own["violation_probability"]) - true) / true,
                    float(truth.errors["probability"][k] / true),
                    float(high - low) / 2 / true,
                )
    return found


def largest(value: dict[str, Array], truth: Truth, statistic: str) -> tuple[float, float]:
    """Return the largest error of a statistic over outputs and times, and the error of the reference there.

    Outputs that do not vary, such as a driven travel, are left out, as are outputs without a true statistic.
    """
    worst = -1.0, np.nan
    for name, own in value.items():
        if name not in truth.outputs:
            continue
        k = truth.outputs.index(name)
        if truth.scale[k] <= STILL * np.nanmax(np.abs(truth.values["mean"][k])):
            continue
        true, off = truth.values[statistic][..., k, :], truth.errors[statistic][..., k, :]
        moves = truth.values["std"][k] > 1e-6 * truth.scale[k]
        scale = truth.scale[k] if statistic not in ("first", "total") else 1.0
        wrong, off = (np.where(moves & np.isfinite(true), x / scale, -1.0) for x in (np.abs(own - true), off))
        if np.isnan(wrong).any():
            return np.inf, np.nan
        if wrong.max() > worst[0]:
            worst = float(wrong.max()), float(off.ravel()[wrong.argmax()])
    return worst


def answers(node: xr.DataTree) -> dict[str, dict[str, Array]]:
    """Return each statistic of a result by output, (time,), of Sobol' indices (input, time)."""
    named = {"mean": "mean", "std": "std", "first": "sobol_first", "total": "sobol_total"}
    found = {question: dict(stated(node, variable)) for question, variable in named.items()}
    for group in (node, node["scalars"]) if "scalars" in node.children else (node,):
        if "samples" in group.children:
            data = group["samples"]["response"].transpose("sample", "output", ...)
            names = [str(x) for x in data["output"].values]
            levels = np.nanquantile(data.values.reshape(len(data), len(names), -1), QUANTILES, axis=0)
        elif "chaos" in group.children:
            chaos = surrogate(group)
            names = [one.name for one in chaos.labels.outputs]
            levels = chaos.quantiles(QUANTILES, samples=DRAWS)
        else:
            continue
        for q, values in zip(QUANTILES, levels, strict=True):
            own = found.setdefault(f"quantile_{q:g}", {})
            for name, row in zip(names, np.asarray(values).reshape(len(names), -1), strict=True):
                own.setdefault(name, row)
    return {question: values for question, values in found.items() if values}
