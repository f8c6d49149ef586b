"""The report's sections on which inputs matter and on how far surrogates can be trusted."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.drawing import image
from uqmbd.report.figures import (
    OF_GERMS,
    Indices,
    chaos_nodes,
    chaos_of,
    elements_in_words,
    finest,
    has_elements,
    has_indices,
    horizon,
    indices_of,
    label_of,
    node_with_indices,
    order_of,
    orders_of,
    series,
    stated_error_of,
    surrogate_nodes,
    surrogate_of,
)
from uqmbd.report.sections.outputs import most_uncertain
from uqmbd.results import statements, varies
from uqmbd.results.chaos import Discontinuity
from uqmbd.results.comparison import STILL
from uqmbd.wording import format_count, format_integer

__all__ = ["influence", "trust"]

_MINOR = 0.01
_VERIFIED = 3


def influence(nodes: Mapping[str, xr.DataTree]) -> dict[str, Any] | None:
    """Return what the section on influence says and shows; None if no method knows."""
    if not any(has_indices(node) for node in nodes.values()):
        return None
    node = node_with_indices(nodes)
    label = label_of(node)
    found = {name: indices_of(node, name) for name in _outputs(node)}
    varying = {name: one for name, one in found.items() if one.meaningful.any()}
    if not varying:
        return {"words": [f"No output has a spread to share: each {STILL}."], "rows": [], "figures": [], "outputs": []}
    first = next(iter(varying.values()))
    kind = "germ" if first.of_germs else "input"
    words = []
    if len(nodes) > 1:
        words.append(f"These are Sobol' indices of {label}.")
    if first.of_germs:
        words.append(
            "The inputs depend on one another, so that no share of the variance belongs to an input alone. The shares "
            f"are those of independent germs, in the order in which the inputs were declared: {OF_GERMS}."
        )
    if len(first.names) == 1:
        words.append(f"There is one input, {first.names[0]}: all variance comes from it.")
        return {"words": words, "rows": [], "figures": [], "outputs": list(varying), "kind": kind}
    shares = {name: one.weighted for name, one in varying.items()}
    minor = [n for k, n in enumerate(first.names) if all(total[k] < _MINOR for _, total in shares.values())]
    if minor:
        words.append(f"Taking part in less than 1 % of the variance of every output: {', '.join(minor)}.")
    rows = [
        {"name": name, "cells": [f"{_share(total[k])} ({_share(alone[k])})" for alone, total in shares.values()]}
        for k, name in enumerate(first.names)
    ]
    shown = most_uncertain(nodes, list(varying))
    drawn = [
        image(
            functools.partial(figures.sobol_indices, node, name),
            f"Sobol' indices of {name} over time, and its standard deviation. {_in_words(name, one)}",
            _in_words(name, one),
            f"{name}-sobol-indices",
        )
        for name, one in varying.items()
        if name in shown
    ]
    if len(drawn) < len(varying):
        words.append(f"Figures are those of the {len(drawn)} most uncertain outputs; the table is that of all.")
    return {"words": words, "kind": kind, "outputs": list(varying), "rows": rows, "figures": drawn}


def _in_words(name: str, one: Indices) -> str:
    """Say which inputs take part in most of the variance."""
    _, total = one.weighted
    ranked = sorted(range(len(total)), key=lambda k: -total[k])
    largest = [k for k in ranked[:3] if total[k] >= _MINOR] or ranked[:1]
    parts = [
        f"{one.names[k]} takes part in {_share(total[k])} of the variance of {name}"
        if not n
        else f"{one.names[k]} in {_share(total[k])}"
        for n, k in enumerate(largest)
    ]
    return f"Averaged over time, {', '.join(parts)}."


def _share(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{100 * value:.0f} %" if value >= 0.0995 else (f"{100 * value:.1f} %" if value >= 0.0005 else "0 %")


def trust(nodes: Mapping[str, xr.DataTree], tree: xr.DataTree | None = None) -> dict[str, Any] | None:
    """Return what the section on the errors of surrogates says and shows; None if no method holds a surrogate.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Methods by label.
    tree : xarray.DataTree, optional
        The result of the study, whose comparison has a statement on each output of each method.
    """
    holders = surrogate_nodes(nodes)
    if not holders:
        return None
    groups = series(holders)
    best = {members[-1]: holders[members[-1]] for members in groups.values()}
    said = statements(xr.DataTree() if tree is None else tree, nodes)
    rows = [row for label, node in holders.items() for row in _rows(label, node)]
    order = {name: k for k, name in enumerate(dict.fromkeys(row["output"] for row in rows))}
    rows.sort(key=lambda row: order[row["output"]])
    last = holders[finest(holders)]
    stating = [label for label, node in best.items() if stated_error_of(node) is not None]
    stating.sort(key=lambda label: -order_of(best[label]))
    names = [name for name in _outputs(last) if varies(last, name)]
    shown = most_uncertain(nodes, names)
    several = max(len({order_of(nodes[m]) for m in members}) for members in groups.values()) > 2
    return {
        "methods": [_verdicts(label, node, said) for label, node in best.items()],
        "rows": rows,
        "stated": any(stated_error_of(node) is not None for node in holders.values()),
        "left_out": any(row["left_out"] != "–" for row in rows),
        "figures": [
            *(_verification(label, best[label], said) for label in stating[:_VERIFIED]),
            *(_elements(node) for node in best.values() if has_elements(node)),
        ],
        "outputs": [_of_output(nodes, name, several) for name in shown],
        "note": f"Figures are those of the {len(shown)} most uncertain outputs." if len(shown) < len(names) else "",
    }


def _outputs(node: xr.DataTree) -> list[str]:
    return [str(name) for name in node.children["statistics"].coords["output"].values]


def _stored(node: xr.DataTree) -> xr.DataTree:
    return node.children["chaos" if "chaos" in node.children else "aligned"]


def _verdicts(label: str, node: xr.DataTree, said: Mapping[tuple[str, str], str]) -> dict[str, Any]:
    sizes = _stored(node).sizes
    what = f"order {order_of(node)}, {format_count(sizes['term'], 'term')}"
    if sizes.get("element", 1) > 1:
        what += f" in each of {sizes['element']} elements"
    what += f", {node.attrs['fit']}" if node.attrs.get("fit") else ""
    try:
        seen: tuple[Discontinuity | None, ...] = getattr(surrogate_of(node), "discontinuities", tuple)()
        words = {one.output: f". {one.words()}" for one in seen if one is not None and varies(node, one.output)}
        found = [f"{name}: {said[label, name]}{words.get(name, '')}" for name in _outputs(node)]
        return {"label": label, "what": what, "problem": "", "verdicts": found}
    except Exception as error:  # noqa: BLE001 - a chaos of another package may lack anything; the rest must stand
        problem = f"The chaos of {label} cannot be read: {type(error).__name__}: {error}"
        return {"label": label, "what": what, "problem": problem, "verdicts": ()}


def _rows(label: str, node: xr.DataTree) -> list[dict[str, str]]:
    """Return the table of a method: for each output its order, cost and errors."""
    statistics = node.children["statistics"].to_dataset()
    stated = stated_error_of(node)
    left_out = statistics.get("leave_one_out")
    gains = _gains(node, statistics)
    rows = []
    for k, name in enumerate(_outputs(node)):
        row = {
            "output": name,
            "method": label,
            "order": str(order_of(node)),
            "terms": format_integer(_stored(node).sizes["term"]),
            "realisations": format_integer(int(node.attrs.get("realisations", 0))),
            "error": "–",
            "horizon": "–",
            "left_out": "–",
            "gain": gains[k],
        }
        if not varies(node, name):
            row |= {"error": "no spread", "horizon": "never", "gain": "–"}
        elif stated is not None:
            error = stated.values[k]
            first = horizon(stated["time"].values, error)
            row["error"] = _error(float(np.nanmax(error)))
            row["horizon"] = "never" if first is None else f"{first:.4g} s"
        if left_out is not None and varies(node, name):
            row["left_out"] = _error(math.sqrt(max(float(np.max(left_out.values[k])), 0.0)))
        rows.append(row)
    return rows


def _error(value: float) -> str:
    if not math.isfinite(value):
        return "cannot be told"
    if value < 1e-6:
        return "below 0.0001 %"
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:.0f} %"


def _gains(node: xr.DataTree, statistics: xr.Dataset) -> list[str]:
    """Say by how much each order divides what is missing, at the time of the largest standard deviation."""
    names = _outputs(node)
    try:
        rate = chaos_of(node).decay()["rate"].values
    except Exception:  # noqa: BLE001 - said where the verdicts are
        return ["–"] * len(names)
    places = np.nan_to_num(statistics["std"].values, nan=-1.0).argmax(axis=-1)
    decades = [float(rate[k, place]) for k, place in enumerate(places)]
    return [f"÷ {_short(10**d)}" if math.isfinite(d) and -1 < d < 4 else "–" for d in decades]


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def _verification(label: str, node: xr.DataTree, said: Mapping[tuple[str, str], str]) -> dict[str, str]:
    count = _stored(node).sizes.get("verification", 0)
    where = format_count(count, "realisation") if count else "realisations"
    return image(
        functools.partial(figures.verification, node),
        f"Stated error of the surrogate of {label} over time, for each output. "
        + "; ".join(_verdicts(label, node, said)["verdicts"]),
        f"What {label} states of its own error: at {where} that did not enter the surrogate, relative to the standard "
        "deviation. A dot marks where the limit of 1 % is passed for the first time.",
        f"{label}-stated-error",
    )


def _elements(node: xr.DataTree) -> dict[str, str]:
    words = elements_in_words(node)
    return image(
        functools.partial(figures.split_pattern, node),
        f"The elements in the plane of the inputs that were split most, or along the only one. {words}",
        f"{words} Small elements lie where the response has a kink or a jump.",
        f"{label_of(node)}-elements",
    )


def _of_output(nodes: Mapping[str, xr.DataTree], name: str, several: bool) -> dict[str, Any]:
    drawn = []
    if chaos_nodes(nodes):
        drawn.append(
            image(
                functools.partial(figures.coefficient_decay, nodes, name),
                f"Part of the standard deviation of {name} that the polynomials of each order carry.",
                "Whether the order suffices: the part of the spread in the polynomials of each total order (left), and "
                "of each degree in each input (right). It should fall from order to order, and end well below 1 %.",
                f"{name}-coefficient-decay",
            )
        )
    words: list[str] = []
    if several:
        words = _convergence_words(nodes, name)
        drawn.append(
            image(
                functools.partial(figures.order_convergence, nodes, name),
                f"Difference of mean and standard deviation of {name} to a reference, against the order and the number "
                "of realisations. " + " ".join(words),
                "How the error falls with the order, and with what it costs: the largest difference over time to the "
                "surrogate of the highest order. Exponential convergence is a straight line on the left; a floor that "
                "no order lowers is the accuracy of the time integration.",
                f"{name}-orders",
            )
        )
    return {"name": name, "words": words, "figures": drawn}


def _convergence_words(nodes: Mapping[str, xr.DataTree], name: str) -> list[str]:
    try:
        reference, found = orders_of(nodes, name)
    except Exception:  # noqa: BLE001 - said where the figure would be
        return []
    words = []
    for row in found:
        if len(row.orders) < 2 or not row.std[0] > 0:
            continue
        goes = "falls" if row.std[-1] < row.std[0] else "goes"
        words.append(
            f"From order {row.orders[0]} ({format_count(int(row.realisations[0]), 'realisation')}) to order "
            f"{row.orders[-1]} ({row.realisations[-1]}) of {row.name}, the difference of the standard deviation to "
            f"that of {reference} {goes} from {_error(float(row.std[0]))} to {_error(float(row.std[-1]))} of its "
            "maximum."
        )
    return words
