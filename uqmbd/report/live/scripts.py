"""The modules of JavaScript as one script: a page that is a single file has no address to import from.

Own code: bundlers of JavaScript (esbuild, rollup) need a build step with Node. What is joined here are modules whose
imports are lines `import { a, b } from "./other.js";`, and whose exports stand before their declarations.
"""

from __future__ import annotations

import re
from importlib.resources import files

__all__ = ["joined_modules"]

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.-]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?function\b|const\b|class\b)", re.MULTILINE)
_DECLARED = re.compile(r"^(?:async )?(?:function|const|let|class) ([\w$]+)", re.MULTILINE)


def joined_modules(*names: str) -> str:
    """Return the text of one module with what the files `names` hold, and before them what they import.

    Their names share one scope; the text is for `<script type="module">`.

    Raises
    ------
    ValueError
        If two files declare the same name, one has an import or export of another form, or one holds `</script`.
    """
    texts: dict[str, str] = {}
    owner: dict[str, str] = {}

    def add(name: str) -> None:
        if name in texts:
            return
        source = (files(__package__) / name).read_text(encoding="utf-8")
        for other in _IMPORT.findall(source):
            add(other)
        text = _EXPORT.sub("", _IMPORT.sub("", source))
        if re.search(r"^(?:import|export)\b", text, re.MULTILINE):
            raise ValueError(f"{name} has an import or an export that cannot be joined.")
        if "</script" in text.lower() or "<!--" in text:
            raise ValueError(f"{name} holds a text that ends its element in HTML.")
        for declared in _DECLARED.findall(text):
            if declared in owner:
                raise ValueError(f"{name} and {owner[declared]} both declare {declared}.")
            owner[declared] = name
        texts[name] = text

    for name in names:
        add(name)
    return "\n".join(texts.values())
