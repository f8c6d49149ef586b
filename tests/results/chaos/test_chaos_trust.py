"""What a chaos says of its own error: stated error and horizon, decay, and verdicts in words."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

from uqmbd import RandomVariable, extend
from uqmbd.errors import StudyError
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos import error_words
from uqmbd.results.chaos.sampling import random_germs, spread_germs

TIMES = np.linspace(0.0, 2.0, 21)


def oscillator(order: int, verify: int = 0, seed: int = 0, kind: str = "total", nodes: int = 16) -> PolynomialChaos:
    """Return the chaos of cos(w t) and of a constant, for w ~ Normal(3, 1) and a phase that hardly matters."""
    inputs = [RandomVariable("phase", chaospy.Uniform(-0.01, 0.01)), RandomVariable("rate", chaospy.Normal(3.0, 1.0))]
    space = GermSpace.of(JointInput.of(inputs))
    index = index_set(2, order, kind)

    def model(values: np.ndarray) -> np.ndarray:
        moving = np.cos(values[:, 1:] * TIMES + values[:, :1])
        return np.stack([moving, np.full_like(moving, 0.3)], axis=1)

    rules = [germ.gauss(nodes) for germ in space.germs]
    grid = np.stack([g.ravel() for g in np.meshgrid(*(r[0] for r in rules), indexing="ij")], axis=1)
    weights = np.multiply.outer(rules[0][1], rules[1][1]).ravel()
    coefficients = extend.project(model(space.to_inputs(grid)), space.evaluate(grid, index), weights)
    axes = extend.labels([("slider_x", "m"), ("$F_{pin}$", "N")], space.inputs, TIMES)
    germs = None
    if verify:
        draw = random_germs if verify < 100 else spread_germs
        germs = draw(space, verify, seed)
    response = None if germs is None else model(space.to_inputs(germs))
    return PolynomialChaos(coefficients, index, space, axes, verification_germs=germs, verification_response=response)


@pytest.mark.thorough
def test_stated_error_is_the_true_one() -> None:
    """Of cos(w t) the truncation error is known: eight realisations state it within a factor, many of them exactly.

    E[cos(w t) He_n] = t^n exp(-t^2 / 2) / sqrt(n!) times cos(3 t + n pi / 2), so the neglected variance is a sum.
    """
    chaos = oscillator(4, verify=2**16)
    n = np.arange(1, 40)[:, None]
    factorial = np.cumprod(np.arange(1.0, 40.0))[:, None]
    energy = TIMES ** (2 * n) / factorial * np.exp(-(TIMES**2)) * np.cos(3 * TIMES + n * np.pi / 2) ** 2
    true = np.sqrt(energy[4:].sum(axis=0) / energy[:4].sum(axis=0).clip(1e-300))
    late = TIMES > 0.5
    np.testing.assert_allclose(chaos.verification_error("slider_x")[late], true[late], rtol=0.1)
    ratios = [oscillator(4, verify=8, seed=s).verification_error("slider_x", 2.0).item() / true[-1] for s in range(20)]
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 2.0
    assert np.median(ratios) > 0.3


def test_stated_error_where_nothing_varies() -> None:
    """A constant output has the error 0; at the common start the maximum over time is the scale; order 0 misses all."""
    chaos = oscillator(4, verify=8)
    assert chaos.verification_error("$F_{pin}$").tolist() == [0.0] * 21
    start = chaos.verification_error("slider_x", 0.0)
    germs, response = chaos.verification_germs, chaos.verification_response
    assert germs is not None and response is not None
    difference = np.sqrt(np.mean((chaos.evaluate_germs(germs) - response)[:, 0, 0] ** 2))
    assert start == pytest.approx(difference / (0.01 * chaos.std[0].max()))
    mean_only = PolynomialChaos(
        chaos.coefficients[:1], chaos.multi_index[:1], chaos.space, chaos.labels,
        verification_germs=germs, verification_response=response,
    )  # fmt: skip
    assert mean_only.verification_error("slider_x", 2.0) == pytest.approx(1.0)
    assert mean_only.verification_error("$F_{pin}$").tolist() == [0.0] * 21
    assert mean_only.verdicts()[1].startswith("$F_{pin}$: stated error of the surrogate at most 0 %")


def test_horizon_and_its_words() -> None:
    """The horizon is the first time at which the error passes the limit, and the verdict says it."""
    chaos = oscillator(4, verify=8)
    error = chaos.verification_error("slider_x")
    assert chaos.verification_error().shape == (2, 21)
    assert chaos.verification_error(time=1.0).shape == (2,)
    first = int(np.argmax(error > 0.01))
    assert 0 < first < 20
    assert chaos.horizon() == {"slider_x": TIMES[first], "$F_{pin}$": None}
    assert chaos.horizon(limit=1e9)["slider_x"] is None
    words = chaos.verdicts()[0]
    assert words == (
        f"slider_x: stated error of the surrogate below 1 % of the standard deviation until {TIMES[first]:g} s, "
        f"{100 * error[-1]:.2g} % at 2 s; raise the order"
    )
    fine = oscillator(14, verify=8, nodes=24)
    assert fine.horizon(0.05) == {"slider_x": None, "$F_{pin}$": None}
    assert "at most" in fine.verdicts(0.05)[0] and "raise" not in fine.verdicts(0.05)[0]
    assert "above 0.01 % of the standard deviation" in oscillator(1, verify=8).verdicts(1e-4)[0]
    with pytest.raises(StudyError, match="no verification realisations.*verify=16"):
        oscillator(2).horizon()


def test_decay_against_the_closed_form() -> None:
    """Energy per order is the closed form's; it sums to variance and square of the mean; the rate falls with time."""
    chaos = oscillator(6)
    decay = chaos.decay()
    n = np.arange(7)[:, None]
    factorial = np.array([1, 1, 2, 6, 24, 120, 720])[:, None]
    energy = TIMES ** (2 * n) / factorial * np.exp(-(TIMES**2)) * np.cos(3 * TIMES + n * np.pi / 2) ** 2
    np.testing.assert_allclose(decay["energy"].sel(output="slider_x"), energy, atol=2e-4)
    np.testing.assert_allclose(decay["energy"].sum("order"), chaos.variance + chaos.mean**2)
    np.testing.assert_allclose(decay["energy_germ"].sum("degree"), [chaos.variance + chaos.mean**2] * 2)
    np.testing.assert_allclose(decay["energy_germ"].sel(germ="rate", output="slider_x"), energy, atol=2e-4)
    assert decay["energy_germ"].sel(germ="phase", degree=1, output="slider_x").max() < 1e-4
    rate = decay["rate"].sel(output="slider_x").values
    assert rate[1] > 1.0 and rate[5] > rate[-1] and rate[-1] < 0.5
    assert np.isnan(decay["rate"].sel(output="$F_{pin}$")).all()
    assert decay["energy"].dims == ("order", "output", "time")


def test_rate_of_a_geometric_decay() -> None:
    """Amplitudes that fall tenfold with each order, or hundredfold with every second: one decade an order."""
    space = GermSpace.of(JointInput.of([RandomVariable("x", chaospy.Normal(0, 1))]))
    axes = extend.labels(["y", "even"], ["x"], [0.0])
    orders = np.arange(9.0)
    amplitudes = np.stack([10.0**-orders, np.where(orders % 2 == 0, 10.0**-orders, 0.0)], axis=1)[:, :, None]
    chaos = PolynomialChaos(amplitudes, np.arange(9)[:, None], space, axes)
    np.testing.assert_allclose(chaos.decay()["rate"].values.ravel(), [1.0, 1.0], atol=0.1)


def test_verdict_without_verification() -> None:
    """Words on the top order: the order, the output as written, since when, how much, and whose input it is."""
    chaos = oscillator(4)
    top = np.sqrt(np.sum(chaos.coefficients[chaos.multi_index.sum(axis=1) == 4][:, 0] ** 2, axis=0))
    share = top / np.maximum(chaos.std[0], 0.01 * chaos.std[0].max())
    since = int(np.flatnonzero(share <= 0.01)[-1]) + 1
    worst = int(share.argmax())
    assert 0 < since < 21
    words, constant = chaos.verdicts()
    assert words == (
        f"order 4 is not enough for slider_x after {TIMES[since]:g} s: {100 * share[worst]:.2g} % of the standard "
        f"deviation is in the terms of the highest order at {TIMES[worst]:g} s, mostly of rate; raise the order"
    )
    assert (
        constant.startswith("$F_{pin}$: the terms of order 4 contribute at most ")
        and "only verification realisations can prove it" in constant
    )
    # a tensor set of order 4 has total degrees up to 8; its order is 4 all the same
    assert oscillator(4, kind="tensor").verdicts()[0].startswith("order 4 is not enough for slider_x after")
    # a passage above the tolerance that does not persist
    space, axes = chaos.space, extend.labels(["y"], chaos.space.inputs, TIMES)
    bump = np.zeros((2, 1, 21))
    bump[1] = np.exp(-(np.linspace(-6, 6, 21) ** 2)) + 1e-9
    passing = PolynomialChaos(
        np.concatenate([bump * 0, bump + 1, bump])[[0, 2, 5]], [[0, 0], [1, 0], [2, 0]], space, axes
    ).verdicts(0.2)[0]
    always = PolynomialChaos([np.ones((1, 21))] * 2, [[0, 0], [0, 1]], space, axes).verdicts()[0]
    assert always.startswith("order 1 is not enough for y at any time: 100 %")
    assert "at some times from" in passing and "mostly of phase" in passing


def test_the_largest_error_is_reported_wherever_it_is() -> None:
    """Also where the last one is above the limit: another number for the same thing stood beside it elsewhere."""
    error = np.array([0.001, 0.085, 0.019])
    assert error_words(error, np.array([0.0, 1.5, 2.0]), 0.01).endswith(" until 1.5 s, 8.5 % at 1.5 s")
