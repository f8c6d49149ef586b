"""Components whose arguments are known to editors and type checkers."""

from __future__ import annotations

from typing import Any, dataclass_transform

from uqmbd.mechanism.components.component import Component
from uqmbd.mechanism.components.declaration import require_annotated
from uqmbd.mechanism.components.parameter import Parameter

__all__ = ["TypedComponent"]


# Attributes of the class that has the decorator are no arguments: `name` is one in the class below.
@dataclass_transform(eq_default=False, field_specifiers=(Parameter,))
class _Fields(Component):
    """Base for type checkers of classes whose annotations are the arguments of the constructor (PEP 681)."""


class TypedComponent(_Fields):
    """A `uqmbd.Component` whose bodies and parameters are annotated, for editors and type checkers.

    A body is annotated by `uqmbd.extend.NamedFrame`, a parameter by ``uqmbd.Parameter[type]`` with the type of what is
    given:
    `uqmbd.typing.Quantity`, `uqmbd.typing.Vector`, or that of an option.  Bodies come first, then parameters, those
    with a default last.  mypy and pyright then find a wrong keyword, a wrong body and a missing argument in scripts,
    without a plugin.

    What a component takes besides (``at=`` and ``axis=``, bodies that may be left out) they do not see: one that is
    for them derives from `uqmbd.Component` and states ``__init__``, with overloads, below
    ``if typing.TYPE_CHECKING:``.

    Raises
    ------
    uqmbd.StudyError
        When the class is made: if an annotation is missing, or checkers would see other arguments than there are.

    Examples
    --------
    A particle held on a circle about the world's origin:

    >>> import uqmbd
    >>> from uqmbd.typing import Quantity
    >>> class Circle(uqmbd.extend.TypedComponent):
    ...     '''A particle stays on a circle.'''
    ...     bodies = ("body",)
    ...     body: uqmbd.extend.NamedFrame
    ...     radius: uqmbd.Parameter[Quantity] = uqmbd.Parameter("m", "radius of the circle")
    ...     def terms(self, p):
    ...         r = p.body.position
    ...         yield uqmbd.Constraint(r.dot(r) - p.radius**2)
    >>> Circle.signature()
    '(name, body, radius)'
    >>> Circle.__doc__.splitlines()[-2:]
    ['radius : number or expression [m]', '    Radius of the circle.']
    """

    name: str

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        require_annotated(cls)
