"""Which methods the first screen speaks of: those that are recommended."""

from __future__ import annotations

import xarray as xr

from uqmbd.report.figures import finest, surrogate_nodes
from uqmbd.report.view import Method, StudyResult, dataset_of
from uqmbd.results import Answer, answers
from uqmbd.results.comparison import recommended

__all__ = ["answer_of", "comparison_of", "holder_of", "populations", "trusted_labels"]


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
    """Return the most trusted method that has an output; of an output without a time as a result of such."""
    for label in trusted_labels(result):
        method = result.methods[label]
        inner = method.scalars if scalar else method
        if inner is not None and name in (inner.names if scalar else inner.histories):
            return inner
    return None


def answer_of(result: StudyResult, name: str) -> Answer:
    """Return what is said of a requirement: by a recommended method, else by that with the narrowest interval."""
    found, compared = answers(result.nodes)[name], comparison_of(result)
    for label in recommended(compared) if compared is not None else ():
        if label in found:
            return found[label]
    return min(found.values(), key=lambda one: one.upper - one.lower)
