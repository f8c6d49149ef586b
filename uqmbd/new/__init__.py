"""What `uqmbd new` writes: a study, or the package of a plugin, from templates.

The templates are rendered by Jinja, which renders the reports, too.  A tool for templates would be one more thing to
install, for thirty lines here: Copier's updates of what was written and Cookiecutter's questions are of no use to
examples that are written once and then changed.
"""

from __future__ import annotations

from uqmbd.new.kinds import PLUGIN_KINDS, PluginKind
from uqmbd.new.plugin import new_plugin
from uqmbd.new.study import new_study

__all__ = ["PLUGIN_KINDS", "PluginKind", "new_plugin", "new_study"]
