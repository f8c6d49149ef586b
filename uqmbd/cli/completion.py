"""Shell completion of study files, and of labels of their methods.

Completion reads a script as text, and neither runs nor imports it. If it returns no suggestion, the shell completes
files and folders. The shell handles folders better: it descends into them, and adds no space.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import typer

__all__ = ["labels", "studies"]

LONGEST = 1_000_000
"""Maximum size of a script for completion, bytes."""


def studies(incomplete: str) -> list[str]:
    """Return the scripts with a study that match the start of a path; if empty, the shell lists files."""
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
    """Return the labels of the methods of the study on the command line, as far as its script states them."""
    # an option without its value stops the parser, which leaves later arguments in `args`
    script = ctx.params.get("script") or next(iter(ctx.args), None)
    if script is None:
        return []
    try:
        tree = ast.parse(_text(Path(script)))  # the script is read, but does not run
    except (OSError, SyntaxError, ValueError):
        return []
    return [label for label in dict.fromkeys(_labels(tree)) if label.startswith(incomplete)]


def _text(path: Path) -> str:
    """Return the text of a script; empty if it is too long."""
    if path.stat().st_size > LONGEST:
        return ""
    return path.read_text(encoding="utf-8", errors="replace")


def _labels(tree: ast.Module) -> Iterator[str]:
    """Find the labels of methods that are passed to studies, in lists or by names of lists."""
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
    """Return the label of a method: the given label, otherwise the name from its class."""
    for word in method.keywords:
        if word.arg == "label":
            if isinstance(word.value, ast.Constant) and isinstance(word.value.value, str):
                yield word.value.value
            return
    yield re.sub("(?<=[a-z0-9])(?=[A-Z])", "-", _name(method.func)).lower()


def _name(function: ast.expr) -> str:
    """Return the last part of a name."""
    return getattr(function, "attr", getattr(function, "id", ""))
