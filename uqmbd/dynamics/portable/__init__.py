"""Motion of a mechanism as C source, for programs that integrate it without uqmbd."""

from __future__ import annotations

from uqmbd.dynamics.portable.commands import MotionCommand
from uqmbd.dynamics.portable.motion import PortableMotion, motion_refusal, motion_source

__all__ = ["MotionCommand", "PortableMotion", "motion_refusal", "motion_source"]
