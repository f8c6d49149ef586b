"""Section on methods, their cost, and the provenance of the results."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from uqmbd.report.sections.about_methods.comparison import agreement
from uqmbd.report.sections.about_results import input_rows
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import answers
from uqmbd.results.assessment import NO_VARIATION, coupled_systems, worst_integration_share
from uqmbd.wording import format_count, format_duration, format_integer, format_number, format_part

__all__ = ["COST", "METHODS", "PROVENANCE"]


def content(result: StudyResult) -> Content:
    """Return the content of the section."""
    return {
        "agreement": agreement(result),
        "sentences": _sentences(result),
    }


METHODS = TemplateSection("Methods", "methods", content, "about_methods.html.j2")


def _sentences(result: StudyResult) -> list[str]:
    """Describe the study in a few sentences."""
    rows, methods = input_rows(result), result.methods
    count, limits = len(result.histories) + len(result.scalar_names), len(answers(result.nodes))
    limits -= limits > 1  # do not count the entry for the violation of any requirement
    where = [format_count(count, "output")] if count else []
    where += [format_count(limits, "requirement")] if limits else []
    inputs = format_count(len(rows), "input") if rows else "the inputs"
    text = [
        f"This study propagated the uncertainty of {inputs} through the mechanism {result.mechanism} "
        f"to {' and '.join(where)}, by {format_count(len(methods), 'method')}: {', '.join(methods)}."
    ]
    compared = result.several and result.comparison is not None and "verdict" in result.comparison
    if compared and not any(method.failures for method in methods.values()):
        text[0] += " All realisations succeeded."
    for label, method in methods.items():
        if method.lacking:
            text.append(
                f"With {label}, {method.lacking[0]} of {format_count(method.lacking[1], 'realisation')} lack values "
                "of some scalar outputs. The statistics of these outputs exclude them."
            )
    for method in methods.values():
        text += _outcome(method, compared)
    text += _populations(result)
    text += result.assessment.precision
    constant = [n for n in result.histories if all(one.level == 3 for one in result.assessment.of(n))]
    if constant:
        words = NO_VARIATION if len(constant) == 1 else NO_VARIATION.replace("does", "do", 1)
        text.append(f"{', '.join(constant)} {words}.")
    return text + list(map(str, result.findings))


def _populations(result: StudyResult) -> list[str]:
    """List the methods with input distributions that differ from the study."""
    found = {label: method.population for label, method in result.methods.items()}
    note = "; it is not compared with the other methods" if len(set(found.values())) > 1 else ""
    return [
        f"The distributions of the inputs of {label} differ from the study: {population}{note}."
        for label, population in found.items()
        if population
    ]


def _outcome(method: Method, compared: bool) -> list[str]:
    """State the numbers of computed and failed realisations, and the realisations that statistics or results omit."""
    label, total, failed = method.label, method.realisations, method.failures
    text = []
    outcome = "all succeeded" if not failed else f"{failed} failed and did not enter the statistics"
    if failed and method.fit:
        outcome = f"{failed} failed, and the surrogate was fitted without them: {method.fit}"
    if failed or not compared:  # otherwise the table of methods shows the number
        seconds = format_duration(method.wall_time)
        text.append(f"{label} computed {format_count(total, 'realisation')} in {seconds}; {outcome}.")
    stored, counted = total if method.samples is None else method.samples.sizes["sample"], method.counted
    if counted < total:
        text.append(
            f"The statistics of {label} use the {format_integer(counted)} realisations that were sampled from the "
            f"distributions of the inputs. The other {format_integer(total - counted)} were chosen to find violations."
        )
    elif stored < method.sample_size:
        text.append(_describe_stored(method, method.sample_size, stored))
    if method.ends_at is not None:
        text.append(
            f"Results of {label} end at t = {format_number(method.ends_at)} s, before the end of the "
            "study. Later results could not be computed, or are not reliable."
        )
    return text


def _describe_stored(method: Method, total: int, stored: int) -> str:
    """State which samples statistics and figures use, if the results contain only the first of them."""
    every, first = format_integer(total), f"the first {format_integer(stored)}, which are stored"
    if "smallest" not in method.statistics:  # results of an earlier version
        return (
            f"Means and standard deviations of {method.label} use all {every} samples. Quantiles, histograms and "
            f"densities use {first}."
        )
    text = f"Statistics of {method.label} use all {every} samples. Histograms and densities use {first}."
    if "quantile_error" in method.statistics:
        error, std = (method.statistics[name] for name in ("quantile_error", "std"))
        worst = float((error.max("probability") / std.where(std > 0)).max())
        share = format_part(worst, "the standard deviation") if math.isfinite(worst) else "rounding"
        text += f" Quantiles are computed from counts between edges; their error is at most {share}."
    return text


_COUNTERS = {
    "steps": "integration steps",
    "residuals": "residual evaluations",
    "residual_evaluations": "residual evaluations",
    "jacobians": "Jacobian evaluations",
    "jacobian_evaluations": "Jacobian evaluations",
    "factorisations": "Jacobian factorisations",
    "integrations": "integrations (implicit: batch of realisations; explicit: single realisation)",
    "accelerations": "evaluations of the compiled equations of motion (each for up to eight realisations)",
    "passages": "singular poses that were crossed",
    "repivots": "changes of the set of independent equations",
    "stiff": "realisations passed from the explicit integrator to an implicit one (stiff, or less expensive)",
    "alone": "realisations integrated separately",
    "two_motions": "realisations with contacts for which several motions are possible",
    "by_dop853": "realisations integrated by the explicit integrator (dop853)",
    "by_ida": "realisations integrated by IDA",
    "by_radau": "realisations integrated by the compiled implicit integrator (radau)",
    "seconds": "time in the integrator, summed over workers",
}


FITTING = 0.01
"""Minimum share of fitting in the wall time for which the report states the fitting time."""


def cost(result: StudyResult) -> Content:
    """Return the cost of each method."""
    return {
        "coupled": coupled_systems(result.nodes),
        "methods": [
            {
                "label": label,
                "wall_time": format_duration(method.wall_time),
                "realisations": method.total_realisations,
                "failures": method.failures,
                "budget": str(method.node.attrs.get("budget_summary", "")),
                "fitting": _fitting(method),
                "each": format_duration(method.wall_time / method.total_realisations) if method.separate else "–",
                "counters": [
                    *(_counter(name, value) for name, value in method.pairs("solver_counters") if not _nothing(value)),
                    *_integration(method),
                ],
            }
            for label, method in result.methods.items()
        ],
    }


COST = TemplateSection("Cost", "cost", cost, "about_methods.html.j2")


def _fitting(method: Method) -> str:
    """Return the time to fit a surrogate as text; empty if it is below one hundredth of the wall time."""
    seconds = float(method.node.attrs.get("wall_time_fitting", 0.0))
    return format_duration(seconds) if seconds >= FITTING * method.wall_time > 0 else ""


def _integration(method: Method) -> list[tuple[str, str]]:
    """Return a row on the largest error of the time integration and its source."""
    worst = worst_integration_share(method.node)
    if worst is None:
        return []
    several = len(method.names) + len(method.scalars.names if method.scalars else ()) > 1
    which = f", of {worst.output}" if several and math.isfinite(worst.share) else ""
    how = f" ({worst.reason})" if worst.reason else ""
    return [("integration error", f"{worst.words()}{which}{how}")]


def _nothing(value: str) -> bool:
    """Return whether a counter is zero, so that the report omits it."""
    try:
        return float(value) == 0.0
    except ValueError:
        return False


def _counter(name: str, value: str) -> tuple[str, str]:
    """Return a readable name and the value of a solver counter."""
    shown = _COUNTERS.get(name, name.replace("_", " "))
    try:
        number = float(value)
    except ValueError:
        return shown, value
    if name == "seconds":
        return shown, format_duration(number)
    return shown, format_integer(number) if number == round(number) else format_number(number)


_ATTRIBUTES = {
    "integrated_by": "integrated by",
    "not_unique": "not unique (redundant constraints)",
    "rtol": "relative tolerance of the integration",
    "max_step": "largest step, s",
    "uqmbd_version": "uqmbd version",
    "schema_version": "schema version",
    "report_times": "times of distributions, s",
    "script_sha256": "SHA-256 of the script",
    "allowed_probability": "allowed probability of violation",
}


_SHOWN = {
    "study", "mechanism", "created", "command", "parts", "model", "limits", "over", "failed", "warnings", "budget",
}  # fmt: skip
"""Attributes of a study that the report shows elsewhere."""

_KNOWN = {
    "propagator", "label", "seed", "created", "uqmbd_version", "options", "versions", "solver_counters", "wall_time",
    "realisations", "further_realisations", "failures", "warnings", "budget_summary", "refused",
}  # fmt: skip
"""Attributes of a method that the report shows under another name, or elsewhere."""


def provenance(result: StudyResult) -> Content:
    """Return the command and the script, bodies and components, and options, seed and date of each method."""
    attrs = result.tree.attrs
    about = {str(k): v for k, v in attrs.items() if k not in _SHOWN}
    first = ["script", "script_sha256"]
    order = sorted(about, key=lambda k: first.index(k) if k in first else len(first))
    return {
        "command": attrs.get("command"),
        "study_attributes": [(_ATTRIBUTES.get(k, k), str(about[k])) for k in order],
        **_mechanism(result),
        "methods": [{"label": label, "facts": _facts(method)} for label, method in result.methods.items()],
        "versions": _versions(result),
    }


PROVENANCE = TemplateSection("Provenance", "provenance", provenance, "about_methods.html.j2")


def _facts(method: Method) -> list[tuple[str, str]]:
    attrs = method.node.attrs
    found = [
        *((k, str(attrs[k])) for k in ("propagator", "seed", "created") if k in attrs),
        *((f"option {name}", value) for name, value in method.pairs("options")),
        *((_ATTRIBUTES.get(str(k), str(k)), str(v)) for k, v in attrs.items() if k not in _KNOWN),
    ]
    # options without a value have no row
    return [(name, value) for name, value in found if value not in ("null", "None", "")]


def _versions(result: StudyResult) -> list[Content]:
    """Return the versions of packages; if all methods have the same versions, return them once."""
    found = {label: method.pairs("versions") for label, method in result.methods.items()}
    found = {label: pairs for label, pairs in found.items() if pairs}
    if len({json.dumps(pairs) for pairs in found.values()}) == 1:
        return [{"of": "", "facts": next(iter(found.values()))}]
    return [{"of": label, "facts": pairs} for label, pairs in found.items()]


def _mechanism(result: StudyResult) -> Content:
    """Return rows of bodies, components and excitations; results of earlier versions contain only their names."""
    parts, model = (_object(result.tree.attrs.get(name)) for name in ("parts", "model"))
    known, joined = (_object(model.get(name)) for name in ("bodies", "components"))
    bodies = parts.get("bodies") if isinstance(parts.get("bodies"), list) else []
    components = _object(parts.get("components"))
    return {
        "bodies": [{"name": str(name), "constants": _constants(known.get(str(name)))} for name in bodies or ()],
        "components": [
            {
                "name": str(name),
                "kind": str(kind),
                "between": ", ".join(map(str, _object(joined.get(name)).get("bodies", ()))),
                "constants": _constants(_object(joined.get(name)).get("parameters")),
            }
            for name, kind in components.items()
        ],
        "excitations": [(str(name), str(text)) for name, text in _object(model.get("excitations")).items()],
    }


def _constants(values: object) -> str:
    return "; ".join(f"{name}: {value}" for name, value in _object(values).items())


def _object(value: object) -> Mapping[str, Any]:
    """Return a JSON object, or its text, as a mapping; return an empty mapping for any other value."""
    try:
        found = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return {}
    return found if isinstance(found, Mapping) else {}
