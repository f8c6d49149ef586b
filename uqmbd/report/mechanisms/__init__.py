"""Drawings of a mechanism: its picture, its poses, its animation."""

from __future__ import annotations

from uqmbd.report.mechanisms.animation import (
    SECONDS,
    animate,
    check_target,
    gif,
    marked_points,
    motion,
    observed_bodies,
    poses,
    with_motion,
)
from uqmbd.report.mechanisms.picture import mechanism

__all__ = [
    "SECONDS",
    "animate",
    "check_target",
    "gif",
    "marked_points",
    "mechanism",
    "motion",
    "observed_bodies",
    "poses",
    "with_motion",
]
