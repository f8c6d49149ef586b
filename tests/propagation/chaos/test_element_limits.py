"""The stated number of verification realisations of elements is at least that of any splits."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Literal

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import (
    ElementLimits,
    GermBox,
    GermSpace,
    VerificationPoints,
    gauss_tensor,
    labels,
    project,
    refine_elements,
)
from uqmbd.randomness import JointInput
from uqmbd.results import PiecewiseChaos, PolynomialChaos
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin

TERMS = np.array([[0], [1]])


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(6))
def test_no_sequence_of_splits_takes_more(seed: int) -> None:
    """Of continuous and discrete inputs, in any order: halves of three values have the probabilities 1/3 and 2/3."""
    draw = np.random.default_rng(seed)
    laws = [chaospy.Uniform(-1, 1), chaospy.DiscreteUniform(0, 2 + seed), chaospy.Normal(0, 1)]
    chosen = [laws[k] for k in draw.choice(3, size=2, replace=False)]
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x{k}", law) for k, law in enumerate(chosen)]))
    for count in (0, 1, 2, 3, 5, 16, 40):
        for most in range(1, 7):
            boxes = [GermBox.whole(space)]
            used = sum(len(one.germs) for one in VerificationPoints.of_elements(boxes, 0, count, 0, 1))
            while len(boxes) < most:
                able = [(k, germ) for k, box in enumerate(boxes) for germ in range(2) if box.divisible(germ)]
                k, germ = able[draw.integers(len(able))]
                halves = boxes.pop(k).split(germ)
                used += sum(len(one.germs) for one in VerificationPoints.of_elements(halves, 1, count, 0, 1))
                boxes += halves
            assert used <= ElementLimits(most).verified(count, space), (count, most)


@pytest.mark.parametrize("verify", [0, 1, 2, 3, 16])
def test_without_elements_the_number_is_that_which_is_asked(verify: int) -> None:
    """A study states the realisations that it computes."""
    assert ElementLimits(None).verified(verify) == verify
    mechanism = uqmbd.Mechanism("fall", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    mechanism.output("x", mechanism.body("mass", mass=1, velocity=speed).position[0], units="m")
    for method in (Collocation(order=1, verify=verify), Galerkin(order=1, verify=verify)):
        study = uqmbd.Study("fall", mechanism, [0.0, 1.0], [method])
        planned = method.estimate(study)
        assert planned is not None
        node = study.propagate(method)
        assert planned.realisations == node.attrs["realisations"]


class Wrong:
    """Elements of the size of an input, which further realisations show to be wrong by 1."""

    def __init__(self, by: float) -> None:
        """Say how wrong further realisations are."""
        self.by = by
        self.asked: list[tuple[int, ...]] = []

    def chaos(self, box: GermBox, wrong: float) -> PolynomialChaos:
        """Return the chaos of a box, verified at its middle."""
        axes = labels(["x"], ["a"], [0.0])
        germs = np.array([[(box.lower[0] + box.upper[0]) / 2]])
        local = box.local.to_germs(box.space.to_inputs(germs))
        rule = gauss_tensor(box.local, 2)
        basis = box.local.evaluate(rule.nodes, TERMS)
        coefficients = project(box.local.to_inputs(rule.nodes)[:, :, None], basis, rule.weights)
        exact = box.local.to_inputs(local)[:, :, None]
        known = {"verification_germs": local, "verification_response": exact + wrong}
        return PolynomialChaos(coefficients, TERMS, box.local, axes, **known)

    def further(self, chaos: PiecewiseChaos, numbers: Sequence[int]) -> list[PolynomialChaos]:
        """Return the elements, the last one wrong."""
        self.asked.append(tuple(numbers))
        return [*chaos.elements[:-1], self.chaos(chaos.boxes[-1], self.by)]


@pytest.mark.parametrize("by", [0.0, 1e-4, 0.1, 1.0])
@pytest.mark.parametrize("elements", ["adaptive", 3])
def test_the_error_is_estimated_again_after_further_verification(by: float, elements: Literal["adaptive", 3]) -> None:
    """The threshold is met, and the history ends, as the further realisations show."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    wrong, limits = Wrong(by), ElementLimits(elements, threshold=0.05)
    unmet = by > 0.05
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        found = refine_elements(
            space, lambda boxes: [wrong.chaos(box, 0.0) for box in boxes], limits, label="m", further=wrong.further
        )
    assert found.met != unmet and wrong.asked == [found.kept]
    share = found.chaos.boxes[-1].probability
    assert float(found.steps["error"][-1]) == pytest.approx(by * np.sqrt(3 * share), rel=1e-6, abs=1e-9)
    said = [str(one.message) for one in seen]
    assert any("additional verification realisations show a larger error. Raise verify." in one for one in said) == (
        unmet and elements == "adaptive"
    )


def test_further_verification_fits_into_the_allowed_realisations() -> None:
    """They are scaled to the room, not dropped; the message states how many are missing."""
    mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
    a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
    mechanism.output("y", sympy.Abs(mechanism.body("rest", mass=1, position=a).position[0] - 0.3))
    study = uqmbd.Study("kink", mechanism, [0.0, 1.0])
    numbers = {}
    for most in (5000, 38, 37, 36, 35):
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            node = study.propagate(Collocation(order=1, elements=4, verify=3, max_realisations=most))
        numbers[most] = node.attrs["realisations"]
        said = [str(one.message) for one in seen if "additional verification realisations, because" in str(one.message)]
        assert numbers[most] <= most and node.attrs["elements"] == 4, numbers
        assert len(said) == (numbers[most] < numbers[5000])
    assert len(set(numbers.values())) > 2, numbers
