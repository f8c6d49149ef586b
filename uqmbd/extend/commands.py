"""Names for plugins that add a command or an exporter; this module imports no large libraries."""

from __future__ import annotations

from uqmbd.errors import PluginWarning as PluginWarning
from uqmbd.plugins import Command as Command
from uqmbd.plugins import Exporter as Exporter
