"""What the statistics of a chaos cost: memory, and which route to the shape is taken."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from uqmbd import extend
from uqmbd.randomness.germs.germ import Germ
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos.terms import moments as chaos_moments
from uqmbd.results.chaos.terms import products as chaos_products
from uqmbd.typing import Index


def large(inputs: int, order: int, times: int) -> PolynomialChaos:
    """Return a chaos of ten outputs in normal and uniform germs."""
    families = ("hermite", "legendre")
    germs = tuple(Germ.classical(f"x{k}", families[k % 2]) for k in range(inputs))
    names = tuple(g.name for g in germs)
    index = index_set(inputs, order)
    values = np.random.default_rng(0).normal(size=(len(index), 10, times)) * 0.5 ** index.sum(axis=1)[:, None, None]
    axes = extend.labels([f"y{k}" for k in range(10)], names, np.arange(float(times)))
    return PolynomialChaos(values, index, GermSpace(names, germs, ()), axes)


def peak(action: Callable[[], object]) -> float:
    """Return the largest memory in MB that an action takes beyond what was there."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def route_of(index: Index, germs: Sequence[Germ], columns: int) -> str:
    """Return the route of as many coefficients that are not constant."""
    return chaos_moments.shape_route(np.ones((len(index), columns)), index, germs)


def test_the_route_is_chosen_by_cost() -> None:
    """Three inputs of order 10 take the grid, ten of order 3 (which would need 282 million nodes) the products."""
    for inputs, order, route in ((3, 10, "grid"), (10, 3, "products"), (1, 20, "grid")):
        index = index_set(inputs, order)
        germs = [Germ.classical("x", "hermite")] * inputs
        assert route_of(index, germs, 10_000) == route


def test_products_are_counted_exactly() -> None:
    """The number of non-zero products, by which the cost is known beforehand, is that of the table."""
    for inputs, order in ((2, 6), (5, 3)):
        germs = [Germ.classical("x", "hermite"), *[Germ.classical("y", "jacobi", 2.0, 3.0)] * (inputs - 1)]
        index = index_set(inputs, order)
        pairs, nonzeros = chaos_products.product_count(index, germs)
        table = chaos_products.product_table(index, germs)
        assert (len(table.pairs), table.matrix.nnz) == (pairs, nonzeros)


@pytest.mark.thorough
def test_memory_does_not_grow_with_outputs_and_times() -> None:
    """286 terms of 10 inputs of order 3: blocks of some 20 MB, whatever the number of outputs and times."""
    large(4, 1, 1).kurtosis.item(0)  # what is imported late is no memory of the statistics
    chaos = large(10, 3, 100)
    assert peak(lambda: chaos.std) < 25
    assert peak(lambda: (chaos.sobol_first, chaos.sobol_total, chaos.sobol_second)) < 25
    assert peak(lambda: chaos.kurtosis) < 40


def test_too_many_products_are_replaced_by_samples() -> None:
    """Where neither exact route is possible; they were an error, for which finished runs were thrown away."""
    index = np.concatenate([np.zeros((1, 40), dtype=int), np.eye(40, dtype=int), 2 * np.eye(40, dtype=int)])
    germs = [Germ.classical("x", "hermite")] * 40
    assert route_of(index, germs, 1) == "products"
    with pytest.MonkeyPatch.context() as patch:
        pairs, products = chaos_products.product_count(index, germs)
        for most in (pairs - 1, products - 1):
            patch.setattr(chaos_moments, "MAX_PRODUCTS", most)
            assert route_of(index, germs, 1) == "samples"
