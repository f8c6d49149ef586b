"""What parts of an integration know of one another."""

from __future__ import annotations

from uqmbd.typing import Array

__all__ = ["Out"]

Out = tuple[Array, Array, Array]
"""Where a rate is written: the parts of coordinates and of velocities, and the whole."""
