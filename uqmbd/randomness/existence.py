"""Up to which order the moments of inputs exist."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uqmbd.randomness.distributions import AffineDistribution, Tail, heaviest_tail, is_dependent, tail_of
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.variable import JointDistribution
from uqmbd.typing import Array

__all__ = ["exists", "moment_orders"]


MARGIN = 1.02
"""The order of a tail is measured: a moment exists if the order is above its own by this factor."""


def exists(moment: int, order: float) -> bool:
    """Return whether a moment is finite, for a variable whose moments are finite below an order.

    >>> exists(1, 1.0), exists(1, 1.2), exists(2, 1.2), exists(4, np.inf)
    (False, True, False, True)
    """
    return order > moment * MARGIN


def moment_orders(inputs: JointInput) -> dict[str, float]:
    """Return for each input, by name, the order below which its moments are finite: infinite for most.

    Inputs that depend on each other have the lowest order of their group.

    >>> import chaospy, uqmbd
    >>> a = uqmbd.RandomVariable("a", chaospy.Normal()); b = uqmbd.RandomVariable("b", chaospy.StudentT(3))
    >>> {name: round(order, 1) for name, order in moment_orders(JointInput.of([a, b])).items()}
    {'a': inf, 'b': 3.0}
    """
    found: dict[str, float] = {}
    for group in {id(v.joint): v.joint for v in inputs.variables}.values():
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
    """Orders of inputs that depend on each other, each with the others at their medians."""
    import chaospy

    distribution, count = joint.distribution, len(joint.names)
    if isinstance(distribution, chaospy.MvStudentT):  # conditional tails are lighter than those of the whole
        return [float(np.ravel(distribution._dist._owners[0][1]._parameters["a"])[0])]

    def tail(k: int) -> Tail:
        def conditional(u: Array) -> Array:
            uniform = np.full((len(u), count), 0.5)
            uniform[:, k] = u
            return joint.transform.inverse(uniform)[:, k]

        return tail_of(conditional)

    return [np.inf if joint.transform.law.discrete[k] else tail(k).moments for k in range(count)]
