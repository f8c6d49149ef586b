"""Mechanisms of the comparison, each with requirements that are violated with chosen probabilities.

The mechanisms of the table of stated errors are here with their closed forms.  The examples of the dissertation and
other studies have none: their references are integrated at a thousandth of the tolerance.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "benchmarks"), str(HERE.parent)]

from error_mechanisms import MECHANISMS, Array, TestedMechanism
from measure import console, table_of
from stated_errors import Reference, index_estimates, stated

import uqmbd

__all__ = [
    "CASES",
    "CLASSES",
    "HELD_OUT",
    "QUICK",
    "Array",
    "Reference",
    "TestedMechanism",
    "class_of",
    "console",
    "first_output",
    "index_estimates",
    "stated",
    "study_with_levels",
    "table_of",
]

OF_STUDIES = {
    "slider_crank": "closed loop",
    "agile_eye": "closed loop",
    "motorcycle": "closed loop",
    "suspension": "closed loop",
    "bouncing_ball_compliant": "contact",
    "clearance": "contact",
    "robot": "controller",
}
"""Studies of this repository whose mechanisms are compared, and their kinds."""

QUICK = ("damped oscillator", "two modes of stiffness", "pendulum", "bouncing ball", "double well", "six inputs")
"""Mechanisms of the short comparison: smooth, kinked, rotating, with impacts, with two equilibria, many inputs."""

CLASSES = {
    "smooth": ("smooth", "dependent inputs", "without motion", "censored"),
    "rotating": ("rotating", "closed loop"),
    "contact": ("contact",),
    "controlled or stiff": ("controller", "stiff"),
    "many inputs": ("many inputs",),
}
"""Classes of mechanisms, with the kinds that they contain."""
HELD_OUT = (
    "start phase over a turn",
    "two frequencies",
    "disc, weight and friction",
    "rotating slider-crank",
    "Kraichnan-Orszag",
    "four-bar",
    "dropped ball",
    "trampoline",
    "controller with limits",
    "damped chain",
    "relaxation oscillation",
    "forty inputs",
    "reach of an arm",
    "driver's seat",
    "dependent mass and stiffness",
    "censored passage",
    "bouncing ball compliant",
    "clearance",
    "robot",
)
"""Mechanisms that were not used when the rules of recommendation were chosen."""


def class_of(kind: str) -> str:
    """Return the class of a kind of mechanism."""
    return next(name for name, kinds in CLASSES.items() if kind in kinds)


def of_study(name: str, kind: str) -> TestedMechanism:
    """Return the mechanism of a study with its times and its start condition."""
    study: uqmbd.Study = importlib.import_module(name).study
    return TestedMechanism(kind, lambda: study.mechanism, float(study.times[-1]), len(study.times), start=study.start)


CASES: Mapping[str, TestedMechanism] = {
    **MECHANISMS,
    **{name.replace("_", " "): of_study(name, kind) for name, kind in OF_STUDIES.items()},
}
"""Mechanisms by name."""


def first_output(mechanism: uqmbd.Mechanism) -> str:
    """Return the output that the requirements limit."""
    return next(iter([*mechanism.outputs, *mechanism.scalars]))


def study_with_levels(reference: Reference, levels: Mapping[str, float]) -> uqmbd.Study:
    """Return the study at the few times of its reference, with an upper limit of the first output for each level.

    `levels` maps names of requirements to limits of the first output at the last time, in its units.
    """
    made = reference.tested.make()
    name = first_output(made)
    timed = name in made.outputs
    expression = uqmbd.final(made.outputs[name].expression) if timed else made.scalars[name].expression
    for title, level in levels.items():
        if title not in made.requirements:
            made.require(title, expression <= level)
    return reference.study(mechanism=made)
