"""Scripts of pages: JavaScript modules joined into one, and libraries."""

from __future__ import annotations

import re
from importlib.resources import files

__all__ = ["joined_modules", "library", "surface_library", "vendor_file"]

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.-]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?function\b|const\b|class\b)", re.MULTILINE)
_DECLARED = re.compile(r"^(?:async )?(?:function|const|let|class) ([\w$]+)", re.MULTILINE)


def joined_modules(*names: str) -> str:
    """Return the text of one module that contains the files `names` and, before them, their imports.

    The names of all files share one scope; the text is for `<script type="module">`.

    Raise ValueError if two files declare the same name. Also raise it if a file contains an import or export of another
    form, or `</script`.
    """
    texts: dict[str, str] = {}
    owner: dict[str, str] = {}

    def add(name: str) -> None:
        if name in texts:
            return
        source = (files("uqmbd") / "report" / "live" / name).read_text(encoding="utf-8")
        for other in _IMPORT.findall(source):
            add(other)
        text = _EXPORT.sub("", _IMPORT.sub("", source))
        if re.search(r"^(?:import|export)\b", text, re.MULTILINE):
            raise ValueError(f"{name} has an import or an export that the page cannot merge.")
        if "</script" in text.lower() or "<!--" in text:
            raise ValueError(f"{name} contains a text that would end its HTML element.")
        for declared in _DECLARED.findall(text):
            if declared in owner:
                raise ValueError(f"{name} and {owner[declared]} both declare {declared}.")
            owner[declared] = name
        texts[name] = text

    for name in names:
        add(name)
    return "\n".join(map(_without_comments, texts.values()))


def surface_library() -> str:
    """Return the script of three.js, which draws surfaces in space."""
    return library("three", "three.min.js")


def library(name: str, file: str) -> str:
    """Return the script of a library, with its licence as a comment."""
    return f"/*\n{name}\n{vendor_file(f'LICENSE-{name}.txt')}\n*/\n{vendor_file(file)}"


def vendor_file(name: str) -> str:
    """Return the text of a file of a library."""
    return (files("uqmbd") / "report" / "live" / "vendor" / name).read_text(encoding="utf-8")


def _without_comments(source: str) -> str:
    """Return a script without comments and indentation, which makes pages smaller."""
    kept, comment = [], False
    for line in map(str.strip, source.splitlines()):
        if line.count("`") % 2:
            raise ValueError(f"A script has a multi-line text, in which spaces are significant: {line!r:.80}.")
        comment = comment or line.startswith("/*")
        if not comment and line and not line.startswith("//"):
            kept.append(line)
        comment = comment and not line.endswith("*/")
    return "\n".join(kept) + "\n"
