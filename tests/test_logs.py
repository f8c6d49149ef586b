"""Logging by the standard library: silent by default, useful where a program listens, and no cost where it does not."""

from __future__ import annotations

import logging
import subprocess
import sys

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from .mechanisms import driven_slider_crank, oscillator


def study(*methods, times=11):
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    return uqmbd.Study("oscillator", oscillator(stiffness), np.linspace(0, 1, times), list(methods))


@pytest.fixture
def said(caplog):
    """Messages of our loggers at a level."""

    def run(level, what):
        caplog.clear()
        with caplog.at_level(level, logger="uqmbd"):
            what()
        return [(r.name, r.levelname, r.getMessage()) for r in caplog.records if r.name.startswith("uqmbd")]

    return run


@pytest.mark.thorough
def test_info_says_what_begins_and_ends_and_refinements(said):
    found = said("INFO", study(MonteCarlo(samples=20), Collocation(order=1, adaptive="order", tolerance=0.05)).run)
    words = [text for name, _, text in found if name == "uqmbd.methods"]
    assert words[0] == "monte-carlo: begins, 1 input, 11 output times"
    assert words[1].startswith("monte-carlo: finished: 20 realisations, 0 failed, ")
    assert [text.split(":")[0] for text in words] == ["monte-carlo", "monte-carlo", "collocation", "collocation"]
    steps = [text for name, _, text in found if name == "uqmbd.refinement"]
    assert len(steps) >= 2 and "2 terms: mean changed by inf" in steps[0] and "tolerance 0.05" in steps[0]
    assert {level for _, level, _ in found} == {"INFO"}


@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of 12 %: two elements of order 1
def test_elements_are_reported(said):
    found = said("INFO", study(Collocation(order=1, elements=2)).run)
    assert [text.split(",")[0] for name, _, text in found if name == "uqmbd.refinement"] == [
        "collocation: 1 elements",
        "collocation: 2 elements",
    ]


@pytest.mark.thorough
def test_debug_says_chunks_and_failures(said):
    """A rod that is too short does not let the crank pass."""
    rod = uqmbd.RandomVariable("rod", chaospy.Uniform(0.145, 0.2), units="m")
    failing = uqmbd.Study("crank", driven_slider_crank(rod), np.linspace(0, 1.2, 5), [MonteCarlo(samples=60, seed=1)])
    tree = {}

    def run():
        with pytest.warns(UserWarning):
            tree["found"] = failing.run()

    found = said("DEBUG", run)
    failures = int(tree["found"]["monte-carlo"].attrs["failures"])
    assert failures
    own = [(level, text) for name, level, text in found if name == "uqmbd.realisations"]
    assert any(level == "INFO" and f"{failures} of 60 realisations failed; the first: " in text for level, text in own)
    inputs = tree["found"]["monte-carlo/samples"]["inputs"].values[:, 0]
    told = [text for level, text in own if level == "DEBUG" and "inputs [" in text]
    assert len(told) == failures and all(any(repr(float(x)) in text for x in inputs) for text in told)
    assert any(text.startswith("monte-carlo: 60 realisations of outputs in ") for _, text in own)


def test_kernels_are_reported(said, tmp_path, monkeypatch):
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "kernels"))

    def simulate():
        uqmbd.simulate(oscillator(100.0, mass=1.7), np.linspace(0, 0.1, 3), check=False)

    first, second = said("DEBUG", simulate), said("DEBUG", simulate)
    made = [text.split(":")[0] for name, level, text in first if name == "uqmbd.kernels" and "compiled in" in text]
    again = [
        text.split(":")[0] for name, level, text in second if name == "uqmbd.kernels" and "taken from the cache" in text
    ]
    assert made and set(again) <= set(made) and not any("compiled in" in text for _, _, text in second)


def test_a_method_that_fails_is_reported(said):
    def run():
        with pytest.warns(uqmbd.MethodFailedWarning):
            study(MonteCarlo(samples=4), Collocation(order=3, max_realisations=1)).run()

    assert any("collocation" in text for _, _, text in said("INFO", run))


class Calls:
    """Counts how often loggers are asked, and how often something is said."""

    def __init__(self, monkeypatch):
        self.asked = self.said = 0
        enabled, handle = logging.Logger.isEnabledFor, logging.Logger.handle

        def ask(logger, level):
            self.asked += logger.name.startswith("uqmbd")
            return enabled(logger, level)

        def say(logger, record):
            self.said += logger.name.startswith("uqmbd")
            return handle(logger, record)

        monkeypatch.setattr(logging.Logger, "isEnabledFor", ask)
        monkeypatch.setattr(logging.Logger, "handle", say)


def test_where_nobody_listens_it_costs_nothing(monkeypatch):
    """No record is made, and loggers are asked as often for few output times and realisations of a chunk as for many."""
    small, large = study(MonteCarlo(samples=16)), study(MonteCarlo(samples=64), times=101)
    for one in (small, large):
        one.run()  # compiled
    counts = []
    for one in (small, large):
        with monkeypatch.context() as patched:
            calls = Calls(patched)
            one.run()
        counts.append(calls.asked)
        assert calls.said == 0
    assert counts[0] == counts[1] < 40


@pytest.mark.thorough
def test_nothing_is_printed():
    """Neither by default, nor on standard output where a program listens."""
    script = (
        "import logging, sys, numpy as np, uqmbd, chaospy\n"
        "from uqmbd_montecarlo import MonteCarlo\n"
        "mechanism = uqmbd.Mechanism('fall', uqmbd.Translational(gravity=(0, -9.81)))\n"
        "height = uqmbd.RandomVariable('h', chaospy.Normal(1, 0.1))\n"
        "stone = mechanism.body('stone', mass=1, position=(0, height))\n"
        "mechanism.output('y', stone.position[1])\n"
        "study = uqmbd.Study('fall', mechanism, [0, 1], [MonteCarlo(samples=8)])\n"
        "study.run()\n"
        "sys.stderr.write('listens\\n'); sys.stderr.flush()\n"
        "logging.basicConfig(force=True); logging.getLogger('uqmbd').setLevel('INFO')\n"
        "study.run()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    before, _, after = done.stderr.partition("listens\n")
    assert (done.stdout, before) == ("", "")
    assert "INFO:uqmbd.methods:monte-carlo: begins, 1 input, 2 output times" in after
