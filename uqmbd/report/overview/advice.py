"""What to do next time: which method to use, and what it costs."""

from __future__ import annotations

from uqmbd.names import ANY
from uqmbd.report.overview.belief import RARE, belief
from uqmbd.report.overview.trusted import answer_of, comparison_of, trusted_labels
from uqmbd.report.sections import Content, precision_sentences
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import answers
from uqmbd.results.comparison import recommended
from uqmbd.wording import format_count, format_duration, format_integer

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
        words = words or _better(result, result.methods[labels[0]])
    words += _rarer(result)
    return {"methods": [{"label": label, "cost": _cost(result, label)} for label in labels], "words": words}


def _better(result: StudyResult, method: Method) -> list[str]:
    """Say what a method that is alone needs where one of its outputs is not known well; nothing where all are."""
    worst = max(
        (line for line in belief(result) if line.stated and line.level < 2), key=lambda line: line.error, default=None
    )
    if worst is None:
        return []
    inner = method.scalars or method
    needed = (
        f"{format_count(4 * method.counted, 'sample')} instead of {format_integer(method.counted)} would halve it"
        if method.samples is not None or inner.samples is not None
        else "a higher order would lower it; where it does not, samples tell why (Monte Carlo)"
    )
    return [f"With a {worst.stated}, {worst.name} is not known well: {needed}."]


def _rarer(result: StudyResult) -> list[str]:
    """Say what would bound the probability of what was never violated; nothing where it is known to be rare."""
    found = {name: answer_of(result, name) for name in answers(result.nodes) if name != ANY}
    unknown = [name for name, one in found.items() if one.probability == 0 and one.upper > RARE]
    if not unknown:
        return []
    return [
        f"{', '.join(unknown)}: ten times as many realisations without a violation would bound the probability by a "
        "tenth of what is said; the method reliability looks for violations."
    ]


def _cost(result: StudyResult, label: str) -> str:
    method = result.methods[label]
    return f"{format_count(method.realisations, 'realisation')}, {format_duration(method.wall_time)}"
