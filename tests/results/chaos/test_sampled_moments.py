"""Moments of aligned surrogates come from samples of the surrogate: their sampling errors are stated, and limited."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import GermSpace
from uqmbd.results import stated_accuracy
from uqmbd.results.chaos.surrogate_moments import MOMENTS, SampledMoments
from uqmbd.results.chaos.terms import PowerSums
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute


def space():
    """Two uniform germs."""
    mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
    names = "a", "b"
    for name in names:
        mechanism.output(name, uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)))
    return GermSpace.of(mechanism.inputs)


def wave(k, phase):
    """Return cos(k . x + phase) as a function of germ points (K, 2), and its exact mean and standard deviation."""

    def evaluate(germs):
        return np.cos(germs @ k + phase)[:, None, None]

    mean = np.cos(phase) * np.prod(np.sinc(k / np.pi))
    square = 0.5 + 0.5 * np.cos(2 * phase) * np.prod(np.sinc(2 * k / np.pi))
    return evaluate, mean, np.sqrt(square - mean**2)


@pytest.mark.parametrize("largest", [3.0, 60.0, 1500.0])
def test_stated_sampling_errors_hold_for_waves_with_known_moments(largest):
    """cos(k x + phase) over uniform germs has moments in closed form, for slow and for fast waves."""
    rng, held, cases = np.random.default_rng(4), 0, 40
    for _ in range(cases):
        evaluate, mean, std = wave(rng.uniform(-largest, largest, 2), rng.uniform(0, 2 * np.pi))
        moments = SampledMoments(space(), np.zeros((1, 2), int), (1, 1), evaluate, lambda terms, germs: germs)
        errors = moments.sampling_errors[:, 0, 0]
        off = np.abs([moments.mean[0, 0] - mean, moments.spread[0, 0, 0] - std])
        held += bool((off <= 1.96 * errors + 1e-12).all())
        assert (off <= 5 * errors + 1e-12).all()
    assert held >= 0.9 * cases  # two intervals of 95 % each


def test_fast_waves_get_more_samples_and_slow_ones_do_not():
    counts = []
    for k in (3.0, 1500.0):
        evaluate, _, _ = wave(np.array([k, k]), 0.3)
        counts.append(SampledMoments(space(), np.zeros((1, 2), int), (1, 1), evaluate, lambda t, g: g).shape_samples)
    assert counts[0] == MOMENTS < counts[1]


def test_joined_sums_are_the_sums_of_all_samples():
    evaluate, _, _ = wave(np.array([20.0, 7.0]), 0.1)
    germs = np.random.default_rng(1).uniform(-1, 1, (8, 512, 2))
    shift = evaluate(germs[0, :1])[0]
    whole = PowerSums.of(evaluate, germs, shift)
    first = PowerSums.of(evaluate, germs[:, :256], shift)
    both = first.joined(PowerSums.of(evaluate, germs[:, 256:], shift, first.size))
    assert both.count == whole.count == 4096
    x = evaluate(germs.reshape(-1, 2))[:, 0, 0]
    for found in (whole, both):
        assert np.allclose(found.moments[0], x.mean(), rtol=1e-12)
        assert np.allclose(found.moments[1], x.var(), rtol=1e-12)
        assert np.allclose(found.moments[3], np.mean((x - x.mean()) ** 4) / x.var() ** 2, rtol=1e-10)


@pytest.mark.thorough
def test_moments_of_a_pendulum_over_many_turns_are_within_their_stated_errors():
    """The same surrogate, integrated by a Gauss rule of 400 x 12 points: another route to its moments."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.98, 1.02), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(2.0, 3.0), units="rad/s")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body(
        "rod", mass=1.0, inertia=0, position=(0, -length), angle=-sympy.pi / 2, velocity=(speed * length, 0),
        angular_velocity=speed,
    )  # fmt: skip
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length, 0)))
    mechanism.output("height", rod.position[1], units="m")
    study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 60, 6), [])
    node = study.propagate(Collocation(order=4, alignment="phase"))
    statistics = node["statistics"]
    chaos = uqmbd.results.surrogate(node)
    germs, weights = np.polynomial.legendre.leggauss(400)
    other, also = np.polynomial.legendre.leggauss(12)
    names = [variable.name for variable in mechanism.inputs.variables]
    grid = np.stack(np.meshgrid(*((germs, other) if names[0] == "speed" else (other, germs)), indexing="ij"), -1)
    w = np.multiply.outer(*((weights, also) if names[0] == "speed" else (also, weights))).ravel() / 4
    y = chaos.evaluate_germs(grid.reshape(-1, 2))
    mean = np.tensordot(w, y, 1)
    std = np.sqrt(np.tensordot(w, (y - mean) ** 2, 1))
    for name, exact in (("mean", mean), ("std", std)):
        off = np.abs(statistics[name].values - exact)
        assert (off <= 1.96 * statistics[f"std_error_{name}"].values + 1e-9).all()
    assert stated_accuracy(node).value < 2e-3
