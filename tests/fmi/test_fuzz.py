"""Random sequences of calls, compiled with sanitizers: errors have a status and a message, and nothing crashes."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

import uqmbd
from uqmbd_fmi import export_fmu
from uqmbd_fmi.exporting import MECHANISM, SURROGATE

from .surrogates import KINDS, node
from .test_mechanism_fmu import controlled, hitting_rod, lawful, rotor, swung_by_inputs, tabled, two_contacts

MECHANISMS = {
    "mechanism": (rotor, ("torque",)),
    "impacts": (hitting_rod, ()),
    "friction": (two_contacts, ()),
    "controller": (controlled, ()),
    "law": (lawful, ()),
    "table": (lambda: tabled(lambda body: uqmbd.t), ()),
    "motion": (swung_by_inputs, ("angle", "rate", "acceleration", "since")),
}

SANITIZED = ("-std=gnu11", "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("kind", ["composed", "dependent", *MECHANISMS])
def test_no_sequence_of_calls_crashes(kind, tmp_path):
    mechanism, (make, inputs) = kind in MECHANISMS, MECHANISMS.get(kind, (None, ()))
    source = make() if mechanism else node(KINDS[kind]())
    done = export_fmu(source, tmp_path / "one.fmu", compiler="none", inputs=inputs)
    with zipfile.ZipFile(done.path) as archive:
        archive.extractall(tmp_path)
    names = ("instance.c", "fmi2.c", "data.c", *(MECHANISM if mechanism else SURROGATE))
    sources = [str(tmp_path / "sources" / name) for name in names]
    words = ["gcc", *SANITIZED, *sources, str(Path(__file__).with_name("fuzz.c")), "-lm", "-o", str(tmp_path / "fuzz")]
    made = subprocess.run(words, capture_output=True, text=True, check=False)
    if made.returncode and "asan" in made.stderr:
        pytest.skip("gcc has no sanitizers")
    assert made.returncode == 0, made.stderr
    run = subprocess.run([str(tmp_path / "fuzz"), "1", "200"], capture_output=True, text=True, check=False)
    assert run.returncode == 0 and " calls, " in run.stdout, run.stderr[-2000:]
