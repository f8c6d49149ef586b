"""First-order perturbation: a mechanism that is linear about its means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import statistics_dataset

__all__ = ["Taylor"]


@dataclass(frozen=True, kw_only=True)
class Taylor(uqmbd.Propagator):
    """Mean at the means of the inputs, variance ``g^T C g`` by the gradient there (central differences).

    Parameters
    ----------
    step : float
        Of the differences, over the standard deviation of each input.
    """

    name: ClassVar[str] = "taylor"
    step: float = 0.1

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say that nothing is random, where it is so."""
        return None if len(study.mechanism.inputs) else "nothing in the mechanism is random"

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Compute the motion at the means and beside them."""
        if not len(problem.inputs):
            raise uqmbd.StudyError(f"{problem.label}: nothing is random; declare a uqmbd.RandomVariable.")
        space = uqmbd.GermSpace.of(problem.inputs, "rosenblatt")
        points = space.to_inputs(uqmbd.monte_carlo_rule(space, 4096, 0, "sobol").nodes)
        covariance = np.atleast_2d(np.cov(points.T))
        steps = self.step * np.sqrt(np.diag(covariance))
        beside = np.concatenate([np.zeros((1, len(steps))), np.diag(steps), -np.diag(steps)])
        found = problem.realise(problem.inputs.means + beside)
        if found.failures:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {len(beside)} motions near the means fail; use Monte Carlo, which "
                f"counts them. Reason: {found.most_frequent_reason()}"
            )
        mean, (ahead, behind) = found.response[0], np.split(found.response[1:], 2)
        gradient = (ahead - behind) / (2 * steps[:, None, None])
        std = np.sqrt(np.einsum("iot,ij,jot->ot", gradient, covariance, gradient).clip(0))
        statistics = statistics_dataset(problem.labels, mean=mean, std=std)
        return problem.node(
            self, statistics, realisations=len(beside), wall_time=found.wall_time, counters=found.counters
        )
