"""One output of one record, and how likely its values are given predictions of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.unknowns import Unknowns

__all__ = ["FREEDOM", "Block", "NormalEquations"]


FREEDOM = 4.0
"""Degrees of freedom of robust noise: a value at ten standard deviations is 1e-4 as dense as one at none, not 1e-22."""

NormalEquations = tuple[Index, Array, Array]
"""Columns of the vector of unknowns, gradient (K, c) and Gauss-Newton Hessian (K, c, c) of the misfit by them."""


@dataclass(frozen=True, eq=False)
class Block:
    """Values of one output in one record.

    The values are a prediction, a bias, and noise: ``values = prediction + modes @ b + e``.  The coefficients b are
    standard normal; they are integrated out where the noise is normal, and sampled where it is robust.
    """

    # record, output, units: of what
    record: str
    output: str
    units: str
    times: Array  # (n,): s; empty for an output without a time
    values: Array  # (n,): what was measured
    row: int  # which output of the study over time, or without a time
    columns: Index  # (n,): which of the times of the study; zeros for an output without a time
    noise: float | None  # standard deviation of e; None: it is one of the unknown levels
    level: int  # which one
    modes: Array  # (n, k): of the bias
    robust: bool  # whether e has the density of Student's t
    first: int  # where b begins in the vector of unknowns, of robust noise
    variance: Array  # (n,): what predictions are uncertain by, besides

    @property
    def timeless(self) -> bool:
        """Whether the output has no time."""
        return not self.times.size

    def part(self, rows: Index) -> Block:
        """Return some of its values."""
        times = self.times if self.timeless else self.times[rows]
        about = {name: getattr(self, name)[rows] for name in ("values", "columns", "modes", "variance")}
        return replace(self, times=times, **about)

    def sigma(self, unknowns: Unknowns, vectors: Array) -> Array:
        """Return the standard deviation of the noise (K,)."""
        if self.noise is not None:
            return np.full(len(vectors), self.noise)
        return unknowns.noise(vectors)[:, self.level]

    def misfit(self, prediction: Array, vectors: Array) -> Array:
        """Return prediction and bias, if that is sampled, minus values (K, n)."""
        found = prediction - self.values
        if self.robust and self.modes.shape[1]:
            found = found + vectors[:, self._coefficients] @ self.modes.T
        return np.asarray(found)

    def log_likelihood(self, misfit: Array, sigma: Array) -> Array:
        """Return the logarithm of the density of the values (K,), from misfits (K, n) and deviations (K,)."""
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
        """Return the logarithm of the density of each value (K, n), a bias that is integrated out left at its mean."""
        variance = sigma[:, None] ** 2 + self.variance
        if self.robust:
            constant = gammaln((FREEDOM + 1) / 2) - gammaln(FREEDOM / 2) - 0.5 * np.log(FREEDOM * np.pi)
            tails = np.log1p(misfit**2 / variance / FREEDOM)
            return np.asarray(constant - 0.5 * np.log(variance) - 0.5 * (FREEDOM + 1) * tails)
        rest = misfit - self.bias(misfit, sigma)
        return np.asarray(-0.5 * (rest**2 / variance + np.log(2 * np.pi * variance)))

    def bias(self, misfit: Array, sigma: Array) -> Array:
        """Return the mean of minus the bias (K, n) given the misfits, where it is integrated out; else zeros."""
        if self.robust or not self.modes.shape[1]:
            return np.zeros_like(misfit)
        variance = sigma[:, None] ** 2 + self.variance
        solved = np.linalg.solve(self._inner(variance), ((misfit / variance) @ self.modes)[..., None])[..., 0]
        return np.asarray(solved @ self.modes.T)

    def drawn(self, prediction: Array, sigma: Array, vectors: Array, generator: np.random.Generator) -> Array:
        """Return values (K, n) as they may have been measured: predictions with bias and noise."""
        found = prediction + self.misfit(np.zeros_like(prediction), vectors) + self.values
        if not self.robust and self.modes.shape[1]:
            found = found + generator.standard_normal((len(found), self.modes.shape[1])) @ self.modes.T
        noise = generator.standard_t(FREEDOM, found.shape) if self.robust else generator.standard_normal(found.shape)
        return np.asarray(found + np.sqrt(sigma[:, None] ** 2 + self.variance) * noise)

    def normal_equations(self, misfit: Array, jacobian: Array, sigma: Array) -> NormalEquations:
        """Return gradient and Hessian of minus the log-likelihood.

        `misfit` (K, n); `jacobian` (K, n, D): derivatives of predictions by the unknown inputs; `sigma` (K,).
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
        """Return the expected information on the normal variable of its noise level, whose log deviates by `spread`."""
        share = FREEDOM / (FREEDOM + 3) if self.robust else 1.0
        return 2.0 * share * len(self.values) * spread**2

    @property
    def _coefficients(self) -> Index:
        return np.arange(self.first, self.first + self.modes.shape[1])

    def _inner(self, variance: Array) -> Array:
        """Return the identity plus modes weighted by one over the variance (K, k, k): Woodbury's inner matrix."""
        if np.all(variance == variance[:1]):
            variance = variance[:1]
        inner = np.einsum("nk,xn,nl->xkl", self.modes, 1.0 / variance, self.modes, optimize=True)
        return np.asarray(inner + np.eye(self.modes.shape[1]))
