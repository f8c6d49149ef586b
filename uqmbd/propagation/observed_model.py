"""Build the model of a mechanism with outputs and with the requested limits of integration steps."""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import sympy

from uqmbd.errors import Finding, Severity, StudyError
from uqmbd.mechanism import as_symbolic, excitation_sources
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from uqmbd.dynamics import Ensemble, Model
    from uqmbd.mechanism import Component, Mechanism

__all__ = [
    "finding_attributes",
    "friction_at_rest",
    "mechanism_attributes",
    "not_unique_attribute",
    "several_motions",
    "build_observed_model",
    "refuse_jumps",
    "step_attributes",
    "warn_of",
    "warn_once",
    "warned_elsewhere",
]

KNOWN = "findings of the model are known"
"""Key under which a mechanism records, with the time of its model, that its findings were listed or issued."""


def build_observed_model(
    mechanism: Mechanism,
    time: float,
    start: str = "drawn",
    max_step: float = float("inf"),
    breaks: tuple[float, ...] = (),
) -> Model:
    """Build a mechanism with outputs; `Study` documents `start`, `max_step` and `breaks`."""
    from uqmbd.dynamics import build, referenced

    if not mechanism.observed():
        raise StudyError(
            f"mechanism {mechanism.name!r} has no outputs; add one, "
            "e.g. mechanism.output('x', body.position[0], units='m'), or a requirement, "
            "e.g. mechanism.require('clearance', body.position[0] <= 0.47)."
        )
    means = mechanism.inputs.means
    # redundant constraints are among the findings, and the caller warns of them
    model = mechanism.remembered(("model", time), lambda: referenced(build(mechanism, time, quiet=True), means))
    if start != "drawn":
        posed = [name for name, condition in mechanism.conditions.items() if not condition.of_velocities]
        if posed:
            raise StudyError(
                f"mechanism {mechanism.name!r}: start condition {posed[0]} and start='equilibrium' both define the "
                "initial pose; omit one of them. Start conditions on velocities are allowed with "
                "start='equilibrium'."
            )
        built = model
        model = mechanism.remembered(("model", time, start), lambda: referenced(replace(built, start_at=start), means))
    held = mechanism.remembered(("held at rest", time, start), lambda: friction_at_rest(model, means))
    if further := (*_never_added(mechanism), *held):
        model = replace(model, findings=(*further, *model.findings))
    if max_step != float("inf") or breaks:
        model = replace(model, max_step=max_step, added_breaks=breaks)
    return model


def friction_at_rest(model: Model, values: Array, every: bool = False) -> tuple[Finding, ...]:
    """Return findings on dry friction that makes the static equilibrium a set of poses, at values of the inputs.

    The findings concern the start in equilibrium and outputs in equilibrium; with `every`, all outputs.
    """
    from uqmbd.dynamics import Ensemble, has_dry_friction, ranges_by_friction, static_equilibria

    maps = [one for one in (model.scalars, None if model.margins is None else model.margins.still) if one is not None]
    seen = [model.outputs] if every else [one.resting for one in maps if one.resting.names]
    starts = model.start_at == "equilibrium" and not every
    if not has_dry_friction(model) or not (seen or starts):
        return ()
    one = Ensemble(replace(model, start_at="drawn"), values[None, :])
    found = static_equilibria(one)
    if found.messages[0]:
        return ()
    texts = []
    for outputs in seen:
        for name, units, held in zip(
            outputs.names, outputs.units, ranges_by_friction(one, found.q, found.s, outputs), strict=False
        ):
            what, size = name.replace("AtEquilibrium", "at_equilibrium"), abs(held.half_width)
            if size > 0:
                width = f"about ±{size:.3g} {units}".rstrip() if size < float("inf") else "any amount"
                value = f"{held.value:.6g} {units}".rstrip()
                texts.append((held.components, f"{what} is {value}, but may differ from this value by {width}"))
    if starts:
        some = ranges_by_friction(one, found.q, found.s, None)
        texts += [(held.components, "the motion starts in the pose without this friction") for held in some]
    return tuple(
        Finding(
            Severity.WARNING,
            f"dry friction of {components}",
            f"the dry friction of {components} holds the mechanism at rest in a range of poses, so the static "
            f"equilibrium is not unique; {text}",
            "Use smooth friction (for example with a transition speed), which holds no pose, or simulate the motion "
            "until it rests",
        )
        for components, text in texts
    )


def _never_added(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Return findings on components that refer to bodies of a mechanism but were never passed to its `add`.

    The findings exclude rejected components and components that another component with the same name has replaced.
    """
    touched: dict[tuple[str, str], list[str]] = {}
    for body in mechanism.bodies.values():
        for name, kind in body.drafts.items():
            if name not in mechanism.components:
                touched.setdefault((name, kind), []).append(repr(body.name))
    return tuple(
        Finding(
            Severity.WARNING,
            f"{kind} {name!r}",
            f"{kind} {name!r} of {'body' if len(bodies) == 1 else 'bodies'} {' and '.join(bodies)} was created but "
            "not added to the mechanism, so it has no effect",
            f"Add the {kind} by mechanism.add(...)",
        )
        for (name, kind), bodies in sorted(touched.items())
    )


def warn_of(model: Model, stacklevel: int) -> None:
    """Issue the Python warnings of findings on a model."""
    for finding in model.findings:
        if finding.warned:
            warnings.warn(f"{finding.text}.", finding.category, stacklevel=stacklevel + 1)


def warn_once(mechanism: Mechanism, model: Model, stacklevel: int) -> None:
    """Issue the warnings of `warn_of` unless they were issued or listed since the last change of the mechanism."""
    mechanism.remembered((KNOWN, model.time), lambda: warn_of(model, stacklevel + 3))


def warned_elsewhere(mechanism: Mechanism, time: float) -> None:
    """Record that the caller lists or issues the findings on the model of a mechanism at a time, s."""
    mechanism.remembered((KNOWN, time), lambda: None)


def refuse_jumps(ensemble: Ensemble, times: Array, rtol: float, where: str) -> None:
    """Raise a `StudyError` if a prescribed position of a single realisation jumps within the times."""
    from uqmbd.dynamics import position_jumps

    if len(times) > 1 and ensemble.model.rheonomic and (found := position_jumps(ensemble, times, rtol)):
        raise StudyError(f"{where}: {found[0]}.")


def step_attributes(max_step: float, breaks: tuple[float, ...]) -> dict[str, Any]:
    """Return the attributes on step limits; empty without limits."""
    found: dict[str, Any] = {} if max_step == float("inf") else {"max_step": max_step}
    return found | ({"breaks": list(breaks)} if breaks else {})


def several_motions(where: str) -> str:
    """Return a warning of contacts for which several motions are possible; `where` states them.

    >>> print(several_motions("in 3 of 8 realisations, two motions satisfy the laws of contact").partition(";")[0])
    in 3 of 8 realisations, two motions satisfy the laws of contact (Painleve's paradox)
    """
    return (
        f"{where} (Painleve's paradox); the motion is that of a compliant contact whose stiffness grows without bound. "
        "Compare with a compliant contact, or lower the coefficient of friction."
    )


def not_unique_attribute(model: Model) -> dict[str, str]:
    """Return the attribute with the outputs that redundant constraints leave undetermined; empty if there are none."""
    names = model.outputs.not_unique
    return {"not_unique": ", ".join(names)} if names else {}


def finding_attributes(findings: Sequence[Finding]) -> dict[str, str]:
    """Return the attributes with all findings, and with the texts of warnings, as JSON; empty without findings."""
    names = ("place", "message", "remedy")
    found: list[dict[str, Any]] = []
    for one in findings:
        found.append({"severity": one.severity.value, **{name: getattr(one, name) for name in names}})
        if one.hidden_errors:  # null in JSON: the error is unknown
            errors = [[name, None if math.isnan(error) else error] for name, error in one.hidden_errors]
            found[-1]["hidden_errors"] = errors
    warned = [x.text for x in findings if x.warned]
    return {name: json.dumps(value) for name, value in (("findings", found), ("warnings", warned)) if value}


LONGEST = 60
"""Maximum number of characters of a displayed expression."""

LONGEST_DESCRIPTION = 600
"""Maximum number of characters of the description of an excitation, which may contain a record."""

ROW = 24
"""Maximum number of displayed numbers of a row."""


def mechanism_attributes(mechanism: Mechanism) -> dict[str, str]:
    """Return the attributes that describe the mechanism in results, each as JSON.

    ``parts`` contains bodies, and components with their types; `uqmbd compare` uses it to find parts that only one of
    two mechanisms has. ``model`` contains the parameters of bodies and components as text, and the descriptions of
    excitations, such as random processes with their spectra. ``over`` contains outputs
    that are plotted over other outputs. ``limits`` contains requirements that an output over time stays below or above
    a number.
    """
    components = {c.name: type(c).__name__ for c in mechanism.components.values()}
    components |= {c.name: type(c).__name__ for c in mechanism.controllers.values()}
    sources = excitation_sources([tuple(c.values.values()) for c in mechanism.all_components()])
    excited = {"excitations": {name: _cut(repr(source)) for name, source in sources.items()}} if sources else {}
    found: dict[str, object] = {
        "parts": {"bodies": list(mechanism.bodies), "components": components},
        "model": {
            "bodies": {name: _shown(body.terms, {"gravity"}) for name, body in mechanism.bodies.items()},
            "components": {
                c.name: {"bodies": [body.name for body in c.attached.values()], "parameters": _shown(c)}
                for c in mechanism.components.values()
            },
            **excited,
        },
        "over": {output.name: output.over for output in mechanism.outputs.values() if output.over},
        "limits": _limits(mechanism),
    }
    return {name: json.dumps(value, ensure_ascii=False) for name, value in found.items() if value}


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_DESCRIPTION else f"{text[: LONGEST_DESCRIPTION - 1]}\N{HORIZONTAL ELLIPSIS}"


def _shown(component: Component, left_out: Collection[str] = ()) -> dict[str, str]:
    declared = type(component).parameters()
    return {
        name: f"{_written(value)} {typeset_units(declared[name].units)}".strip()
        for name, value in component.values.items()
        if name in declared and declared[name].kind != "option" and name not in left_out
        if value is not None and not (isinstance(value, (tuple, list)) and not value)
    }


def _written(value: Any) -> str:
    """Return a number, a row of numbers, or an expression as text; for a long expression, return its symbols."""
    if isinstance(value, (tuple, list, sympy.MatrixBase)):
        if len(value) > ROW:
            return f"{len(value)} numbers"
        return f"({', '.join(_written(one) for one in value)})"
    try:
        value = as_symbolic(value)
    except StudyError:
        return type(value).__name__
    if not isinstance(value, sympy.Expr):
        return type(value).__name__
    if value.is_real and value.is_number:
        return f"{float(value):.6g}"
    text = str(value)
    return text if len(text) <= LONGEST else f"depends on {', '.join(sorted(map(str, value.free_symbols)))}"


def _limits(mechanism: Mechanism) -> list[dict[str, object]]:
    found: list[dict[str, object]] = []
    for name, margin in mechanism.margins.items():
        for output in mechanism.outputs.values():
            ends = {"highest": margin.expression + output.expression, "lowest": output.expression - margin.expression}
            for end, limit in ends.items():
                if limit.is_number and limit.is_real:
                    found.append({"requirement": name, "output": output.name, "limit": float(limit), "end": end})
    return found
