"""An output over time in words and numbers: its end, its largest spread, and how well both are known."""

from __future__ import annotations

import math

import numpy as np

from uqmbd.report.figures import automatic_times
from uqmbd.report.view import Method
from uqmbd.results import integration_shares, own_statements
from uqmbd.results.comparison import own_error
from uqmbd.results.statistics import rtol_of
from uqmbd.wording import format_number, format_quantity, minus, typeset_units

__all__ = ["in_words", "integration", "numbers", "output_row", "precision", "stated_errors"]


def in_words(method: Method, name: str) -> str:
    """Describe an output's end and its largest spread in a sentence or two."""
    row = output_row(method, name)
    return (
        f"At {row['end']} the mean is {row['mean']} and the standard deviation {row['std']}; "
        f"the largest standard deviation, {row['std_max']}, is reached at {row['std_max_time']}."
    )


def stated_errors(method: Method) -> dict[str, tuple[float, float]]:
    """Return the largest stated error of each output that varies, as a share of the standard deviation, and its time.

    Of a method with samples that states standard errors; else nothing.
    """
    if method.samples is None or "std_error_std" not in method.statistics:
        return {}
    own = own_error(method.node, rtol_of(method.node), dependence=False)
    errors, at = own.largest(method.statistics["time"].values)
    return {
        name: (float(errors[k]), float(at[k]))
        for k, name in enumerate(method.names)
        if own.varies[k] and 0 < errors[k] < math.inf
    }


def precision(method: Method, name: str) -> str:
    """Say in words how well the standard deviation of an output is known; empty if the method cannot tell.

    What is to be done about it is in the summary.
    """
    if name not in stated_errors(method):
        return ""
    data = method.of(name)
    said = own_statements(method.node)[method.histories.index(name)]
    text = f"{said[0].upper()}{said[1:]}, with 95 % confidence."
    largest = int(np.nan_to_num(data["std"].values, nan=-1.0).argmax())
    if float(data["kurtosis"][largest]) > 30:
        text += (
            " A few extreme samples make up most of the largest standard deviation, so that even this error is itself "
            "uncertain: look at the quantiles rather than at the standard deviation."
        )
    return text


def integration(method: Method, name: str) -> str:
    """Say how large the error of the time integration of an output is; empty if the results do not state it."""
    found = {one.output: one for one in integration_shares(method.statistics)}.get(name)
    if found is None:
        return ""
    if not math.isfinite(found.error):
        return f"The error of the time integration is not known: {found.reason}."
    size = f" ({found.words()})" if math.isfinite(found.share) and found.error else ""
    return f"The time integration is wrong by up to {format_quantity(found.error, found.units)}{size}."


def output_row(method: Method, name: str) -> dict[str, str]:
    """Return the row of an output: at the end the mean, deviation and 95 % interval; the largest deviation."""
    data = method.of(name)
    units = method.units(name)
    end = data.isel(time=-1)
    largest = int(data["std"].values.argmax())

    def shown(value: str, error: str) -> str:
        return format_quantity(float(end[value]), units, float(end[error]) if error in end else None)

    ends = [float(end["quantile"].sel(probability=p, method="nearest")) for p in (0.025, 0.975)]
    levels = end["probability"].values
    known = np.isfinite(ends).all() and np.any(np.abs(levels - 0.025) < 1e-6) and np.any(np.abs(levels - 0.975) < 1e-6)
    return {
        "output": name,
        "method": method.label,
        "end": f"t = {float(end['time']):.4g} s",
        "mean": shown("mean", "std_error_mean"),
        "std": shown("std", "std_error_std"),
        "interval": f"{format_number(ends[0])} to {format_quantity(ends[1], units)}" if known else "unknown",
        "std_max": format_quantity(float(data["std"][largest]), units),
        "std_max_time": f"{float(data['time'][largest]):.4g} s" if method.varies(name) else "no spread",
    }


def numbers(method: Method, name: str) -> list[dict[str, str]]:
    """Return the numbers of an output at chosen times: mean, deviation, quantiles and shape."""
    data = method.of(name)
    rows = []
    for k in automatic_times(data["time"].values, data["std"].values):
        at = data.isel(time=k)
        row = {"time": f"{float(at['time']):.4g} s", "units": typeset_units(method.units(name))}
        for value in ("mean", "std"):
            row[value] = format_number(float(at[value]))
        for p in (0.025, 0.5, 0.975):
            known = abs(float(at["probability"].sel(probability=p, method="nearest")) - p) < 1e-6
            quantile = float(at["quantile"].sel(probability=p, method="nearest")) if known else math.nan
            row[f"q{p}"] = format_number(quantile) if math.isfinite(quantile) else "–"
        skewness = float(at["skewness"])
        row["skewness"] = minus(f"{skewness:.2f}") if math.isfinite(skewness) else "–"
        rows.append(row)
    return rows
