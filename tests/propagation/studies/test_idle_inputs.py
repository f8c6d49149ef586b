"""An input that no output depends on is told once per study, whatever the methods are; no other is."""

from __future__ import annotations

import json
import warnings

import chaospy
import pytest
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

MASS = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
METHODS = [
    MonteCarlo(samples=20, seed=1),
    Collocation(order=1),
    Galerkin(order=1),
    Collocation(order=2, method="omp", label="sparse"),
    Collocation(order=1, elements=2, label="elements"),
]


def falling(*outputs, **options):
    """A stone that falls, whose mass changes nothing."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=MASS, velocity=speed)
    mechanism.output("height", stone.position[0], units="m")
    return mechanism, stone


def told(study, **options):
    """What is said of inputs that change nothing."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        tree = study.run(**options)
    return tree, [str(w.message) for w in seen if issubclass(w.category, uqmbd.UnusedInputWarning)]


def idle_of(study):
    """Names of the inputs that are found to change nothing."""
    found = [x for x in uqmbd.findings(study) if x.category is uqmbd.UnusedInputWarning]
    return {x.place.split("'")[1] for x in found}


@pytest.mark.thorough
@pytest.mark.parametrize("methods", [[m] for m in METHODS] + [METHODS], ids=lambda m: "+".join(x.node_name for x in m))
def test_every_method_tells_once(methods):
    tree, said = told(uqmbd.Study("fall", falling()[0], [0, 1], methods))
    (sentence,) = said
    assert sentence.startswith("study 'fall': no output depends on the random input 'mass'; ")
    assert any("'mass'" in one for one in json.loads(tree.attrs["warnings"]))


def test_what_is_observed_by_any_means_is_not_idle():
    """Of outputs over time, those without one, and requirements each sees what the others do not."""
    for observe in (
        lambda m, s: m.output("momentum", MASS * s.velocity[0], units="kg m/s"),
        lambda m, s: m.output("hardest", uqmbd.maximum(MASS * s.velocity[0]), units="kg m/s"),
        lambda m, s: m.require("soft", MASS * s.velocity[0] <= 10),
    ):
        mechanism, stone = falling()
        assert told(uqmbd.Study("fall", mechanism, [0, 1], METHODS[:1]))[1] != []
        observe(mechanism, stone)
        assert told(uqmbd.Study("fall", mechanism, [0, 1], METHODS[:1]))[1] == []


def test_requirements_alone_tell_too():
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=MASS, velocity=speed)
    mechanism.require("low", stone.position[0] <= 1)
    assert len(told(uqmbd.Study("fall", mechanism, [0, 1], METHODS[:1]))[1]) == 1


def test_what_matters_in_some_realisations_only_is_not_idle():
    """Half of the stones reach the floor within the time: the others do not tell how they rebound."""
    mechanism, stone = falling()
    rebound = uqmbd.RandomVariable("rebound", chaospy.Uniform(0.2, 0.4))
    depth = uqmbd.RandomVariable("depth", chaospy.Uniform(2, 12), units="m")
    mechanism.add(PlaneImpact("floor", mechanism.ground, stone, (-depth,), (0,), (1,), restitution=rebound))
    (sentence,) = told(uqmbd.Study("fall", mechanism, [0, 1.4], [MonteCarlo(samples=20, seed=1)]))[1]
    assert "'mass'" in sentence


@pytest.mark.parametrize("idle", [0, 3, 6])
def test_exactly_the_inputs_without_influence_are_named(idle):
    """Products of centred inputs have no main effects, and are no idle inputs."""
    variables = [uqmbd.RandomVariable(f"x{k}", chaospy.Uniform(-1, 1)) for k in (3, 0, 5, 1, 6, 2, 4)]
    mechanism = uqmbd.Mechanism("still", uqmbd.Line())
    mechanism.body("block", mass=20 + sum(variables[:idle]))
    mechanism.output("product", sympy.Mul(*variables[idle:]), units="1")
    study = uqmbd.Study("look", mechanism, [0, 1], [MonteCarlo(samples=20, seed=1)])
    assert idle_of(study) == {x.name for x in variables[:idle]}


def test_many_inputs_of_few_realisations_are_not_looked_at():
    mechanism = uqmbd.Mechanism("row", uqmbd.Line())
    for k in range(9):
        mechanism.body(f"b{k}", mass=uqmbd.RandomVariable(f"m{k}", chaospy.Uniform(1, 2), units="kg"))
    mechanism.output("x", mechanism.bodies["b0"].position[0], units="m")
    few, many = (MonteCarlo(samples=n, seed=1) for n in (100, 200))
    study = uqmbd.Study("look", mechanism, [0, 1], [few])
    assert not idle_of(study) and len(idle_of(study.with_propagators([many]))) == 9
