"""The texts are plain technical English: phrases and identifiers that readers had to read twice do not come back.

The list holds what a search can judge; the rest is left to readers.
"""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
from collections.abc import Iterator
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
    r"\bdoubted\b|\bnothing learned\b": "rejected, unreliable; no reduction",
    r"\bdraw (?:it|them) apart\b": "change the given poses",
}
"""Patterns, in any case, and what to write instead; identifiers of one capital letter are matched as they are."""

HEADINGS = {
    r"\bWhat was asked\b": "Results",
    r"\bWhat matters\b|\bMatters most\b|>Because of<": "Main contributors",
    r"\bHow reliable is this\b": "Reliability of the results",
    r"\bNext time\b": "Recommended method",
    r"\bOther inputs\b": "What-if",
    r"\bWhat was uncertain\b": "Uncertain inputs",
    r"\bWhich inputs matter\b": "Sensitivity to inputs",
    r"\bHow far the surrogates\b": "Accuracy of the surrogates",
    r"\bOutputs without a time<|\"Outputs without a time\"": "Scalar outputs",
    r"\bWhen events happen\b": "Event times",
    r"\bWork of the solver\b": "Solver statistics",
    r">It says<|\"It says\"": "Condition",
    r"\b[Vv]iolated with (?:a )?probability\b": "Probability of violation",
}
"""Headings of the report and of the console that were replaced, as they are written, and by what."""

SHOW_HEADINGS = ("uqmbd/report/", "uqmbd/cli/", "docs/", "README.md")
"""Where headings are written or quoted."""

ALLOWED: dict[str, str] = {
    "tests/test_language.py": "the list itself",
}
"""Files that may hold them, and why."""

ALLOWED_WORDS: dict[str, tuple[str, str]] = {
    "docs/project/deprecations.md": ("foretold", "the old name of a method"),
    "uqmbd/propagation/studies/study_data.py": (
        "foretold",
        "`Study.foretold` was public: it warns, and leaves in version 0.2",
    ),
}
"""A word that a file may hold, and why."""

TEXTS = (".py", ".md", ".js", ".html", ".jinja", ".j2", ".h", ".c", ".toml")


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


def _old_headings(text: str) -> list[str]:
    """List headings that were replaced, and by what."""
    return [f"{hit[0]!r} is now {new!r}" for old, new in HEADINGS.items() for hit in re.finditer(old, text)]


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


def test_old_headings_are_found_as_they_were_written() -> None:
    assert _old_headings('<h2 id="next-head">Next time</h2>') == ["'Next time' is now 'Recommended method'"]
    assert _old_headings("<th>Because of</th>") == ["'>Because of<' is now 'Main contributors'"]
    assert not _old_headings("the next time, because of other inputs")


def test_report_console_and_pages_use_the_same_headings() -> None:
    names = [name for name in _files() if name.startswith(SHOW_HEADINGS)]
    wrong = {name: _old_headings((ROOT / name).read_text(encoding="utf-8")) for name in names}
    assert not any(wrong.values()), {name: found for name, found in wrong.items() if found}


def test_allowed_words_are_in_their_files() -> None:
    for name, (word, _) in ALLOWED_WORDS.items():
        assert word in (ROOT / name).read_text(encoding="utf-8"), name


MOST_WORDS = 25
"""Words of a sentence; a name in code, a formula and the address of a link count as one or none."""

LONG: dict[str, str] = {
    "docs/reference/components.md": "cells of its table are lists of components",
}
"""Files whose sentences are not counted, and why."""


def _sentences(text: str) -> Iterator[str]:
    """Split text, in Markdown or plain, into sentences: cells of tables, items and paragraphs end them, too."""
    text = re.sub(r"^(```|~~~).*?^\1", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*#:|]|\d+\.) ?)", text):
        for cell in block.split("|"):
            plain = re.sub(r"`[^`]*`|\$[^$]*\$", "code", " ".join(cell.split()))
            yield from re.split(r"(?<=[.!?:;])\**\s+", re.sub(r"\]\([^)]*\)", "]", plain))


def _words(sentence: str) -> int:
    return len(re.findall(r"[\w’']+(?:-[\w’']+)*", sentence))


def _long(text: str) -> list[str]:
    return [f"{_words(one)} words: {one}" for one in _sentences(text) if _words(one) > MOST_WORDS]


def _messages(text: str) -> Iterator[str]:
    """Yield the strings of a module with the parts that are filled in as one word; without docstrings and patterns."""
    tree = ast.parse(text)
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    skipped |= {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "(?" not in node.value:
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(str(x.value) if isinstance(x, ast.Constant) else "x" for x in node.values)


def _prose(docstring: str) -> str:
    """Return a docstring without examples and literal blocks, its entries and their descriptions as paragraphs."""
    lines: list[str] = []
    example, literal, before = False, -1, 0
    for line in inspect.cleandoc(docstring).splitlines():
        indent = len(line) - len(line.lstrip())
        example = (example and bool(line.strip())) or line.lstrip().startswith(">>>")
        if line.strip() and indent <= literal:
            literal = -1
        if not line.strip() or example or literal >= 0 or re.fullmatch(r"\s*-{3,}", line):
            lines.append("")
        else:
            lines += ["", line] if indent != before and not re.match(r"[-*] ", lines[-1].lstrip()) else [line]
            literal, before = (indent if line.endswith("::") else -1), indent
    return re.sub(r"(?::\w+:)?`+([^`]*)`+", "`code`", "\n".join(lines))


def _docstrings(text: str) -> Iterator[str]:
    """Yield the docstrings of a module, also those of its constants and fields."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def test_long_sentences_of_docstrings_are_found() -> None:
    words = "word " * MOST_WORDS
    for text in (
        f"{words} word.",
        f"Short.\n\n{words}\nword.",
        f"Doc.\n\n- {words}\n  word.",
        f"Doc.\n\nx : int\n    {words}word",
    ):
        assert _long(_prose(text)), text
    for text in (
        f"{words}.",
        f"Doc.\n\nx : {words.rsplit(maxsplit=1)[0]}\n    A number.",
        f"Doc.\n\nSo::\n\n    {words} word",
        f"Doc.\n\n>>> f()\n{words} word",
    ):
        assert not _long(_prose(text)), text
    assert list(_docstrings('"""One."""\nX = "no"\n"""Two."""\ndef f():\n    """Three."""')) == [
        "One.",
        "Two.",
        "Three.",
    ]


def test_no_sentence_of_a_docstring_is_long() -> None:
    wrong = {}
    for name in _files():
        if name.endswith(".py") and name.startswith(("uqmbd/", "plugins/")):
            text = (ROOT / name).read_text(encoding="utf-8")
            wrong[name] = [found for one in _docstrings(text) for found in _long(_prose(one))]
    assert not any(wrong.values()), "\n".join(f"{name}: {line}" for name, lines in wrong.items() for line in lines)


def test_long_sentences_are_found() -> None:
    words = "word " * MOST_WORDS
    assert not _long(f"One {words.removesuffix('word ')}.") and _long(f"One {words}.")
    assert not _long(f"- {words}\n- {words}") and not _long(f"| {words} | {words} |") and not _long(f"{words}: {words}")
    assert list(_messages('"""Doc."""\nraise E(f"no {name} here")\n"""About it."""')) == ["no x here"]


def test_no_sentence_that_users_see_is_long() -> None:
    wrong = {}
    for name in _files():
        text = (ROOT / name).read_text(encoding="utf-8")
        if name in LONG:
            assert _long(text), f"{name} has no long sentence: take it from the list"
        elif name.endswith(".md") and not name.startswith(("uqmbd/new/", "studies/benchmarks/", "studies/records/")):
            wrong[name] = _long(text)
        elif name.endswith(".py") and name.startswith(("uqmbd/", "plugins/")):
            wrong[name] = [found for message in _messages(text) for found in _long(message)]
    assert not any(wrong.values()), "\n".join(f"{name}: {line}" for name, lines in wrong.items() for line in lines)
