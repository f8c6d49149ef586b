"""What to do next time: which method to use, and what it costs."""

from __future__ import annotations

from uqmbd.report.overview.trusted import comparison_of, trusted_labels
from uqmbd.report.sections import Content, precision_sentences
from uqmbd.report.view import StudyResult
from uqmbd.results.comparison import recommended
from uqmbd.wording import format_count, format_duration

__all__ = ["advice"]


def advice(result: StudyResult) -> Content:
    """Return which method to use, why, and what it cost here.

    Returns
    -------
    dict
        ``methods``: name and cost of each that is recommended; ``words``: sentences.
    """
    data = comparison_of(result)
    labels = [label for label in (recommended(data) if data is not None else ()) if label in result.methods]
    lead = "" if data is None else str(data.attrs.get("recommendation", "")).split("\n")[0]
    words = [lead] if lead else precision_sentences(result)
    if not labels and len(result.methods) == 1:
        labels = trusted_labels(result)
    return {"methods": [{"label": label, "cost": _cost(result, label)} for label in labels], "words": words}


def _cost(result: StudyResult, label: str) -> str:
    method = result.methods[label]
    return f"{format_count(method.realisations, 'realisation')}, {format_duration(method.wall_time)}"
