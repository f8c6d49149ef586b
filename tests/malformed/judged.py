"""What became of malformed studies that ran in processes of their own, and what is wrong with that."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from .mutations import Case


def run_isolated(cases: Sequence[Case]) -> dict[str, dict[str, Any]]:
    """Run cases one after the other; where one ends the process, another one goes on with the next."""
    waiting, found = [case.name for case in cases], {}
    while waiting:
        text = "".join(json.dumps(name) + "\n" for name in waiting)
        command = [sys.executable, "-m", "tests.malformed.isolated"]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
        begun = None
        for line in done.stdout.splitlines():
            told = json.loads(line)
            begun = told.get("begin")
            if begun is None:
                found[told["name"]] = told
        if begun is None and not done.returncode:
            break
        assert begun is not None, done.stderr
        found[begun] = {
            "fate": "died",
            "message": f"status {done.returncode}",
            "heard": done.stderr[-500:],
            "warnings": [],
            "trace": "",
            "seconds": 0.0,
        }
        waiting = waiting[waiting.index(begun) + 1 :]
    return found


def complaint(case: Case, found: dict[str, Any]) -> str:
    """Say what is wrong with what became of a case; empty: nothing."""
    fate, message = found["fate"], found["message"]
    if fate in ("died", "mistake"):
        return f"{fate}: {message} [{found['trace']}]"
    if found["heard"].strip():
        return f"raw text: {found['heard'].strip()[:200]}"
    if found["warnings"]:
        return f"foreign warning: {found['warnings'][0]}"
    if case.fate == "refused" and fate != "refused":
        return f"{'accepted' if fate == 'computed' else 'failed: ' + message}, expected a StudyError"
    missing = [word for word in case.words if word not in message]
    if fate == "refused" and missing:
        return f"the message does not contain {missing[0]!r}: {message}"
    return ""
