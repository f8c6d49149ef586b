"""Requirements: what they may say, and what is refused."""

from __future__ import annotations

import chaospy
import pytest
import sympy

import uqmbd
from uqmbd_springs import SpringDamper


def oscillator():
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(6, 10), units="N/m")
    mass = mechanism.body("mass", mass=2, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    return mechanism, mass, stiffness


def test_margins_are_positive_where_relations_hold():
    mechanism, mass, k = oscillator()
    x, k = mass.position[0], 1.0 * k
    relations = {"le": x <= k, "ge": x >= k, "lt": x < k, "gt": x > k, "turned": k >= x}
    for name, relation in relations.items():
        mechanism.require(name, relation)
    found = {name: margin.expression for name, margin in mechanism.margins.items()}
    assert found == {"le": k - x, "ge": x - k, "lt": k - x, "gt": x - k, "turned": k - x}
    assert all(requirement.over_time for requirement in mechanism.requirements.values())


def test_what_does_not_change_with_time_is_one_statement():
    mechanism, mass, k = oscillator()
    mechanism.require("random", k <= 9)
    mechanism.require("modal", uqmbd.eigenfrequency(1) * k >= 2, description="a product")
    assert not any(requirement.over_time for requirement in mechanism.requirements.values())
    assert mechanism.requirements["modal"].words == "a product"
    assert mechanism.requirements["random"].words == "stiffness <= 9"


def test_impossible_relations_are_refused():
    mechanism, mass, k = oscillator()
    x = mass.position[0]
    other = uqmbd.Mechanism("other", uqmbd.Translational()).body("elsewhere", mass=1)
    refused = {
        "the relation is always satisfied": sympy.Abs(x) >= 0,
        "the relation is never satisfied": sympy.Abs(x) < 0,
        "the relation is 3": 3,
        "a random quantity equals a value with probability zero": sympy.Eq(x, k),
        "several relations": (x <= 1) & (x >= -1),
        "the relation is the text 'x < 3'": "x < 3",
        "body 'elsewhere' is not in mechanism": other.position[0] <= 1,
        "which changes during the motion": x <= uqmbd.eigenfrequency(1),
    }
    for words, relation in refused.items():
        with pytest.raises(uqmbd.StudyError, match=words):
            mechanism.require("limit", relation)
    assert not mechanism.requirements


def test_names_are_unique_and_any_is_taken():
    mechanism, mass, _ = oscillator()
    mechanism.require("limit", mass.position[0] <= 1)
    with pytest.raises(uqmbd.StudyError, match="a requirement with this name exists already"):
        mechanism.require("limit", mass.position[0] <= 2)
    with pytest.raises(
        uqmbd.StudyError, match="this name is reserved for the violation of any requirement; choose another name"
    ):
        mechanism.require("any", mass.position[0] <= 2)
    with pytest.raises(uqmbd.StudyError, match="the description is 3; expected a text"):
        mechanism.require("words", mass.position[0] <= 2, description=3)


def test_inputs_of_requirements_alone_are_inputs():
    mechanism, mass, _ = oscillator()
    limit = uqmbd.RandomVariable("limit", chaospy.Normal(2, 0.1), units="m")
    revision = mechanism.revision()
    mechanism.require("clearance", mass.position[0] <= limit)
    assert mechanism.inputs.names == ("limit", "stiffness") and mechanism.revision() != revision
