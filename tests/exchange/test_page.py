"""The examples of the page on other packages run, part by part, where their packages are installed."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "ecosystem.md").read_text(encoding="utf-8")
START, *PARTS = re.split(r"^## ", PAGE, flags=re.M)


def blocks(text):
    return re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)


@pytest.fixture(scope="module")
def study():
    """What the first part of the page makes, which the others share."""
    example = ModuleType("page_of_docs")
    sys.modules["page_of_docs"] = example
    for block in blocks(START):
        exec(compile(block, "ecosystem.md", "exec"), example.__dict__)
    yield example
    del sys.modules["page_of_docs"]


@pytest.mark.thorough
@pytest.mark.parametrize("part", [part for part in PARTS if blocks(part)], ids=lambda part: part.partition("\n")[0])
def test_a_part_runs(part, study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope = dict(study.__dict__)
    needed = {name for block in blocks(part) for name in re.findall(r"^(?:import|from) (\w+)", block, re.M)}
    missing = sorted(name for name in needed if importlib.util.find_spec(name) is None)
    for block in blocks(part):
        if not any(re.search(rf"^(?:import|from) {name}\b", block, re.M) for name in missing):
            exec(compile(block, "ecosystem.md", "exec"), scope)
    if missing:
        pytest.skip(f"{', '.join(missing)} is not installed: its examples did not run")
