"""Flexible bodies with small deformations: modal bodies in a floating frame of reference, and uniform beams."""

from __future__ import annotations

import uqmbd
from uqmbd_flexible.beams import Beam
from uqmbd_flexible.figures import mode_shapes
from uqmbd_flexible.files import read_matrix
from uqmbd_flexible.flexible import FlexibleBody, flexible_body
from uqmbd_flexible.maximum_entropy import random_matrices
from uqmbd_flexible.modal_model import ModalModel, NodeShape
from uqmbd_flexible.modes import FlexibleModes
from uqmbd_flexible.reduction import craig_bampton

__all__ = [
    "Beam",
    "FlexibleBody",
    "FlexibleModes",
    "ModalModel",
    "NodeShape",
    "craig_bampton",
    "flexible_body",
    "mode_shapes",
    "random_matrices",
    "read_matrix",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type]:
    """Return the components of this package."""
    return [FlexibleModes]
