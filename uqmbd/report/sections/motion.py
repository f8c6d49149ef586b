"""The report's animation of the mechanism, from what is stored with the results."""

from __future__ import annotations

import base64

from uqmbd.report.drawing import svg
from uqmbd.report.mechanisms import gif, poses
from uqmbd.report.sections.section import Content
from uqmbd.report.view import StudyResult
from uqmbd.wording import format_count, format_number

__all__ = ["mechanism_picture"]

LARGEST = 1_100_000
"""Bytes of an animation in the report: its text form is a third larger.  One that is larger is drawn smaller."""


def mechanism_picture(result: StudyResult) -> Content | None:
    """Return the animation as data URIs, a still picture for print, and texts for both; None if none is stored.

    Returns
    -------
    dict of str, or None
        ``moving``, ``still``, ``alt``, ``still_alt``, ``caption`` and ``problem``: why it could not be drawn.
    """
    data = result.motion
    if data is None:
        return None
    try:
        content = gif(data)
        for width, resolution in ((5.6, 64), (4.6, 52)):
            if len(content) > LARGEST:
                content = gif(data, width, resolution)
        if len(content) > LARGEST:
            content = gif(data.isel(time=slice(None, None, 3), realisation=slice(0, 6)), 4.6, 52)
        still = svg(poses(data))
        times, bodies = data["time"].values, ", ".join(map(str, data["body"].values))
        count = data.sizes["realisation"] - 1
        others = f", and {format_count(count, 'realisation')} around it" if count else ""
        what = f"the mechanism {data.attrs.get('mechanism', '')} ({bodies}) at the means of its inputs{others}"
        failed = int(data.attrs.get("failures", 0))
        left_out = f" {format_count(failed, 'realisation')} failed and {'is' if failed == 1 else 'are'} left out."
        return {
            "moving": "data:image/gif;base64," + base64.b64encode(content).decode("ascii"),
            "still": still,
            "alt": f"Animation from {format_number(times[0])} s to {format_number(times[-1])} s: {what}.",
            "still_alt": f"Picture of {what}, at the time at which these are farthest apart.",
            "caption": "How the mechanism moves: drawn at the means of the inputs"
            + ("; pale, some realisations." if count else ".")
            + (left_out if failed else "")
            + " Bodies are drawn from what is known of them: their joint points, centres of mass and observed points.",
            "short": "At the means of the inputs" + ("; pale, some realisations." if count else "."),
            "problem": "",
            "name": "motion",
        }
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the rest of the report must stand
        return {"problem": f"{type(error).__name__}: {error}"}
