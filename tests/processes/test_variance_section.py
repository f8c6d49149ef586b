"""Report section on the shares of the variance."""

from __future__ import annotations

import chaospy

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import CommonPaths, RandomProcess, exponential_covariance, stationary_std
from uqmbd_processes.reporting import VarianceSection
from uqmbd_springs import PointForce, SpringDamper


def test_outputs_without_paths_are_listed_in_one_sentence():
    gust = RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=4.0)
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(1, 4), units="N s/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 36, damping=damping, free_length=1))
    mechanism.add(PointForce("push", body, 0, gust()))
    mechanism.output("largest", uqmbd.maximum(body.position[0]), units="m")
    mechanism.output("deviation", stationary_std(body.position[0]), units="m")
    mechanism.output("speed", stationary_std(body.velocity[0]), units="m/s")
    method = MonteCarlo(samples=32, sobol_indices=True, seed=1)
    tree = uqmbd.Study("s", mechanism, [0.0, 2.0], [method]).run()
    text = VarianceSection().render(tree)
    assert '<th scope="row">largest</th>' in text
    assert "do not depend on the sampled paths: 2 outputs, from deviation to speed." in text
    assert '<th scope="row">deviation</th>' not in text


def test_shares_over_time_are_curves_with_their_intervals():
    gust = RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=4.0)
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(1, 4), units="N s/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 36, damping=damping, free_length=1))
    mechanism.add(PointForce("push", body, 0, gust()))
    mechanism.output("height", body.position[0], units="m")
    tree = uqmbd.Study("s", mechanism, [0.0, 0.5, 1.0], [CommonPaths(order=1, paths=8)]).run()
    text = VarianceSection().render(tree)
    assert "Shares of the variance of height" in text
    assert "95 % interval" in text
