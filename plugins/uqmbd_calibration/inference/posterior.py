"""Posterior density of all unknowns, given predictors of the records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.unknowns import LEVEL_SPREAD, Unknowns

__all__ = ["Linearised", "Posterior", "Predictor"]


Predictor = Callable[[Array], list[Array]]
"""Function that maps standard normal variables of the inputs (K, d) to predictions (K, n) of each block of a case."""

STEP = 1e-3
"""Step of central differences, in standard deviations of the prior."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """Linearisation of the misfit at several points: minus the log-density, and its normal equations."""

    cost: Array  # (K,): minus the log-density
    gradient: Array  # (K, N)
    hessian: Array  # (K, N, N): Gauss-Newton Hessian, with the prior


@dataclass(frozen=True, eq=False)
class Posterior:
    """Prior times likelihood, in the standard normal space of the unknowns."""

    unknowns: Unknowns  # meaning of the columns of a vector
    cases: tuple[MachineRecords, ...]  # records of each machine at each operating point
    predictors: tuple[Predictor, ...]  # one for each case

    def predictions(self, vectors: Array) -> list[list[Array]]:
        """Return predictions (K, n) of each block of each case."""
        return [p(case.normals(vectors)) for p, case in zip(self.predictors, self.cases, strict=True)]

    def log_likelihood(self, vectors: Array, predictions: list[list[Array]] | None = None) -> Array:
        """Return the log-likelihood (K,); minus infinity if a prediction is not finite."""
        found = np.zeros(len(vectors))
        given = self.predictions(vectors) if predictions is None else predictions
        for case, predicted in zip(self.cases, given, strict=True):
            for block, values in zip(case.blocks, predicted, strict=True):
                misfit = block.misfit(values, vectors)
                found += block.log_likelihood(misfit, block.sigma(self.unknowns, vectors))
        return np.where(np.isfinite(found), found, -np.inf)

    def log_density(self, vectors: Array) -> Array:
        """Return the logarithm of the posterior density (K,), up to a constant."""
        return np.asarray(self.log_likelihood(vectors) - 0.5 * (vectors**2).sum(axis=1))

    def with_levels(self, vectors: Array, predictions: list[list[Array]] | None = None) -> Array:
        """Return the vectors (K, N) with each noise level replaced by its most probable value for the inputs."""
        if not self.unknowns.levels:
            return vectors
        found = vectors.copy()
        first = self.unknowns.first_level
        given = self.predictions(vectors) if predictions is None else predictions
        for level in range(len(self.unknowns.levels)):
            own = [
                (block, block.misfit(values, vectors))
                for case, predicted in zip(self.cases, given, strict=True)
                for block, values in zip(case.blocks, predicted, strict=True)
                if block.noise is None and block.level == level
            ]
            median = self.unknowns.levels[level].median

            def density(at: Array, own: list = own, median: float = median) -> Array:  # type: ignore[type-arg]
                sigma = median * np.exp(LEVEL_SPREAD * at)
                return np.asarray(sum(b.log_likelihood(m, sigma) for b, m in own) - 0.5 * at**2)

            best, width = np.zeros(len(vectors)), 4.0
            for _ in range(8):
                grid = best[:, None] + np.linspace(-width, width, 9)
                values = np.stack([density(grid[:, k]) for k in range(9)], axis=1)
                best = grid[np.arange(len(best)), np.argmax(np.where(np.isfinite(values), values, -np.inf), axis=1)]
                width /= 3.0
            found[:, first + level] = best
        return found

    def linearised(self, vectors: Array, steps: Array | float = STEP, *, expected: bool = False) -> Linearised:
        """Return cost, gradient and Hessian at several vectors.

        `vectors` (K, N). `steps` (D,): steps of the central differences, by unknown input. `expected`: whether to
        compute the Hessian for measured values that equal the predictions, for example if there are no measurements
        yet.
        """
        count, wide = vectors.shape
        inputs = len(self.unknowns.inputs)
        h = np.broadcast_to(np.asarray(steps, dtype=float), (inputs,))
        moved = np.repeat(vectors[:, None, :], 2 * inputs + 1, axis=1)
        for k in range(inputs):
            moved[:, 1 + 2 * k, k] += h[k]
            moved[:, 2 + 2 * k, k] -= h[k]
        predicted = self.predictions(moved.reshape(-1, wide))
        cost = 0.5 * (vectors**2).sum(axis=1)
        gradient = vectors.copy()
        hessian = np.tile(np.eye(wide), (count, 1, 1))
        for case, blocks in zip(self.cases, predicted, strict=True):
            for block, flat in zip(case.blocks, blocks, strict=True):
                values = flat.reshape(count, 2 * inputs + 1, -1)
                jacobian = ((values[:, 1::2] - values[:, 2::2]) / (2 * h[:, None])).swapaxes(1, 2)
                misfit = block.misfit(values[:, 0], vectors)
                sigma = block.sigma(self.unknowns, vectors)
                cost -= block.log_likelihood(misfit, sigma)
                met = np.zeros_like(misfit) if expected else misfit
                columns, g, hess = block.normal_equations(met, jacobian, sigma)
                gradient[:, columns] += g
                hessian[:, columns[:, None], columns] += hess
                if block.noise is None:
                    at = self.unknowns.first_level + block.level
                    hessian[:, at, at] += block.level_information(LEVEL_SPREAD)
        return Linearised(np.where(np.isfinite(cost), cost, np.inf), gradient, hessian)

    def part(self, cases: tuple[MachineRecords, ...], predictors: tuple[Predictor, ...]) -> Posterior:
        """Return the posterior density of the same unknowns for other records and predictors."""
        return Posterior(self.unknowns, cases, predictors)
