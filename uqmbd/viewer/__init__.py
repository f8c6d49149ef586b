"""Viewer of a mechanism while it is built: a page on the loopback address that follows the study file."""

from __future__ import annotations

from uqmbd.viewer.viewing import FileViewer, MechanismView, view_mechanism, view_study

__all__ = ["FileViewer", "MechanismView", "view_mechanism", "view_study"]
