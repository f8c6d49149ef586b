"""Refusal of keys of sampled paths by methods that do not accept them."""

from __future__ import annotations

from uqmbd import plugins
from uqmbd.errors import StudyError
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.randomness import JointInput

__all__ = ["refused_key", "require_keys_accepted"]


def refused_key(propagator: Propagator, inputs: JointInput) -> str | None:
    """Return the reason why a method cannot compute a mechanism with sampled paths, or None."""
    keys = [variable.name for variable in inputs.variables if variable.is_key]
    if not keys or propagator.accepts_keys:
        return None
    found = plugins.propagators().items()
    known = ", ".join(repr(name) for name, method in found if getattr(method, "accepts_keys", False)) or "none"
    return (
        f"the outputs depend on sampled paths of {', '.join(map(repr, keys))}, on which the method "
        f"{propagator.name!r} cannot build a surrogate. Use a method that accepts them ({known}), or outputs of the "
        "stationary response"
    )


def require_keys_accepted(propagator: Propagator, inputs: JointInput) -> None:
    """Raise if the outputs depend on sampled paths, and the method does not accept their keys."""
    if refused := refused_key(propagator, inputs):
        raise StudyError(f"{propagator.node_name}: {refused}.")
