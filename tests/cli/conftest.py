"""The command line, run in the process of the tests."""

from __future__ import annotations

import sys
import warnings

import pytest

from uqmbd.cli import main


@pytest.fixture
def command_line(monkeypatch, tmp_path, capsys):
    """Run the command line in an empty folder; return status, output and errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)

    def run(*words):
        # In the tests warnings are errors; users see them as text.
        with pytest.raises(SystemExit) as left, warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            main(list(words))
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    yield run
    # a study is imported by the name of its file: that of the next test is another one
    for name in {path.stem for path in tmp_path.glob("*.py")} - before:
        sys.modules.pop(name, None)
