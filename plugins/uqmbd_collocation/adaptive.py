"""Dimension-adaptive sparse grids: tensor projections where they matter, in the order in which they matter."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import project
from uqmbd_collocation.fitting import Fit, refitted
from uqmbd_collocation.runs import Runs

__all__ = ["Refinement", "Step", "refine_dimensions"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Level = tuple[int, ...]

DEEPEST = 12
"""Highest level of a germ."""


@dataclass(frozen=True)
class Step:
    """What a refinement knew after one of its steps.

    Attributes
    ----------
    realisations : int
        So far.
    terms : int
        Of the chaos.
    change_mean, change_std : float
        Largest over outputs and times, over the largest standard deviation of the output over time.
    """

    realisations: int
    terms: int
    change_mean: float
    change_std: float


@dataclass(frozen=True)
class Refinement:
    """A fit, how it came about, and whether the tolerance was met."""

    fit: Fit
    steps: tuple[Step, ...]
    met: bool


@dataclass
class _Grid:
    """Tensor projections of a downward closed set of levels, by the combination technique.

    Each is a full pseudo-spectral projection of its own, so that the sum has no internal aliasing (P. R. Conrad and
    Y. M. Marzouk, SIAM Journal on Scientific Computing 35 (2013) A2643-A2670).
    """

    runs: Runs
    found: dict[Level, dict[Level, Array]] = field(default_factory=dict)

    def nodes(self, level: Level) -> uqmbd.Quadrature:
        """Return the Gauss rule of a level: ``2 l + 1`` nodes in each germ, which share the middle one."""
        space = self.runs.space
        counts = [
            min(2 * k + 1, germ.values) if germ.values else 2 * k + 1
            for k, germ in zip(level, space.germs, strict=True)
        ]
        return uqmbd.gauss_tensor(space, counts)

    def projection(self, level: Level) -> dict[Level, Array]:
        """Coefficients of the tensor projection of a level, by the degrees of their terms."""
        if level not in self.found:
            rule = self.nodes(level)
            counts = [len(np.unique(np.round(column, 11))) for column in rule.nodes.T]
            degrees = np.array(list(product(*(range(n) for n in counts))), dtype=np.int64)
            where = self.runs.at(rule.nodes)
            psi = self.runs.space.evaluate(rule.nodes, degrees)
            values = project(self.runs.response[where], psi, rule.weights)
            self.found[level] = dict(zip(map(tuple, degrees.tolist()), values, strict=True))
        return self.found[level]

    def surplus(self, level: Level) -> dict[Level, Array]:
        """Return what a level adds to all smaller ones: the product of differences from one level to the next."""
        total: dict[Level, Array] = {}
        for shift in product(*((0, 1) if k else (0,) for k in level)):
            sign = (-1) ** sum(shift)
            for term, value in self.projection(tuple(a - b for a, b in zip(level, shift, strict=True))).items():
                total[term] = total[term] + sign * value if term in total else sign * value
        return total


def _measure(surplus: dict[Level, Array], scale: Array) -> tuple[float, float]:
    """Size of a surplus in the mean and in the spread, over the scale of each output (O,)."""
    mean = np.zeros(1)
    spread: Array | float = 0.0
    for term, value in surplus.items():
        if any(term):
            spread = spread + value**2
        else:
            mean = np.abs(value).max(axis=-1) / scale
    size = np.sqrt(np.asarray(spread)).max(axis=-1) / scale if np.ndim(spread) else np.zeros(1)
    return float(mean.max()), float(size.max())


def _scale(terms: dict[Level, Array]) -> Array:
    """Largest standard deviation of each output over time; where it vanishes the size of the mean, times rounding."""
    mean = next(value for term, value in terms.items() if not any(term))
    variance = sum((value**2 for term, value in terms.items() if any(term)), np.zeros_like(mean))
    rounding = 1e-12 * np.abs(mean).max(axis=-1) + 1e-300
    return np.asarray(np.maximum(np.sqrt(variance).max(axis=-1), rounding))


def refine_dimensions(runs: Runs, tolerance: float, most: int, label: str) -> Refinement:
    """Refine a sparse grid where it changes mean and standard deviation most, until nothing does.

    Parameters
    ----------
    runs : Runs
        Realisations.
    tolerance : float
        Relative to the largest standard deviation of each output over time.
    most : int
        Realisations that may be spent.
    label : str
        Of the propagator.

    References
    ----------
    T. Gerstner and M. Griebel, Computing 71 (2003) 65-87.
    """
    grid, dimension = _Grid(runs), runs.space.dimension
    root = (0,) * dimension
    done: set[Level] = set()
    waiting: dict[Level, tuple[float, float]] = {}
    total: dict[Level, Array] = {}
    steps: list[Step] = []
    met = False

    def enter(levels: list[Level]) -> bool:
        """Compute levels; False where a node failed."""
        nodes = np.concatenate([grid.nodes(level).nodes for level in levels])
        where = runs.at(nodes)
        if (runs.status[where] != 0).any():
            return False
        for level in levels:
            surplus = grid.surplus(level)
            for term, value in surplus.items():
                total[term] = total[term] + value if term in total else value
            waiting[level] = _measure(surplus, _scale(total))
        return True

    sound = enter([root])
    while sound:
        # the root tells nothing about spread: its neighbours are always tried
        mean, std = (max((m[k] for m in waiting.values()), default=0.0) for k in (0, 1))
        steps.append(Step(len(runs), len(total), mean if len(done) else np.inf, std if len(done) else np.inf))
        if len(done) and max(mean, std) < tolerance:
            met = True
            break
        worst = max(waiting, key=lambda level: (max(waiting[level]), [-k for k in level]))
        del waiting[worst]
        done.add(worst)
        new = []
        for k in range(dimension):
            level = (*worst[:k], worst[k] + 1, *worst[k + 1 :])
            below = [(*level[:i], level[i] - 1, *level[i + 1 :]) for i in range(dimension) if level[i]]
            germ = runs.space.germs[k]
            deep = level[k] > DEEPEST or (germ.values is not None and 2 * level[k] - 1 >= germ.values)
            if not deep and all(b in done for b in below):
                new.append(level)
        if not new and not waiting:
            met = True
            break
        more = len(runs.missing(np.concatenate([grid.nodes(level).nodes for level in new]))) if new else 0
        if len(runs) + more > most:
            warnings.warn(
                f"{label}: the tolerance {tolerance:g} was not met with {len(runs)} realisations; the next step needs "
                f"{more} more, and max_realisations is {most}. Mean and standard deviation still change by "
                f"{max(mean, std):.2g}.",
                stacklevel=2,
            )
            break
        if new:
            sound = enter(new)
    multi_index = _sorted(total, dimension)
    if not sound:
        if not len(multi_index):
            multi_index = np.zeros((1, dimension), dtype=np.int64)
        fit = refitted(runs, np.arange(len(runs)), multi_index, label)
        return Refinement(fit, tuple(steps), met=False)
    coefficients = np.array([total[tuple(row)] for row in multi_index.tolist()])
    how = f"adaptive sparse grid of {len(grid.found)} tensor projections"
    return Refinement(Fit(coefficients, multi_index, how), tuple(steps), met)


def _sorted(terms: dict[Level, Array], dimension: int) -> Index:
    rows = sorted(terms, key=lambda term: (sum(term), [-k for k in term]))
    return np.array(rows, dtype=np.int64).reshape(-1, dimension)
