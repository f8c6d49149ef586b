"""The report's player of the mechanism, from what is stored with the results, and the picture that stands for it."""

from __future__ import annotations

import base64

from uqmbd.report import live
from uqmbd.report.charts import json_script
from uqmbd.report.drawing import still_image
from uqmbd.report.mechanisms import gif, poses, still
from uqmbd.report.sections import Content
from uqmbd.report.view import StudyResult
from uqmbd.wording import format_count, format_number

__all__ = ["mechanism_picture"]


def mechanism_picture(result: StudyResult) -> Content | None:
    """Return the data of the player, and a still picture for pages without scripts and print; None if none is stored.

    Returns
    -------
    dict of str, or None
        As of `still_image`, and ``player``, JSON; ``short``, a shorter caption; ``moving``, which makes the film as a
        file.
    """
    data = result.motion
    if data is None:
        reason = str(result.tree.attrs.get("no_motion", ""))
        return {"problem": reason} if reason else None
    try:
        times, bodies = data["time"].values, ", ".join(map(str, data["body"].values))
        count = data.sizes["realisation"] - 1
        others = f", and {format_count(count, 'realisation')} around it" if count else ""
        failed = int(data.attrs.get("failures", 0))
        left_out = f" {format_count(failed, 'realisation')} failed and {'is' if failed == 1 else 'are'} left out."
        caption = (
            f"The mechanism from {format_number(times[0])} s to {format_number(times[-1])} s, at "
            f"{format_count(len(times), 'time')}: at the means of the inputs"
            + ("; thin, other realisations." if count else ".")
            + (left_out if failed else "")
            + " Bodies are drawn from what is known of them: their joint points, centres of mass and observed points."
        )
        alt = (
            f"Picture of the mechanism {data.attrs.get('mechanism', '')} ({bodies}) at the means of its inputs"
            f"{others}, at the time at which these are farthest apart."
        )
        return still_image(lambda: still(data), alt, caption, "motion", lambda: poses(data)) | {
            "player": json_script({**live.player_data(data), **_live(result), "caption": caption}),
            "moving": lambda: "data:image/gif;base64," + base64.b64encode(gif(data)).decode("ascii"),
            "short": "At the means of the inputs" + ("; thin, other realisations." if count else "."),
        }
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the rest of the report must stand
        return {"problem": f"{type(error).__name__}: {error}"}


def _live(result: StudyResult) -> Content:
    """Return the surrogates of the poses for the player, or why there are none."""
    tree = result.tree
    if "pose_surrogate" not in tree.children:
        said = tree["motion"].attrs.get("no_surrogate")
        return {"live": None, "reason": str(said or "The poses of the bodies have no surrogate in these results.")}
    data, reason = live.live_poses(tree.children["pose_surrogate"], live.live_method(tree))
    return {"live": data, "reason": reason}
