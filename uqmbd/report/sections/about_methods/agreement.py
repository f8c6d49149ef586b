"""What the report says first of several methods: which one to use, and whether they agree."""

from __future__ import annotations

import numpy as np

from uqmbd.report.sections.section import Content
from uqmbd.report.view import StudyResult
from uqmbd.results.comparison import AGREES, COARSE, NO_SPREAD, REFERENCE, overall
from uqmbd.typing import Array
from uqmbd.wording import format_duration, format_integer, format_percent

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


def _largest(stated: Array, names: list[str]) -> str:
    """Say how large the stated error of a method is at most, and of which output; nothing where it is not known."""
    known = np.where(np.isfinite(stated), stated, -np.inf)
    if not np.isfinite(known).any():
        return ""
    of = f", {names[int(known.argmax())]}" if len(names) > 1 else ""
    return f"stated error up to {format_percent(float(known.max()))} of the standard deviation{of}"


def agreement(result: StudyResult) -> Content | None:
    """Return the recommendation and the verdict of each method and output; None for one method, or older results.

    Verdicts stand in the section that compares methods (``each``), and nowhere else; ``rows`` name them.
    """
    data = result.comparison
    if data is None or not data.sizes.get("output", 0) or "verdict" not in data:
        return None
    lead, *others = str(data.attrs.get("recommendation", "")).split("\n")
    rows, each = [], []
    reference, usable = str(data.attrs["reference"]), False
    for m, method in enumerate(str(v) for v in data["method"].values):
        kind, _, which = overall(data, method)
        stated = data["stated_error_max"].values[m] if "stated_error_max" in data else np.zeros(0)
        large = bool(np.any(np.isfinite(stated) & (stated > COARSE)))
        if kind in (AGREES, REFERENCE):
            which = _largest(stated, [str(v) for v in data["output"].values])
        sign = "!" if kind == "agrees" and large else _SIGNS[kind]
        rows.append(
            {
                "method": method,
                "kind": kind,
                "text": f"{sign} {_SHORT.get(kind, kind)}" + (f" ({which})" if which else ""),
                "wall_time": format_duration(float(data["wall_time"][m])),
                "realisations": format_integer(int(data["realisations"][m])),
            }
        )
        usable |= method != reference and kind in ("agrees", NO_SPREAD)
        names = [str(v) for v in data["output"].values]
        said = [str(v) for v in data["verdict"].values[m]]
        each += [{"output": o, "method": method, "text": t} for o, t in zip(names, said, strict=True)]
    return {
        "lead": lead,
        "good": usable,
        "others": others,
        "rows": rows,
        "each": each,
        "reference": reference,
        "level": f"{100 * float(data.attrs.get('level', 0.05)):g} %",
    }
