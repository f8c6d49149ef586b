"""Conversion of results for other packages: trees of ArviZ and frames of pandas.

Each module imports its package at the first use.  chaospy needs no conversion: `uqmbd.randomness` uses its
distributions, and collocation uses its expansions and rules.
"""

from __future__ import annotations

from uqmbd.exchange.arviz_tree import to_arviz
from uqmbd.exchange.frames import samples_to_frame, to_frame

__all__ = ["samples_to_frame", "to_arviz", "to_frame"]
