"""Messages on parameters of a model that are not finite at the means of the inputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.dynamics.equations import Instance, Model
from uqmbd.mechanism import Mechanism, as_symbolic, flatten
from uqmbd.randomness import RandomVariable

__all__ = ["not_finite"]

LENGTH = 200
"""Largest number of characters of an expression in a message."""


def not_finite(
    mechanism: Mechanism,
    model: Model,
    instances: Sequence[Instance],
    expressions: Sequence[sympy.Expr],
    values: NDArray[np.float64],
) -> str:
    """Return a message on a parameter that is not finite, with its owner and the inputs.

    The values (P,) of the expressions (P,) are those at the means of the inputs; at least one is not finite.  The
    parameters of the instances come first.  An example is
    ``body 'rod': its given pose is nan at the means of the inputs: angle = asin(x); x = 2``.
    """
    wrong = np.flatnonzero(~np.isfinite(values))
    # report an undefined pose first, because counters of angles depend on it
    k = int(next(iter(np.intersect1d(wrong, model.drawn)), wrong[0]))
    owner, what, expression = _origin(mechanism, model, instances, k, expressions[k])
    inputs = mechanism.inputs
    means = dict(zip(inputs.names, inputs.means.tolist(), strict=True))
    needed = sorted(str(s) for s in expression.free_symbols if str(s) in means)
    shown = str(expression)
    text = shown if len(shown) <= LENGTH else f"{shown[:LENGTH]} ..."
    at = ", ".join(f"{name} = {means[name]:g}" for name in needed)
    return (
        f"{owner}: {what[0]} is {values[k]:g} at the means of the inputs: {what[1]} = {text}{f'; {at}' if at else ''}"
    )


def _origin(
    mechanism: Mechanism, model: Model, instances: Sequence[Instance], k: int, expression: sympy.Expr
) -> tuple[str, tuple[str, str], sympy.Expr]:
    """Return the owner of parameter `k`, its description and name, and the expression of the user."""
    first = 0
    for instance in instances:
        last = first + len(instance.parameters)
        if k < last:
            component = instance.component
            name = next(
                (n for n, v in component.values.items() if any(x == expression for x in flatten(v))), "an expression"
            )
            owner = f"{type(component).__name__} {component.name!r}"
            return owner, (f"its parameter {name!r}" if name != "an expression" else "a parameter", name), expression
        first = last
    if first + model.of_bodies <= k < first + model.layout.coordinates:
        owner, name, _ = model.own[k - first - model.of_bodies]
        return f"component {owner!r}", (f"the initial value of its coordinate {name!r}", name), expression
    if k < first + model.of_bodies:
        body = list(mechanism.bodies.values())[(k - first) // model.size]
        coordinate = (k - first) % model.size
        pose = ("its given pose", mechanism.space.coordinates[coordinate])
        turned = as_symbolic(body.pose.angle)
        if coordinate >= model.dimension and mechanism.space.turns and model.dimension == 2 and turned.free_symbols:
            # the half-angle pair is not the user's expression
            return f"body {body.name!r}", (pose[0], "angle"), turned
        return f"body {body.name!r}", pose, expression
    for statement in model.statements:
        if k in statement.parameters:
            quantity = statement.quantity
            return f"body {statement.body!r}", (f"its {quantity.replace('_', ' ')}", quantity), expression
    for limit in model.limits:
        if k == limit.index:
            return f"mechanism {mechanism.name!r}", (f"the {limit.name}", limit.name.partition(" of ")[0]), expression
    for tensor in model.tensors:
        if k in tensor.index:
            return f"body {tensor.body!r}", ("its inertia", "inertia"), expression
    if isinstance(expression, RandomVariable):
        return f"mechanism {mechanism.name!r}", ("a number in a start condition", str(expression)), expression
    return f"mechanism {mechanism.name!r}", ("a time at which a force or a driver changes", "time"), expression
