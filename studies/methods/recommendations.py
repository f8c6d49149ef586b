"""What uqmbd recommends: runs with a requested accuracy, compared with the truth, by the present and earlier rules."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.errors import UqmbdError
from uqmbd.extend import Propagator
from uqmbd.results import assess, compare, propagator_nodes, stated_accuracy
from uqmbd.results.assessment import recommended
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from .cases import CASES, Reference
from .runs import answers, first_line, largest
from .truths import Truth, load_truth

__all__ = ["ACCURACIES", "RULES", "Recommendation", "before_run", "recommendation_of"]

ACCURACIES = 0.1, 0.01, 0.001
"""Wanted errors of means and standard deviations, over the largest standard deviation of the output."""
MOST = 50_000
"""Budget in realisations: 42,258 independent samples state 1 % in most cases, and no budget would suffice for 0.1 %."""
SEPARATE = 5
"""Most inputs of a chaos of one order for all."""
SPARSE = 3
"""Fewest inputs of a sparse grid that is refined input by input; with fewer, tensor grids have as few nodes."""
ELEMENTS = 4
"""Most inputs of a chaos by elements, which follows if no other chaos reaches the accuracy."""


@dataclass(frozen=True)
class Recommendation:
    """The method that a run with an accuracy recommends, and what it is worth.

    Attributes
    ----------
    mechanism, kind : str
        What was run.
    accuracy : float
        Wanted accuracy.
    rules : str
        ``now``: those of the code; ``limits``: those without the requested accuracy.  See `Rules`.
    method : str
        Recommended method; empty: none reaches the accuracy by its own statement.
    error, stated : float
        Largest true error of mean and standard deviation, and the stated accuracy.
    realisations, whole : int
        Those of the recommended method, and of all methods of the run.
    least : int
        Fewest realisations of a method of the run whose true error is at most the accuracy; 0: none.
    seconds : float
        Processor time of the run, s.
    failure : str
        Message of a run that failed.
    """

    mechanism: str
    kind: str
    accuracy: float
    rules: str
    method: str
    error: float
    stated: float
    realisations: int
    whole: int
    least: int
    seconds: float
    failure: str = ""


@dataclass(frozen=True)
class Rules:
    """Rules of recommendation: the methods of a first study, and how one of them is recommended.

    Attributes
    ----------
    sampling : str
        Design of Monte Carlo.
    requested : bool
        Whether the requested accuracy decides; otherwise limits of 1 % and 5 %, and wall times, as in November 2026.
    """

    sampling: str = "sobol"
    requested: bool = True


RULES = {"now": Rules(), "design": Rules(requested=False), "limits": Rules("random", requested=False)}
"""Rules that are compared."""


def methods(mechanism: str, sampling: str = "sobol") -> list[Propagator]:
    """Return the methods of a first study: those of the page on the choice of a method."""
    tested = Reference(CASES[mechanism]).mechanism
    found: list[Propagator] = [MonteCarlo(samples=512, sampling=sampling, seed=1)]
    if len(tested.inputs) <= SEPARATE:
        found.append(Collocation(alignment="auto") if tested.outputs else Collocation())
    if len(tested.inputs) >= SPARSE:
        found.append(Collocation(adaptive="dimension", label="sparse-grid"))
    return found


def further(mechanism: str) -> list[Propagator]:
    """Return the methods of a second study, which follows if no chaos of the first one reaches the accuracy."""
    if len(Reference(CASES[mechanism]).inputs) > ELEMENTS:
        return []
    return [Collocation(order=2, elements="adaptive", max_elements=256, label="elements")]


def before_run(mechanism: str, accuracy: float) -> list[tuple[str, str]]:
    """Return the method and size that the page recommends before any run; the second if the first does not exist.

    The choice follows from the number of inputs alone, which ``uqmbd check`` prints.
    """
    k = ACCURACIES.index(accuracy)
    if len(Reference(CASES[mechanism]).inputs) > SEPARATE:
        return [("Collocation, adaptive=dimension", f"tolerance={(0.1, 0.01, 0.001)[k]:g}")]
    order = f"order={(2, 3, 4)[k]}"
    return [("Collocation, alignment=auto", order), ("Collocation", order)]


def recommendation_of(mechanism: str, accuracy: float, rules: str) -> Recommendation:
    """Run the first study of a mechanism with an accuracy, and return the recommendation by some rules."""
    reference, truth = Reference(CASES[mechanism]), load_truth(mechanism)
    study = reference.study().with_propagators(methods(mechanism, RULES[rules].sampling))
    about, begin = (mechanism, reference.tested.kind, accuracy, rules), time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = study.run(accuracy=accuracy, budget=MOST, planned=lambda sentence: None)
            nodes = dict(propagator_nodes(tree))
            chaoses = [node for node in nodes.values() if node.attrs["propagator"] != MonteCarlo.name]
            rough = all(stated_accuracy(node, rtol=study.rtol).value > accuracy for node in chaoses)
            if RULES[rules].requested and rough and (more := further(mechanism)):
                again = reference.study().with_propagators(more)
                added = propagator_nodes(again.run(accuracy=accuracy, budget=MOST, planned=lambda sentence: None))
                # elements that miss the accuracy leave the first recommendation as it is
                nodes |= {k: x for k, x in added.items() if stated_accuracy(x, rtol=study.rtol).value <= accuracy}
    except UqmbdError as raised:
        return Recommendation(*about, "", np.nan, np.nan, 0, 0, 0, time.process_time() - begin, first_line(raised))
    seconds = time.process_time() - begin
    # outputs that do not occur in all realisations are not compared; the recommendation says which method has them
    censored = tree["comparison"].attrs.get("censored", "").split(", ") if "comparison" in tree.children else ()
    errors = {label: _error(node, truth, censored) for label, node in nodes.items()}
    costs = {label: int(node.attrs["realisations"]) for label, node in nodes.items()}
    whole, least = sum(costs.values()), min((costs[n] for n in nodes if errors[n] <= accuracy), default=0)
    advised = assess(tree).recommended if RULES[rules].requested else by_limits(nodes)
    if "elements" in nodes:
        # without a recommendation, as when samples and elements disagree, that of the first study remains
        advised = recommended(compare(nodes, rtol=study.rtol)) or advised
    if not advised:
        return Recommendation(*about, "", np.nan, np.nan, 0, whole, least, seconds, "no method is recommended")
    label = advised[0]
    claimed = stated_accuracy(nodes[label], rtol=study.rtol).value
    missed = "" if claimed <= accuracy else "the stated error is above the accuracy"
    return Recommendation(*about, label, errors[label], claimed, costs[label], whole, least, seconds, missed)


def _error(node: xr.DataTree, truth: Truth, left_out: Iterable[str]) -> float:
    """Return the largest true error of mean and standard deviation, of all outputs but some."""
    found = {key: {k: x for k, x in values.items() if k not in left_out} for key, values in answers(node).items()}
    return max(largest(found[question], truth, question)[0] for question in ("mean", "std"))


def by_limits(nodes: Mapping[str, xr.DataTree]) -> tuple[str, ...]:
    """Return what limits of 1 % and 5 % and the wall times recommend, without the requested accuracy.

    Those rules took wall times as costs at any length; multiplied by a large number, they decide here as well.
    """
    plain = {}
    for label, node in nodes.items():
        own = node.children["scalars"] if not node.children["statistics"].sizes["output"] else node
        plain[label] = own.copy()
        plain[label].attrs = {k: x for k, x in node.attrs.items() if k != "requested_accuracy"}
        plain[label].attrs["wall_time"] = 1e6 * float(node.attrs["wall_time"])
    return recommended(compare(plain, rtol=1e-6)) if len(plain) > 1 else tuple(plain)
