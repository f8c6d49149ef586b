"""Compare all methods on all mechanisms: ``python -m studies.methods [--quick]``.

Rows go to ``errors.csv`` and ``recommendations.csv`` in the folder of ``--out``.  An interrupted comparison continues:
neither the errors of a mechanism nor a recommendation is computed again.  The whole takes some hours, ``--quick`` about
ten minutes.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .cases import CASES, QUICK, console, table_of
from .recommendations import ACCURACIES, RULES, Recommendation, recommendation_of
from .regret import best_methods, regrets
from .runs import Row, rows_of
from .tables import store_tables
from .truths import load_truth

Record = TypeVar("Record", Row, Recommendation)


def stored(path: Path, kind: type[Record]) -> list[Record]:
    """Read the rows of a file."""
    if not path.exists():
        return []
    types: dict[str, Any] = {one.name: {"str": str, "int": int, "float": float}[str(one.type)] for one in fields(kind)}
    with path.open(newline="", encoding="utf-8") as file:
        return [kind(**{name: types[name](value) for name, value in row.items()}) for row in csv.DictReader(file)]


def append(path: Path, rows: Iterable[Record], kind: type[Record]) -> None:
    """Add rows to a file; numbers have four digits."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow([one.name for one in fields(kind)])
        for row in rows:
            writer.writerow([f"{x:.4g}" if isinstance(x, float) else x for x in astuple(row)])


def all_rows(mechanism: str, most_seconds: float) -> list[Row]:
    """Return the rows of a mechanism."""
    return list(rows_of(mechanism, most_seconds=most_seconds))


def title(task: Any) -> str:
    """Return the name of a mechanism, or of a mechanism with an accuracy and rules."""
    return task if isinstance(task, str) else f"{task[0]}, {task[1]:g}, rules: {task[2]}"


def executor(workers: int, dask: str | None) -> Executor:
    """Return who computes: processes, or the workers of a Dask cluster."""
    if dask:
        from distributed import Client

        return Client(dask).get_executor()
    return ProcessPoolExecutor(workers)


def computed(pool: Executor, tasks: Iterable[Any], function: Any, *given: Any) -> Iterator[tuple[str, Any]]:
    """Yield the result of each task as soon as it is ready; failed tasks are reported and left for the next run."""
    running = {
        pool.submit(function, *((task,) if isinstance(task, str) else task), *given): title(task) for task in tasks
    }
    for future in as_completed(running):
        try:
            yield running[future], future.result()
        except Exception as raised:  # one mechanism must not end the comparison of the others
            print(f"{running[future]}: {type(raised).__name__}: {raised}", file=sys.stderr, flush=True)


def show(rows: list[Row], recommended: list[Recommendation]) -> None:
    """Print the best method of each task, and the regret of the recommendations."""
    table = table_of(
        "Fewest realisations for an error", "mechanism", "question", "accuracy", "method", "realisations", "s"
    )
    for best in best_methods(rows):
        table.add_row(
            best.mechanism, best.question, f"{best.accuracy:g}", f"{best.method}, {best.size}",
            str(best.realisations), f"{best.seconds:.2g}",
        )  # fmt: skip
    console.print(table)
    titles = "mechanism", "accuracy", "rules", "recommended", "best", "regret", "error"
    table = table_of("Recommended methods", *titles)
    found = regrets(rows, recommended)
    for one in found:
        text = one.method if one.reached else f"{one.method} (accuracy not reached)" if one.method else "none"
        table.add_row(
            one.mechanism, f"{one.accuracy:g}", one.rules, text, one.best, f"{one.regret:.2f}", f"{one.error:.2g}"
        )
    console.print(table)
    for rules in RULES:
        own = [one for one in found if one.rules == rules]
        ratios = np.array([one.regret for one in own if np.isfinite(one.regret) and one.reached])
        if len(ratios):
            wrong = sum(one.error > 2 * one.accuracy for one in own if one.reached)
            print(
                f"{rules}: {len(own)} tasks, {len(ratios)} with a method that states the accuracy; regret: median "
                f"{np.median(ratios):.2f}, nine of ten below {np.quantile(ratios, 0.9):.2f}; {wrong} have more than "
                "twice the wanted error"
            )


def main() -> None:
    """Compute what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], prog="python -m studies.methods")
    parser.add_argument("--quick", action="store_true", help="six mechanisms, at most 2 s for each run")
    parser.add_argument("--only", nargs="*", choices=CASES, help="mechanisms")
    parser.add_argument(
        "--seconds", type=float, help="processor time, s, of a run after which larger sizes of its method are left out"
    )
    parser.add_argument("--rules", nargs="*", choices=RULES, default=list(RULES), help="rules of recommendation")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    parser.add_argument("--dask", metavar="ADDRESS", help="address of a Dask scheduler whose workers compute")
    parser.add_argument("--out", type=Path, default=Path("methods"), help="folder of the tables")
    parser.add_argument("--table", action="store_true", help="print the stored tables only")
    parser.add_argument("--store", action="store_true", help="write tables and figures of the documentation only")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    errors, advised = given.out / "errors.csv", given.out / "recommendations.csv"
    names = given.only or (QUICK if given.quick else tuple(CASES))
    if given.store:
        store_tables(stored(errors, Row), stored(advised, Recommendation))
        return
    if not given.table:
        with executor(given.workers, given.dask) as pool:
            for name, _ in computed(pool, names, load_truth):
                print(f"{name}: reference", flush=True)
            known = {row.mechanism for row in stored(errors, Row)}
            most = given.seconds or (2.0 if given.quick else 60.0)
            for name, rows in computed(pool, [n for n in names if n not in known], all_rows, most):
                append(errors, rows, Row)
                print(f"{name}: {len(rows)} rows", flush=True)
            done = {(row.mechanism, row.accuracy, row.rules) for row in stored(advised, Recommendation)}
            tasks = [task for task in itertools.product(names, ACCURACIES, given.rules) if task not in done]
            for name, found in computed(pool, sorted(tasks, key=lambda task: -task[1]), recommendation_of):
                append(advised, [found], Recommendation)
                print(f"{name}: {found.method or found.failure}", flush=True)
    show(stored(errors, Row), stored(advised, Recommendation))


if __name__ == "__main__":
    main()
