"""Drawings of a mechanism: its picture, its poses, its animation."""

from __future__ import annotations

from uqmbd.report.mechanism.animation import SECONDS, animate, check_target, gif, poses, with_motion
from uqmbd.report.mechanism.body_poses import motion
from uqmbd.report.mechanism.picture import mechanism

__all__ = [
    "SECONDS",
    "animate",
    "check_target",
    "gif",
    "mechanism",
    "motion",
    "poses",
    "with_motion",
]
