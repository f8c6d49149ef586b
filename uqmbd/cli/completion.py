"""What shells complete: study files, and labels of their methods.

Nothing is run or imported for it: a script is read as text.  Where nothing is returned, the shell completes files and
folders by itself, which it does better (folders are gone into, and no space follows them).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import typer

__all__ = ["labels", "studies"]

LONGEST = 1_000_000
"""Bytes of a script that is read."""


def studies(incomplete: str) -> list[str]:
    """Return the scripts with a study that a beginning of a path may mean; none: the shell lists files by itself."""
    folder = Path(incomplete).parent if incomplete and not incomplete.endswith("/") else Path(incomplete)
    before = incomplete[: incomplete.rfind("/") + 1]
    found = []
    try:
        for path in sorted(folder.glob("*.py")):
            if (name := before + path.name).startswith(incomplete) and re.search(r"^study\b", _text(path), re.M):
                found.append(name)
    except OSError:
        return []
    return found


def labels(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the labels of the methods of the study that was typed before, as far as its script states them."""
    # an option without its value ends what is read of the arguments: they are left as they were typed
    script = ctx.params.get("script") or next(iter(ctx.args), None)
    if script is None:
        return []
    try:
        tree = ast.parse(_text(Path(script)))  # it is read, not run
    except (OSError, SyntaxError, ValueError):
        return []
    return [label for label in dict.fromkeys(_labels(tree)) if label.startswith(incomplete)]


def _text(path: Path) -> str:
    """Read a script; empty where it is too long to be one."""
    if path.stat().st_size > LONGEST:
        return ""
    return path.read_text(encoding="utf-8", errors="replace")


def _labels(tree: ast.Module) -> Iterator[str]:
    """Find the labels of the methods that are given to studies, in lists or by names of lists."""
    assigned = {
        target.id: node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or _name(node.func) != "Study":
            continue
        given = [word.value for word in node.keywords if word.arg == "propagators"] + node.args[3:4]
        for methods in given:
            if isinstance(methods, ast.Name):
                methods = assigned.get(methods.id, methods)
            for method in getattr(methods, "elts", ()):
                if isinstance(method, ast.Name):
                    method = assigned.get(method.id, method)
                if isinstance(method, ast.Call):
                    yield from _label(method)


def _label(method: ast.Call) -> Iterator[str]:
    """Find the label of a method: the stated one, or else its name, which is that of its class."""
    for word in method.keywords:
        if word.arg == "label":
            if isinstance(word.value, ast.Constant) and isinstance(word.value.value, str):
                yield word.value.value
            return
    yield re.sub("(?<=[a-z0-9])(?=[A-Z])", "-", _name(method.func)).lower()


def _name(function: ast.expr) -> str:
    """Return the last part of a name."""
    return getattr(function, "attr", getattr(function, "id", ""))
