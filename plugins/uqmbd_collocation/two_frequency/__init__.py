"""Motions that are sums of harmonics of one or two frequencies, compared by these and by amplitudes."""

from __future__ import annotations

from uqmbd_collocation.two_frequency.collocated import expand_series

__all__ = ["expand_series"]
