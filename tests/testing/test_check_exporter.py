"""Mutants of a sound exporter, each with one realistic mistake: `check_exporter` finds every one."""

from __future__ import annotations

from dataclasses import dataclass, make_dataclass
from pathlib import Path

import pytest

import uqmbd
from uqmbd.testing import check_exporter
from uqmbd_fmi.compiling import find_compiler
from uqmbd_fmi.exporter import FmuExporter


@dataclass(frozen=True)
class Sound:
    """Export means, or names of bodies."""

    name = "sound"
    suffix = ".txt"
    exports = ("surrogate", "mechanism")

    digits: int = 3

    def refusal(self, what, study):
        return "" if what == "mechanism" or study.mechanism.inputs.variables else "there is no random input."

    def export(self, source, path, study):
        if isinstance(source, uqmbd.Mechanism):
            path.write_text(" ".join(source.bodies))
        else:
            path.write_text(str(uqmbd.results.surrogate(source).mean.round(self.digits).tolist()))
        return f"written  {path}"


def changed(**methods):
    """Return a variant of the sound exporter."""
    made = make_dataclass("Changed", [], bases=(Sound,), namespace={"__doc__": "A variant.", **methods}, frozen=True)
    return made


def spaced(self, source, path, study):
    """Fail for names of outputs that are not plain words."""
    names = " ".join(study.mechanism.outputs)
    if not names.isidentifier():
        raise ValueError(names)
    return Sound.export(self, source, path, study)


def strewing(self, source, path, study):
    """Write a second file with a name of its own."""
    Path(path.parent, "log.txt").write_text("done")
    return Sound.export(self, source, path, study)


def keeping(self, source, path, study):
    """Leave an older file as it is."""
    return "kept" if path.exists() else Sound.export(self, source, path, study)


def adding(self, source, path, study):
    """Add an output to the mechanism."""
    if isinstance(source, uqmbd.Mechanism):
        body = next(iter(source.bodies.values()))
        source.output(f"added {len(source.outputs)}", body.position[0], units="m")
    return Sound.export(self, source, path, study)


def weighing(self, source, path, study):
    """Change the mass of a body."""
    if isinstance(source, uqmbd.Mechanism):
        values = next(iter(source.bodies.values())).terms.values
        values["mass"] = 2 * values["mass"]
    return Sound.export(self, source, path, study)


def inventing(self, source, path, study):
    """Write something even without a surrogate."""
    path.write_text("nothing")
    return "done"


def failing(self, what, study):
    raise KeyError(what)


MUTANTS = {
    "refusal raises": (changed(refusal=failing), "refusal.. raised"),
    "refusal returns nothing": (changed(refusal=lambda self, what, study: None), "expected a text"),
    "refuses everything": (changed(refusal=lambda self, what, study: "no."), "refuses the surrogate of every study"),
    "names of outputs": (changed(export=spaced), "unusual name.*raised"),
    "further files": (changed(export=strewing), "wrote log.txt"),
    "older files": (changed(export=keeping), "did not replace"),
    "no text": (changed(export=lambda self, *rest: Sound.export(self, *rest) and None), "returned None"),
    "no file": (changed(export=lambda self, source, path, study: "done"), "wrote no file"),
    "changes the mechanism": (changed(export=adding), "modified its source"),
    "changes a mass": (changed(export=weighing), "modified its source"),
    "no surrogate": (changed(export=inventing), "without a surrogate"),
    "no ending": (changed(suffix="txt"), "suffix"),
    "no class of options": (
        type("Bare", (), {"name": "bare", "suffix": ".b", "exports": ("mechanism",)}),
        "is a class",
    ),
}


@pytest.mark.parametrize("mutant", MUTANTS)
def test_each_mistake_is_found(mutant):
    exporter, text = MUTANTS[mutant]
    with pytest.raises(AssertionError, match=text):
        check_exporter(exporter)


def test_a_sound_exporter_passes(uqmbd_exporter):
    uqmbd_exporter(Sound)


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")
def test_the_exporter_of_fmus_passes():
    check_exporter(FmuExporter)
