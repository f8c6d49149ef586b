"""Values of one output in one record, and their likelihood given predictions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.unknowns import Unknowns

__all__ = ["FREEDOM", "Block", "NormalEquations"]


FREEDOM = 4.0
"""Degrees of freedom of Student's t for robust noise. Its density at ten standard deviations is 3e-4 of the maximum;
for normal noise, it is 2e-22."""

NormalEquations = tuple[Index, Array, Array]
"""Indices (c,) of unknowns, with gradient (K, c) and Gauss-Newton Hessian (K, c, c) of minus the log-likelihood."""


@dataclass(frozen=True, eq=False)
class Block:
    """Values of one output in one record.

    The model of the values is ``values = prediction + modes @ b + e``, with bias coefficients b and noise e. The
    coefficients are standard normal; the likelihood integrates over them for normal noise, and they are sampled for
    robust noise.
    """

    # record, output, units: name of the record, name of the output, and its units
    record: str
    output: str
    units: str
    times: Array  # (n,): s; empty for a scalar output
    values: Array  # (n,): measured values
    row: int  # index of the output among the outputs over time, or among the scalar outputs
    columns: Index  # (n,): indices of the times of the study; zeros for a scalar output
    noise: float | None  # standard deviation of e; None: an unknown noise level
    level: int  # index of the unknown noise level
    modes: Array  # (n, k): modes of the bias
    robust: bool  # whether e has a Student's t distribution
    first: int  # for robust noise, index of the first coefficient b in the vector of unknowns
    variance: Array  # (n,): additional variance of the predictions

    @property
    def timeless(self) -> bool:
        """Whether the output is a scalar output, without a time."""
        return not self.times.size

    def part(self, rows: Index) -> Block:
        """Return the block with only the selected values."""
        times = self.times if self.timeless else self.times[rows]
        about = {name: getattr(self, name)[rows] for name in ("values", "columns", "modes", "variance")}
        return replace(self, times=times, **about)

    def sigma(self, unknowns: Unknowns, vectors: Array) -> Array:
        """Return the standard deviation of the noise (K,)."""
        if self.noise is not None:
            return np.full(len(vectors), self.noise)
        return unknowns.noise(vectors)[:, self.level]

    def misfit(self, prediction: Array, vectors: Array) -> Array:
        """Return predictions minus values (K, n), with the bias added if its coefficients are sampled."""
        found = prediction - self.values
        if self.robust and self.modes.shape[1]:
            found = found + vectors[:, self._coefficients] @ self.modes.T
        return np.asarray(found)

    def log_likelihood(self, misfit: Array, sigma: Array) -> Array:
        """Return the log-likelihood (K,) of the values, from misfits (K, n) and standard deviations (K,)."""
        variance = sigma[:, None] ** 2 + self.variance
        squares = misfit**2 / variance
        found = -0.5 * np.log(variance).sum(axis=1)
        if self.robust:
            constant = gammaln((FREEDOM + 1) / 2) - gammaln(FREEDOM / 2) - 0.5 * np.log(FREEDOM * np.pi)
            tails = np.log1p(squares / FREEDOM).sum(axis=1)
            return np.asarray(found + len(self.values) * constant - 0.5 * (FREEDOM + 1) * tails)
        found -= 0.5 * squares.sum(axis=1) + 0.5 * len(self.values) * np.log(2 * np.pi)
        if self.modes.shape[1]:
            inner = self._inner(variance)
            projected = (misfit / variance) @ self.modes
            solved = np.linalg.solve(inner, projected[..., None])[..., 0]
            found += 0.5 * (projected * solved).sum(axis=1) - 0.5 * np.linalg.slogdet(inner)[1]
        return np.asarray(found)

    def each(self, misfit: Array, sigma: Array) -> Array:
        """Return the log-likelihood (K, n) of each value; a bias that is not sampled has its conditional mean."""
        variance = sigma[:, None] ** 2 + self.variance
        if self.robust:
            constant = gammaln((FREEDOM + 1) / 2) - gammaln(FREEDOM / 2) - 0.5 * np.log(FREEDOM * np.pi)
            tails = np.log1p(misfit**2 / variance / FREEDOM)
            return np.asarray(constant - 0.5 * np.log(variance) - 0.5 * (FREEDOM + 1) * tails)
        rest = misfit - self.bias(misfit, sigma)
        return np.asarray(-0.5 * (rest**2 / variance + np.log(2 * np.pi * variance)))

    def bias(self, misfit: Array, sigma: Array) -> Array:
        """Return minus the conditional mean of the bias (K, n), given misfits; zeros if the bias is sampled."""
        if self.robust or not self.modes.shape[1]:
            return np.zeros_like(misfit)
        variance = sigma[:, None] ** 2 + self.variance
        solved = np.linalg.solve(self._inner(variance), ((misfit / variance) @ self.modes)[..., None])[..., 0]
        return np.asarray(solved @ self.modes.T)

    def drawn(self, prediction: Array, sigma: Array, vectors: Array, generator: np.random.Generator) -> Array:
        """Return random values (K, n) from the model of the measurement: predictions with bias and noise."""
        found = prediction + self.misfit(np.zeros_like(prediction), vectors) + self.values
        if not self.robust and self.modes.shape[1]:
            found = found + generator.standard_normal((len(found), self.modes.shape[1])) @ self.modes.T
        noise = generator.standard_t(FREEDOM, found.shape) if self.robust else generator.standard_normal(found.shape)
        return np.asarray(found + np.sqrt(sigma[:, None] ** 2 + self.variance) * noise)

    def normal_equations(self, misfit: Array, jacobian: Array, sigma: Array) -> NormalEquations:
        """Return gradient and Hessian of minus the log-likelihood.

        `misfit` (K, n); `jacobian` (K, n, D): derivatives of predictions with respect to the unknown inputs; `sigma`
        (K,).
        """
        variance = sigma[:, None] ** 2 + self.variance
        columns = np.arange(jacobian.shape[2])
        weights = 1.0 / variance
        if self.robust:
            weights = (FREEDOM + 1) / (FREEDOM + misfit**2 / variance) / variance
            if self.modes.shape[1]:
                modes = np.broadcast_to(self.modes, (len(misfit), *self.modes.shape))
                jacobian = np.concatenate([jacobian, modes], axis=2)
                columns = np.concatenate([columns, self._coefficients])
        weighted = jacobian * weights[:, :, None]
        gradient = (weighted.swapaxes(1, 2) @ misfit[:, :, None])[..., 0]
        hessian = weighted.swapaxes(1, 2) @ jacobian
        if not self.robust and self.modes.shape[1]:
            inner = self._inner(variance)
            cross = np.einsum("nk,xnd->xkd", self.modes, weighted)
            projected = (misfit * weights) @ self.modes
            gradient = gradient - (cross.swapaxes(1, 2) @ np.linalg.solve(inner, projected[..., None]))[..., 0]
            hessian = hessian - cross.swapaxes(1, 2) @ np.linalg.solve(inner, cross)
        return columns, gradient, hessian

    def level_information(self, spread: float) -> float:
        """Return the expected Fisher information on the standard normal variable of the noise level.

        `spread` is the standard deviation of the logarithm of the noise level.
        """
        share = FREEDOM / (FREEDOM + 3) if self.robust else 1.0
        return 2.0 * share * len(self.values) * spread**2

    @property
    def _coefficients(self) -> Index:
        return np.arange(self.first, self.first + self.modes.shape[1])

    def _inner(self, variance: Array) -> Array:
        """Return Woodbury's inner matrix (K, k, k): the identity plus modes weighted by one over the variance."""
        if np.all(variance == variance[:1]):
            variance = variance[:1]
        inner = np.einsum("nk,xn,nl->xkl", self.modes, 1.0 / variance, self.modes, optimize=True)
        return np.asarray(inner + np.eye(self.modes.shape[1]))
