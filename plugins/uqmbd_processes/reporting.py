"""Report section: shares of the variance due to parameters, to sampled paths, and to interactions of both."""

from __future__ import annotations

import html
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqmbd.report import Band, Curve, chart_html
from uqmbd.results import methods

__all__ = ["VarianceSection"]

MINUS = "\N{MINUS SIGN}"

ORIGINS = {"parameters": "parameters alone", "paths": "paths alone", "both": "interaction of both"}
"""Text of each part of the variance."""


class VarianceSection:
    """Shares of the variance over time."""

    title = "Variance due to parameters and random processes"

    def render(self, tree: xr.DataTree) -> str:
        """Return a table of scalar outputs, and a chart for each output over time; an empty text without shares."""
        found = []
        for label, data in _shares(tree):
            shown = label if len(methods(tree)) > 1 else ""
            parts = [data.sel(output=name) for name in data["output"].values]
            if "time" in data.dims:
                found += [_chart(shown, one) for one in parts]
            else:
                moved = [one for one in parts if _depends_on_paths(one)]
                found += [_table(shown, moved)] if moved else []
                if fixed := [str(one["output"].item()) for one in parts if not _depends_on_paths(one)]:
                    found.append(f"<p>{html.escape(_without_paths(shown, fixed))}</p>")
        return "\n".join(found)


def _depends_on_paths(one: xr.Dataset) -> bool:
    """Return whether the variance of an output without a time is due to sampled paths, also in part."""
    origins = ["paths", "both"]
    return bool(
        one["variance_share"].sel(origin=origins).any() or one["variance_share_interval"].sel(origin=origins).any()
    )


def _without_paths(label: str, names: list[str]) -> str:
    """Return a sentence on outputs that do not depend on sampled paths."""
    listed = names[0] if len(names) == 1 else f"{len(names)} outputs, from {names[0]} to {names[-1]}"
    method = f" ({label})" if label else ""
    return f"Scalar outputs that do not depend on the sampled paths{method}: {listed}."


def _shares(tree: xr.DataTree) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the statistics of methods with shares of the variance, by label; those of scalar outputs first."""
    for label, node in methods(tree).items():
        for place in ("scalars/statistics", "statistics"):
            data = node[place].to_dataset() if place in _paths(node) else xr.Dataset()
            if "variance_share" in data and data.sizes.get("time", 2) > 1:
                yield label, data


def _paths(node: xr.DataTree) -> set[str]:
    return {one.relative_to(node) for one in node.subtree}


BEYOND = "; estimates outside 0 to 100 % are due to sampling error"
"""Reason for impossible shares: an unbiased estimate of a share may be negative, or exceed 100 %."""


def _table(label: str, parts: list[xr.Dataset]) -> str:
    """Return a table of the shares of scalar outputs with their 95 % intervals."""
    rows = []
    for one in parts:
        cells = []
        for origin in ORIGINS:
            low, high = one["variance_share_interval"].sel(origin=origin).transpose("bound").values * 100
            share = 100 * float(one["variance_share"].sel(origin=origin))
            shown = f"{share:.1f} % ({low:.1f} to {high:.1f}{BEYOND if not 0 <= share <= 100 else ''})".replace(
                "-", MINUS
            )
            cells.append(f'<td class="number">{shown}</td>')
        rows.append(f'<tr><th scope="row">{html.escape(str(one["output"].item()))}</th>{"".join(cells)}</tr>')
    heads = "".join(f'<th scope="col">{text}</th>' for text in ("Output", *ORIGINS.values()))
    about = f"Shares of the variance of scalar outputs, with 95 % intervals{f' ({label})' if label else ''}."
    table = f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    region = '<div class="wide" tabindex="0" role="region" aria-label="Shares of the variance">'
    return f"<p>{html.escape(about)}</p>{region}{table}</div>"


def _chart(label: str, one: xr.Dataset) -> str:
    name = str(one["output"].item())
    curves = []
    for origin, text in ORIGINS.items():
        share = one["variance_share"].sel(origin=origin).values
        low, high = (one["variance_share_interval"].sel(origin=origin, bound=b).values for b in ("lower", "upper"))
        curves.append(Curve(text, share, (Band("95 % interval", low, high),), quantity="share of the variance"))
    mean = _weighted(one)
    means = ", ".join(f"{text} {_whole_percent(mean[origin])}" for origin, text in ORIGINS.items())
    beyond = f"{BEYOND}" if not all(-5e-3 <= x <= 1.005 for x in mean.values()) else ""
    caption = f"Shares of the variance of {name}{f' ({label})' if label else ''}; over all times: {means}{beyond}."
    title = f"share of the variance of {name}"
    return chart_html(title, one["time"].values, curves, caption, caption, units="1")


def _whole_percent(share: float) -> str:
    """Return a share as whole percents, with the sign that typography uses, and no sign of zero."""
    return f"{round(100 * share)} %".replace("-", MINUS)


def _weighted(one: xr.Dataset) -> dict[str, float]:
    """Return the shares of the sum of the variances over all times."""
    variance = np.square(one["std"].values)
    whole = float(variance.sum())
    shares = one["variance_share"].transpose("origin", "time").values @ variance
    found = shares / whole if whole > 0 else np.zeros_like(shares)
    return dict(zip(map(str, one["origin"].values), map(float, found), strict=True))
