"""What a class of components declares: checked when the class is made, and told to `help`."""

from __future__ import annotations

import inspect
import time
from collections.abc import Mapping, Sequence

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.local import RESERVED
from uqmbd.mechanism.components.parameter import Parameter

__all__ = ["BEGUN", "python_signature", "require_declared"]

BEGUN = time.time()
"""When a component could be written first, s: code that is edited later may not be what runs."""


def require_declared(name: str, bodies: Sequence[str], parameters: Mapping[str, Parameter]) -> None:
    """Raise where parameters of the class of a name hide what `Local` offers, or speak of what there is not."""
    if hidden := sorted(RESERVED & parameters.keys()):
        raise StudyError(
            f"{name}: a parameter cannot be called {hidden[0]!r}: p.{hidden[0]} of terms() "
            "is something else; take another name."
        )
    points = tuple(key for key, other in parameters.items() if other.kind == "point")
    for key, parameter in parameters.items():
        for word, stated, there in (("body", parameter.body, bodies), ("about", parameter.about, points)):
            if stated and stated not in there:
                expected = ", ".join(map(repr, there)) or "nothing: there is none"
                raise StudyError(f"{name}: parameter {key!r}: {word} is {stated!r}; expected {expected}.")


def python_signature(
    bodies: Sequence[str], grounded: Sequence[str], parameters: Mapping[str, Parameter]
) -> inspect.Signature:
    """Return the arguments of a class of components."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parts = [inspect.Parameter(n, kind) for n in ("name", *bodies) if n not in grounded]
    rest = sorted(parameters.items(), key=lambda item: not item[1].required)
    parts += [inspect.Parameter(n, kind, default=inspect.Parameter.empty if p.required else p.default) for n, p in rest]
    parts += [inspect.Parameter(n, inspect.Parameter.KEYWORD_ONLY, default=None) for n in grounded]
    return inspect.Signature(parts)
