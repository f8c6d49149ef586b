"""Data of charts of elements: where the space of the inputs was split, and how large the error is there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.drawing import decades
from uqmbd.report.figures import Band, Curve, SplitElements, split_elements
from uqmbd.report.live.chart_data import curve_data
from uqmbd.report.live.packing import packed
from uqmbd.typing import Array
from uqmbd.wording import format_number, typeset_units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["elements_data"]

SPAN = 1e-3
"""Smallest value, over the largest, that has a shade or a height of its own: errors of rounding need none."""


def elements_data(node: xr.DataTree, output: str | None = None) -> dict[str, Any]:
    """Return the elements of a method: boxes in the plane of two inputs, steps along the only one that was split.

    Parameters
    ----------
    node, output
        As of `uqmbd.report.split_pattern`.

    Raises
    ------
    StudyError
        If no such output exists.
    """
    found = split_elements(node, output)
    return _steps(found) if found.up is None else _boxes(found, found.up)


def _ends(values: Array) -> tuple[float, float] | None:
    """Return between which values above zero differences are seen; None if nothing differs."""
    positive = values[values > 0]
    if not len(positive) or positive.max() <= 1.05 * positive.min():
        return None
    return max(float(positive.min()), SPAN * float(positive.max())), float(positive.max())


def _worst(values: Array) -> int:
    """Return where the largest value is; those that are not known do not count."""
    return int(np.argmax(np.where(np.isnan(values), -np.inf, values)))


def _boxes(found: SplitElements, up: tuple[Array, Array]) -> dict[str, Any]:
    """Return boxes, ordered along the axis."""
    (x0, x1), (y0, y1) = found.across, up
    order = np.lexsort((y0 + y1, x0 + x1))
    x0, x1, y0, y1 = (side[order] for side in (x0, x1, y0, y1))
    scale, name, units = (100.0, "stated error", "% of std") if found.stated else (1.0, found.what, "")
    value = scale * found.value[order]
    (across, across_units), (name_up, units_up) = ((one, typeset_units(unit)) for one, unit in found.names)
    curve = Curve("elements", (y0 + y1) / 2, (Band(f"{name_up} from, to", y0, y1),), f"centre of {name_up}")
    method = curve_data(0, 1, curve)
    method["columns"] = [{"name": name, "units": units, "digits": True, "values": packed(value)}]
    if found.stated:
        probability = {"name": "probability", "units": "", "digits": True, "values": packed(found.probability[order])}
        method["columns"].append(probability)
    ends = _ends(value)
    largest = float(np.nanmax(value, initial=0.0))
    return {
        "output": name_up,
        "units": units_up,
        "time": packed((x0 + x1) / 2),
        "of": len(order),
        "start": _worst(value),
        "across": {
            "name": across,
            "units": across_units,
            "told": across_units,
            "ends": [float(x0.min()), float(x1.max())],
            "texts": [_range(across, low, high, across_units) for low, high in zip(x0, x1, strict=True)],
        },
        "up": {"low": float(y0.min()), "high": float(y1.max())},
        "boxes": {
            "name": f"{name} in the element",
            "units": units,
            "left": packed(x0),
            "right": packed(x1),
            "shade": packed(value),
            "ends": list(ends or (0.0, largest)),
            "log": ends is not None,
        },
        "methods": [method],
    }


def _range(name: str, low: float, high: float, units: str) -> str:
    return f"{name} from {format_number(low)} to {format_number(high)} {units}".strip()


def _steps(found: SplitElements) -> dict[str, Any]:
    """Return the height of each element over the input that was split."""
    x0, x1 = found.across
    order = np.argsort(x0)
    value = (100.0 if found.stated else 1.0) * found.value[order]
    ends = _ends(value) if found.stated else None
    units = typeset_units(found.names[0][1])
    name = "stated error" if found.stated else found.what
    shown = value if ends is None else np.maximum(value, ends[0])
    curve = Curve("elements", np.repeat(shown, 2), (), name)
    up: dict[str, Any] = {"low": 0.0}
    if ends is not None:
        first, last = decades(ends[0], 1.5 * ends[1])
        up = {"log": True, "low": float(f"1e{first}"), "high": float(f"1e{last}")}
    return {
        "output": f"{name} in the element",
        "axis": name,
        "units": "% of std" if found.stated else "",
        "time": packed(np.column_stack([x0[order], x1[order]]).ravel()),
        "of": 2 * len(order),
        "digits": 2,
        "start": 2 * _worst(value),
        "across": {"name": found.names[0][0], "units": units, "told": units},
        "up": up,
        "methods": [curve_data(0, 1, curve) | {"filled": True}],
    }
