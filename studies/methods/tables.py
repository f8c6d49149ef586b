"""Tables and figures of the comparison, for the page on the choice of a method.

``python -m studies.methods --store`` writes them from the stored rows: ``docs/explanation/methods.nc`` has the least
cost of each method for each task, ``docs/explanation/methods.csv`` the best method and the recommendations, and
``docs/pictures/methods_KIND.png`` error against cost for each class of mechanisms.  ``docs/_static/choose_method.svg``
is the decision diagram.  Without stored rows, the recommendations replace those of the stored table, and its best
methods remain.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .cases import CLASSES, HERE, class_of
from .diagram import diagram
from .pages import best_realisations, store_page
from .recommendations import ACCURACIES, RULES, Recommendation
from .regret import Regret, costs_of, moments, regrets
from .runs import Row

__all__ = ["best_table", "cost_table", "draw", "revised_table", "store_tables"]

DOCS = HERE.parents[1] / "docs"
DRAWN = {
    "Monte Carlo": "#666666",
    "Monte Carlo, sobol": "#0072b2",
    "Monte Carlo, latin-hypercube": "#56b4e9",
    "Collocation": "#d55e00",
    "Collocation, alignment=auto": "#cc79a7",
    "Collocation, smolyak": "#e69f00",
    "Collocation, adaptive=dimension": "#009e73",
    "Collocation, elements": "#b8a000",
    "Galerkin": "#000000",
}
"""Methods in the figures, with their colours."""


def cost_table(rows: Sequence[Row]) -> xr.Dataset:
    """Return the least realisations and processor time of each method that reach an accuracy; NaN: none does."""
    costs = costs_of(rows)
    mechanisms = list(dict.fromkeys(row.mechanism for row in rows))
    kinds = {row.mechanism: row.kind for row in rows}
    questions = list(dict.fromkeys(row.question for row in rows if row.question))
    methods = list(dict.fromkeys(row.method for row in rows))
    axes: dict[str, Sequence[object]] = {
        "mechanism": mechanisms,
        "question": questions,
        "accuracy": list(ACCURACIES),
        "method": methods,
    }
    shape = [len(values) for values in axes.values()]
    found = {name: np.full(shape, np.nan, dtype=np.float32) for name in ("realisations", "seconds", "error")}
    for (mechanism, question, accuracy), own in costs.items():
        for method, best in own.items():
            where = (
                mechanisms.index(mechanism), questions.index(question), ACCURACIES.index(accuracy),
                methods.index(method),
            )  # fmt: skip
            for name, values in found.items():
                values[where] = getattr(best, name)
    data = xr.Dataset({name: (tuple(axes), values) for name, values in found.items()}, axes)
    data["seconds"].attrs = {"units": "s", "long_name": "processor time"}
    data["error"].attrs = {"long_name": "largest true error of the least costly size"}
    return data.assign_coords(kind=("mechanism", [kinds[name] for name in mechanisms]))


def best_table(rows: Sequence[Row], recommended: Sequence[Recommendation]) -> list[dict[str, object]]:
    """Return one row for each mechanism, accuracy and rule: the best method and the recommended one."""
    costs, found = costs_of(rows), []
    for one, own in zip(recommended, regrets(rows, recommended), strict=True):
        best = min(moments(costs, one.mechanism, one.accuracy).values(), key=lambda b: b.realisations, default=None)
        found.append(_entry(one, own, best.realisations if best else ""))
    return found


def revised_table(recommended: Sequence[Recommendation], path: Path) -> list[dict[str, object]]:
    """Return the stored table with recommendations in place of those for the same task and rules.

    The best methods are those of the table: this needs no rows of errors.  A recommendation without a stored best
    method has no regret.
    """
    with path.open(newline="", encoding="utf-8") as file:
        table: list[dict[str, object]] = [{str(key): x for key, x in row.items()} for row in csv.DictReader(file)]
    where = {_task(str(one["mechanism"]), float(str(one["accuracy"])), one["rules"]): k for k, one in enumerate(table)}
    for one in recommended:
        task = _task(one.mechanism, one.accuracy, one.rules)
        known = table[where[task]] if task in where else {"best": "", "best_realisations": ""}
        least, title = best_realisations(known), str(known["best"])
        if one.least and (not least or one.least < least):
            least, title = one.least, "a method of the run"
        ratio = one.realisations / least if least and one.method else np.nan
        regret = Regret(
            one.mechanism, one.kind, one.accuracy, one.rules, one.method, title, ratio, one.error,
            one.stated <= one.accuracy,
        )  # fmt: skip
        made = _entry(one, regret, known["best_realisations"])
        if task in where:
            table[where[task]] = made
        else:
            table.append(made)
    return table


def _task(mechanism: str, accuracy: float, rules: object) -> tuple[str, str, object]:
    return mechanism, f"{accuracy:g}", rules


def _entry(one: Recommendation, own: Regret, best_realisations: object) -> dict[str, object]:
    """Return a row of the table of recommendations."""
    return {
        "mechanism": one.mechanism, "kind": one.kind, "accuracy": one.accuracy, "rules": one.rules,
        "best": own.best, "best_realisations": best_realisations,
        "recommended": one.method or "none", "reached": "yes" if own.reached else "no",
        "realisations": one.realisations, "stated": f"{one.stated:.2g}", "error": f"{one.error:.2g}",
        "regret": f"{own.regret:.3g}",
    }  # fmt: skip


def draw(rows: Sequence[Row], name: str) -> Figure:
    """Return error of the standard deviation against realisations, a panel for each mechanism of a class."""
    of_class = [row for row in rows if row.question == "std" and not row.failure and class_of(row.kind) == name]
    mechanisms = list(dict.fromkeys(row.mechanism for row in of_class))
    width = min(len(mechanisms), 4)
    height = -(-len(mechanisms) // width)
    figure, axes = plt.subplots(
        height, width, figsize=(2.6 * width, 2.2 * height + 0.6), sharex=True, sharey=True, squeeze=False
    )
    for axis in axes.ravel()[len(mechanisms) :]:
        axis.set_visible(False)
    for axis, mechanism in zip(axes.ravel(), mechanisms, strict=False):
        for method, colour in DRAWN.items():
            sizes: dict[str, list[Row]] = defaultdict(list)
            for row in of_class:
                if (row.mechanism, row.method) == (mechanism, method) and np.isfinite(row.error):
                    sizes[row.size].append(row)
            points = sorted(
                (np.mean([r.realisations for r in own]), max(r.error for r in own)) for own in sizes.values()
            )
            if points:
                axis.loglog(*zip(*points, strict=True), ".-", color=colour, label=method, lw=1, ms=4)
        axis.set_title(mechanism, fontsize=8)
        axis.set_ylim(1e-6, 2)
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=7)
    figure.supxlabel("realisations", fontsize=8)
    figure.supylabel("largest error of the standard deviation / its maximum", fontsize=8)
    entries = dict(zip(*reversed([list(x) for x in _legend(axes)]), strict=True))
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=3, fontsize=7)
    figure.set_layout_engine("constrained")
    return figure


def _legend(axes: np.ndarray) -> tuple[list[object], list[str]]:
    """Return handles and labels of all panels."""
    found = [axis.get_legend_handles_labels() for axis in axes.ravel()]
    return [h for handles, _ in found for h in handles], [x for _, labels in found for x in labels]


def store_tables(rows: Sequence[Row], recommended: Sequence[Recommendation], docs: Path = DOCS) -> None:
    """Write the tables and figures of the pages; without rows, only the table of recommendations and the page."""
    path, own = docs / "explanation" / "methods.csv", [one for one in recommended if one.rules in RULES]
    table = best_table(rows, own) if rows else revised_table(own, path)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    store_page(rows, table, docs / "how-to" / "choose_method.md")
    if not rows:
        return
    data = cost_table(rows)
    encoding = {name: {"zlib": True, "complevel": 9} for name in data.data_vars}
    data.to_netcdf(docs / "explanation" / "methods.nc", encoding=encoding)
    (docs / "_static" / "choose_method.svg").write_text(diagram(data), encoding="utf-8")
    for name in CLASSES:
        if any(class_of(row.kind) == name for row in rows):
            figure = draw(rows, name)
            figure.savefig(docs / "pictures" / f"methods_{name.replace(' ', '_')}.png", dpi=90)
            plt.close(figure)
