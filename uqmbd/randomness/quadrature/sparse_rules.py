"""Sparse grids: Smolyak's combination of small tensor rules for any downward closed set of levels."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.index_sets import index_set, whole_number
from uqmbd.randomness.quadrature.nested import nested_count, nested_exactness, nested_rule
from uqmbd.randomness.quadrature.rules import (
    Quadrature,
    check_size,
    tensor_rule,
)
from uqmbd.randomness.space import GermSpace
from uqmbd.typing import Array, Index

__all__ = ["combination_coefficients", "smolyak", "sparse_rule"]


RULES = ("gauss", "clenshaw-curtis")
GROWTHS = ("slow", "linear")

SAME = 1e-12
"""Nodes of one germ are combined up to this distance, relative to the largest node."""

CANCELLED = 1e-13
"""A weight counts as zero up to this limit, relative to the sum of the absolute contributions to its node."""


@typechecked
def smolyak(space: GermSpace, level: int, growth: str = "slow", rule: str = "gauss") -> Quadrature:
    """Return Smolyak's sparse rule; with Gauss rules, it is exact at least up to the total degree ``2 * level + 1``.

    Parameters
    ----------
    space : GermSpace
        Space of the germs.
    level : int
        Level of the rule: 0 for a single node.
    growth : {"slow", "linear"}
        Number of nodes of the Gauss rule at level l: ``l + 1`` or ``2 l + 1``. The latter rules share the middle node
        of symmetric germs, and are more accurate in single germs.
    rule : {"gauss", "clenshaw-curtis"}
        Gauss rules or nested rules. See `uqmbd.extend.clenshaw_curtis` for nested rules, which ignore `growth`.

    Returns
    -------
    Quadrature
        Rule with distinct nodes; weights may be negative.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    References
    ----------
    E. Novak, K. Ritter, Numer. Math. 75 (1996) 79; G. W. Wasilkowski, H. Wozniakowski, J. Complexity 11 (1995) 1.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> inputs = [uqmbd.RandomVariable(f"x{k}", chaospy.Normal(0, 1)) for k in range(6)]
    >>> space = GermSpace.of(JointInput.of(inputs))
    >>> rule = smolyak(space, 2, growth="linear")
    >>> len(rule), rule.exactness, round(float(rule.weights @ (rule.nodes[:, 0] * rule.nodes[:, 1]) ** 2), 12)
    (97, 5, 1.0)
    """
    whole_number(level, "smolyak: level", 0)
    found = _sparse(space, index_set(space.dimension, level), growth, rule, "smolyak")
    return Quadrature(found.nodes, found.weights, found.exactness, f"Smolyak level {level}, {_described(rule, growth)}")


@typechecked
def sparse_rule(space: GermSpace, levels: ArrayLike, growth: str = "slow", rule: str = "gauss") -> Quadrature:
    """Return the sparse rule of a set of levels, as for a dimension-adaptive refinement.

    Parameters
    ----------
    space : GermSpace
        Space of the ``d`` germs.
    levels : array_like of int, shape (n, d)
        Levels of the tensor rules. For each row, the set must contain all rows with smaller levels.
    growth, rule : str
        Growth and kind of the rules, as for :func:`smolyak`.

    Returns
    -------
    Quadrature
        Sparse rule.

    Raises
    ------
    uqmbd.StudyError
        If the set is not downward closed, or another argument is invalid.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(n, chaospy.Uniform(-1, 1)) for n in "ab"]))
    >>> sparse_rule(space, [[0, 0], [1, 0]], rule="clenshaw-curtis").nodes.tolist()
    [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]
    """
    return _sparse(space, levels, growth, rule, "sparse_rule")


def _sparse(space: GermSpace, levels: ArrayLike, growth: str, rule: str, caller: str) -> Quadrature:
    """Return the sparse rule of levels (n, d); messages begin with `caller`, the function that the user called."""
    for value, known, what in ((rule, RULES, "rule"), (growth, GROWTHS, "growth")):
        if value not in known:
            raise StudyError(f"{caller}: {what} is {value!r}; expected one of {', '.join(known)}.")
    rows = np.asarray(levels)
    if rows.ndim != 2 or rows.shape[1] != space.dimension or not len(rows):
        raise StudyError(
            f"{caller}: levels have the shape {rows.shape}; expected (rows, {space.dimension}) with at least one row."
        )
    coefficients = combination_coefficients(rows)
    used = rows[coefficients != 0]
    highest = rows.max(axis=0, initial=0).tolist()
    catalogues = [_Catalogue(germ, most, growth, rule, caller) for germ, most in zip(space.germs, highest, strict=True)]
    sizes = np.ones(len(used))
    for k, catalogue in enumerate(catalogues):
        sizes *= np.array([len(places) for places, _ in catalogue.rules])[used[:, k]]
    check_size(int(sizes.sum()), space, caller)
    places: list[Array] = []
    weights: list[Array] = []
    for row, coefficient in zip(used, coefficients[coefficients != 0], strict=True):
        grid, product = tensor_rule([c.rules[level] for c, level in zip(catalogues, row, strict=True)])
        places.append(grid)
        weights.append(coefficient * product)
    stacked, added = np.concatenate(places), np.concatenate(weights)
    if space.dimension:
        unique, where = np.unique(stacked.astype(np.int32), axis=0, return_inverse=True)
    else:
        unique, where = np.zeros((1, 0), dtype=np.int32), np.zeros(len(stacked), dtype=np.intp)
    where = where.ravel()
    total: Array = np.bincount(where, added).astype(float)
    kept = np.abs(total) > CANCELLED * np.bincount(where, np.abs(added))
    nodes = np.empty((int(kept.sum()), space.dimension))
    for k, catalogue in enumerate(catalogues):
        nodes[:, k] = catalogue.nodes[unique[kept, k]]
    exactness = _exactness(rows, catalogues)
    return Quadrature(nodes, total[kept], exactness, f"sparse grid of {len(rows)} levels, {_described(rule, growth)}")


@typechecked
def combination_coefficients(levels: ArrayLike) -> Index:
    """Return the factors of the tensor rules in the combination technique.

    Source: Gerstner and Griebel, Computing 71 (2003) 65.

    Parameters
    ----------
    levels : array_like of int, shape (n, d)
        Downward closed set of levels.

    Returns
    -------
    array of int, shape (n,)
        Factors of the tensor rules, with the sum 1.

    Raises
    ------
    uqmbd.StudyError
        If the set is not downward closed, or a row occurs twice.

    Examples
    --------
    >>> combination_coefficients([[0, 0], [1, 0], [0, 1]]).tolist()
    [-1, 1, 1]
    """
    given = np.asarray(levels)
    if given.ndim != 2 or given.dtype.kind not in "iu":
        raise StudyError(
            f"combination_coefficients: levels is {shown(levels)}; expected whole numbers in rows, shape (n, d)."
        )
    rows = [tuple(row) for row in given.tolist()]
    factors = dict.fromkeys(rows, 1)
    if len(factors) != len(rows):
        raise StudyError("The set of levels contains a row twice; expected different rows.")
    for row in rows:
        for k, digit in enumerate(row):
            smaller = (*row[:k], digit - 1, *row[k + 1 :])
            if digit < 0 or (digit and smaller not in factors):
                raise StudyError(
                    f"The set of levels is not downward closed: it contains {row}, but not {smaller}. Add the "
                    "missing levels."
                )
    # product over the germs of (1 - shift), one germ after another
    for k in range(len(rows[0]) if rows else 0):
        larger = {row: factors.get((*row[:k], row[k] + 1, *row[k + 1 :]), 0) for row in rows}
        factors = {row: factors[row] - larger[row] for row in rows}
    return np.array([factors[row] for row in rows], dtype=np.int64)


class _Catalogue:
    """Rules of one germ at all levels, as indices into one list of distinct nodes."""

    def __init__(self, germ: Germ, highest: int, growth: str, rule: str, caller: str) -> None:
        if rule == "clenshaw-curtis" and (count := nested_count(germ, highest)) > 2**20:
            raise StudyError(f"{caller}: level {highest} needs {count} nodes for {germ.name!r}; use a lower level.")
        rules = [self._rule(germ, level, growth, rule) for level in range(highest + 1)]
        self.exactness = [exact for _, _, exact in rules]
        everything = np.concatenate([nodes for nodes, _, _ in rules])
        order = np.argsort(everything, kind="stable")
        apart = np.diff(everything[order]) > SAME * np.abs(everything).max()
        number = np.empty(len(everything), dtype=int)
        number[order] = np.r_[0, np.cumsum(apart)]
        self.nodes: Array = everything[order][np.r_[True, apart]]
        self.rules: list[tuple[Array, Array]] = []
        first = 0
        for nodes, weights, _ in rules:
            self.rules.append((number[first : first + len(nodes)].astype(float), weights))
            first += len(nodes)

    @staticmethod
    def _rule(germ: Germ, level: int, growth: str, rule: str) -> tuple[Array, Array, int]:
        if rule == "clenshaw-curtis":
            return (*nested_rule(germ, level), nested_exactness(germ, level))
        count = level + 1 if growth == "slow" else 2 * level + 1
        if germ.values is not None and count >= germ.values:
            return (*germ.gauss(germ.values), 10**6)  # a rule on all values gives the exact expectation
        return (*germ.gauss(count), 2 * count - 1)


def _exactness(rows: Index, catalogues: list[_Catalogue]) -> int | None:
    """Return the highest total degree up to which the rule is exact for all monomials; None: for every degree."""
    members = {tuple(int(v) for v in row) for row in rows}

    @cache
    def cheapest(row: tuple[int, ...]) -> int:
        # lowest total degree of a monomial that needs a level outside the set, at or above `row`
        if row not in members:
            return sum(catalogues[k].exactness[level - 1] + 1 for k, level in enumerate(row) if level)
        steps = ((*row[:k], row[k] + 1, *row[k + 1 :]) for k in range(len(row)))
        return min((cheapest(step) for step in steps), default=10**6)

    found = cheapest((0,) * rows.shape[1]) - 1
    return found if found < 10**6 - 1 else None


def _described(rule: str, growth: str) -> str:
    return "Clenshaw-Curtis" if rule == "clenshaw-curtis" else f"Gauss, {growth} growth"
