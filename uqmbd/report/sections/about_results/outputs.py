"""Section on outputs over time: figures, texts and numbers, complete for the most uncertain outputs."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report import figures
from uqmbd.report.charts import Chart, Views, charted
from uqmbd.report.figures import design_of, drawable_nodes, shown_methods, surrogate_nodes
from uqmbd.report.sections.about_results.output_words import in_words, integration, numbers, output_rows, precision
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import choose_reference
from uqmbd.results.assessment import NO_VARIATION
from uqmbd.wording import format_count, typeset_units

__all__ = ["FULL", "OUTPUTS", "bands_chart", "bands_of", "most_uncertain", "only_density", "over_chart", "ranked"]

DENSITIES = 6
"""Maximum number of methods in a figure of densities."""

FEW_ROWS = 6
"""Maximum number of rows of a complete table; otherwise, the table of one method is shown, and all rows are folded."""

FEW_OUTPUTS = 12
"""Number of outputs above which folded outputs are grouped; `search.js` searches outputs in such lists."""

FULL = 6
"""Maximum number of outputs with all figures; other outputs have only folded bands.

A browser takes about 15 ms per image.
"""


def describe_outputs(result: StudyResult) -> Content | None:
    """Return the content of the section; None if no output is a function of time.

    The keys are ``outputs``, ``note`` (omitted figures, or empty) and ``statistics`` (a table of all outputs).
    ``outputs`` are in the order of the study; if there are more than :data:`FULL`, the most uncertain output is first.
    """
    names = result.histories
    if not names:
        return None
    full = most_uncertain(result)
    found = [_output(result, name, name in full) for name in sorted(names, key=lambda n: n not in full)]
    if len(full) == len(names):
        _group(result, found, ())
        return {"outputs": found, "note": "", "statistics": statistics(result)}
    found.sort(key=lambda one: full.index(one["name"]) if one["name"] in full else len(full))
    _group(result, found, full)
    return {
        "outputs": found,
        "statistics": statistics(result),
        "note": f"The {len(full)} most uncertain of {format_count(len(names), 'output')} (by the largest standard "
        f"deviation over the largest mean) are listed first and have all figures. The other {len(names) - len(full)} "
        "are collapsed and have bands and numbers only. The functions of uqmbd.report draw all figures of any output.",
    }


def _group(result: StudyResult, found: list[Content], full: Sequence[str]) -> None:
    """Assign folded outputs with the same units to a named group if there are more than `FEW_OUTPUTS` outputs."""
    known = {one["name"]: next(iter(result.holders(one["name"]).values())).units(one["name"]) for one in found}
    folded = [units for name, units in known.items() if name not in full] if len(found) > FEW_OUTPUTS else []
    counts = Counter(folded)
    for one in found:
        units = known[one["name"]]
        named = f"in {typeset_units(units)}" if typeset_units(units) else "without units"
        count = format_count(counts[units], "further output")
        one["group"] = "" if one["name"] in full or not counts else f"{count} {named}"
    found.sort(key=lambda one: list(counts).index(known[one["name"]]) if one["group"] else -1)


def most_uncertain(result: StudyResult, names: Sequence[str] | None = None, most: int = FULL) -> list[str]:
    """Return the names of the outputs with all figures: at most `most` of the candidates `names`.

    Default candidates are all outputs over time. If there are more than `most` candidates, the most uncertain outputs
    are returned. They are sorted by the ratio of the largest standard deviation over time to the largest mean.
    """
    known = list(result.histories if names is None else names)
    return known if len(known) <= most else ranked(result, known)[:most]


def ranked(result: StudyResult, names: Sequence[str]) -> list[str]:
    """Sort the names of outputs over time, the most uncertain first."""
    return sorted(names, key=lambda name: -_uncertainty(result, name))


def _uncertainty(result: StudyResult, name: str) -> float:
    method = next(iter(result.holders(name).values()))
    data = method.of(name)
    std, mean = (float(np.nan_to_num(np.abs(data[key].values)).max(initial=0.0)) for key in ("std", "mean"))
    if not method.varies(name):
        return 0.0
    return std / mean if mean > 0 else (np.inf if std > 0 else 0.0)


def _output(result: StudyResult, name: str, whole: bool) -> Content:
    """Return the figures, texts and numbers of an output; unless `whole`, only the most important figures."""
    every = {label: method.node for label, method in result.holders(name).items()}
    holders = shown_methods(every)
    shown = [result.methods[label] for label in holders]
    first = shown[0]
    drawn: list[Content] = [bands_chart(result, name)]
    if along := over_chart(result, name):
        drawn.append(along)
    unfolded = len(drawn)
    if not any(method.varies(name) for method in shown):
        return {
            "name": name,
            "figures": drawn,
            "shown": unfolded,
            "folded": not whole,
            "note": " ".join(filter(None, (f"This output {NO_VARIATION}.", integration(first, name)))),
            "words": "",
            "numbers": [],
            "numbers_of": "",
        }
    sampled = {method.label: method for method in shown if method.sampled}
    files: list[Content] = []
    deviation: list[Content] = []
    if whole and over_time(result, name):
        deviation.append(
            charted(
                lambda: figures.std_chart(holders, name),
                f"Standard deviation of {name} over time. " + in_words(first, name),
                "Standard deviation over time. The shaded band is ± two standard errors, where these are known.",
                f"{name}-standard-deviation",
            )
        )
    if sampled and whole:
        method = next(iter(sampled.values()))
        from_label = f" (samples of {method.label})" if result.several else ""
        # the page shows the same data as bands over time, and as densities at chosen times
        histogram = functools.partial(figures.time_history_histogram, method.node, name)
        files.append({"name": f"{name}-time-history-histogram", "draw": histogram})
        drawn += [
            _densities(result, [*sampled, *drawable_nodes(every)], name),
            charted(
                lambda: figures.settling_chart(method.node, name),
                f"Mean and standard deviation of {name} as samples are added. " + precision(result, method, name),
                _convergence_caption(method) + from_label + ".",
                f"{name}-samples",
            ),
        ]
    elif drawable_nodes(every) and whole:
        drawn.append(_densities(result, list(drawable_nodes(every)), name))
    compared: list[Content] = []
    if whole and len(holders) > 1 and surrogate_nodes(holders) and over_time(result, name):
        compared += _differences(result, holders, name)
    described = in_words(first, name)
    words = [
        f"By {first.label}, {described[0].lower()}{described[1:]}" if result.several else described,
        *(precision(result, method, name) for method in list(sampled.values())[:1]),
        integration(first, name),
    ]
    return {
        "name": name,
        "folded": not whole,
        "figures": [*drawn, *deviation, *compared],
        "shown": unfolded,
        "files": files,
        "note": "",
        "words": " ".join(filter(None, words)),
        "numbers": numbers(first, name),
        "numbers_of": first.label if result.several else "",
    }


def over_time(result: StudyResult, name: str) -> bool:
    """Return whether an output has at least two times, as required for a line."""
    return max(method.of(name).sizes["time"] for method in result.holders(name).values()) > 1


def bands_of(result: StudyResult, name: str) -> Chart:
    """Return the chart of an output over time; surrogates of several orders are represented by the highest order."""
    holders = shown_methods({label: method.node for label, method in result.holders(name).items()})
    return figures.bands_chart(holders, name, limits=result.limits_of(name))


def bands_chart(result: StudyResult, name: str) -> Content:
    """Return the chart of an output over time, with its text."""
    every = {label: method.node for label, method in result.holders(name).items()}
    holders = shown_methods(every)
    lower = " Only the highest order of a surrogate is shown." if len(holders) < len(every) else ""
    return charted(
        lambda: bands_of(result, name),
        f"Mean of {name} over time, with the bands that contain 50 % and 95 % of the realisations. "
        + in_words(result.methods[next(iter(holders))], name),
        "Mean, and the bands that contain 50 % and 95 % of the realisations." + lower,
        f"{name}-bands",
    )


def _differences(result: StudyResult, holders: Mapping[str, xr.DataTree], name: str) -> list[Content]:
    """Return charts of differences between methods in mean and standard deviation, if the output has times."""
    reference = result.assessment.reference
    reference = reference if reference in holders else choose_reference(holders)
    charts = [figures.difference_chart(holders, name, reference, statistic) for statistic in ("mean", "std")]
    return [
        charted(
            chart,
            f"Difference of the {words} of {name} between methods, over time.",
            f"Difference of the {words} between each method and {reference}. A shaded band is ± two standard "
            "errors of this difference, where they are known.",
            f"{name}-differences" if words == "mean" else "",
            on_paper=lambda: Views(charts, columns=1, shared=True, heights=(1.15, 1.15)),
        )
        for chart, words in zip(charts, ("mean", "standard deviation"), strict=True)
    ]


def over_chart(result: StudyResult, name: str) -> Content | None:
    """Return the chart of an output over another output that the study names; None without such an output."""
    holders = shown_methods({label: method.node for label, method in result.holders(name).items()})
    over = result.over.get(name, "")
    if not over or not all(over in result.methods[label].histories for label in holders):
        return None
    if not over_time(result, name):
        return None
    functions = all(figures.is_function(node, name, over) for node in holders.values())
    caption = (
        f"Curve over {over}: the mean, and the bands that contain 50 % and 95 % of the realisations, at each value "
        f"of {over}."
        if functions
        else f"Curve over {over}: the means of both outputs at each time, and single realisations."
    )
    described = f"{name} over {over}."
    return charted(
        lambda: figures.over_chart(holders, name, over),
        described,
        caption,
        f"{name}-over-{over}",
    )


def only_density(holders: Mapping[str, xr.DataTree], name: str) -> tuple[Chart, str] | None:
    """Return chart and text of the density of an output at a single time; None without a density."""
    try:
        chart = figures.densities_chart(holders, name).charts[0]
    except StudyError:
        return None
    return (
        chart,
        f"Probability density of {name} at the only time, by {', '.join(holders)}.",
    )


def _densities(result: StudyResult, labels: Sequence[str], name: str) -> Content:
    dense = {label: result.methods[label].node for label in list(dict.fromkeys(labels))[:DENSITIES]}
    sampled = any(result.methods[label].sampled for label in dense)
    surrogates = bool(surrogate_nodes(dense))
    bars = "bars are the histogram, curves a kernel density estimate" if sampled else "kernel density estimates"
    of_surrogates = " (for a surrogate, of its samples)" if surrogates else ""
    return charted(
        lambda: figures.densities_chart(dense, name, result.report_times),
        f"Probability densities of {name} at chosen times.",
        f"Probability density at chosen times: {bars}{of_surrogates}.",
        f"{name}-densities",
    )


def _convergence_caption(method: Method) -> str:
    design = design_of(method.node.attrs)
    if design.independent:
        return (
            "Convergence with the number of samples, at the time of the largest standard deviation: estimates from "
            "the first samples, and their 95 % confidence band"
        )
    return (
        f"Convergence with the number of independent replicates of the {design.name} design: estimates and their 95 % "
        "confidence band, at the time of the largest standard deviation"
    )


def statistics(result: StudyResult) -> Content:
    """Return the table of outputs: all rows if few, otherwise the rows of one method, and all rows separately.

    The keys are ``rows``, ``of`` (the method of the rows, or empty), and ``all`` (all rows, if ``rows`` is incomplete).
    """
    rows = [row for name in result.histories for row in output_rows(result.holders(name).values(), name)]
    if not result.several or len(rows) <= FEW_ROWS:
        return {"rows": rows, "of": "", "all": []}
    data = result.comparison
    label = str(next(iter(result.methods)) if data is None else data.attrs.get("reference", ""))
    chosen = [row for row in rows if row["method"] == label]
    return {"rows": chosen, "of": label, "all": rows} if chosen else {"rows": rows, "of": "", "all": []}


OUTPUTS = TemplateSection("Outputs", "outputs", describe_outputs)
