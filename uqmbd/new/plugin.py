"""`uqmbd new plugin`: a package that is installed, tested and linted as it is, to start from."""

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

    `name`: of the distribution, and of the folder that is made for it; `kind`: key of `PLUGIN_KINDS`; `folder`: where
    that folder is made; `force`: whether files that are there are overwritten. Return what was written. Raise
    StudyError if there can be no package of this name, or a file is there already.
    """
    about = PLUGIN_KINDS[kind]
    names = check_plugin_name(name, about)
    target = folder / name
    check_module(name, names.package, target)
    _check_registered(names, about, target)
    offered = names.cls if about.offers == "class" else names.function
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
        _check_free(name, offered, text)
    return write(texts, target, force=force)


def _check_registered(names: PluginNames, kind: PluginKind, target: Path) -> None:
    """Raise where a plugin of this kind is registered by the name, other than by the package that is written."""
    from uqmbd import plugins

    known = kind.registered
    if known is None:
        return
    word = names.short if known.by_attribute else names.cls
    if word in known.reserved:
        owner = "uqmbd itself"
    else:
        owner = plugins.owner(kind.registry, word)
    ours = (target / "src" / names.package).exists()  # --force, of a package that is installed from there
    if owner and not ours:
        raise StudyError(f"name {names.name!r}: the {known.noun} {word!r} belongs to {owner}; choose another name.")


def _check_free(name: str, offered: str, text: str) -> None:
    """Raise where the example imports something else by the name of what it offers."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                module = node.module if isinstance(node, ast.ImportFrom) else alias.name
                if (alias.asname or alias.name) == offered and not _is_own(module, name):
                    raise StudyError(
                        f"name {name!r}: the example would be named {offered}, like {module}.{offered}, "
                        "which it uses; choose another name."
                    )


def _is_own(module: str | None, name: str) -> bool:
    """Return whether a module is one of the package that is written."""
    return (module or "").partition(".")[0] == name.replace("-", "_")
