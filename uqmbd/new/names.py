"""Names of studies and plugins that Python, the file system and other packages allow."""

from __future__ import annotations

import builtins
import importlib.machinery
import importlib.util
import keyword
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from uqmbd.errors import StudyError

__all__ = ["PluginNames", "check_module", "check_plugin_name", "check_study_name"]

LONGEST = 40
"""Largest number of characters of a name, with which lines of the templates satisfy the limits of linters."""


@dataclass(frozen=True)
class PluginNames:
    """Names of a plugin's distribution, package, class and function.

    `name` is the name of the distribution and of its folder. `package` is the name for imports. `short` is the name in
    studies, without the prefix ``uqmbd-``. `cls` and `function` are the names of its class or its function.

    >>> PluginNames("uqmbd-wire-rope").cls
    'WireRope'
    """

    name: str

    @property
    def package(self) -> str:
        """Name of the package for imports."""
        return self.name.replace("-", "_")

    @property
    def short(self) -> str:
        """Name of the plugin's class in studies, without the prefix ``uqmbd-``."""
        return re.sub("^uqmbd[-_]", "", self.name).replace("_", "-")

    @property
    def function(self) -> str:
        """Name of the function of the plugin."""
        return self.short.replace("-", "_")

    @property
    def cls(self) -> str:
        """Name of the class of the plugin."""
        return "".join(part.capitalize() for part in self.short.split("-"))


def check_study_name(name: str) -> None:
    """Raise StudyError unless a study script can have this name.

    The message suggests a valid name if there is a similar one.

    >>> check_study_name("crank")
    """
    if name.endswith(".py"):
        raise StudyError(f"name {name!r}: omit the suffix .py; `uqmbd new study {name[:-3]}` writes {name}.")
    _check_plain(name)
    if not name.isidentifier():
        near = re.sub(r"\W+", "_", name).strip("_")
        near = near if near.isidentifier() else f"study_{near}".rstrip("_")
        raise StudyError(
            f"name {name!r}: a study is a Python module: its name has letters, digits and underscores, and "
            f"does not begin with a digit. Try {near!r}."
        )
    _check_reserved(name, name)


def check_plugin_name(name: str) -> PluginNames:
    """Return the names of a plugin, or raise StudyError for an invalid name.

    The message suggests a valid name if there is a similar one.

    >>> check_plugin_name("wire-rope").package
    'wire_rope'
    """
    _check_plain(name)
    if not re.fullmatch("[a-z][a-z0-9]*([-_][a-z0-9]+)*", name):
        words = re.findall("[a-z0-9]+", re.sub("([a-z0-9])([A-Z])", r"\1-\2", name).lower())
        near = "-".join(words)
        if not re.match("[a-z]", near):
            near = f"plugin-{near}".rstrip("-")
        raise StudyError(
            f"name {name!r}: the name of a package has lower-case letters and digits, with single hyphens or "
            f"underscores between words, and begins with a letter. Try {near!r}."
        )
    names = PluginNames(name)
    if len(names.short) < 2:
        raise StudyError(f"name {name!r}: the name has a single letter; choose a descriptive name.")
    for word in (names.package, names.function, names.cls):
        _check_reserved(name, word)
    if hasattr(builtins, names.cls):
        raise StudyError(
            f"name {name!r}: the example would be named {names.cls}, which is a built-in name of Python; "
            "choose another name."
        )
    if names.function.startswith("test"):
        raise StudyError(f"name {name!r}: pytest treats functions of this name as tests; choose another name.")
    return names


def check_module(name: str, module: str, folder: Path) -> None:
    """Raise StudyError if a module with this name exists outside of a folder, as one of them would hide the other.

    The message states the location of the module.
    """
    where = "part of Python" if module in sys.stdlib_module_names else _place(module, folder.resolve())
    if where:
        raise StudyError(
            f"name {name!r}: a module {module} exists already ({where}), and one of them would hide the other; choose "
            "another name."
        )


def _place(module: str, folder: Path) -> str:
    """Return the location of a module outside of a folder; empty if there is none."""
    found: importlib.machinery.ModuleSpec | None
    try:
        found = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return ""
    if found is None:
        return ""
    places = [found.origin] if found.has_location and found.origin else list(found.submodule_search_locations or [])
    if not places:
        return "part of Python"
    place = Path(places[0]).resolve()
    return "" if folder in place.parents or folder == place else str(place)


def _check_plain(name: str) -> None:
    if not name.strip():
        raise StudyError("the name is empty; choose a descriptive name.")
    if "/" in name or "\\" in name:
        raise StudyError(f"name {name!r}: expected a name, not a path; use --folder for the target folder.")
    if len(name) > LONGEST:
        raise StudyError(f"name {name!r}: the name has {len(name)} characters; the maximum is {LONGEST}.")


def _check_reserved(name: str, word: str) -> None:
    if keyword.iskeyword(word):
        raise StudyError(f"name {name!r}: {word} is a reserved word of Python; choose another name.")
    if re.fullmatch("__.*__", word):
        raise StudyError(f"name {name!r}: Python reserves file names of this form; choose another name.")
    if re.fullmatch("con|prn|aux|nul|(com|lpt)[0-9]", word.casefold()):
        raise StudyError(
            f"name {name!r}: Windows reserves {word} for a device, so no file can have this name; choose another name."
        )
