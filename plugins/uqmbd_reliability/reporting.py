"""Report section on reliability: most likely violations, and the computation of their probabilities."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqmbd.report import Chart, ChartGroup, Curve, FirstScreen, ReliabilityStatement, with_units
from uqmbd.results import methods

__all__ = ["ReliabilitySection"]

MOST_CHARTS = 4
"""Largest number of requirements with charts of the most likely violations."""

NAMED = 2
"""Number of inputs of a most likely violation in a table."""


class ReliabilitySection:
    """Most likely violations of requirements."""

    title = "Most likely violations"

    def render(self, tree: xr.DataTree) -> str:
        """Return the table of all most likely violations; an empty text if no method has any."""
        return "\n".join(_table(label, node) for label, node in _analyses(tree))

    def first_screen(self, tree: xr.DataTree) -> FirstScreen | None:
        """Return a table and charts of the most likely violations, and numbers of realisations; None if none exist."""
        rows, charts, sentences = [], [], []
        found = list(_analyses(tree))
        for label, node in found:
            data = node["requirements"].to_dataset()
            of = f" ({label})" if len(found) > 1 else ""
            for name in _with_design_point(data):
                one = data.sel(requirement=name).isel(point=0)
                cells = (_time(one), f"{float(one['beta']):.2f}", "; ".join(_inputs(one)[:NAMED]))
                rows.append((f"{name}{of}", *cells))
                charts.append(_chart(one, f"{name}{of}"))
            count, how = f"{int(node.attrs['realisations'])} realisations", str(data.attrs.get("how", ""))
            text = f"{how}." if re.search(rf"\b{count}\b", how) else f"{count}; {how}."
            sentences.append(ReliabilityStatement(3, label, text))
        if not rows:
            return None
        group = ChartGroup(
            charts[:MOST_CHARTS],
            "Deviations of the inputs at the most likely violations.",
            "The most likely violation in independent standard normal variables. For an input that depends on others, "
            "the bar is its deviation given these.",
            "Requirement",
        )
        heads = ("Time", "Reliability index", "Inputs with the largest deviations")
        return FirstScreen("Most likely violation", heads, rows, [group], sentences)


def _analyses(tree: xr.DataTree) -> Iterator[tuple[str, xr.DataTree]]:
    """Yield the methods with design points, by label."""
    for label, node in methods(tree).items():
        part = node.children.get("requirements")
        if part is not None and {"design_points", "design_points_standard", "beta"} <= set(part.data_vars):
            yield label, node


def _with_design_point(data: xr.Dataset) -> list[str]:
    """Return the requirements with a design point, without the event that any of several is violated."""
    if not data.sizes.get("point", 0):
        return []
    names = [str(name) for name in data["requirement"].values]
    own = names[:-1] if len(names) > 1 else names
    return [name for name in own if np.isfinite(float(data["beta"].sel(requirement=name)[0]))]


def _time(one: xr.Dataset) -> str:
    time = float(one["design_times"]) if "design_times" in one else float("nan")
    return f"{time:.4g} s" if np.isfinite(time) else "\N{EN DASH}"


def _inputs(one: xr.Dataset) -> list[str]:
    """Return texts of the inputs at a design point, largest distance from the median first."""
    away = np.abs(one["design_points_standard"].values)
    names, units = one["input"].values, one["input_units"].values
    values = one["design_points"].values
    # units as in a label, without brackets
    shown = [with_units("", str(one)).strip(" []") for one in units]
    return [f"{names[k]} = {_number(values[k])} {shown[k]}".rstrip() for k in np.argsort(-away)]


def _number(value: float) -> str:
    return f"{value:.5g}".replace("-", "\N{MINUS SIGN}")


def _chart(one: xr.Dataset, title: str) -> Chart:
    names = [str(name) for name in one["input"].values]
    bars = Curve("most likely violation", one["design_points_standard"].values, (), "deviation", drawn="bars")
    return Chart("deviation", names, [bars], title, "1", "input")


def _table(label: str, node: xr.DataTree) -> str:
    data = node["requirements"].to_dataset()
    names = _with_design_point(data)
    if not names:
        return ""
    inputs = [with_units(str(n), str(u)) for n, u in zip(data["input"].values, data["input_units"].values, strict=True)]
    heads = ("Requirement", "Time", "Reliability index", *inputs)
    rows = []
    for name in names:
        data_of = data.sel(requirement=name)
        for k in range(data.sizes["point"]):
            one = data_of.isel(point=k)
            if not np.isfinite(float(one["beta"])):
                continue
            cells = [_time(one), f"{float(one['beta']):.2f}"]
            cells += [_number(float(value)) for value in one["design_points"].values]
            shown = "".join(f'<td class="number">{html.escape(cell)}</td>' for cell in cells)
            rows.append(f'<tr><th scope="row">{html.escape(name)}</th>{shown}</tr>')
    head = "".join(f'<th scope="col">{html.escape(head)}</th>' for head in heads)
    words = f"Design points of {label}: the most likely inputs at which a requirement is violated."
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    region = '<div class="wide" tabindex="0" role="region" aria-label="Most likely violations">'
    return f"<p>{html.escape(words)}</p>{region}{table}</div>"
