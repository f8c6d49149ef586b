"""An exporter of a third party, with options, for surrogates and mechanisms."""

from __future__ import annotations

from pathlib import Path

import pytest

from uqmbd.testing import check_exporter

PACKAGE = Path(__file__).parent / "uqmbd-table-plugin"

STUDY = """
import chaospy
import uqmbd
from uqmbd_collocation import Collocation

speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
stone = mechanism.body("stone", mass=1, velocity=speed)
mechanism.output("height", stone.position[0], units="m")
study = uqmbd.Study("throw", mechanism, [0, 1, 2], [Collocation(order=1)])
"""


def test_the_exporter_conforms(monkeypatch):
    monkeypatch.syspath_prepend(PACKAGE)
    from uqmbd_table import Table

    check_exporter(Table)


@pytest.mark.thorough
def test_the_command_uses_the_exporter_of_the_ending_with_its_options(python, site):
    script = site.parent / "throw.py"
    script.write_text(STUDY)
    said = python("-m", "uqmbd", "export", str(script), "--to", "throw.tab", "--digits", "4", "--spread")
    assert said == "3 columns\n"
    assert (site.parent / "throw.tab").read_text().split() == ["0", "0", "0", "1", "3", "0.2", "2", "6", "0.4"]
    said = python("-m", "uqmbd", "export", str(script), "--to", "bodies.tab", "--what", "mechanism")
    assert said == "1 bodies\n" and (site.parent / "bodies.tab").read_text() == "stone\n"
    assert "Export of the mechanism (table): yes: uqmbd export --to FILE.tab" in python(
        "-m", "uqmbd", "check", str(script)
    )
