"""Compute moments of a polynomial chaos from its coefficients."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.results.chaos.terms.products import ProductTable, product_count, product_table
from uqmbd.results.statistics import divisor
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import Germ

__all__ = ["column_blocks", "constant_columns", "shape_route", "skewness_kurtosis", "standard_deviation"]


BLOCK_NUMBERS = 1_000_000
"""Size of the largest array of a block, in numbers of 8 bytes; three such arrays (24 MB) exist at once."""

MAX_NODES = 4_000_000
"""Maximum number of nodes of a tensor grid; above it, one column of values would exceed 32 MB."""

MAX_PRODUCTS = 5_000_000
"""Maximum number of non-zero linearisation coefficients in a table, which needs 140 bytes each during construction."""

# Relative costs, measured with one thread: of a floating-point operation in a small matrix product, of the powers and
# sums at a node, of a non-zero in a sparse product, of a pair of terms, and of constructing a non-zero for each input.
_FLOP, _NODE, _NONZERO, _PAIR, _MAKING = 0.1, 6.0, 1.2, 6.0, 60.0


def standard_deviation(coefficients: Array) -> Array:
    """Return the standard deviation (C,) of coefficients (P, C): the norm of the rows after row 0, the mean."""
    rest = coefficients[1:]
    found = np.zeros(coefficients.shape[1])
    for part in column_blocks(coefficients.shape[1], len(coefficients)):
        block = rest[:, part]
        # scale, so that the square of a spread of 1e-200 does not underflow
        scale = np.abs(block).max(axis=0, initial=0.0)
        unit = block / divisor(scale)
        found[part] = scale * np.sqrt(np.einsum("pc,pc->c", unit, unit))
    return found


def constant_columns(mean: Array, std: Array, terms: int = 1) -> Mask:
    """Return a mask of constant outputs: their deviation, from `terms` terms, is zero or rounding of the mean."""
    return np.asarray(std <= 32.0 * np.finfo(float).eps * np.sqrt(terms) * np.abs(mean))


def column_blocks(columns: int, rows: int) -> Iterator[slice]:
    """Divide columns into slices, with a bounded number of elements in each block."""
    size = max(1, BLOCK_NUMBERS // max(rows, 1))
    return (slice(start, min(start + size, columns)) for start in range(0, columns, size))


def skewness_kurtosis(
    coefficients: Array, multi_index: Index, germs: Sequence[Germ], route: str = "auto"
) -> tuple[Array, Array]:
    """Compute exact skewness and kurtosis (C,) of coefficients (P, C); 0 and 3 for constant outputs."""
    # Two algorithms give the same numbers, and "auto" chooses the faster one. "grid", for few inputs: evaluate on a
    # tensor Gauss grid by sum factorisation; the grid integrates the fourth power exactly (2 q + 1 nodes for an input
    # of degree q). "products", for many inputs: E f^3 = sum f_k g_k and E f^4 = sum g_k^2, with the coefficients g of
    # the square of the chaos from the table of non-zero E[psi_i psi_j psi_k]. If both are too large, StudyError.
    std = standard_deviation(coefficients)
    varies = np.flatnonzero(~constant_columns(coefficients[0], std, len(coefficients)))
    skewness, kurtosis = np.zeros(len(std)), np.full(len(std), 3.0)
    used = np.flatnonzero(multi_index.max(axis=0, initial=0) > 0)
    if not varies.size or not used.size:
        return skewness, kurtosis
    index, involved = multi_index[:, used], [germs[k] for k in used.tolist()]
    chosen = _cheaper(index, involved, varies.size) if route == "auto" else route
    if chosen == "samples":
        raise StudyError(
            f"Skewness and kurtosis of {len(index)} terms in {len(involved)} inputs need too many nodes, or too many "
            "products of three polynomials. Compute them from samples with uqmbd.results.sample_statistics, applied "
            "to the responses of 'sample'."
        )
    table = product_table(index, involved) if chosen == "products" else None
    rows = int(np.prod(_node_counts(index, involved))) if table is None else max(len(table.pairs), table.terms)
    whole = varies.size == len(std)
    with one_thread():
        for part in column_blocks(varies.size, rows):
            columns: slice | Index = part if whole else varies[part]
            unit = coefficients[:, columns] / std[columns]
            unit[0] = 0.0
            third, fourth = _by_grid(unit, index, involved) if table is None else _by_products(unit, table)
            skewness[columns], kurtosis[columns] = third, fourth
    return skewness, kurtosis


def shape_route(coefficients: Array, multi_index: Index, germs: Sequence[Germ]) -> str:
    """Choose the algorithm for skewness and kurtosis: "grid" or "products", or "samples" if both are too large."""
    std = standard_deviation(coefficients)
    varies = int(np.count_nonzero(~constant_columns(coefficients[0], std, len(coefficients))))
    used = np.flatnonzero(multi_index.max(axis=0, initial=0) > 0).tolist()
    return _cheaper(multi_index[:, used], [germs[k] for k in used], varies) if varies and used else "grid"


def _cheaper(index: Index, germs: Sequence[Germ], columns: int) -> str:
    degrees = index.max(axis=0)
    sizes, counts = degrees + 1.0, np.array(_node_counts(index, germs), dtype=float)
    nodes = float(np.prod(counts))
    flops = sum(2.0 * np.prod(counts[: m + 1]) * np.prod(sizes[m:]) for m in range(len(sizes)))
    grid = columns * (_FLOP * flops + _NODE * nodes) if nodes <= MAX_NODES else np.inf
    if grid <= columns * _NODE * len(index):
        return "grid"
    # every pair has at least one non-zero product
    most = len(index) * (len(index) - 1) // 2
    products = np.inf
    if most <= MAX_PRODUCTS:
        pairs, nonzeros = product_count(index, germs)
        if nonzeros <= MAX_PRODUCTS:
            products = columns * (_NONZERO * nonzeros + _PAIR * pairs) + _MAKING * len(sizes) * nonzeros
    if np.isinf(grid) and np.isinf(products):
        return "samples"
    return "grid" if grid <= products else "products"


def _node_counts(index: Index, germs: Sequence[Germ]) -> list[int]:
    """Return node counts of rules that integrate the fourth power exactly; at most the values of a discrete germ."""
    tops = zip(index.max(axis=0).tolist(), germs, strict=True)
    return [min(2 * q + 1, len(g.alpha)) if g.family == "discrete" else 2 * q + 1 for q, g in tops]


def _by_grid(unit: Array, index: Index, germs: Sequence[Germ]) -> tuple[Array, Array]:
    """Return E f^3 and E f^4 (C,) of coefficients (P, C), by sum factorisation over the inputs."""
    degrees = index.max(axis=0)
    values = np.zeros((int(np.prod(degrees + 1)), unit.shape[1]))
    values[np.ravel_multi_index(tuple(index.T), tuple(degrees + 1))] = unit
    weights, done = np.ones(1), 1
    for degree, germ, count in zip(degrees.tolist(), germs, _node_counts(index, germs), strict=True):
        nodes, rule = germ.gauss(count)
        table = germ.polynomials(nodes, degree)
        values = table @ values.reshape(done, degree + 1, -1)
        weights, done = np.multiply.outer(weights, rule).ravel(), done * len(nodes)
    values = values.reshape(done, -1)
    square = values * values
    values *= square
    third = weights @ values
    np.multiply(square, square, out=square)
    return third, weights @ square


def _by_products(unit: Array, table: ProductTable) -> tuple[Array, Array]:
    """Return E f^3 and E f^4 (C,) of coefficients (P, C), from the coefficients of f^2."""
    pairs = table.pairs
    square = table.matrix @ (unit[pairs[:, 0]] * unit[pairs[:, 1]])
    third = np.einsum("pc,pc->c", unit, square[table.position])
    return third, np.einsum("kc,kc->c", square, square)
