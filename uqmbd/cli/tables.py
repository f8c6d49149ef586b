"""Tables for the terminal: numbers with significant digits only, and outputs next to their units."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from uqmbd.wording import format_duration, format_share, typeset_units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["console", "plain_table", "show_summary", "units_of", "with_spread"]

RELIABILITY = 5  # maximum number of lines on reliability, the least reliable first; the report has all
LINES = 20  # maximum number of outputs in a table on the terminal; the report has all outputs


def console() -> Console:
    """Return a console for the standard output; lines in a pipe or file are not cut at 80 columns."""
    return Console(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else 160)


def plain_table(*columns: str, right: int = 0) -> Table:
    """Return an empty table without a frame; the last `right` columns contain numbers."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for number, column in enumerate(columns):
        table.add_column(Text(column), justify="right" if number >= len(columns) - right else "left")
    return table


def with_spread(mean: float, std: float) -> str:
    """Return mean and standard deviation as text with equal decimal places; the latter has two digits.

    >>> with_spread(0.349613, 0.003121), with_spread(-12345.6, 250.0), with_spread(1.5, 0.0)
    ('0.3496 ± 0.0031', '-12346 ± 250', '1.5 ± 0')
    >>> with_spread(2.5e-7, 1.1e-9), with_spread(float("nan"), 1.0)
    ('2.500e-07 ± 1.1e-09', 'unknown')
    >>> with_spread(-1.6e-9, 0.55), with_spread(-1.6e-12, 2.3e-5)
    ('0.00 ± 0.55', '0 ± 2.3e-05')
    """
    if not (math.isfinite(mean) and math.isfinite(std)):
        return "unknown"
    if std == 0.0:
        return f"{mean:.6g} ± 0"
    place = 1 - math.floor(math.log10(abs(std)))
    mean = round(mean, max(place, 0)) + 0.0  # rounding has no sign
    largest = max(abs(mean), abs(std))
    if largest >= 1e6 or place > 8 or largest < 1e-4:
        digits = max(place + math.floor(math.log10(abs(mean))), 1) if mean else 0
        return f"{f'{mean:.{min(digits, 12)}e}' if mean else 0} ± {std:.1e}"
    decimals = max(place, 0)
    return f"{mean:.{decimals}f} ± {std:.{decimals}f}"


def show_summary(tree: xr.DataTree, *, files: Mapping[str, Path], title: str = "") -> None:
    """Print each output at the end time, failures, wall times and paths of the files."""
    from uqmbd.results import propagator_nodes, scalar_nodes
    from uqmbd.results.assessment import coupled_systems

    nodes = propagator_nodes(tree)
    still = scalar_nodes(nodes)
    first = next(iter(nodes.values()))["statistics"].to_dataset()
    names = [str(name) for name in first["output"].values]
    units = units_of(first)
    end = f" at t = {float(first['time'].values[-1]):g} s" if "time" in first.coords else ""
    screen = console()
    screen.print(Text(f"\n{title}mean ± standard deviation{end if names else ''}", style="bold"))
    table = plain_table("output", "units", *nodes, right=len(nodes))
    for number, (name, unit) in enumerate(zip(names[:LINES], units, strict=False)):
        table.add_row(Text(name), Text(unit), *(_final(node, number) for node in nodes.values()))
    if names and still:
        table.add_row("")
        table.add_row(Text("scalar outputs", style="italic"))
    _add_scalars(table, list(nodes), still)
    _add_requirements(table, nodes)
    table.add_section()
    table.add_row("failed realisations", "", *_failed(nodes.values()))
    if any(int(node.attrs.get("failures", 0)) for node in still.values()):
        table.add_row("without scalar outputs", "", *_failed(still.get(label) for label in nodes))
    spent = (float(node.attrs.get("wall_time", 0.0)) for node in nodes.values())
    table.add_row("wall time", "", *(format_duration(time) for time in spent))
    if any("clock" in node.attrs for node in nodes.values()):
        table.add_row("clock", "", *(Text(_clock(node)) for node in nodes.values()))
    table.add_row("integration error", "", *(_integration(node) for node in nodes.values()))
    screen.print(table)
    if text := coupled_systems(nodes):
        screen.print(Text(text))
    if len(names) > LINES:
        screen.print(f"... and {len(names) - LINES} more outputs, which the report contains.")
    _show_assessment(screen, tree)
    width = max(map(len, files), default=0)
    for kind, path in files.items():
        # without rich, which would wrap a long path so that it cannot be copied
        print(f"{kind:<{width}}  {path}")


def _clock(node: xr.DataTree) -> str:
    """Describe the clock of the comparison of realisations at equal phase."""
    known = node.attrs
    return f"{known['clock']} ({known.get('clock_kind', '')})" if "clock" in known else "–"


def _integration(node: xr.DataTree) -> str:
    """State the largest error of the time integration, with its output."""
    from uqmbd.results.assessment import worst_integration_share

    worst = worst_integration_share(node)
    return "–" if worst is None else worst.words()


def _failed(nodes: Iterable[xr.DataTree | None]) -> list[Text]:
    """Describe the failed realisations of each method; empty if there are none."""
    counts = [
        [0 if node is None else int(node.attrs.get(n, 0)) for n in ("failures", "realisations")] for node in nodes
    ]
    return [Text(f"{bad} of {all_}" if all_ else "", style="bold red" if bad else "") for bad, all_ in counts]


def _show_assessment(screen: Console, tree: xr.DataTree) -> None:
    """Print the reliability of outputs, the least reliable first, the recommended method, and drawbacks of others."""
    from uqmbd.results import assess

    found = assess(tree)
    for sentence in found.contradictions:
        screen.print(Text(sentence, style="bold red"))
    screen.print(Text("\nReliability of the results", style="bold"))
    table = plain_table("reliable", "quantity", "reason")
    for one in found.reliability[:RELIABILITY]:
        table.add_row(Text(f"{one.sign} {one.word}"), Text(one.name), Text(one.reason))
    screen.print(table)
    if len(found.reliability) > RELIABILITY:
        screen.print(f"... and {len(found.reliability) - RELIABILITY} more, which are at least as reliable.")
    if text := (*found.recommendation, *found.reasons):
        print("", *text, "", sep="\n")
    if problem := tree.children["comparison"].attrs.get("problem") if "comparison" in tree.children else None:
        print(f"\nThe methods could not be compared: {problem}\n")


def _add_scalars(table: Table, labels: list[str], still: Mapping[str, xr.DataTree]) -> None:
    """Add rows of the scalar outputs, which some methods may lack."""
    if not still:
        return
    first = next(iter(still.values()))["statistics"].to_dataset()
    names = [str(name) for name in first["output"].values]
    for number, (name, unit) in enumerate(zip(names[:LINES], units_of(first), strict=False)):
        cells = (_final(still[label], number) if label in still else "–" for label in labels)
        table.add_row(Text(name), Text(unit), *cells)
    if len(names) > LINES:
        table.add_row(Text(f"... and {len(names) - LINES} more"))


def _add_requirements(table: Table, nodes: Mapping[str, xr.DataTree]) -> None:
    """Add rows of the probabilities of violation, with their 95 % intervals."""
    from uqmbd.results import answers

    found = answers(nodes)
    if not found:
        return
    if table.row_count:
        table.add_row("")
    table.add_row(Text("probability of violation (95 %)", style="italic"))
    for name, by_method in found.items():
        table.add_row(Text(name), "", *(Text(by_method[x].words if x in by_method else "–") for x in nodes))


def units_of(statistics: xr.Dataset) -> list[str]:
    """Return the units of the outputs as they are displayed; empty if none are stated."""
    if "output_units" not in statistics.coords:
        return [""] * statistics.sizes["output"]
    return [typeset_units(str(unit)) for unit in statistics["output_units"].values]


def _final(node: xr.DataTree, output: int) -> str:
    from uqmbd.results import varying
    from uqmbd.results.statistics import rtol_of

    whole = node["statistics"].to_dataset()
    statistics = whole.isel(output=output)
    if "time" in statistics.dims:
        statistics = statistics.isel(time=-1)
    mean = float(statistics["mean"])
    late = float(statistics.get("censored", 0.0))
    if late and not math.isfinite(mean):
        return "does not always occur" if math.isnan(late) else f"does not occur in {format_share(late)}"
    more = f"; does not occur in {format_share(late)}" if late else ""
    if math.isfinite(mean) and not varying(whole, rtol_of(node))[output]:
        return f"{mean:.6g}, no spread{more}"
    return with_spread(mean, float(statistics["std"])) + more
