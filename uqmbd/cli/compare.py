"""`uqmbd compare`: how far two stored results are apart."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from uqmbd.cli.tables import console, plain_table, units_of
from uqmbd.errors import StudyError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["show_comparison"]


def show_comparison(first: Path, second: Path) -> None:
    """Print the largest differences of means and standard deviations over time between two result files.

    Methods with the same label are compared with each other; if there are none, and each file holds one
    method, these are.
    """
    from uqmbd.results import compare, load, propagator_nodes

    nodes = [propagator_nodes(load(path)) for path in (first, second)]
    screen = console()
    for one, other in _pairs(nodes[0], nodes[1], first, second):
        # Neither the labels nor the paths need differ, so the two results are told apart by letters.
        found = compare({"A": nodes[0][one], "B": nodes[1][other]}, reference="A")
        screen.print(Text(f"\n{second}: {other}  against  {first}: {one}", style="bold"))
        table = plain_table(
            "output", "units", "largest mean difference", "largest std difference", "largest std", right=3
        )
        differences = found.sel({"method": "B"})  # `method` as a keyword is another thing to xarray
        scales = [float(value) for value in found["reference_std_max"].values]
        units = units_of(nodes[0][one]["statistics"].to_dataset())
        for number, (output, scale) in enumerate(zip(found["output"].values, scales, strict=True)):
            mean = float(differences["mean_difference_max"].values[number])
            std = float(differences["std_difference_max"].values[number])
            table.add_row(
                Text(str(output)), Text(units[number]), _relative(mean, scale), _relative(std, scale), f"{scale:.4g}"
            )
        screen.print(table)
    print("The largest differences over time; percentages are of the largest standard deviation in the first file.")


def _pairs(
    first: dict[str, xr.DataTree], second: dict[str, xr.DataTree], path: Path, other: Path
) -> list[tuple[str, str]]:
    shared = [(label, label) for label in first if label in second]
    if shared:
        return shared
    if len(first) == len(second) == 1:
        return [(next(iter(first)), next(iter(second)))]
    raise StudyError(
        f"No method is in both files: {path} holds {', '.join(first)}, and {other} holds {', '.join(second)}. "
        "Methods are matched by their labels."
    )


def _relative(difference: float, scale: float) -> str:
    return f"{difference:.3g} ({100 * difference / scale:.3g} %)" if scale > 0 else f"{difference:.3g}"
