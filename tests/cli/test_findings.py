"""What is probably wrong with a study is the same list for `check`, `run`, `Study.run`, notebook and report."""

from __future__ import annotations

import html
import json
import random
import re
import warnings

import pytest

import uqmbd
from uqmbd.results import load

HEAD = """
import chaospy, uqmbd, warnings
from uqmbd_contact import PlaneContact
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

warnings.simplefilter("ignore", uqmbd.UnitsWarning)
def random(name, law, units=""):
    return uqmbd.RandomVariable(name, law, units=units)

m = uqmbd.Mechanism("machine", uqmbd.Planar(gravity=(0, -9.81)))
push = random("push", chaospy.Uniform(0.9, 1.1), "N")
rod = m.body("rod", mass=1, inertia=0.1, position=(0.5, 0))
m.add(Revolute("pivot", m.ground, rod, (0, 0), (-0.5, 0)))
m.add(PointForce("push", rod, (0.5, 0), (0, push)))
m.output("tip", rod.point((0.5, 0))[1], units="m")
"""

TAIL = """
study = uqmbd.Study("machine", m, [0, 0.01, 0.02], [MonteCarlo(samples=20, seed=1)])
"""

FAULTS = {
    "degrees": (
        "m.add(Revolute('wheel pivot', m.ground, m.body('wheel', mass=1, inertia=1, angle=90), (0, 0), (0, 0)))",
        "warning", "body 'wheel' has the angle 90 rad, 14.3 turns",
    ),
    "forgotten": (
        "PointForce('pull', rod, (0, 0), (1, 0))",
        "warning", "PointForce 'pull' of body 'rod' was created but not added",
    ),
    "idle": (
        "weight = random('weight', chaospy.Uniform(1, 2), 'kg')\n"
        "m.add(Fixed('weld', m.ground, m.body('block', mass=weight, inertia=1), (0, 0), (0, 0)))",
        "warning", "no output depends on the random input 'weight'",
    ),
    "negative mass": (
        "load = random('load', chaospy.Normal(1.0, 0.3), 'kg')\n"
        "bob = m.body('bob', mass=load, inertia=0.1, position=(0.3, 0))\n"
        "m.add(Revolute('bob pivot', m.ground, bob, (0, 0), (-0.3, 0)))\n"
        "m.output('bob height', bob.position[1], units='m')",
        "warning", "the mass of body 'bob' is outside of its range (0 or more) in 0.043 % of the realisations",
    ),
    "sign of a stiffness": (
        "k = random('k', chaospy.Normal(1000, 400), 'N/m')\n"
        "m.add(SpringDamper('spring', m.ground, rod, (0, 1), (0, 0), stiffness=k))",
        "warning", "the stiffness of SpringDamper 'spring' is negative in 0.62 % of the realisations",
    ),
    "square": (
        "long = random('long', chaospy.Normal(1.0, 0.8), 'm')\n"
        "bar = m.body('bar', mass=1, inertia=long**2 / 12, position=(0.5, 0))\n"
        "m.add(Revolute('bar pivot', m.ground, bar, (0, 0), (-0.5, 0)))\n"
        "m.output('bar height', bar.position[1], units='m')",
        "warning", "the long in the inertia of body 'bar' is negative in 11 % of the realisations",
    ),
    "inertia": (
        "arm = m.body('arm', mass=1, inertia=1e3, position=(0.5, 0))\n"
        "m.add(Revolute('arm pivot', m.ground, arm, (0, 0), (-0.5, 0)))",
        "note", "body 'arm' has a radius of gyration of 31.6 m, 63 times the extent of the points that are given for it, 0.5 m",
    ),
    "lengths": (
        "beam = m.body('beam', mass=1, inertia=1, position=(2e4, 0))\n"
        "m.add(Revolute('beam pivot', m.ground, beam, (0, 0), (-2e4, 0)))",
        "note", "lengths that differ by more than a factor of 10000",
    ),
    "moved far": (
        "cart = m.body('cart', mass=1, inertia=1, position=(7, 0), angle=1.0)\n"
        "m.add(Fixed('cart weld', m.ground, cart, (0, 0), (0, 0), rotation=0))",
        "warning", "assembly moved body 'cart' by 7 m and by 57.3 degrees from its given pose",
    ),
    "moved": (
        "cart = m.body('near', mass=1, inertia=1, position=(0.3, 0))\n"
        "m.add(Fixed('near weld', m.ground, cart, (0, 0), (0, 0), rotation=0))",
        "note", "assembly moved body 'near' by 0.3 m from its given pose",
    ),
    "heavy tail": (
        "speed = random('speed', chaospy.Cauchy(), 'm/s')\n"
        "ball = m.body('ball', mass=1, inertia=1, velocity=(speed, 0))\n"
        "m.add(SpringDamper('leash', m.ground, ball, (0, 0), (0, 0), stiffness=1))\n"
        "m.output('flight', ball.position[0], units='m')",
        "warning", "do not exist, unless the output is a bounded function of input 'speed'",
    ),
    "units": (
        "m.output('wrong', rod.position[0], units='kg')",
        "warning", "output 'wrong': rod.x is in m, but its declared units are kg",
    ),
    "redundant": (
        "m.add(Revolute('again', m.ground, rod, (0, 0), (-0.5, 0)))",
        "warning", "2 of 5 constraint equations are redundant and omitted",
    ),
    "apart": (
        "m.body('lost', mass=1, inertia=1)",
        "note", "body 'lost' is not connected: no component connects it to another body or to the ground",
    ),
    "deep": (
        "m.add(PlaneContact('floor', m.ground, rod, (0, 2), (0, 0), (0, 1), stiffness=10))",
        "warning", "PlaneContact 'floor' starts 2 m deep",
    ),
}  # fmt: skip
"""Fault -> lines of the study, and severity and words of its finding."""


def places_of(names, command_line, tmp_path):
    """Return the findings of a study with some faults, after a look at the five places."""
    script = tmp_path / "machine.py"
    script.write_text(HEAD + "\n".join(FAULTS[name][0] for name in names) + TAIL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        study = uqmbd.load_study(script)
        found = uqmbd.findings(study)
    lines = [str(one) for one in found]
    status, out, err = command_line("check", "machine.py")
    assert status == 0, err
    listed = out.partition("\nFindings: ")[2].splitlines()
    assert listed[0] == (str(len(found)) if found else "none") and listed[1:] == lines
    status, out, err = command_line("run", "machine.py", "--out", "out")
    assert status == 0, err
    shown = [re.sub("^(Warning: )study 'machine': ", r"\1", line) for line in err.splitlines()]
    assert [line for line in shown if line in lines] == lines
    assert not [x for x in shown if x.startswith(("Note: ", "Warning: ")) and x not in lines and "realisation" not in x]
    tree = load(tmp_path / "out" / "results.nc")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        again = study.run()
    stored = [json.loads(x.attrs.get("findings", "[]")) for x in (tree, again)]
    about = [{x: getattr(one, x) for x in ("place", "message", "remedy")} for one in found]
    wanted = [{"severity": one.severity.value, **rest} for one, rest in zip(found, about, strict=True)]
    assert stored == [wanted, wanted]
    said = [re.sub("^study 'machine': ", "", str(one.message)) for one in caught]
    assert [x for x in said if f"Warning: {x}" in lines] == [f"{one.text}." for one in found if one.warned]
    pages = [html.unescape(x) for x in (study._repr_html_(), uqmbd.report.show(again).html)]
    for page in pages:
        assert [x for x in re.findall("<p>((?:Note|Warning): .*?)</p>", page) if x in lines] == lines
        assert len(re.findall("<p>(?:Note|Warning): ", page)) == len(lines)
    # numbers of a page do not break from their units
    page = html.unescape((tmp_path / "out" / "report.html").read_text()).replace("\N{NO-BREAK SPACE}", " ")
    assert [(line, page.count(line)) for line in lines if page.count(line) != 1] == []
    return found


@pytest.mark.thorough
def test_a_study_without_faults_has_no_findings(command_line, tmp_path):
    assert places_of((), command_line, tmp_path) == []


@pytest.mark.thorough
@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_and_listed_everywhere(fault, command_line, tmp_path):
    (found,) = places_of((fault,), command_line, tmp_path)
    _, severity, words = FAULTS[fault]
    assert found.severity.value == severity and words in found.text


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_random_faults_are_listed_everywhere(seed, command_line, tmp_path):
    """Lengths that differ hide faults that are small next to them."""
    names = random.Random(seed).sample([name for name in FAULTS if name != "lengths"], 2 + seed % 5)
    found = places_of(names, command_line, tmp_path)
    for name in names:
        _, severity, words = FAULTS[name]
        if name not in ("moved", "moved far", "redundant"):  # of which the numbers depend on the others
            assert any(one.severity.value == severity and words in one.text for one in found), name
