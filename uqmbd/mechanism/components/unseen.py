"""Numbers of components that are 1, or 2: a product with one of them, or half of it, shows nothing of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import sympy

from uqmbd.mechanism.components.component import Component
from uqmbd.mechanism.expressions import flatten
from uqmbd.units import Dimension, read_units

__all__ = ["unseen_in"]

VANISHING = (1, -1, 2, -2, sympy.Rational(1, 2), sympy.Rational(-1, 2))
"""Numbers that leave a product, alone or with the half of an energy; 2.0 stays as 1.0."""


def unseen_in(components: Iterable[Component]) -> Callable[[], set[Dimension]]:
    """Return a function that returns the dimensions of the values that vanish from products; see `check_dimensions`.

    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> unseen_in(mechanism.all_components())() == {read_units("kg").dimension}
    True
    """

    def dimensions() -> set[Dimension]:
        found: set[Dimension] = set()
        for component in components:
            for key, parameter in component.parameters().items():
                unit = read_units(parameter.units) if parameter.kind != "option" else None
                values = flatten(component.values.get(key, ())) if unit is not None else []
                if unit is not None and any(x in VANISHING for x in values):
                    found.add(unit.dimension)
        return found

    return dimensions
