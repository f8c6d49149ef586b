"""The example of the page on clusters runs as it stands, as a script beside a study."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import uqmbd

ROOT = Path(uqmbd.__file__).parents[1]


@pytest.mark.thorough
def test_the_example_runs(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    page = (ROOT / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
    [example] = re.findall(r"^```python\n(.*?)^```$", page, re.M | re.S)
    (tmp_path / "my_study.py").write_text((ROOT / "studies" / "pendulum.py").read_text(encoding="utf-8"))
    (tmp_path / "example.py").write_text(example + "        assert len(tree.children)\n")
    paths = os.pathsep.join([str(ROOT), str(ROOT / "plugins")])
    done = subprocess.run(
        [sys.executable, "example.py"],
        cwd=tmp_path,
        env=dict(os.environ, PYTHONPATH=paths),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "results").iterdir())
