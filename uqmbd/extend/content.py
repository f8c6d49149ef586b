"""Digest of functions and objects, for plugins that identify functions of users by their content."""

from __future__ import annotations

from uqmbd.dynamics import content_key as content_key
