"""Requirements on the first screen: yield, margins, closest approach and effect of tighter tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uqmbd.names import ANY
from uqmbd.report.charts import Chart, Views, several
from uqmbd.report.figures import Approach, OutputLimit, bands_chart, closest_approach, deviation_chart
from uqmbd.report.sections import Content
from uqmbd.report.view import StudyResult
from uqmbd.results import Answer, answers
from uqmbd.results.requirements import tightened_probabilities
from uqmbd.results.schema import comparable
from uqmbd.wording import (
    format_cells,
    format_interval_ends,
    format_number,
    format_probability,
    format_quantity,
    resolved_width,
)

__all__ = ["chart_in_view", "margin_words", "tightening", "yield_words"]

HALF = 0.5
"""Factor by which the standard deviation of an input is reduced in the statement on tighter tolerances."""


def yield_words(one: Answer, several_requirements: bool) -> str:
    """State the share of realisations that meet the requirements, with its 95 % interval.

    The text is empty if the share is unknown, or if all or no realisations violate a requirement.
    """
    if not np.isfinite(one.probability) or one.probability in (0.0, 1.0):
        return ""
    width = resolved_width(one.lower, one.upper)
    condition = "all requirements met" if several_requirements else "requirement met"
    share, interval = (
        format_probability(1 - one.probability, width, 1 - one.lower),
        format_interval_ends(1 - one.upper, 1 - one.lower),
    )
    return f"Yield ({condition}): {share}, 95 % interval {interval}."


def margin_words(result: StudyResult, name: str, label: str) -> tuple[str, str, str]:
    """Return mean, standard deviation and units of the smallest margin over the motion as texts; empty if unknown."""
    part = result.methods[label].node.children.get("requirements")
    if name == ANY or part is None or "statistics" not in part.children:
        return "", "", ""
    data = part.children["statistics"].to_dataset()
    if name not in data["output"].values:
        return "", "", ""
    data = data.sel(output=name)
    data = data.isel(time=-1) if "time" in data.dims else data
    mean, std = float(data["mean"]), float(data["std"])
    if not np.isfinite([mean, std]).all():
        return "", "", ""
    units = str(data["output_units"].item()) if "output_units" in data.coords else ""
    units = units or _units_of_limit(result, name)
    (middle,), (spread,) = format_cells([mean], units, scale=std), format_cells([std], units)
    return str(middle), f"standard deviation {spread}", units


def _units_of_limit(result: StudyResult, requirement: str) -> str:
    """Return the units of the output that a requirement limits; empty if the results do not state the output."""
    for one in result.limits:
        output = str(one["output"])
        if one["requirement"] == requirement and (methods := result.holders(output)):
            return next(iter(methods.values())).units(output)
    return ""


def tightening(result: StudyResult, requirement: str, inputs: Sequence[str]) -> Content | None:
    """Return the probability of violation for half the standard deviation of each input; None if none is known.

    The keys are ``text``, by input, and ``words``, which state the method and the largest half-width of the intervals.
    """
    alike = comparable(result.nodes)
    for label in (one for one in result.assessment.order if one in alike):
        part = result.methods[label].node.children.get("requirements")
        if part is None:
            continue
        found = tightened_probabilities(part, requirement, inputs, HALF)
        if not found:
            continue
        now = answers(result.nodes)[requirement][label]
        widths = [(one.upper - one.lower) / 2 for one in found.values()]
        width = 2 * max(widths)
        words = (
            "Halved: probability of violation if the standard deviation of this input alone is halved; the present "
            f"probability is {format_probability(now.probability, resolved_width(now.lower, now.upper))}. Computed "
            f"from samples of the surrogate of {label}; the half-width of the 95 % intervals is at most "
            f"{format_probability(max(widths))}."
        )
        # if no sample violates the requirement, the probability may still be positive: state the interval
        text = {
            k: format_probability(x.probability, width) if x.probability > 0 else format_interval_ends(0.0, x.upper)
            for k, x in found.items()
        }
        return {"text": text, "words": words}
    return None


def chart_in_view(result: StudyResult, name: str) -> tuple[Chart | Views, str] | None:
    """Return the chart of an output over time and its caption, with deviations if the band is too narrow.

    The cursor begins at the closest approach to a limit. If methods have different input distributions, such as before
    and after a calibration, the last one is first. Return None if the output has no chart over time.
    """
    found = result.assessment.of(name)
    order = found[::-1] if any(one.population for one in found) else found
    holders = {one.method: result.methods[one.method] for one in order}
    limits = result.limits_of(name)
    chart = bands_chart({label: method.node for label, method in holders.items()}, name, limits=limits)
    if not several(chart):
        return None
    text = "; dotted lines: limits" if limits else ""
    words = f"{name} by {', '.join(holders)}: mean, and bands that contain 50 % and 95 % of the realisations{text}."
    first = next(iter(holders.values()))
    data, units = first.of(name), first.units(name)
    stated = [
        OutputLimit(str(one["requirement"]), float(str(one["limit"])), str(one["end"]))
        for one in result.limits
        if one["output"] == name
    ]
    nearest = closest_approach(np.asarray(data["mean"].values), np.asarray(data["std"].values), stated)
    if nearest is not None:
        time = float(data["time"][nearest.place])
        chart = replace(chart, start=int(np.abs(np.asarray(chart.places, dtype=float) - time).argmin()))
        words += f" {_approach_words(nearest, time, units, first.label)}"
    if (deviations := deviation_chart(chart, limits)) is None:
        return chart, words
    return Views([deviations, replace(chart, title="over time")], "Quantity"), words


def _approach_words(nearest: Approach, time: float, units: str, label: str) -> str:
    """State the time at which the mean is closest to a limit in standard deviations, and its distance."""
    margin, deviations = (
        format_quantity(abs(nearest.margin), units),
        format_number(float(f"{abs(nearest.deviations):.3g}")),
    )
    side = "within" if nearest.margin >= 0 else "beyond"
    return (
        f"Closest approach to {nearest.limit.requirement} at {time:.4g} s: the mean is {margin} {side} the limit, "
        f"{deviations} standard deviations ({label})."
    )
