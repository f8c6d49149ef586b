"""Drawings of a mechanism: picture, poses, and animation."""

from __future__ import annotations

from uqmbd.report.mechanisms.animation import (
    SECONDS,
    animate,
    check_target,
    coordinate_names,
    gif,
    integrated_bodies,
    marked_points,
    motion,
    observed_bodies,
    poses,
    with_motion,
)
from uqmbd.report.mechanisms.body_poses import drawn_pose, motion_at, stated_pose
from uqmbd.report.mechanisms.deformation import magnification
from uqmbd.report.mechanisms.film import Film
from uqmbd.report.mechanisms.sketch import CLOSED, Sketch, world
from uqmbd.report.mechanisms.still_picture import draw_named, draw_pose, mechanism, still
from uqmbd.report.mechanisms.symbols import Stroke

__all__ = [
    "CLOSED",
    "SECONDS",
    "Film",
    "Sketch",
    "Stroke",
    "animate",
    "check_target",
    "coordinate_names",
    "drawn_pose",
    "gif",
    "integrated_bodies",
    "magnification",
    "marked_points",
    "mechanism",
    "motion",
    "motion_at",
    "draw_named",
    "observed_bodies",
    "draw_pose",
    "poses",
    "stated_pose",
    "still",
    "with_motion",
    "world",
]
