"""Margins by a surrogate that another method makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import uqmbd
from uqmbd.results import surrogate
from uqmbd.typing import Array
from uqmbd_reliability.space import StandardSpace

__all__ = ["Predictor", "predictor"]


BLOCK = 2**13
"""Points that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class Predictor:
    """Surrogate margins of chosen requirements at points of the standard normal space."""

    evaluate: Callable[[Array], Array]  # from germs (K, d) to values (K, requirement, 1)
    space: StandardSpace
    chosen: list[int]  # indices of the requirements
    realisations: int  # for the training
    failures: int  # of these realisations

    def __call__(self, points: Array) -> Array:
        """Return margins (K, requirement) at points (K, d)."""
        parts = [points[k : k + BLOCK] for k in range(0, len(points), BLOCK)]
        found = [self.evaluate(self.space.to_germs(part))[:, self.chosen, -1] for part in parts]
        return np.concatenate([np.zeros((0, len(self.chosen))), *found])


def predictor(
    method: uqmbd.extend.Propagator, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]
) -> Predictor:
    """Train a surrogate of the margins by a method; raise StudyError if the method gives none."""
    margins = problem if problem.kind == "requirements" else problem.of_requirements()
    part = margins.part(f"{problem.label}: surrogate").using(observed=margins.runner.observed)
    node = method.propagate(replace(part, answers_requirements=False))
    chaos = surrogate(node, times=[len(problem.times if problem.over is None else problem.over) - 1])
    return Predictor(
        chaos.evaluate_germs,
        space,
        chosen,
        int(node.attrs["realisations"]),
        int(node.attrs["failures"]),
    )
