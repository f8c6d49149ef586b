"""Describe an output over time in words and numbers: final value, largest spread, and precision."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report.figures import automatic_times
from uqmbd.report.view import Method, StudyResult
from uqmbd.wording import (
    Cell,
    format_cells,
    format_power,
    minus,
    power_of_ten,
    typeset_units,
)

__all__ = ["in_words", "integration", "numbers", "output_rows", "precision", "quantile_interval"]


_UNKNOWN = Cell("unknown", "")


def in_words(method: Method, name: str) -> str:
    """Describe the final value and the largest spread of an output in one or two sentences."""
    (row,) = output_rows([method], name)
    return (
        f"At {row['end']} the mean is {row['mean']} and the standard deviation {row['std']}; "
        f"the largest standard deviation, {row['std_max']}, is reached at {row['std_max_time']}."
    )


def precision(result: StudyResult, method: Method, name: str) -> str:
    """State the precision of the standard deviation of an output; empty if it is unknown.

    The section on methods gives advice to improve the precision.
    """
    one, data = result.assessment.judgement(method.label, name), method.of(name)
    if method.samples is None or "std_error_std" not in data or not one.varies or not 0 < one.error < math.inf:
        return ""
    words = method.statements[name]
    text = f"{words[0].upper()}{words[1:]}, with 95 % confidence."
    largest = int(np.nan_to_num(data["std"].values, nan=-1.0).argmax())
    if float(data["kurtosis"][largest]) > 30:
        text += (
            " A few extreme samples cause most of the largest standard deviation, so this error is uncertain as well. "
            "Use the quantiles instead of the standard deviation."
        )
    return text


def integration(method: Method, name: str) -> str:
    """State the error of the time integration of an output; empty if the results do not state it."""
    return method.integration_shares[name].sentence() if name in method.integration_shares else ""


def output_rows(methods: Iterable[Method], name: str) -> list[dict[str, Any]]:
    """Return the rows of an output, one for each method: final value with 95 % interval, and largest std.

    Numbers of all methods have the same number of digits. Each number is a `Cell`, whose two parts a table aligns
    separately. The last time, ``end``, is a text.
    """
    some = list(methods)
    units = some[0].units(name)
    histories = [method.of(name) for method in some]
    ends = [data.isel(time=-1) for data in histories]
    scale = float(np.fmax.reduce([float(end["std"]) for end in ends], initial=0.0))

    def shown(value: str, error: str) -> list[Cell]:
        errors = [float(end[error]) if error in end else math.nan for end in ends]
        return format_cells([float(end[value]) for end in ends], units, errors, scale if value == "mean" else 0.0)

    largest = [int(np.nan_to_num(data["std"].values, nan=-1.0).argmax()) for data in histories]
    most = [float(data["std"][k]) for data, k in zip(histories, largest, strict=True)]
    when = [float(data["time"][k]) for data, k in zip(histories, largest, strict=True)]
    last = float(max(abs(end["time"]) for end in ends))
    bounds = [_interval(end) for end in ends]
    flat = format_cells([x for pair in bounds for x in pair], units, scale=scale)
    columns = zip(
        some, ends, shown("mean", "std_error_mean"), shown("std", "std_error_std"), flat[::2], flat[1::2], bounds,
        format_cells(most, units), format_cells(when, "s", scale=last), strict=True,
    )  # fmt: skip
    return [
        {
            "output": name,
            "method": method.label,
            "end": f"t = {float(end['time']):.4g} s",
            "mean": mean,
            "std": std,
            "interval": Cell(f"{low.number} to {high.number}", high.rest) if np.isfinite(pair).all() else _UNKNOWN,
            "std_max": most_std,
            "std_max_time": time if method.varies(name) else Cell("no spread", ""),
        }
        for method, end, mean, std, low, high, pair, most_std, time in columns
    ]


def _interval(end: xr.Dataset) -> tuple[float, float]:
    """Return the ends of the interval with 95 % of the realisations; NaN if the quantiles are not stored."""
    found = end["quantile"].sel(probability=[0.025, 0.975], method="nearest")
    known = np.allclose(found["probability"].values, (0.025, 0.975), rtol=0, atol=1e-6)
    low, high = found.values.tolist() if known else (math.nan, math.nan)
    return (low, high) if math.isfinite(low) and math.isfinite(high) else (math.nan, math.nan)


def quantile_interval(data: xr.Dataset, level: float) -> xr.DataArray | None:
    """Return the 95 % interval (bound, ...) of a quantile; None if it is not stored."""
    if "quantile_interval" not in data:
        return None
    found = data["quantile_interval"].sel(probability=level, method="nearest")
    known = abs(float(found["probability"]) - level) < 1e-6 and not bool(found.isnull().all())
    return found.transpose("bound", ...) if known else None


def numbers(method: Method, name: str) -> list[dict[str, str]]:
    """Return the numbers of an output at chosen times: mean, standard deviation, quantiles and skewness.

    The key ``within`` with the level of a quantile contains its 95 % interval, which is empty if it is not stored. Very
    large and very small numbers are in units of a power of ten, so that columns are narrow.
    """
    data = method.of(name)
    some = data.isel(time=automatic_times(data["time"].values, data["std"].values))
    sizes = [np.fmax.reduce(np.abs(some[key].values), axis=None, initial=0.0) for key in ("mean", "std", "quantile")]
    power = power_of_ten(float(max(sizes)))
    scaled = [key for key in ("mean", "std", "quantile", "quantile_interval") if key in some]
    some = some.assign({key: some[key] / 10.0**power for key in scaled})
    scale = float(np.fmax.reduce(some["std"].values, axis=None, initial=0.0))
    times = some["time"].values.tolist()
    columns = {
        "time": [str(cell) for cell in format_cells(times, "s", scale=float(abs(data["time"][-1])))],
        "mean": _column(some["mean"], scale),
        "std": _column(some["std"]),
    }
    for p in (0.025, 0.5, 0.975):
        at = some["quantile"].sel(probability=p, method="nearest")
        known = abs(float(at["probability"]) - p) < 1e-6
        columns[f"q{p}"] = _column(at, scale) if known else ["–"] * len(times)
        ends = quantile_interval(some, p)
        within = [] if ends is None else zip(*(_column(one, scale) for one in ends), strict=True)
        columns[f"within{p}"] = [f"{low} to {high}" for low, high in within] or [""] * len(times)
    shape = some["skewness"].values.tolist()
    columns["skewness"] = [minus(f"{round(one, 2) + 0.0:.2f}") if math.isfinite(one) else "–" for one in shape]
    units = " ".join(filter(None, (format_power(power), typeset_units(method.units(name)))))
    columns["units"] = [units] * len(times)
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _column(values: xr.DataArray, scale: float = 0.0) -> list[str]:
    """Return the numbers of one column as texts, with dashes for unknown numbers.

    The last digit is at most a tenth of `scale`, if six digits are sufficient for this.
    """
    known = values.values.tolist()
    texts = [str(cell) if cell != _UNKNOWN else "–" for cell in format_cells(known, scale=scale)]
    largest = max((abs(one) for one in known if math.isfinite(one)), default=0.0)
    if scale <= 0 or largest <= 0 or any("×" in text for text in texts):
        return texts
    places = min(1 - math.floor(math.log10(scale)), 5 - math.floor(math.log10(largest)))
    if places <= max(len(text.partition(".")[2]) for text in texts):
        return texts
    return [minus(f"{one:.{places}f}") if math.isfinite(one) else text for one, text in zip(known, texts, strict=True)]
