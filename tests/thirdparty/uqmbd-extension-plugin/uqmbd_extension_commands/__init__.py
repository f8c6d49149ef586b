"""A command. It is a package of its own, since the other one imports SymPy, for which `uqmbd --help` would wait."""

from __future__ import annotations

import uqmbd
from uqmbd_extension_commands.bodies import Bodies

__all__ = ["Bodies"]


@uqmbd.hookimpl
def uqmbd_commands() -> list[type[uqmbd.Command]]:
    """Return the command."""
    return [Bodies]
