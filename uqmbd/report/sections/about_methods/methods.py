"""The report's section on methods: which one to use, and what was done, in a few sentences."""

from __future__ import annotations

import math

from uqmbd.report.sections.about_methods.agreement import agreement
from uqmbd.report.sections.about_results import input_rows
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import answers
from uqmbd.wording import format_count, format_duration, format_integer, format_number, format_percent

__all__ = ["METHODS"]


def content(result: StudyResult) -> Content:
    """Return what the section says."""
    return {
        "agreement": agreement(result),
        "sentences": _sentences(result),
    }


METHODS = TemplateSection("Methods", "methods", content)


def _sentences(result: StudyResult) -> list[str]:
    """Describe the study in a few sentences."""
    rows, methods = input_rows(result), result.methods
    count, limits = len(result.histories) + len(result.scalar_names), len(answers(result.nodes))
    limits -= limits > 1  # that any is violated is no further one
    where = [format_count(count, "output")] if count else []
    where += [format_count(limits, "requirement")] if limits else []
    what = "the uncertainty of " + format_count(len(rows), "input") if rows else "uncertain inputs"
    text = [
        f"This study carried {what} through the mechanism {result.mechanism} "
        f"to {' and '.join(where)} with {format_count(len(methods), 'method')}: {', '.join(methods)}."
    ]
    compared = result.several and result.comparison is not None and "verdict" in result.comparison
    if compared and not any(method.failures for method in methods.values()):
        text[0] += " All realisations succeeded."
    for label, method in methods.items():
        if method.lacking:
            text.append(
                f"With {label}, {method.lacking[0]} of {format_count(method.lacking[1], 'realisation')} have not all "
                "of the outputs without a time, and are left out of the statistics of these."
            )
    for method in methods.values():
        text += _outcome(method, compared)
    text += _populations(result)
    text += result.assessment.precision
    constant = [n for n in result.histories if all(one.level == 3 for one in result.assessment.of(n))]
    if constant:
        does = "does" if len(constant) == 1 else "do"
        text.append(f"{', '.join(constant)} {does} not vary beyond the integration error.")
    return text + list(map(str, result.findings))


def _populations(result: StudyResult) -> list[str]:
    """Say which methods have inputs of other distributions than the study."""
    found = {label: method.population for label, method in result.methods.items()}
    beside = ", so that it is not compared with the others" if len(set(found.values())) > 1 else ""
    return [
        f"{label} has inputs of other distributions than the study, {population}{beside}."
        for label, population in found.items()
        if population
    ]


def _outcome(method: Method, compared: bool) -> list[str]:
    """Say how many realisations succeeded, and what statistics and results leave out."""
    label, total, failed = method.label, method.realisations, method.failures
    text = []
    outcome = "all succeeded" if not failed else f"{failed} failed and did not enter the statistics"
    if failed and method.fit:
        outcome = f"{failed} failed, and the surrogate was found without them: {method.fit}"
    if failed or not compared:  # else the table of methods has it
        seconds = format_duration(method.wall_time)
        text.append(f"{label} computed {format_count(total, 'realisation')} in {seconds}; {outcome}.")
    kept, counted = total if method.samples is None else method.samples.sizes["sample"], method.counted
    if counted < total:
        text.append(
            f"Statistics of {label} are those of {format_integer(counted)} realisations that are spread like the "
            f"inputs; the other {format_integer(total - counted)} were chosen to find violations."
        )
    elif kept < total:
        text.append(_beyond_the_kept(method, total, kept))
    if method.ends_at is not None:
        text.append(
            f"Results of {label} end at t = {format_number(method.ends_at)} s, before the end of the "
            "study: beyond, they could not be computed, or not be trusted."
        )
    return text


def _beyond_the_kept(method: Method, total: int, kept: int) -> str:
    """Say of which realisations statistics and figures are, where the results do not hold all."""
    every, first = format_integer(total), f"the first {format_integer(kept)}, which the results hold"
    if "smallest" not in method.statistics:  # of an earlier version
        return (
            f"Means and standard deviations of {method.label} are those of all {every}; quantiles, histograms and "
            f"densities are those of {first}."
        )
    text = f"Statistics of {method.label} are those of all {every}; histograms and densities are those of {first}."
    if "quantile_error" in method.statistics:
        error, std = (method.statistics[name] for name in ("quantile_error", "std"))
        worst = float((error.max("probability") / std.where(std > 0)).max())
        share = f"{format_percent(worst)} of the standard deviation" if math.isfinite(worst) else "rounding"
        text += f" Quantiles were counted between edges, and are known within {share}."
    return text
