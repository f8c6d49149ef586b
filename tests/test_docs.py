"""The examples of the pages on plugins run as they stand, and every hook has a page."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from uqmbd import plugins

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "plugins"
PAGES = sorted(path for path in FOLDER.glob("*.md") if path.name != "README.md")


@pytest.mark.thorough
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_example_runs_and_passes_its_check(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) >= 2
    package = ModuleType("my_package")
    monkeypatch.setitem(sys.modules, "my_package", package)
    for block in blocks:
        exec(compile(block, page.name, "exec"), package.__dict__)


ALONE = {"other_models.md": "tests/models/test_page.py", "cluster.md": "tests/clusters/test_page.py"}
"""Pages whose examples need more than is installed for tests, and who runs them."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "page", sorted(page for page in (ROOT / "docs").glob("*.md") if page.name not in ALONE), ids=lambda page: page.stem
)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch):
    """And the study that they end in, if there is one."""
    monkeypatch.chdir(tmp_path)
    example = ModuleType("page_of_docs")
    monkeypatch.setitem(sys.modules, "page_of_docs", example)
    for block in re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        exec(compile(block, page.name, "exec"), example.__dict__)
    if hasattr(example, "study"):
        assert "failed" not in example.study.run().attrs


def test_every_path_that_the_page_on_changes_names_is_there():
    text = (ROOT / "docs" / "change.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([\w-]+/[\w/.-]+)`", text)
    assert len(paths) > 20
    assert [x for x in paths if not ((ROOT / x).exists() or (ROOT / "uqmbd" / x).exists())] == []


def test_every_hook_has_a_page_and_every_link_leads_somewhere():
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert [kind.hook for kind in plugins.KINDS.values() if kind.hook not in index] == []
    for page in [FOLDER / "README.md", *PAGES, *(ROOT / "docs").glob("*.md"), ROOT / "README.md"]:
        for link in re.findall(r"\]\(([^)#\s]+)\)", page.read_text(encoding="utf-8")):
            assert link.startswith("http") or (page.parent / link).exists(), (page.name, link)
