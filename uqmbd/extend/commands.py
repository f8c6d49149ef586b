"""What plugins need that add a command; nothing heavy is imported here."""

from __future__ import annotations

from uqmbd.errors import PluginWarning as PluginWarning
from uqmbd.plugins import Command as Command
