"""A Gaussian process with training nodes, and an unscented transform, as propagators of uqmbd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import scipy.linalg
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm, qmc

import uqmbd
from uqmbd.extend import Bounds, CustomSurrogate, sample_dataset, statistics_dataset

__all__ = ["GaussianProcess", "Process", "UnscentedTransform"]

Array = NDArray[np.float64]

LENGTHS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Correlation lengths that are tried, in half ranges of the nodes."""

NUGGET = 1e-10
"""Part of the variance that is added to the diagonal."""


class Process:
    """Mean of a Gaussian process with a squared exponential kernel, about a constant."""

    name: ClassVar[str] = "gaussian-process"
    remedy = "add training nodes"

    def __init__(self, nodes: Array, weights: Array, offset: Array, scale: Array) -> None:
        self.nodes, self.weights = nodes, weights  # (N, I), in units of the scale, and (N, O, T)
        self.offset, self.scale = offset, scale  # (O, T), and (2, I): centre and correlation length of the inputs

    @classmethod
    def fitted(cls, inputs: Array, response: Array) -> Process:
        """Fit the correlation length by the smallest leave-one-out error; inputs (N, I), response (N, O, T)."""
        centre = (inputs.max(axis=0) + inputs.min(axis=0)) / 2
        half = (inputs.max(axis=0) - inputs.min(axis=0)) / 2
        offset = response.mean(axis=0)
        targets = (response - offset).reshape(len(inputs), -1)
        spread = np.maximum(targets.std(axis=0), 1e-12 * np.abs(offset).ravel() + np.finfo(float).tiny)
        found = []
        for length in LENGTHS:
            nodes = (inputs - centre) / (length * half)
            factor = scipy.linalg.cho_factor(kernel(nodes, nodes) + NUGGET * np.eye(len(nodes)))
            weights = scipy.linalg.cho_solve(factor, targets)
            inverse = np.diag(scipy.linalg.cho_solve(factor, np.eye(len(nodes))))
            left_out = weights / inverse[:, None] / spread  # residuals of each node that is left out
            scale = np.stack([centre, length * half])
            found.append((float(np.mean(left_out**2)), nodes, weights, scale))
        _, nodes, weights, scale = min(found, key=lambda one: one[0])
        return cls(nodes, weights.reshape(response.shape), offset, scale)

    def evaluate(self, inputs: Array) -> Array:
        return self.offset + np.tensordot(kernel(self._scaled(inputs), self.nodes), self.weights, 1)

    def gradient(self, inputs: Array) -> Array:
        points = self._scaled(inputs)
        away = points[:, None, :] - self.nodes  # (K, N, I)
        slopes = -away * kernel(points, self.nodes)[:, :, None] / self.scale[1]
        return np.einsum("kni,not->kiot", slopes, self.weights)

    def arrays(self) -> Mapping[str, NDArray[Any]]:
        return {"nodes": self.nodes, "weights": self.weights, "offset": self.offset, "scale": self.scale}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        return cls(arrays["nodes"], arrays["weights"], arrays["offset"], arrays["scale"])

    def _scaled(self, inputs: Array) -> Array:
        scaled: Array = (inputs - self.scale[0]) / self.scale[1]
        return scaled


def kernel(a: Array, b: Array) -> Array:
    """Return the correlations (K, N) of points (K, I) and (N, I)."""
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


@dataclass(frozen=True, kw_only=True)
class GaussianProcess(uqmbd.extend.Propagator):
    """Fit a Gaussian process to nodes that fill the space of the inputs.

    Parameters
    ----------
    nodes : int
        Training nodes, evenly spread up to `reach` standard deviations.
    reach : float
        Of normal inputs; of others up to the same probability.
    verify : int
        Realisations by which the error is stated.
    seed : int
        Of the verification points.
    """

    name: ClassVar[str] = "gaussian-process"
    nodes: Annotated[int, Bounds(4)] = 40
    reach: Annotated[float, Bounds(1)] = 4.0
    verify: Annotated[int, Bounds(4)] = 16
    seed: int = 0

    def obstacle(self, study: uqmbd.Study) -> str | None:
        return None if len(study.mechanism.inputs) else "the mechanism has no random inputs"

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        space = problem.germ_space()
        z = self.reach * (2 * qmc.Halton(space.dimension, scramble=False).random(self.nodes + 1)[1:] - 1)
        found = problem.realise(np.asarray(problem.inputs.from_uniform(norm.cdf(z))))
        points = uqmbd.extend.VerificationPoints.drawn(space, self.verify, self.seed, 1)
        with problem.timed("verification"):
            seen = problem.realise(np.asarray(space.to_inputs(points.germs)))
        failures = found.failures + seen.failures
        if failures:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {failures} of {self.nodes + self.verify} realisations failed; use Monte Carlo, which "
                f"counts failures. Reason: {found.most_frequent_reason() or seen.most_frequent_reason()}"
            )
        with problem.timed("fitting"):
            process = Process.fitted(found.values, found.response)
        surrogate = CustomSurrogate(process, space, problem.labels, points.germs, seen.response, points.weights)
        nodes = sample_dataset(found.response, found.values, problem.labels, status=found.status, kind="nodes")
        return problem.node(
            self,
            surrogate.statistics(),
            nodes=nodes,
            realisations=self.nodes + self.verify,
            counters=found.counters,
            children=surrogate.to_datasets(),
        )


@dataclass(frozen=True, kw_only=True)
class UnscentedTransform(uqmbd.extend.Propagator):
    """Mean and standard deviation from 2 I + 1 sigma points; states no error, and knows no probability.

    Parameters
    ----------
    kappa : float
        Distance of the points: the square root of ``I + kappa`` standard deviations. Default: 3 - I.
    """

    name: ClassVar[str] = "unscented"
    kappa: float | None = None

    def obstacle(self, study: uqmbd.Study) -> str | None:
        return None if len(study.mechanism.inputs) else "the mechanism has no random inputs"

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        size = len(problem.inputs)
        kappa = 3.0 - size if self.kappa is None else self.kappa
        root = np.linalg.cholesky(problem.inputs.covariance)
        steps = np.sqrt(size + kappa) * root.T
        found = problem.realise(problem.inputs.means + np.concatenate([np.zeros((1, size)), steps, -steps]))
        if found.failures:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {found.failures} of {2 * size + 1} realisations failed; use Monte Carlo, which counts "
                f"failures. Reason: {found.most_frequent_reason()}"
            )
        weights = np.full(2 * size + 1, 0.5 / (size + kappa))
        weights[0] = kappa / (size + kappa)
        mean = np.tensordot(weights, found.response, 1)
        std = np.sqrt(np.maximum(np.tensordot(weights, (found.response - mean) ** 2, 1), 0.0))
        statistics = statistics_dataset(problem.labels, mean=mean, std=std)
        nodes = sample_dataset(found.response, found.values, problem.labels, status=found.status, kind="nodes")
        return problem.node(self, statistics, nodes=nodes, realisations=2 * size + 1, counters=found.counters)


@uqmbd.hookimpl
def uqmbd_propagators() -> Sequence[type]:
    return [GaussianProcess, UnscentedTransform]


@uqmbd.hookimpl
def uqmbd_surrogates() -> Sequence[type]:
    return [Process]
