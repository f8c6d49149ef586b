"""Results and reports name the random processes of the mechanism with their spectra."""

from __future__ import annotations

import json

import chaospy
import numpy as np

import uqmbd
from uqmbd.cli.compare.differences import find_differences
from uqmbd.report import write_report
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, kanai_tajimi, stationary_std
from uqmbd_springs import PointForce, SpringDamper


def result(**options):
    """Return the process, and results of an oscillator on it."""
    push = RandomProcess("push", units="m/s^2", **options)
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(30, 40), units="N/m")
    body = mechanism.body("body", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness, damping=2.4, free_length=1))
    mechanism.add(PointForce("load", body, 0, 2.0 * push()))
    mechanism.output("deviation", stationary_std(body.position[0]), units="m")
    return push, uqmbd.Study("s", mechanism, propagators=[MonteCarlo(samples=20, seed=1)]).run()


def test_the_report_describes_the_process(tmp_path):
    push, tree = result(psd=kanai_tajimi(0.01, 15.6, 0.6), cutoff=12.5)
    assert json.loads(tree.attrs["model"])["excitations"] == {"push": repr(push)}
    write_report(tree, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    part = text[text.index("<h3>Excitations</h3>") :]
    for words in ("<dt>push</dt>", "frequency=15.6, damping=0.6", "cutoff=12.5"):
        assert words in part


def test_a_record_is_shortened():
    values = np.random.default_rng(1).standard_normal(500)
    _, tree = result(record=(0.1, values))
    text = json.loads(tree.attrs["model"])["excitations"]["push"]
    assert len(text) == 600 and text.startswith("RandomProcess('push', record=(0.1, (0.34558") and text.endswith("…")


def test_other_spectra_are_differences_of_results():
    one, other = (result(psd=kanai_tajimi(0.01, 15.6, ratio))[1] for ratio in (0.6, 0.7))
    (name, found), *rest = find_differences({"A": one, "B": other})
    assert name == "excitation push" and not rest
    assert "damping=0.6" in found["A"] and "damping=0.7" in found["B"]
