"""Tables of the page on the choice of a method, written between markers of the page."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from .cases import CLASSES, HELD_OUT, class_of
from .recommendations import ACCURACIES
from .regret import Regret, before_runs
from .runs import Row

__all__ = ["best_realisations", "store_page"]

NAMES = {"collocation": "chaos", "monte-carlo": "Sobol' points", "sparse-grid": "sparse grid"}
"""Names of the recommended methods on the page."""
HEADER = (
    "rules", "mechanisms", "tasks", "accuracy reached", "median regret", "90 % quantile of the regret",
    "regret below 3", "median at 10 % (tasks)", "at 1 %", "at 0.1 %", "errors above twice the accuracy",
)  # fmt: skip


BEFORE = "choice before a run"
"""Beginning of the lines of the table of regrets that need rows."""


def store_page(rows: Sequence[Row], table: Sequence[Mapping[str, object]], page: Path) -> None:
    """Write the tables between the markers ``<!-- NAME -->`` and ``<!-- end -->`` of the page.

    `table` is that of the best and recommended methods.  Without `rows`, parts that need them remain.
    """
    text = page.read_text(encoding="utf-8")
    earlier = "".join(found + "\n" for found in re.findall(rf"^\| {BEFORE}.*$", text, re.MULTILINE))
    known = {str(one["mechanism"]) for one in table if float(str(one["accuracy"])) == ACCURACIES[1]}
    unrun = [x for x in re.findall(r"^\| .*\|  \|  \|$", text, re.MULTILINE) if x.split(" | ")[0][2:] not in known]
    tables = {
        "best": best(table) + ("" if rows else "".join(found + "\n" for found in unrun)),
        "regrets": regret_table(rows, table) + ("" if rows else earlier),
        "causes": causes(table),
    }
    if rows:
        tables["mechanisms"] = mechanisms(rows)
    for name, made in tables.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        if not re.search(pattern, text, re.DOTALL):
            raise ValueError(f"{page} has no markers <!-- {name} --> and <!-- end -->")
        text = re.sub(pattern, rf"\g<1>{made}\g<2>", text, flags=re.DOTALL)
    page.write_text(text, encoding="utf-8")


def mechanisms(rows: Sequence[Row]) -> str:
    """Return the measured mechanisms by class."""
    kinds = {row.mechanism: row.kind for row in rows}
    own = {title: [name for name, kind in kinds.items() if class_of(kind) == title] for title in CLASSES}
    return markdown(("class", "mechanisms"), [(title, "; ".join(names)) for title, names in own.items() if names])


def best(table: Sequence[Mapping[str, object]], accuracy: float = 0.01) -> str:
    """Return the best and the recommended method of each mechanism for an accuracy."""
    cells = []
    for one in table:
        if one["rules"] != "now" or float(str(one["accuracy"])) != accuracy:
            continue
        method, _, size = str(one["best"]).rpartition(", ")
        name, least = NAMES.get(str(one["recommended"]), str(one["recommended"])), best_realisations(one)
        if one["reached"] != "yes":
            name += " (1 % not reached)"
        found = f"`{method}`, {size}" if method else one["best"] or "none"
        cells.append([one["mechanism"], found, least or "", name, one["realisations"]])
    title = f"best for {accuracy:.0%} in hindsight".replace("%", " %")
    return markdown(("mechanism", title, "realisations", "recommended", "realisations"), cells)


def best_realisations(one: Mapping[str, object]) -> int:
    """Return the fewest realisations of a task, also of a method of the run; 0: no method reaches the accuracy."""
    regret = float(str(one["regret"] or "nan"))
    if one["best"] == "a method of the run" and math.isfinite(regret):
        return round(int(str(one["realisations"])) / regret)
    return int(str(one["best_realisations"] or 0))


def entries(table: Sequence[Mapping[str, object]]) -> list[Regret]:
    """Return the regrets of a table."""
    return [
        Regret(
            str(one["mechanism"]), str(one["kind"]), float(str(one["accuracy"])), str(one["rules"]),
            "" if one["recommended"] == "none" else str(one["recommended"]), str(one["best"]),
            float(str(one["regret"])), float(str(one["error"])), one["reached"] == "yes",
        )
        for one in table
    ]  # fmt: skip


def regret_table(rows: Sequence[Row], table: Sequence[Mapping[str, object]]) -> str:
    """Return regrets of the rules, of mechanisms with which they were chosen and of those that were held out."""
    found = entries(table)
    now, limits = ([one for one in found if one.rules == rules] for rules in ("now", "limits"))
    tasks = {(one.mechanism, one.accuracy) for one in limits}
    before = before_runs(rows, {one.mechanism: one.kind for one in rows})
    both = [one for one in now if (one.mechanism, one.accuracy) in tasks]
    groups = {
        "present rules, all mechanisms": now,
        "mechanisms with which the rules were chosen": [one for one in now if one.mechanism not in HELD_OUT],
        "other mechanisms": [one for one in now if one.mechanism in HELD_OUT],
        "present rules, tasks of the former rules": both,
        "former rules": limits,
        BEFORE: before,
        f"{BEFORE}, other mechanisms": [one for one in before if one.mechanism in HELD_OUT],
    }
    return markdown(HEADER, [line(title, own) for title, own in groups.items() if own])


def causes(table: Sequence[Mapping[str, object]], least: float = 3.0) -> str:
    """Return the tasks with a large regret, by the recommended method and the accuracy of the best one."""
    cells = [
        [
            one["mechanism"], f"{100 * float(str(one['accuracy'])):g} %",
            NAMES.get(str(one["recommended"]), str(one["recommended"])), one["realisations"],
            f"{100 * float(str(one['stated'])):.2g} %", f"{100 * float(str(one['error'])):.2g} %",
            one["best"], one["best_realisations"], f"{float(str(one['regret'])):.1f}",
        ]
        for one in table
        if one["rules"] == "now" and float(str(one["regret"])) > least
    ]  # fmt: skip
    titles = (
        "mechanism", "accuracy", "recommended", "realisations", "stated error", "true error",
        "best in hindsight", "realisations", "regret",
    )  # fmt: skip
    return markdown(titles, cells)


def line(title: str, own: Sequence[Regret]) -> list[object]:
    """Return a line of the table of regrets."""
    reached = [one for one in own if one.reached and np.isfinite(one.regret)]
    ratios = np.array([one.regret for one in reached])
    by = [[one.regret for one in reached if one.accuracy == accuracy] for accuracy in ACCURACIES]
    return [
        title,
        len({one.mechanism for one in own}),
        len(own),
        sum(one.reached for one in own),
        f"{np.median(ratios):.2f}" if len(ratios) else "",
        f"{np.quantile(ratios, 0.9):.1f}" if len(ratios) else "",
        f"{np.mean(ratios < 3):.0%}".replace("%", " %") if len(ratios) else "",
        *(f"{np.median(each):.2g} ({len(each)})" if each else "" for each in by),
        sum(one.error > 2 * one.accuracy for one in own if one.method),
    ]


def markdown(titles: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    rows = [titles, ["---"] * len(titles), *lines]
    return "".join("| " + " | ".join(str(x) for x in row) + " |\n" for row in rows)
