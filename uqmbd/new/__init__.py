"""Templates of `uqmbd new` for a study and for the package of a plugin.

Jinja renders the templates, like the reports.  A template tool would be another dependency, and would replace only
thirty lines.  The examples are written once and then edited, so that Copier's updates and Cookiecutter's questions are
not needed.
"""

from __future__ import annotations

from uqmbd.new.kinds import PLUGIN_KINDS, PluginKind
from uqmbd.new.plugin import new_plugin
from uqmbd.new.study import new_study

__all__ = ["PLUGIN_KINDS", "PluginKind", "new_plugin", "new_study"]
