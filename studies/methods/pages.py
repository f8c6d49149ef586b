"""Tables of the page on the choice of a method, written between markers of the page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from .cases import CLASSES, HELD_OUT, class_of
from .recommendations import ACCURACIES, Recommendation
from .regret import Regret, before_runs, costs_of, moments, regrets
from .runs import Row

__all__ = ["store_page"]

NAMES = {"collocation": "chaos", "monte-carlo": "Sobol' points"}
"""Names of the recommended methods on the page."""
HEADER = (
    "rules", "mechanisms", "tasks", "accuracy reached", "median regret", "90 % quantile of the regret",
    "regret below 3", "median at 10 % (tasks)", "at 1 %", "at 0.1 %", "errors above twice the accuracy",
)  # fmt: skip


def store_page(rows: Sequence[Row], recommended: Sequence[Recommendation], page: Path) -> None:
    """Write the tables between the markers ``<!-- NAME -->`` and ``<!-- end -->`` of the page."""
    text = page.read_text(encoding="utf-8")
    tables = {
        "mechanisms": mechanisms(rows),
        "best": best(rows, recommended),
        "regrets": regret_table(rows, recommended),
    }
    for name, table in tables.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        if not re.search(pattern, text, re.DOTALL):
            raise ValueError(f"{page} has no markers <!-- {name} --> and <!-- end -->")
        text = re.sub(pattern, rf"\g<1>{table}\g<2>", text, flags=re.DOTALL)
    page.write_text(text, encoding="utf-8")


def mechanisms(rows: Sequence[Row]) -> str:
    """Return the measured mechanisms by class."""
    kinds = {row.mechanism: row.kind for row in rows}
    own = {title: [name for name, kind in kinds.items() if class_of(kind) == title] for title in CLASSES}
    return markdown(("class", "mechanisms"), [(title, "; ".join(names)) for title, names in own.items() if names])


def best(rows: Sequence[Row], recommended: Sequence[Recommendation], accuracy: float = 0.01) -> str:
    """Return the best and the recommended method of each mechanism for an accuracy."""
    costs = costs_of(rows)
    now = {one.mechanism: one for one in recommended if one.rules == "now" and one.accuracy == accuracy}
    cells = []
    for mechanism in dict.fromkeys(row.mechanism for row in rows):
        found = min(moments(costs, mechanism, accuracy).values(), key=lambda b: b.realisations, default=None)
        one = now.get(mechanism)
        name = "" if one is None else NAMES.get(one.method, one.method) or "none"
        if one is not None and one.method and one.stated > accuracy:
            name += " (1 % not reached)"
        cells.append(
            [
                mechanism,
                f"`{found.method}`, {found.size}" if found else "none",
                found.realisations if found else "",
                name,
                one.realisations if one is not None and one.method else "",
            ]
        )
    title = f"best for {accuracy:.0%} in hindsight".replace("%", " %")
    return markdown(("mechanism", title, "realisations", "recommended", "realisations"), cells)


def regret_table(rows: Sequence[Row], recommended: Sequence[Recommendation]) -> str:
    """Return regrets of the rules, of mechanisms with which they were chosen and of those that were held out."""
    found = regrets(rows, recommended)
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
        "choice before a run": before,
        "choice before a run, other mechanisms": [one for one in before if one.mechanism in HELD_OUT],
    }
    return markdown(HEADER, [line(title, own) for title, own in groups.items() if own])


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
