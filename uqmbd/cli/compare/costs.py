"""Errors against costs, compared with a reference: the table on the terminal, and as CSV or LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from uqmbd.cli.tables import plain_table
from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.wording import format_duration, format_integer, format_percent

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from rich.console import Console

__all__ = ["require_table", "show_costs", "write_costs"]

FORMATS = ".csv", ".tex"


def require_table(path: Path, reference: str | None) -> None:
    """Raise StudyError if a table of errors and costs cannot be written."""
    if path.suffix not in FORMATS:
        raise StudyError(f"--table {path}: unknown format; expected a file name that ends with {' or '.join(FORMATS)}.")
    if reference is None:
        raise StudyError(f"--table {path}: errors need a reference; also give --reference LABEL.")


def show_costs(screen: Console, found: xr.Dataset) -> None:
    """Print errors, costs and regrets, the method with the fewest realisations first."""
    levels = [f"{100 * float(x):g} %" for x in found["accuracy"].values]
    regrets = [f"regret at {x}" for x in levels]
    columns = "error of mean", "error of std", "stated error", "realisations", "time", *regrets
    table = plain_table("method", *columns, right=len(columns))
    for label in _by_cost(found):
        row = found.sel({"method": label})
        errors = [format_percent(float(row[name])) for name in ("mean_error", "std_error", "stated_accuracy")]
        costs = format_integer(int(row["realisations"])), format_duration(float(row["wall_time"]))
        table.add_row(Text(label), *errors, *costs, *(_number(float(x)) for x in row["regret"].values))
    screen.print(Text(f"\nErrors and costs compared with {found.attrs['reference']}", style="bold"))
    screen.print(table)
    own = float(found.attrs["reference_accuracy"])
    screen.print(
        Text(
            "Largest errors over outputs and times; percentages are of the largest standard deviation of the output. "
            "Regret at an accuracy: number of realisations with which the method reaches it, divided by the smallest "
            f"number of all methods. The stated error of the reference is {format_percent(own, 'unknown')}; regrets "
            "for smaller errors are unknown."
        )
    )


def write_costs(path: Path, found: xr.Dataset) -> None:
    """Write errors, costs and regrets as CSV with all digits, or as LaTeX for a paper."""
    frame = _frame(found)
    with replacing(path) as part:
        if path.suffix == ".csv":
            frame.to_csv(part, index=False)
        else:
            part.write_text(
                _latex(frame, str(found.attrs["reference"]), found["accuracy"].values.tolist()), encoding="utf-8"
            )


def _by_cost(found: xr.Dataset) -> list[str]:
    return [str(x) for x in found.sortby(["realisations", "method"])["method"].values]


def _number(value: float) -> str:
    """Return a regret as text: a dash if the method misses the accuracy."""
    return f"{value:.2g}" if value < 10 else f"{value:.0f}" if value == value else "–"


def _frame(found: xr.Dataset) -> pd.DataFrame:
    """Return a frame with one row for each method."""
    import pandas as pd

    names = "mean_error", "std_error", "stated_accuracy", "realisations", "wall_time"
    labels = _by_cost(found)
    data = found.sel({"method": labels})
    columns = {"method": labels, **{name: data[name].values for name in names}}
    for accuracy in found["accuracy"].values:
        columns[f"regret_{accuracy:g}"] = data["regret"].sel(accuracy=accuracy).values
    return pd.DataFrame(columns)


def _latex(frame: pd.DataFrame, reference: str, accuracies: Sequence[float]) -> str:
    """Return a table of LaTeX (package booktabs)."""
    titles = {"method": "method", "mean_error": "mean", "std_error": "std", "stated_accuracy": "stated"}
    titles |= {"realisations": "realisations", "wall_time": "time in s"}
    titles |= {f"regret_{x:g}": f"regret at {100 * x:g}\\,\\%" for x in accuracies}
    shown = frame.rename(columns=titles)
    few = [x for x in shown if x not in ("method", "realisations")]
    style = shown.style.format(precision=2, escape="latex")
    style = style.format({name: "{:.2g}" for name in few}, na_rep="--", escape="latex").hide(axis="index")
    styled: str = style.to_latex(
        column_format="l" + "r" * (len(shown.columns) - 1),
        hrules=True,
        caption=f"Errors of mean and standard deviation, relative to the largest standard deviation, and costs. "
        f"Reference: {reference.replace('_', chr(92) + '_')}.",
    )
    return styled
