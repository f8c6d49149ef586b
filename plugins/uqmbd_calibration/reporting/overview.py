"""First screen of a calibration: inputs before and after, fit, identifiability, and reliability."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report import Chart, ChartGroup, FirstScreen, ReliabilityStatement, with_units
from uqmbd_calibration.reporting.charts import inputs_of, posterior_charts, record_charts
from uqmbd_calibration.reporting.numbers import interval, mean_and_deviation
from uqmbd_calibration.result import outliers_in_words, reduction_in_words, several_maxima

__all__ = ["first_screen"]

MOST_OUTPUTS = 3
"""Largest number of measured outputs in the figure of the fit, with the worst fit first."""

TOGETHER, WIDE = 0.9, 0.3
"""Limits above which two inputs cannot be distinguished: their correlation, and the ratio of posterior to prior width
of both."""


def first_screen(found: list[tuple[list[str], xr.DataTree]]) -> FirstScreen:
    """Return the first screen of calibrations, each with the labels of the methods that use it."""
    rows, sentences = [], []
    for labels, tree in found:
        of = f" ({', '.join(labels)})" if len(found) > 1 else ""
        rows += list(_rows(tree, of))
        sentences += [replace(one, name=f"{one.name}{of}") for one in _statements(tree)]
    labels, first = found[0]
    which = f" Calibration of {', '.join(labels)}." if len(found) > 1 else ""
    charts = [
        ChartGroup(
            posterior_charts(first),
            "The density of each input before and after the calibration.",
            f"Densities of the inputs before and after the calibration, each divided by its own maximum.{which}",
            "Input",
        ),
        ChartGroup(
            list(_fits(first)),
            "Measured values with predictions before and after the calibration, and residuals.",
            (
                "Record and fit, with bands for 95 % of measurements; residuals divided by the standard "
                "deviation of the noise."
            )
            + which,
            "Output",
        ),
    ]
    heads = ("Before", "After", "95 % interval", "Reduction of std")
    return FirstScreen("Calibrated input", heads, rows, charts, sentences)


def _rows(tree: xr.DataTree, of: str) -> Iterator[tuple[str, ...]]:
    data = tree["summary"].to_dataset()
    for name in inputs_of(tree):
        one = data.sel(input=name)
        yield (
            with_units(name, str(one["units"].item())) + of,
            _with_no_break_spaces(mean_and_deviation(one["prior_mean"], one["prior_sd"])),
            _with_no_break_spaces(mean_and_deviation(one["mean"], one["sd"])),
            _with_no_break_spaces(interval(one)),
            reduction_in_words(one),
        )


def _with_no_break_spaces(numbers: str) -> str:
    """Replace the spaces in a text of numbers by no-break spaces, so that a narrow column does not break the line."""
    return numbers.replace(" ", "\N{NO-BREAK SPACE}")


def _fits(tree: xr.DataTree) -> Iterator[Chart]:
    """Yield the charts of measured outputs, smallest probability of the residuals first."""
    p = {(one["record"], one["output"]): float(one["p"]) for one in _checks(tree).get("model", [])}
    names = [str(name) for name in tree["observed_data"].data_vars]
    worst = {
        name: min((x for (record, output), x in p.items() if name in (output, f"{output}[{record}]")), default=1.0)
        for name in names
    }
    for name in sorted(names, key=lambda one: worst[one])[:MOST_OUTPUTS]:
        for chart, what in zip(record_charts(tree, name), ("fit", "residuals"), strict=True):
            # the page links all charts over the study's time, so the time of a record needs another name
            across, units = (chart.across, chart.across_units) if chart.across else ("time in the record", "s")
            yield replace(chart, title=f"{name}: {what}", across=across, across_units=units)


def _checks(tree: xr.DataTree) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(str(tree.attrs.get("checks", "{}")))
    return found


def _statements(tree: xr.DataTree) -> list[ReliabilityStatement]:
    checks = _checks(tree)
    return [*_of_fit(checks), *_of_identifiability(tree), *_of_posterior(tree, checks)]


def _of_fit(checks: dict[str, Any]) -> Iterator[ReliabilityStatement]:
    """Yield statements on outputs that the model cannot explain, and on the smallest probability of the others."""
    of = checks.get("model", [])
    for one in of:
        where = f"{one['output']} in record {one['record']}"
        if one.get("rejected"):
            when = ", ".join(f"{begin:.4g} to {end:.4g} s" for begin, end in one.get("where", []))
            text = f"the model cannot explain {where} (p = {one['p']:.1g})" + (
                f", above all at {when}." if when else "."
            )
            yield ReliabilityStatement(0, "Fit", text)
        if one.get("outlier_values"):
            yield ReliabilityStatement(1, "Outliers", f"{where}: {outliers_in_words(one)}.")
    fine = [one for one in of if not one.get("rejected")]
    if fine:
        least = min(fine, key=lambda one: float(one["p"]))
        what = "the measured output" if len(fine) == 1 else f"{len(fine)} measured outputs"
        text = f"the residuals of {what} are consistent with the noise (p = {least['p']:.2g}" + (
            ")." if len(fine) == 1 else f" or more; smallest for {least['output']})."
        )
        yield ReliabilityStatement(2, "Fit", text)


def _of_identifiability(tree: xr.DataTree) -> Iterator[ReliabilityStatement]:
    """Yield statements on combinations and pairs of inputs that the record does not determine."""
    left = [one["name"] for one in json.loads(str(tree.attrs.get("unidentified", "[]")))]
    if left:
        text = f"the record contains less information than the prior about {'; '.join(left)}."
        yield ReliabilityStatement(1, "Identifiability", text)
    data, draws = tree["summary"].to_dataset(), tree["posterior"].to_dataset()
    pairs = []
    for one, other in combinations(inputs_of(tree), 2):
        values = [np.ravel(draws[name].values) for name in (one, other)]
        if all(np.ptp(x) > 0 for x in values):
            pairs.append((float(np.corrcoef(np.stack(values))[0, 1]), one, other))
    kept = 1 - data["reduction"]
    close = [
        (r, one, other)
        for r, one, other in pairs
        if abs(r) > TOGETHER and min(float(kept.sel(input=name)) for name in (one, other)) > WIDE
    ]
    for r, one, other in sorted(close, key=lambda pair: -abs(pair[0])):
        text = f"{one} and {other} cannot be distinguished: their correlation is {_signed(r)} after the calibration."
        yield ReliabilityStatement(1, "Identifiability", text)
    if not left and not close:
        text = "the record determines each input"
        if pairs:
            r, one, other = max(pairs, key=lambda pair: abs(pair[0]))
            text += f"; the largest correlation is {_signed(r)} ({one}, {other})"
        yield ReliabilityStatement(2, "Identifiability", f"{text}.")


def _signed(number: float) -> str:
    return f"{number:.2f}".replace("-", "\N{MINUS SIGN}")


def _of_posterior(tree: xr.DataTree, checks: dict[str, Any]) -> Iterator[ReliabilityStatement]:
    """Yield statements on whether realisations and chains verify the posterior, and on contrary evidence."""
    cost = f"{int(tree.attrs.get('realisations', 0))} realisations"
    last = checks["surrogate"][-1] if checks.get("surrogate") else None
    if "even" in checks and last is not None:
        shift = f"they shift posterior means by up to {last['shift']:.2g} standard deviations"
        if checks["even"]:
            text = f"realisations at {last['draws']} draws verify the posterior: {shift} ({cost} in total)."
            yield ReliabilityStatement(2, "Posterior", text)
        else:
            text = f"realisations at {last['draws']} draws contradict the posterior: {shift} ({cost} in total)."
            yield ReliabilityStatement(0, "Posterior", text)
    elif checks.get("widened"):
        yield ReliabilityStatement(
            0, "Posterior", f"no realisations verify the posterior, and errors of the surrogate widen it ({cost})."
        )
    else:
        yield ReliabilityStatement(3, "Posterior", f"the posterior is based on {cost} of the mechanism.")
    if "rhat" in checks:
        numbers = f"R-hat is at most {checks['rhat']:.3f}, with at least {checks['ess']:.0f} effective draws."
        fine = bool(checks.get("converged"))
        yield ReliabilityStatement(
            2 if fine else 0, "Chains", f"the chains {'converged' if fine else 'did not converge'}: {numbers}"
        )
    if shares := several_maxima(checks).removeprefix("the posterior has "):
        text = f"the posterior has {shares}; its mean and standard deviation do not describe the separate maxima."
        yield ReliabilityStatement(1, "Posterior", text)
    if others := checks.get("unsampled", []):
        text = (
            f"{len(others)} further maxima contain about {100 * sum(others):.0f} % of the probability, but the sampled "
            "draws contain less than a fifth of the number expected there."
        )
        yield ReliabilityStatement(0, "Posterior", text)
    if unseen := checks.get("unseen"):
        yield ReliabilityStatement(
            1,
            "Posterior",
            f"{unseen} further maxima of the surrogate have a similar probability, but no realisations verified them.",
        )
    for one in checks.get("far", []):
        text = (
            f"the posterior mean of {one['input']} is {abs(one['deviations']):.1f} prior standard deviations from the "
            "prior median."
        )
        yield ReliabilityStatement(1, "Prior", text)
