"""Rosenblatt transform of joint distributions: conditional members, copulas, vectors and mixtures.

chaospy has such transforms. Several are wrong (Gumbel, Joe and Student copulas, Student vectors, truncated and discrete
members), and others change from call to call. This package computes transforms from the structure of chaospy's
distributions, verifies them, and stores them as text.
"""

from __future__ import annotations

from uqmbd.randomness.rosenblatt.expressions import NotUnderstood
from uqmbd.randomness.rosenblatt.independent import rewritten
from uqmbd.randomness.rosenblatt.moments import covariances_of, known_covariance, means_of
from uqmbd.randomness.rosenblatt.supports import supports_of
from uqmbd.randomness.rosenblatt.transform import Transform, in_blocks

__all__ = [
    "NotUnderstood",
    "Transform",
    "covariances_of",
    "in_blocks",
    "known_covariance",
    "means_of",
    "rewritten",
    "supports_of",
]
