"""Components with typed arguments for editors and type checkers."""

from __future__ import annotations

from typing import Any, dataclass_transform

from uqmbd.mechanism.components.component import Component
from uqmbd.mechanism.components.declaration import require_annotated
from uqmbd.mechanism.components.parameter import Parameter

__all__ = ["TypedComponent"]


# Attributes of the decorated class are not arguments; `name`, an attribute of the next class, is an argument.
@dataclass_transform(eq_default=False, field_specifiers=(Parameter,))
class _Fields(Component):
    """Base class for type checkers: annotations of subclasses are arguments of the constructor (PEP 681)."""


class TypedComponent(_Fields):
    """A `uqmbd.Component` with annotated bodies and parameters, for editors and type checkers.

    The annotation of a body is `uqmbd.extend.NamedFrame`; the annotation of a parameter is ``uqmbd.Parameter[type]``.
    The type of the argument is `uqmbd.typing.Quantity`, `uqmbd.typing.Vector`, or the type of an option.  Bodies come
    first, then parameters without a default, then parameters with a default.  mypy and pyright then detect a wrong
    keyword, a wrong body and a missing argument in scripts, without a plugin.

    Type checkers do not see the arguments ``at=`` and ``axis=`` and optional bodies. To declare types for these
    arguments, derive the component from `uqmbd.Component` and declare ``__init__``, with overloads, below
    ``if typing.TYPE_CHECKING:``.

    Raises
    ------
    uqmbd.StudyError
        At the definition of the class, if an annotation is missing or would declare wrong arguments to type checkers.

    Examples
    --------
    A constraint holds a particle on a circle about the world's origin:

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
