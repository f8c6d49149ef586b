"""The page on other people's models runs as it stands, and tells what its example prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import uqmbd
from uqmbd_models import MJCF

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "other_models.md").read_text(encoding="utf-8")


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")  # a plane linkage in space
def test_the_example_runs_and_prints_what_the_page_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(uqmbd, "from_mjcf", lambda path: MJCF().read(path), raising=False)
    (model,) = re.findall(r"^```xml\n(.*?)^```$", PAGE, re.M | re.S)
    (script,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
    (tmp_path / "crank.xml").write_text(model, encoding="utf-8")
    namespace = {}
    exec(compile(script, "other_models.md", "exec"), namespace)
    (printed,) = re.findall(r"`crank.xml` the list is:\n\n((?:    .*\n)+)", PAGE)
    assert capsys.readouterr().out.split("\n") == [line.strip() for line in printed.split("\n")]
    tree = namespace["study"].run()
    assert "failed" not in tree.attrs
    assert float(tree["collocation/statistics"]["std"].sel(output="tip").max()) > 1e-3
