"""Parameters of conditional distributions, as expressions in the values of other members."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.typing import Array

__all__ = [
    "MemberValue",
    "Expression",
    "NotUnderstood",
    "Operation",
    "decoded",
    "encoded",
    "evaluated",
    "owners_of",
    "read",
    "used",
]


class NotUnderstood(Exception):
    """The structure of a part of a chaospy distribution is unknown; the message names the part."""


@dataclass(frozen=True)
class MemberValue:
    """Value of a member of the joint distribution."""

    place: int  # index in the joint distribution


@dataclass(frozen=True)
class Operation:
    """Operation on two expressions."""

    kind: str  # one of `OPERATIONS`
    left: Expression
    right: Expression


Expression = float | MemberValue | Operation

OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "sum": np.add,
    "product": np.multiply,
    "power": np.power,
    "logarithm": lambda x, base: np.log(x) / np.log(base),
}


def evaluated(expression: Expression, values: Array) -> Any:
    """Evaluate an expression at values of all members, shape (n, N): a number, or an array of shape (N,)."""
    if isinstance(expression, MemberValue):
        return values[expression.place]
    if isinstance(expression, Operation):
        left, right = evaluated(expression.left, values), evaluated(expression.right, values)
        return OPERATIONS[expression.kind](left, right)
    return expression


def used(expression: Expression) -> frozenset[int]:
    """Return the indices of the members on which an expression depends."""
    if isinstance(expression, MemberValue):
        return frozenset({expression.place})
    if isinstance(expression, Operation):
        return used(expression.left) | used(expression.right)
    return frozenset()


def encoded(expression: Expression) -> Any:
    """Return an expression as numbers, texts and lists."""
    if isinstance(expression, MemberValue):
        return expression.place
    if isinstance(expression, Operation):
        return [expression.kind, encoded(expression.left), encoded(expression.right)]
    return float(expression)


def decoded(data: Any) -> Expression:
    """Return the expression from its :func:`encoded` form.

    >>> decoded(["product", 0.2, 0])
    Operation(kind='product', left=0.2, right=MemberValue(place=0))
    """
    if isinstance(data, list):
        kind, left, right = data
        if kind not in OPERATIONS:
            raise ValueError(f"unknown operation {kind!r}")
        return Operation(kind, decoded(left), decoded(right))
    return MemberValue(data) if isinstance(data, int) else float(data)


def read(value: Any, places: Mapping[tuple[int, int], int], component: int = 0) -> Expression:
    """Return a parameter of a distribution of chaospy as an expression.

    `places` contains the index of each earlier member, keyed by the identity of its distribution and the component in
    it. `component` selects a component of a value with several. Raise NotUnderstood if the value is not an expression.
    """
    import chaospy

    if not isinstance(value, chaospy.Distribution):
        numbers = np.ravel(np.asarray(value, dtype=float))
        if len(numbers) != 1 and component >= len(numbers):
            raise NotUnderstood(f"a parameter of the shape {np.shape(value)}")
        return float(numbers[0 if len(numbers) == 1 else component])
    if (id(value), component) in places:
        return MemberValue(places[id(value), component])
    given = value._parameters
    if isinstance(value, chaospy.ItemDistribution):
        return read(given["parent"], places, int(given["index"]))
    if isinstance(value, chaospy.J):
        owned, owner = owners_of(value)[component]
        return read(owner, places, owned)
    if isinstance(value, chaospy.Negative):
        return Operation("product", -1.0, read(given["left"], places, component))
    kinds = {chaospy.Add: "sum", chaospy.Multiply: "product", chaospy.Power: "power", chaospy.Logn: "logarithm"}
    for kind, name in kinds.items():
        if isinstance(value, kind):
            return Operation(name, read(given["left"], places, component), read(given["right"], places, component))
    raise NotUnderstood(str(value))


def owners_of(distribution: Any) -> Mapping[int, tuple[int, Any]]:
    """Return, for each component of a ``chaospy.J``, its index in the member that contains it, and this member.

    The members of a ``J`` are distributions of one or several components. The table of chaospy, ``_owners``, is
    incomplete if members follow a vector. The missing members are then among the other entries of the table and the
    arguments of the ``J``. The dependences of each component, which chaospy also stores, determine their order. Raise
    NotUnderstood if they fit no member, or several.
    """
    import chaospy

    found: Mapping[int, tuple[int, Any]] = distribution._owners
    count = len(distribution)
    if set(found) == set(range(count)):
        return found
    arguments = [x for name, x in sorted(distribution._parameters.items()) if name.startswith("_")]
    # search the table first: chaospy.Binomial is a J as well, so the arguments of a J contain its size and probability
    # instead of the variable itself, and these may have the dependences of another member
    kinds = [{id(x): x for x in part} for part in ([owner for _, owner in found.values()], arguments)]
    rows: list[tuple[int, Any]] = []
    while len(rows) < count:
        rest = distribution._dependencies[len(rows) :]
        fitting: list[Any] = []
        for candidates in kinds:
            fitting = fitting or [
                x
                for x in candidates.values()
                if isinstance(x, chaospy.Distribution) and x._dependencies == rest[: len(x)]
            ]
        if len(fitting) != 1:
            raise NotUnderstood(f"{distribution}, whose members after a vector chaospy ignores (put vectors last),")
        rows += [(place, fitting[0]) for place in range(len(fitting[0]))]
    return dict(enumerate(rows))
