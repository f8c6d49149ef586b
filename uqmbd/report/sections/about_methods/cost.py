"""The report's section on what each method cost."""

from __future__ import annotations

import math

from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results.assessment import worst_integration_share
from uqmbd.wording import format_duration, format_integer, format_number

__all__ = ["COST"]

_COUNTERS = {
    "steps": "steps of the integrator",
    "residuals": "residual evaluations",
    "residual_evaluations": "residual evaluations",
    "jacobians": "Jacobian evaluations",
    "jacobian_evaluations": "Jacobian evaluations",
    "factorisations": "factorisations of the Jacobian",
    "integrations": "integrations (implicit: of a stack of realisations; explicit: of one)",
    "accelerations": "evaluations of the equations of motion, explicit (each of up to eight realisations)",
    "passages": "singular poses passed over",
    "repivots": "changes to other independent equations on the way",
    "stiff": "realisations that the explicit integrator left to IDA: stiff, or cheaper there",
    "alone": "realisations integrated alone",
    "by_dop853": "realisations whose motion is that of the explicit integrator (dop853)",
    "by_ida": "realisations whose motion is that of IDA",
    "seconds": "time in the integrator, summed over workers",
}


def cost(result: StudyResult) -> Content:
    """Return what each method cost."""
    return {
        "methods": [
            {
                "label": label,
                "wall_time": format_duration(method.wall_time),
                "realisations": method.realisations,
                "failures": method.failures,
                "budget": str(method.node.attrs.get("budget_summary", "")),
                "each": format_duration(method.wall_time / method.realisations) if method.separate else "–",
                "counters": [
                    *(_counter(name, value) for name, value in method.pairs("solver_counters") if not _nothing(value)),
                    *_integration(method),
                ],
            }
            for label, method in result.methods.items()
        ]
    }


COST = TemplateSection("Cost", "cost", cost)


def _integration(method: Method) -> list[tuple[str, str]]:
    """Return the largest error of the time integration, and how it was found."""
    worst = worst_integration_share(method.node)
    if worst is None:
        return []
    several = len(method.names) + len(method.scalars.names if method.scalars else ()) > 1
    which = f", of {worst.output}" if several and math.isfinite(worst.share) else ""
    how = f" ({worst.reason})" if worst.reason else ""
    return [("error of the time integration", f"{worst.words()}{which}{how}")]


def _nothing(value: str) -> bool:
    """Tell whether a counter has counted nothing: what did not happen needs no line."""
    try:
        return float(value) == 0.0
    except ValueError:
        return False


def _counter(name: str, value: str) -> tuple[str, str]:
    """Return a solver's counter with a name for reading."""
    shown = _COUNTERS.get(name, name.replace("_", " "))
    try:
        number = float(value)
    except ValueError:
        return shown, value
    if name == "seconds":
        return shown, format_duration(number)
    return shown, format_integer(number) if number == round(number) else format_number(number)
