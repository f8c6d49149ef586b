"""Names of installed methods with a property, for messages: the core does not know the methods of plugins by name."""

from __future__ import annotations

from collections.abc import Callable

from uqmbd.plugins.input_treatment import InputTreatment
from uqmbd.plugins.registry import propagators

__all__ = ["example_of", "method_with_option", "such_as"]


def such_as(*treatments: InputTreatment, searches_violations: bool = False) -> str:
    """Return ", such as 'a' or 'b'" with installed methods, to continue a sentence; empty if there is none.

    The methods have one of `treatments`, or search for violations of requirements if `searches_violations`.

    >>> such_as(InputTreatment.INTERPOLATE)
    ", such as 'collocation' or 'galerkin'"
    """

    def is_suitable(method: type) -> bool:
        if searches_violations:
            return getattr(method, "searches_violations", False) is True
        return _treatment(method) in treatments

    names = [repr(name) for name in _names(is_suitable)]
    if len(names) > 2:
        names = [", ".join(names[:-1]), names[-1]]
    return f", such as {' or '.join(names)}" if names else ""


def example_of(treatment: InputTreatment, options: str = "...") -> str:
    """Return a call of the first installed method with a treatment of inputs, for examples in messages.

    >>> example_of(InputTreatment.SAMPLE)
    'MonteCarlo(...)'
    """
    methods = propagators()
    names = _names(lambda method: _treatment(method) is treatment)
    return f"{methods[names[0]].__name__ if names else 'Method'}({options})"


def method_with_option(name: str, default: str) -> str:
    """Return the class name of the first installed method with an option; `default` if no method has it.

    >>> method_with_option("alignment", "a method")
    'Collocation'
    """
    methods = propagators()
    found = _names(lambda method: name in getattr(method, "__dataclass_fields__", ()))
    return methods[found[0]].__name__ if found else default


def _names(is_suitable: Callable[[type], bool]) -> list[str]:
    """Return the registered names of the installed methods that a function accepts, in alphabetical order."""
    return sorted(name for name, method in propagators().items() if is_suitable(method))


def _treatment(method: type) -> object:
    return getattr(method, "input_treatment", None)
