"""A node that fails is never silently dropped: the others are fitted, and that is said, or the reason stops the run."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.results import validate
from uqmbd_collocation import Collocation
from uqmbd_collocation.plans import STREAM
from uqmbd_joints import Distance, Revolute

UNIFORM = chaospy.Uniform(-1, 1)


def slider(length, times):
    """Slider over a crank of 0.15 m at the angle 2 t."""
    return 0.15 * np.cos(2 * times) + np.sqrt(length**2 - (0.15 * np.sin(2 * times)) ** 2)


@pytest.mark.thorough
@pytest.mark.parametrize("options", [{}, {"method": "regression", "samples": 20}], ids=str)
def test_a_mechanism_that_locks_for_some_lengths(locking, warned, chaos_of, options):
    """Rods from 0.146 m on: those below 0.15 m lock at a quarter turn; the fit holds for the others."""
    study = locking(0.146, 0.25)
    node, messages = warned(lambda: study.propagate(Collocation(**{"order": 8, "verify": 16} | options)))
    validate(node)
    nodes = node["nodes"]
    short = nodes["inputs"].values[:, 0] < 0.15
    fit = nodes["purpose"].values == "fit"
    np.testing.assert_array_equal(nodes["status"].values != 0, short)
    assert (short & fit).any()
    assert all(message for message in nodes["message"].values[short])
    assert node.attrs["failures"] == short.sum()
    assert "regression on" in node.attrs["fit"]
    (message,) = [m for m in messages if "verification" not in m]
    assert f"{(short & fit).sum()} of {fit.sum()}" in message
    assert nodes["message"].values[short & fit][0] in message
    assert "extrapol" in message
    if (short & ~fit).any():
        assert any("of 16 verification realisations failed" in m for m in messages)
    assert node["chaos"].sizes["verification"] == node.attrs["verification"] == 16 - (short & ~fit).sum()
    lengths = np.linspace(0.17, 0.24, 8)
    error = chaos_of(node).evaluate(lengths[:, None])[:, 0] - slider(lengths[:, None], study.times)
    assert np.abs(error).max() < 0.05 * np.ptp(slider(lengths[:, None], study.times), axis=0).max()


def test_a_mechanism_that_cannot_be_assembled_for_some_lengths(warned):
    """A lever of 1 m and a strut from a point 3 m away: nothing shorter than 2 m reaches."""
    length = uqmbd.RandomVariable("strut_length", chaospy.Normal(2.1, 0.05), units="m")
    mechanism = uqmbd.Mechanism("triangle", uqmbd.Planar())
    lever = mechanism.body("lever", mass=1, inertia=1, angle=0.4)
    mechanism.add(Revolute("pivot", mechanism.ground, lever, (0, 0), (0, 0)))
    mechanism.add(Distance("strut", mechanism.ground, lever, (3, 0), (1, 0), length=length))
    mechanism.output("angle", lever.angle, units="rad")
    study = uqmbd.Study("triangle", mechanism, [0, 0.1, 0.2])
    node, messages = warned(lambda: study.propagate(Collocation(order=4)))
    assert any("1 of 5 nodes failed" in m and "strut" in m for m in messages)
    assert node["nodes"]["status"].values[0] == 1
    # at the mean the angle is that of the triangle
    assert float(node["statistics"]["mean"][0, 0]) == pytest.approx(np.arccos((10 - 2.1**2) / 6), rel=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("options", [{}, {"elements": 2}], ids=str)
def test_what_fails_in_the_tails_counts_by_its_weight(warned, options):
    """Struts below 2 m do not reach: 4e-4 of the probability, where some of the verification points lie on purpose."""
    length = uqmbd.RandomVariable("strut_length", chaospy.Normal(2.1, 0.03), units="m")
    mechanism = uqmbd.Mechanism("triangle", uqmbd.Planar())
    lever = mechanism.body("lever", mass=1, inertia=1, angle=0.4)
    mechanism.add(Revolute("pivot", mechanism.ground, lever, (0, 0), (0, 0)))
    mechanism.add(Distance("strut", mechanism.ground, lever, (3, 0), (1, 0), length=length))
    mechanism.require("folded", lever.angle < 0.9)
    study = uqmbd.Study("triangle", mechanism, [0, 0.1])
    node, messages = warned(lambda: study.propagate(Collocation(order=3, verify=64, **options)))
    requirement = node["requirements"].to_dataset()
    assert requirement.attrs["margin_failures"] > 1
    assert 0 < requirement.attrs["failed"] < 3e-3
    # the angle of 0.9 rad takes a strut 4.1 standard deviations longer than the mean one
    assert 0 == requirement["violation_probability"].item() <= requirement["interval"].values.max() < 4e-3
    if not options:
        assert any("of 64 verification" in m and "of the probability" in m for m in messages)


EVERY_WAY = [{}, {"method": "regression"}, {"method": "omp"}, {"adaptive": "order"}, {"adaptive": "dimension"}]


@pytest.mark.parametrize("options", EVERY_WAY, ids=str)
def test_too_many_fail(resting, options):
    """Five sixths of the inputs give no number."""
    study = resting(lambda a, b: sympy.log(a - sympy.Rational(1, 2)) + b, chaospy.Uniform(-2, 1), UNIFORM)
    with pytest.raises(
        uqmbd.IntegrationError, match="failed.*Reason of the failure: an output is not finite"
    ) as caught:
        study.propagate(Collocation(**options))
    assert str(caught.value).startswith("collocation: ")


@pytest.mark.thorough
def test_all_realisations_fail(locking):
    with pytest.raises(uqmbd.IntegrationError, match="2 of 2 nodes failed") as caught:
        locking(0.10, 0.14).propagate(Collocation(order=1, verify=1))
    assert "Reason of the failure: " in str(caught.value)
    assert "unknown" not in str(caught.value)


def test_terms_that_the_others_do_not_determine_are_left_out(resting, warned, chaos_of):
    """Of four nodes of x0 the lowest fails with all of x1: three are left, and a parabola through them."""
    late = {"late": lambda a, b: sympy.log(a + sympy.Rational(8, 10))}
    study = resting(lambda a, b: a**2 + b, UNIFORM, UNIFORM, **late)
    node, messages = warned(lambda: study.propagate(Collocation(order=3, verify=0)))
    assert node.attrs["failures"] == 4
    assert "6 of the 10 terms" in messages[0]
    assert node.attrs["fit"] == "regression on the 12 of 16 nodes that did not fail, 6 of 10 terms"
    assert "leave_one_out" not in node["statistics"]  # it would be zero: each node has neighbours in its column
    expected = {(0, 0): 1 / 3, (2, 0): 2 / 3 / 5**0.5, (0, 1): 1 / 3**0.5}
    chaos = chaos_of(node)
    found = [expected.get(tuple(row), 0.0) for row in chaos.multi_index.tolist()]
    np.testing.assert_allclose(chaos.coefficients[:, 0, 0], found, atol=1e-12)


@pytest.mark.parametrize("adaptive", ["order", "dimension"])
def test_a_refinement_ends_where_realisations_fail(resting, warned, adaptive):
    """Below -0.9 the second output is no number: higher orders and levels meet it, the first ones do not."""
    study = resting(
        lambda a, b: sympy.exp(a) + b, UNIFORM, UNIFORM, y2=lambda a, b: sympy.log(a + sympy.Rational(9, 10))
    )
    node, messages = warned(
        lambda: study.propagate(Collocation(adaptive=adaptive, order=1, tolerance=1e-6, verify=4, seed=2))
    )
    validate(node)
    assert node.attrs["tolerance_met"] == "False"
    assert node.attrs["failures"] > 0
    assert "regression on" in node.attrs["fit"]
    assert sum("nodes failed" in m for m in messages) == 1
    assert sum("was not met" in m and "because realisations failed" in m for m in messages) == 1
    nodes = node["nodes"]
    failed = nodes["status"].values != 0
    np.testing.assert_array_equal(failed, nodes["inputs"].values[:, 0] < -0.9)
    # no verification realisation became a node
    assert (nodes["purpose"].values == "verification").sum() == 4
    fit = float(node["statistics"]["mean"].sel(output="y")[0])
    assert fit == pytest.approx(np.sinh(1), rel=0.01)


@pytest.mark.parametrize("adaptive", ["order", "dimension"])
def test_failed_verification_does_not_end_a_refinement(resting, warned, adaptive):
    """Beyond 0.98 in x1 a realisation fails: no node is there, but a verification point is; seven have no extremes."""
    edge = sympy.Rational(98, 100)
    study = resting(lambda a, b: sympy.exp(a) + b, UNIFORM, UNIFORM, y2=lambda a, b: sympy.sqrt(edge - b))
    space = uqmbd.extend.GermSpace.of(study.mechanism.inputs)
    seed = next(
        k
        for k in range(99)
        if (uqmbd.extend.VerificationPoints.drawn(space, 7, k, STREAM).germs[:, 1] > 0.98).sum() == 1
    )
    options = Collocation(adaptive=adaptive, order=1, verify=7, seed=seed, tolerance=0.02)
    node, messages = warned(lambda: study.propagate(options))
    assert messages[0].startswith("UserWarning: collocation: 1 of 7 verification realisations failed; the stated error")
    assert "not finite" in messages[0]
    assert len(messages) == 1
    assert node.attrs["tolerance_met"] == "True"
    assert node.attrs["verification"] == 6
