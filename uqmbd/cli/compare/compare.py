"""`uqmbd compare`: compare numbers, agreement, and settings of stored results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from uqmbd.cli.compare.costs import require_table, show_costs, write_costs
from uqmbd.cli.compare.differences import find_differences
from uqmbd.cli.tables import console, plain_table
from uqmbd.errors import StudyError
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

__all__ = ["show_comparison"]


def show_comparison(
    paths: Sequence[Path], *, reference: str | None = None, out: Path | None = None, table: Path | None = None
) -> None:
    """Compare stored results: files, or folders of runs.

    Methods with the same label are compared with the method of this label in the first file that has it. Without equal
    labels, or with `reference`, all methods of all files are compared with a single method.

    `paths` are result files, or folders that contain a ``results.nc``: two or more, or one with several methods.
    `reference` is a label that occurs once, or, for example, ``"A collocation"``: the method of this label in the first
    file. With `reference`, errors are also listed against costs. `out` is the folder for ``comparison.nc`` and
    ``report.html`` of all methods together. `table` is a file for errors and costs: CSV or LaTeX.
    """
    from uqmbd.results import load
    from uqmbd.results.storage import errors_of_files

    if table is not None:
        require_table(table, reference)
    trees = {chr(ord("A") + k): load(_file(path)) for k, path in enumerate(paths)}
    with errors_of_files(*trees.values()):
        _show_all(trees, paths, reference, out, table)


def _show_all(
    trees: Mapping[str, xr.DataTree], paths: Sequence[Path], reference: str | None, out: Path | None, table: Path | None
) -> None:
    from uqmbd.results import compare, failed_methods, propagator_nodes, scalar_nodes
    from uqmbd.results.assessment import error_against_cost
    from uqmbd.results.storage import not_verified
    from uqmbd.results.tree import happening

    nodes: dict[str, xr.DataTree] = {}
    screen = console()
    for (letter, tree), path in zip(trees.items(), paths, strict=True):
        found = propagator_nodes(tree)
        if not found:
            raise StudyError(f"{path} contains no results of a method; expected the results of `uqmbd run`.")
        nodes |= {f"{letter} {label}": node for label, node in found.items()}
        screen.print(Text(f"{letter}  {path}: {', '.join(found)}"))
        if not_verified(tree):
            screen.print(Text(f"   {letter} is not verified: this file has no digest."))
        for label, reason in failed_methods(tree).items():
            screen.print(Text(f"   {label} has no results in {letter}: {reason}"))
    if len(nodes) < 2:
        raise StudyError(f"{paths[0]} contains a single method; give a second result for the comparison.")
    _show_differences(screen, trees)
    rtol = max(float(tree.attrs.get("rtol", 0.0)) for tree in trees.values())
    from uqmbd.results import align

    chosen = _chosen(reference, list(nodes)) if reference else None
    # outputs over time first, then outputs without a time
    moving = {label: node for label, node in nodes.items() if node["statistics"].sizes["output"]}
    still, left_out = happening(scalar_nodes(nodes))
    if left_out:
        screen.print(Text(f"Not compared, because they do not occur in all realisations: {', '.join(left_out)}."))
    for some in (moving, still):
        for group in _groups(list(some), chosen) if len(some) > 1 else ():
            aligned, notes = align({label: some[label] for label in group})
            for note in notes:
                screen.print(Text(note, style="bold"))
            known = chosen if chosen in some else None
            _show_group(screen, compare(aligned, reference=known or _first(group, some, rtol), rtol=rtol), notes)
    _show_requirements(screen, nodes)
    if chosen is not None:
        costs = error_against_cost(align(nodes)[0], chosen)
        show_costs(screen, costs)
        if table is not None:
            write_costs(table, costs)
            print(f"table    {table}")
    print("Largest differences over time; percentages are of the largest standard deviation of the reference.")
    if out is not None:
        _write(out, nodes, chosen, rtol, trees)


def _file(path: Path) -> Path:
    if not path.exists():
        raise StudyError(f"{path}: no such file or folder; expected a result file, or the folder of a run.")
    if path.is_dir() and path.suffix != ".zarr":
        if not (path / "results.nc").exists():
            raise StudyError(
                f"{path}: the folder contains no results.nc; expected a result file, or the folder of a run."
            )
        return path / "results.nc"
    return path


def _chosen(reference: str, labels: list[str]) -> str:
    found = [label for label in labels if reference in (label, label.partition(" ")[2])]
    if not found:
        raise StudyError(f"--reference {reference}: no such method; expected one of: {', '.join(labels)}.")
    return found[0]


def _groups(labels: list[str], chosen: str | None) -> list[list[str]]:
    """Return groups of methods to compare: methods of one label, or all methods if no two files share a label."""
    by_name: dict[str, list[str]] = {}
    for label in labels:
        by_name.setdefault(label.partition(" ")[2], []).append(label)
    shared = [group for group in by_name.values() if len(group) > 1]
    return shared if shared and chosen is None else [labels]


def _of_first_file(labels: Sequence[str]) -> list[str]:
    """Return the labels of the first file, from which the reference is chosen."""
    letter = labels[0].partition(" ")[0]
    return [label for label in labels if label.partition(" ")[0] == letter]


def _first(group: Sequence[str], nodes: Mapping[str, xr.DataTree], rtol: float) -> str:
    """Return the reference of a group: the first method of the label, otherwise the best method of the first file."""
    from uqmbd.results import choose_reference

    if len({label.partition(" ")[2] for label in group}) == 1:
        return group[0]
    return choose_reference({label: nodes[label] for label in _of_first_file(group)}, rtol=rtol)


def _show_differences(screen: Console, trees: Mapping[str, xr.DataTree]) -> None:
    found = find_differences(trees)
    if len(trees) < 2:
        return
    if not found:
        screen.print("Studies, inputs, options and versions are equal.")
        return
    table = plain_table("difference", *trees)
    for name, given in found:
        table.add_row(Text(name), *(Text(given[letter]) for letter in trees))
    screen.print()
    screen.print(table)


def _show_group(screen: Console, found: xr.Dataset, notes: Sequence[str]) -> None:
    from uqmbd.results.assessment import NO_SPREAD

    reference = str(found.attrs["reference"])
    for label in (str(m) for m in found["method"].values):
        if label == reference:
            continue
        screen.print(Text(f"\n{label} compared with {reference}", style="bold"))
        table = plain_table("output", "units", "largest mean difference", "largest std difference", "verdict")
        row = found.sel({"method": label})  # `method` as a keyword has another meaning in xarray
        for number, output in enumerate(found["output"].values):
            still = str(row["verdict_kind"].values[number]) == NO_SPREAD
            scale = 0.0 if still else float(found["reference_std_max"].values[number])
            table.add_row(
                Text(str(output)),
                Text(typeset_units(str(found["output_units"].values[number]))),
                _relative(float(row["mean_difference_max"].values[number]), scale),
                _relative(float(row["std_difference_max"].values[number]), scale),
                Text(str(row["verdict"].values[number])),
            )
        screen.print(table)
    if found.attrs.get("recommendation"):
        screen.print()
        print(found.attrs["recommendation"])


def _show_requirements(screen: Console, nodes: Mapping[str, xr.DataTree]) -> None:
    """Print the probability of violation by each method, and the methods that contradict each other."""
    from uqmbd.results import answers
    from uqmbd.results.requirements import differing

    found = answers(nodes)
    if not found:
        return
    labels = [label for label in nodes if any(label in by_method for by_method in found.values())]
    table = plain_table("requirement: probability of violation (95 %)", *labels, right=len(labels))
    for name, by_method in found.items():
        table.add_row(Text(name), *(Text(by_method[x].words if x in by_method else "–") for x in labels))
    screen.print()
    screen.print(table)
    for sentence in differing(nodes):
        screen.print(Text(f"{sentence}.", style="bold red"))
    screen.print()


def _relative(difference: float, scale: float) -> str:
    return f"{difference:.3g} ({100 * difference / scale:.3g} %)" if scale > 0 else f"{difference:.3g}"


def _write(
    out: Path, nodes: Mapping[str, xr.DataTree], chosen: str | None, rtol: float, trees: Mapping[str, xr.DataTree]
) -> None:
    """Write all methods of all files as one result, with its report."""
    from uqmbd.cli.report import write
    from uqmbd.propagation import output_folder
    from uqmbd.results import align, failed_methods, save, study_tree

    aligned, notes = align(nodes)
    failed = {f"{n} {label}": reason for n, tree in trees.items() for label, reason in failed_methods(tree).items()}
    names = [str(tree.attrs.get("study", "study")) for tree in trees.values()]
    mechanisms = dict.fromkeys(str(tree.attrs.get("mechanism", "")) for tree in trees.values())
    attrs: dict[str, Any] = {"rtol": rtol, **({"notes": " ".join(notes)} if notes else {})}
    attrs |= {"failed": json.dumps(failed, ensure_ascii=False)} if failed else {}
    attrs |= {
        f"what differs: {n}": "; ".join(f"{k}: {v}" for k, v in given.items()) for n, given in find_differences(trees)
    }
    tree = study_tree(
        aligned.values(),
        study=" and ".join(dict.fromkeys(names)),
        mechanism=", ".join(mechanisms),
        reference=chosen or _of_first_file(list(nodes)),
        attrs={name.replace("/", "-"): value for name, value in attrs.items()},
    )
    with output_folder(out, ["comparison.nc", "report.html"]):
        print(f"results  {save(tree, out / 'comparison.nc')}")
        print(f"report   {write(tree, out / 'report.html')}")
