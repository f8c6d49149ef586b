"""Collocation of frequencies and amplitudes, for sums of harmonics of one or two frequencies."""

from __future__ import annotations

from uqmbd_collocation.two_frequency.collocated import expand_series

__all__ = ["expand_series"]
