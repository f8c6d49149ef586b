"""Three mechanisms that no polynomial follows: surrogates are never shown without a warning, and Monte Carlo is named."""

from __future__ import annotations

import re
import warnings

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import assess
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper, Torque

LARGE = 0.1
"""Stated error, over the standard deviation, above which statistics of a surrogate are not used."""

ADAPTIVE = Collocation(adaptive="dimension", max_realisations=250, label="adaptive")
METHODS = {
    "with samples": [MonteCarlo(samples=400, label="monte-carlo"), Collocation(order=3, label="collocation"), ADAPTIVE],
    "surrogates": [Collocation(order=3, label="collocation"), ADAPTIVE],
    "alone": [ADAPTIVE],
}


def uniform(name, low, high, units=""):
    """Return a uniform input."""
    return uqmbd.RandomVariable(name, chaospy.Uniform(low, high), units=units)


def kraichnan_orszag():
    """Make the three equations without damping from three random values, as a free rigid body (moments 1, 2, 3)."""
    y1, y2, y3 = (uniform(f"xi{k}", -1, 1) for k in (1, 2, 3))
    a, b, c = np.sqrt([1 / 6, 1 / 3, 1 / 2])
    made = uqmbd.Mechanism("kraichnan_orszag", uqmbd.Spatial(gravity=(0, 0, 0)))
    rates = (y1 + y2) / sympy.sqrt(2) / a, -y3 / b, (y1 - y2) / sympy.sqrt(2) / c
    body = made.body("sheet", mass=1.0, inertia=(1.0, 2.0, 3.0), angular_velocity=rates)
    first, second, third = body.rotation.T * body.angular_velocity
    made.output("y1", (a * first + c * third) / sympy.sqrt(2), units="1")
    made.output("y2", (a * first - c * third) / sympy.sqrt(2), units="1")
    made.output("y3", -b * second, units="1")
    return made, np.linspace(0, 10, 21)


def robot_arm():
    """Make an arm of two links with stops at its elbow and dry friction in its drive."""
    made = uqmbd.Mechanism("robot_arm", uqmbd.Planar(gravity=(0, 0)))
    upper = made.body("upper", mass=2, inertia=0.1, position=(0.3, 0), angle=0)
    lower = made.body("lower", mass=1, inertia=0.05, position=(0.8, 0), angle=0)
    made.add(Revolute("shoulder", made.ground, upper, point_i=(0, 0), point_j=(-0.3, 0)))
    made.add(Revolute("elbow", upper, lower, point_i=(0.3, 0), point_j=(-0.2, 0)))
    bend, gap = lower.angle - upper.angle, uniform("gap", 0.1, 0.5, "rad")
    dry = uniform("friction", 0.5, 1.5, "N m") * sympy.tanh(upper.angular_velocity / 0.05)
    stop = 400 * (sympy.Max(0, -bend - 0.3) - sympy.Max(0, bend - gap))
    made.add(Torque("motor", upper, torque=uniform("torque", 1, 4, "N m") - dry - stop))
    made.add(Torque("stop", lower, torque=stop))
    made.output("x", lower.point((0.2, 0))[0], units="m")
    made.output("bend", bend, units="rad")
    return made, np.linspace(0, 3, 31)


def bimodal_stiffness():
    """Make an oscillator with springs of two batches: a mixture of two normal distributions."""
    mixture = chaospy.GaussianMixture([[70.0], [130.0]], [[[4.0]], [[4.0]]])
    made = uqmbd.Mechanism("two_batches", uqmbd.Line())
    body = made.body("mass", mass=1, position=0.1)
    stiffness = uqmbd.RandomVariable("stiffness", mixture, units="N/m")
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness=stiffness, free_length=0, damping=0.2))
    made.output("position", body.position[0], units="m")
    return made, np.linspace(0, 8, 41)


@pytest.fixture(scope="module", params=[kraichnan_orszag, robot_arm, bimodal_stiffness], ids=lambda made: made.__name__)
def run(request):
    """Return a function that runs methods: their results, and what they warn of."""
    made, times = request.param()
    known = {}

    def computed(kind):
        if kind not in known:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                known[kind] = uqmbd.Study("poor", made, times, METHODS[kind], rtol=1e-8).run(), said
        return known[kind]

    return computed


def words_of(tree, folder):
    """Return the text of the first screen of the page."""
    path = folder / "report.html"
    write_report(tree, path)
    page = path.read_text(encoding="utf-8")
    first = page[page.index('id="asked-head"') : page.index('id="next-head"') + 4000]
    first = first[: first.index("</section>", first.index('id="next-head"'))]
    parts = []
    for part in re.split("<script", first):  # the data of scripts are no words
        parts.append(part.partition("</script>")[2] or part)
    return " ".join(re.sub("<[^>]*>", " ", " ".join(parts)).split())


@pytest.mark.thorough
@pytest.mark.parametrize("kind", METHODS)
def test_poor_surrogates_are_never_shown_without_a_warning(run, kind, tmp_path):
    tree, said = run(kind)
    told = assess(tree)
    messages = [str(one.message) for one in said if issubclass(one.category, uqmbd.SurrogateWarning)]
    poor = {}
    for method in (one for one in METHODS[kind] if not isinstance(one, MonteCarlo)):
        data = tree[method.label]["statistics"].to_dataset()
        error = data["verification_error"].max("time")
        poor[method.label] = [str(name) for name in data["output"].values if float(error.sel(output=name)) > LARGE]
        assert poor[method.label], method.label
        (message,) = (one for one in messages if one.startswith(f"{method.label}: "))
        assert all(repr(name) in message for name in poor[method.label]) and "or use a sampling method" in message
        assert method.label not in told.recommended
    first = words_of(tree, tmp_path)
    for one in told.reliability:
        if one.method in poor and one.quantity in poor[one.method]:
            assert one.level == 0, one
            assert re.search(rf"✗ no {one.quantity} : (by {one.method}, )?stated error", first), first
    if kind == "with samples":
        assert {one.method for one in told.reliability} == {"monte-carlo"}
        assert ", within its stated error" in told.recommendation[0]
    else:
        assert told.recommended == () and "use a sampling method" in told.recommendation[0]
        # nothing is shown below the heading but the advice
        assert "realisations," not in first[first.index("Recommended method") :]
        assert "unreliable; see Reliability of the results" in first


@pytest.mark.thorough
def test_adaptive_refinement_states_that_more_realisations_do_not_help(run):
    _, said = run("alone")
    (message,) = (str(one.message) for one in said if "was not met" in str(one.message))
    assert (
        "Monte Carlo needs no more realisations than this method for this tolerance; use Monte Carlo" in message
        and "would meet the tolerance" not in message
    )


@pytest.mark.thorough
def test_adaptive_refinement_states_how_many_realisations_would_help():
    """A smooth output of two inputs; the stated number meets the tolerance to a factor of a few."""
    made = uqmbd.Mechanism("spring", uqmbd.Line())
    body = made.body("mass", mass=uniform("m", 0.8, 1.2, "kg"), position=0.1)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness=uniform("k", 80, 120, "N/m"), free_length=0))
    made.output("x", body.position[0], units="m")
    study = uqmbd.Study("smooth", made, np.linspace(0, 2, 21))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        study.propagate(Collocation(adaptive="dimension", max_realisations=70, tolerance=1e-4))
    (message,) = (str(one.message) for one in said if "was not met" in str(one.message))
    needed = int(re.search("about ([0-9]+) would meet", message).group(1))
    node = study.propagate(Collocation(adaptive="dimension", tolerance=1e-4))
    assert node.attrs["tolerance_met"] == "True"
    assert needed / 4 < node.attrs["realisations"] < 4 * needed
