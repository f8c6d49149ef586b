"""Rosenblatt's transform of joint distributions: conditional members, copulas, vectors, mixtures.

chaospy has such transforms. Several are wrong (copulas of Gumbel, Joe and Student, vectors of Student, truncated and
discrete members), and others change from call to call. Here they are computed from the structure of its distributions,
verified, and stored as text.
"""

from __future__ import annotations

from uqmbd.randomness.rosenblatt.expressions import NotUnderstood
from uqmbd.randomness.rosenblatt.independent import rewritten
from uqmbd.randomness.rosenblatt.moments import means_of
from uqmbd.randomness.rosenblatt.supports import supports_of
from uqmbd.randomness.rosenblatt.transform import Transform, in_blocks

__all__ = ["NotUnderstood", "Transform", "in_blocks", "means_of", "rewritten", "supports_of"]
