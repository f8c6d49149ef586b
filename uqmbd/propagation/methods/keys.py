"""Reject outputs that methods with surrogates cannot approximate: those of sampled paths, and non-smooth summaries."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.randomness import JointInput

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism

__all__ = ["refused_key", "refused_output", "require_keys_accepted", "require_smooth_outputs"]


def refused_key(propagator: Propagator, inputs: JointInput) -> str | None:
    """Return the reason why a method cannot compute a mechanism with sampled paths, or None."""
    keys = [variable.name for variable in inputs.variables if variable.is_key]
    if not keys or propagator.input_treatment is not InputTreatment.INTERPOLATE:
        return None
    others = such_as(InputTreatment.AVERAGE_PATHS, InputTreatment.SAMPLE)
    return (
        f"the outputs depend on sampled paths of {', '.join(map(repr, keys))}, on which the method "
        f"{propagator.name!r} cannot build a surrogate. Use a method that accepts them{others}, or "
        "outputs of the stationary response"
    )


def refused_output(propagator: Propagator, mechanism: Mechanism) -> str | None:
    """Return the reason why a method cannot compute outputs that are not smooth functions of the inputs, or None."""
    from uqmbd.mechanism import not_smooth

    if propagator.input_treatment is InputTreatment.SAMPLE or not len(mechanism.inputs):
        return None
    for output in mechanism.observed():
        if quantity := not_smooth(output.expression):
            return (
                f"{output.name!r} contains {quantity}, which is not a smooth function of the inputs, so the method "
                f"{propagator.name!r} cannot approximate it by a surrogate. Use a method that samples the inputs"
                f"{such_as(InputTreatment.SAMPLE)}, or remove {output.name!r} from the mechanism of this method"
            )
    return None


def require_keys_accepted(propagator: Propagator, inputs: JointInput) -> None:
    """Raise if the outputs depend on sampled paths, and the method does not accept their keys."""
    if refused := refused_key(propagator, inputs):
        raise StudyError(f"{propagator.node_name}: {refused}.")


def require_smooth_outputs(propagator: Propagator, mechanism: Mechanism) -> None:
    """Raise if an output is not a smooth function of the inputs, and the method does not sample the inputs."""
    if refused := refused_output(propagator, mechanism):
        raise StudyError(f"{propagator.node_name}: {refused}.")
