"""What the report says first of several methods: which one to use, and whether they agree."""

from __future__ import annotations

import math

from uqmbd.report.sections.section import Content
from uqmbd.report.view import StudyResult
from uqmbd.results.assessment import AGREES, COARSE, NO_SPREAD, REFERENCE, largest_error, worst
from uqmbd.wording import format_duration, format_integer

__all__ = ["agreement"]

_SIGNS = {
    "reference": "•",
    "agrees": "✓",
    "differs": "✗",
    "under-resolved": "!",
    "too few samples": "?",
    NO_SPREAD: "–",
}
_SHORT = {"reference": "the reference", NO_SPREAD: "nothing varies"}
"""Verdicts in a word or two, where their names do not say them."""


def agreement(result: StudyResult) -> Content | None:
    """Return the recommendation and the verdict of each method and output; None for one method, or older results.

    Verdicts stand in the section that compares methods (``each``), and nowhere else; ``rows`` name them.
    """
    data, found = result.comparison, result.assessment
    compared = [one for one in found.judgements if one.kind]
    if data is None or not compared:
        return None
    rows = []
    for method in (result.methods[label] for label in dict.fromkeys(one.method for one in compared)):
        mine = [one for one in compared if one.method == method.label]
        one, which = worst(mine)
        text = _SHORT.get(one.kind, one.kind)
        if one.kind in (AGREES, REFERENCE) and (words := largest_error(mine)):
            text += f"; {words}"
        elif which:
            text += f" ({which})"
        large = one.kind == AGREES and any(COARSE < one.error < math.inf for one in mine)
        rows.append(
            {
                "method": method.label,
                "kind": one.kind,
                "text": f"{'!' if large else _SIGNS[one.kind]} {text}",
                "wall_time": format_duration(method.wall_time),
                "realisations": format_integer(method.realisations),
            }
        )
    return {
        "lead": "".join(found.recommendation[:1]),
        "others": found.reasons,
        "rows": rows,
        "each": compared,
        "reference": found.reference,
        "level": f"{100 * float(data.attrs.get('level', 0.05)):g} %",
    }
