"""Report section on calibrations: measurements, posterior of the inputs, and its verification."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator
from typing import Any

import xarray as xr

from uqmbd.report import FirstScreen, charts_html, with_units
from uqmbd_calibration.reporting.charts import pair_charts, posterior_charts, record_charts, reduction_chart
from uqmbd_calibration.reporting.numbers import interval, mean_and_deviation
from uqmbd_calibration.reporting.overview import first_screen
from uqmbd_calibration.result import outliers_in_words, reduction_in_words, several_maxima

__all__ = ["CalibrationSection"]


class CalibrationSection:
    """Posterior of the inputs, from records."""

    title = "Calibration"

    def first_screen(self, tree: xr.DataTree) -> FirstScreen | None:
        """Return the inputs before and after, the fit and its reliability; None if no method has a calibration."""
        found = list(_calibrations(tree))
        return first_screen(found) if found else None

    def render(self, tree: xr.DataTree) -> str:
        """Return the section; an empty text if no method has a calibration."""
        found = list(_calibrations(tree))
        parts = []
        for labels, one in found:
            if len(found) > 1:
                parts.append(f"<h3>{_text(', '.join(labels))}</h3>")
            parts += _paragraphs(one, labels)
        return "\n".join(parts)


def _calibrations(tree: xr.DataTree) -> Iterator[tuple[list[str], xr.DataTree]]:
    """Yield each calibration once, with the labels of the methods that use it."""
    seen: list[tuple[list[str], xr.DataTree]] = []
    for label, node in tree.children.items():
        for part in node.subtree:
            if part.name != "calibration" or part.attrs.get("kind") != "calibration":
                continue
            same = next((labels for labels, other in seen if other.identical(part)), None)
            if same is None:
                seen.append(([str(label)], part))
            else:
                same.append(str(label))
    yield from seen


def _paragraphs(tree: xr.DataTree, labels: list[str]) -> list[str]:
    checks = json.loads(str(tree.attrs.get("checks", "{}")))
    sentences = [*_about(tree, labels, checks), *_contradictions(tree, checks)]
    parts = [f"<p>{_text(sentence)}</p>" for sentence in sentences]
    parts.append(_table(tree))
    names = [str(name) for name in tree["observed_data"].data_vars]
    parts += [
        charts_html(
            record_charts(tree, name),
            f"Measured values of {name}, with predictions before and after the calibration, and residuals.",
            f"{name}: measured values, with the bands in which 95 % of measurements are expected before and after the "
            "calibration. Residuals of the fit at the posterior's mean are divided by the standard deviation of the "
            "noise. If the model is correct, 95 % of them are in the band.",
            choose="Displayed quantity",
        )
        for name in names
    ]
    parts.append(
        charts_html(
            [reduction_chart(tree)],
            "Ratio of the widths of posterior and prior.",
            "Ratio of the standard deviations of each input after and before the calibration. At 100 % the "
            "calibration did not change it.",
        )
    )
    parts.append(
        charts_html(
            posterior_charts(tree),
            "The density of each input before and after the calibration.",
            "Densities of the inputs before and after the calibration, each divided by its own maximum, so that "
            "areas are not comparable.",
            choose="Input",
        )
    )
    if pairs := pair_charts(tree):
        parts.append(
            charts_html(
                pairs,
                "Draws of each pair of inputs after the calibration.",
                "Draws of pairs of inputs after the calibration. If draws lie along a line, the records determine "
                "this combination of inputs better than each input alone.",
                choose="Pair of inputs",
            )
        )
    return parts


def _about(tree: xr.DataTree, labels: list[str], checks: dict[str, Any]) -> list[str]:
    records = tree.attrs.get("records", [])
    names = [records] if isinstance(records, str) else [str(name) for name in records]
    counted = sum(int(one.size) for one in tree["observed_data"].data_vars.values())
    method = ", ".join(labels)
    text = (
        f"{method} {'takes' if len(labels) == 1 else 'take'} the inputs from "
        f"{'the record' if len(names) == 1 else 'the records'} {', '.join(names)}: {counted} values of "
        f"{', '.join(str(name) for name in tree['observed_data'].data_vars)}. The calibration used "
        f"{int(tree.attrs.get('realisations', 0))} realisations of the mechanism"
    )
    if "even" in checks:
        last = checks["surrogate"][-1] if checks.get("surrogate") else None
        seen = (
            f": realisations at {last['draws']} draws of the posterior give an effective sample size of "
            f"{100 * last['share']:.1f} %, and shift posterior means by up to {last['shift']:.2g} standard deviations"
            + (f" (standard error of each {last['chance']:.2g})" if "chance" in last else "")
            if last is not None
            else ""
        )
        text += (
            f"; they verify the surrogate that was sampled{seen}."
            if checks["even"]
            else f"; they do not verify the surrogate that was sampled{seen}. Errors of the surrogate widen the "
            "posterior."
        )
    else:
        text += "."
    sentences = [text]
    if "rhat" in checks:
        state = "converged" if checks.get("converged") else "did not converge"
        sentences.append(
            f"The chains {state}: R-hat is at most {checks['rhat']:.3f}, and the effective number of draws is at "
            f"least {checks['ess']:.0f}."
        )
    if text := several_maxima(checks):
        sentences.append(
            f"{text[0].upper()}{text[1:]}. Its mean and standard deviation do not describe the separate maxima."
        )
    if others := checks.get("unsampled", []):
        sentences.append(
            f"The posterior has {len(others)} more maxima, with about {100 * sum(others):.0f} % of the probability. "
            "The sampled draws contain less than a fifth of the number expected near these maxima."
        )
    sentences += [
        f"The posterior mean of {one['input']} is {abs(one['deviations']):.1f} prior standard deviations from the "
        "prior median."
        for one in checks.get("far", [])
    ]
    return sentences


def _contradictions(tree: xr.DataTree, checks: dict[str, Any]) -> list[str]:
    """Return sentences on unidentified inputs, and on records that contradict the model."""
    statements = []
    left = [one["name"] for one in json.loads(str(tree.attrs.get("unidentified", "[]")))]
    if left:
        statements.append(
            f"Not identified, as predicted before sampling: {'; '.join(left)}. The records contain less information "
            "about these quantities than the prior."
        )
    for one in checks.get("model", []):
        where = ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in one.get("where", []))
        if one.get("rejected"):
            statements.append(
                f"The model does not explain the values of {one['output']} in record {one['record']} (p = "
                f"{one['p']:.1g})" + (f", above all at {where}." if where else ".")
            )
        else:
            statements.append(
                f"The residuals of {one['output']} in record {one['record']} are consistent with the noise (p = "
                f"{one['p']:.2g})."
            )
        if one.get("outlier_values"):
            statements.append(
                f"Some values of {one['output']} in record {one['record']} are far from the model: "
                f"{outliers_in_words(one)}."
            )
        elif one.get("outliers"):
            statements.append(
                f"{one['outliers']} of {one['values']} values of {one['output']} in record {one['record']} are more "
                "than 4 standard deviations of the noise away from the model."
            )
    return statements


def _table(tree: xr.DataTree) -> str:
    data = tree["summary"].to_dataset()
    heads = ("Input", "Before", "After", "95 % interval", "Reduction of std", "R-hat", "Draws")
    rows = []
    for k, name in enumerate(data["input"].values.tolist()):
        one = data.isel(input=k)
        cells = (
            mean_and_deviation(one["prior_mean"], one["prior_sd"]),
            mean_and_deviation(one["mean"], one["sd"]),
            interval(one),
            reduction_in_words(one),
            f"{float(one['rhat']):.3f}",
            f"{float(one['ess']):.0f}",
        )
        shown = "".join(f'<td class="number">{_text(cell)}</td>' for cell in cells)
        rows.append(f'<tr><th scope="row">{_text(with_units(str(name), str(one["units"].item())))}</th>{shown}</tr>')
    head = "".join(f'<th scope="col">{head}</th>' for head in heads)
    return (
        '<div class="wide" tabindex="0" role="region" aria-label="Inputs before and after the calibration"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _text(text: str) -> str:
    return html.escape(text)
