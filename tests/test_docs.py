"""The examples of the pages on plugins run as they stand, and every hook has a page."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from uqmbd import plugins

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FOLDER = DOCS / "how-to" / "plugins"
PAGES = sorted(path for path in FOLDER.glob("*.md") if path.name != "index.md")
OTHERS = sorted(
    path
    for path in DOCS.rglob("*.md")
    if path not in PAGES and path.relative_to(DOCS).parts[0] not in ("_build", "_ext", "gallery")
)
"""All pages but those on plugins, without what a build of the site makes."""

BLOCK = re.compile(r"^```(?:python|\{code-cell\} *(?:python|ipython3)?)\n(.*?)^```$", re.M | re.S)
"""A block of code; those of executed pages are code cells, whose options stand in lines that begin with a colon."""


def blocks_of(page):
    """Find the blocks of a page, as the site and a reader run them."""
    text = page.read_text(encoding="utf-8")
    return [re.sub(r"\A(:.*\n)+", "", block) for block in BLOCK.findall(text)]


@pytest.mark.thorough
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_example_runs_and_passes_its_check(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(page)
    assert len(blocks) >= 2
    package = ModuleType("my_package")
    monkeypatch.setitem(sys.modules, "my_package", package)
    for block in blocks:
        exec(compile(block, page.name, "exec"), package.__dict__)


ALONE = {
    "other_models.md": "tests/models/test_page.py",
    "cluster.md": "tests/clusters/test_page.py",
    "features.md": "tests/test_readme.py",
    "ecosystem.md": "tests/exchange/test_page.py",
}
"""Pages whose examples need more than is installed for tests, and who runs them."""


@pytest.mark.thorough(every_case=True)
@pytest.mark.parametrize(
    "page", [page for page in OTHERS if page.name not in ALONE and blocks_of(page)], ids=lambda page: page.stem
)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch):
    """And the study that they end in, if there is one."""
    monkeypatch.chdir(tmp_path)
    example = ModuleType("page_of_docs")
    monkeypatch.setitem(sys.modules, "page_of_docs", example)
    for block in blocks_of(page):
        exec(compile(block, page.name, "exec"), example.__dict__)
    if hasattr(example, "study"):
        assert "failed" not in example.study.run().attrs


def test_every_path_that_the_page_on_changes_names_is_there():
    text = (ROOT / "docs" / "change.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([\w-]+/[\w/.-]+)`", text)
    assert len(paths) > 20
    assert [x for x in paths if not ((ROOT / x).exists() or (ROOT / "uqmbd" / x).exists())] == []


def test_every_hook_has_a_page_and_every_link_leads_somewhere():
    index = (FOLDER / "index.md").read_text(encoding="utf-8")
    assert [kind.hook for kind in plugins.KINDS.values() if kind.hook not in index] == []
    for page in [*PAGES, *OTHERS, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)", page.read_text(encoding="utf-8")):
            assert link.startswith("http") or (page.parent / link).exists(), (page.name, link)


def test_no_line_of_a_page_is_hidden():
    """MyST hides lines that begin with a per cent sign, such as the end of "95 %" after a line break."""
    hidden = {}
    for page in [*PAGES, *OTHERS]:
        text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        hidden[page.name] = re.findall(r"^\s*%.*$", text, re.M)
    assert {name: lines for name, lines in hidden.items() if lines} == {}
