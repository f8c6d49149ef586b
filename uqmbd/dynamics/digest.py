"""Hash of a model: of all data that the motion and the outputs depend on."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import fields

import sympy

from uqmbd.dynamics.equations import Instance
from uqmbd.mechanism import Mechanism

__all__ = ["digest_of"]


def digest_of(mechanism: Mechanism, instances: list[Instance], controllers: Iterable[str]) -> str:
    """Return the hash of all symbols that the motion and the outputs depend on, and of the controllers.

    Expressions are written by `sympy.srepr`: the text that people read leaves out tables, and digits of numbers.
    """
    text = hashlib.sha256()
    for i in instances:
        text.update(repr((i.type.digest, i.component.name, [b.name for b in i.bodies])).encode())
        text.update(sympy.srepr(i.parameters).encode())
        if i.held:
            text.update(sympy.srepr(i.held).encode())
    for output in mechanism.observed():
        text.update(f"{output.name} {sympy.srepr(output.expression)}".encode())
    for body in mechanism.bodies.values():
        pose = tuple(getattr(body.pose, x.name) for x in fields(body.pose))
        text.update(f"{body.name} {sympy.srepr(pose)}".encode())
    for condition in mechanism.conditions.values():
        text.update(sympy.srepr(condition.residual).encode())
    for controller in controllers:
        text.update(controller.encode())
    return text.hexdigest()
