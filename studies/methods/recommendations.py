"""What uqmbd recommends: run with a wanted accuracy, and compared with the truth."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass

import numpy as np

from uqmbd.errors import UqmbdError
from uqmbd.extend import Propagator
from uqmbd.results import assess, stated_accuracy
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from .cases import CASES, Reference
from .runs import answers, first_line, largest
from .truths import load_truth

__all__ = ["ACCURACIES", "Recommendation", "recommendation_of"]

ACCURACIES = 0.1, 0.01, 0.001
"""Wanted errors of means and standard deviations, over the largest standard deviation of the output."""
MOST = 200_000
"""Budget in realisations."""


@dataclass(frozen=True)
class Recommendation:
    """The method that a run with an accuracy recommends, and what it is worth.

    Attributes
    ----------
    mechanism, kind : str
        What was run.
    accuracy : float
        Wanted accuracy.
    method : str
        Recommended method; empty: none.
    error, stated : float
        Largest true error of mean and standard deviation, and the stated accuracy.
    realisations, whole : int
        Those of the recommended method, and of all methods of the run.
    seconds : float
        Processor time of the run, s.
    failure : str
        Message of a run that failed.
    """

    mechanism: str
    kind: str
    accuracy: float
    method: str
    error: float
    stated: float
    realisations: int
    whole: int
    seconds: float
    failure: str = ""


def methods(mechanism: str) -> list[Propagator]:
    """Return the methods of a first study: those of the page on the choice of a method."""
    many = len(Reference(CASES[mechanism]).inputs) > 5
    chaos = Collocation(adaptive="dimension") if many else Collocation(alignment="auto")
    return [MonteCarlo(seed=1), chaos]


def recommendation_of(mechanism: str, accuracy: float) -> Recommendation:
    """Run the first study of a mechanism with an accuracy, and return what it recommends."""
    reference, truth = Reference(CASES[mechanism]), load_truth(mechanism)
    study, about = reference.study().with_propagators(methods(mechanism)), (mechanism, reference.tested.kind, accuracy)
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = study.run(accuracy=accuracy, budget=MOST, planned=lambda sentence: None)
    except UqmbdError as raised:
        return Recommendation(*about, "", np.nan, np.nan, 0, 0, time.process_time() - begin, first_line(raised))
    seconds = time.process_time() - begin
    nodes = {label: node for label, node in tree.children.items() if "realisations" in node.attrs}
    whole = sum(int(node.attrs["realisations"]) for node in nodes.values())
    advised = assess(tree).recommended
    if not advised:
        return Recommendation(*about, "", np.nan, np.nan, 0, whole, seconds, "no method is recommended")
    node = nodes[advised[0]]
    found = answers(node)
    error = max(largest(found[question], truth, question)[0] for question in ("mean", "std"))
    claimed = stated_accuracy(node).value
    return Recommendation(*about, advised[0], error, claimed, int(node.attrs["realisations"]), whole, seconds)
