"""Pictures of the mechanism on the first screen: the player of its motion, and the pose of a named realisation."""

from __future__ import annotations

import base64
from functools import partial

import numpy as np

from uqmbd.report import live
from uqmbd.report.charts import json_script
from uqmbd.report.drawing import still_image
from uqmbd.report.mechanisms import draw_named, gif, poses, still
from uqmbd.report.sections import Content
from uqmbd.report.stored_motion import named_poses
from uqmbd.report.view import StudyResult
from uqmbd.wording import format_count, format_number

__all__ = ["mechanism_picture", "pose_pictures"]


def mechanism_picture(result: StudyResult) -> Content | None:
    """Return the data of the player, and a still picture for print and pages without scripts; None without a motion.

    The keys are the keys of `still_image`, ``player`` (JSON) and ``surfaces`` (whether it draws surfaces in space). The
    key ``short`` is a shorter caption, and ``moving`` a function that returns the animation as a data URI.
    """
    data, stored = result.motion, result.stored_motion
    if data is None or stored is None:
        reason = str(result.tree.attrs.get("no_motion", ""))
        return {"problem": reason} if reason else None
    try:
        times, bodies = data["time"].values, ", ".join(map(str, data["body"].values))
        count = data.sizes["realisation"] - 1
        others = f", and {format_count(count, 'realisation')} around it" if count else ""
        failed = int(data.attrs.get("failures", 0))
        left_out = f" {format_count(failed, 'realisation')} failed and {'is' if failed == 1 else 'are'} not shown."
        caption = (
            f"Motion of the mechanism from {format_number(times[0])} s to {format_number(times[-1])} s, at "
            f"{format_count(len(times), 'time')}, at the means of the inputs"
            + ("; thin lines: other realisations." if count else ".")
            + (left_out if failed else "")
            + " Bodies are drawn through their joint points, centres of mass and observed points."
        )
        alt = (
            f"Picture of the mechanism {data.attrs.get('mechanism', '')} ({bodies}) at the means of its inputs"
            f"{others}, at the time of the largest distance between realisations."
        )
        # the player states the chosen scale
        scale = " Deformations of flexible bodies are at true scale." if "displacement" in data else ""
        return still_image(lambda: still(data), alt, caption + scale, "motion", lambda: poses(data)) | {
            "player": json_script({**live.collect_player_data(stored), **_live(result), "caption": caption}),
            "surfaces": "solid_face" in data and data.sizes["axis"] == 3,
            "moving": lambda: "data:image/gif;base64," + base64.b64encode(gif(data)).decode("ascii"),
            "short": "At the means of the inputs" + ("; thin lines: other realisations." if count else "."),
        }
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the rest of the report must remain
        return {"problem": f"{type(error).__name__}: {error}"}


def _live(result: StudyResult) -> Content:
    """Return the surrogates of the poses for the player, or the reason why they are missing."""
    tree = result.tree
    if "pose_surrogate" not in tree.children:
        reason = tree["motion"].attrs.get("no_surrogate")
        return {"live": None, "reason": str(reason or "These results contain no surrogate of the poses.")}
    data, reason = live.live_poses(tree.children["pose_surrogate"], live.live_method(tree))
    return {"live": data, "reason": reason}


def pose_pictures(result: StudyResult) -> list[Content]:
    """Return a picture of the first named realisation of the stored motion that has one on the first screen."""
    data, found = result.stored_motion, []
    if data is None:
        return []
    try:
        times = np.asarray(data["time"].values, dtype=float)
        for one in [one for one in named_poses(data) if one.pictured][:1]:
            time = float(times[np.argmin(np.abs(times - one.time))])
            words = f", the stored time nearest to {one.time:.4g} s" if abs(time - one.time) > 1e-9 else ""
            caption = f"Pose of the {one.name} at {time:.4g} s{words}; outline: at the means of the inputs."
            made = partial(draw_named, data, one.realisation, one.time)
            one_time = data.isel(realisation=[one.realisation, 0])
            found.append(
                still_image(made, caption, caption, f"pose-{one.realisation}", partial(poses, one_time, one.time))
            )
        return found
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the rest of the report must remain
        return [{"problem": f"{type(error).__name__}: {error}", "caption": "named realisations"}]
