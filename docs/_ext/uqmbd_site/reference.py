"""Pages of the reference, one for each public name: from the lists of the packages, so that none can be forgotten."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import Any

import uqmbd
from uqmbd_site.components import component_page, draw
from uqmbd_site.names import CORE, PLUGINS, file_names, kind, owners, public_names, returned, told_at_its_place

__all__ = ["is_component", "write_if_changed", "write_reference"]

TITLES = {
    "class": "Classes",
    "function": "Functions",
    "exception": "Errors and warnings",
    "data": "Symbols, types and constants",
}
"""Heading of each kind of object."""

OPTIONS = {"class": (":members:",), "exception": (":members:", ":show-inheritance:")}
"""How autodoc shows each kind."""


def write_if_changed(path: Path, text: str) -> None:
    """Write a page unless it is there already: what is unchanged is not built again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def write_reference(source: str | Path, *, pictures: bool = True) -> None:
    """Write the pages of all public names into ``reference/api`` of a folder of sources."""
    folder = Path(source) / "reference" / "api"
    written = {folder / f"{page}.rst" for page in ("core", "plugins", "returned", "command_line", "hooks")}
    write_if_changed(folder / "core.rst", _overview("Public modules", CORE))
    write_if_changed(folder / "plugins.rst", _overview("Built-in plugins", PLUGINS))
    write_if_changed(folder / "returned.rst", _returned_page())
    for module in (*CORE, *PLUGINS):
        pages = file_names(module)
        write_if_changed(folder / f"{module}.rst", _module_page(module, pages))
        written.add(folder / f"{module}.rst")
        for name, found in public_names(module).items():
            text = _object_page(module, name, found)
            if is_component(found):
                picture = folder / f"{pages[name]}.svg"
                if pictures and _older(picture, found):
                    draw(found, picture)
                text += "\n".join(component_page(found, picture.name))
            write_if_changed(folder / f"{pages[name]}.rst", text)
            written.add(folder / f"{pages[name]}.rst")
    for path in set(folder.glob("*.rst")) - written:
        path.unlink()


def is_component(found: Any) -> bool:
    """Whether an object is a joint, driver, spring, load or contact."""
    return isinstance(found, type) and issubclass(found, uqmbd.Component) and found.__module__.split(".")[0] in PLUGINS


def _older(picture: Path, component: type) -> bool:
    """Whether a picture is to be drawn: it is not there, or the component was changed since."""
    source = Path(inspect.getsourcefile(component) or "")
    return not picture.exists() or picture.stat().st_mtime < source.stat().st_mtime


def _overview(title: str, modules: tuple[str, ...]) -> str:
    lines = [title, "=" * len(title), ""]
    lines += [".. list-table::", "", *(line for module in modules for line in _row(module, module, _summary(module)))]
    return "\n".join([*lines, "", ".. toctree::", "   :hidden:", "", *(f"   {module}" for module in modules), ""])


def _returned_page() -> str:
    """Return the page of classes whose objects public functions return, and which nobody makes by name."""
    title = "What functions return"
    lines = [
        title,
        "=" * len(title),
        "",
        "Objects of these classes are made by what is named, and not by their classes.",
        "",
    ]
    for cls, places in returned().items():
        lines += [
            cls.__name__,
            "-" * len(cls.__name__),
            "",
            f"Of {', '.join(f'`{place}`' for place in places[:4])}.",
            "",
        ]
        lines += [
            f".. autoclass:: {cls.__module__}.{cls.__name__}",
            "   :members:",
            "   :inherited-members: Expr, Symbol, tuple",
            "",
        ]
    return "\n".join(lines)


def _summary(module: str) -> str:
    return _first(importlib.import_module(module))


def _first(found: Any) -> str:
    """Return the first sentence of a docstring."""
    return " ".join((inspect.getdoc(found) or "").split("\n\n", 1)[0].split())


def _row(shown: str, page: str, text: str) -> list[str]:
    return [f"   * - :doc:`{shown} <{page}>`", f"     - {text}"]


def _module_page(module: str, pages: dict[str, str]) -> str:
    """Return the page of a module: what it says of itself, and a table of each kind of names."""
    names = public_names(module)
    lines = [module, "=" * len(module), "", f".. automodule:: {module}", "   :no-members:", ""]
    for which, title in TITLES.items():
        chosen = [name for name, found in names.items() if kind(found) == which]
        if chosen:
            lines += [title, "-" * len(title), "", ".. list-table::", ""]
            for name in chosen:
                text = told_at_its_place(name, names[name]) if which == "data" else _first(names[name])
                lines += _row(name, pages[name], text)
            lines.append("")
    return "\n".join([*lines, ".. toctree::", "   :hidden:", "", *(f"   {pages[name]}" for name in names), ""])


def _object_page(module: str, name: str, found: Any) -> str:
    title, which = f"{module}.{name}", kind(found)
    if which == "data":
        shown = [f".. py:data:: {name}", "   :module: " + module, "", f"   {told_at_its_place(name, found)}", ""]
        return "\n".join([name, "=" * len(name), "", *shown])
    options = [] if is_component(found) else [f"   {option}" for option in OPTIONS.get(which, ())]
    if which == "class" and options and len(shown := owners(found)) > 1:
        others = ", ".join(base.__name__ for base in found.__mro__ if base not in shown)
        options.append(f"   :inherited-members: {others}")
    lines = [name, "=" * len(name), "", f".. currentmodule:: {module}", "", f".. auto{which}:: {title}", *options, ""]
    return "\n".join(lines)
