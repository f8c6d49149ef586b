"""Hash of all data of a model that affect the motion and the outputs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import fields

import sympy

from uqmbd.dynamics.equations import Instance
from uqmbd.mechanism import Mechanism, coordinates_of

__all__ = ["digest_of"]


def digest_of(mechanism: Mechanism, instances: list[Instance], controllers: Iterable[str]) -> str:
    """Return the hash of all symbols that affect the motion and the outputs, and of the controllers.

    Expressions are converted by `sympy.srepr`, because readable texts omit tables and digits of numbers.
    """
    text = hashlib.sha256()
    for i in instances:
        text.update(repr((i.type.digest, i.component.name, [x.name for x in i.owners])).encode())
        text.update(sympy.srepr(i.parameters).encode())
        if i.held:
            text.update(sympy.srepr(i.held).encode())
        for c in i.excitations:
            text.update(f"{sympy.srepr(c.source)} {sympy.srepr(c.argument)} {c.order}".encode())
    for output in mechanism.observed():
        text.update(f"{output.name} {sympy.srepr(output.expression)}".encode())
    for body in mechanism.bodies.values():
        pose = tuple(getattr(body.pose, x.name) for x in fields(body.pose))
        text.update(f"{body.name} {sympy.srepr(pose)}".encode())
    for one in (x for i in instances if (x := coordinates_of(i.component)) is not None):
        values = [(name, c.units, sympy.srepr((c.initial, c.rate, c.largest))) for name, c in one.declared.items()]
        text.update(f"{one.name} {values}".encode())
    for condition in mechanism.conditions.values():
        text.update(sympy.srepr(condition.residual).encode())
    for controller in controllers:
        text.update(controller.encode())
    return text.hexdigest()
