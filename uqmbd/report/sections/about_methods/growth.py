"""The report's section on error against cost: what a study's ``convergence`` found."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.sections.about_results import most_uncertain
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult
from uqmbd.wording import format_duration, format_factor, format_integer, format_percent

__all__ = ["GROWTH"]


def growth(result: StudyResult) -> Content | None:
    """Return what the section says and shows; None if the study did not ask for it.

    Returns
    -------
    dict or None
        ``problem`` (empty, or why there is nothing else), ``reference``, ``outputs`` (name, words, figure, rows),
        ``problems`` of single levels and ``note``: which outputs are left out.
    """
    data = result.convergence
    if data is None:
        return None
    if "std_error_l2" not in data:
        return {"problem": str(data.attrs.get("problem", "the results hold none"))}
    names = [str(name) for name in data["output"].values]
    shown = most_uncertain(result, [name for name in names if _computed(data, names.index(name))])
    left = len(names) - len(shown)
    return {
        "problem": "",
        "reference": str(data.attrs.get("reference", "")),
        "outputs": [_of_output(data, names.index(name), name) for name in shown],
        "problems": [
            f"{method}, {level}: {text}"
            for method, row, levels in zip(data["method"].values, data["problem"].values, _levels(data), strict=True)
            for text, level in zip(row, levels, strict=True)
            if str(text)
        ],
        "note": f"{left} of {len(names)} outputs are not shown: they do not vary, or are among the least uncertain."
        if left
        else "",
    }


def _computed(data: xr.Dataset, o: int) -> bool:
    return bool(np.nanmax(np.nan_to_num(data["std_error_l2"].values[..., o]), initial=0.0) > 0)


def _levels(data: xr.Dataset) -> list[list[str]]:
    return [[str(text) for text in row] for row in data["level_name"].values]


def _of_output(data: xr.Dataset, o: int, name: str) -> Content:
    words = [w for m in range(data.sizes["method"]) if (w := _in_words(data, m, o))]
    rows = [
        {
            "method": str(data["method"].values[m]),
            "level": level,
            "realisations": _whole(float(data["realisations"].values[m, k])),
            "wall_time": format_duration(float(data["wall_time"].values[m, k])),
            "mean": format_percent(float(data["mean_error_l2"].values[m, k, o])),
            "std": format_percent(float(data["std_error_l2"].values[m, k, o])),
        }
        for m, levels in enumerate(_levels(data))
        for k, level in enumerate(levels)
        if level
    ]
    reference = str(data.attrs.get("reference", ""))
    figure = charted(
        lambda: figures.cost_chart(data, name),
        f"Errors of mean and standard deviation of {name} against realisations and wall time. {' '.join(words)}",
        f"Error of {name} against {reference}, over all times, for what it costs: the mean (full lines, filled points) "
        "relative to the mean, the standard deviation (dashed, hollow points) relative to the standard deviation. A "
        "grey line is the error of the reference itself: beneath it nothing can be told.",
        f"{name}-error-against-cost",
    )
    return {"name": name, "words": words, "figure": figure, "rows": rows}


def _in_words(data: xr.Dataset, m: int, o: int) -> str:
    """Say how far the error of the standard deviation of a method falls, and how fast."""
    error, runs = data["std_error_l2"].values[m, :, o], data["realisations"].values[m]
    known = np.flatnonzero(np.isfinite(error))
    method = str(data["method"].values[m])
    if len(known) < 2:
        return ""
    first, last = known[0], known[-1]
    own = float(np.nan_to_num(data["reference_std_error"].values[o]))
    goes = "falls" if error[last] < error[first] else "goes"
    text = (
        f"{method}: the error of the standard deviation {goes} from {format_percent(error[first])} "
        f"({_whole(runs[first])} realisations) to {format_percent(error[last])} ({_whole(runs[last])})"
    )
    rate = float(data["std_rate"].values[m, o])
    if math.isfinite(rate) and rate > 0.05 and str(data["option"].values[m]) == "order":
        text += f", divided by {format_factor(10**rate)} with each order"
    if error[last] < own:
        text += "; that is less than the error of the reference itself, so it may be smaller still"
    return f"{text}."


def _whole(value: float) -> str:
    return format_integer(value) if math.isfinite(value) else "–"


GROWTH = TemplateSection("Error against cost", "growth", growth)
