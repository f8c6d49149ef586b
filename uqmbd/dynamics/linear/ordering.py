"""Block elimination order of a large index-1 system by multiple minimum degree on the mechanism's graph [1]_.

A unit is a body with the equations of this body only, or the multipliers of a joint.  Each round eliminates all units
with few neighbours and regular blocks together, unless two of them are neighbours.  Each round therefore
eliminates half of the units of a chain, and units of one kind in one round can be computed together.

References
----------
.. [1] J. W. H. Liu, Modification of the minimum-degree algorithm by multiple elimination, ACM Transactions on
   Mathematical Software 11 (1985) 141-153.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Front", "rounds_of", "units_of"]


REGULAR = 1e-6
"""Least ratio of the smallest to the largest singular value of a scaled block that may be eliminated."""

WIDE = 2
"""Largest ratio of a unit's degree to the least degree, for elimination in the same round."""

LARGEST = 24
"""Largest number of unknowns of a block; unrolled code for larger blocks is inefficient."""


@dataclass(frozen=True)
class Front:
    """Unit of a mechanism at its elimination."""

    unknowns: tuple[int, ...]  # unknowns of the unit
    neighbours: tuple[int, ...]  # unknowns of its remaining neighbours
    block: Array  # (S, s, s): block of its unknowns in typical systems, which is inverted


def units_of(rows: Index, columns: Index, coordinates: int, body: int, owners: list[str]) -> list[tuple[int, ...]]:
    """Group the unknowns of an index-1 system with a pattern (nnz,) into units; equations follow the coordinates.

    `coordinates` is the number of coordinates, `body` the number for each body; `owners` are the components of the
    equations.  The example has two translational bodies, an equation of the first body, and an equation of both:

    >>> rows = np.array([0, 1, 2, 3, 4, 5, 5])
    >>> columns = np.array([0, 1, 2, 3, 0, 1, 2])
    >>> units_of(rows, columns, 4, 2, ["wall", "rod"])
    [(0, 1, 4), (2, 3), (5,)]
    """
    touched: dict[int, set[int]] = {}
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if i >= coordinates > j:
            touched.setdefault(i, set()).add(j // body)
    units: dict[tuple[int, str], list[int]] = {(i // body, ""): [] for i in range(coordinates)}
    for i in range(coordinates):
        units[i // body, ""].append(i)
    first = coordinates // body
    for k, owner in enumerate(owners):
        bodies = touched.get(coordinates + k, set())
        key = (min(bodies), "") if len(bodies) == 1 else (first, owner)
        units.setdefault(key, []).append(coordinates + k)
    return [tuple(unknowns) for unknowns in units.values()]


class _Graph:
    """Remaining units, and the blocks of typical systems between them."""

    def __init__(self, units: list[tuple[int, ...]], rows: Index, columns: Index, typical: Array) -> None:
        self.unknowns = dict(enumerate(units))
        self.count = len(typical)
        unit: dict[int, int] = {}
        place: dict[int, int] = {}
        for u, unknowns in self.unknowns.items():
            unit |= dict.fromkeys(unknowns, u)
            place |= {x: k for k, x in enumerate(unknowns)}
        self.blocks: dict[tuple[int, int], Array] = {}
        self.beside: dict[int, set[int]] = {u: set() for u in self.unknowns}
        for k, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
            u, w = unit[i], unit[j]
            block: Any = self._block(u, w)
            block[:, place[i], place[j]] += typical[:, k]
            if u != w:
                self.beside[u].add(w)
        self.known: dict[int, bool] = {}

    def _block(self, u: int, w: int) -> Array:
        if (u, w) not in self.blocks:
            self.blocks[u, w] = np.zeros((self.count, len(self.unknowns[u]), len(self.unknowns[w])))
        return self.blocks[u, w]

    def degree(self, u: int) -> int:
        """Return the number of unknowns of the neighbours of a unit."""
        return sum(len(self.unknowns[w]) for w in self.beside[u])

    def regular(self, u: int) -> bool:
        """Return whether the block of a unit can be inverted in all typical systems."""
        if u not in self.known:
            self.known[u] = _regular(self._block(u, u))
        return self.known[u]

    def eliminate(self, u: int) -> Front:
        """Eliminate a unit and return its front."""
        others = sorted(self.beside.pop(u))
        block = self.blocks.pop((u, u))
        beside = np.concatenate([self.blocks.pop((u, w)) for w in others], axis=2) if others else None
        if beside is not None:
            solved = np.linalg.solve(block, beside)
            edges = np.cumsum([0, *(len(self.unknowns[w]) for w in others)])
            for a in others:
                below = self.blocks.pop((a, u))
                change = below @ solved
                for k, b in enumerate(others):
                    entry = self._block(a, b)
                    entry -= change[:, :, edges[k] : edges[k + 1]]
                self.beside[a] |= set(others)
                self.beside[a] -= {a, u}
                self.known.pop(a, None)
        neighbours = tuple(x for w in others for x in self.unknowns[w])
        return Front(self.unknowns.pop(u), neighbours, block)

    def merge(self, u: int, w: int) -> None:
        """Merge two neighbours into one unit."""
        others = (self.beside[u] | self.beside[w]) - {u, w}

        def joined(a: int, b: int) -> Array:
            return np.concatenate([self._block(a, b), self._block(w, b)], axis=1)

        both = np.concatenate([joined(u, u), joined(u, w)], axis=2)
        right = {x: joined(u, x) for x in others}
        below = {x: np.concatenate([self._block(x, u), self._block(x, w)], axis=2) for x in others}
        for a in (u, w):
            for b in (u, w, *others):
                self.blocks.pop((a, b), None)
                self.blocks.pop((b, a), None)
        self.unknowns[u] += self.unknowns.pop(w)
        self.blocks[u, u] = both
        for x in others:
            self.blocks[u, x], self.blocks[x, u] = right[x], below[x]
            self.beside[x] = (self.beside[x] | {u}) - {w}
        self.beside[u] = others
        del self.beside[w]
        self.known.pop(u, None)
        self.known.pop(w, None)


def _regular(block: Array) -> bool:
    scaled = block.copy()
    for _ in range(3):  # scale rows and columns equally, as masses and lengths have any magnitude
        size = np.sqrt(np.abs(scaled).max(axis=2))
        if not (size > 0).all():
            return False
        scaled /= size[:, :, None] * size[:, None, :]
    values = np.linalg.svd(scaled, compute_uv=False)
    return bool((values[:, -1] >= REGULAR * values[:, 0]).all())


def rounds_of(units: list[tuple[int, ...]], rows: Index, columns: Index, typical: Array) -> list[list[Front]] | None:
    """Choose the order of elimination by rounds; None if blocks become too large for this method or singular.

    The pattern (nnz,) is symmetric; entries of typical systems are (S, nnz).
    """
    graph = _Graph(units, rows, columns, typical)
    rounds = []
    while graph.unknowns:
        ready = sorted((graph.degree(u), u) for u in graph.unknowns if graph.regular(u))
        if not ready:
            _, u = min((graph.degree(u), u) for u in graph.unknowns)
            if not graph.beside[u]:
                return None
            _, w = min((len(graph.unknowns[w]), w) for w in graph.beside[u])
            if len(graph.unknowns[u]) + len(graph.unknowns[w]) > LARGEST:
                return None
            graph.merge(u, w)
            continue
        chosen: list[int] = []
        blocked: set[int] = set()
        for degree, u in ready:
            if degree > WIDE * ready[0][0]:
                break
            if u not in blocked:
                chosen.append(u)
                blocked |= graph.beside[u]
        rounds.append([graph.eliminate(u) for u in chosen])
        if any(len(front.unknowns) > LARGEST for front in rounds[-1]):
            return None
    return rounds
