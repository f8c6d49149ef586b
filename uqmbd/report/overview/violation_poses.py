"""Pictures of named realisations of the stored motion, such as most likely violations."""

from __future__ import annotations

import json
from functools import partial

import numpy as np

from uqmbd.report.drawing import still_image
from uqmbd.report.mechanisms import draw_named, poses
from uqmbd.report.sections import Content
from uqmbd.report.view import StudyResult, dataset_of

__all__ = ["named_poses"]


def named_poses(result: StudyResult) -> list[Content]:
    """Return pictures of the named realisations of the stored motion, at most one on the first screen."""
    data, found = dataset_of(result.tree, "motion"), []
    if data is None:
        return []
    try:
        times = np.asarray(data["time"].values, dtype=float)
        named = json.loads(str(data.attrs.get("named", "[]")))
        for one in named[:1]:
            k, wanted, name = int(one["realisation"]), float(one["time"]), str(one["name"])
            time = float(times[np.argmin(np.abs(times - wanted))])
            at = f"{time:.4g} s" + (f", the stored time nearest to {wanted:.4g} s" if abs(time - wanted) > 1e-9 else "")
            caption = f"Pose of the {name} at {at}; outline: at the means of the inputs."
            made = partial(draw_named, data, k, wanted)
            one_time = data.isel(realisation=[k, 0])
            found.append(still_image(made, caption, caption, f"pose-{k}", partial(poses, one_time, wanted)))
        return found
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the rest of the report must stand
        return [{"problem": f"{type(error).__name__}: {error}", "caption": "named realisations"}]
