"""Which methods the first screen speaks of: those that are recommended."""

from __future__ import annotations

import math

import xarray as xr

from uqmbd.report.figures import finest, surrogate_nodes
from uqmbd.report.view import Method, StudyResult, dataset_of
from uqmbd.results import Answer, answers
from uqmbd.results.comparison import AGREES, COARSE, REFERENCE, own_error, recommended
from uqmbd.results.statistics import rtol_of

__all__ = ["ROUGHLY", "WELL", "answer_of", "comparison_of", "holder_of", "populations", "trusted_labels"]

WELL, ROUGHLY = 0.05, COARSE
"""Stated errors, in shares of the standard deviation, up to which an output is known well, and roughly."""


def comparison_of(result: StudyResult) -> xr.Dataset | None:
    """Return the comparison of methods, also of those that have outputs without a time only; None without verdicts."""
    found = dataset_of(result.tree, "comparison")
    return found if found is not None and "verdict_kind" in found and "method" in found.coords else None


def trusted_labels(result: StudyResult) -> list[str]:
    """Return all methods, those that are recommended first, then the reference.

    A reference in which an output has no spread that others give one (a surrogate of order 0) comes last.
    """
    compared = comparison_of(result)
    first: list[str] = []
    if compared is not None:
        first = list(recommended(compared))
        reference = str(compared.attrs.get("reference", ""))
        if reference in result.methods and (first or not _blind(result, result.methods[reference])):
            first.append(reference)
        elif not first:
            holders = surrogate_nodes(result.nodes)
            rest = [label for label, method in result.methods.items() if not _blind(result, method)]
            first += [finest(holders)] if holders else rest
    return [label for label in dict.fromkeys([*first, *result.methods]) if label in result.methods]


def _blind(result: StudyResult, method: Method) -> bool:
    still = [name for name in method.histories if not method.varies(name)]
    return any(other.varies(name) for name in still for other in result.holders(name).values())


def populations(result: StudyResult) -> list[StudyResult]:
    """Return a result for each distribution of the inputs, of the methods that have it: several after a calibration."""
    found: dict[str, dict[str, Method]] = {}
    for label, method in result.methods.items():
        found.setdefault(str(method.node.attrs.get("population", "")), {})[label] = method
    return [result] if len(found) == 1 else [StudyResult(result.tree, methods) for methods in found.values()]


def holder_of(result: StudyResult, name: str, *, scalar: bool = False) -> Method | None:
    """Return the most trusted method that has an output; of an output without a time as a result of such.

    Where that does not know this output well, or not even roughly, it is the next one that does and agrees on it.
    """
    held = dict[str, Method]()
    for label in trusted_labels(result):
        method = result.methods[label]
        inner = method.scalars if scalar else method
        if inner is not None and name in (inner.names if scalar else inner.histories):
            held[label] = inner
    if not held:
        return None
    first, kinds = next(iter(held)), _kinds(result, name, scalar=scalar)
    agree = [label for label in held if label == first or kinds.get(label) in (AGREES, REFERENCE)]
    if len(agree) < 2 or kinds.get(first) not in (AGREES, REFERENCE):
        return held[first]
    stated = {label: _stated(result, label, held[label], name, scalar=scalar) for label in agree}
    for bound in (WELL, ROUGHLY):
        for label in agree:
            if stated[label] <= bound:
                return held[label]
    return held[first]


def _kinds(result: StudyResult, name: str, *, scalar: bool) -> dict[str, str]:
    """Return the kinds of verdicts on an output by method; empty: nothing is compared."""
    data = comparison_of(result)
    variable, dim = ("scalar_verdict_kind", "scalar") if scalar else ("verdict_kind", "output")
    if data is None or variable not in data or name not in data[dim].values:
        return {}
    kinds = data[variable].sel({dim: name}).values
    return dict(zip(map(str, data["method"].values), map(str, kinds), strict=True))


def _stated(result: StudyResult, label: str, method: Method, name: str, *, scalar: bool) -> float:
    """Return the largest stated error of an output, in standard deviations; infinite where it is not known."""
    data = comparison_of(result)
    if not scalar and data is not None and "stated_error_max" in data:
        error = float(data["stated_error_max"].sel({"method": label, "output": name}))
    else:
        own = own_error(method.node, rtol_of(method.node), dependence=False)
        times = None if scalar else method.statistics["time"].values
        error = float(own.largest(times)[0][method.names.index(name)])
    return error if math.isfinite(error) else math.inf


def answer_of(result: StudyResult, name: str) -> Answer:
    """Return what is said of a requirement: by a recommended method, else by that with the narrowest interval."""
    found, compared = answers(result.nodes)[name], comparison_of(result)
    for label in recommended(compared) if compared is not None else ():
        if label in found:
            return found[label]
    return min(found.values(), key=lambda one: one.upper - one.lower)
