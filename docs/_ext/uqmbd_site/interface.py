"""Pages on the command line, from its own declarations, and on the hooks of plugins, from their specifications."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from uqmbd_site.reference import write_if_changed

__all__ = ["write_command_line", "write_hooks"]


def write_command_line(source: str | Path) -> None:
    """Write the page of all commands with their arguments and options into a folder of sources."""
    import typer.main

    from uqmbd.cli.app import app

    group: Any = typer.main.get_command(app)
    context = group.context_class(group, info_name="uqmbd")
    lines = ["Command line", "============", "", group.help, "", group.epilog, ""]
    lines += _options(group, context)
    lines += _commands(group, context, "uqmbd")
    write_if_changed(Path(source) / "reference" / "api" / "command_line.rst", "\n".join(lines))


def _commands(group: Any, context: Any, before: str) -> list[str]:
    """Return a section for each command of a group, and of the groups in it."""
    lines = []
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        inner = command.context_class(command, info_name=name, parent=context)
        if hasattr(command, "list_commands"):
            lines += _commands(command, inner, f"{before} {name}")
            continue
        title = f"{before} {name}"
        usage = " ".join(command.collect_usage_pieces(inner))
        anchor = title.removeprefix("uqmbd ").replace(" ", "-")
        lines += [f".. _command-{anchor}:", "", title, "-" * len(title), "", f"``{title} {usage}``", ""]
        lines += [inspect.cleandoc(command.help or ""), "", *_options(command, inner)]
    return lines


def _options(command: Any, context: Any) -> list[str]:
    """Return a table of arguments and options, as `--help` tells them."""
    rows = [record for parameter in command.get_params(context) if (record := _record(parameter, context))]
    if not rows:
        return []
    lines = [".. list-table::", "   :widths: 35 65", ""]
    for shown, text in rows:
        lines += [f"   * - ``{shown}``", f"     - {text}"]
    return [*lines, ""]


def _record(parameter: Any, context: Any) -> tuple[str, str] | None:
    found = parameter.get_help_record(context)
    if found is None:
        return (parameter.make_metavar(context), getattr(parameter, "help", None) or "")
    return (found[0], " ".join(found[1].split()))


def write_hooks(source: str | Path) -> None:
    """Write the page of all hooks and what is known of their classes, into a folder of sources."""
    from uqmbd.plugins.hooks import KINDS, plugin_manager

    hooks = plugin_manager().hook
    lines = ["Hooks of plugins", "================", ""]
    lines += [
        "A plugin implements them as functions without arguments, decorated by `uqmbd.hookimpl`, that return classes."
    ]
    lines += [":doc:`How to write each </how-to/plugins/index>`.", ""]
    for kind in KINDS.values():
        specification = getattr(hooks, kind.hook).spec.function
        lines += [kind.hook, "-" * len(kind.hook), "", inspect.getdoc(specification) or "", ""]
        facts = {
            "A class is": f"{'an' if kind.noun[0] in 'aeiou' else 'a'} {kind.noun}",
            "Entry-point group": f"``{kind.group}``",
            "Derives from": f"`{kind.base}`" if kind.base else "",
            "Known by": "its class attribute ``name``" if kind.by_attribute else "the name of the class",
            "Has the method": f"``{kind.method}``" if kind.method else "",
            "Declares": ", ".join(f"``{flag}``" for flag in kind.flags),
            "Names of the core": ", ".join(f"``{name}``" for name in kind.reserved),
        }
        lines += [".. list-table::", "   :widths: 30 70", ""]
        lines += [line for key, text in facts.items() if text for line in (f"   * - {key}", f"     - {text}")]
        lines.append("")
    write_if_changed(Path(source) / "reference" / "api" / "hooks.rst", "\n".join(lines))
