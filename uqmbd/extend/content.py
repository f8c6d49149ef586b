"""Names for plugins that identify functions of users."""

from __future__ import annotations

from uqmbd.dynamics import content_key as content_key
