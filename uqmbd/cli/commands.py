"""The commands of uqmbd and of plugins."""

from __future__ import annotations

import difflib
import functools
import warnings
from typing import Any

from typer.core import TyperGroup

__all__ = ["Commands"]


class Commands(TyperGroup):
    """Commands of uqmbd, which load no plugin, followed by commands of plugins."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return [*super().list_commands(ctx), *plugin_commands()]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, or None."""
        own = super().get_command(ctx, cmd_name)
        return plugin_commands().get(cmd_name) if own is None else own

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return a command by name; an unknown name may belong to a plugin that cannot be loaded."""
        name = args[0]
        if not name.startswith("-") and self.get_command(ctx, name) is None:
            from uqmbd import plugins

            known = self.list_commands(ctx)
            near = difflib.get_close_matches(name, known, n=1)
            meant = f" Did you mean {near[0]!r}?" if near else f" There are {', '.join(known)}."
            ctx.fail(f"No such command {name!r}.{meant} {plugins.unusable()}".rstrip())
        return super().resolve_command(ctx, args)


@functools.cache
def plugin_commands() -> dict[str, Any]:
    """Make the commands of plugins; a command that cannot be made gives a warning."""
    from uqmbd import plugins
    from uqmbd.errors import PluginWarning
    from uqmbd.isolation import Isolated

    made = {}
    for name, command in plugins.commands().items():
        with Isolated() as work:
            made[name] = plugins.command_line(command)
        if work.failed:
            text = f"the command {name!r} of {plugins.owner('commands', name)} is omitted: {work.reason}"
            warnings.warn(text, PluginWarning, stacklevel=2)
    return made
