"""The report's section of other inputs: sliders, behind which the stored surrogate is evaluated in the page."""

from __future__ import annotations

from uqmbd.report import live
from uqmbd.report.charts import json_script
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult

__all__ = ["EXPLORE"]


def explore(result: StudyResult) -> Content | None:
    """Return the data of the sliders, or why there are none; None where the results hold no inputs.

    Returns
    -------
    dict, or None
        ``explorer``, JSON, or None; ``moving``, whether there is a mechanism to draw; ``notes``, what does not follow
        the inputs, and why.
    """
    if not live.live_method(result.tree) and not _sampled(result):
        return None
    moving = result.motion is not None
    try:
        found = live.explorer_data(result.tree, result.limits)
    except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the report must stand
        found = {"reason": f"{type(error).__name__}: {error}"}
    if "reason" in found:
        notes = [f"Inputs cannot be chosen in this page: {found['reason']}"]
        return {"explorer": None, "moving": moving, "notes": notes}
    notes = [f"Some outputs do not follow the inputs: {reason}" for reason in found["missing"]]
    if found["still"]:
        names = ", ".join(found["still"])
        why = f"{found['method']} has no surrogate of their margins"
        notes.append(f"These requirements do not follow the inputs: {names}; {why}.")
    return {"explorer": json_script(found), "moving": moving, "notes": notes}


def _sampled(result: StudyResult) -> bool:
    """Tell whether outputs are known by samples of inputs, of which a surrogate could be made."""
    held = [one for method in result.methods.values() for one in (method, method.scalars) if one is not None]
    return any(one.samples is not None and one.samples.sizes.get("input", 0) and one.names for one in held)


EXPLORE = TemplateSection("Other inputs", "explore", explore)
