"""Motion of a mechanism as C source, for programs that integrate it without uqmbd."""

from __future__ import annotations

from uqmbd.dynamics.portable.commands import MotionCommand
from uqmbd.dynamics.portable.motion import motion_refusal, motion_source
from uqmbd.dynamics.portable.portable_motion import PortableMotion

__all__ = ["MotionCommand", "PortableMotion", "motion_refusal", "motion_source"]
