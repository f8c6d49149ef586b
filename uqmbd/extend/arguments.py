"""Argument checks for public functions and classes of plugins, and for options of their methods."""

from __future__ import annotations

from uqmbd.arguments import Bounds as Bounds
from uqmbd.arguments import typechecked as typechecked
