"""A section of the report with charts of its own data."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqmbd.report import Band, Curve, chart_html

__all__ = ["Rates"]


class Rates:
    """How fast the mean of each output over time changes, by each method."""

    title = "Rates of change"

    def render(self, tree: xr.DataTree) -> str:
        """Return a chart for each output."""
        methods = {name: node for name, node in tree.children.items() if "realisations" in node.attrs}
        found = {name: node["statistics"].to_dataset() for name, node in methods.items()}
        return "".join(self._chart(found, output) for output in self._outputs(found))

    def _outputs(self, found: dict[str, xr.Dataset]) -> list[str]:
        """Those that all methods have at the same two or more times."""
        first = next(iter(found.values()))
        if any(len(data["time"]) < 2 or not data["time"].equals(first["time"]) for data in found.values()):
            return []
        return [x for x in first["output"].values.tolist() if all(x in data["output"] for data in found.values())]

    def _chart(self, found: dict[str, xr.Dataset], output: str) -> str:
        times = next(iter(found.values()))["time"].values
        curves = []
        for label, data in found.items():
            mean, std = (data[key].sel(output=output).values for key in ("mean", "std"))
            rate = np.gradient(mean, times)
            spread = np.abs(np.gradient(std, times))
            band = Band("± the rate of the standard deviation", rate - spread, rate + spread)
            curves.append(Curve(label, rate, (band,), "rate of the mean"))
        units = str(next(iter(found.values()))["output_units"].sel(output=output).item())
        return chart_html(
            f"rate of {output}",
            times,
            curves,
            f"How fast {output} changes.",
            f"How fast the mean of {output} changes: differences over time.",
            units=f"{units or 1}/s",
        )
