"""Command `uqmbd new plugin`, which writes an example package that can be installed, tested and linted unchanged."""

from __future__ import annotations

import ast
from pathlib import Path

from uqmbd.errors import StudyError
from uqmbd.new.kinds import PLUGIN_KINDS, PluginKind
from uqmbd.new.names import PluginNames, check_module, check_plugin_name
from uqmbd.new.writing import rendered, write
from uqmbd.version import __version__

__all__ = ["new_plugin"]


def new_plugin(name: str, kind: str, folder: Path = Path(), *, force: bool = False) -> list[Path]:
    """Write the package of a plugin.

    `name` is the name of the distribution and of its new folder in `folder`. `kind` is a key of `PLUGIN_KINDS`. `force`
    allows overwriting existing files. Return the paths of the written files. Raise StudyError if a package cannot have
    this name, or a file exists already and `force` is False.
    """
    about = PLUGIN_KINDS[kind]
    names = check_plugin_name(name)
    target = folder / name
    check_module(name, names.package, target)
    _check_registered(names, about, target)
    offered = [names.cls, "FittedModel"] if about.fitted else [names.cls]
    known = {
        "name": names.name,
        "package": names.package,
        "short": names.short,
        "cls": names.cls,
        "function": names.function,
        "offered": offered,
        "kind": about,
        "word": kind,
        "version": __version__,
    }
    example = {path.name: text for path, text in rendered(f"kinds/{kind}", known).items()}
    texts = rendered("plugin", known | {"usage": example["usage.py"].rstrip()}, replaced={"PACKAGE": names.package})
    texts[Path("src") / names.package / f"{about.module}.py"] = example["module.py"]
    texts[Path("tests") / f"test_{names.package}.py"] = example["test.py"]
    for text in (example["module.py"], example["test.py"]):
        for word in offered:
            _check_free(name, word, text)
    return write(texts, target, force=force)


def _check_registered(names: PluginNames, kind: PluginKind, target: Path) -> None:
    """Raise StudyError if another package registers a plugin of this kind and name."""
    from uqmbd import plugins

    known = kind.registered
    word = names.short if known.by_attribute else names.cls
    owner = "uqmbd itself" if word in known.reserved else plugins.owner(kind.registry, word)
    owner = owner or (plugins.owner(kind.fitted, word) if kind.fitted else "")
    ours = (target / "src" / names.package).exists()  # with --force, for a package that is installed from this folder
    if owner and not ours:
        raise StudyError(f"name {names.name!r}: the {known.noun} {word!r} belongs to {owner}; choose another name.")


def _check_free(name: str, offered: str, text: str) -> None:
    """Raise StudyError if the example imports another object with the name of its own class or function."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                module = node.module if isinstance(node, ast.ImportFrom) else alias.name
                if (alias.asname or alias.name) == offered and not _is_own(module, name):
                    raise StudyError(
                        f"name {name!r}: the example would be named {offered}, like {module}.{offered}, which the "
                        "example uses; choose another name."
                    )


def _is_own(module: str | None, name: str) -> bool:
    """Return whether a module belongs to the package that is written."""
    return (module or "").partition(".")[0] == name.replace("-", "_")
