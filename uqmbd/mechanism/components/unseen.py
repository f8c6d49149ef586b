"""Numbers of components that are 1: a product with one of them shows nothing of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from uqmbd.mechanism.components.component import Component
from uqmbd.mechanism.expressions import flatten
from uqmbd.units import Dimension, read_units

__all__ = ["unseen_in"]


def unseen_in(components: Iterable[Component]) -> Callable[[], set[Dimension]]:
    """Return what returns the dimensions of numbers that are 1 or -1; see `check_dimensions`.

    Examples
    --------
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
                if unit is not None and any(x in (1, -1) for x in values):
                    found.add(unit.dimension)
        return found

    return dimensions
