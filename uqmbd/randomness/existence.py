"""Orders up to which the moments of inputs exist."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from uqmbd.randomness.distributions import AffineDistribution, Tail, heaviest_tail, is_dependent, tail_of
from uqmbd.randomness.variable import JointDistribution, RandomVariable
from uqmbd.typing import Array

__all__ = ["exists", "moment_orders"]


MARGIN = 1.02
"""Ratio of the measured order of a tail to the order of a moment above which the moment exists."""


def exists(moment: int, order: float) -> bool:
    """Return whether a moment is finite, if the variable has finite moments below `order`.

    >>> exists(1, 1.0), exists(1, 1.2), exists(2, 1.2), exists(4, np.inf)
    (False, True, False, True)
    """
    return order > moment * MARGIN


def moment_orders(variables: Iterable[RandomVariable]) -> dict[str, float]:
    """Return the order below which moments are finite, by the name of the input; infinite for most inputs.

    `variables` must contain whole groups of dependent inputs. Dependent inputs have the lowest order of their group.

    >>> import chaospy, uqmbd
    >>> a = uqmbd.RandomVariable("a", chaospy.Normal()); b = uqmbd.RandomVariable("b", chaospy.StudentT(3))
    >>> {name: round(order, 1) for name, order in moment_orders([a, b]).items()}
    {'a': inf, 'b': 3.0}
    """
    found: dict[str, float] = {}
    for group in {id(v.joint): v.joint for v in variables}.values():
        with np.errstate(all="ignore"):
            if is_dependent(group.distribution):
                order = min(_dependent(group))
                found |= dict.fromkeys(group.names, order)
            else:
                found |= {v.name: _order(v.distribution) for v in group.members()}
    return found


def _order(distribution: Any) -> float:
    law = AffineDistribution.of(distribution)
    return np.inf if law.discrete else heaviest_tail(law).moments


def _dependent(joint: JointDistribution) -> Sequence[float]:
    """Return the orders of dependent inputs, each with the other inputs at their medians."""
    import chaospy

    distribution, count = joint.distribution, len(joint.names)
    if isinstance(distribution, chaospy.MvStudentT):  # conditional tails are lighter than joint tails
        return [float(np.ravel(distribution._dist._owners[0][1]._parameters["a"])[0])]

    def tail(k: int) -> Tail:
        def conditional(u: Array) -> Array:
            uniform = np.full((len(u), count), 0.5)
            uniform[:, k] = u
            return joint.transform.inverse(uniform)[:, k]

        return tail_of(conditional)

    return [np.inf if joint.transform.law.discrete[k] else tail(k).moments for k in range(count)]
