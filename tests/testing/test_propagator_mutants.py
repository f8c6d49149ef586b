"""Mutants of sound methods, each with one realistic mistake: `check_propagator` finds every one.

The oracles are exact outputs of small mechanisms and their distributions, and an executor that counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

import uqmbd
from uqmbd.extend import StatedError, sample_dataset, statistics_dataset
from uqmbd.testing import check_propagator
from uqmbd_collocation import Collocation

PROBABILITIES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)


@dataclass(frozen=True, kw_only=True)
class Sampled(uqmbd.extend.Propagator):
    """Monte Carlo by hand; `mistake` names what is wrong with it."""

    name: ClassVar[str] = "sampled"
    seed: int = 0
    count: int = 600
    mistake: str = ""

    def estimate(self, study):
        most = self.mistake == "bound too small"
        told = {"half predicted": self.count // 2, "bound too small": self.count // 3}.get(self.mistake, self.count)
        return uqmbd.extend.Estimate(told, 8 * told, at_most=most)

    def obstacle(self, study):
        return None if len(study.mechanism.inputs) else "nothing is random"

    def propagate(self, problem):
        d = len(problem.inputs)
        if not d:
            raise uqmbd.StudyError(f"{problem.label}: nothing is random; declare a uqmbd.RandomVariable.")
        rng = np.random.default_rng(self.seed)
        uniform = rng.random((self.count, d))
        found = problem.realise(problem.inputs.from_uniform(uniform))
        if len(found.response[found.good]) < 2:
            raise uqmbd.IntegrationError(f"{problem.label}: all fail; use other inputs. {found.most_frequent_reason()}")
        y, n = found.response[found.good], int(found.good.sum())
        mean, std = y.mean(0), y.std(0, ddof=1)
        fourth = ((y - mean) ** 4).mean(0)
        safe = np.where(std > 0, std, 1)
        noise = std / np.sqrt(n), np.sqrt(np.maximum(fourth - std**4, 0) / n) / (2 * safe)
        if self.mistake == "errors of the mean over the number":
            noise = std / n, noise[1]
        if self.mistake == "errors of the deviation over the number":
            noise = noise[0], noise[1] / np.sqrt(n)
        statistics = statistics_dataset(
            problem.labels, mean=mean, std=std, std_error_mean=noise[0], std_error_std=noise[1],
            quantile=self.quantiles(y, mean, std), probability=PROBABILITIES,
        )  # fmt: skip
        if self.mistake == "stated error of another scale":
            statistics = statistics_dataset(
                problem.labels, mean=mean, std=std,
                stated_error=StatedError(np.full(std.shape, 1e-3), "relative", "leave-one-out error"),
            )  # fmt: skip
        if self.mistake == "verification error that nothing verifies":
            statistics["verification_error"] = (statistics["mean"].dims, np.full(std.shape, 1e-9))
        realisations = {"half stated": n // 2, "twice stated": 2 * n}.get(self.mistake, len(y) + found.failures)
        return problem.node(
            self, statistics, self.samples(problem, found, rng), realisations=realisations,
            wall_time=found.wall_time, counters=found.counters, attrs={"failures": found.failures},
        )  # fmt: skip

    def quantiles(self, y, mean, std):
        levels = np.array(PROBABILITIES)
        found = np.quantile(y, levels, axis=0)
        if self.mistake == "quantiles of a normal distribution":
            return mean + norm.ppf(levels)[:, None, None] * std
        if self.mistake == "quantiles of the other tail":
            return found[::-1]
        if self.mistake == "quantiles about zero":
            return found - mean
        if self.mistake == "quantiles of the last time":
            return np.repeat(found[:, :, -1:], found.shape[2], axis=2)
        if self.mistake == "percent for probability":
            return np.quantile(y, levels / 100, axis=0)
        return found

    def samples(self, problem, found, rng):
        inputs, response = found.values, found.response
        if self.mistake == "training points for samples":
            nodes = problem.inputs.from_uniform(0.25 + 0.5 * rng.random(inputs.shape))
            inputs, response = nodes, problem.realise(nodes).response
        if self.mistake == "inputs in another order":
            inputs = rng.permutation(inputs)
        if self.mistake == "responses of other outputs":
            response = response[:, ::-1]
        if self.mistake == "one number for all inputs":
            inputs = problem.inputs.from_uniform(np.repeat(rng.random((len(inputs), 1)), inputs.shape[1], axis=1))
        return sample_dataset(
            response, inputs, problem.labels, status=found.status, messages=found.messages, kind="draws"
        )


@dataclass(frozen=True, kw_only=True)
class Fitted(Collocation):
    """A surrogate of low order, whose error is large enough to be told."""

    order: int = 2
    mistake: str = ""

    def propagate(self, problem):
        node = super().propagate(problem)
        if not self.mistake:
            return node
        statistics, chaos = (node[x].to_dataset() for x in ("statistics", "chaos"))
        if self.mistake == "errors at the nodes of the fit":
            less = 1e-3
            statistics = statistics.assign(verification_error=statistics["verification_error"] * less)
            chaos = chaos.assign(verification_error=chaos["verification_error"] * less)
        if self.mistake == "variance for the error":
            statistics = statistics.assign(verification_error=statistics["verification_error"] ** 2)
            chaos = chaos.assign(verification_error=chaos["verification_error"] ** 2)
        if self.mistake == "a coefficient lost":
            coefficients = chaos["coefficients"].copy(deep=True)
            coefficients[-1] = 0
            chaos = chaos.assign(coefficients=coefficients)
        return node.assign(statistics=xr.DataTree(statistics), chaos=xr.DataTree(chaos))


SAMPLED = {
    "half stated": r"costs: the method computed \d+ realisations, but the attribute 'realisations' is",
    "twice stated": r"costs: the method integrated \d+ realisations, but the attribute 'realisations' is",
    "half predicted": "costs: the method 'estimate' predicts 300 realisations, but 600 were computed",
    "bound too small": "costs: the method 'estimate' predicts at most 200 realisations, but 600 were computed",
    "errors of the mean over the number": "moments: the mean of|stated errors: the mean of",
    "errors of the deviation over the number": "moments: the standard deviation|stated errors: the standard deviation",
    "verification error that nothing verifies": "stated errors: the mean of .* allows",
    "stated error of another scale": "moments: the mean of .*the sum of the stated error|stated errors: the mean of .* allows",
    "quantiles of a normal distribution": "quantiles: the .* quantile of",
    "quantiles of the other tail": "found a quantile that falls with the probability",
    "quantiles about zero": "quantiles: the .* quantile of",
    "quantiles of the last time": "quantiles: the .* quantile of .* at 0 s",
    "percent for probability": "quantiles: the .* quantile of",
    "training points for samples": "samples: the values of the input .* do not have its distribution",
    "inputs in another order": "samples: the response of sample .* but its inputs give",
    "responses of other outputs": "samples: the response of sample",
    "one number for all inputs": "samples: two independent inputs have a correlation of 1",
}
FITTED = {
    "errors at the nodes of the fit": "stated errors: the (mean|surrogate|standard deviation) of .* allows",
    "variance for the error": "stated errors: the (mean|surrogate|standard deviation) of .* allows",
    "a coefficient lost": "stated errors: the surrogate of .* has the error",
}


def kit(propagator, cases):
    """Check moments, distributions, costs and what every method has to do."""
    check_propagator(propagator, moments=cases, failures=False, resume=False, nothing_random=False)


@pytest.mark.parametrize(
    "mistake", [pytest.param(k, marks=() if k == "half stated" else pytest.mark.thorough, id=k) for k in SAMPLED]
)
def test_mistakes_of_sampling_are_found(mistake):
    with pytest.raises(AssertionError, match=SAMPLED[mistake]):
        kit(Sampled(mistake=mistake), ["oscillator" if "normal" in mistake else "stone"])


@pytest.mark.thorough
@pytest.mark.parametrize("mistake", FITTED)
def test_mistakes_of_a_surrogate_are_found(mistake):
    with pytest.raises(AssertionError, match=FITTED[mistake]):
        kit(Fitted(mistake=mistake), ["oscillator"])


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
def test_sound_methods_pass(seed):
    check_propagator(replace(Sampled(), seed=seed))
    kit(Fitted(order=3), True)
