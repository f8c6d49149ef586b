"""Names for plugins that add a command or an exporter; nothing heavy is imported here."""

from __future__ import annotations

from uqmbd.errors import PluginWarning as PluginWarning
from uqmbd.plugins import Command as Command
from uqmbd.plugins import Exporter as Exporter
