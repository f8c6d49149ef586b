"""Which methods the first screen speaks of: those that are recommended."""

from __future__ import annotations

import xarray as xr

from uqmbd.report.view import Method, StudyResult, dataset_of
from uqmbd.results import Answer, answers
from uqmbd.results.comparison import recommended

__all__ = ["answer_of", "comparison_of", "holder_of", "trusted_labels"]


def comparison_of(result: StudyResult) -> xr.Dataset | None:
    """Return the comparison of methods, also of those that have outputs without a time only; None without verdicts."""
    found = dataset_of(result.tree, "comparison")
    return found if found is not None and "verdict_kind" in found and "method" in found.coords else None


def trusted_labels(result: StudyResult) -> list[str]:
    """Return all methods, those that are recommended first, then the reference."""
    compared = comparison_of(result)
    first: list[str] = []
    if compared is not None:
        first = [*recommended(compared), str(compared.attrs.get("reference", ""))]
    return [label for label in dict.fromkeys([*first, *result.methods]) if label in result.methods]


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
