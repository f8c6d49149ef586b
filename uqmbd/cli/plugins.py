"""`uqmbd plugins`: list installed plugins, their contents, and load failures."""

from __future__ import annotations

import dataclasses
import json
import sys
import warnings
from collections.abc import Sequence

from uqmbd import plugins
from uqmbd.errors import PluginWarning

__all__ = ["show_plugins"]


def show_plugins(*, as_json: bool = False) -> None:
    """Print the installed plugins as a table, or as JSON: a list of objects with the fields of `PluginInfo`."""
    with warnings.catch_warnings():
        # the printed table includes errors of plugins
        warnings.simplefilter("ignore", PluginWarning)
        found = plugins.installed()
    if as_json:
        print(json.dumps([dataclasses.asdict(info) for info in found], indent=2))
        return
    _show_table(found)


def _show_table(found: Sequence[plugins.PluginInfo]) -> None:
    from rich.text import Text

    from uqmbd.cli.tables import console, plain_table

    if not found:
        print(
            "No plugins are installed, not even the built-in ones. uqmbd was not installed by pip, or its "
            "installation is damaged. Try: pip install --force-reinstall uqmbd"
        )
        return
    colours = {"loaded": "green", "incomplete": "yellow", "failed": "bold red", "disabled": "dim"}
    table = plain_table("plugin", "package", "version", "status", "offers")
    for info in found:
        offered = [name for kind in plugins.KINDS for name in getattr(info, kind)]
        table.add_row(
            Text(info.name),
            Text(info.distribution or "?"),
            Text(info.version or "?"),
            Text(info.status, style=colours[info.status]),
            Text(", ".join(offered)),
        )
    console().print(table)
    sys.stdout.flush()
    for info in found:
        for error in info.errors:
            print(f"\n{info.name}: {error}")
