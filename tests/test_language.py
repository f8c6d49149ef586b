"""The texts are plain technical English: phrases and identifiers that readers had to read twice do not come back.

The list holds what a search can judge; the rest is left to readers.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PHRASES = {
    r"\b(?:is|are|be|was|were|being|been) (?:told|said|sold|bought)\b": "reports, warns, lists, states",
    r"\btold (?:beforehand|of|about|at|by|with)\b": "predicted, reported",
    r"\btells (?:of|how|what|that|when|where|which|about)\b": "reports, states, shows, lists",
    r"\bforetold\b|\bforetells?\b": "predicted",
    r"\bdear(?:er|est)?\b": "expensive, costly",
    r"\b(?:Staff|Crew|_Desk|Desk)\b": "WorkerPool, worker, task queue",
    r"\bhow sure\b": "confidence interval, uncertainty",
    r"\bnothing but itself\b": "does not affect the others",
    r"\bcan I believe\b|\bwhat comes back\b": "reliability; return value",
    r"\bput by\b|\bgleaned\b": "stored, derived",
    r"\bother people's models\b": "model import",
    r"\bthe page has the word\b": "the page documents",
}
"""Patterns, in any case, and what to write instead; identifiers of one capital letter are matched as they are."""

ALLOWED: dict[str, str] = {
    "tests/test_language.py": "the list itself",
}
"""Files that may hold them, and why."""

ALLOWED_WORDS: dict[str, tuple[str, str]] = {
    "uqmbd/propagation/studies/study.py": (
        "foretold",
        "`Study.foretold` was public: it warns, and leaves in version 0.2",
    ),
}
"""A word that a file may hold, and why."""

TEXTS = (".py", ".md", ".js", ".html", ".jinja", ".h", ".c", ".toml")


def _files() -> list[str]:
    """List the files of the repository that hold text for readers."""
    found = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    names = found.stdout.splitlines() if found.returncode == 0 else [str(p.relative_to(ROOT)) for p in ROOT.rglob("*")]
    chosen = ("uqmbd/", "plugins/", "studies/", "docs/", "README.md", "CONTRIBUTING.md", "SECURITY.md")
    return [name for name in names if name.startswith(chosen) and name.endswith(TEXTS) and "/vendor/" not in name]


def _found(text: str) -> list[str]:
    """List lines with one of the phrases, and what to write instead."""
    wrong = []
    for pattern, instead in PHRASES.items():
        flags = re.MULTILINE if "Staff" in pattern else re.MULTILINE | re.IGNORECASE
        for hit in re.finditer(pattern, text, flags):
            line = text.count("\n", 0, hit.start()) + 1
            wrong.append(f"line {line}: {hit[0]!r}; write: {instead}")
    return wrong


@pytest.mark.parametrize(
    "text", ["It is told at the end.", "class Staff:", "A dearer method", "what comes back", "This tells how"]
)
def test_the_search_finds_what_it_is_for(text: str) -> None:
    assert _found(text)


@pytest.mark.parametrize("text", ["The report states the error.", "the staff of the bench", "It retells", "untold"])
def test_the_search_finds_nothing_else(text: str) -> None:
    assert not _found(text)


def test_no_text_has_phrases_that_were_replaced() -> None:
    wrong = {}
    for name in _files():
        if name in ALLOWED:
            continue
        word = ALLOWED_WORDS.get(name, ("", ""))[0]
        found = [
            line for line in _found((ROOT / name).read_text(encoding="utf-8")) if not word or repr(word) not in line
        ]
        if found:
            wrong[name] = found
    assert not wrong, "\n".join(f"{name}: {line}" for name, lines in wrong.items() for line in lines)


def test_allowed_words_are_in_their_files() -> None:
    for name, (word, _) in ALLOWED_WORDS.items():
        assert word in (ROOT / name).read_text(encoding="utf-8"), name
