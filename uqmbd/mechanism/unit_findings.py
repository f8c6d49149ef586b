"""Collect findings on the units of a mechanism; each finding is also a warning at the line of its cause."""

from __future__ import annotations

import sympy

from uqmbd.mechanism.declared import unseen_numbers
from uqmbd.mechanism.expressions import flatten, mismatches
from uqmbd.mechanism.mechanism import Mechanism
from uqmbd.units import spelling

__all__ = ["find_unit_problems"]


def find_unit_problems(mechanism: Mechanism) -> tuple[str, ...]:
    """Return sentences on wrong units of outputs, requirements, start conditions, parameters and random variables."""
    unseen = unseen_numbers(mechanism)
    stated = [
        (f"output {o.name!r}", o.expression, o.units)
        for o in (*mechanism.outputs.values(), *mechanism.scalars.values())
    ]
    stated += [(f"requirement {name!r}", margin.expression, "") for name, margin in mechanism.margins.items()]
    stated += [(f"start condition {x.text}", x.residual, "") for x in mechanism.conditions.values()]
    for component in mechanism.all_components():
        kind = f"body {component.name!r}" if component.offered else f"{type(component).__name__} {component.name!r}"
        for key, parameter in component.parameters().items():
            value = component.values.get(key)
            if parameter.kind == "option":  # it may be a law, whose result has the units of the parameter
                stated += [(f"{kind}: {key}", value, parameter.units)] if isinstance(value, sympy.Expr) else []
            elif parameter.kind not in ("axis", "turning_axis", "rotation") and value is not None:
                stated += [(f"{kind}: {key}", x, parameter.units) for x in flatten(value)]
    texts = [(f"random variable {x.name!r}", x.units) for x in mechanism.inputs.variables]
    texts += [(where, units) for where, _, units in stated]
    statements = [sentence for where, units in texts if (sentence := spelling(where, units))]
    statements += [x.text for where, value, units in stated for x in mismatches(where, value, units, unseen)]
    return tuple(dict.fromkeys(statements))
