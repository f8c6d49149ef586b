"""Means and products of several variables, accumulated chunk by chunk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array

__all__ = ["JointMoments"]


@dataclass(frozen=True)
class JointMoments:
    """Number, means and central products of samples of V variables in C columns.

    Two objects can be merged; the result contains the moments of the samples of both. See Pebay, Formulas for robust,
    one-pass parallel computation of covariances and arbitrary-order statistical moments, Sandia report SAND2008-6212
    (2008).
    """

    count: int
    mean: Array  # (V, C)
    products: Array  # (V, V, C) sums of products of the differences from the means

    @classmethod
    def of(cls, samples: Array) -> JointMoments:
        """Return the moments of samples, shape (S, V, C); S may be zero."""
        _, width, columns = samples.shape
        products = np.zeros((width, width, columns))
        if not len(samples):
            return cls(0, np.zeros((width, columns)), products)
        mean = samples.mean(axis=0)
        d = samples - mean
        for i in range(width):
            for j in range(i + 1):
                products[i, j] = products[j, i] = np.einsum("sc,sc->c", d[:, i], d[:, j])
        return cls(len(samples), mean, products)

    def empty(self) -> JointMoments:
        """Return the moments of an empty set of samples."""
        return JointMoments(0, np.zeros_like(self.mean), np.zeros_like(self.products))

    def merge(self, other: JointMoments) -> JointMoments:
        """Return the moments of the samples of both objects."""
        if not self.count or not other.count:
            return other if not self.count else self
        n = self.count + other.count
        d = other.mean - self.mean
        products = self.products + other.products + d[:, None] * d * (self.count * other.count / n)
        return JointMoments(n, self.mean + d * (other.count / n), products)

    def transformed(self, matrix: Array) -> JointMoments:
        """Return the moments of N linear combinations of the variables, given by a matrix (N, V, C)."""
        left = np.einsum("nvc,vwc->nwc", matrix, self.products)
        products = np.einsum("nwc,mwc->nmc", left, matrix)
        return JointMoments(self.count, np.einsum("nvc,vc->nc", matrix, self.mean), products)
