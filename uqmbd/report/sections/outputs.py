"""The report's section on outputs over time: figures, words and numbers of each, the most uncertain ones in full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.drawing import image
from uqmbd.report.figures import design_of, shown_methods, surrogate_nodes
from uqmbd.report.sections import summary as content
from uqmbd.results import choose_reference, varies
from uqmbd.results.comparison import STILL
from uqmbd.wording import format_count

__all__ = ["FULL", "most_uncertain", "outputs"]

DENSITIES = 6
"""Most methods whose densities are drawn in one figure."""

FULL = 6
"""Outputs of which all figures are drawn; of those beyond, the bands, folded.  A browser takes some 15 ms an image."""


def outputs(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> dict[str, Any]:
    """Return what the section says and shows.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    nodes : mapping of str to xarray.DataTree
        Its methods.

    Returns
    -------
    dict
        ``outputs``, in the order of the study or, of more than :data:`FULL`, the most uncertain first; ``note``: what
        is not drawn, or empty.
    """
    names = content.output_names(nodes)
    full = most_uncertain(nodes)
    found = [_output(tree, nodes, name, name in full) for name in sorted(names, key=lambda n: n not in full)]
    if len(full) == len(names):
        return {"outputs": found, "note": ""}
    found.sort(key=lambda one: full.index(one["name"]) if one["name"] in full else len(full))
    return {
        "outputs": found,
        "note": f"Of {format_count(len(names), 'output')}, the {len(full)} most uncertain ones (largest standard "
        f"deviation as a share of the largest mean) come first and have all figures, here and in the sections below. "
        f"The other {len(names) - len(full)} are folded, with their bands and numbers; the functions of "
        "uqmbd.report draw everything of any output.",
    }


def most_uncertain(nodes: Mapping[str, xr.DataTree], names: Sequence[str] | None = None, most: int = FULL) -> list[str]:
    """Return the names of the outputs that are shown in full: all of a few, of many the most uncertain ones.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
    names : sequence of str, optional
        Among which; default: all outputs over time.
    most : int

    Returns
    -------
    list of str
        In the order of ``names`` if these are all, else the most uncertain first: by the largest standard deviation
        over time, over the largest mean.
    """
    known = list(content.output_names(nodes) if names is None else names)
    if len(known) <= most:
        return known
    return sorted(known, key=lambda name: -_uncertainty(nodes, name))[:most]


def _uncertainty(nodes: Mapping[str, xr.DataTree], name: str) -> float:
    node = next(node for node in nodes.values() if content.has_output(node, name))
    data = node.children["statistics"].to_dataset()
    data = data.isel(output=[str(n) for n in data["output"].values].index(name))
    std, mean = (float(np.nan_to_num(np.abs(data[key].values)).max(initial=0.0)) for key in ("std", "mean"))
    if not varies(node, name):
        return 0.0
    return std / mean if mean > 0 else (np.inf if std > 0 else 0.0)


def _output(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree], name: str, whole: bool) -> dict[str, Any]:
    """Return the figures, words and numbers of an output: all of them, or the most important."""
    every = {label: node for label, node in nodes.items() if content.has_output(node, name)}
    holders = shown_methods(every)
    lower = " Of a surrogate with several orders, only the highest is drawn." if len(holders) < len(every) else ""
    first = next(iter(holders.values()))
    varying = any(varies(node, name) for node in holders.values())
    drawn = [
        image(
            lambda: figures.bands(holders, name),
            f"Mean of {name} over time, with the bands that hold 50 % and 95 % of the realisations. "
            + content.in_words(first, name),
            "How it moves: the mean, and the bands in which 50 % and 95 % of the realisations lie." + lower,
            f"{name}-bands",
        )
    ]
    if not varying:
        return {
            "name": name,
            "figures": drawn,
            "folded": not whole,
            "note": " ".join(filter(None, (f"This output {STILL}.", content.integration(first, name)))),
            "words": "",
            "numbers": [],
        }
    sampled = {label: node for label, node in holders.items() if content.has_histograms(node)}
    deviation = (
        []
        if not whole
        else [
            image(
                lambda: figures.std_over_time(holders, name),
                f"Standard deviation of {name} over time. " + content.in_words(first, name),
                "When it is uncertain: the standard deviation over time; the shaded band is plus and minus two "
                "standard errors, where they are known.",
                f"{name}-standard-deviation",
            )
        ]
    )
    if sampled and whole:
        label, node = next(iter(sampled.items()))
        from_label = f" (samples of {label})" if len(nodes) > 1 else ""
        drawn += [
            image(
                lambda: figures.time_history_histogram(node, name),
                f"Time-history histogram of {name}: how many samples have which value at which time.",
                f"Where the samples are: the darker, the more of them have this value at this time{from_label}. "
                "White: none.",
                f"{name}-time-history-histogram",
            ),
            _densities(tree, sampled | surrogate_nodes(every), name),
            image(
                lambda: figures.convergence(node, name),
                f"Mean and standard deviation of {name} as samples are added. " + content.precision(node, name),
                _convergence_caption(node) + from_label + ".",
                f"{name}-samples",
            ),
        ]
    elif surrogate_nodes(every) and whole:
        drawn.append(_densities(tree, surrogate_nodes(every), name))
    compared = []
    if whole and len(holders) > 1 and surrogate_nodes(holders):
        reference = choose_reference(holders)
        compared.append(
            image(
                lambda: figures.differences(holders, name, reference=reference),
                f"Difference of the mean and the standard deviation of {name} between methods, over time.",
                f"How far the methods agree: the mean and the standard deviation of each, less those of {reference}. "
                "A shaded band is plus and minus two standard errors of these, where they are known.",
                f"{name}-differences",
            )
        )
    words = [
        content.in_words(first, name),
        *(content.precision(node, name) for node in list(sampled.values())[:1]),
        content.integration(first, name),
    ]
    return {
        "name": name,
        "folded": not whole,
        "figures": [*drawn, *deviation, *compared],
        "note": "",
        "words": " ".join(filter(None, words)),
        "numbers": content.numbers(first, name),
    }


def _densities(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree], name: str) -> dict[str, str]:
    dense = dict(list(nodes.items())[:DENSITIES])
    sampled = any(content.has_histograms(node) for node in dense.values())
    surrogates = any(label in surrogate_nodes(dense) for label in dense)
    bars = "bars are the histogram, curves a smooth estimate" if sampled else "smooth estimates"
    of_surrogates = " (of a surrogate, from samples of it)" if surrogates else ""
    return image(
        lambda: figures.histograms(dense, name, content.report_times(tree)),
        f"Probability densities of {name} at chosen times.",
        f"How it is distributed at chosen times: {bars} of the density{of_surrogates}; the area under each is 1.",
        f"{name}-densities",
    )


def _convergence_caption(node: xr.DataTree) -> str:
    design = design_of(node.attrs)
    if design.independent:
        return (
            "Whether there are enough samples: the estimates from the first samples only, and the band that holds the "
            "true value with 95 % confidence, at the time of the largest standard deviation"
        )
    return (
        f"Whether there are enough samples: the points of a {design.name} design count as a whole only, so the "
        "estimates are shown against the number of its independent replicates, with the band that holds the true value "
        "with 95 % confidence, at the time of the largest standard deviation"
    )
