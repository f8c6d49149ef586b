"""Quadrature rules over the germs, and their accuracy for the projection on a basis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Count, Seed, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.randomness.designs import sampling_design
from uqmbd.randomness.index_sets import whole_number
from uqmbd.randomness.quadrature.nested import nested_count, nested_exactness, nested_rule
from uqmbd.randomness.space import GermSpace
from uqmbd.typing import Array

__all__ = [
    "MOST_NODES",
    "Quadrature",
    "check_size",
    "clenshaw_curtis",
    "gauss_tensor",
    "gram_error",
    "monte_carlo_rule",
    "tensor_rule",
]


MOST_NODES = 20_000_000
"""Largest size (nodes times germs) of a rule; a larger size is a mistake, and would fill the memory."""


FINEST = 62
"""Highest level of nested rules; each level doubles the number of nodes."""


@typechecked
@dataclass(frozen=True, eq=False)
class Quadrature:
    """Nodes and weights for the expectation of functions of the germs.

    Parameters
    ----------
    nodes : array, shape (K, d)
        Germ points.
    weights : array, shape (K,)
        Weights with the sum 1; sparse rules have negative weights.
    exactness : int or None
        Highest total degree of polynomials in the germs that the rule integrates exactly; None if unknown.
    name : str
        Name of the rule, for messages.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    >>> rule = gauss_tensor(space, 3)
    >>> round(float(rule.weights @ rule.nodes[:, 0] ** 4), 12), rule.exactness
    (0.2, 5)
    """

    nodes: Array
    weights: Array
    exactness: int | None
    name: str

    def __len__(self) -> int:
        return len(self.weights)


@typechecked
def gauss_tensor(space: GermSpace, counts: int | Sequence[int]) -> Quadrature:
    """Return the product of Gauss rules.

    Parameters
    ----------
    space : GermSpace
        Space of the ``d`` germs.
    counts : int or sequence of int, length d
        Number of nodes for each germ. A rule of n nodes is exact to the degree ``2 n - 1`` in its germ.

    Returns
    -------
    Quadrature
        Rule of ``prod(counts)`` nodes; the last germ changes fastest.

    Raises
    ------
    uqmbd.StudyError
        If a count is invalid, or the nodes do not fit into memory.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> rule = uqmbd.extend.gauss_tensor(space, 3)
    >>> rule.nodes.ravel().round(6).tolist(), rule.weights.round(6).tolist()
    ([-1.732051, 0.0, 1.732051], [0.166667, 0.666667, 0.166667])
    >>> round(float(rule.weights @ rule.nodes[:, 0] ** 4), 9)  # the fourth moment of the standard normal
    3.0
    """
    numbers = _each(space, counts, "gauss_tensor: counts")
    for germ, count in zip(space.germs, numbers, strict=True):
        whole_number(count, f"gauss_tensor: the number of nodes of {germ.name!r}", 1)
    check_size(int(np.prod(numbers, dtype=object)), space, "gauss_tensor")
    nodes, weights = tensor_rule([germ.gauss(count) for germ, count in zip(space.germs, numbers, strict=True)])
    known = [2 * n - 1 for germ, n in zip(space.germs, numbers, strict=True) if n != germ.values]
    name = f"Gauss tensor, {' x '.join(str(n) for n in numbers)} nodes"
    return Quadrature(nodes, weights, min(known) if known else None, name)


@typechecked
def clenshaw_curtis(space: GermSpace, level: int | Sequence[int]) -> Quadrature:
    """Return the product of nested rules with Chebyshev nodes in the probability of each germ.

    A germ of bounded support gets the rule of Clenshaw and Curtis (Numer. Math. 2 (1960) 197) with 1, 3, 5, 9, ...
    nodes. Any other germ gets Fejer's second rule, which excludes the ends, with 1, 3, 7, 15, ... nodes. For a uniform
    germ, the rule is exact up to the degree that equals its number of nodes. For any other germ, the quantile function
    maps the nodes: the rule is nested, but exact for constants only. The rule converges slowly for functions that grow
    in a tail; Gauss rules are preferable for such functions.

    Parameters
    ----------
    space : GermSpace
        Space of the ``d`` germs.
    level : int or sequence of int, length d
        Level of each germ: 0 for one node; each further level halves the distances between nodes.

    Raises
    ------
    uqmbd.StudyError
        If a level is invalid, or the nodes do not fit into memory.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    >>> clenshaw_curtis(space, 1).nodes[:, 0].tolist(), clenshaw_curtis(space, 1).exactness
    ([-1.0, 0.0, 1.0], 3)
    """
    levels = [
        whole_number(n, f"clenshaw_curtis: the level of {germ.name!r}", 0)
        for germ, n in zip(space.germs, _each(space, level, "clenshaw_curtis: level"), strict=True)
    ]
    if max(levels, default=0) > FINEST:
        raise StudyError(f"clenshaw_curtis: level is {shown(level)}; expected whole numbers up to {FINEST}.")
    counts = [nested_count(germ, n) for germ, n in zip(space.germs, levels, strict=True)]
    check_size(int(np.prod(counts, dtype=object)), space, "clenshaw_curtis")
    nodes, weights = tensor_rule([nested_rule(germ, n) for germ, n in zip(space.germs, levels, strict=True)])
    exactness = min((nested_exactness(germ, n) for germ, n in zip(space.germs, levels, strict=True)), default=None)
    name = f"Clenshaw-Curtis tensor, {' x '.join(str(n) for n in counts)} nodes"
    return Quadrature(nodes, weights, exactness, name)


@typechecked
def monte_carlo_rule(space: GermSpace, count: Count, seed: Seed, sequence: str = "random") -> Quadrature:
    """Return samples with equal weights.

    Parameters
    ----------
    space : GermSpace
        Space of the germs.
    count : int
        Number of samples; for ``"sobol"``, a power of two keeps the sequence balanced.
    seed : int
        Seed of the random numbers or of the scrambling.
    sequence : str
        Name of a sampling design: ``"random"``, ``"latin-hypercube"``, ``"sobol"``, ``"halton"``, or one of a plugin.

    Returns
    -------
    Quadrature
        Rule with equal weights, which is exact for constants only: ``exactness`` is 0.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    >>> rule = monte_carlo_rule(space, 1024, seed=1, sequence="sobol")
    >>> bool(abs(rule.weights @ rule.nodes[:, 0] ** 2 - 1 / 3) < 1e-3)
    True
    """
    whole_number(count, "monte_carlo_rule: count", 1)
    whole_number(seed, "monte_carlo_rule: seed", 0)
    design = sampling_design(sequence, "monte_carlo_rule: sequence")
    check_size(count, space, "monte_carlo_rule")
    uniform = design.points(space.dimension, count, seed)
    weights = np.full(count, 1 / count)
    return Quadrature(space.from_uniform(uniform), weights, 0, f"{count} samples, {sequence}")


@typechecked
def gram_error(space: GermSpace, quadrature: Quadrature, multi_index: ArrayLike) -> float:
    """Return the largest error of a rule for products of all pairs of a basis.

    The projection on a basis needs the integrals of products of its terms. A wrong integral mixes coefficients of terms
    (internal aliasing; Conrad and Marzouk, SIAM J. Sci. Comput. 35 (2013) A2643).

    Parameters
    ----------
    space : GermSpace
        Space of the germs.
    quadrature : Quadrature
        Rule to test.
    multi_index : array_like of int, shape (P, d)
        Degrees of the basis polynomials.

    Returns
    -------
    float
        Largest entry of ``abs(Psi.T @ W @ Psi - identity)``. Below 1e-10 the rule suits the basis; above 0.1 it does
        not.

    Raises
    ------
    uqmbd.StudyError
        If basis and space have different numbers of germs.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput, index_set
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(0, 1))]))
    >>> gram_error(space, gauss_tensor(space, 4), index_set(1, 3)) < 1e-12
    True
    >>> round(gram_error(space, gauss_tensor(space, 3), index_set(1, 3)), 6)
    1.0
    """
    index = np.asarray(multi_index)
    if index.ndim != 2:
        raise StudyError(f"gram_error: multi_index is {shown(index)}; expected degrees of terms, shape (P, d).")
    gram = np.zeros((len(index), len(index)))
    block = max(1, 4_000_000 // max(1, len(index)))
    for first in range(0, len(quadrature), block):
        psi = space.evaluate(quadrature.nodes[first : first + block], index)
        gram += (psi * quadrature.weights[first : first + block, None]).T @ psi
    return float(np.abs(gram - np.eye(len(index))).max(initial=0.0))


def tensor_rule(rules: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return nodes (K, d) and weights (K,) of the product of one-dimensional rules.

    >>> tensor_rule([(np.array([1.0, 2.0]), np.array([0.5, 0.5])), (np.array([3.0]), np.array([1.0]))])[0].tolist()
    [[1.0, 3.0], [2.0, 3.0]]
    """
    counts = [len(weights) for _, weights in rules]
    nodes = np.empty((int(np.prod(counts)), len(rules)))
    weights = np.ones(len(nodes))
    repeat = len(nodes)
    for k, (points, rule) in enumerate(rules):
        repeat //= counts[k]
        place = np.arange(len(nodes)) // repeat % counts[k]
        nodes[:, k] = points[place]
        weights *= rule[place]
    return nodes, weights


def _each(space: GermSpace, value: int | Sequence[int], what: str) -> list[int]:
    numbers: list[int] = [value] * space.dimension if np.ndim(value) == 0 else np.asarray(value).tolist()  # type: ignore[list-item]
    if len(numbers) != space.dimension:
        raise StudyError(
            f"{what} has {len(numbers)} entries; expected one number for all germs, or one number for each of the "
            f"{space.dimension} germs ({', '.join(space.names)})."
        )
    return numbers


def check_size(count: int, space: GermSpace, where: str) -> None:
    """Raise StudyError if a rule would fill the memory."""
    if count * max(1, space.dimension) > MOST_NODES:
        raise StudyError(
            f"{where}: {count} nodes for {space.dimension} germs exceed the limit of {MOST_NODES} numbers. Use a "
            "sparse grid, regression, or fewer nodes for germs with little influence."
        )
