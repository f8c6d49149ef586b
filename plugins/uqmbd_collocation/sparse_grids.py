"""Sparse grids of tensor projections: nodes of levels, and combination of their coefficients."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

import uqmbd
from uqmbd.extend import project
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Fit, refitted
from uqmbd_collocation.runs import DIGITS, CollocationRuns

__all__ = [
    "Level",
    "SparseProjection",
    "TensorProjection",
    "fewest_nodes",
    "in_order",
    "level_of",
    "levels_for",
    "levels_of",
    "lower_levels",
    "nodes_of_levels",
    "tensor_projection",
]

Level = tuple[int, ...]
"""Level, or degree, of each germ."""


def _count(values: int | None, level: int) -> int:
    """Return the number of Gauss nodes of a germ with this number of values (None: continuous).

    Level l has ``2 l + 1`` nodes, which include the middle node of symmetric germs. The nodes resolve all degrees up to
    ``2 l``, about half of the degree that they integrate exactly.
    """
    return min(2 * level + 1, values or 2 * level + 1)


def level_of(degrees: Index) -> Index:
    """Return the lowest level whose nodes resolve a degree, for each entry of an array of degrees."""
    return (degrees + 1) // 2


def levels_of(space: uqmbd.extend.GermSpace, level: int) -> Index:
    """Return all levels (L, d) with a sum of at most `level`; for germs of few values only levels that add nodes."""
    levels = uqmbd.extend.index_set(space.dimension, level)
    deepest = [level if germ.values is None else germ.values // 2 for germ in space.germs]
    return np.asarray(levels[(levels <= deepest).all(axis=1)])


def levels_for(space: uqmbd.extend.GermSpace, terms: Index) -> Index:
    """Return the levels (L, d) that terms (P, d) need, and for each single input one more level.

    The additional level needs few nodes. With this level, terms of one input just above an even order are separated
    from lower terms.
    """
    needed = level_of(terms)
    highest = needed.max(axis=0)
    deepest = [k if germ.values is None else germ.values // 2 for k, germ in zip(highest + 1, space.germs, strict=True)]
    alone = np.diag(np.where(highest > 0, np.minimum(highest + 1, deepest), 0))
    return np.unique(np.concatenate([needed, alone]), axis=0)


def fewest_nodes(space: uqmbd.extend.GermSpace, level: int, enough: int) -> int:
    """Return a lower bound for the number of nodes of :func:`levels_of`, without computing the nodes.

    The bound is the number of resolved terms, which cannot exceed the number of nodes. If the count for the first germs
    already exceeds `enough`, the bound includes only these germs.
    """
    values = [germ.values for germ in space.germs]
    if None in values and level > enough:
        return 2 * level + 1
    top = min(level, sum(level if one is None else one // 2 for one in values))
    known = np.eye(1, top + 1)[0]
    for one in values:
        known = np.convolve(known, np.diff([0, *(_count(one, k) for k in range(top + 1))]))[: top + 1]
        if known.sum() > enough:
            break
    return int(known.sum())


def lower_levels(level: Level) -> Iterator[tuple[int, Level]]:
    """Yield signs and levels; the signed sum of their projections is the surplus of a level over all smaller levels.

    The surplus is the product of the differences between successive levels of each germ.
    """
    for shift in product(*((0, 1) if k else (0,) for k in level)):
        yield (-1) ** sum(shift), tuple(a - b for a, b in zip(level, shift, strict=True))


def in_order(terms: Iterable[Level]) -> list[Level]:
    """Return terms sorted by total degree, then with earlier germs first, as in `uqmbd.extend.index_set`."""
    return sorted(terms, key=lambda term: (sum(term), [-k for k in term]))


def _rule(space: uqmbd.extend.GermSpace, level: Level) -> tuple[uqmbd.extend.Quadrature, list[int]]:
    """Return the tensor product of Gauss rules of a level, and the number of nodes of each germ."""
    counts = [_count(germ.values, k) for germ, k in zip(space.germs, level, strict=True)]
    return uqmbd.extend.gauss_tensor(space, counts), counts


def nodes_of_levels(space: uqmbd.extend.GermSpace, levels: Iterable[Level]) -> Array:
    """Return the Gauss nodes of all levels, shape (K, d), in order of the levels."""
    return np.concatenate([_rule(space, level)[0].nodes for level in levels])


@dataclass(frozen=True, eq=False)
class TensorProjection:
    """Full pseudo-spectral projection at the nodes of a level, on the terms that the nodes resolve exactly."""

    where: Index  # (K,) indices of the realisations
    weights: Array  # (K,) weights of the nodes
    terms: dict[Level, Array]  # coefficients (O, T) by the degrees of their terms


def tensor_projection(runs: CollocationRuns, level: Level) -> TensorProjection:
    """Return the projection of the realisations at the nodes of a level.

    A rule of n nodes is exact up to degree 2 n - 1. Products of two polynomials of degrees below n do not exceed this
    degree, so there is no internal aliasing between terms.
    """
    rule, counts = _rule(runs.space, level)
    degrees = np.array(list(product(*(range(n) for n in counts))), dtype=np.int64)
    where = runs.at(rule.nodes)
    psi = runs.space.evaluate(rule.nodes, degrees)
    values = project(runs.response[where], psi, rule.weights)
    return TensorProjection(where, rule.weights, dict(zip(map(tuple, degrees.tolist()), values, strict=True)))


@dataclass(frozen=True, eq=False)
class SparseProjection:
    """Sparse pseudo-spectral projection: the Smolyak combination of tensor projections.

    A single sparse-grid quadrature for all coefficients mixes terms, by factors far above 1, if it does not integrate
    their products exactly. Here, in contrast, each tensor projection contains only the terms that its nodes resolve.
    The combination reproduces every polynomial of all these terms (Constantine, Eldred and Phipps, Computer Methods in
    Applied Mechanics and Engineering 229-232 (2012) 1-12; Conrad and Marzouk, SIAM Journal on Scientific Computing 35
    (2013) A2643-A2670).
    """

    factors: dict[Level, int]  # nonzero factor of each level in the combination
    multi_index: Index  # (P, d) all or some of the terms that the levels resolve
    nodes: Array  # (K, d) distinct
    label: str  # label of the propagator, for messages
    name: str  # description of the grid, for messages

    @classmethod
    def of(
        cls, space: uqmbd.extend.GermSpace, levels: Index, terms: Index | None, label: str, name: str
    ) -> SparseProjection:
        """Combine the levels (L, d) of a downward closed set; `terms` (P, d) are by default all resolved terms."""
        rows: list[Level] = [tuple(row) for row in levels.tolist()]
        factors: Counter[Level] = Counter()
        for row in rows:
            for sign, lower in lower_levels(row):
                factors[lower] += sign
        used = {row: factor for row, factor in factors.items() if factor}
        if terms is None:
            terms = np.array(in_order(term for row in rows for term in _added(space, row)), dtype=np.int64)
        nodes = nodes_of_levels(space, used)
        _, first = np.unique(np.round(nodes, DIGITS) + 0.0, axis=0, return_index=True)
        return cls(used, terms, nodes[np.sort(first)], label, name)

    def check(self, space: uqmbd.extend.GermSpace) -> None:
        """Accept every space, because the levels resolve the terms."""

    def fit(self, runs: CollocationRuns) -> Fit:
        """Return the projection; if a node failed, return a regression on the other nodes."""
        where = runs.at(self.nodes)
        if not runs.good(where).all():
            return refitted(runs, where, self.multi_index, self.label)
        total = np.zeros((len(self.multi_index), *runs.response.shape[1:]))
        weights = np.zeros(len(runs))
        rows = {tuple(term): row for row, term in enumerate(self.multi_index.tolist())}
        for level, factor in self.factors.items():
            found = tensor_projection(runs, level)
            np.add.at(weights, found.where, factor * found.weights)
            for term, value in found.terms.items():
                if term in rows:
                    total[rows[term]] += factor * value
        how = f"sparse pseudo-spectral projection by {self.name}"
        return Fit(total, self.multi_index, how, where, weights=weights[where])


def _added(space: uqmbd.extend.GermSpace, level: Level) -> Iterator[Level]:
    """Yield the terms that a level resolves, but that no smaller level resolves."""
    values = [germ.values for germ in space.germs]
    added = (range(_count(v, k - 1) if k else 0, _count(v, k)) for v, k in zip(values, level, strict=True))
    return product(*added)
