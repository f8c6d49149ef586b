"""What `uqmbd run` says before the work begins: that there is nothing to go on with, and who is waited for."""

from __future__ import annotations

import json

import pytest

STUDY = """
import chaospy, uqmbd
from uqmbd_montecarlo import MonteCarlo
mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
mechanism.output("x", mechanism.body("mass", mass=1, velocity=(speed, 0)).position[0], units="m")
study = uqmbd.Study("fall", mechanism, [0.0, 1.0], [MonteCarlo(samples=70, seed=1)])
"""


def test_nothing_to_go_on_with_is_reported(command_line, tmp_path):
    (tmp_path / "fall.py").write_text(STUDY)
    (tmp_path / "results" / "unfinished").mkdir(parents=True)
    (tmp_path / "results" / "unfinished" / "asked.json").write_text(json.dumps({"study": "0" * 32, "methods": {}}))
    status, _, said = command_line("run", "fall.py", "--no-report", "--resume")
    assert status == 0, said
    assert said.splitlines().count("Note: --resume: results contains no unfinished run; a new run starts.") == 1


def test_who_is_waited_for_is_the_stage(command_line, tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "fall.py").write_text(STUDY)
    status, _, said = command_line("run", "fall.py", "--no-report", "--dask", "nobody.json")
    assert status == 2
    assert said.index("connecting to the Dask scheduler nobody.json ...\n") < said.index("Error: --dask nobody.json:")
