"""Messages on drivers, forces and lengths that are not finite in the equations of a realisation."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.typing import Array

__all__ = ["REMEDY", "ahead", "describe_undefined"]


REMEDY = "Look for divisions by zero, and for roots, logarithms and powers outside of their range."

AHEAD = (1e-9, 1e-6, 1e-4)
"""Relative parts of the remaining time at which a stopped integration may have evaluated the equations."""


def describe_undefined(model: Model, q: Array, s: Array, v: Array, time: float, parameters: Array) -> str:
    """Return a message on an equation or force of one realisation that is not finite in a state, or an empty text."""
    states, own = state_arguments(time, q[None], s[None], v[None]), parameters[None]
    at = f"at t = {time:.6g} s"
    with np.errstate(all="ignore"):
        found = {kind: model.evaluate(kind, states, own) for kind in ("position", "velocity", "acceleration")}
    for kind, name, what in (
        ("position", "phi", "the equation"),
        ("velocity", "phi_t", "the rate in time of the equation"),
        ("acceleration", "gamma", "the second derivative in time of the equation"),
    ):
        values = found[kind][name][0]
        if (wrong := np.flatnonzero(~np.isfinite(values))).size:
            k = int(wrong[0])
            return (
                f"{what} {model.equations[k]!r} is {values[k]:g} {at}: an argument of {model.owners[k]!r}, such as a "
                f"driver's function of time, has no finite value there. {REMEDY}"
            )
    for name, what in (("force", "the force on"), ("mass", "the mass or inertia of")):
        rows = found["acceleration"][name][0].reshape(model.layout.coordinates, -1)
        if (wrong := np.flatnonzero(~np.isfinite(rows).all(axis=1))).size:
            value = rows[wrong[0]][~np.isfinite(rows[wrong[0]])][0]
            carrier, k = model.carrier(int(wrong[0])), int(wrong[0]) // model.size
            acting = model.acting[k] if k < len(model.acting) else ()
            names = [repr(x) for x in acting] if name == "force" else []
            whose = "one of " + ", ".join(names) if len(names) > 1 else (names or ["a component"])[0]
            return f"{what} {carrier} is {value:g} {at}: {whose} has no finite value there. {REMEDY}"
    return ""


def ahead(model: Model, states: tuple[Array, Array, Array], span: tuple[float, float], parameters: Array) -> str:
    """Return a message on a term that is undefined right after a stop; `span`: times of stop and target, s."""
    now, end = span
    for part in AHEAD:
        if text := describe_undefined(model, *states, now + part * (end - now), parameters):
            return text
    return ""
