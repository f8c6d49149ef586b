"""The model of a mechanism that has something to observe, with the steps that a user asks for."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError, StudyWarning
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.dynamics import Ensemble, Model
    from uqmbd.mechanism import Mechanism

__all__ = [
    "not_unique_attribute",
    "notices_attribute",
    "observed_model",
    "parts_attribute",
    "refuse_jumps",
    "step_attributes",
    "stepped",
]


def observed_model(mechanism: Mechanism, time: float, start: str = "drawn") -> Model:
    """Build a mechanism that has something to observe; `start` as for `Study`."""
    from uqmbd.dynamics import build, referenced
    from uqmbd.mechanism import forgotten

    if not mechanism.observed():
        raise StudyError(
            f"mechanism {mechanism.name!r} has no outputs; say what to observe, "
            "e.g. mechanism.output('x', body.position[0], units='m'), or what must hold, "
            "e.g. mechanism.require('clearance', body.position[0] <= 0.47)."
        )
    means = mechanism.inputs.means
    model = mechanism.remembered(("model", time), lambda: referenced(build(mechanism, time), means))
    if start != "drawn":
        posed = [name for name, condition in mechanism.conditions.items() if not condition.of_velocities]
        if posed:
            raise StudyError(
                f"mechanism {mechanism.name!r}: start condition {posed[0]} says where the bodies are, and so does "
                "start='equilibrium'; leave one of them out. Conditions of velocities may stay."
            )
        built = model
        model = mechanism.remembered(("model", time, start), lambda: referenced(replace(built, start_at=start), means))
    if missing := forgotten(mechanism):
        model = replace(model, notices=(*missing, *model.notices))
    for notice in model.notices:
        warnings.warn(f"{notice}.", StudyWarning, stacklevel=3)
    return model


def stepped(model: Model, max_step: float, breaks: tuple[float, ...]) -> Model:
    """Return a model that every integrator follows with bounded steps, and with breaks of the user's."""
    plain = max_step == float("inf") and not breaks
    return model if plain else replace(model, max_step=max_step, added_breaks=breaks)


def refuse_jumps(ensemble: Ensemble, times: Array, rtol: float, where: str) -> None:
    """Raise a `StudyError` if the position that is prescribed to a single realisation jumps within the times."""
    from uqmbd.dynamics import position_jumps

    if len(times) > 1 and (found := position_jumps(ensemble, times, rtol)):
        raise StudyError(f"{where}: {found[0]}.")


def step_attributes(max_step: float, breaks: tuple[float, ...]) -> dict[str, Any]:
    """Return the attributes that say how steps were bounded, if they were."""
    found: dict[str, Any] = {} if max_step == float("inf") else {"max_step": max_step}
    return found | ({"breaks": list(breaks)} if breaks else {})


def not_unique_attribute(model: Model) -> dict[str, str]:
    """Return the attribute that names outputs that redundant constraints leave undetermined, if there are any."""
    names = model.outputs.not_unique
    return {"not_unique": ", ".join(names)} if names else {}


def notices_attribute(model: Model) -> dict[str, str]:
    """Return the attribute that holds what was warned of, as JSON, if there is anything."""
    return {"warnings": json.dumps(model.notices)} if model.notices else {}


def parts_attribute(mechanism: Mechanism) -> dict[str, str]:
    """Bodies, and components with their types, as JSON: `uqmbd compare` tells which only one of two mechanisms has."""
    components = {c.name: type(c).__name__ for c in mechanism.components.values()}
    components |= {c.name: type(c).__name__ for c in mechanism.controllers.values()}
    return {"parts": json.dumps({"bodies": list(mechanism.bodies), "components": components})}
