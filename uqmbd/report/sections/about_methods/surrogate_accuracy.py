"""Section on the accuracy of surrogates: stated errors, and error against cost."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.figures import (
    chaos_nodes,
    chaos_of,
    elements_in_words,
    finest,
    has_elements,
    horizon,
    order_of,
    orders_of,
    series,
    stated_error_of,
    surrogate_nodes,
    surrogate_of,
    varies_over_time,
)
from uqmbd.report.sections.about_methods.comparison import agreement
from uqmbd.report.sections.about_results import most_uncertain
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results.assessment import Assessment
from uqmbd.results.chaos import Discontinuity
from uqmbd.wording import format_count, format_duration, format_factor, format_integer, format_percent

__all__ = ["ACCURACY", "GROWTH"]


_UNKNOWN = "unknown"
_VERIFIED = 3


def describe_reliability(result: StudyResult) -> Content | None:
    """Return the content of the section; None if no method has a surrogate."""
    nodes = result.nodes
    holders = surrogate_nodes(nodes)
    if not holders:
        return None
    groups = series(holders)
    best = {members[-1]: result.methods[members[-1]] for members in groups.values()}
    judged = result.assessment
    rows = [row for label in holders for row in _rows(result.methods[label], judged)]
    order = {name: k for k, name in enumerate(dict.fromkeys(row["output"] for row in rows))}
    rows.sort(key=lambda row: order[row["output"]])
    last = result.methods[finest(holders)]
    stating = [method for method in best.values() if stated_error_of(method.node) is not None]
    stating.sort(key=lambda method: -order_of(method.node))
    names = [name for name in last.names if last.varies(name)]
    shown = most_uncertain(result, names)
    several = max(len({order_of(nodes[m]) for m in members}) for members in groups.values()) > 2
    return {
        # whether the comparison section shows the stated errors of each method
        "compared": agreement(result) is not None,
        "methods": [_verdicts(method, judged) for method in best.values()],
        "rows": rows,
        "stated": any(stated_error_of(node) is not None for node in holders.values()),
        "left_out": any(row["left_out"] != "–" for row in rows),
        "figures": [
            *(_verification(method, judged) for method in stating[:_VERIFIED]),
            *(_elements(method) for method in best.values() if has_elements(method.node)),
        ],
        "outputs": [_of_output(nodes, name, several) for name in shown],
        "note": f"The figures show the {len(shown)} most uncertain outputs." if len(shown) < len(names) else "",
    }


ACCURACY = TemplateSection("Accuracy of the surrogates", "trust", describe_reliability, "about_methods.html.j2")


def _verdicts(method: Method, assessment: Assessment) -> Content:
    label, sizes = method.label, method.surrogate_data.sizes
    kind = f"order {order_of(method.node)}, {format_count(sizes['term'], 'term')}"
    if sizes.get("element", 1) > 1:
        kind += f" in each of {sizes['element']} elements"
    kind += f", {method.fit}" if method.fit else ""
    kind += f"; {method.clock}" if method.clock else ""
    texts = {name: assessment.judgement(label, name).text for name in method.names}
    try:
        seen: tuple[Discontinuity | None, ...] = getattr(surrogate_of(method.node), "discontinuities", tuple)()
        words = {one.output: one.words() for one in seen if one is not None and method.varies(one.output)}
        found = [". ".join(filter(None, (f"{name}: {texts[name]}", words.get(name)))) for name in method.names]
        jumps = [f"{name}: {words[name]}" for name in method.names if name in words]
        return {"label": label, "what": kind, "problem": "", "verdicts": found, "jumps": jumps}
    except Exception as error:  # noqa: BLE001 - a chaos of another package may lack anything; the rest must remain
        problem = f"The polynomial chaos of {label} cannot be read: {type(error).__name__}: {error}"
        return {"label": label, "what": kind, "problem": problem, "verdicts": (), "jumps": ()}


def _rows(method: Method, assessment: Assessment) -> list[dict[str, str]]:
    """Return the table of a method, with the order, cost and errors of each output."""
    stated = stated_error_of(method.node)
    left_out = method.statistics.get("leave_one_out")
    gains = _gains(method)
    rows = []
    for k, name in enumerate(method.names):
        row = {
            "output": name,
            "method": method.label,
            "order": str(order_of(method.node)),
            "terms": format_integer(method.surrogate_data.sizes["term"]),
            "realisations": format_integer(method.realisations),
            "error": "–",
            "horizon": "–",
            "left_out": "–",
            "gain": gains[k],
        }
        one = assessment.judgement(method.label, name)
        if not one.varies:
            row |= {"error": "no spread", "horizon": "never", "gain": "–"}
        elif stated is not None:
            error = stated.values[k]
            first = horizon(stated["time"].values, error)
            row["error"] = format_percent(one.error, _UNKNOWN)
            row["horizon"] = "never" if first is None else f"{first:.4g} s"
        if left_out is not None and one.varies:
            # exclude times of very small standard deviation, at which an error relative to it has no meaning
            spreads = varies_over_time(method.statistics["std"].values[k], method.statistics["mean"].values[k])
            square = float(np.max(left_out.values[k], where=spreads, initial=0.0))
            row["left_out"] = format_percent(math.sqrt(square), _UNKNOWN)
        rows.append(row)
    return rows


def _gains(method: Method) -> list[str]:
    """State the reduction factor of the error for each order, at the time of the largest standard deviation."""
    try:
        rate = chaos_of(method.node).decay()["rate"].values
    except Exception:  # noqa: BLE001 - reported with the verdicts
        return ["–"] * len(method.names)
    places = np.nan_to_num(method.statistics["std"].values, nan=-1.0).argmax(axis=-1)
    decades = [float(rate[k, place]) for k, place in enumerate(places)]
    return [f"÷ {format_factor(10**d)}" if math.isfinite(d) and -1 < d < 4 else "–" for d in decades]


def _verification(method: Method, assessment: Assessment) -> Content:
    label, count = method.label, method.surrogate_data.sizes.get("verification", 0)
    where = format_count(count, "realisation") if count else "realisations"
    return charted(
        lambda: figures.errors_chart(method.node),
        f"Stated error of the surrogate of {label} over time, for each output. "
        + "; ".join(_verdicts(method, assessment)["verdicts"]),
        f"Stated error of {label}, measured at {where} that were not used for the fit. The denominator is the standard "
        "deviation, taken as at least 1 % of its maximum. A dot marks the first time with an error above 1 %.",
        f"{label}-stated-error",
    )


def _elements(method: Method) -> Content:
    words = elements_in_words(method.node)
    return charted(
        lambda: figures.elements_chart(method.node),
        f"Elements in the plane of the two inputs that were split most often, or along the only split input. {words}",
        f"{words} Elements are small near a kink or a jump of the response.",
        f"{method.label}-elements",
    )


def _of_output(nodes: Mapping[str, xr.DataTree], name: str, several: bool) -> Content:
    drawn = []
    if chaos_nodes(nodes):
        drawn.append(
            charted(
                lambda: figures.decay_chart(nodes, name),
                f"Contribution of the polynomials of each order to the standard deviation of {name}.",
                "Convergence with the order: contribution of the polynomials of each total order, and of each degree "
                "in each input, to the standard deviation. If the contributions decrease, the omitted terms are "
                "smaller than the terms of the highest order.",
                f"{name}-coefficient-decay",
            )
        )
    words: list[str] = []
    if several:
        words = _convergence_words(nodes, name)
        drawn.append(
            charted(
                lambda: figures.orders_chart(nodes, name),
                f"Difference of mean and standard deviation of {name} from a reference, by order and by number "
                "of realisations. " + " ".join(words),
                "Convergence with the order and the cost: largest difference over time from the surrogate of the "
                "highest order. Exponential convergence is a straight line by order. The error does not "
                "decrease below the error of the time integration.",
                f"{name}-orders",
            )
        )
    return {"name": name, "words": words, "figures": drawn}


def _convergence_words(nodes: Mapping[str, xr.DataTree], name: str) -> list[str]:
    try:
        reference, found = orders_of(nodes, name)
    except Exception:  # noqa: BLE001 - reported in place of the figure
        return []
    words = []
    for row in found:
        if len(row.orders) < 2 or not row.std[0] > 0:
            continue
        verb = "decreases" if row.std[-1] < row.std[0] else "changes"
        first, last = (format_percent(float(row.std[k]), _UNKNOWN) for k in (0, -1))
        words.append(
            f"{row.name}, from order {row.orders[0]} ({format_count(int(row.realisations[0]), 'realisation')}) to "
            f"order {row.orders[-1]} ({row.realisations[-1]}): the difference of the standard deviation from "
            f"{reference} {verb} from {first} to {last} of the maximum."
        )
    return words


def growth(result: StudyResult) -> Content | None:
    """Return the content of the section; None if the study has no convergence levels.

    ``problem`` is the reason why other keys are missing, or empty. Other keys are ``reference``, ``outputs`` (name,
    words, figure, rows), ``problems`` of single levels, and ``note`` (omitted outputs).
    """
    data = result.convergence
    if data is None:
        return None
    if "std_error_l2" not in data:
        return {"problem": str(data.attrs.get("problem", "the results contain none"))}
    names = [str(name) for name in data["output"].values]
    shown = most_uncertain(result, [name for name in names if _computed(data, names.index(name))])
    left = len(names) - len(shown)
    return {
        "problem": "",
        "reference": str(data.attrs.get("reference", "")),
        "outputs": [_growth_of(data, names.index(name), name) for name in shown],
        "problems": [
            f"{method}, {level}: {text}"
            for method, row, levels in zip(data["method"].values, data["problem"].values, _levels(data), strict=True)
            for text, level in zip(row, levels, strict=True)
            if str(text)
        ],
        "note": f"{left} of {len(names)} outputs are not shown: they do not vary, or are the least uncertain."
        if left
        else "",
    }


def _computed(data: xr.Dataset, o: int) -> bool:
    return bool(np.nanmax(np.nan_to_num(data["std_error_l2"].values[..., o]), initial=0.0) > 0)


def _levels(data: xr.Dataset) -> list[list[str]]:
    return [[str(text) for text in row] for row in data["level_name"].values]


def _growth_of(data: xr.Dataset, o: int, name: str) -> Content:
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
        f"Error of {name} with respect to {reference}, over all times, against the cost. Solid lines: error of the "
        "mean, relative to the mean. Dashed lines: error of the standard deviation, relative to the standard "
        "deviation. The grey line is the error of the reference; smaller errors cannot be measured.",
        f"{name}-error-against-cost",
    )
    return {"name": name, "words": words, "figure": figure, "rows": rows}


def _in_words(data: xr.Dataset, m: int, o: int) -> str:
    """State the reduction of the error of the standard deviation of a method, and its rate."""
    error, runs = data["std_error_l2"].values[m, :, o], data["realisations"].values[m]
    known = np.flatnonzero(np.isfinite(error))
    method = str(data["method"].values[m])
    if len(known) < 2:
        return ""
    first, last = known[0], known[-1]
    own = float(np.nan_to_num(data["reference_std_error"].values[o]))
    verb = "decreases" if error[last] < error[first] else "changes"
    text = (
        f"{method}: the error of the standard deviation {verb} from {format_percent(error[first])} "
        f"({_whole(runs[first])} realisations) to {format_percent(error[last])} ({_whole(runs[last])})"
    )
    rate = float(data["std_rate"].values[m, o])
    if math.isfinite(rate) and rate > 0.05 and str(data["option"].values[m]) == "order":
        text += f", divided by {format_factor(10**rate)} with each order"
    if error[last] < own:
        text += "; this is below the error of the reference, so the true error may be smaller"
    return f"{text}."


def _whole(value: float) -> str:
    return format_integer(value) if math.isfinite(value) else "–"


GROWTH = TemplateSection("Error against cost", "growth", growth, "about_methods.html.j2")
