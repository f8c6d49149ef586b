"""What other packages take: results as trees of ArviZ and frames of pandas.

Each module brings its package when it is used.  What uqmbd takes from others (distributions, expansions and rules of
chaospy) is where it belongs: in `uqmbd.randomness` and in collocation.
"""

from __future__ import annotations

from uqmbd.exchange.arviz_tree import to_arviz
from uqmbd.exchange.frames import samples_to_frame, to_frame

__all__ = ["samples_to_frame", "to_arviz", "to_frame"]
