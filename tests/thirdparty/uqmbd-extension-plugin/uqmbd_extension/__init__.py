"""A law of contact and a sampling design, on the public interface of uqmbd and of its plugins only."""

from __future__ import annotations

import uqmbd
from uqmbd_extension.kronecker import Kronecker
from uqmbd_extension.lankarani import lankarani

__all__ = ["Kronecker", "lankarani"]


@uqmbd.hookimpl
def uqmbd_designs() -> list[type[uqmbd.SamplingDesign]]:
    """Return the sampling design; a law of contact needs no hook: it is given to a contact."""
    return [Kronecker]
