"""Names of studies and plugins: what Python, the file system and other packages allow."""

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
from uqmbd.new.kinds import PluginKind

__all__ = ["PluginNames", "check_module", "check_plugin_name", "check_study_name"]

LONGEST = 40
"""Characters of a name: lines of what is written stay within those of linters."""


@dataclass(frozen=True)
class PluginNames:
    """What a plugin is called where.

    `name`: of the distribution, and of its folder; `package`: by which it is imported; `short`: by which studies
    choose it: the name without ``uqmbd-`` before it; `cls`, `function`: of its class, or its function.

    >>> PluginNames("uqmbd-wire-rope").cls
    'WireRope'
    """

    name: str

    @property
    def package(self) -> str:
        """Name by which it is imported."""
        return self.name.replace("-", "_")

    @property
    def short(self) -> str:
        """Name by which studies choose it."""
        return re.sub("^uqmbd[-_]", "", self.name).replace("_", "-")

    @property
    def function(self) -> str:
        """Name of its function."""
        return self.short.replace("-", "_")

    @property
    def cls(self) -> str:
        """Name of its class."""
        return "".join(part.capitalize() for part in self.short.split("-"))


def check_study_name(name: str) -> None:
    """Raise where a study script cannot be called so.

    Raise StudyError with a name that would do, where one is near.

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


def check_plugin_name(name: str, kind: PluginKind) -> PluginNames:
    """Return what a plugin is called where; raise where it cannot be called so.

    Raise StudyError with a name that would do, where one is near.

    >>> from uqmbd.new.kinds import PLUGIN_KINDS
    >>> check_plugin_name("wire-rope", PLUGIN_KINDS["component"]).package
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
    offered = names.cls if kind.offers == "class" else names.function
    if hasattr(builtins, offered):
        raise StudyError(
            f"name {name!r}: the example would be named {offered}, which is a built-in name of Python; "
            "choose another name."
        )
    if names.function.startswith("test"):
        raise StudyError(f"name {name!r}: pytest treats functions of this name as tests; choose another name.")
    return names


def check_module(name: str, module: str, folder: Path) -> None:
    """Raise where a module of that name is there already, outside of a folder: one of them would hide the other.

    Raise StudyError with where it is.
    """
    where = "part of Python" if module in sys.stdlib_module_names else _place(module, folder.resolve())
    if where:
        raise StudyError(f"name {name!r}: a module {module} exists already ({where}); one would hide the other.")


def _place(module: str, folder: Path) -> str:
    """Where a module is that is not in a folder; empty if there is none."""
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
